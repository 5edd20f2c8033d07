"""Tell which assertions of the tests of a git revision are lost or changed in this tree: `same_assertions.py REVISION`.

Compared are `assert` statements, `pytest.raises` blocks and parameters of every function, by its class and name,
wherever its file lies now, as Python reads them: moves, formatting and comments do not count. Other decorators are not
compared, nor values that stand in constants.
"""

from __future__ import annotations

import ast
import subprocess
import sys
from collections import Counter, defaultdict
from pathlib import Path

Asserted = dict[str, Counter[str]]


def asserted(texts: list[str]) -> Asserted:
    """Return what each function asserts, by `Class.name`."""
    found: Asserted = defaultdict(Counter)
    for text in texts:
        visit(ast.parse(text), "", found)
    return found


def visit(node: ast.AST, where: str, found: Asserted) -> None:
    """Collect what is asserted below a node of the function or class `where`."""
    for child in ast.iter_child_nodes(node):
        inner = where
        if isinstance(child, ast.FunctionDef | ast.AsyncFunctionDef | ast.ClassDef):
            inner = f"{where}.{child.name}".strip(".")
            found[inner].update(text for d in child.decorator_list if "parametrize(" in (text := ast.unparse(d)))
        elif isinstance(child, ast.Assert):
            found[where][ast.unparse(child)] += 1
        elif isinstance(child, ast.withitem) and "raises" in (head := ast.unparse(child.context_expr)):
            found[where][head] += 1
        visit(child, inner, found)


def git(*words: str) -> str:
    """Return what git prints."""
    return subprocess.run(["git", *words], capture_output=True, text=True, check=True).stdout


def main(revision: str) -> int:
    """Print what is lost or changed; 1 if anything is."""
    names = [n for n in git("ls-tree", "-r", "--name-only", revision, "tests").splitlines() if n.endswith(".py")]
    before = asserted([git("show", f"{revision}:{name}") for name in names])
    after = asserted([p.read_text(encoding="utf-8") for p in Path("tests").rglob("*.py")])
    everywhere = sum(after.values(), Counter[str]())
    status = 0
    for where, old in before.items():
        new = after.get(where)
        lost = old - (new or Counter())
        # A helper may have moved into another function or class.
        lost = Counter({line: n for line, n in lost.items() if new is not None or everywhere[line] < n})
        if lost or (new is None and not old and where.rpartition(".")[2].startswith("test_")):
            status = 1
            print(f"\n{where or 'at the top of modules'}{'' if new is not None else ': is gone'}")
            print(*(f"  - {line}" for line in lost), sep="\n")
            print(*(f"  + {line}" for line in (new or Counter()) - old), sep="\n")
    return status


if __name__ == "__main__":
    sys.exit(main(*sys.argv[1:]))
