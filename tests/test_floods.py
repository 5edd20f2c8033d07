"""Files made to flood whoever reads them: few words come back, soon, and nothing but errors of this project's own."""

from __future__ import annotations

import json
import random
import subprocess
import sys
import time
from collections.abc import Callable
from pathlib import Path
from typing import ClassVar

import folders
import hostile
import numpy as np
import pytest
from hostile import BOX, ROBOT, problem
from scenes import fault

import env2mjcf
from env2mjcf import Severity
from env2mjcf.cli.main import main
from env2mjcf.diagnostics import DiagnosticLog, few, totals
from env2mjcf.errors import Diagnostic, Span, abridged, did_you_mean, enumeration
from env2mjcf.linting import lint

resource = pytest.importorskip("resource", reason="POSIX")

# Bytes that a hostile file may bring onto both streams.
MOST = 64_000
# Seconds for one file and one verb on a busy machine, and bytes of memory that the process grows by.
SECONDS, MEMORY = 20.0, 300e6
WORD = "w" * 5_000_000


def write(folder: Path, made: hostile.Made) -> Path:
    for name, text in (*hostile.BESIDE.items(), made):
        # Half of a surrogate pair has no bytes.
        (folder / name).write_text(text, encoding="utf-8", errors="replace")
    return folder / made[0]


def words(path: Path, verb: str) -> list[str]:
    more = {
        "convert": [str(path.parent / "out")],
        "translate": ["-o", str(path.parent / "new.env"), "--dialect", "D"],
        "batch": [str(path.parent / "rows.npy"), "-o", str(path.parent / "verdicts.npy")],
        "plan": ["--time", "1"],
    }
    return [verb, str(path), *more.get(verb, [])]


VERBS = ("lint", "info", "convert", "translate", "check", "batch", "plan")


# Kinds whose files have no size that is quick.
QUICK = [k.__name__ for k in hostile.KINDS if k not in (hostile.many_robots, hostile.bodies_of_one_robot)]


@pytest.fixture(scope="module")
def imported(tmp_path_factory: pytest.TempPathFactory) -> None:
    """Import all that the verbs need, so that it does not count."""
    path = write(tmp_path_factory.mktemp("first"), ("hostile.env", f"{BOX}1\n{ROBOT}"))
    assert [main(words(path, verb)) for verb in ("lint", "info", "convert", "translate")] == [0] * 4


@pytest.mark.usefixtures("imported")
class TestRandomFiles:
    def check(self, folder: Path, seed: int, capfd: pytest.CaptureFixture[str], sizes: tuple[int, ...]) -> None:
        rng = random.Random(seed)
        kind = hostile.KINDS[seed % len(hostile.KINDS)]
        path = write(folder, kind(rng, rng.choice(sizes)))
        verb = rng.choice(("lint", "info", "convert", "translate"))
        capfd.readouterr()
        before, began = resource.getrusage(resource.RUSAGE_SELF).ru_maxrss, time.monotonic()
        status = main(words(path, verb))
        seconds = time.monotonic() - began
        grown = 1024 * (resource.getrusage(resource.RUSAGE_SELF).ru_maxrss - before)
        said = "".join(capfd.readouterr())
        where = f"{kind.__name__} {seed} {verb}"
        assert status in (0, 1, 2, 3), f"{where}: {said[-2000:]}"
        assert len(said.encode("utf-8", "replace")) < MOST, where
        assert seconds < SECONDS, where
        assert grown < MEMORY, where

    @pytest.mark.parametrize("kind", [k.__name__ for k in hostile.KINDS])
    @pytest.mark.slow_but(*QUICK)
    def test_are_answered_in_few_words(self, kind: str, tmp_path: Path, capfd: pytest.CaptureFixture[str]) -> None:
        number = [k.__name__ for k in hostile.KINDS].index(kind)
        for seed in (number, number + len(hostile.KINDS), number + 2 * len(hostile.KINDS)):
            self.check(tmp_path, seed, capfd, sizes=(10, 200))

    @pytest.mark.slow
    @pytest.mark.parametrize("block", range(10))
    def test_a_thousand_of_them(self, block: int, tmp_path: Path, capfd: pytest.CaptureFixture[str]) -> None:
        for seed in range(100 * block + 1000, 100 * block + 1100):
            folder = tmp_path / str(seed)
            folder.mkdir()
            self.check(folder, seed, capfd, sizes=(10, 300, 3000))

    @pytest.mark.slow
    @pytest.mark.parametrize("kind", hostile.KINDS)
    def test_the_program_says_no_more(self, kind: Callable[..., hostile.Made], tmp_path: Path) -> None:
        path = write(tmp_path, kind(random.Random(1), 3000))
        np.save(tmp_path / "rows.npy", np.zeros((1, 6)))
        for verb in VERBS:
            for flags in ((), ("--json",), ("--debug",)):
                if verb == "info" and flags == ("--json",):
                    continue  # all facts are asked for there
                said = run(*words(path, verb), *flags)
                assert said.returncode in (0, 1, 2, 3), (verb, flags, said.stderr[-2000:])
                assert len(said.stdout) + len(said.stderr) < MOST, (verb, flags)


