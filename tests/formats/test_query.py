"""Query files: starts, goals, robot indices, velocities, info fields and text (docs/format/companions.md)."""

from __future__ import annotations

from pathlib import Path

import pytest
from texts import LEGACY, Reader, fault, write

import env2mjcf
from env2mjcf.diagnostics import DiagnosticLog
from env2mjcf.errors import Diagnostic, FormatError
from env2mjcf.formats.rows import read_query, split_row
from env2mjcf.formats.source import Source
from env2mjcf.model.environment import Task


def tasks(text: str, *dofs: int) -> tuple[tuple[Task, ...], list[Diagnostic]]:
    log = DiagnosticLog()
    return read_query(Source.of("x.query", text), dofs, log), list(log)


def configurations(text: str, *dofs: int) -> list[tuple[int, tuple[tuple[float, ...], ...]]]:
    return [(t.robot, t.configurations) for t in tasks(text, *dofs)[0]]


def refused(text: str, *dofs: int) -> Diagnostic:
    with pytest.raises(FormatError) as caught:
        tasks(text, *dofs)
    assert caught.value.diagnostic.hint
    return caught.value.diagnostic


def test_one_configuration_a_line() -> None:
    found, diagnostics = tasks("1 2 3\n4 5 6\n", 3)
    assert found[0].configurations == ((1, 2, 3), (4, 5, 6))
    assert not diagnostics


def test_more_than_two_configurations_are_visited_in_turn() -> None:
    assert len(tasks("1 2\n3 4\n5 6\n7 8\n", 2)[0][0].configurations) == 4


@pytest.mark.parametrize("end", ["\n", "\r\n", "\r", ""])
def test_line_ends_and_a_missing_last_one_do_not_matter(end: str) -> None:
    assert configurations(f"1 2{end or chr(10)}\t3   4{end}", 2) == [(0, ((1, 2), (3, 4)))]


def test_the_robot_index_is_no_coordinate() -> None:
    assert configurations("0 1 2 3\n0 4 5 6\n", 3) == [(0, ((1, 2, 3), (4, 5, 6)))]


def test_the_index_says_whose_configuration_it_is() -> None:
    assert configurations("1 1 2 3\n0 4 5\n1 6 7 8\n0 9 9\n", 2, 3) == [
        (0, ((4, 5), (9, 9))),
        (1, ((1, 2, 3), (6, 7, 8))),
    ]


def test_a_lone_robot_without_index_keeps_a_zero_in_front() -> None:
    assert configurations("0 1 2\n0 3 4\n", 3) == [(0, ((0, 1, 2), (0, 3, 4)))]


def test_a_zero_in_front_of_a_shorter_robot_is_its_index() -> None:
    assert configurations("0 1 2\n0 3 4\n", 2) == [(0, ((1, 2), (3, 4)))]


@pytest.mark.parametrize("row", ["0 1 2 3 9 9 9", "1 2 3 9 9 9"])
def test_velocities_are_dropped_and_reported(row: str) -> None:
    found, diagnostics = tasks(f"{row}\n{row}\n", 3)
    assert found[0].configurations == ((1, 2, 3), (1, 2, 3))
    assert [(d.code, d.severity) for d in diagnostics] == [("CFG507", "info")]
    assert "velocities" in diagnostics[0].message


def test_info_fields_of_dialect_a_are_dropped_and_reported() -> None:
    found, diagnostics = tasks("1 2 3 4 5 6 -1 -1 -1\n1 2 3 4 5 6 -1 -1 -1\n", 6)
    assert found[0].configurations[0] == (1, 2, 3, 4, 5, 6)
    assert "info fields" in diagnostics[0].message


def test_numbers_may_run_over_lines() -> None:
    assert configurations("1 2 3 4\n5\n6 7 8 9 10 11 12\n", 6) == [(0, ((1, 2, 3, 4, 5, 6), (7, 8, 9, 10, 11, 12)))]
    assert configurations("0\n1 2 3 4\n0\n5 6 7 8\n", 4) == [(0, ((1, 2, 3, 4), (5, 6, 7, 8)))]


def test_comments_and_slashes_end_a_line() -> None:
    text = "# start\n1 2 // here\n\n3 4 # goal\n// three extra fields for InfoCfg data\n#units: [0, 1]\n"
    found, diagnostics = tasks(text, 2)
    assert found[0].configurations == ((1, 2), (3, 4))
    assert not diagnostics


def test_text_ends_the_list_where_it_stands() -> None:
    found, diagnostics = tasks("1 2\n3 4 and\n5 6\n", 2)
    assert found[0].configurations == ((1, 2), (3, 4))
    assert [(d.code, d.severity) for d in diagnostics] == [("CFG501", "warning")]
    span = diagnostics[0].span
    assert (span and span.line, span and span.column) == (2, 5)


def test_a_task_knows_its_first_line() -> None:
    (task,) = tasks("# nothing\n\n  1 2\n3 4\n", 2)[0]
    assert (task.span and task.span.line, task.span and task.span.column) == (3, 3)


