"""Finds the mesh files that a scene names."""

from __future__ import annotations

import os
from dataclasses import dataclass
from pathlib import Path, PurePosixPath

from ..diagnostics import DiagnosticLog
from ..errors import Span, did_you_mean
from ..model.environment import Environment
from ..options import Options

# Missing names for which the nearest one is looked for.
_GUESSES = 3


@dataclass(frozen=True, slots=True)
class UnusableMesh:
    """Why a mesh file cannot be used.

    Attributes:
        code, name, message, hint, span: Those of the diagnostic.
        path: Where the file is; None where there is none.
    """

    code: str
    name: str
    message: str
    hint: str
    span: Span | None
    path: Path | None = None


def resolve_all(environment: Environment, options: Options, log: DiagnosticLog) -> dict[str, Path]:
    """Find every mesh file of a scene.

    A name is looked for beside the environment file, then in each of `mesh_dirs`, then in the same places with
    backslashes read as slashes, then without regard to case. What is found must lie, symbolic links resolved,
    inside one of these folders, unless `allow_outside`.

    Returns:
        Path of each file name, in the order of the bodies.

    Raises:
        GeometryError: One or more files are missing, forbidden or unreadable; one error names them all.
    """
    found, problems = find_all(environment, options, log)
    if problems:
        first, *others = problems.values()
        message, hint = first.message, first.hint
        if others:
            lines = (
                f"  {p.span or environment.path}: {p.message}" + (f" ({p.hint})" if p.hint else "")
                for p in (first, *others)
            )
            message, hint = f"{len(problems)} mesh files cannot be used:\n" + "\n".join(lines), ""
        log.fail(first.code, first.name, message, hint=hint, span=first.span)
    return found


def find_all(
    environment: Environment, options: Options, log: DiagnosticLog
) -> tuple[dict[str, Path], dict[str, UnusableMesh]]:
    """Find the mesh files of a scene as `resolve_all` does, and tell what is wrong with the others.

    Returns:
        Path of each file name, and why the others cannot be used, in the order of the bodies.
    """
    for extra in options.mesh_dirs:
        if not Path(extra).is_dir():
            hint = "check the path: it is relative to the current directory"
            log.warn("GEO228", str(extra), f"mesh_dirs names {str(extra)!r}, which is not a folder", hint=hint)
    finder = _Finder([environment.directory, *(Path(d) for d in options.mesh_dirs)], options.allow_outside, log)
    found: dict[str, Path] = {}
    problems: dict[str, UnusableMesh] = {}
    for multibody in environment.multibodies:
        for body in multibody.bodies:
            name = body.filename
            if name in found or name in problems:
                continue
            result = finder.find(name, body.span)
            if isinstance(result, UnusableMesh):
                problems[name] = result
            else:
                found[name] = result
    return found, problems


class _Finder:
    """Looks for files in a list of folders."""

    def __init__(self, folders: list[Path], allow_outside: bool, log: DiagnosticLog) -> None:
        self._folders = folders
        self._real_folders = [os.path.realpath(f) for f in folders]
        self._allow_outside = allow_outside
        self._log = log
        self._listings: dict[Path, list[str]] = {}
        self._folded: dict[Path, dict[str, str]] = {}
        self._guesses = _GUESSES

    def find(self, name: str, span: Span | None) -> Path | UnusableMesh:
        """Return where a file is, or why it cannot be used."""
        if "\0" in name:
            return UnusableMesh("GEO203", repr(name), f"the mesh file name {name!r} holds a NUL byte", "", span)
        slashed = name.replace("\\", "/")
        found = self._first_file(name)
        if found is None and slashed != name and (found := self._first_file(slashed)):
            message = f"the backslashes of {name!r} are read as slashes"
            self._log.warn("GEO206", name, message, hint=f"write {slashed}", span=span)
        if found is None and (found := self._any_case(slashed)):
            message = f"there is no {name!r}; {str(found)!r}, which differs in case, is read"
            self._log.warn("GEO205", name, message, hint="write the name as the file's", span=span)
        if found is None:
            return self._missing(name, slashed, span)
        if not self._inside(found):
            message = f"{str(found)!r} lies outside the scene's folder and mesh_dirs"
            folder = str(found.parent)
            hint = f"if you trust the scene: allow_outside=True (--allow-outside), or mesh_dirs=[{folder!r}]"
            return UnusableMesh("GEO202", str(found), message, hint, span, found)
        if not os.access(found, os.R_OK):
            return UnusableMesh("GEO204", name, f"{str(found)!r} may not be read", "check its permissions", span, found)
        return found

    def _candidates(self, name: str) -> list[Path]:
        # Joining an absolute name to a folder gives the name itself.
        return list(dict.fromkeys(folder / name for folder in self._folders))

    def _first_file(self, name: str) -> Path | None:
        """Return the first candidate that is a file, those inside the allowed folders before all others."""
        files = [c for c in self._candidates(name) if os.path.isfile(c)]
        return next((f for f in files if self._inside(f)), files[0] if files else None)

    def _any_case(self, name: str) -> Path | None:
        matches = (self._match_case(folder, name) for folder in self._folders if not PurePosixPath(name).is_absolute())
        return next((m for m in matches if m is not None and self._inside(m)), None)

    def _match_case(self, folder: Path, name: str) -> Path | None:
        """Return the file that a name means when case is ignored; the first in code point order where several fit."""
        at = folder
        for part in PurePosixPath(name).parts:
            exact = part == ".." or os.path.lexists(at / part)
            at /= part if exact else self._any_case_of(at, part)
        return at if os.path.isfile(at) else None

    def _any_case_of(self, folder: Path, name: str) -> str:
        if folder not in self._folded:
            # Backwards, so that the first of several stays.
            self._folded[folder] = {x.lower(): x for x in reversed(self._listing(folder))}
        return self._folded[folder].get(name.lower(), name)

    def _listing(self, folder: Path) -> list[str]:
        """Return what is in a folder, in order; read once, however many names are looked for in it."""
        if folder not in self._listings:
            try:
                self._listings[folder] = sorted(os.listdir(folder))
            except OSError:
                self._listings[folder] = []
        return self._listings[folder]

    def _inside(self, path: Path) -> bool:
        if self._allow_outside:
            return True
        real = os.path.realpath(path)
        return any(real == f or real.startswith(os.path.join(f, "")) for f in self._real_folders)

    def _missing(self, name: str, slashed: str, span: Span | None) -> UnusableMesh:
        candidates = self._candidates(slashed)
        for candidate in candidates:
            if os.path.lexists(candidate) and self._inside(candidate):
                kind = "folder" if candidate.is_dir() else "broken link or a special file"
                return UnusableMesh("GEO203", name, f"{str(candidate)!r} is a {kind}; expected a mesh file", "", span)
        places = ", ".join(repr(str(c)) for c in candidates)
        hint = self._guess(slashed, candidates) or "add the folder that holds it to mesh_dirs (--mesh-dirs)"
        return UnusableMesh("GEO201", name, f"there is no mesh file {name!r}; tried {places}", hint, span)

    def _guess(self, name: str, candidates: list[Path]) -> str:
        """Return what a missing name may be a slip of: of the first few names, because each is compared with all."""
        if self._guesses == 0:
            return ""
        self._guesses -= 1
        # Folders outside are not listed: an error message must not show what they hold.
        near = [x for c in candidates if self._inside(c.parent) for x in self._listing(c.parent)]
        return did_you_mean(PurePosixPath(name).name, near)