def run(*arguments: str) -> subprocess.CompletedProcess[bytes]:
    command = [sys.executable, "-m", "env2mjcf", *arguments]
    return subprocess.run(command, env=folders.ENVIRONMENT, capture_output=True, check=False, timeout=120)


class TestQuotations:
    TEXTS: ClassVar[dict[str, hostile.Made]] = {
        "a word": ("hostile.env", f"{BOX}1\n{WORD}\n"),
        "a file that is one word": ("hostile.env", WORD),
        "words of an attribute": ("hostile.xml", f'<Environment><MultiBody type="{"w " * 2_500_000}"/></Environment>'),
        "a robot": ("hostile.xml", problem(f'<Task label="{WORD}" robot="{WORD}"/>')),
        "the name of a file": ("hostile.xml", problem(f'<Robot label="r" filename="{WORD}"/>')),
        "lines of an attribute": ("hostile.xml", problem("<Task robot='" + "&#10;" * 100_000 + "'/>")),
    }

    @pytest.mark.slow_but("a word", "lines")
    @pytest.mark.parametrize("text", TEXTS)
    def test_are_cut_however_long_the_word_is(self, text: str, tmp_path: Path) -> None:
        found = fault(lambda: env2mjcf.read(write(tmp_path, self.TEXTS[text])))
        assert len(str(found)) < 4000
        assert len(found.diagnostic.message) < 2000

    def test_what_was_expected_behind_a_long_word_stays(self, tmp_path: Path) -> None:
        found = fault(lambda: env2mjcf.read(write(tmp_path, self.TEXTS["words of an attribute"])))
        assert found.diagnostic.message.startswith("unknown type 'w w w")
        assert found.diagnostic.message.endswith("; expected 'passive' or 'internal' or 'surface'")

    def test_what_is_short_is_left_alone(self) -> None:
        text = "/a/path/of/some/length/" + "x" * 200 + "\nand a second line"
        assert abridged(text) == text

    @pytest.mark.parametrize(
        ("text", "expected"),
        [
            ("x" * 1_000_000, "x" * 160 + "..." + "x" * 77),
            ("\n".join(map(str, range(100))), "\n".join(map(str, range(24))) + "\n... and 76 more lines"),
        ],
    )
    def test_keep_their_beginning(self, text: str, expected: str) -> None:
        assert abridged(text) == expected

    def test_lists_say_how_many_are_left(self) -> None:
        assert enumeration(["a", "b", "c"], 2) == "a, b, and 1 more"
        assert enumeration(["a", "b"], 2) == "a, b"

    def test_a_task_for_an_unknown_robot_names_a_few(self, tmp_path: Path) -> None:
        robots = "".join(f'<Robot label="r{i}" filename="robot.xml"/>' for i in range(20_000))
        found = fault(lambda: env2mjcf.read(write(tmp_path, ("p.xml", problem(f'{robots}<Task robot="q"/>')))))
        assert found.diagnostic.message.endswith("'r11', and 19988 more")

    def test_no_word_is_compared_with_all_names(self) -> None:
        assert did_you_mean("abcd", ["abce"]) == "did you mean 'abce'?"
        assert did_you_mean("w" * 5_000_000, ["www"]) == ""
        assert did_you_mean("abcd", (f"{i:04}" for i in range(10**9))) == ""


