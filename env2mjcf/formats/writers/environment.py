"""Whole environments and robots as text, as the original readers and our own take them (env-format sections 4 to 8)."""

from __future__ import annotations

from collections.abc import Iterable, Iterator

from ...dialects import RULES, VOCABULARIES, SurfaceLabels
from ...model import Boundary, Comment, Dialect, Environment, MultiBody, MultiBodyKind, Resolution
from ..blocks import Grammar
from .bodies import legacy_bodies, robot_body, static_body
from .connections import connection_lines
from .decimals import decimal, short

_RESOLUTION_TAGS = {
    "position": "PositionRes",
    "position_factor": "PositionResFactor",
    "orientation": "Orientation",
    "time": "TimeRes",
    "rd": "RDRes",
}
# They stand in front of their bodies, where they are written anew.
_DIRECTIVES = ("#VIZMO_COLOR", "#VIZMO_NAME")
# Dialect A's reader has 256 characters for a comment.
_LONGEST_HEADER = 240


def env_text(environment: Environment) -> str:
    """Return an environment as text of its own dialect, comments at the top.

    Robots that have files of their own are left out: `robot_text` writes them. What the dialect cannot express is left
    out, too; `translate` says what that is, also where it is asked for the dialect that the environment has.
    """
    dialect = environment.dialect
    inside = [m for m in environment.multibodies if m.robot_file is None]
    legacy = VOCABULARIES[dialect].legacy_layout
    comments = _legacy_comments(environment) if legacy else _comments(environment.comments)
    lines = [*comments, *_preamble(environment)]
    lines.append(str(len(inside)))
    for multibody in inside:
        lines.append("")
        lines += _legacy(multibody, environment.semantics) if legacy else _later(multibody, dialect)
    return _joined(lines)


def robot_text(robot: MultiBody) -> str:
    """Return a robot as the text of a dialect E robot file."""
    return _joined(_robot(robot, Dialect.E))


def _joined(lines: Iterable[str]) -> str:
    # The original readers of dialects B to E fail on a file that ends with its last word.
    return "".join(f"{line}\n" for line in lines)


def _comments(comments: Iterable[Comment]) -> Iterator[str]:
    return (c.text for c in comments if c.text.split()[0] not in _DIRECTIVES)


def _legacy_comments(environment: Environment) -> Iterator[str]:
    """Yield comments that dialect A's reader takes in front of the count (env-format section 3.1)."""
    versioned = False
    for text in _comments(environment.comments):
        words = text.split()
        version = len(words) >= 3 and words[0] == "#Environment" and "Version" in words[1]
        versioned |= version
        # It stops at any other header line with this word in it, and reads so many characters of a line.
        safe = text if version else text.replace("Environment", "environment")
        yield safe[:_LONGEST_HEADER]
        for at in range(_LONGEST_HEADER, len(safe), _LONGEST_HEADER - 1):
            yield f"#{safe[at : at + _LONGEST_HEADER - 1]}"
    if not versioned and any(m.kind is MultiBodyKind.INTERNAL for m in environment.multibodies):
        yield "#Environment Version 20020327"


def _preamble(environment: Environment) -> Iterator[str]:
    vocabulary = VOCABULARIES[environment.dialect]
    if not vocabulary.boundaries or environment.boundary is None:
        return
    yield f"Boundary {_boundary(environment.boundary, vocabulary.brackets)}"
    yield from _resolution(environment.resolution, environment.dialect)
    yield ""
    yield "Multibodies"


def _boundary(boundary: Boundary, brackets: bool) -> str:
    ranges = [f"{short(a)}:{short(b)}" for a, b in zip(boundary.lower, boundary.upper, strict=True)]
    parts = ranges or [" ".join(map(short, boundary.center)), short(boundary.radius)]
    # Brackets and semicolons are words of their own to the original (env-format section 7).
    extent = f"[ {' ; '.join(parts)} ]" if brackets else " ".join(parts)
    return f"{boundary.shape.value} {extent}"


def _resolution(resolution: Resolution, dialect: Dialect) -> Iterator[str]:
    for name in VOCABULARIES[dialect].resolution:
        value: float | None = getattr(resolution, name)
        if value is not None:
            unit = RULES[dialect].configuration_angle if name == "orientation" else 1.0
            yield f"{_RESOLUTION_TAGS[name]} {decimal(value, unit)}"


def _legacy(multibody: MultiBody, semantics: str) -> Iterator[str]:
    internal = multibody.kind is MultiBodyKind.INTERNAL
    yield f"MultiBody {'Passive Internal' if internal else multibody.kind.value}"
    yield str(len(multibody.bodies))
    yield from legacy_bodies(multibody.bodies)
    yield from connection_lines(multibody.connections, Dialect.A, Grammar.of(Dialect.A, semantics).rules)


def _later(multibody: MultiBody, dialect: Dialect) -> Iterator[str]:
    if multibody.kind is MultiBodyKind.SURFACE:
        labelled = multibody.label is not None and VOCABULARIES[dialect].surface_labels is not SurfaceLabels.NONE
        yield f"Surface {multibody.label}" if labelled else "Surface"
        yield from static_body(multibody.bodies[0], dialect, VOCABULARIES[dialect])
        return
    yield multibody.kind.value
    if not multibody.moves:
        yield from static_body(multibody.bodies[0], dialect, VOCABULARIES[dialect])
        return
    yield from _robot(multibody, dialect)
    if multibody.velocity_bounds is not None:
        yield f"VelocityBounds {short(multibody.velocity_bounds.linear)} {short(multibody.velocity_bounds.angular)}"
        yield f"Controls {len(multibody.controls)}"
        yield from (" ".join(map(short, control)) for control in multibody.controls)


def _robot(robot: MultiBody, dialect: Dialect) -> Iterator[str]:
    vocabulary = VOCABULARIES[dialect]
    yield str(len(robot.bodies))
    for body in robot.bodies:
        yield from robot_body(body, dialect, vocabulary)
    if robot.adjacencies and vocabulary.adjacencies:
        yield "Adjacencies"
        yield str(len(robot.adjacencies))
        yield from (f"{i} {j}" for i, j in robot.adjacencies)
    yield from connection_lines(robot.connections, dialect, RULES[dialect])
