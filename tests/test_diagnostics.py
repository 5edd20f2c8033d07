"""The catalogue of diagnostic codes and the source agree."""

from __future__ import annotations

import ast
import re
from pathlib import Path

import env2mjcf
from env2mjcf.diagnostics import CATALOGUE

CODE = re.compile(r"(?:ENV|GEO|KIN|MJC|CFG)[0-9]+")
PACKAGE = Path(env2mjcf.__file__).parent


def codes_in(path: Path) -> set[str]:
    """Return the string literals of a module that are codes."""
    tree = ast.parse(path.read_text(encoding="utf-8"))
    words = {n.value for n in ast.walk(tree) if isinstance(n, ast.Constant) and isinstance(n.value, str)}
    return {w for w in words if CODE.fullmatch(w)}


USED = {
    code: path.relative_to(PACKAGE)
    for path in sorted(PACKAGE.rglob("*.py"))
    if path.name != "diagnostics.py"
    for code in codes_in(path)
}


def test_the_scan_finds_codes() -> None:
    assert len(USED) > 50
    assert USED["ENV101"] == Path("formats/source.py")


def test_every_code_in_the_source_has_a_meaning() -> None:
    assert {code: str(path) for code, path in USED.items() if code not in CATALOGUE} == {}


def test_every_meaning_has_a_code_in_the_source() -> None:
    assert sorted(set(CATALOGUE) - set(USED)) == []


def test_no_two_codes_mean_the_same() -> None:
    assert len(set(CATALOGUE.values())) == len(CATALOGUE)


def test_codes_are_well_formed_and_sorted_within_their_family() -> None:
    assert all(CODE.fullmatch(code) for code in CATALOGUE)
    for family in ("ENV", "GEO", "KIN", "MJC", "CFG"):
        codes = [c for c in CATALOGUE if c.startswith(family)]
        assert codes == sorted(codes)


def test_meanings_are_one_sentence() -> None:
    for meaning in CATALOGUE.values():
        assert meaning[-1] == "."
        assert meaning[0].isupper() or meaning[0] == "`" or meaning.startswith("trimesh")
        assert ". " not in meaning
        assert len(meaning) <= 110
