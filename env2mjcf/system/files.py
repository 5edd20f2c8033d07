"""The one way to write files, whole or not at all, and to open files that may be pipes, devices or somebody else's."""

from __future__ import annotations

import errno
import os
import secrets
import shutil
import stat
from collections.abc import Callable, Generator, Iterable, Mapping, Sequence
from contextlib import contextmanager, suppress
from dataclasses import dataclass
from functools import cache
from pathlib import Path
from typing import IO, NoReturn

from ..diagnostics import DiagnosticLog
from ..options import PathArgument

_FULL = (errno.ENOSPC, errno.EDQUOT, errno.EFBIG)
# Of a file, as much as tells what it is.
_BEGINNING = 4096
_ANOTHER = "choose another output, or remove the file"


@contextmanager
def replaced(file: str | os.PathLike[str]) -> Generator[Path]:
    """Let a file be written beside its place, then rename it there; remove it where writing fails.

    Yields:
        The path to write to; it ends as the file does.

    Raises:
        OSError: It cannot be written, or what stands there is not a regular file but a device, say.
    """
    path = Path(os.fsdecode(file))
    _refuse_special(path)
    staged = beside(path)
    try:
        yield staged
        os.replace(staged, path)
    except BaseException:
        # What went wrong is worth more than what this would say.
        with suppress(OSError):
            staged.unlink()
        raise


def beside(path: Path) -> Path:
    """Return a new hidden name in the same folder, in front of the same suffix, for a file until it is whole."""
    return path.with_name(f".{path.stem}-{secrets.token_hex(8)}{path.suffix}")


@contextmanager
def output(file: str | os.PathLike[str], code: str) -> Generator[Path]:
    """Let a file be written as `replaced` does; where it cannot be, fail with a ConversionError of this code."""
    with _said(file, code), replaced(file) as staged:
        yield staged


@contextmanager
def made_folder(folder: Path, code: str) -> Generator[None]:
    """Make a folder, with those that it lies in; where what is done in it fails, remove what was made and is empty.

    Raises:
        ConversionError: It cannot be made.
    """
    missing = [f for f in (folder, *folder.parents) if not os.path.lexists(f)]
    try:
        if missing and "\0" not in str(folder):
            with _said(folder, code):
                folder.mkdir(parents=True, exist_ok=True)
        yield
    except BaseException:
        for made in missing:
            with suppress(OSError):
                made.rmdir()
        raise


def write_together(contents: Mapping[Path, bytes], code: str) -> None:
    """Write several files, or leave all as they were where one cannot be written.

    All are written beside their places, and what they replace is copied, before the first is renamed; an error then
    takes back what was renamed. A process that is killed between two renames leaves the first files new, the others
    old, and what lies beside them.

    Args:
        contents: What to write, in the order in which it is renamed.
        code: The code of the diagnostic.

    Raises:
        ConversionError: A file cannot be written.
    """
    replacements = {path: _Replacement(path, beside(path), beside(path)) for path in contents}
    try:
        for path, data in contents.items():
            with _said(path, code):
                replacements[path].stage(data)
        for path, replacement in replacements.items():
            with _said(path, code):
                replacement.rename()
    except BaseException:
        for replacement in replacements.values():
            with suppress(OSError):
                replacement.take_back()
        raise
    copies = [replacement.old for replacement in replacements.values()]
    try:
        _remove(copies)
    except BaseException:
        _remove(copies)  # also where an interrupt comes
        raise


def _remove(paths: Iterable[Path]) -> None:
    for path in paths:
        with suppress(OSError):
            path.unlink(missing_ok=True)


@dataclass(slots=True)
class _Replacement:
    """A file that is replaced together with others.

    Attributes:
        path: Its place.
        new: What comes there.
        old: A copy of what is there; missing where nothing is.
        begun: Whether it may have been renamed: an interrupt may come as soon as it is.
    """

    path: Path
    new: Path
    old: Path
    begun: bool = False

    def stage(self, data: bytes) -> None:
        _refuse_special(self.path)
        if os.path.lexists(self.path):
            shutil.copy2(self.path, self.old, follow_symlinks=False)
        self.new.write_bytes(data)

    def rename(self) -> None:
        self.begun = True
        os.replace(self.new, self.path)

    def take_back(self) -> None:
        """Put back what was there; a copy that cannot be put back stays where it is."""
        if not self.begun or self.new.exists():
            self.new.unlink(missing_ok=True)
            self.old.unlink(missing_ok=True)
        elif os.path.lexists(self.old):
            os.replace(self.old, self.path)
        else:
            self.path.unlink()


def _refuse_special(path: Path) -> None:
    if "\0" in path.name:
        raise OSError(errno.EINVAL, "its name holds a NUL character", str(path))
    # Renaming would put a file in the place of /dev/null.
    if path.exists() and not path.is_file():
        raise OSError(errno.EINVAL, "it is not a regular file", str(path))


@contextmanager
def _said(file: str | os.PathLike[str], code: str) -> Generator[None]:
    """Make a ConversionError of an OSError about a file that is written."""
    try:
        yield
    except OSError as error:
        path = os.fsdecode(file)
        full = error.errno in _FULL
        hint = f"{'make room, or ' if full else ''}choose another file; its folder must exist"
        DiagnosticLog().fail(code, path, f"{path} cannot be written: {error.strerror or error}", hint=hint)


