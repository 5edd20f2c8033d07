"""Assertions about scenes for tests; a failure names the bodies, the place and the depth, and may draw a picture."""

from __future__ import annotations

import hashlib
import os
import re
from collections.abc import Sequence
from os import PathLike
from pathlib import Path

import numpy as np
from numpy.typing import ArrayLike, NDArray

from ..contact.types import Reason
from ..simulation.scene import Scene
from ..simulation.verdicts import any_rough
from ..transforms import Array
from ..view.offscreen import RenderError
from ..view.pictures import picture as draw

__all__ = ["assert_free", "assert_valid", "assert_valid_path"]

PICTURES_VARIABLE = "ENV2MJCF_PICTURES"
"""Environment variable that names a folder for pictures of failures; pytest's --env2mjcf-pictures sets it."""

_ROUGH = "(depths at bodies that are not convex may be more than the shortest way out)"
# What is said where a verdict has no reasons.
_UNSEEN = "something touches, within the tolerance of contact"
# Reasons beyond these are counted, not listed.
_LISTED = 12
# As many configurations of a path are drawn as ghosts.
_GHOSTS = 12

_numbered: dict[str, int] = {}


def assert_free(scene: Scene, q: ArrayLike, *, picture: str | PathLike[str] | None = None) -> None:
    """Assert that no tested pair touches.

    Args:
        scene: The scene.
        q: One configuration, (dim,), or several, (n, dim), in radians and metres.
        picture: A PNG file to draw the first failure into; needs the extra `view` and a GL library. Without it,
            a file in the folder that the environment variable ENV2MJCF_PICTURES names, if it names one.

    Raises:
        AssertionError: Something touches; the message says who touches whom, where and how deep.
        ValueError: q has a wrong shape, holds no row, or a value that is not finite.
    """
    __tracebackhide__ = True
    rows = _rows(scene, q)
    _refuse(scene, rows, np.asarray(scene.in_collision(rows)), "in collision", picture)


def assert_valid(scene: Scene, q: ArrayLike, *, picture: str | PathLike[str] | None = None) -> None:
    """Assert that configurations are within limits and inside the boundary, and that nothing touches.

    Arguments and errors are those of `assert_free`; the message also says which limit is passed, and who is outside.
    """
    __tracebackhide__ = True
    rows = _rows(scene, q)
    _refuse(scene, rows, ~np.asarray(scene.is_valid(rows)), "not valid", picture)


def assert_valid_path(
    scene: Scene, path: ArrayLike, resolution: float | None = None, *, picture: str | PathLike[str] | None = None
) -> None:
    """Assert that the configurations of a path, and the straight edges between them, are valid.

    Args:
        scene: The scene.
        path: (k, dim), in radians and metres.
        resolution: Greatest distance in metres that any point of a robot moves between two checks; None takes the
            file's PositionRes, else 0.01 extent.
        picture: As for `assert_free`; the path is drawn as ghosts.

    Raises:
        AssertionError: The path is not valid; the message says where along it, and why.
        ValueError: The path has a wrong shape, holds no row, or a value that is not finite; or the resolution is not
            positive, or too small for such edges.
    """
    __tracebackhide__ = True
    rows = _rows(scene, path)
    if np.ndim(path) != 2:
        raise ValueError(f"a path of shape {np.shape(path)}; expected (k, {scene.space.dim})")
    report = scene.check_path(rows, resolution)
    if report.valid:
        return
    assert report.first_invalid is not None
    assert report.invalid_q is not None
    place = _place(scene, rows, report.first_invalid, report.invalid_q)
    edges = int(np.count_nonzero(~report.edges))
    head = (
        f"the path is not valid {place} ({edges} of its {len(report.edges)} edges are not)\n"
        f"  {_values(scene, report.invalid_q)}"
    )
    ghosts = rows[np.linspace(0, len(rows) - 1, min(len(rows), _GHOSTS)).round().astype(int)]
    drawn = _draw(scene, np.vstack([ghosts, report.invalid_q]), picture)
    raise AssertionError(_message(scene, head, scene.explain(report.invalid_q).reasons, drawn))


def _rows(scene: Scene, q: ArrayLike) -> Array:
    rows = np.atleast_2d(scene.space.check(q))
    if not len(rows):
        raise ValueError("there are no configurations, so there is nothing to assert")
    return rows


def _refuse(
    scene: Scene, rows: Array, wrong: NDArray[np.bool_], what: str, picture: str | PathLike[str] | None
) -> None:
    """Raise an AssertionError about the first row that is wrong, if any is."""
    __tracebackhide__ = True
    if not wrong.any():
        return
    first = int(np.argmax(wrong))
    several = f"{wrong.sum()} of {len(rows)} configurations are {what}; the first is row {first}"
    head = f"the configuration is {what}" if len(rows) == 1 else several
    verdict = scene.explain(rows[first])
    drawn = _draw(scene, rows[first : first + 1], picture)
    reasons = verdict.contacts if what == "in collision" else verdict.reasons
    raise AssertionError(_message(scene, f"{head}\n  {_values(scene, rows[first])}", reasons, drawn))


def _values(scene: Scene, row: Array) -> str:
    """Return a configuration such that it can be copied back, bit for bit, into a test."""
    return f"q = {row.tolist()}  ({', '.join(scene.space.names)})"


def _place(scene: Scene, path: Array, index: int, q: Array) -> str:
    if np.array_equal(path[index], q):
        return f"at its configuration {index} of {len(path)}"
    whole, part = (np.linalg.norm(scene.space.difference(path[index], end)) for end in (path[index + 1], q))
    return f"between its configurations {index} and {index + 1} of {len(path)}, {part / whole:.0%} of the way"


def _message(scene: Scene, head: str, reasons: Sequence[Reason], drawn: str) -> str:
    lines = [head, *(f"    {reason}" for reason in reasons[:_LISTED] or (_UNSEEN,))]
    if len(reasons) > _LISTED:
        lines.append(f"    ... and {len(reasons) - _LISTED} more")
    if any_rough(scene, reasons):
        lines.append(f"    {_ROUGH}")
    if drawn:
        lines.append(f"    {drawn}")
    return "\n".join(lines)


def _draw(scene: Scene, rows: Array, picture: str | PathLike[str] | None) -> str:
    """Draw a failure, the last row in full, and return where it lies, or why there is no picture."""
    target = Path(picture) if picture is not None else _default_picture()
    if target is None:
        return ""
    try:
        target.parent.mkdir(parents=True, exist_ok=True)
        draw(scene, rows[-1], file=target, size=(1280, 960), ghosts=rows[:-1], contacts=True)
    except (RenderError, OSError) as error:
        return f"no picture: {error}"
    return f"picture: {target}"


def _default_picture() -> Path | None:
    folder = os.environ.get(PICTURES_VARIABLE)
    if not folder:
        return None
    # pytest keeps the running test's id here, "(call)" or another phase behind it.
    test = re.sub(r" \(\w+\)$", "", os.environ.get("PYTEST_CURRENT_TEST", "failure"))
    _numbered[test] = count = _numbered.get(test, 0) + 1
    words = re.sub(r"[^A-Za-z0-9_.]+", "-", test.replace(".py::", "-")).strip("-")[-100:]
    digest = hashlib.sha256(test.encode("utf-8", "surrogateescape")).hexdigest()[:8]
    return Path(folder) / f"{words}-{digest}{f'-{count}' if count > 1 else ''}.png"