def finding(number: int, code: str = "ENV120", severity: Severity = Severity.WARNING) -> Diagnostic:
    return Diagnostic(code, severity, "subject", f"finding {number}", span=Span("a.env", number + 1, 1, text="line"))


class TestManyFindings:
    @pytest.fixture
    def log(self) -> DiagnosticLog:
        log = DiagnosticLog()
        for i in range(20_000):
            log.warn("ENV120", "subject", f"finding {i}", span=Span("a.env", i + 1, 1, text="line"))
        log.info("ENV310", "subject", "another")
        return log

    def test_the_first_are_kept_and_the_others_counted(self, log: DiagnosticLog) -> None:
        listed = list(log)
        assert len(listed) == len(log) == 1002
        assert [d.message for d in listed[:1000]] == [f"finding {i}" for i in range(1000)]
        (others,) = [d for d in listed if d.times > 1]
        assert (others.code, others.times, others.severity) == ("ENV120", 19_000, Severity.WARNING)
        assert others.span is not None
        assert others.span.line == 1001
        assert others.message == "19000 more findings of this code are not listed; 20000 in all"
        assert totals(log) == {"ENV120": 20_000, "ENV310": 1}

    def test_nothing_is_lost_from_log_to_log(self, log: DiagnosticLog) -> None:
        second = DiagnosticLog()
        second.extend(log)
        assert list(second) == list(log)
        second.extend(log)
        assert totals(second) == {"ENV120": 40_000, "ENV310": 2}

    def test_an_error_carries_what_is_kept(self, log: DiagnosticLog) -> None:
        found = fault(lambda: log.fail("ENV101", "x", "gone"))
        assert len(found.diagnostics) == 1003
        assert found.diagnostics[-1] is found.diagnostic

    def test_few_are_shown_and_all_are_counted(self, log: DiagnosticLog) -> None:
        found = fault(lambda: log.fail("ENV120", "x", "the end"))
        shown = few(found.diagnostics)
        assert [d.message for d in shown[:10]] == [f"finding {i}" for i in range(10)]
        assert shown[-1].message == "the end"
        assert totals(shown) == totals(found.diagnostics) == {"ENV120": 20_001, "ENV310": 1}
        assert len(shown) == 13

    def test_many_codes_are_a_page_or_two_all_the_same(self) -> None:
        many = [finding(i, f"ENV{100 + i % 99}") for i in range(5000)]
        assert totals(few(many)) == totals(many)
        assert len("\n".join(map(str, few(many)))) < 20_000

    def test_strict_still_ends_at_the_first(self) -> None:
        assert fault(lambda: DiagnosticLog(strict=True).warn("ENV120", "x", "first")).diagnostic.message == "first"

    def test_a_scene_has_what_is_kept(self, tmp_path: Path) -> None:
        attributes = " ".join(f"a{i}=''" for i in range(20_000))
        found = env2mjcf.read(write(tmp_path, ("x.xml", f"<Environment {attributes}/>"))).diagnostics
        assert totals(found) == {"ENV311": 20_000, "ENV310": 1}
        assert len(found) == 1002


