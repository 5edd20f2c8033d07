"""The summary of a scene as calm tables."""

from __future__ import annotations

import math
import sys
from collections.abc import Iterable, Iterator, Sequence
from typing import TYPE_CHECKING

from rich.console import RenderableType
from rich.padding import Padding
from rich.table import Table
from rich.text import Text

from ..contact.types import short
from ..errors import counted, robots_named
from ..model.environment import Boundary, Resolution
from ..summary import DofSummary, RobotSummary, SceneSummary
from .terminal import one_line

if TYPE_CHECKING:
    from ..report import MeshReport, Report
    from ..simulation.verdicts import PairCount

# Rows about degrees of freedom in all, what the head of a robot counts for among them, and rows about meshes.
_ROWS, _ROBOT_ROWS, _MESHES = 80, 4, 30
# Characters of a cell, and of a name.
_LONGEST, _LONGEST_NAME = 400, 80
_UNITS = {"turns": "turns", "pi": "pi rad", "length": "length"}


def text_part(scene: SceneSummary, every: bool) -> Iterator[RenderableType]:
    """Yield what the text says: of robots and queries the first, or every one."""
    most = sys.maxsize if every else _ROWS
    yield Text(one_line(scene.path), "bold")
    rows = [
        ("dialect", f"{scene.dialect}: {scene.told_by}"),
        ("semantics", _semantics(scene)),
        ("scale", f"{scene.metres_per_unit:g} m for a file unit"),
        ("boundary", _boundary(scene.boundary)),
        ("resolution", _resolution(scene.resolution)),
        ("robots", str(len(scene.robots))),
        ("obstacles", _list(scene.obstacles)),
    ]
    if scene.surfaces:
        rows.append(("surfaces", f"{_list(scene.surfaces)} (drawn, never touched)"))
    rows += [
        ("query", f"{robots_named(q.robots)}: {q.configurations} configurations{f', {q.label}' if q.label else ''}")
        for q in scene.queries[:most]
    ]
    rows += _left("query", len(scene.queries) - most)
    yield _facts(rows)
    for number, robot in enumerate(scene.robots):
        if most <= 0:
            yield Text(f"\nand {counted(len(scene.robots) - number, 'more robot')} (--verbose lists all)", "dim")
            return
        yield from _robot(number, robot, most)
        most -= len(robot.dofs) + _ROBOT_ROWS


def geometry_part(report: Report, every: bool) -> Iterator[RenderableType]:
    """Yield what meshes add: about the first of them, or about every one."""
    meshes = report.meshes if every else report.meshes[:_MESHES]
    yield Text(f"\nMeshes, collision {report.collision}", "bold")
    table = _table("file", "triangles", "closed", "convex", "cells", "collides as", right=(1, 4))
    for mesh in meshes:
        name = _short(mesh.file, _LONGEST_NAME)
        table.add_row(*_cells(name, mesh.triangles, _closed(mesh), _yes(mesh.convex), mesh.cells, mesh.note))
    for row in _left("...", len(report.meshes) - len(meshes)):
        table.add_row(*_cells(*row))
    yield _indented(table)
    proofs = {m.file: m.certificate for m in meshes if m.certificate is not None}
    if proofs:
        yield Text("\nHow far that is from the meshes", "bold")
        yield _facts((_short(file, _LONGEST_NAME), str(proof)) for file, proof in proofs.items())
    yield Text("\nWhole scene", "bold")
    yield _facts(
        [
            ("extent", f"{report.extent:.6g} m"),
            *_origin(report.origin),
            ("mass", f"{report.mass:.6g} kg, all links"),
            ("geoms", f"{report.geoms} that collide"),
            ("pairs", f"{report.pairs} tested"),
            ("certain", f"beyond {report.band:.2g} m of contact"),
            *_walls(report.wall_speed),
        ]
    )


def _origin(origin: tuple[float, float, float]) -> list[tuple[str, str]]:
    return [("origin", f"of the MJCF: {' '.join(map(short, origin))} m in the file's frame")] if any(origin) else []


def _walls(speed: float | None) -> list[tuple[str, str]]:
    return [] if speed is None else [("walls", f"hold what is no faster than {speed:g} m/s in MuJoCo")]


def pairs_part(counts: Sequence[PairCount], samples: int) -> Iterator[RenderableType]:
    """Yield every tested pair, and how often it touched."""
    yield Text("\nTested pairs", "bold")
    table = _table("link", "other", "touch")
    for count in counts:
        table.add_row(*_cells(count.link, count.other, _touch(count)))
    yield _indented(table)
    if any(not c.constant for c in counts):
        often = {w: sum(c.verdict == w and not c.constant for c in counts) for w in ("never", "always")}
        yield Text(
            f"  sampled, not proved: home and {samples - 1} uniform configurations; "
            f"{often['never']} pairs never touched, {often['always']} always did",
            "dim",
        )


