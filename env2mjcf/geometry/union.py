"""What the closed pieces of a mesh fill together: where they overlap, or lie in each other, it is filled once."""

from __future__ import annotations

from dataclasses import dataclass
from importlib import import_module
from importlib.util import find_spec
from typing import Any

import numpy as np

from ..diagnostics import DiagnosticLog
from ..errors import Span, counted
from ..limits import COSTLY, Work
from .analysis import Analysis
from .orientation import winding_numbers
from .topology import Bools, Floats, Ints
from .triangle_search import Jobs, Search
from .triangle_tree import forest

_NOTHING = 1e-6  # of the volume, which messages give with six digits
_JOBS = 1024  # pairs of pieces that are looked at together
_SAMPLES = 4096
_PAIRS = 4_000_000  # pairs of samples and triangles
# Roberts, "The unreasonable effectiveness of quasirandom sequences", 2018.
_STEPS = 1.2207440846057596 ** -np.arange(1.0, 4.0)


@dataclass(frozen=True, slots=True, eq=False)
class Union:
    """What is filled.

    Attributes:
        triangles: (m, 3, 3) wound outwards; what they wind around twice counts twice.
        total: Sum of the volumes of the pieces.
        volume: Volume of the union, as far as it is known.
        inner: How many pieces were left out, because they lie wholly in others.
        united: Whether pieces that cross were united by manifold3d.
        samples: From how many points the volume was estimated, while `triangles` count twice; 0 where it is exact.
    """

    triangles: Floats
    total: float
    volume: float
    inner: int = 0
    united: bool = False
    samples: int = 0


def union(analysis: Analysis, work: Work | None = None) -> Union:
    """Find what the `solids` of a mesh fill.

    A piece that crosses no other is left out where both of its sides are filled. Pieces that cross are united by
    manifold3d, where that is installed and takes them; else the volume is estimated, and their triangles stay.

    Raises:
        TooMuchWorkError: It takes more than `work` has left.
    """
    work = work or Work()
    solid, volumes = analysis.solids[analysis.component], analysis.component_volumes[analysis.solids]
    number = (np.cumsum(analysis.solids) - 1)[analysis.component[solid]]
    triangles = analysis.vertices[analysis.faces[solid]]
    order, total = np.argsort(number, kind="stable"), float(volumes.sum())
    pieces = np.split(triangles[order], np.cumsum(np.bincount(number))[:-1])
    a, b = _near_pairs(pieces, analysis.tolerance, work)
    if not len(a):
        return Union(triangles, total, total)
    meet = _meet(pieces, a, b, analysis.tolerance, work)
    kept = _bounding(pieces, volumes, a, b, meet, work)
    inner, triangles = int((~kept).sum()), triangles[kept[number]]
    found = Union(triangles, total, float(volumes[kept].sum()), inner)
    crossing = meet & kept[a] & kept[b]
    if not crossing.any():
        return found
    # In single precision, pieces that touch overlap by rounding.
    least = _NOTHING * found.volume
    united = _united([pieces[i] for i in np.flatnonzero(kept)], volumes[kept], work)
    if united is not None:
        volume = _volume(united - united.mean(axis=(0, 1)))
        # Pieces that merely touch stay as they are in the file, with manifold3d and without.
        return found if found.volume - volume <= least else Union(united, total, volume, inner, True)
    twice, samples = _twice(pieces, a[crossing], b[crossing], triangles, work)
    return found if twice <= least else Union(triangles, total, found.volume - twice, inner, False, samples)


def union_diagnostics(found: Union, log: DiagnosticLog, subject: str, span: Span | None = None) -> None:
    """Record which pieces overlap, and what that does to the mass: with both figures, and how they came about."""
    inner = f"{counted(found.inner, 'closed piece')} wholly inside of others"
    sums = f"the volumes of all pieces add up to {found.total:.6g}"
    if found.samples:
        message = f"closed pieces overlap, and what they share counts twice in the mass: {sums}, their union has about "
        message += f"{found.volume:.4g} (estimated from {found.samples} points)"
        hint = "unite the pieces in a modelling program"
        if not available():
            hint += ', or install manifold3d, which then does: pip install "env2mjcf[solids]"'
        log.warn("GEO246", subject, message, hint=hint, span=span)
    elif found.united:
        also = f", {inner}," if found.inner else ""
        message = f"closed pieces overlap{also} and were united by manifold3d for the mass: "
        log.info("GEO245", subject, f"{message}{sums}, their union has {found.volume:.6g}", span=span)
    elif found.inner:
        log.info(
            "GEO245",
            subject,
            f"{inner} do not count in the mass: {sums}, their union has {found.volume:.6g}",
            span=span,
        )


def available() -> bool:
    """Tell whether pieces that cross can be united."""
    return find_spec("manifold3d") is not None


def _volume(triangles: Floats) -> float:
    return float(np.einsum("ij,ij->", triangles[:, 0], np.cross(triangles[:, 1], triangles[:, 2])) / 6)


