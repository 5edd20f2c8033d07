"""Keeps the results of expensive geometry between runs, in files named after what they were computed from."""

from __future__ import annotations

import hashlib
import os
import platform
import re
import struct
import time
import zipfile
from collections.abc import Callable, Mapping, Sequence
from contextlib import suppress
from dataclasses import dataclass
from functools import cache
from pathlib import Path
from typing import IO, Any, TypeVar

import numpy as np
from numpy.typing import NDArray
from platformdirs import user_cache_path

from ..diagnostics import DiagnosticLog
from ..system.files import NoRegularFileError, open_regular, replaced
from ..system.imports import installed_version
from .serialization import pack, unpack

T = TypeVar("T")

FOLDER_VARIABLE = "ENV2MJCF_CACHE_DIR"
"""Environment variable that names another folder."""

LIMIT = 1 << 30
"""Bytes that the cache may hold; beyond them the entries that were not used for longest go."""

# Room that is made at once, so that a full cache is not cleaned at every new entry.
_LOWERED = 0.9
# A file that its writer left behind; none takes an hour.
_STALE_SECONDS = 3600.0
_ENTRY = re.compile(r"[0-9a-f]{64}\.npz")
_STAGED = re.compile(r"\.[0-9a-f]{64}-[0-9a-f]{16}\.npz")
_ALTERED = "its content is not what was written"
_LIBRARIES = ("numpy", "mujoco", "coacd")
# What stands in an entry's place without being a file, and all that numpy raises on files cut short or altered.
_DAMAGED_FILES = (NoRegularFileError, zipfile.BadZipFile, struct.error, EOFError)
_DAMAGE = (*_DAMAGED_FILES, ValueError, TypeError, LookupError, ArithmeticError, MemoryError, RuntimeError)


def default_folder() -> Path | None:
    """Return where entries lie; None where there is no home folder."""
    named = os.environ.get(FOLDER_VARIABLE)
    if named:
        return Path(os.path.abspath(named))
    with suppress(RuntimeError):
        folder = user_cache_path("env2mjcf", appauthor=False, opinion=False)
        return folder if folder.is_absolute() else None
    return None


@dataclass(frozen=True, slots=True)
class CacheState:
    """What a cache folder holds.

    Attributes:
        folder: Where; None if there is no home folder.
        entries: Number of entries.
        bytes: Their size.
        limit: The size beyond which the oldest-used go.
        oldest, newest: When the least and the most recently used entries were used, seconds since 1970.
    """

    folder: Path | None
    entries: int
    bytes: int
    limit: int
    oldest: float | None
    newest: float | None


