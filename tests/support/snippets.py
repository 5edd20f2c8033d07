"""Runs the examples of a page of the documentation, as a reader would: `tests/support/snippets.py PAGE`.

From top to bottom, in the current folder, where what they write stays:

* ```` ```python ````: run; all blocks of a page share one module. ```` ```text ```` right behind it is what it prints.
* ```` ```console ````: a line that begins with `$ ` is run by a shell, with the next if it ends with `\\`; below it
  stands what it prints. A command that is to fail is written with `|| echo ...`.
* ```` ```{code-block} LANGUAGE ```` with a `:caption:`: written into the file that the caption names.

`...` stands for anything. ```` ```sh ```` and code blocks without caption are not run, nor is Python that needs
more than the extras: a comment before them says why, `<!-- not run: reason -->`.
"""

from __future__ import annotations

import contextlib
import doctest
import io
import os
import re
import subprocess
import sys
import types
from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path

ROOT = Path(__file__).resolve().parents[2]
RUN, SHOWN = ("python", "console"), ("text", "xml", "toml", "yaml")
FENCE = re.compile(r"^(?P<fence>```+)(?P<language>[^\n`]*)\n(?P<body>.*?)^(?P=fence)\n", re.MULTILINE | re.DOTALL)
REASON = re.compile(r"<!-- not run: .+ -->\n+\Z")


@dataclass(frozen=True, slots=True)
class Block:
    """A fenced block of a page.

    Attributes:
        language: What stands behind the fence.
        body: The lines between the fences.
        line: Number of its first line.
        expected: What a Python block prints; None where the page does not say.
        reason: Does the page say why it is not run.
    """

    language: str
    body: str
    line: int
    expected: str | None = None
    reason: bool = False


class Difference(Exception):
    """An example does not do what the page says."""


def blocks(text: str) -> list[Block]:
    """Return the fenced blocks of a page, in order."""
    found: list[Block] = []
    end = -1
    for match in FENCE.finditer(text):
        language = match["language"].strip()
        if language == "text" and found and found[-1].language == "python" and not text[end : match.start()].strip():
            last = found.pop()
            found.append(Block("python", last.body, last.line, match["body"]))
        else:
            line = text.count("\n", 0, match.start("body")) + 1
            reason = REASON.search(text, 0, match.start()) is not None
            found.append(Block(language, match["body"], line, None, reason))
        end = match.end()
    return found


def commands(block: Block) -> Iterator[tuple[int, str, str]]:
    """Yield the line, the words and the output of each command of a console block."""
    lines = block.body.splitlines()
    starts = [i for i, line in enumerate(lines) if line.startswith("$ ")]
    if not starts or starts[0] != 0:
        raise Difference(f"{block.line}: a console block begins with a command, `$ ...`")
    for start, stop in zip(starts, [*starts[1:], len(lines)], strict=True):
        first = start
        while lines[first].endswith("\\"):
            first += 1
        words = "\n".join([lines[start][2:], *lines[start + 1 : first + 1]])
        yield block.line + start, words, "\n".join(lines[first + 1 : stop])


def run_page(page: Path) -> None:
    """Run the examples of a page in the current folder.

    Raises:
        Difference: One does not do what the page says; the message begins with the page and the line.
    """
    module = types.ModuleType("__main__")
    module.__dict__["__name__"] = "__main__"
    # What is pickled by reference to the main module is found there.
    sys.modules["__main__"] = module
    for block in blocks(page.read_text(encoding="utf-8")):
        try:
            run_block(block, module, page)
        except Difference as difference:
            raise Difference(f"{page}:{difference}") from None


def run_block(block: Block, module: types.ModuleType, page: Path) -> None:
    """Run one block."""
    if block.language == "python" and not block.reason:
        printed = run_python(block, module, page)
        if block.expected is not None:
            compare(block.line, block.expected, printed)
    elif block.language == "console":
        for line, words, expected in commands(block):
            compare(line, expected, run_command(line, words))
    elif block.language.startswith("{code-block}") and (file := re.match(r":caption: (\S+)\n\n", block.body)):
        Path(file[1]).parent.mkdir(parents=True, exist_ok=True)
        Path(file[1]).write_text(block.body[file.end() :], encoding="utf-8")


def run_python(block: Block, module: types.ModuleType, page: Path) -> str:
    """Run Python and return what it prints."""
    printed = io.StringIO()
    # Tracebacks name the line of the page.
    code = compile("\n" * (block.line - 1) + block.body, str(page), "exec")
    with contextlib.redirect_stdout(printed):
        exec(code, module.__dict__)
    return printed.getvalue()


def run_command(line: int, words: str) -> str:
    """Run a command as a reader's terminal would, and return what it prints."""
    folder = Path(sys.executable).parent
    environment = {
        **os.environ,
        "PATH": f"{folder}{os.pathsep}{os.environ['PATH']}",
        "PYTHONPATH": str(ROOT),
        "COLUMNS": "100",
        "NO_COLOR": "1",
        "TERM": "dumb",
        "PYTEST_ADDOPTS": "",
    }
    done = subprocess.run(
        ["bash", "-c", words], env=environment, stdout=subprocess.PIPE, stderr=subprocess.STDOUT, check=False
    )
    printed = done.stdout.decode("utf-8", "replace")
    if done.returncode:
        raise Difference(f"{line}: `{words}` ended with status {done.returncode}:\n{printed}")
    return printed


def compare(line: int, expected: str, printed: str) -> None:
    """Compare what is printed with what the page shows, but for blanks at the ends of lines."""
    want, got = ("\n".join(x.rstrip() for x in text.strip("\n").splitlines()) + "\n" for text in (expected, printed))
    if not doctest.OutputChecker().check_output(want, got, doctest.ELLIPSIS):
        raise Difference(f"{line}: the page shows\n{want}but printed was\n{got}")


def main() -> int:
    """Run the page that is named."""
    try:
        run_page(Path(sys.argv[1]).resolve())
    except Difference as difference:
        print(difference, file=sys.stderr)
        return 1
    return 0


if __name__ == "__main__":
    sys.exit(main())
