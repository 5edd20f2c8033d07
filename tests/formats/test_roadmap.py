"""Roadmap files of all ages, as text (docs/format/companions.md)."""

from __future__ import annotations

import pytest

from env2mjcf.diagnostics import DiagnosticLog
from env2mjcf.errors import Diagnostic, FormatError
from env2mjcf.formats.graph import Edge
from env2mjcf.formats.roadmap import RoadmapFile, is_roadmap, read_roadmap, roadmap_text
from env2mjcf.formats.source import Source

OLD_HEAD = """Roadmap Version Number {version}
#####PREAMBLESTART#####
../obprm -f serial -bbox [0,4]
#####PREAMBLESTOP#####
#####ENVFILESTART#####
serial.env
#####ENVFILESTOP#####
#####LPSTART#####
2
straightline
rotate_at_s 0.5
#####LPSTOP#####
#####CDSTART#####
1
RAPID
#####CDSTOP#####
#####DMSTART#####
1
scaledEuclidean 0.9
#####DMSTOP#####
{seed}#####GRAPHSTART#####
"""
SEED = "#####RNGSEEDSTART#####\n1234\n#####RNGSEEDSTOP#####\n"
STOP = "\n#####GRAPHSTOP#####\n"
V061300 = (
    OLD_HEAD.format(version="061300", seed="")
    + "3 2 3\n0 0.5 1.5 1 -1 -1  1 1 1 9  \n1 2.5 3.5 2 -1 0.25  2 0 1 9  2 0 4  \n2 4.5 5.5 -1 -1 -1  1 1 0 4"
    + STOP
)
V041805 = (
    V061300.replace("061300", "041805").replace("#####GRAPHSTART", f"{SEED}#####GRAPHSTART").replace("3 2 3", "3 4 3")
)
V62000 = OLD_HEAD.format(version="62000", seed="") + "2 1 2\n0 0.5 1.5 1 -1 1 1 1 9\n1 2.5 3.5 2 -1 1 0 1 9" + STOP
LEGACY = "#####GRAPHSTART#####\n2 1 2\n0 0.5 1.5 1 1 9.5\n1 2.5 3.5 1 0 9.5" + STOP
V2011 = (
    "PMPL Roadmap Version 041805\n#####PREAMBLESTART#####\n../pmpl -f a.env\n#####PREAMBLESTOP#####\n"
    "#####ENVFILESTART#####\na.env\n#####ENVFILESTOP#####\n#####LPSTART#####\n0\n#####LPSTOP#####\n"
    "#####CDSTART#####\n0\n#####CDSTOP#####\n#####DMSTART#####\n0\n#####DMSTOP#####\n"
    "#####RNGSEEDSTART#####\n0\n#####RNGSEEDSTOP#####\n\n#####GRAPHSTART#####\n"
    "2 2 2\n0 0 0.5 1.5 1 1 1 0 0.7 0.8 2.5\n1 0 2.5 3.5 1 0 1 0 0.7 0.8 2.5" + STOP
)
V2012 = (
    "#####ENVFILESTART#####\na.env\n#####ENVFILESTOP#####\n#####GRAPHSTART#####\n3 4 3\n"
    "0 0    5.0000000000000000e-01    1.5000000000000000e+00  1 1 0 2.0000000000000000e+00  \n"
    "1 0 2.5 3.5 2 0 0 2.0 2 2 0 3.25 4.25 0 4 5 1.5\n"
    "2 0 4.5 5.5 1 1 2 0 4 5 0 3.25 4.25 1.5" + STOP
)
NEWEST = (
    V2012.replace("0 0    5", "0 5").replace("1 0 2.5", "1 2.5").replace("2 2 0 3.25 4.25 0 4 5", "2 2 3.25 4.25 4 5")
)
NEWEST = NEWEST.replace("2 0 4.5 5.5 1 1 2 0 4 5 0 3.25 4.25", "2 4.5 5.5 1 1 2 4 5 3.25 4.25")


def read(text: str, *dofs: int) -> tuple[RoadmapFile, list[Diagnostic]]:
    log = DiagnosticLog()
    return read_roadmap(Source.of("x.map", text), dofs, log), list(log)


