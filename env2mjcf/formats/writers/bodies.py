"""The lines of bodies: file name, options, mass, base, pose."""

from __future__ import annotations

from collections.abc import Iterator, Sequence

from ...dialects import RULES, Vocabulary
from ...model import BaseKind, Body, Dialect, Pose, Recentring
from .decimals import decimal, short


def pose_words(pose: Pose | None, unit: float) -> str:
    """Return `x y z rx ry rz`; a body without a pose stands at the origin."""
    pose = pose or Pose()
    return " ".join([*map(short, pose.position), *(decimal(r, unit) for r in pose.rotation)])


def legacy_bodies(bodies: Sequence[Body]) -> Iterator[str]:
    """Yield the lines of dialect A's bodies, each counted within its kind where it has no index (section 4.2)."""
    unit = RULES[Dialect.A].pose_angle
    counts = {True: 0, False: 0}
    for body in bodies:
        fixed = body.base is BaseKind.FIXED
        index = counts[fixed] if body.index is None else body.index
        counts[fixed] += 1
        words = ["FixedBody" if fixed else "FreeBody", str(index), body.filename]
        if fixed or body.pose is not None:
            words.append(pose_words(body.pose, unit))
        yield from _directives(body, color=True)
        yield " ".join(words)


def robot_body(body: Body, dialect: Dialect, vocabulary: Vocabulary) -> Iterator[str]:
    """Yield the lines of a robot's body in dialects B to E."""
    words = [body.filename, *_options(body, vocabulary)]
    if body.mass is not None and vocabulary.mass:
        words.append(short(body.mass))
    words.append(body.base.value)
    if body.base is BaseKind.FIXED:
        words.append(pose_words(body.pose, RULES[dialect].pose_angle))
    yield from _directives(body, color=not vocabulary.options)
    yield " ".join(words)


def static_body(body: Body, dialect: Dialect, vocabulary: Vocabulary) -> Iterator[str]:
    """Yield the lines of an obstacle's body in dialects B to E."""
    yield from _directives(body, color=not vocabulary.options)
    yield " ".join([body.filename, *_options(body, vocabulary), pose_words(body.pose, RULES[dialect].pose_angle)])


def _options(body: Body, vocabulary: Vocabulary) -> Iterator[str]:
    if not vocabulary.options:
        return
    if body.recentring is not Recentring.COM:
        yield f"-a({body.recentring.value})"
    if body.color is not None:
        yield f"-c({' '.join(map(short, body.color))})"
    if body.texture is not None:
        yield f"-t({body.texture})"


def _directives(body: Body, *, color: bool) -> Iterator[str]:
    """Yield the visualiser's lines in front of a body (env-format section 3.1)."""
    if color and body.color is not None:
        yield f"#VIZMO_COLOR {' '.join(map(short, body.color[:3]))}"
    if body.label is not None:
        yield f"#VIZMO_NAME {body.label}"
