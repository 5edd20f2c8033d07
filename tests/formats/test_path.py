"""Path files of all ages, as text (docs/format/companions.md)."""

from __future__ import annotations

import itertools

import numpy as np
import pytest

from env2mjcf.diagnostics import DiagnosticLog
from env2mjcf.errors import Diagnostic, FormatError
from env2mjcf.formats.path import ALL_ROBOTS, TURNS, PathFile, is_path, path_text, read_path
from env2mjcf.formats.source import Source

HEAD = "VIZMO_PATH_FILE   Path Version "


def read(text: str, *dofs: int, links: tuple[int, ...] = (1,)) -> tuple[PathFile, list[Diagnostic]]:
    log = DiagnosticLog()
    return read_path(Source.of("x.path", text), dofs, links, log), list(log)


def rows(text: str, *dofs: int) -> list[tuple[int, tuple[float, ...]]]:
    found, diagnostics = read(text, *dofs)
    assert not [d for d in diagnostics if d.severity != "info"]
    return [(row.robot, row.configuration) for row in found.rows]


def refused(text: str, *dofs: int, links: tuple[int, ...] = (1,)) -> Diagnostic:
    with pytest.raises(FormatError) as caught:
        read(text, *dofs, links=links)
    assert caught.value.span is not None
    assert caught.value.diagnostic.hint
    return caught.value.diagnostic


def test_dialect_a_wrote_six_decimals_and_a_blank_behind_the_count() -> None:
    text = f"{HEAD}20001125\n1\n2 \n0.000000 0.500000 \n1.000000 0.250000 \n"
    assert rows(text, 2) == [(0, (0, 0.5)), (0, (1, 0.25))]


def test_since_2012_the_robot_stands_in_front() -> None:
    text = f"{HEAD}2012\n1\n2\n0   -1.0000000000000000e+01    5.0000000000000000e-01 \n0 1 2\n"
    assert rows(text, 2) == [(0, (-10, 0.5)), (0, (1, 2))]
    assert rows(f"{HEAD}2012\n1\n3\n1 1 2 3\n0 4 5\n1 6 7 8\n", 2, 3) == [(1, (1, 2, 3)), (0, (4, 5)), (1, (6, 7, 8))]


def test_the_newest_planner_writes_no_index() -> None:
    assert rows(f"{HEAD}2012\n1\n1\n0 2 3\n", 3) == [(0, (0, 2, 3))]


def test_a_row_of_all_robots_stands_behind_a_zero_or_not() -> None:
    assert rows(f"{HEAD}2012\n1\n1\n0 1 2 3 4 5 6\n", 3, 3) == [(ALL_ROBOTS, (1, 2, 3, 4, 5, 6))]
    assert rows(f"{HEAD}2012\n1\n1\n1 2 3 4 5 6\n", 3, 3) == [(ALL_ROBOTS, (1, 2, 3, 4, 5, 6))]


def test_a_row_of_robots_that_cannot_move_is_an_index_alone() -> None:
    assert rows(f"{HEAD}2012\n1\n2\n0\n0\n", 0, 0) == [(ALL_ROBOTS, ())] * 2


def test_the_oldest_version_holds_a_pose_for_every_link() -> None:
    poses = "\n".join(f"{i} 0 0 0.25 -0.5 0" for i in range(6))
    found, diagnostics = read(f"{HEAD}20001022\n3\n2\n{poses}\n", 8, links=(3,))
    assert not diagnostics
    assert not found.rows
    assert found.poses is not None
    assert found.poses.shape == (2, 3, 6)
    assert found.poses[1, 2].tolist() == [5, 0, 0, 0.25, -0.5, 0]
    assert found.lines == (4, 7)


def test_a_fixed_base_may_have_no_pose() -> None:
    found, _ = read(f"{HEAD}20001022\n2\n1\n1 2 3 0 0 0\n4 5 6 0 0 0\n", 2, links=(3, 2))
    assert found.poses is not None
    assert found.poses.shape == (1, 2, 6)


