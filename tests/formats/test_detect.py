"""The dialect of a file is told from its text, never from its folder or name (docs/format/env.md)."""

from __future__ import annotations

import time

import pytest
from texts import ENV_TEXTS, PROBLEM, ROBOT, XML_ENVIRONMENT, B, C, D, E, Reader, fault, place

from env2mjcf.diagnostics import DiagnosticLog
from env2mjcf.errors import FormatError
from env2mjcf.formats.detect import detect, is_robot_file, is_xml
from env2mjcf.formats.source import Source
from env2mjcf.model.environment import Dialect


def dialect_of(text: str) -> Dialect:
    return detect(Source.of("x.env", text), DiagnosticLog())


@pytest.mark.parametrize("name", ENV_TEXTS)
def test_each_sample_is_what_it_is_called(name: str) -> None:
    assert dialect_of(ENV_TEXTS[name]) is Dialect(name[0])


@pytest.mark.parametrize(
    ("text", "dialect"),
    [
        ("1\nMultiBody Active", "A"),
        ("1 multibody", "A"),
        ("#Environment Version 20001022\n# 3 Active\n1\n#VIZMO_NAME x\nMultBody Active", "A"),
        ("1\nActive\n1\nx.g Planar Rotational", "B"),
        ("1\nPASSIVE x.g", "B"),
        ("1\nInternal x.g", "B"),
        ("1\nSurface x.g", "B"),
        ("1\nPasive x.g", "B"),
        ("1\nActive\n2\na.g Fixed 0 0 0 0 0 0\nb.g Joint\nConnections\n1\n0 1 Revolute -1:1", "C"),
        ("1\nActive\n2\na.g Fixed 0 0 0 0 0 0\nb.g Joint\nConnections\n1\n0 1 SPHERICAL -1:1 0:1", "C"),
        ("Boundary Box -1:1 -1:1", "C"),
        ("boundary\nsphere 0 0 0 5", "C"),
        ("Boundary Sphere .5 0 0 5", "C"),
        ("Boundary Box [-1:1 ; -1:1]\nMultibodies 1 Passive x.g", "E"),
        ("Boundary Box\n# [\n[-1:1 ; -1:1]\nMultibodies 1 Passive x.g", "E"),
        ("Boundary Box2D[-1:1;-1:1]\nMultibodies 1 Internal x.g", "E"),
        ("Boundary [-1:1 ; -1:1]\nObstacles 1 Passive x.g", "E"),
        ("Boundary Box [-1:1 ; -1:1] Multibodies 1 Active 1 x.g", "D"),
        ("Boundary Box [-1:1 ; -1:1]\nMultibodies\n1\nACTIVE\n1 x.g", "D"),
        ("Boundary Box [-1:1 ; -1:1]\nMultibodies\n1\nNonHolonomic\n1 x.g", "D"),
        ("Boundary Box [-1:1 ; -1:1]\nMultibodies\n1\nSurface\nfloor x.g", "D"),
        ("Boundary Box [-1:1 ; -1:1]\nMultibodies\n1\n# Active\nPassive x.g", "E"),
        ("Boundary Box [-1:1 ; -1:1]\nMultibodies\n1\nPassive x.g -a( Surface ) 0 0 0 0 0 0", "E"),
        ("Boundary Box [-1:1 ; -1:1]\nMultibodies\n1\nPassive active.g 0 0 0 0 0 0", "E"),
        ("Bondary Box [-1:1 ; -1:1]\nMultibodies\n1\nPassive x.g", "E"),
    ],
)
def test_the_first_words_tell(text: str, dialect: str) -> None:
    assert dialect_of(text) is Dialect(dialect)


@pytest.mark.parametrize(
    ("text", "code", "message", "line", "column"),
    [
        ("hello world", "ENV130", "found 'hello'; expected a number of multibodies, 'Boundary' or XML", 1, 1),
        ("# 7\n  solid cube\n", "ENV130", "found 'solid'", 2, 3),
        ("3\n\n 4 5 6", "ENV130", "found '4'; expected 'MultiBody', 'Active', 'Passive'", 3, 2),
        ("17", "ENV130", "found '17'; expected 'MultiBody'", 1, 1),
        ("-1 MultiBody", "ENV130", "found '-1'", 1, 1),
        ("\n\n", "ENV130", "is empty; expected an environment", 1, 1),
        ("# 1\n1\nrobot.g Planar", "ENV131", "is a robot file, not an environment", 3, 1),
    ],
)
def test_what_is_no_environment_is_refused_at_its_first_odd_word(
    text: str, code: str, message: str, line: int, column: int
) -> None:
    with pytest.raises(FormatError) as caught:
        dialect_of(text)
    found = caught.value.diagnostic
    assert (found.code, found.span and found.span.line, found.span and found.span.column) == (code, line, column)
    assert message in found.message
    assert found.hint


def test_a_robot_file_says_how_it_is_given(read: Reader) -> None:
    found = fault(read, ROBOT)
    assert found.code == "ENV131"
    assert "--robots" in found.hint
    assert (found.span and found.span.line, found.span and found.span.column) == place(ROBOT, "base.g")


def test_robot_files_and_xml_are_known_by_their_beginning() -> None:
    assert is_robot_file(Source.of("x", "# robot\n" + ROBOT))
    assert not any(is_robot_file(Source.of("x", text)) for text in (*ENV_TEXTS.values(), "", "3"))
    assert is_xml(Source.of("x", "\n " + XML_ENVIRONMENT))
    assert is_xml(Source.of("x", PROBLEM))
    assert not is_xml(Source.of("x", D))


def test_a_forced_dialect_is_believed(read: Reader) -> None:
    assert read(C.replace("Revolute -0.5:0.25", "Revolute"), dialect="B").dialect is Dialect.B
    assert read(E, dialect="D").dialect is Dialect.D
    assert fault(read, B, dialect="A").code == "ENV120"


@pytest.mark.parametrize("text", ["\n" * 300_000, "9" * 1_000_000, "x" * 1_000_000, "Boundary Box [" + "\n" * 300_000])
def test_odd_beginnings_are_judged_quickly(read: Reader, text: str) -> None:
    start = time.perf_counter()
    fault(read, text)
    assert time.perf_counter() - start < 5


def test_many_different_words_are_judged_quickly() -> None:
    text = "Boundary Box [0:1;0:1]\n" + " ".join(f"n{'abcdefghij'[i % 10]}{'x' * (i // 10 % 12)}" for i in range(10**5))
    start = time.perf_counter()
    assert dialect_of(text) is Dialect.E
    assert time.perf_counter() - start < 5
