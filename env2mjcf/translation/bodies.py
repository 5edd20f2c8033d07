"""Bodies in another dialect."""

from __future__ import annotations

import re
from dataclasses import replace

from ..model import BaseKind, Body, Pose, Recentring
from .losses import Losses

_WORD = re.compile(r"[^\s#]\S*")


def robot_body(body: Body, base: BaseKind, first: bool, losses: Losses) -> Body:
    """Return one body of a robot.

    Args:
        body: The body.
        base: How it is carried, whatever its tag says.
        first: Whether it is body 0.
        losses: Where losses are reported.
    """
    dressed = _dressed(body, losses)
    if not losses.vocabulary.legacy_layout:
        _report_home(body, base, losses)
        return replace(dressed, base=base, index=None, pose=(body.pose or Pose()) if base is BaseKind.FIXED else None)
    # Dialect A's first FreeBody is a free base, every other one a link (env-format section 4).
    free = BaseKind.VOLUMETRIC_ROTATIONAL if first else BaseKind.JOINT
    if base not in (free, BaseKind.FIXED):
        losses.refuse(
            "ENV167", body.filename, f"a {base.value} base of {body.filename}; in dialect A the first body moves "
            "freely or is fixed, and all others hang on connections or are fixed", "choose another dialect", body.span,
        )  # fmt: skip
    # A free base has a pose there, its home; other dialects' free bases are at home at the origin.
    return replace(dressed, base=base, pose=body.pose or Pose() if first or base is BaseKind.FIXED else None)


def static_body(body: Body, pose: Pose, losses: Losses) -> Body:
    """Return the body of an obstacle or a surface."""
    dressed = _dressed(body, losses)
    return replace(dressed, base=BaseKind.FIXED, pose=pose, index=0 if losses.vocabulary.legacy_layout else None)


def _dressed(body: Body, losses: Losses) -> Body:
    """Return a body without the options that the dialect does not have."""
    name, span, dialect = body.filename, body.span, losses.dialect
    if not _WORD.fullmatch(name):
        losses.refuse(
            "ENV178", name, f"the file name {name!r} is no single word, as names in text files are",
            "rename the mesh file", span,
        )  # fmt: skip
    if body.mass is not None and not losses.vocabulary.mass:
        losses.lost(
            "ENV170", name, f"dialect {dialect} has no masses; the mass {body.mass:g} of {name} is lost", "", span
        )
        body = replace(body, mass=None)
    if losses.vocabulary.options:
        return body
    if body.recentring is not Recentring.COM:
        losses.refuse(
            "ENV169", name, f"{name} is not to be moved to the mean of its vertices ({body.recentring.value}); dialect "
            f"{dialect} always does", "move the mean of its vertices into the origin, or choose dialect D or E", span,
        )  # fmt: skip
    return _without_paint(body, losses)


def _without_paint(body: Body, losses: Losses) -> Body:
    """Keep as much of a colour as the visualiser's comment holds."""
    name, color = body.filename, body.color
    if body.texture is not None:
        losses.lost("ENV170", name, f"dialect {losses.dialect} has no textures; {body.texture} is lost", "", body.span)
    if color is not None and not all(0 <= c <= 1 for c in color):
        losses.lost("ENV170", name, "a colour beyond 0 to 1 cannot be written as a comment; it is lost", "", body.span)
        color = None
    if color is not None and color[3] != 1:
        losses.lost("ENV170", name, f"dialect {losses.dialect} has opaque colours only", "", body.span)
        color = (*color[:3], 1.0)
    return replace(body, texture=None, color=color)


def _report_home(body: Body, base: BaseKind, losses: Losses) -> None:
    if base in (BaseKind.FIXED, BaseKind.JOINT) or body.pose is None or body.pose == Pose():
        return
    losses.lost(
        "ENV168", body.filename,
        f"dialect {losses.dialect} has no pose for a free base: {body.filename} is at home at the origin there",
        "a query file holds where the robot starts", body.pose.span or body.span,
    )  # fmt: skip