def test_the_oldest_version_may_hold_configurations() -> None:
    assert rows(f"{HEAD}20001022\n1\n1\n1 2 3 4 5 6 7 8\n", 8) == [(0, (1, 2, 3, 4, 5, 6, 7, 8))]


@pytest.mark.parametrize("version", [20001022, 20001025])
def test_poses_of_six_numbers_are_told_from_six_degrees_of_freedom_by_the_second_line(version: int) -> None:
    body = "1 2 3 0 0 0\n4 5 6 0 0 0\n"
    assert read(f"{HEAD}{version}\n2\n1\n{body}", 6, links=(2,))[0].poses is not None
    assert len(read(f"{HEAD}{version}\n1\n2\n{body}", 6, links=(2,))[0].rows) == 2


@pytest.mark.parametrize("version", [20001022, 20001125, 2012])
def test_a_second_line_that_lies_is_a_warning(version: int) -> None:
    found, diagnostics = read(f"{HEAD}{version}\n12\n1\n1 2\n", 2, links=(12,))
    assert [d.code for d in diagnostics] == ["CFG513"]
    assert found.rows[0].configuration == (1, 2)
    found, diagnostics = read(f"{HEAD}{version}\n1\n1\n1 2 3 0 0 0\n4 5 6 0 0 0\n", 8, links=(2,))
    assert [d.code for d in diagnostics] == ["CFG513"]
    assert found.poses is not None


@pytest.mark.parametrize("version", [20001125, 2012, 2030, 20001023, 1999])
def test_a_second_line_that_lies_makes_no_poses_of_six_degrees_of_freedom(version: int) -> None:
    found, diagnostics = read(f"{HEAD}{version}\n2\n2\n1 2 3 0 0 0\n4 5 6 0 0 0\n", 6, links=(2,))
    assert len(found.rows) == 2
    assert [d.code for d in diagnostics] == ["CFG512", "CFG513"][version in (20001125, 2012) :]


def test_a_third_line_that_lies_is_a_warning_at_its_place() -> None:
    for count in (1, 3, 10**12):
        found, diagnostics = read(f"{HEAD}20001125\n1\n{count}\n1 2\n3 4\n", 2)
        assert [d.code for d in diagnostics] == ["CFG514"]
        assert diagnostics[0].span is not None
        assert diagnostics[0].span.line == 3
        assert len(found.rows) == 2


@pytest.mark.parametrize("links", [1, 12])
@pytest.mark.parametrize("end", ["0", "0 \n\n"])
def test_an_empty_path_is_valid(links: int, end: str) -> None:
    found, diagnostics = read(f"{HEAD}20001022\n{links}\n{end}", 19, links=(12,))
    assert (found.rows, found.lines, diagnostics) == ((), (), [])


@pytest.mark.parametrize(
    "head",
    [
        "VIZMO_PATH_FILE Path Version 20001125",
        " VIZMO_PATH_FILE   Path Version 20001125 ",
        "vizmo_path_file   path version 20001125",
    ],
)
def test_a_header_with_other_blanks_or_case_is_read_with_a_warning(head: str) -> None:
    found, diagnostics = read(f"{head}\n1\n1\n1 2\n", 2)
    assert len(found.rows) == 1
    assert [d.code for d in diagnostics] == ([] if head.startswith("VIZMO_PATH_FILE   ") else ["CFG511"])


def test_an_unknown_version_is_read_as_its_rows_suggest() -> None:
    found, diagnostics = read(f"{HEAD}2030\n1\n1\n1 2\n", 2)
    assert (found.version, [d.code for d in diagnostics]) == (2030, ["CFG512"])


def test_numbers_may_run_over_lines() -> None:
    assert rows(f"{HEAD}2012\n1\n2\n1 2\n3\n4 5 6\n", 3) == [(0, (1, 2, 3)), (0, (4, 5, 6))]


