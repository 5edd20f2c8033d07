"""The folder that scenes are written into, by several processes at once if need be.

A writer first puts its MJCF there under a staged name, which tells every other process what assets it counts on, then
the assets that are missing, then lets MuJoCo load it, and renames it last. A process holds the folder's lock while it
changes the folder: none removes an asset between another's look at it and the MJCF that names it. The lock is not held
while MuJoCo loads. It is a lock of the folder itself, so it leaves no file behind, and a process that dies leaves it
open.
"""

from __future__ import annotations

import os
import re
import time
from collections.abc import Iterable, Mapping
from contextlib import suppress
from pathlib import Path
from typing import IO

from ..system.files import NoRegularFileError, beside, open_regular, replaced
from ..system.locks import FolderBusyError, LockOutcome, folder_lock, try_lock
from .markup import ASSET_FOLDER, files_mentioned

# What a killed process leaves is removed when it is as old as this, if nobody holds it.
_STALE_SECONDS = 3600.0

_STAGED = re.compile(r"\..+-[0-9a-f]{16}\.xml")
_STAGED_ASSET = re.compile(r"\..+-[0-9a-f]{12}-[0-9a-f]{16}\.(?:stl|obj|xml)")
_ASSET = re.compile(r"(?:.*[/\\])?([^/\\]+-[0-9a-f]{12}\.(?:stl|obj|xml))", re.DOTALL)
_SCENES = (".xml", ".mjcf", ".urdf")


class Staged:
    """A scene that is written but does not have its name yet.

    Args:
        folder: Where it is; made if need be.
        name: What it will be called, without `.xml`.
        xml: The MJCF.
        assets: The files that it names, by their paths in the folder.

    Raises:
        FolderBusyError: Another process does not let anybody write.
        OSError: It cannot be written.
    """

    def __init__(self, folder: Path, name: str, xml: bytes, assets: Mapping[str, bytes]) -> None:
        self.folder = folder
        self.final = folder / f"{name}.xml"
        self.path = beside(self.final)
        self.assets = tuple(folder / relative for relative in assets)
        self._made: set[str] = set()
        self._retired: Path | None = None
        self._file: IO[bytes] | None = None
        self._begun = False
        # What is not there yet, the innermost first.
        self._made_folders = [f for f in (folder / ASSET_FOLDER, folder, *folder.parents) if not f.exists()]
        (folder / ASSET_FOLDER).mkdir(parents=True, exist_ok=True)
        try:
            with folder_lock(folder):
                # Another process may just have removed one that was of no use to it.
                (folder / ASSET_FOLDER).mkdir(parents=True, exist_ok=True)
                with suppress(OSError):
                    _remove_stale(folder)
                self._begun = True
                # Open and locked for as long as this process needs it: it is not stale, however old it is.
                self._file = self.path.open("xb", 0)
                try_lock(self._file.fileno())
                self.path.write_bytes(xml)
                for relative, data in assets.items():
                    self._provide(folder / relative, data)
        except BaseException:
            self.discard()
            raise

    def _provide(self, path: Path, data: bytes) -> None:
        # The name holds the hash of the content: what is there and whole is right.
        if path.is_file() and path.stat().st_size == len(data) and path.read_bytes() == data:
            return
        with replaced(path) as staged:
            staged.write_bytes(data)
        self._made.add(path.name)

    def commit(self) -> None:
        """Give the scene its name, and remove the assets that only the scene of that name before it used.

        Raises:
            FolderBusyError: Another process does not let anybody write.
            OSError: It cannot be renamed; `discard` then removes what was written.
        """
        with folder_lock(self.folder):
            self._close()
            self._retire()
            os.replace(self.path, self.final)
            # The scene is there: what cannot be tidied up is no reason to say that it is not.
            with suppress(OSError):
                self._remove_retired()

    def _retire(self) -> None:
        """Keep the scene of this name that was there before under a staged name, if it has assets that go with it.

        If this process is killed, the next one knows from it what to remove.
        """
        try:
            if _named(self.final) <= {asset.name for asset in self.assets}:
                return
        except PermissionError:  # of a file that it includes: its assets stay
            return
        self._retired = beside(self.final)
        self._retired.write_bytes(self.final.read_bytes())

    def _remove_retired(self) -> None:
        if self._retired is not None:
            _remove(self.folder, self._retired)

    def discard(self) -> None:
        """Remove the staged MJCF, the assets that were written for it, and the folders that were made for both."""
        self._close()
        with suppress(OSError, FolderBusyError), folder_lock(self.folder):
            if self._begun:
                _remove(self.folder, self.path, self._made)
                self._remove_retired()
            for folder in self._made_folders:
                folder.rmdir()  # fails where somebody else has put something there

    def _close(self) -> None:
        if self._file is not None:
            self._file.close()


def _remove_stale(folder: Path) -> None:
    """Remove what killed processes have left: staged files, and assets that only those name."""
    for staged in _old(folder, _STAGED):
        with staged.open("rb") as file:
            if try_lock(file.fileno()) is not LockOutcome.TAKEN:
                _remove(folder, staged)
    for staged in _old(folder / ASSET_FOLDER, _STAGED_ASSET):
        staged.unlink(missing_ok=True)


def _old(folder: Path, pattern: re.Pattern[str]) -> list[Path]:
    before = time.time() - _STALE_SECONDS
    with os.scandir(folder) as listing:
        files = [i for i in listing if pattern.fullmatch(i.name) and i.is_file(follow_symlinks=False)]
        return [Path(i.path) for i in files if i.stat().st_mtime < before]


def _remove(folder: Path, staged: Path, names: Iterable[str] | None = None) -> None:
    """Remove a staged scene, and before it those of its assets (or of the given ones) that no other scene names.

    Raises:
        OSError: The folder, or another scene, cannot be read, and may name any of them.
    """
    left = _named(staged) if names is None else set(names)
    if left:
        # Not by `Path.glob`, which takes a folder that cannot be listed for an empty one.
        with os.scandir(folder) as listing:
            scenes = [Path(item.path) for item in listing if item.name.lower().endswith(_SCENES)]
        for scene in scenes:
            if scene != staged:
                left -= _named(scene)
    for name in left:
        (folder / ASSET_FOLDER / name).unlink(missing_ok=True)
    staged.unlink(missing_ok=True)


def _named(xml: Path) -> set[str]:
    """Return the asset files that an MJCF file names, itself or in a file that it includes."""
    names: set[str] = set()
    files = [xml]
    for file in files:
        try:
            with open_regular(file) as stream:
                mentioned = files_mentioned(stream.read())
        except (FileNotFoundError, IsADirectoryError, NoRegularFileError):
            continue
        found = {name: _ASSET.fullmatch(name) for name in mentioned}
        names.update(asset[1] for asset in found.values() if asset)
        included = (xml.parent / n for n, asset in found.items() if not asset and n.lower().endswith(_SCENES))
        files += [path for path in included if path not in files and os.path.isfile(path)]
    return names