class TestLint:
    @pytest.fixture
    def scene(self, tmp_path: Path) -> str:
        attributes = " ".join(f"a{i}=''" for i in range(2000))
        return str(write(tmp_path, ("x.xml", f"<Environment {attributes}/>")))

    def test_ends_with_totals_by_code(self, scene: str, capsys: pytest.CaptureFixture[str]) -> None:
        assert main(["lint", scene]) == 0
        *_, more, first, second, summary = capsys.readouterr().out.splitlines()
        assert more.endswith("info ENV311: 1990 more findings of this code are not listed; 2000 in all")
        assert (first, second, summary) == ("ENV311 2000", "ENV310 1", "1 file: 0 errors, 0 warnings, 2001 notes")

    def test_so_it_does_as_json(self, scene: str, capsys: pytest.CaptureFixture[str]) -> None:
        assert main(["lint", scene, "--json"]) == 0
        found = json.loads(capsys.readouterr().out)
        assert (found["codes"], found["notes"]) == ({"ENV311": 2000, "ENV310": 1}, 2001)
        assert sum(d["times"] for d in found["files"][0]["diagnostics"]) == 2001
        assert len(found["files"][0]["diagnostics"]) == 12

    def test_shows_what_is_kept_on_request(self, scene: str, capsys: pytest.CaptureFixture[str]) -> None:
        assert main(["lint", scene, "--verbose"]) == 0
        out = capsys.readouterr().out
        assert out.count("info ENV311: attribute") == 1000
        assert "info ENV311: 1000 more" in out

    def test_the_api_counts_all(self, scene: str) -> None:
        (result,) = lint([scene])
        assert result.count(Severity.INFO) == 2001


def seconds(call: Callable[[], object]) -> float:
    began = time.process_time()
    call()
    return time.process_time() - began


def robots_with_tasks(n: int) -> str:
    robots = "".join(f'<Robot label="r{i}" filename="robot.xml"/>' for i in range(n))
    point = '<StartConstraints><CSpaceConstraint point="0 0 0 0 0 0"/></StartConstraints>'
    return problem(robots + "".join(f'<Task robot="r{i}">{point}</Task>' for i in range(n)))


def flat_robot(n: int) -> str:
    joints = "".join(f"0 {i + 1} Revolute -1:1\n{'0 ' * 16}\n" for i in range(n - 1))
    bodies = "cube.g Volumetric Rotational\n" + "cube.g Joint\n" * (n - 1)
    return f"{BOX}1\nActive\n{n}\n{bodies}Connections\n{n - 1}\n{joints}"


@pytest.mark.slow
class TestGrowth:
    """Four times as much takes about four times as long, where a square would take sixteen."""

    TEXTS: ClassVar[dict[str, tuple[int, str, Callable[[int], str]]]] = {
        "robots with tasks": (1000, "x.xml", robots_with_tasks),
        "unknown tags": (
            5000,
            "x.xml",
            lambda n: f"<Environment>{''.join(f'<Tag{i}/>' for i in range(n))}</Environment>",
        ),
        # Above, the pairs that are counted weigh.
        "links": (1000, "x.env", flat_robot),
        "bases": (
            1000,
            "x.env",
            lambda n: f"1\nMultiBody Active\n{n}\n" + "FreeBody 0 cube.g 0 0 0 0 0 0\n" * n + "Connection\n0\n",
        ),
        "missing meshes": (
            1000,
            "x.env",
            lambda n: f"{BOX}{n}\n" + "".join(f"Passive\nm{i}.g 1 2 3 0 0 0\n" for i in range(n)),
        ),
    }

    @pytest.mark.parametrize("text", TEXTS)
    def test_is_not_quadratic(self, text: str, tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
        n, name, make = self.TEXTS[text]

        def info(count: int) -> float:
            path = write(tmp_path, (name, make(count)))
            return min(seconds(lambda: main(["info", str(path), "--limits.pairs", "2"])) for _ in range(2))

        info(10)
        once, often = info(n), info(4 * n)
        capsys.readouterr()
        assert often < 8 * once + 0.2