def _near_pairs(pieces: list[Floats], tolerance: float, work: Work) -> tuple[Ints, Ints]:
    """Return the pairs of pieces whose boxes overlap."""
    none = np.zeros(0, dtype=np.int64)
    if len(pieces) < 2:
        return none, none
    low = np.array([p.min(axis=(0, 1)) for p in pieces]) + tolerance
    high = np.array([p.max(axis=(0, 1)) for p in pieces])
    first, second = [none], [none]
    for i in range(len(pieces) - 1):
        work.spend(len(pieces) - i)
        near = ((low[i] < high[i + 1 :]) & (low[i + 1 :] < high[i])).all(axis=1)
        second.append(i + 1 + np.flatnonzero(near))
        first.append(np.full(len(second[-1]), i))
    return np.concatenate(first), np.concatenate(second)


def _meet(pieces: list[Floats], a: Ints, b: Ints, tolerance: float, work: Work) -> Bools:
    """Tell which pairs of surfaces touch or cross, (p,)."""
    trees, out = forest(pieces), np.zeros(len(a), dtype=np.bool_)
    size = np.array([len(p) for p in pieces])
    for i in range(0, len(a), _JOBS):
        first, second = a[i : i + _JOBS], b[i : i + _JOBS]
        work.spend(COSTLY * int((size[first] + size[second]).sum()))
        count = len(first)
        jobs = Jobs(first, second, np.tile(np.eye(3), (count, 1, 1)), np.zeros((count, 3)), np.arange(count))
        found = Search(trees, jobs, np.full(count, 2 * tolerance), tolerance).run()
        out[i : i + _JOBS] = found.distance <= tolerance
    return out


def _around(pieces: list[Floats], i: int, others: Ints, work: Work) -> Floats:
    """Return how often each of the others winds around piece i, which does not meet them."""
    probe = pieces[i][0].mean(axis=0)[None]
    return np.array([_winding(probe, pieces[j], work)[0] for j in others])


def _winding(points: Floats, triangles: Floats, work: Work) -> Floats:
    faces = np.arange(3 * len(triangles)).reshape(-1, 3)
    return np.round(winding_numbers(points, triangles.reshape(-1, 3), faces, work))


def _bounding(pieces: list[Floats], volumes: Floats, a: Ints, b: Ints, meet: Bools, work: Work) -> Bools:
    """Tell which pieces bound what is filled, or meet others, so that this is not known, (p,)."""
    kept = np.ones(len(pieces), dtype=np.bool_)
    alone = ~np.isin(np.arange(len(pieces)), np.concatenate([a[meet], b[meet]]))
    for i in np.flatnonzero(alone).tolist():
        others = np.concatenate([b[a == i], a[b == i]])
        outside = float(_around(pieces, i, others, work).sum())
        kept[i] = (outside > 0) != (outside + np.sign(volumes[i]) > 0)
    return kept


def _united(pieces: list[Floats], volumes: Floats, work: Work) -> Floats | None:
    """Return the triangles (m, 3, 3) of the union, in an order of their own; None where it cannot be made."""
    if not available():
        return None
    # By name, because it has no complete type hints; only here, because it is optional.
    manifold3d: Any = import_module("manifold3d")
    outward = np.flatnonzero(volumes > 0)
    bodies = {i: [pieces[i]] for i in outward.tolist()}
    for i in np.flatnonzero(volumes <= 0).tolist():
        holders = outward[_around(pieces, i, outward, work) > 0]
        if not len(holders):
            return None
        bodies[int(holders[np.argmin(volumes[holders])])].append(pieces[i])
    solids: list[Any] = []
    for parts in bodies.values():
        points, faces = np.unique(np.concatenate(parts).reshape(-1, 3), axis=0, return_inverse=True)
        faces = faces.reshape(-1, 3).astype(np.uint64)
        solids.append(manifold3d.Manifold(manifold3d.Mesh64(points, faces)))
    result = manifold3d.Manifold.batch_boolean(solids, manifold3d.OpType.Add)
    if any(s.status() != manifold3d.Error.NoError for s in (*solids, result)):
        return None
    mesh = result.to_mesh64()
    triangles = mesh.vert_properties[:, :3][mesh.tri_verts.astype(np.int64)]
    # Sums of them must not depend on the order in which threads made them.
    return _in_order(triangles) if len(triangles) else None


def _in_order(triangles: Floats) -> Floats:
    """Return triangles with the least corner first, and sorted."""
    rank = np.unique(triangles.reshape(-1, 3), axis=0, return_inverse=True)[1].reshape(-1, 3)
    turn = (np.argmin(rank, axis=1)[:, None] + np.arange(3)) % 3
    rank = np.take_along_axis(rank, turn, axis=1)
    return np.take_along_axis(triangles, turn[:, :, None], axis=1)[np.lexsort(rank.T[::-1])]


def _twice(pieces: list[Floats], a: Ints, b: Ints, triangles: Floats, work: Work) -> tuple[float, int]:
    """Estimate the volume that counts more than once, in the box of all that pairs of pieces may share."""
    lows, highs = (np.array([f(p, axis=(0, 1)) for p in pieces]) for f in (np.min, np.max))
    low, high = np.maximum(lows[a], lows[b]).min(axis=0), np.minimum(highs[a], highs[b]).max(axis=0)
    count = max(_SAMPLES // 4, min(_SAMPLES, _PAIRS // len(triangles)))
    points = low + (high - low) * (((np.arange(count)[:, None] + 0.5) * _STEPS) % 1.0)
    more = np.maximum(_winding(points, triangles, work) - 1, 0)
    return float(more.mean() * np.prod(high - low)), count