def _touch(count: PairCount) -> str:
    if count.constant:
        return f"{count.verdict}: neither moves against the other"
    if count.verdict == "sometimes":
        return f"in {count.touches} of {count.samples} samples"
    return f"{count.verdict}, in {count.samples} samples"


def _left(name: str, count: int) -> list[tuple[str, str]]:
    """Return a row, if any, that tells how many more there are."""
    return [(name, f"and {count} more (--verbose lists all)")] if count > 0 else []


def _robot(number: int, robot: RobotSummary, most: int) -> Iterator[RenderableType]:
    where = "".join(f", {one_line(_short(x))}" for x in (robot.label, robot.file) if x)
    yield Text(f"\nRobot {number}{where}", "bold")
    yield _facts([("base", robot.base), ("bodies", _list(robot.links)), ("freedom", f"{len(robot.dofs)} degrees")])
    if not robot.dofs:
        return
    table = _table("", "unit", "limits in file", "home", "limits in rad, m", "home", right=(3, 5))
    for dof in robot.dofs[:most]:
        of_file = _limits(dof, dof.lower, dof.upper), short(dof.home)
        in_si = _limits(dof, dof.lower_si, dof.upper_si), short(dof.home_si)
        table.add_row(*_cells(_short(dof.name, _LONGEST_NAME), _UNITS[dof.unit], *of_file, *in_si))
    for row in _left("...", len(robot.dofs) - most):
        table.add_row(*_cells(*row))
    yield _indented(table)


def _limits(dof: DofSummary, lower: float, upper: float) -> str:
    if dof.periodic:
        return "turns freely"
    if math.isinf(lower) and math.isinf(upper):
        return "none"
    return f"{short(lower)} to {short(upper)}"


def _semantics(scene: SceneSummary) -> str:
    apart = scene.readings
    if apart is None:
        return f"the {scene.semantics}'s"
    reading = f"the {scene.semantics}'s; the {apart.other}'s reading"
    if apart.distance == 0:
        return f"{reading} puts every link at the same place at home"
    return f"{reading} puts links up to {apart.distance:.6g} m ({one_line(apart.link)}) elsewhere at home"


def _boundary(boundary: Boundary | None) -> str:
    if boundary is None:
        return "none"
    if boundary.lower:
        sides = zip("xyz", boundary.lower, boundary.upper, strict=False)
        inside = ", ".join(f"{axis} {short(low)} to {short(high)}" for axis, low, high in sides)
    else:
        inside = f"radius {boundary.radius:g} around {' '.join(map(short, boundary.center))}"
    return f"{boundary.shape.value}, {inside}, file units"


def _resolution(resolution: Resolution) -> str:
    position, angle = resolution.position, resolution.orientation
    steps = [f"{position:g} file units"] if position is not None else []
    steps += [f"{angle:g} rad"] if angle is not None else []
    return ", ".join(steps) or "none"


def _list(names: Sequence[str], most: int = 12) -> str:
    shown = ", ".join(one_line(n) for n in names[:most])
    more = f", and {len(names) - most} more" if len(names) > most else ""
    return f"{len(names)}: {shown}{more}" if names else "none"


def _closed(mesh: MeshReport) -> str:
    return f"{mesh.solids} of {mesh.solids + mesh.sheets}" if mesh.solids and mesh.sheets else _yes(mesh.closed)


def _yes(value: bool) -> str:
    return "yes" if value else "no"


def _facts(rows: Iterable[tuple[str, str]]) -> RenderableType:
    table = Table(box=None, show_header=False, pad_edge=False)
    table.add_column(style="dim")
    table.add_column(overflow="fold")
    for row in rows:
        table.add_row(*_cells(*row))
    return _indented(table)


def _table(*headers: str, right: tuple[int, ...] = ()) -> Table:
    table = Table(box=None, pad_edge=False, header_style="dim")
    for i, header in enumerate(headers):
        table.add_column(header, justify="right" if i in right else "left", overflow="fold")
    return table


def _cells(*values: object) -> Iterator[Text]:
    """Yield texts that rich does not read as markup."""
    return (Text(one_line(_short(str(v)))) for v in values)


def _short(text: str, most: int = _LONGEST) -> str:
    return text if len(text) <= most else f"{text[: most - 33]}...{text[-30:]}"


def _indented(table: Table) -> RenderableType:
    return Padding(table, (0, 0, 0, 2), expand=False)