class GeometryCache:
    """A folder of results, safe with several processes and threads at once; whatever fails there, work goes on.

    Args:
        folder: Where entries lie; made when the first is written. None switches the cache off.
        limit: Bytes that it may hold.
    """

    def __init__(self, folder: Path | None, limit: int = LIMIT) -> None:
        self.folder = folder
        self.limit = limit
        self._held: int | None = None
        self._writable = True

    def remember(
        self,
        what: Sequence[object],
        build: Callable[[], T],
        *,
        kinds: Sequence[type],
        known: Mapping[str, object],
        log: DiagnosticLog,
        subject: str = "",
    ) -> T:
        """Return a result from the cache, or build and keep it.

        Args:
            what: All that the result depends on, in words and numbers; versions are added.
            build: Computes the result.
            kinds: The dataclasses that it is made of.
            known: Objects in it that are not stored.
            log: Takes a finding if an entry is damaged or cannot be written.
            subject: What the findings are about.
        """
        if self.folder is None:
            return build()
        key = entry_key(*what)
        path = self.folder / f"{key}.npz"
        try:
            value = unpack(_read(path, key), kinds, known)
        except FileNotFoundError:
            pass
        except _DAMAGE as error:
            message = f"an entry of the geometry cache is damaged ({type(error).__name__}) and was made anew"
            log.info("GEO260", subject, message)
        except OSError as error:
            self._complain(error, log)
        else:
            with suppress(OSError):
                os.utime(path)
            return value
        value = build()
        self._keep(path, key, pack(value, kinds, known), log)
        return value

    def state(self) -> CacheState:
        """Say what the folder holds."""
        entries = self._files()
        used, held = sorted(u for _, u, _ in entries), sum(size for _, _, size in entries)
        return CacheState(self.folder, len(used), held, self.limit, *((used[0], used[-1]) if used else (None, None)))

    def clear(self) -> int:
        """Remove every entry, and what writers left behind; nothing else. Returns the number of entries removed.

        Raises:
            OSError: An entry may not be removed.
        """
        entries = self._files()
        for path, _, _ in entries + self._files(_STAGED):
            path.unlink(missing_ok=True)
        return len(entries)

    def _keep(self, path: Path, key: str, arrays: Mapping[str, NDArray[Any]], log: DiagnosticLog) -> None:
        size = sum(a.nbytes for a in arrays.values())
        if not self._writable or size > self.limit:
            return
        try:
            path.parent.mkdir(parents=True, exist_ok=True)
            if path.exists() and not path.is_file():
                path.unlink()  # a pipe, say: this folder holds entries only
            with replaced(path) as staged:
                # `pack` holds plain numbers only, and allow_pickle=False names one more array to numpy below 2.1.
                entry: dict[str, Any] = {"digest": _digest(key, arrays), **arrays}
                np.savez(staged, **entry)
            self._make_room(path, size)
        except FileNotFoundError:
            pass  # another process has cleared the folder
        except OSError as error:
            self._complain(error, log)

    def _complain(self, error: OSError, log: DiagnosticLog) -> None:
        """Say once that the cache is of no use."""
        if self._writable:
            message = f"the geometry cache cannot be used: {error.strerror or error}"
            hint = f"set {FOLDER_VARIABLE} to a folder that may be written, or cache=False (--no-cache)"
            log.info("GEO261", str(self.folder), message, hint=hint)
        self._writable = False

    def _make_room(self, new: Path, size: int) -> None:
        """Remove what was not used for longest, if there is too much; the folder is only listed then, and once."""
        if self._held is None:
            self._held = sum(s for _, _, s in self._files())
            for path, written, _ in self._files(_STAGED):
                if time.time() - written > _STALE_SECONDS:
                    path.unlink(missing_ok=True)
        else:
            self._held += size
        if self._held <= self.limit:
            return
        entries = sorted(self._files(), key=lambda e: (e[1], e[0].name))
        self._held = sum(s for _, _, s in entries)
        for path, _, freed in entries:
            if self._held <= _LOWERED * self.limit:
                break
            if path != new:
                path.unlink(missing_ok=True)
                self._held -= freed

    def _files(self, pattern: re.Pattern[str] = _ENTRY) -> list[tuple[Path, float, int]]:
        """Return path, time of last use and size of the entries, or of what writers left behind."""
        found: list[tuple[Path, float, int]] = []
        if self.folder is None:
            return found
        with suppress(FileNotFoundError, NotADirectoryError), os.scandir(self.folder) as listing:
            for item in listing:
                # Another process may have removed it since.
                with suppress(FileNotFoundError):
                    if pattern.fullmatch(item.name) and item.is_file(follow_symlinks=False):
                        found.append((Path(item.path), item.stat().st_mtime, item.stat().st_size))
        return found


def entry_key(*what: object) -> str:
    """Return the name of the entry of a result that depends on `what`, and on the versions of all that computes it."""
    parts = [_provenance(), *(w.hex() if isinstance(w, float) else str(w) for w in what)]
    return hashlib.sha256("\0".join(parts).encode()).hexdigest()


@cache
def _provenance() -> str:
    """Say who computes: the text of the geometry code itself, so that no version number is ever forgotten."""
    code = hashlib.sha256()
    for path in sorted(Path(__file__).parent.rglob("*.py")):
        code.update(path.name.encode() + b"\0" + path.read_bytes() + b"\0")
    return " ".join(
        [code.hexdigest(), platform.machine(), *(f"{n}={installed_version(n)}" for n in ("env2mjcf", *_LIBRARIES))]
    )


def _read(path: Path, key: str) -> dict[str, NDArray[Any]]:
    """Read an entry whole.

    Raises:
        ValueError: It is not what was written under this key.
    """
    with open_regular(path) as file:
        try:
            arrays = _arrays(file, os.fstat(file.fileno()).st_size)
        except OSError as error:
            # It leads to places that are not in the file.
            raise ValueError(_ALTERED) from error
    digest = arrays.pop("digest")
    if not np.array_equal(digest, _digest(key, arrays)):
        raise ValueError(_ALTERED)
    return arrays


def _arrays(file: IO[bytes], size: int) -> dict[str, NDArray[Any]]:
    # What is written is not compressed, so that no entry becomes larger than it is.
    with zipfile.ZipFile(file) as archive:
        parts = archive.infolist()
    if any(p.compress_type != zipfile.ZIP_STORED for p in parts) or sum(p.file_size for p in parts) > size:
        raise ValueError(_ALTERED)
    file.seek(0)
    with np.load(file, allow_pickle=False) as stored:
        return {name: stored[name] for name in stored.files}


def _digest(key: str, arrays: Mapping[str, NDArray[Any]]) -> NDArray[np.uint8]:
    h = hashlib.sha256(key.encode())
    for name, array in sorted(arrays.items()):
        h.update(f"{name} {array.dtype} {array.shape}".encode())
        h.update(np.ascontiguousarray(array).tobytes())
    return np.frombuffer(h.digest(), dtype=np.uint8)
