"""Asks a scene about all rows of a file, block by block, and goes on where an earlier run of the same batch stopped."""

from __future__ import annotations

import hashlib
import json
import time
from collections.abc import Callable
from concurrent.futures import Executor
from dataclasses import dataclass
from pathlib import Path
from typing import Any, Literal, get_args

import numpy as np
from numpy.lib.format import MAGIC_PREFIX
from numpy.typing import NDArray

from ..companions.arrays import MappedRows, open_rows
from ..contact.threads import thread_count
from ..options import PathArgument
from ..simulation.scene import Scene
from ..system.files import refuse_foreign, refuse_unwritable
from ..system.imports import installed_version
from .journal import Partial, Progress, unfinished_files

What = Literal["collision", "valid", "clearance"]
WHAT: tuple[What, ...] = get_args(What)

# A block is what is asked about at once. It ends in a moment when only some workers have something to do, so it is
# long; it is held in memory, so it is not large.
_SECONDS = 5.0
_FIRST, _GROWTH = 10_000, 8
_BYTES = 64_000_000
# What a crash may cost.
_COMMIT_SECONDS = 0.5


@dataclass(frozen=True, slots=True)
class BatchResult:
    """What a batch came to.

    Attributes:
        output: The file with one answer for each row.
        what: What was asked.
        rows: Number of rows.
        counts: How many rows are "in collision" and "free", or "valid" and "invalid".
        least: The least clearance in metres; None where clearance was not asked for, or there are no rows.
        resumed: Rows that an earlier run had answered.
        seconds: How long this run took for the others.
    """

    output: Path
    what: What
    rows: int
    counts: dict[str, int]
    least: float | None
    resumed: int
    seconds: float

    @property
    def rate(self) -> float:
        """Rows a second in this run."""
        return (self.rows - self.resumed) / max(self.seconds, 1e-9)


def run(
    scene: Scene,
    configurations: PathArgument,
    output: PathArgument,
    what: What = "collision",
    *,
    file_units: bool = False,
    threads: int | None = None,
    executor: Executor | None = None,
    advance: Callable[[int, int], None] | None = None,
    say: Callable[[str], None] | None = None,
) -> BatchResult:
    """Write an answer for each configuration of a NumPy file to another one; neither needs to fit into memory.

    The output appears when it is whole. Until then there are `<output>.partial` and `<output>.journal`, from which the
    same call goes on after a crash, if the scene, its options and the rows that are done are the same; else it begins
    anew. Files of these names that no batch has left are kept, and the call refused.

    Args:
        scene: The scene to ask.
        configurations: A .npy file of (n, dim) numbers, metres and radians.
        output: A .npy file, of (n,) bools or, for clearances, floats; replaced if it exists and is one.
        what: "collision", "valid" or "clearance".
        file_units: The numbers are the env file's own.
        threads: As for `Scene.in_collision`, n being the rows of the file.
        executor: As for `Scene.in_collision`.
        advance: Is told how many rows are done, and how many there are.
        say: Is told in a sentence where the work begins, if not at an untouched beginning.

    Raises:
        FormatError: The file is not one of finite configurations; the message says which row and number is wrong.
        ConversionError: The output cannot be written, another process is writing it, or a foreign file has one of the
            names.
        ValueError: `what` is something else.
    """
    if what not in WHAT:
        raise ValueError(f"what={what!r} is not one of {', '.join(map(repr, WHAT))}")
    source = open_rows(str(configurations), scene.space, file_units)
    target = Path(output)
    refuse_unwritable(target, "CFG509", [configurations])
    for beside in unfinished_files(target):
        refuse_unwritable(beside, "CFG509", [configurations])
    refuse_foreign(target, "CFG509", "a NumPy file", lambda beginning: beginning.startswith(MAGIC_PREFIX))
    count = None if executor is not None and threads is None else thread_count(threads, len(source))
    job = identity(scene, what, file_units)
    partial = Partial(target)
    try:
        work = _Work(scene, source, partial, job, what)
        resumed = work.prepare(say or _ignore)
        began = time.perf_counter()
        work.do(count, executor, advance or _ignore)
        seconds = time.perf_counter() - began
        counts, least = _summary(work.answers, what)
        partial.finish()
    finally:
        partial.close()
    return BatchResult(target, what, len(source), counts, least, resumed, seconds)