def refuse_unwritable(out: PathArgument, code: str, inputs: Sequence[PathArgument] = ()) -> None:
    """Refuse a file that cannot be written, before time is spent on its content.

    Args:
        out: The file to write.
        code: The code of the diagnostic.
        inputs: Files that are read for it, whether they are there or not.

    Raises:
        ConversionError: It is a folder or one of the inputs, its folder is missing or may not be written, or no file
            can have its name.
    """
    path = Path(os.fsdecode(out))
    if reason := _against_name(path):
        what = f"cannot be written: {reason}"
    elif path.is_dir():
        what = "is a folder"
    elif path.exists() and any(os.path.exists(i) and os.path.samefile(path, i) for i in inputs):
        what = "is an input"
    elif path.exists() and not path.is_file():
        what = "is not a regular file"
    elif not path.parent.is_dir():
        what = f"lies in {path.parent}, which is not a folder"
    elif not os.access(path.parent, os.W_OK):
        what = f"lies in {path.parent}, which may not be written"
    else:
        return
    DiagnosticLog().fail(code, str(path), f"{path} {what}; expected a file to write", hint="name another output")


def _against_name(path: Path) -> str:
    """Return why the system refuses the name of a file, which may be too long; empty where it does not."""
    try:
        path.lstat()
    except (FileNotFoundError, NotADirectoryError):
        pass
    except OSError as error:
        return error.strerror or str(error)
    except ValueError as error:  # it holds a NUL character
        return str(error)
    return ""


def refuse_foreign(
    out: Path, code: str, kind: str, belongs: Callable[[bytes], bool], size: int = _BEGINNING, hint: str = _ANOTHER
) -> None:
    """Refuse to replace a file that is of another kind than what is written, such as a scene that was named by mistake.

    Args:
        out: The file to write.
        code: The code of the diagnostic.
        kind: What is written, as "a path file".
        belongs: Says of the beginning of a file whether it is of that kind; one of white space only is always replaced.
        size: Bytes that tell what it is; -1 for all.
        hint: What to do about it.

    Raises:
        ConversionError: It is of another kind, or cannot be read.
    """
    if not out.exists():
        return
    try:
        with open_regular(out) as file:
            beginning = file.read(size)
    except (IsADirectoryError, NoRegularFileError):
        refuse_replacement(out, code, f"is not {kind}", hint)
    except OSError as error:
        refuse_replacement(out, code, f"cannot be read: {error.strerror or error}", hint)
    if beginning.strip() and not belongs(beginning):
        refuse_replacement(out, code, f"is not {kind}", hint)


def refuse_replacement(out: Path, code: str, why: str, hint: str = _ANOTHER) -> NoReturn:
    """Fail because a file, for a reason such as "is not a path file", is kept."""
    DiagnosticLog().fail(code, str(out), f"{out} {why}, and is not replaced", hint=hint)


class NoRegularFileError(OSError):
    """A pipe, a device or the like where a file was expected: it may keep its reader waiting for ever."""

    def __init__(self, path: PathArgument) -> None:
        what = "it is not a regular file but a pipe, a socket, a device, or a view of the system in /proc or /sys"
        super().__init__(errno.EINVAL, what, os.fspath(path))


def open_regular(path: PathArgument, *, or_pipe: bool = False) -> IO[bytes]:
    """Open a regular file to read from it, and wait for nothing.

    Args:
        path: The file.
        or_pipe: Whether a pipe, or the terminal that is the standard input, will do, too; it is waited for.

    Raises:
        NoRegularFileError: It is something else.
        OSError: It is a folder, or cannot be opened.
        ValueError: There is a NUL character in its name.
    """
    # Some devices act as soon as they are opened.
    waits = _refuse_unread(path, os.stat(path), or_pipe)
    file = open(path, "rb", opener=None if waits else _without_waiting)  # noqa: SIM115  the caller closes it
    try:
        # Asked of what is open, too: the name may mean another file by now.
        _refuse_unread(path, os.fstat(file.fileno()), or_pipe)
    except NoRegularFileError:
        file.close()
        raise
    return file


def _refuse_unread(path: PathArgument, found: os.stat_result, or_pipe: bool) -> bool:
    """Refuse what is not read; return whether it has to be waited for. Folders are left to the system to refuse."""
    mode = found.st_mode
    if or_pipe and (stat.S_ISFIFO(mode) or (stat.S_ISCHR(mode) and _is_standard_input(found))):
        return True
    # Files of /proc and /sys call themselves regular. Some wait for the kernel, and to read its log takes it away.
    if not stat.S_ISDIR(mode) and (not stat.S_ISREG(mode) or found.st_dev in _views_of_the_system()):
        raise NoRegularFileError(path)
    return False


def _is_standard_input(found: os.stat_result) -> bool:
    try:
        return os.path.samestat(found, os.fstat(0))
    except OSError:  # it is closed
        return False


@cache
def _views_of_the_system() -> frozenset[int]:
    """Return the devices of the file systems whose files the kernel makes up while they are read."""
    devices: set[int] = set()
    for folder in ("/proc", "/sys"):
        with suppress(OSError):
            devices.add(os.stat(folder).st_dev)
    return frozenset(devices - {os.stat(os.sep).st_dev})


def _without_waiting(path: str, flags: int) -> int:
    """Open a file; a pipe would be waited for until somebody writes to it."""
    return os.open(path, flags | getattr(os, "O_NONBLOCK", 0))
