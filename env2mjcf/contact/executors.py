"""Answers questions on an executor: threads, processes, or the workers of a Dask cluster.

A scene is megabytes, and a task is small. So tasks name the scene by a digest of its pickled bytes; a worker that does
not know it says so, and is sent the task again together with the bytes. It keeps the scene for the tasks that follow.
Nothing need be known about who works where, and a worker that comes late, or comes again, finds its way.
"""

from __future__ import annotations

import dataclasses
import hashlib
import os
import pickle
import threading
import time
import zlib
from collections import OrderedDict
from concurrent.futures import FIRST_COMPLETED, BrokenExecutor, Executor, Future, ThreadPoolExecutor, wait
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any
from weakref import WeakKeyDictionary

from .tasks import Chunks

if TYPE_CHECKING:
    from .queries import ContactQueries
    from .tasks import Question, Store

# Scenes that a worker remembers.
_REMEMBERED = 4
# Workers of an executor that does not tell how many it has.
_WORKERS = 16
# Seconds that tasks which cannot be cancelled are waited for.
_PATIENCE = 1.0


@dataclass(frozen=True, slots=True)
class Parcel:
    """A scene's queries as bytes.

    Attributes:
        digest: SHA-256 of the content.
        content: Compressed pickle.
    """

    digest: str
    content: bytes


@dataclass(frozen=True, slots=True, eq=False)
class Task:
    """Rows to be worked on elsewhere.

    Attributes:
        scene: Digest of the scene; or the queries themselves, which threads of this process share.
        content: The parcel's content, where a worker lacks it.
        question: The question, with the columns of these rows.
    """

    scene: str | ContactQueries
    content: bytes | None
    question: Question


class _Memory:
    """The scenes that a process knows by their digests, the latest used last."""

    def __init__(self) -> None:
        self.clear()

    def clear(self) -> None:
        # A new lock, too: when a process forks, some other thread may hold the old one, and is not there to release it.
        self._lock = threading.Lock()
        self._scenes: OrderedDict[str, ContactQueries] = OrderedDict()

    def find(self, digest: str, content: bytes | None) -> ContactQueries | None:
        """Return a scene; None if it is not known and its content is not given."""
        with self._lock:  # held while unpickling, so that the threads of a worker do it once
            scene = self._scenes.get(digest)
            if scene is None:
                if content is None:
                    return None
                scene = self._scenes[digest] = pickle.loads(zlib.decompress(content))
                if len(self._scenes) > _REMEMBERED:
                    self._scenes.popitem(last=False)
            self._scenes.move_to_end(digest)
            return scene


_memory = _Memory()
_parcels: WeakKeyDictionary[ContactQueries, Parcel] = WeakKeyDictionary()
if hasattr(os, "register_at_fork"):
    # A child must not use scenes whose locks were copied while they were held.
    os.register_at_fork(after_in_child=_memory.clear)


def parcel(queries: ContactQueries) -> Parcel:
    """Return queries as bytes; made once."""
    made = _parcels.get(queries)
    if made is None:
        content = zlib.compress(pickle.dumps(queries, protocol=5), 1)
        made = _parcels[queries] = Parcel(hashlib.sha256(content).hexdigest(), content)
    return made


def answer(task: Task) -> tuple[Any, float] | None:
    """Return a task's answers, and the seconds that they took, in a worker; None asks for the scene's content."""
    queries = _memory.find(task.scene, task.content) if isinstance(task.scene, str) else task.scene
    if queries is None:
        return None
    began = time.perf_counter()
    answers = task.question.answers(queries, slice(None))
    return answers, time.perf_counter() - began


def worker_count(executor: Any) -> int:
    """Return how many tasks an executor works on at a time, as far as it tells."""
    count = getattr(executor, "_max_workers", None)
    if isinstance(count, int):
        return max(1, count)
    client: Any = getattr(executor, "_client", None)  # of Dask
    return max(1, sum(client.nthreads().values())) if hasattr(client, "nthreads") else _WORKERS


def on_executor(
    executor: Executor, queries: ContactQueries, question: Question, chunks: Chunks, store: Store, workers: int
) -> None:
    """Store the answers to a question that an executor's workers give.

    A few tasks more than there are workers are on their way at a time, so that memory does not grow with the rows.

    Raises:
        TypeError: The executor has no `submit`.
        BrokenExecutor: A worker process died, and the executor does not replace it. (Dask's does.)
    """
    if not callable(getattr(executor, "submit", None)):
        expected = "a concurrent.futures.Executor, such as ProcessPoolExecutor() or dask's Client(...).get_executor()"
        raise TypeError(f"executor is {executor!r}; expected {expected}")
    # Derived classes may be something else: interpreters share no objects.
    here = type(executor) is ThreadPoolExecutor
    scene = queries if here else parcel(queries).digest
    running: dict[Future[Any], tuple[Task, slice]] = {}

    def send(task: Task, rows: slice) -> None:
        running[executor.submit(answer, task)] = task, rows

    try:
        while True:
            while len(running) < 2 * workers + 1 and (rows := chunks.take()) is not None:
                send(Task(scene, None, question.part(rows)), rows)
            if not running:
                return
            for future in wait(running, return_when=FIRST_COMPLETED).done:
                task, rows = running.pop(future)
                reply = future.result()
                if reply is None:
                    send(dataclasses.replace(task, content=parcel(queries).content), rows)
                else:
                    answers, seconds = reply
                    store(rows, answers)
                    chunks.took(rows.stop - rows.start, seconds)
    except BrokenExecutor as error:
        raise type(error)(
            "a worker of the executor died, and with it the executor: make a new one and ask again. Usual reasons: "
            "the system was out of memory, or the program's main module starts processes without standing under "
            "`if __name__ == '__main__':`"
        ) from error
    finally:
        # Ctrl-C and errors leave nothing running behind; the executor itself is the caller's.
        for future in running:
            future.cancel()
        if running:
            wait(running, timeout=_PATIENCE)
