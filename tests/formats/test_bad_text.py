"""Files that are cut off, jumbled or mutated: they read, or fail with an error of ours that has a place in the file."""

from __future__ import annotations

import re
import time
from collections.abc import Iterator
from pathlib import Path

import pytest
from conftest import CORPUS
from hypothesis import given, settings
from hypothesis import strategies as st
from texts import ENV_TEXTS, PROBLEM, ROBOT, XML_ENVIRONMENT, XML_ROBOT, E, warnings, write

import env2mjcf
from env2mjcf.diagnostics import DiagnosticLog
from env2mjcf.errors import Diagnostic, Env2MjcfError
from env2mjcf.formats.rows import read_query
from env2mjcf.formats.source import Source
from env2mjcf.model.environment import Environment

MODELS = sorted((Path(__file__).parents[2] / "models").glob("*/*.env"))
TOKEN = re.compile(r"\S+\s*")
PIECE = re.compile(r"[^\s\"'<>;:\[\]()]+|\s+|.")
SLOWEST = 10.0

SAMPLES = {**ENV_TEXTS, "xml": XML_ENVIRONMENT, **{f"{p.parent.name}/{p.name}": p.read_text() for p in MODELS}}
ROBOTS = {"text": ROBOT, "xml": XML_ROBOT}
CORPUS_TEXTS = sorted((CORPUS / "texts").glob("*.env")) if CORPUS else []


@pytest.fixture(scope="module")
def folder(tmp_path_factory: pytest.TempPathFactory) -> Path:
    return tmp_path_factory.mktemp("text")


def outcome(folder: Path, text: str, robot: str | None = None, **options: object) -> Environment | Diagnostic:
    """Read a text; whatever else than a scene or an error of ours comes out fails the test."""
    robots = [write(folder, robot, "rob.robot")] if robot is not None else []
    path = write(folder, text, "scene.env")
    got = outcome_of(path, robots=robots, **options)
    if isinstance(got, Diagnostic):
        check_place(got, {str(path): text, **{str(p): robot or "" for p in robots}})
    return got


def outcome_of(path: Path, **options: object) -> Environment | Diagnostic:
    start = time.perf_counter()
    try:
        return env2mjcf.read(path, **options)
    except Env2MjcfError as error:
        return error.diagnostic if str(error) else pytest.fail("an error without a message")
    finally:
        assert time.perf_counter() - start < SLOWEST


def check_place(found: Diagnostic, texts: dict[str, str]) -> None:
    span = found.span
    if span is None:
        assert not texts[next(iter(texts))].strip() or found.code == "ENV110"
        return
    lines = re.split(r"\r\n|\n|\r", texts[span.path].removeprefix("\ufeff"))
    assert 1 <= span.line <= len(lines)
    line = lines[span.line - 1]
    quoted = span.text.removeprefix("...").removesuffix("...") if len(line) > 400 else span.text
    assert quoted in line
    assert len(line) > 400 or quoted == line
    assert 1 <= span.column <= len(line) + 1
    assert span.column + span.length - 1 <= max(1, len(line)) + 1


def cuts(text: str) -> Iterator[str]:
    """Yield a text cut off at every boundary of a token, with and without the blanks behind it."""
    for match in TOKEN.finditer(text):
        yield text[: match.end()].rstrip()
        yield text[: match.end()]


@pytest.mark.parametrize(
    ("name", "behind", "expected"),
    [
        ("A", "FreeBody 1 link1.g\n", "body 3 of 3"),
        ("A", "Connection\n2\n", "connection 1 of 2"),
        ("A", "Revolute 0.5 0 0 0 0 45\n", "connection 2 of 2"),
        ("A", "Revolute 0.5 0 0", "a number (rx)"),
        ("B", "link1.g Joint\n", "body 3 of 3"),
        ("C", "4 5 6 0 90 0\n", "connection 2 of 2"),
        ("D", "Adjacencies\n1\n", "adjacency 1 of 1"),
        ("D", "Boundary Box [-10:10 ; -20:20", "']' after the boundary"),
        ("D-nonholonomic", "1 0 0\n", "control 2 of 3"),
        ("E", "PositionRes 0.05\n", "'Multibodies' or 'Obstacles'"),
    ],
)
def test_a_cut_off_file_says_what_is_missing(folder: Path, name: str, behind: str, expected: str) -> None:
    text = ENV_TEXTS[name]
    cut = text[: text.index(behind) + len(behind)]
    found = outcome(folder, cut)
    assert isinstance(found, Diagnostic)
    assert (found.code, found.hint) == ("ENV111", "is the file cut off?")
    assert found.message.startswith("the file ends where")
    assert f"{expected} was expected" in found.message
    assert found.span is not None
    last = cut.rstrip().splitlines()
    assert (found.span.line, found.span.column) == (len(last), len(last[-1]))


