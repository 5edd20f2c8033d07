"""The lines of connections, their fields in each dialect's order."""

from __future__ import annotations

import math
from collections.abc import Iterator, Sequence

from ...dialects import VOCABULARIES, DialectRules
from ...model import Connection, Dialect, JointLimits, JointType
from .bodies import pose_words
from .decimals import decimal, short

_WHOLE_TURNS = {JointType.REVOLUTE: 1, JointType.SPHERICAL: 2, JointType.SMA: 1}


def connection_lines(connections: Sequence[Connection], dialect: Dialect, rules: DialectRules) -> Iterator[str]:
    """Yield the tag, the count and each connection."""
    legacy = VOCABULARIES[dialect].legacy_layout
    yield "Connection" if legacy else "Connections"
    yield str(len(connections))
    for connection in connections:
        fields = {name: _field(connection, name, dialect, rules) for name in rules.connection_fields}
        head = [str(connection.previous), str(connection.next)]
        if legacy:
            yield " ".join([*head, fields.pop("actuated")])
        else:
            yield " ".join([*head, fields.pop("joint"), fields.pop("limits")]).rstrip()
        yield "  ".join(fields.values())


def written_limits(connection: Connection) -> tuple[JointLimits, ...]:
    """Return the limits that a dialect which demands them must have: a whole turn where there are none."""
    turn = JointLimits(-math.pi, math.pi)
    return connection.limits or (turn,) * _WHOLE_TURNS.get(connection.joint, 0)


def _field(connection: Connection, name: str, dialect: Dialect, rules: DialectRules) -> str:
    if name == "actuated":
        return connection.actuated or "Actuated"
    if name == "joint":
        return connection.joint.value
    if name == "limits":
        return _limits(connection, rules) if VOCABULARIES[dialect].limits else ""
    if name == "dh":
        return _dh(connection, rules)
    return pose_words(connection.to_dh if name == "to_dh" else connection.to_body, rules.pose_angle)


def _limits(connection: Connection, rules: DialectRules) -> str:
    unit = 1.0 if connection.joint is JointType.PRISMATIC else rules.configuration_angle
    return " ".join(f"{decimal(x.lower, unit)}:{decimal(x.upper, unit)}" for x in written_limits(connection))


def _dh(connection: Connection, rules: DialectRules) -> str:
    dh, unit = connection.dh, rules.dh_angle
    words = [decimal(dh.alpha, unit), short(dh.a), short(dh.d), decimal(dh.theta, unit)]
    if connection.sma is not None:
        words += [short(connection.sma.length), short(connection.sma.width)]
    return " ".join(words)