def refused(text: str, *dofs: int) -> Diagnostic:
    with pytest.raises(FormatError) as caught:
        read(text, *dofs)
    assert caught.value.span is not None
    assert caught.value.diagnostic.hint
    return caught.value.diagnostic


def test_everything_that_dialect_a_wrote_is_kept() -> None:
    found, diagnostics = read(V061300, 2)
    assert not diagnostics
    head = found.header
    assert (head.version, head.environment, head.preamble) == ("061300", "serial.env", "../obprm -f serial -bbox [0,4]")
    assert head.local_planners == ("straightline", "rotate_at_s 0.5")
    assert (head.collision_detectors, head.distance_metrics, head.seed) == (("RAPID",), ("scaledEuclidean 0.9",), "")
    assert [(n.vid, n.configuration, n.info) for n in found.nodes] == [
        (0, (0.5, 1.5), (1, -1, -1)),
        (1, (2.5, 3.5), (2, -1, 0.25)),
        (2, (4.5, 5.5), (-1, -1, -1)),
    ]
    assert found.nodes[1].edges == (Edge(0, 9, 1), Edge(2, 4, 0))


def test_later_versions_count_each_edge_at_both_ends_and_keep_the_seed() -> None:
    found, diagnostics = read(V041805, 2)
    assert not diagnostics
    assert (found.header.version, found.header.seed) == ("041805", "1234")
    assert found.nodes == tuple(
        type(n)(n.vid, n.robot, n.configuration, n.info, n.edges, n.line + 3) for n in read(V061300, 2)[0].nodes
    )


def test_older_versions_have_fewer_info_fields() -> None:
    assert [n.info for n in read(V62000, 2)[0].nodes] == [(1, -1), (2, -1)]
    found, diagnostics = read(LEGACY, 2)
    assert not diagnostics
    assert [(n.info, n.edges) for n in found.nodes] == [((), (Edge(1, 9.5),)), ((), (Edge(0, 9.5),))]


def test_the_version_of_2011_is_the_name_of_an_older_one() -> None:
    found, diagnostics = read(V2011, 2)
    assert not diagnostics
    assert (found.header.environment, found.header.local_planners) == ("a.env", ())
    assert found.nodes[0].edges == (Edge(1, 2.5, None, ((0.7, 0.8),)),)


@pytest.mark.parametrize("text", [V2012, NEWEST])
def test_since_2012_edges_have_intermediates_with_the_robots_index_or_without(text: str) -> None:
    found, diagnostics = read(text, 2)
    assert not diagnostics
    assert [n.configuration for n in found.nodes] == [(0.5, 1.5), (2.5, 3.5), (4.5, 5.5)]
    assert found.nodes[1].edges == (Edge(0, 2), Edge(2, 1.5, None, ((3.25, 4.25), (4, 5))))
    assert found.nodes[2].edges == (Edge(1, 1.5, None, ((4, 5), (3.25, 4.25))),)


def test_the_index_says_whose_node_it_is() -> None:
    text = "#####GRAPHSTART#####\n2 0 2\n0 1 5 6 7 0\n1 0 8 9 0" + STOP
    assert [(n.robot, n.configuration) for n in read(text, 2, 3)[0].nodes] == [(1, (5, 6, 7)), (0, (8, 9))]


def test_velocities_and_controls_of_nonholonomic_robots_are_dropped_and_told() -> None:
    text = "#####GRAPHSTART#####\n2 1 2\n0 0.5 1.5 0 0 1 1 0 2.5 10 2 engine 0.1 0.2 Coast 0 0\n1 2.5 3.5 0 0 0" + STOP
    found, _ = read(text, 2)
    assert found.dropped == "velocities and controls"
    assert found.nodes[0].edges == (Edge(1, 2.5),)


def test_an_empty_roadmap_is_one() -> None:
    assert read("#####GRAPHSTART#####\n0 0 0" + STOP, 6)[0].nodes == ()