@pytest.mark.parametrize("name", SAMPLES)
def test_no_cut_of_an_environment_reads_silently_as_another(folder: Path, name: str) -> None:
    whole = env2mjcf.read(write(folder, SAMPLES[name], "scene.env"))
    for cut in cuts(SAMPLES[name]):
        got = outcome(folder, cut)
        if isinstance(got, Environment):
            assert got.multibodies == whole.multibodies or warnings(got), f"silent: {cut[-60:]!r}"


@pytest.mark.parametrize("name", ROBOTS)
def test_no_cut_of_a_robot_reads_silently_as_another(folder: Path, name: str) -> None:
    whole = outcome(folder, E, ROBOTS[name])
    assert isinstance(whole, Environment)
    for cut in cuts(ROBOTS[name]):
        got = outcome(folder, E, cut)
        if isinstance(got, Environment):
            assert got.robots == whole.robots or warnings(got), f"silent: {cut[-60:]!r}"


def test_a_cut_problem_is_ill_formed_until_its_problem_is_whole(folder: Path) -> None:
    write(folder, ROBOT.replace("Adjacencies\n1\n0 2\n", ""), "rob.robot")
    write(folder, E, "scene.env")
    end = PROBLEM.index("</Problem>") + len("</Problem>")
    for match in TOKEN.finditer(PROBLEM):
        path = write(folder, PROBLEM[: match.end()], "problem.xml")
        got = outcome_of(path)
        if isinstance(got, Environment):
            assert match.end() >= end
            assert match.end() == len(PROBLEM) or warnings(got)
        else:
            assert match.end() < end
            assert got.code == "ENV140"


