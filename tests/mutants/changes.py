"""Small changes of a module's source that tests should notice: one operator, number or statement at a time."""

from __future__ import annotations

import ast
import hashlib
from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path

_COMPARISONS: dict[type[ast.cmpop], tuple[type[ast.cmpop], ...]] = {
    ast.Lt: (ast.LtE, ast.GtE),
    ast.LtE: (ast.Lt, ast.Gt),
    ast.Gt: (ast.GtE, ast.LtE),
    ast.GtE: (ast.Gt, ast.Lt),
    ast.Eq: (ast.NotEq,),
    ast.NotEq: (ast.Eq,),
    ast.In: (ast.NotIn,),
    ast.NotIn: (ast.In,),
    ast.Is: (ast.IsNot,),
    ast.IsNot: (ast.Is,),
}
_ARITHMETIC: dict[type[ast.operator], type[ast.operator]] = {
    ast.Add: ast.Sub,
    ast.Sub: ast.Add,
    ast.Mult: ast.Div,
    ast.Div: ast.Mult,
    ast.FloorDiv: ast.Mult,
    ast.Mod: ast.Mult,
    ast.Pow: ast.Mult,
    ast.BitAnd: ast.BitOr,
    ast.BitOr: ast.BitAnd,
    ast.LShift: ast.RShift,
    ast.RShift: ast.LShift,
}
_CONDITIONS = (ast.Compare, ast.BoolOp, ast.Constant)


@dataclass(frozen=True)
class Mutant:
    """One change of one module.

    Attributes:
        module: Path of the file below the repository.
        function: Qualified name of the function around it, empty at the module's level.
        line: Where it is, from 1; no part of its name, so that lines above may come and go.
        old: What is replaced, on one line.
        new: What replaces it.
        source: The whole module, changed.
        number: Which of several alike of the same function.
    """

    module: str
    function: str
    line: int
    old: str
    new: str
    source: str
    number: int = 0

    @property
    def name(self) -> str:
        """A name that stays as long as the function has the same text there."""
        again = f" #{self.number + 1}" if self.number else ""
        return f"{self.module}:{self.function}: {self.old} -> {self.new}{again}"

    def rank(self, seed: int) -> str:
        """Return what orders all mutants at random, so that a sample hardly changes with the code."""
        return hashlib.sha256(f"{seed}:{self.name}".encode()).hexdigest()


def mutants(root: Path, module: Path) -> Iterator[Mutant]:
    """Yield every change of a module that can be told apart."""
    text = module.read_text()
    tree = ast.parse(text)
    starts = [0]
    for line in text.encode().splitlines(keepends=True):
        starts.append(starts[-1] + len(line))
    seen: dict[str, int] = {}
    for node, function, changed in _changes(tree.body, ""):
        assert node.end_lineno is not None
        assert node.end_col_offset is not None
        first, last = starts[node.lineno - 1] + node.col_offset, starts[node.end_lineno - 1] + node.end_col_offset
        data = text.encode()
        source = (data[:first] + changed.encode() + data[last:]).decode()
        old = ast.unparse(node).replace("\n", " ")
        found = Mutant(str(module.relative_to(root)), function, node.lineno, old, changed, source)
        number = seen.get(found.name, 0)
        seen[found.name] = number + 1
        yield Mutant(found.module, function, node.lineno, old, changed, source, number)


def _changes(nodes: list[ast.AST] | list[ast.stmt], function: str) -> Iterator[tuple[ast.expr | ast.stmt, str, str]]:
    """Yield (node, function around it, text to put there) of all nodes, and of what is in them."""
    for node in nodes:
        name = function
        if isinstance(node, ast.FunctionDef | ast.AsyncFunctionDef | ast.ClassDef):
            name = f"{function}.{node.name}" if function else node.name
        elif isinstance(node, ast.If) and "TYPE_CHECKING" in ast.unparse(node.test):
            continue
        elif isinstance(node, ast.expr):
            yield from ((node, function, f"({text})") for text in _expressions(node))
        elif isinstance(node, ast.stmt) and _can_go(node):
            yield node, function, "pass"
        if isinstance(node, ast.If | ast.While | ast.IfExp) and not isinstance(node.test, _CONDITIONS):
            bare = isinstance(node.test, ast.UnaryOp)  # `not x` has a change of its own.
            if not bare:
                yield node.test, function, f"(not {ast.unparse(node.test)})"
        yield from _changes(_inside(node), name)


def _inside(node: ast.AST) -> list[ast.AST]:
    """Return the parts of a node that run: neither annotations nor decorators, nor what is written into text."""
    skipped = {"annotation", "returns", "decorator_list", "bases", "keywords" if isinstance(node, ast.ClassDef) else ""}
    # How long the parts of a `zip` are is not what a program that works depends on.
    if isinstance(node, ast.JoinedStr | ast.MatchValue) or (isinstance(node, ast.keyword) and node.arg == "strict"):
        return []
    parts: list[ast.AST] = []
    for name, value in ast.iter_fields(node):
        if name not in skipped:
            values = value if isinstance(value, list) else [value]
            parts += [v for v in values if isinstance(v, ast.AST)]
    return parts


def _can_go(node: ast.stmt) -> bool:
    """Return whether a statement can be left out without a name missing afterwards."""
    if isinstance(node, ast.Expr):
        return not isinstance(node.value, ast.Constant)
    if isinstance(node, ast.Assign):
        return all(isinstance(t, ast.Attribute | ast.Subscript) for t in node.targets)
    return isinstance(node, ast.AugAssign | ast.Raise | ast.Continue | ast.Break)


def _expressions(node: ast.expr) -> Iterator[str]:
    if isinstance(node, ast.Compare):
        for i, operator in enumerate(node.ops):
            for other in _COMPARISONS[type(operator)]:
                ops: list[ast.cmpop] = [*node.ops[:i], other(), *node.ops[i + 1 :]]
                yield ast.unparse(ast.Compare(node.left, ops, node.comparators))
    elif isinstance(node, ast.BinOp) and type(node.op) in _ARITHMETIC:
        yield ast.unparse(ast.BinOp(node.left, _ARITHMETIC[type(node.op)](), node.right))
    elif isinstance(node, ast.BoolOp):
        other = ast.Or() if isinstance(node.op, ast.And) else ast.And()
        yield ast.unparse(ast.BoolOp(other, node.values))
    elif isinstance(node, ast.UnaryOp) and isinstance(node.op, ast.Not | ast.USub):
        yield ast.unparse(node.operand)
    elif isinstance(node, ast.Constant):
        if isinstance(node.value, bool):
            yield repr(not node.value)
        elif isinstance(node.value, int):
            yield repr(node.value + 1)
        elif isinstance(node.value, float):
            yield repr(2 * node.value or 1.0)
