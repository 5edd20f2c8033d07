"""Opening text files: encodings, line ends, places, and everything that is not a text file."""

from __future__ import annotations

import os
import tempfile
import traceback
from collections.abc import Callable
from pathlib import Path

import pytest
from texts import LEGACY, B, Reader, codes, fault, place, warnings, write

import env2mjcf
from env2mjcf.diagnostics import DiagnosticLog
from env2mjcf.errors import FormatError
from env2mjcf.formats.source import Source, read_source
from env2mjcf.limits import Limits

NOBODY = 65534


def test_every_kind_of_line_end_starts_a_line() -> None:
    source = Source.of("x", "a\nbc\r\nd\re")
    assert [(start, line) for start, line in source.lines()] == [(0, "a"), (2, "bc"), (6, "d"), (8, "e")]


def test_a_text_without_characters_has_one_empty_line() -> None:
    assert list(Source.of("x", "").lines()) == [(0, "")]


@pytest.mark.parametrize("end", ["\n", "\r\n", "\r"])
def test_a_span_counts_lines_and_columns_from_one(end: str) -> None:
    text = f"first{end}second word{end}"
    at = text.index("word")
    span = Source.of("x.env", text).span(at, at + 4)
    assert (span.line, span.column, span.length, span.text) == (2, 8, 4, "second word")


def test_a_span_never_leaves_its_line() -> None:
    assert Source.of("x", "one\ntwo\n").span(1, 6).length == 2


def test_the_span_of_a_line_is_that_of_its_first_word_or_of_a_given_one() -> None:
    source = Source.of("x", "a\n  word other\n")
    assert (source.line_span(2).column, source.line_span(2, "other").column) == (3, 8)
    assert source.line_span(99).line == 3


@pytest.mark.parametrize("end", ["\r\n", "\r"])
def test_line_ends_do_not_matter(read: Reader, end: str) -> None:
    assert read(LEGACY.replace("\n", end)) == read(LEGACY)


def test_tabs_are_blanks(read: Reader) -> None:
    assert read(LEGACY.replace(" ", "\t\t")) == read(LEGACY.replace(" ", "  "))


def test_a_byte_order_mark_is_no_part_of_the_text(read: Reader) -> None:
    scene = read(b"\xef\xbb\xbf" + B.encode())
    assert scene == read(B)
    assert not codes(scene)


def test_latin_1_is_read_with_a_warning_at_its_byte(read: Reader) -> None:
    scene = read(B.replace("wall.g", "wände.g").encode("latin-1"))
    assert scene.obstacles[0].bodies[0].filename == "wände.g"
    (warning,) = warnings(scene)
    assert warning.code == "ENV108"
    assert "byte 0xe4 on line 14" in warning.message
    assert (warning.span and warning.span.line, warning.span and warning.span.column) == (14, 2)


def test_strict_refuses_latin_1(read: Reader) -> None:
    found = fault(read, "# é\n".encode("latin-1") + B.encode(), strict=True)
    assert (found.code, found.span and found.span.line) == ("ENV108", 1)


def test_utf_8_names_are_kept(read: Reader) -> None:
    assert read(B.replace("wall.g", "壁.g")).obstacles[0].bodies[0].filename == "壁.g"


@pytest.mark.parametrize("encoding", ["utf-16", "utf-16-le", "utf-16-be", "utf-32", "utf-32-le", "utf-32-be"])
def test_wide_encodings_are_refused_by_name(read: Reader, encoding: str) -> None:
    found = fault(read, B.encode(encoding))
    assert found.code == "ENV106"
    assert f"is {encoding[:6].upper()} text" in found.message


def test_a_binary_file_is_refused_at_its_nul_byte(read: Reader) -> None:
    found = fault(read, b"2\nMulti\x00Body")
    assert found.code == "ENV107"
    assert "line 2 holds a NUL byte" in found.message
    assert found.span is not None
    assert (found.span.line, found.span.column) == (2, 6)


def test_an_empty_file_says_so(read: Reader) -> None:
    for text in ("", "\n \n", "# only a comment\n"):
        found = fault(read, text)
        assert found.code == "ENV130"
        assert "is empty" in found.message
        assert found.span is not None


def test_a_missing_file_names_the_near_one(tmp_path: Path) -> None:
    write(tmp_path, B, "scene.env")
    found = fault(env2mjcf.read, str(tmp_path / "scnee.env"))
    assert found.code == "ENV101"
    assert "did you mean 'scene.env'?" in found.hint


def test_a_link_to_nothing_names_what_it_leads_to(tmp_path: Path) -> None:
    (tmp_path / "link.env").symlink_to("gone.env")
    found = fault(env2mjcf.read, str(tmp_path / "link.env"))
    assert found.code == "ENV101"
    assert found.hint == "it is a link to gone.env, which does not exist"


def test_a_folder_names_the_scenes_in_it(tmp_path: Path) -> None:
    write(tmp_path, B, "scene.env")
    found = fault(env2mjcf.read, str(tmp_path))
    assert found.code == "ENV102"
    assert "expected a file" in found.message
    assert "scene.env" in found.hint


@pytest.mark.parametrize("path", ["a\0b", "x" * 300, "loop/scene.env", "file/scene.env"])
def test_paths_that_cannot_be_opened_are_errors_of_ours(tmp_path: Path, path: str) -> None:
    (tmp_path / "loop").symlink_to("loop")
    write(tmp_path, B, "file")
    assert fault(env2mjcf.read, str(tmp_path / path)).code == "ENV104"


def test_a_file_larger_than_allowed_is_refused(read: Reader) -> None:
    found = fault(read, B, limits=Limits(file_bytes=len(B) - 1))
    assert found.code == "ENV105"
    assert f"more than {len(B) - 1} bytes" in found.message
    assert read(B, limits=Limits(file_bytes=len(B))).robots


def test_a_file_that_may_not_be_read_says_so() -> None:
    with tempfile.TemporaryDirectory() as folder:
        os.chmod(folder, 0o755)
        path = write(Path(folder), B, "scene.env")
        path.chmod(0)

        def read_it() -> None:
            found = fault(lambda name: read_source(name, DiagnosticLog(), Limits()), str(path))
            assert found.code == "ENV103"
            assert "may not be read" in found.message
            assert "permissions" in found.hint

        assert _succeeds_without_privileges(read_it)


def _succeeds_without_privileges(act: Callable[[], None]) -> bool:
    """Whether something succeeds in a child process that is not root, for whom permissions do not count."""
    child = os.fork()
    if child == 0:
        status = 1
        try:
            if os.getuid() == 0:
                os.setuid(NOBODY)
            act()
            status = 0
        except BaseException:
            traceback.print_exc()
        os._exit(status)
    return os.waitstatus_to_exitcode(os.waitpid(child, 0)[1]) == 0


def test_the_place_of_an_error_is_shown_with_its_line_and_a_caret(read: Reader) -> None:
    text = B.replace("Spherical", "Helical")
    with pytest.raises(FormatError) as caught:
        read(text)
    line, column = place(text, "Helical")
    message = str(caught.value)
    assert f"scene.env:{line}:{column}: error ENV121:" in message
    assert "    1 2 Helical\n        ^^^^^^^\n" in message


def test_a_long_text_is_indexed_quickly() -> None:
    source = Source.of("x", "0 0 0\r\n" * 300_000)
    assert source.span(7 * 200_000).line == 200_001
