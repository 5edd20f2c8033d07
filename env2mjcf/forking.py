"""Locks and lasting properties for objects that threads share, and that processes may be forked with at any time.

A forked child has the thread alone that forked it. A lock that another thread held at that moment stays locked there,
and nobody will ever open it.
"""

from __future__ import annotations

import os
import threading
from collections.abc import Callable
from types import TracebackType
from typing import Any, Generic, TypeVar, overload
from weakref import WeakSet

T = TypeVar("T")


class Lock:
    """A reentrant lock that a forked child finds open.

    It must guard nothing that the child would find half done. What is made under it is assigned when it is whole: what
    another thread had begun when the process was forked is simply made again.
    """

    def __init__(self) -> None:
        self._lock = threading.RLock()
        _locks.add(self)

    def reopen(self) -> None:
        """Forget who holds it."""
        self._lock = threading.RLock()

    def __enter__(self) -> None:
        self._lock.acquire()

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        self._lock.release()


_locks: WeakSet[Lock] = WeakSet()


def _reopen() -> None:
    for lock in _locks:
        lock.reopen()


if hasattr(os, "register_at_fork"):
    os.register_at_fork(after_in_child=_reopen)


class lasting(Generic[T]):
    """A property that is worked out when it is first asked for; by two threads at once, twice.

    `functools.cached_property` of Python 3.11 has one lock for all instances of a class: a scene would wait for another
    scene, and a forked child for ever.
    """

    def __init__(self, function: Callable[[Any], T]) -> None:
        self._function = function
        self.__doc__ = function.__doc__

    def __set_name__(self, owner: type, name: str) -> None:
        self._name = name

    @overload
    def __get__(self, instance: None, owner: type) -> lasting[T]: ...
    @overload
    def __get__(self, instance: object, owner: type) -> T: ...
    def __get__(self, instance: object | None, owner: type) -> lasting[T] | T:
        if instance is None:
            return self
        # What is found here hides this descriptor, so that it is asked once.
        return instance.__dict__.setdefault(self._name, self._function(instance))