class _Work:
    """A batch at work: what it asks, how far it is, and the digest of the rows that are done."""

    def __init__(self, scene: Scene, source: MappedRows, partial: Partial, job: str, what: What) -> None:
        questions = {"collision": scene.in_collision, "valid": scene.is_valid, "clearance": scene.clearance}
        self._ask: Callable[..., Any] = questions[what]
        self._kind: type[np.generic] = np.float64 if what == "clearance" else np.bool_
        self._source, self._partial, self._job = source, partial, job
        self._digest = hashlib.blake2b(digest_size=20)
        self._done = 0
        self.answers: NDArray[Any] = np.zeros(0)

    def prepare(self, say: Callable[[str], None]) -> int:
        """Take up an earlier run's work or begin anew; return how many rows are done."""
        earlier, rows = self._partial.earlier, len(self._source)
        if earlier is not None and earlier.done:
            reason = self._differs(earlier)
            answers = None if reason else self._partial.resume(rows, self._kind)
            if answers is not None:
                self.answers, self._done = answers, earlier.done
                say(f"going on after {earlier.done} of {rows} rows, which an earlier run has done")
                return earlier.done
            say(f"beginning anew: {reason or 'the unfinished output of the earlier run is damaged'}")
            self._digest = hashlib.blake2b(digest_size=20)
        self.answers = self._partial.begin(self._progress(), self._kind)
        return 0

    def _differs(self, earlier: Progress) -> str:
        """Say in what an earlier run was another one; leave the digest at the rows that it has done."""
        if earlier.job != self._job:
            return "the scene, its options or the question are not those of the unfinished earlier run"
        changed = "the configurations are not those of the unfinished earlier run"
        if earlier.rows != len(self._source) or earlier.done > earlier.rows:
            return changed
        step = self._most()
        for start in range(0, earlier.done, step):
            self._digest.update(self._source.raw(start, min(start + step, earlier.done)).data)
        return "" if self._digest.hexdigest() == earlier.digest else changed

    def _most(self) -> int:
        return max(1, _BYTES // (8 * max(1, self._source.space.dim)))

    def do(self, threads: int | None, executor: Executor | None, advance: Callable[[int, int], None]) -> None:
        """Answer what is not done yet, and keep what is, whatever happens."""
        rows, size = len(self._source), _FIRST
        committed = time.monotonic()
        try:
            advance(self._done, rows)
            while self._done < rows:
                began = time.monotonic()
                stop = min(self._done + size, rows)
                self._block(stop, threads, executor)
                advance(stop, rows)
                now = time.monotonic()
                fitting = int(size * _SECONDS / max(now - began, 1e-3))
                size = max(1, min(fitting, size * _GROWTH, self._most()))
                if now - committed > _COMMIT_SECONDS:
                    self._commit()
                    committed = time.monotonic()
        except BaseException:
            if self._done:
                self._commit()
            else:
                self._partial.discard()
            raise

    def _block(self, stop: int, threads: int | None, executor: Executor | None) -> None:
        start = self._done
        raw = self._source.raw(start, stop)
        q = self._source.decoded(raw, start)
        self.answers[start:stop] = self._ask(q, threads=threads, executor=executor)
        self._digest.update(raw.data)
        self._done = stop

    def _commit(self) -> None:
        self._partial.commit(self._progress())

    def _progress(self) -> Progress:
        return Progress(self._job, len(self._source), self._done, self._digest.hexdigest())


def _summary(answers: NDArray[Any], what: What) -> tuple[dict[str, int], float | None]:
    names = ("valid", "invalid") if what == "valid" else ("in collision", "free")
    first, least = 0, np.inf
    step = _BYTES // 8
    for start in range(0, len(answers), step):
        block = answers[start : start + step]
        first += int(np.count_nonzero(block <= 0 if what == "clearance" else block))
        least = min(least, float(block.min()))
    counts = {names[0]: first, names[1]: len(answers) - first}
    return counts, least if what == "clearance" and len(answers) else None


def _ignore(*_: object) -> None:
    pass


def identity(scene: Scene, what: str, file_units: bool) -> str:
    """Return a digest of all that answers depend on but the configurations: the scene as it is read, not its path."""
    compiled, space = scene.compiled, scene.space
    options = compiled.options
    digest = hashlib.sha256()
    chosen = (options.collision, options.engine, options.semantics, options.scale)
    boundary = repr(compiled.assembly.environment.boundary)
    facts = [installed_version(), what, file_units, *chosen, scene.pairs, space.names, boundary, scene.origin.tolist()]
    digest.update(json.dumps(facts).encode())
    for array in (space.lower, space.upper, space.periodic, space.home, space.decode(np.ones(space.dim))):
        digest.update(np.ascontiguousarray(array).tobytes())
    # Meshes as they were read: those of the MJCF are rounded to floats.
    for part in compiled.assembly.parts():
        for array in (part.mesh.vertices, part.mesh.faces):
            digest.update(repr((part.name, array.shape)).encode() + np.ascontiguousarray(array).tobytes())
    digest.update(scene.xml.encode())
    for name, content in sorted(scene.assets.items()):
        digest.update(name.encode() + content)
    return digest.hexdigest()
