"""Rotations, quaternions and homogeneous transforms, batched over leading axes, in radians.

Conventions (docs/format/kinematics.md): column vectors, `p_world = R p + t`, right-handed, quaternions `w x y z`.
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from numpy.typing import ArrayLike, NDArray

from .model.environment import DHForm, Pose

Array = NDArray[np.float64]


def real_array(values: ArrayLike, what: str, names: Sequence[str] = ()) -> Array:
    """Return finite real numbers as float64: how every array is checked that a public function takes.

    Args:
        values: The array, or what becomes one.
        what: What it is called in messages.
        names: What the entries of its last axis are called.

    Raises:
        ValueError: It holds text, complex numbers, objects or masked entries, a NaN or an infinity.
    """
    if type(values) is np.ndarray and values.dtype == np.float64:
        array = values
    else:
        try:
            found = np.asarray(values)
        except (TypeError, ValueError) as error:
            raise ValueError(f"{what} is not an array of numbers: {error}") from error
        rows = values if found.ndim > 1 and isinstance(values, list | tuple) else (values,)
        if any(isinstance(row, np.ma.MaskedArray) for row in rows):
            raise ValueError(f"{what} is a masked array; expected plain numbers")
        if found.dtype.kind not in "biuf":
            raise ValueError(f"{what} holds values of type {found.dtype}; expected real numbers")
        array = found.astype(np.float64, copy=False)
    finite = np.isfinite(array)
    if not finite.all():
        where = tuple(np.argwhere(~finite)[0].tolist())
        subject, row = f"{what} holds", where
        if where and array.shape[-1] == len(names):
            subject, row = f"{names[where[-1]]} is", where[:-1]
        at = f" in row {', '.join(map(str, row))}" if row else ""
        raise ValueError(f"{subject} {array[where]}{at}; expected a finite number")
    return array


def rotation_matrix(rx: ArrayLike, ry: ArrayLike, rz: ArrayLike) -> Array:
    """Return Rz(rz) Ry(ry) Rx(rx), shape (..., 3, 3), from angles of shape (...)."""
    x, y, z = np.broadcast_arrays(*(np.asarray(v, dtype=np.float64) for v in (rx, ry, rz)))
    (cx, cy, cz), (sx, sy, sz) = (np.cos(v) for v in (x, y, z)), (np.sin(v) for v in (x, y, z))
    r = np.empty((*x.shape, 3, 3))
    r[..., 0, 0] = cz * cy
    r[..., 0, 1] = cz * sy * sx - sz * cx
    r[..., 0, 2] = cz * sy * cx + sz * sx
    r[..., 1, 0] = sz * cy
    r[..., 1, 1] = sz * sy * sx + cz * cx
    r[..., 1, 2] = sz * sy * cx - cz * sx
    r[..., 2, 0] = -sy
    r[..., 2, 1] = cy * sx
    r[..., 2, 2] = cy * cx
    return r


def transform(rotation: Array, position: ArrayLike) -> Array:
    """Return the homogeneous transform (..., 4, 4) of a rotation (..., 3, 3) and a position (..., 3)."""
    t = np.zeros((*rotation.shape[:-2], 4, 4))
    t[..., :3, :3] = rotation
    t[..., :3, 3] = position
    t[..., 3, 3] = 1.0
    return t


def shifted(pose: Array, offset: ArrayLike) -> Array:
    """Return the pose, (..., 4, 4), of a frame whose origin is at an offset, (3,), in the frame of a pose."""
    out = pose.copy()
    out[..., :3, 3] += pose[..., :3, :3] @ np.asarray(offset, dtype=np.float64)
    return out


def translated(poses: Array, by: ArrayLike) -> Array:
    """Return poses, (..., 4, 4), moved by a vector of the world, (3,)."""
    vector = np.asarray(by, dtype=np.float64)
    if not vector.any():
        return poses
    out = poses.copy()
    out[..., :3, 3] += vector
    return out


def pose_matrix(pose: Pose | None) -> Array:
    """Return the transform (4, 4) of a six-number pose; the identity for None."""
    if pose is None:
        return np.eye(4)
    return transform(rotation_matrix(*pose.rotation), pose.position)


def inverse(t: Array) -> Array:
    """Return the inverse of rigid transforms (..., 4, 4)."""
    r = np.swapaxes(t[..., :3, :3], -1, -2)
    return transform(r, -(r @ t[..., :3, 3, None])[..., 0])


def dh_matrix(form: DHForm, alpha: ArrayLike, a: ArrayLike, d: ArrayLike, theta: ArrayLike) -> Array:
    """Return the transform (..., 4, 4) of a DH row.

    Craig's `Rx(alpha) Tx(a) Rz(theta) Tz(d)` (Craig, Introduction to Robotics, eq. 3.6) or the standard
    `Rz(theta) Tz(d) Tx(a) Rx(alpha)` of Denavit and Hartenberg.
    """
    alpha, a, d, theta = np.broadcast_arrays(*(np.asarray(v, dtype=np.float64) for v in (alpha, a, d, theta)))
    zero = np.zeros_like(alpha)
    rx = rotation_matrix(alpha, zero, zero)
    rz = rotation_matrix(zero, zero, theta)
    tx = np.stack([a, zero, zero], axis=-1)
    tz = np.stack([zero, zero, d], axis=-1)
    if form is DHForm.CRAIG:
        return transform(rx, (rx @ tx[..., None])[..., 0]) @ transform(rz, (rz @ tz[..., None])[..., 0])
    return transform(rz, (rz @ (tz + tx)[..., None])[..., 0]) @ transform(rx, np.zeros(3))


def quaternion_from_angles(rx: ArrayLike, ry: ArrayLike, rz: ArrayLike) -> Array:
    """Return the unit quaternion (..., 4) of Rz(rz) Ry(ry) Rx(rx)."""
    x, y, z = np.broadcast_arrays(*(np.asarray(v, dtype=np.float64) / 2 for v in (rx, ry, rz)))
    (cx, cy, cz), (sx, sy, sz) = (np.cos(v) for v in (x, y, z)), (np.sin(v) for v in (x, y, z))
    return np.stack(
        [
            cx * cy * cz + sx * sy * sz,
            sx * cy * cz - cx * sy * sz,
            cx * sy * cz + sx * cy * sz,
            cx * cy * sz - sx * sy * cz,
        ],
        axis=-1,
    )


def angles_from_quaternion(quaternion: ArrayLike) -> tuple[Array, Array, Array]:
    """Return (rx, ry, rz), each (...), of unit quaternions (..., 4); ry lies in [-pi/2, pi/2]."""
    w, x, y, z = np.moveaxis(np.asarray(quaternion, dtype=np.float64), -1, 0)
    sine = np.clip(2 * (w * y - z * x), -1.0, 1.0)
    rx = np.arctan2(2 * (w * x + y * z), 1 - 2 * (x * x + y * y))
    rz = np.arctan2(2 * (w * z + x * y), 1 - 2 * (y * y + z * z))
    # At ry = +-pi/2 only rx -+ rz is determined: rz is set to zero there.
    locked = np.abs(sine) > 1 - 1e-14
    rx = np.where(locked, 2 * np.arctan2(x, w), rx)
    rz = np.where(locked, 0.0, rz)
    return rx, np.arcsin(sine), rz


def quaternion_from_matrix(rotation: ArrayLike) -> Array:
    """Return the unit quaternion (..., 4), w >= 0, of rotations (..., 3, 3).

    Shepperd's method: the largest of the four components is found from the trace, the others by division
    (Shepperd, Quaternion from Rotation Matrix, 1978), so that no digit is lost near half turns.
    """
    r = np.asarray(rotation, dtype=np.float64)
    trace = np.trace(r, axis1=-2, axis2=-1)
    diagonal = np.diagonal(r, axis1=-2, axis2=-1)
    squares = np.concatenate([trace[..., None], 2 * diagonal - trace[..., None]], axis=-1)  # 4 c_i^2 - 1
    skew = np.stack([r[..., 2, 1] - r[..., 1, 2], r[..., 0, 2] - r[..., 2, 0], r[..., 1, 0] - r[..., 0, 1]], axis=-1)
    product = np.empty((*trace.shape, 4, 4))  # 4 c_i c_j
    for i in range(4):
        product[..., i, i] = squares[..., i] + 1
    for i in range(3):
        product[..., 0, i + 1] = product[..., i + 1, 0] = skew[..., i]
    for i, j in ((0, 1), (0, 2), (1, 2)):
        product[..., i + 1, j + 1] = product[..., j + 1, i + 1] = r[..., i, j] + r[..., j, i]
    largest = np.argmax(squares, axis=-1)
    q = np.take_along_axis(product, largest[..., None, None], axis=-2)[..., 0, :]
    q = q / np.linalg.norm(q, axis=-1, keepdims=True)
    return np.where(q[..., :1] < 0, -q, q)


def matrix_from_quaternion(quaternion: ArrayLike) -> Array:
    """Return the rotation (..., 3, 3) of unit quaternions (..., 4), w x y z."""
    w, x, y, z = np.moveaxis(np.asarray(quaternion, dtype=np.float64), -1, 0)
    rows = (
        (1 - 2 * (y * y + z * z), 2 * (x * y - w * z), 2 * (x * z + w * y)),
        (2 * (x * y + w * z), 1 - 2 * (x * x + z * z), 2 * (y * z - w * x)),
        (2 * (x * z - w * y), 2 * (y * z + w * x), 1 - 2 * (x * x + y * y)),
    )
    return np.stack([np.stack(row, axis=-1) for row in rows], axis=-2)


def pose_gaps(found: Array, expected: Array, radii: ArrayLike) -> Array:
    """Return how far bodies are from where they should be, (...).

    An upper bound of the distance over a ball about each body's origin: how far that is off, and twice the radius
    times the sine of half the turn.

    Args:
        found: Poses, (..., 4, 4).
        expected: Where they should be, of the same shape.
        radii: (...) greatest distance of a vertex from the origin.
    """
    moved = np.linalg.norm(found[..., :3, 3] - expected[..., :3, 3], axis=-1)
    # |R1 - R2| (Frobenius) is 2 sqrt(2) sin(w / 2) for a turn by w, and keeps its digits where w is small.
    turned = np.linalg.norm(found[..., :3, :3] - expected[..., :3, :3], axis=(-2, -1)) / np.sqrt(2)
    return moved + turned * np.asarray(radii)


def wrap(angle: ArrayLike) -> Array:
    """Return angles reduced by whole turns to [-pi, pi)."""
    a = np.asarray(angle, dtype=np.float64)
    reduced = np.remainder(a + np.pi, 2 * np.pi) - np.pi
    # Angles that need no reduction keep every digit.
    return np.where((a >= -np.pi) & (a < np.pi), a, reduced)