@pytest.mark.parametrize(
    ("text", "code", "message", "line"),
    [
        ("", "CFG510", "expected 'VIZMO_PATH_FILE   Path Version 2012'", 1),
        ("#####GRAPHSTART#####\n", "CFG510", "found '#####GRAPHSTART#####'", 1),
        (HEAD, "CFG510", "expected 'VIZMO_PATH_FILE   Path Version 2012'", 1),
        (f"{HEAD}2012\n", "CFG515", "the file ends where the number of links", 1),
        (f"{HEAD}2012\n1\n", "CFG515", "the file ends where the number of configurations", 2),
        (f"{HEAD}2012\none\n1\n", "CFG515", "found 'one'", 2),
        (f"{HEAD}2012\n1\n-1\n", "CFG515", "found '-1'", 3),
        (f"{HEAD}2012\n1\n2\n", "CFG514", "declares 2 configurations, and none follows", 3),
        (f"{HEAD}2012\n1\n1\n1 2 3\n", "CFG504", "a row of 3 numbers", 4),
        (f"{HEAD}2012\n1\n1\n1 nan\n", "CFG502", "found 'nan'", 4),
        (f"{HEAD}2012\n1\n1\n1 1e101\n", "CFG502", "found '1e101'", 4),
    ],
)
def test_bad_input_is_refused_where_it_stands(text: str, code: str, message: str, line: int) -> None:
    found = refused(text, 2)
    assert found.code == code
    assert message in found.message
    assert found.span is not None
    assert found.span.line == line


def test_poses_are_as_many_as_divide_the_rows() -> None:
    """A second line that lies: four rows are no poses of three links, with the fixed base, but of two."""
    found, diagnostics = read(f"{HEAD}20001022\n1\n2\n" + "1 2 3 0 0 0\n" * 4, 9, links=(3, 2))
    assert found.poses is not None
    assert found.poses.shape == (2, 2, 6)
    assert [d.code for d in diagnostics] == ["CFG513"]


def test_poses_of_another_robot_are_refused() -> None:
    body = "1 2 3 0 0 0\n" * 4
    assert refused(f"{HEAD}20001022\n4\n1\n{body}", 9, links=(3,)).code == "CFG517"
    assert refused(f"{HEAD}20001022\n3\n1\n{body}", 9, links=(3,)).code == "CFG516"


def test_a_path_is_known_by_its_first_word() -> None:
    assert is_path(Source.of("x", "\n VIZMO_PATH_FILE   Path"))
    assert not is_path(Source.of("x", "1 2 3\n"))


def test_what_is_written_has_the_header_that_the_newest_planner_compares_and_reads_back_exactly() -> None:
    rng = np.random.default_rng(3)
    numbers = [*rng.normal(size=(20, 5)).tolist(), [0.1, -0.0, 1e-300, 5e-324, 1.7976931348623157e29]]
    for version, index in itertools.product((2012, TURNS), (None, 0)):
        text = path_text(numbers, version, index)
        assert text.splitlines()[:3] == [f"VIZMO_PATH_FILE   Path Version {version}", "1", "21"]
        assert [list(c) for _, c in rows(text, 5)] == numbers


@pytest.mark.parametrize(
    "text",
    [
        f"{HEAD}20001125\n1\n3\n0 1 2 3\n4 5 6 7\n8 9 10 11\n",
        f"{HEAD}2012\n1\n3\n0 0 1 2 3\n0 4 5 6 7\n0 8 9 10 11\n",
        f"{HEAD}20001022\n2\n2\n" + "1 2 3 0 0 0\n" * 4,
    ],
)
def test_a_path_that_is_cut_off_never_reads_silently(text: str) -> None:
    for n in range(len(text.rstrip())):
        try:
            found, diagnostics = read(text[:n], 4, links=(2,))
        except FormatError:
            continue
        whole, _ = read(text, 4, links=(2,))
        # A last number that lost digits is a number still.
        assert diagnostics or len(found.lines) == len(whole.lines)
