"""A picture of a path or roadmap: dots and lines that say what is valid, and the robot where the first is not."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from ..companions.records import Configurations

if TYPE_CHECKING:
    from ..simulation.edge_verdicts import EdgeVerdicts
    from ..simulation.scene import Scene
    from ..simulation.verdicts import Verdicts
    from ..transforms import Array
    from .marks import Color, Mark

# A line is cut so finely that a turning robot's way looks round.
_PARTS = 8


def draw(scene: Scene, rows: Configurations, nodes: Verdicts, edges: EdgeVerdicts | None, file: str) -> None:
    """Draw the nodes as dots and the edges as lines, green where they are valid and red where they are not.

    Both go through one point of the robot that moves. The robot stands, and what it touches is shown, where the first
    configuration is invalid, else where the first edge is; at the first configuration if all is valid.

    Raises:
        RenderError: It cannot be drawn here, or pillow is missing.
    """
    from .pictures import picture

    q, wrong = _place(scene, rows, nodes, edges)
    picture(scene, q, file=file, contacts=wrong, marks=_marks(scene, rows, nodes, edges))


def _place(scene: Scene, rows: Configurations, nodes: Verdicts, edges: EdgeVerdicts | None) -> tuple[Array, bool]:
    if not nodes.valid.all():
        return rows.q[int(np.argmin(nodes.valid))], True
    if edges is not None and not edges.valid.all():
        verdict = edges.verdict(int(np.argmin(edges.valid)))
        return (rows.q[verdict.start] if verdict.at is None else verdict.at.q), True
    return rows.q[0], False


def _marks(scene: Scene, rows: Configurations, nodes: Verdicts, edges: EdgeVerdicts | None) -> list[Mark]:
    from .marks import BAD, GOOD, Points, Polyline

    def color(valid: bool) -> Color:
        return GOOD if valid else BAD

    marks: list[Mark] = []
    for robot in _moving(scene, rows.q):
        if rows.graph is not None and edges is not None:
            starts, ends, owner = rows.graph.edges.pieces()
            lines = _points(scene, _cut(scene, starts, ends), robot).reshape(len(owner), _PARTS + 1, 3)
            # What is invalid is drawn last, over the rest.
            for i in np.argsort(~edges.valid[owner], kind="stable").tolist():
                marks.append(Polyline(lines[i], color(bool(edges.valid[owner[i]]))))
        places = _points(scene, rows.q, robot)
        marks += [Points(places[nodes.valid == so], color(so)) for so in (True, False) if (nodes.valid == so).any()]
    return marks


def _moving(scene: Scene, q: Array) -> list[int]:
    """Return the robots that are not at one place in all rows; the first one if none moves."""
    moving = [i for i, s in enumerate(scene.space.robot_slices) if np.ptp(q[:, s], axis=0).any()]
    return moving or ([0] if scene.space.robot_slices else [])


def _cut(scene: Scene, starts: Array, ends: Array) -> Array:
    """Return even steps along straight edges, (m * (parts + 1), dim)."""
    delta = scene.space.difference(starts, ends)
    shares = np.linspace(0.0, 1.0, _PARTS + 1)
    return (starts[:, None] + shares[:, None] * delta[:, None]).reshape(-1, scene.space.dim)


def _points(scene: Scene, q: Array, robot: int) -> Array:
    from .trails import reference_points

    return reference_points(scene, q)[robot]
