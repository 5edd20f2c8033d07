"""Connections in the other DH form: the same pose for every value of the joint (env-format section 9.3)."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from ..model import Connection, DHForm, DHParameters, JointType
from ..transforms import Array, dh_matrix, inverse, pose_matrix
from .poses import six_numbers

# Half a turn about x + z: what turned about x turns about z behind it, and the other way round.
_SWAP: Array = np.array([[0, 0, 1, 0], [0, -1, 0, 0], [1, 0, 0, 0], [0, 0, 0, 1]], dtype=np.float64)


def swaps_angles(connection: Connection, source: DHForm, target: DHForm) -> bool:
    """Whether theta and alpha of a connection change their places between two forms."""
    return source is not target and connection.joint is JointType.SPHERICAL


def in_form(connection: Connection, source: DHForm, target: DHForm) -> Connection:
    """Return a connection in another DH form.

    `Rx(alpha) Tx(a)` stands in front of the joint in Craig's form and behind it in the standard one: where alpha does
    not move, both go into the fixed transform on their side, and what is left, `Rz(theta) Tz(d)`, is the same in both.
    A spherical joint moves alpha, too. With C half a turn about x + z,
    `Rx(alpha) Tx(a) Rz(theta) Tz(d) = C Rz(alpha) Tz(a) Tx(d) Rx(theta) C^-1`: the other form, with alpha and theta
    exchanged, and a and d.
    """
    dh = connection.dh
    if source is target or (dh.alpha == 0 and dh.a == 0 and connection.joint is not JointType.SPHERICAL):
        return connection
    before, after = pose_matrix(connection.to_dh), pose_matrix(connection.to_body)
    if connection.joint is JointType.SPHERICAL:
        return replace(
            connection,
            to_dh=six_numbers(before @ _SWAP),
            dh=DHParameters(dh.theta, dh.d, dh.a, dh.alpha, dh.span),
            to_body=six_numbers(inverse(_SWAP) @ after),
            limits=connection.limits[::-1],
        )
    twist = dh_matrix(source, dh.alpha, dh.a, 0.0, 0.0)
    left = DHParameters(0.0, 0.0, dh.d, dh.theta, dh.span)
    if source is DHForm.CRAIG:
        return replace(connection, to_dh=six_numbers(before @ twist), dh=left)
    return replace(connection, to_body=six_numbers(twist @ after), dh=left)