@pytest.mark.parametrize(
    ("text", "code", "line"),
    [
        ("", "CFG520", 1),
        ("1 2 3\n", "CFG520", 1),
        ("#####GRAPHSTART#####\n", "CFG521", 1),
        ("#####GRAPHSTART#####\n1 2\n", "CFG521", 2),
        ("#####GRAPHSTART#####\n1 x 2\n", "CFG521", 2),
        ("#####GRAPHSTART#####\n2 0 2\n0 1 2 0\n", "CFG522", 3),
        ("#####GRAPHSTART#####\n1 0 1\n0 1 2 nan" + STOP, "CFG529", 3),
        ("#####GRAPHSTART#####\n1 0 1\n0 1 2 0.5" + STOP, "CFG529", 3),
        (V061300.replace("0.5 1.5", "0.5 1.5 2.5"), "CFG529", 23),
    ],
)
def test_bad_input_is_refused_where_it_stands(text: str, code: str, line: int) -> None:
    found = refused(text, 2)
    assert found.code == code
    assert found.span is not None
    assert found.span.line == line


@pytest.mark.parametrize(
    ("row", "hint"), [("0 1 2 0.5", "another scene"), ("0 1 2 1e101", "must not be larger"), ("0 1 2 1,5", "point")]
)
def test_what_to_do_about_a_word_depends_on_the_word(row: str, hint: str) -> None:
    assert hint in refused(f"#####GRAPHSTART#####\n1 0 1\n{row}{STOP}", 2).hint


def test_declared_counts_are_compared_and_not_believed() -> None:
    for counts in ("2 2 3", "4 2 3", "3 1 3", "3 3 3", f"{10**15} 2 3", f"3 {10**15} 3"):
        found, diagnostics = read(V061300.replace("3 2 3", counts), 2)
        assert [d.code for d in diagnostics] == ["CFG523"]
        assert len(found.nodes) == 3
    assert refused(LEGACY.replace("1.5 1 1", f"1.5 {10**15} 1"), 2).code in ("CFG522", "CFG529")
    assert refused(NEWEST.replace("1.5000000000000000e+00  1 1 0", f"1.5 1 1 {10**15}"), 2).code in ("CFG522", "CFG529")


def test_a_roadmap_without_end_mark_is_a_warning_and_without_nodes_an_error() -> None:
    assert [d.code for d in read(V061300.replace("#####GRAPHSTOP#####", ""), 2)[1]] == ["CFG524"]
    assert refused(V061300[: V061300.index("2 4.5")], 2).code == "CFG522"


def test_a_section_without_end_is_a_warning() -> None:
    found, diagnostics = read(V061300.replace("#####LPSTOP#####\n", ""), 2)
    assert [d.code for d in diagnostics] == ["CFG530"]
    assert found.header.local_planners == ()


def test_what_is_written_is_read_back_and_counts_edges_as_the_planner_does() -> None:
    nodes = read(V2012, 2)[0].nodes
    for index in (True, False):
        text = roadmap_text(nodes, "a.env", index=index)
        assert text.startswith("#####ENVFILESTART#####\na.env\n#####ENVFILESTOP#####\n#####GRAPHSTART#####\n3 4 3\n0 ")
        assert text.endswith("\n#####GRAPHSTOP#####\n")
        found, diagnostics = read(text, 2)
        assert not diagnostics
        assert [(n.vid, n.configuration, n.edges) for n in found.nodes] == [
            (n.vid, n.configuration, n.edges) for n in nodes
        ]


def test_a_roadmap_is_known_by_the_start_of_its_graph() -> None:
    assert is_roadmap(Source.of("x", V061300))
    assert not is_roadmap(Source.of("x", "1 2 3\n"))


@pytest.mark.parametrize("text", [V061300, V041805, V62000, LEGACY, V2011, V2012, NEWEST])
def test_a_roadmap_that_is_cut_off_never_reads_silently(text: str) -> None:
    words = text.split()
    place = 0
    for word in words[:-1]:
        place = text.index(word, place) + len(word)
        for cut in (text[:place], text[: place - 1]):
            try:
                _, diagnostics = read(cut, 2)
            except FormatError:
                continue
            assert diagnostics, cut[-80:]