@pytest.mark.parametrize(
    ("text", "code", "message", "line", "column"),
    [
        ("", "CFG503", "holds no configuration", 1, 1),
        ("# only\n// comments\n", "CFG503", "holds no configuration", 1, 1),
        ("hello\n", "CFG502", "expected a number, found 'hello'", 1, 1),
        ("1 2\n3 nan\n", "CFG502", "expected a number, found 'nan'", 2, 3),
        ("1 2\n-inf 4\n", "CFG502", "expected a number, found '-inf'", 2, 1),
        ("1 2\n3 0x4\n", "CFG502", "expected a number, found '0x4'", 2, 3),
        ("1 2\n3 4,5\n", "CFG502", "expected a number, found '4,5'", 2, 3),
        ("1 2\n3 1e999\n", "CFG502", "expected a number, found '1e999'", 2, 3),
        ("1 2\n3 4.5.6\n", "CFG502", "expected a number, found '4.5.6'", 2, 3),
        ("1 2 3\n4 5 6\n", "CFG504", "a row of 3 numbers; expected as many as a robot has degrees of freedom, 2", 1, 1),
        ("1 2\n3\n", "CFG504", "a row of 1 numbers", 2, 1),
        ("1 2 3\n", "CFG504", "a row of 3 numbers", 1, 1),
    ],
)
def test_bad_input_is_refused_where_it_stands(text: str, code: str, message: str, line: int, column: int) -> None:
    found = refused(text, 2)
    assert found.code == code
    assert message in found.message
    assert (found.span and found.span.line, found.span and found.span.column) == (line, column)


def test_a_scene_without_robots_has_no_queries() -> None:
    assert "the scene has no robot" in refused("1 2\n3 4\n").message
    assert refused("1 2\n", 0).code == "CFG504"


def test_a_robot_that_does_not_exist_is_refused() -> None:
    assert refused("2 1 2\n0 1 2\n", 2, 2).code == "CFG504"
    assert refused("-1 1 2\n0 1 2\n", 2, 2).code == "CFG504"
    assert refused("0.5 1 2\n0 1 2\n", 2, 2).code == "CFG504"


def test_a_lone_configuration_is_a_warning() -> None:
    assert [d.code for d in tasks("1 2 3\n", 3)[1]] == ["CFG508"]


def test_rows_of_different_make_are_a_warning_because_the_last_may_be_cut_off() -> None:
    found, diagnostics = tasks("0 1 2 3\n0 4 5\n", 3)
    assert found[0].configurations == ((1, 2, 3), (0, 4, 5))
    assert [d.code for d in diagnostics] == ["CFG506"]
    assert diagnostics[0].span is not None
    assert diagnostics[0].span.line == 2


@pytest.mark.parametrize("dof", [1, 2, 3, 6, 9])
@pytest.mark.parametrize("index", ["", "0 "])
def test_a_query_that_is_cut_off_never_reads_silently(dof: int, index: str) -> None:
    rows = [f"{index}{' '.join(['0'] * dof)}" for _ in range(3)]
    whole = "\n".join(rows)
    words = whole.split()
    for kept in range(len(words)):
        cut, left = "", kept
        for row in rows:
            cut += " ".join(row.split()[:left]) + "\n"
            left -= min(left, len(row.split()))
        try:
            found, diagnostics = tasks(cut, dof)
        except FormatError:
            continue
        complete = kept % len(rows[0].split()) == 0
        assert complete or diagnostics, f"{cut!r} reads as {found[0].configurations}"


@pytest.mark.parametrize(
    ("numbers", "dofs", "expected"),
    [
        ((1.0, 2.0), (2,), (0, (1.0, 2.0))),
        ((0.0, 1.0, 2.0), (2,), (0, (1.0, 2.0))),
        ((1.0, 1.0, 2.0), (2, 2), (1, (1.0, 2.0))),
        ((1.0, 2.0), (2, 3), (0, (1.0, 2.0))),
        ((1.0, 1.0, 2.0), (2,), None),
        ((), (2,), None),
        ((1.0,), (), None),
    ],
)
def test_split_row_tells_robot_and_configuration(
    numbers: tuple[float, ...], dofs: tuple[int, ...], expected: object
) -> None:
    assert split_row(numbers, dofs) == expected


def test_a_query_comes_with_its_scene(tmp_path: Path, read: Reader) -> None:
    query = write(tmp_path, "1 2 3 0 0 0 .1 5\n1 2 4 0 0 0 .2 6\n", "scene.query")
    scene = read(LEGACY, query=query)
    assert [(t.robot, t.configurations[1][2], t.configurations[1][7]) for t in scene.tasks] == [(0, 4, 6)]
    assert not read(LEGACY).tasks
    found = fault(read, LEGACY, query=tmp_path / "other.query")
    assert (found.code, "did you mean 'scene.query'?" in found.hint) == ("ENV101", True)


def test_a_huge_query_reads_quickly(tmp_path: Path) -> None:
    query = write(tmp_path, "0 0 0 0 0 0 0 0\n" * 20_000, "scene.query")
    scene = env2mjcf.read(write(tmp_path, LEGACY, "scene.env"), query=query)
    assert len(scene.tasks[0].configurations) == 20_000