@pytest.mark.skipif(not CORPUS_TEXTS, reason="ENV2MJCF_CORPUS does not name the folder of real scenes")
@pytest.mark.parametrize("path", CORPUS_TEXTS, ids=[p.stem for p in CORPUS_TEXTS])
def test_no_cut_of_a_real_file_reads_silently_as_another(folder: Path, path: Path) -> None:
    text = path.read_bytes().decode("latin-1")
    whole = env2mjcf.read(write(folder, text, "scene.env"))
    if whole.declared_multibodies != len(whole.multibodies):
        pytest.skip("a cut of a file whose own count is wrong may be the one whose count is right")
    found = list(cuts(text))
    for cut in found[:: max(1, len(found) // 40)]:
        got = outcome(folder, cut)
        if isinstance(got, Environment):
            assert got.multibodies == whole.multibodies or warnings(got), f"silent: {cut[-60:]!r}"


# Mutations and soups.

WORDS = sorted(
    {w for text in (*ENV_TEXTS.values(), ROBOT) for w in re.findall(r"[^\s;:\[\]]+", text) if not w[:1].isdigit()}
)
NUMBERS = ["0", "1", "2", "3", "-1", "0.5", "1e9", "-1e-300", "1000000000", "99999999999999999999", "9" * 400]
ODD = [
    "nan",
    "-inf",
    "1e999",
    "0x10",
    "1,5",
    "#",
    "# x\n",
    "\n",
    "\t",
    "-",
    "-c(",
    "-a(",
    ")",
    "\ufeff",
    "é",
    "٣",
    "..",
    "1.#INF",
]
PUNCTUATION = ["[", "]", ";", ":", "-1:1", "0:", "(", ")"]
tokens = st.sampled_from([*WORDS, *NUMBERS, *NUMBERS, *ODD, *PUNCTUATION])
dialects = st.sampled_from([None, "A", "B", "C", "D", "E"])
edits = st.lists(
    st.tuples(
        st.sampled_from(["delete", "duplicate", "swap", "replace", "insert"]),
        st.integers(0, 10**6),
        st.integers(0, 10**6),
        tokens,
    ),
    min_size=1,
    max_size=4,
)


def mutated(text: str, changes: list[tuple[str, int, int, str]]) -> str:
    pieces = PIECE.findall(text)
    for what, here, there, token in changes:
        i, j = here % len(pieces), there % len(pieces)
        if what == "delete":
            del pieces[i : i + 1 + there % 3]
        elif what == "duplicate":
            pieces[i:i] = pieces[i : i + 1 + there % 40]
        elif what == "swap":
            pieces[i], pieces[j] = pieces[j], pieces[i]
        elif what == "replace":
            pieces[i] = token
        else:
            pieces.insert(i, f" {token} ")
        pieces = pieces or [" "]
    return "".join(pieces)


@settings(max_examples=300, deadline=None)
@given(st.sampled_from(sorted(SAMPLES)), edits, dialects)
def test_mutated_environments_read_or_fail_as_ours(
    folder: Path, name: str, changes: list[tuple[str, int, int, str]], dialect: str | None
) -> None:
    text = mutated(SAMPLES[name], changes)
    outcome(folder, text, dialect=None if text.lstrip().startswith("<") else dialect)


@settings(max_examples=200, deadline=None)
@given(st.sampled_from(sorted(ROBOTS)), edits)
def test_mutated_robots_read_or_fail_as_ours(folder: Path, name: str, changes: list[tuple[str, int, int, str]]) -> None:
    outcome(folder, E, mutated(ROBOTS[name], changes))


@settings(max_examples=200, deadline=None)
@given(edits)
def test_mutated_problems_read_or_fail_as_ours(folder: Path, changes: list[tuple[str, int, int, str]]) -> None:
    write(folder, E, "scene.env")
    write(folder, ROBOT, "rob.robot")
    outcome_of(write(folder, mutated(PROBLEM, changes), "problem.xml"))


STARTS = [
    "",
    "1\nMultiBody Active\n",
    "2\nActive\n2\n",
    "Boundary Box -1:1 -1:1\nMultibodies\n1\nActive\n1\n",
    "Boundary Box [-1:1 ; -1:1]\nMultibodies\n2\nActive\n1\nx.g ",
    "Boundary Box [-1:1 ; -1:1]\nMultibodies\n1\nNonHolonomic\n1\nx.g Planar Rotational\nConnections\n0\n",
    "Boundary ",
    "<Environment>",
]


@settings(max_examples=300, deadline=None)
@given(st.sampled_from(STARTS), st.lists(tokens, max_size=60), st.sampled_from([" ", "\n", "\r\n"]), dialects)
def test_soups_of_tokens_read_or_fail_as_ours(
    folder: Path, start: str, soup: list[str], blank: str, dialect: str | None
) -> None:
    outcome(folder, start + blank.join(soup), dialect=None if start.startswith("<") else dialect)


@settings(max_examples=200, deadline=None)
@given(st.lists(tokens, max_size=40), st.sampled_from([" ", "\n"]))
def test_soups_of_tokens_are_robots_or_fail_as_ours(folder: Path, soup: list[str], blank: str) -> None:
    outcome(folder, E, blank.join(soup))


@settings(max_examples=300, deadline=None)
@given(
    st.lists(st.sampled_from([*NUMBERS[:6], *NUMBERS[:6], *ODD, "\n", "\n", "//", "text"]), max_size=40),
    st.lists(st.integers(0, 4), max_size=3),
)
def test_soups_of_numbers_are_queries_or_fail_as_ours(soup: list[str], dofs: list[int]) -> None:
    text = " ".join(soup).removeprefix("\ufeff")
    try:
        tasks = read_query(Source.of("x.query", text), dofs, DiagnosticLog())
    except Env2MjcfError as error:
        check_place(error.diagnostic, {"x.query": text})
    else:
        assert all(len(c) == dofs[t.robot] for t in tasks for c in t.configurations)


@settings(max_examples=200, deadline=None)
@given(st.binary(max_size=200))
def test_bytes_read_or_fail_as_ours(folder: Path, data: bytes) -> None:
    outcome_of(write(folder, data, "scene.env"))


@pytest.mark.skipif(not CORPUS_TEXTS, reason="ENV2MJCF_CORPUS does not name the folder of real scenes")
@settings(max_examples=300, deadline=None)
@given(st.integers(0, 10**6), edits)
def test_mutated_real_files_read_or_fail_as_ours(
    folder: Path, which: int, changes: list[tuple[str, int, int, str]]
) -> None:
    text = CORPUS_TEXTS[which % len(CORPUS_TEXTS)].read_bytes().decode("latin-1")
    outcome(folder, mutated(text, changes))
