"""Verdicts on the edges of a path or roadmap: whether each is valid, and where it first is not."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from math import isfinite
from typing import NoReturn

import numpy as np
from numpy.typing import NDArray

from ..contact.edges import EdgeSteps, even_rows
from ..contact.types import Verdict
from ..diagnostics import DiagnosticLog
from ..transforms import Array
from .scene import Scene

Indices = NDArray[np.int64]

# More checks than this take hours: the step is a slip.
_MOST_CHECKS = 1e10


@dataclass(frozen=True, slots=True, eq=False)
class Edges:
    """Ways between configurations: straight, or through others.

    Attributes:
        q: (n, dim) nodes.
        ends: (m, 2) indices into them.
        between: For each edge (k, dim) configurations on its way; empty where no edge has any.
        labels: What each is called.
    """

    q: Array
    ends: Indices
    between: tuple[Array, ...]
    labels: Sequence[str]

    def __len__(self) -> int:
        return len(self.ends)

    def pieces(self) -> tuple[Array, Array, Indices]:
        """Return the straight pieces in order: where they begin and end, (s, dim) each, and of which edge they are."""
        if not self.between:
            return self.q[self.ends[:, 0]], self.q[self.ends[:, 1]], np.arange(len(self.ends))
        dim = self.q.shape[1]
        corners = [
            np.concatenate([self.q[[i]], b, self.q[[j]]]) for (i, j), b in zip(self.ends, self.between, strict=True)
        ]
        owner = np.repeat(np.arange(len(corners)), [len(c) - 1 for c in corners])
        starts = np.concatenate([np.zeros((0, dim)), *(c[:-1] for c in corners)])
        return starts, np.concatenate([np.zeros((0, dim)), *(c[1:] for c in corners)]), owner


@dataclass(frozen=True, slots=True, eq=False)
class EdgeVerdict:
    """What is known of one edge.

    Attributes:
        label: What it is called.
        start, end: Indices of its nodes.
        valid: Whether nothing is wrong with it.
        checked: Whether it was looked at: not where the file's poses belong to no configuration.
        proved: Whether it is proved that nothing touches between the checks; None without `certified`.
        fraction: Where the first check fails, from 0 at its start to 1 at its end; None where none does.
        at: What is wrong there.
    """

    label: str
    start: int
    end: int
    valid: bool
    checked: bool
    proved: bool | None
    fraction: float | None
    at: Verdict | None


class EdgeVerdicts:
    """Verdicts on edges: limits, boundary and contacts, at even steps.

    Args:
        scene: The scene.
        edges: The edges.
        resolution: As for `Scene.edge_in_collision`.
        certified: Prove, too, that nothing touches between the steps.
        checked: (m,) which edges to look at; None for all.

    Raises:
        FormatError: The file's resolution is so small, or an edge so long, that the checks would not end.
        ValueError: The resolution that is given is not positive, or so small.

    Attributes:
        resolution: The greatest distance in metres that any point moves between two checks.
        valid: (m,) whether nothing is wrong.
        checked: (m,) whether it was looked at.
        stepped: (m,) whether no check failed.
        proved: (m,) whether it is proved; None without `certified`.
    """

    def __init__(
        self,
        scene: Scene,
        edges: Edges,
        resolution: float | None = None,
        certified: bool = False,
        checked: NDArray[np.bool_] | None = None,
    ) -> None:
        self._scene, self._edges = scene, edges
        self._steps = EdgeSteps(scene.compiled.assembly, scene.space)
        self.resolution = self._steps.resolution(resolution)
        self.checked = np.ones(len(edges), dtype=bool) if checked is None else checked
        self.valid = self.checked.copy()
        self._fractions = np.full(len(edges), np.nan)
        self._places = np.zeros((len(edges), scene.space.dim))
        starts, ends, owner = edges.pieces()
        kept = self.checked[owner]
        starts, ends, owner = starts[kept], ends[kept], owner[kept]
        delta = scene.space.difference(starts, ends)
        counts = self._steps.counts(starts, delta, self.resolution)
        if counts.sum(dtype=np.float64) > _MOST_CHECKS:
            self._refuse(starts, delta, owner, resolution)
        self._walk(starts, delta, owner, counts)
        self.stepped = self.valid.copy()
        self.proved: NDArray[np.bool_] | None = None
        if certified:
            self.proved = self.valid.copy()
            left = self.valid[owner]
            free = np.asarray(scene.edge_is_free(starts[left], ends[left], progress=True))
            self.proved[owner[left][~free]] = False
            self.valid &= self.proved

    def verdict(self, index: int) -> EdgeVerdict:
        """Return all that is known of one edge."""
        start, end = self._edges.ends[index].tolist()
        fraction = float(self._fractions[index])
        failed = isfinite(fraction)
        return EdgeVerdict(
            self._edges.labels[index],
            start,
            end,
            bool(self.valid[index]),
            bool(self.checked[index]),
            None if self.proved is None else bool(self.proved[index]),
            fraction if failed else None,
            self._scene.explain(self._places[index]) if failed else None,
        )

    def _refuse(self, start: Array, delta: Array, owner: Indices, given: float | None) -> NoReturn:
        """Raise what is to blame for steps without end: the resolution that was given, the file's, or the edges."""
        message = f"in steps of {self.resolution:g} m the edges would take too many checks"
        if given is not None:
            raise ValueError(f"resolution is {given}; {message}")
        environment, log = self._scene.environment, DiagnosticLog()
        counts = self._steps.counts(start, delta, self._steps.default_resolution)
        if counts.sum(dtype=np.float64) <= _MOST_CHECKS:
            message = f"PositionRes {environment.resolution.position:g}: {message}"
            hint = "correct PositionRes, or give --resolution"
            log.fail("CFG536", "PositionRes", message, hint=hint, span=environment.resolution.span)
        longest = self._edges.labels[int(owner[np.argmax(counts)])]
        hint = "is a number of its ends wrong? Else give --resolution"
        log.fail("CFG537", longest, f"{longest} is too long: {message}", hint=hint)

    def _walk(self, start: Array, delta: Array, owner: Indices, counts: Indices) -> None:
        """Check all edges at even steps, `counts` of each, and note the first check of each that fails."""
        failed = self._scene.first_invalid_steps(start, delta, counts, progress=True)
        bad = np.flatnonzero(failed >= 0)
        edges, which = np.unique(owner[bad], return_index=True)
        piece = bad[which]
        self.valid[edges] = False
        self._places[edges] = even_rows(start[piece], delta[piece], counts[piece], failed[piece])
        whole = np.bincount(owner, counts, minlength=len(self.valid))[edges]
        before = (np.cumsum(counts) - counts)[piece] - (np.cumsum(counts) - counts)[np.searchsorted(owner, edges)]
        self._fractions[edges] = (before + failed[piece]) / np.maximum(whole - 1, 1)
