"""Writes docs/figures/architecture.svg, the rooms of the package and what they import. `--check` only compares."""

from __future__ import annotations

import ast
import re
import sys
from functools import cache
from pathlib import Path

PICTURE = Path(__file__).with_suffix(".svg")
PACKAGE = Path(__file__).resolve().parents[2] / "env2mjcf"
GROUPS = {
    "said": ("what is said and asked for", "#f3f4f6", "#9ca3af"),
    "file": ("what a file says", "#e8f1fb", "#6b9bd1"),
    "mujoco": ("what MuJoCo is given", "#e9f5ec", "#68a87c"),
    "scene": ("questions to a scene", "#fdf1e0", "#d99a3d"),
    "use": ("what is done with a scene", "#f3ecfa", "#a480c9"),
    "program": ("the program", "#fbe9ec", "#cf7286"),
}
# A room's floor follows from its imports. Its place on that floor, its colour and a word about it are chosen.
ROOMS = {
    "errors": (0.5, "said", "exceptions and findings"),
    "diagnostics": (0.0, "said", "codes, meanings, the log"),
    "model": (1.0, "file", "a scene as dataclasses"),
    "limits": (0.0, "said", "bounds on input and work"),
    "options": (0.0, "said", "what a user may choose"),
    "system": (0.0, "said", "files, locks, imports"),
    "transforms": (1.0, "file", "poses as 4 x 4 matrices"),
    "kinematics": (0.5, "file", "frames, joints, q and qpos"),
    "formats": (0.5, "file", "text, XML and meshes"),
    "pairs": (1.55, "file", "which bodies are tested"),
    "summary": (-0.6, "file", "a scene in words"),
    "geometry": (0.5, "mujoco", "mended, cut into cells"),
    "translation": (0.0, "use", "one dialect to another"),
    "mjcf": (1.0, "mujoco", "bodies, joints, geoms"),
    "pipeline": (1.0, "mujoco", "the whole way, once"),
    "report": (1.5, "mujoco", "what came of it"),
    "contact": (0.5, "scene", "verdicts, distances, edges"),
    "simulation": (1.0, "scene", "Scene, loading, verdicts"),
    "linting": (-0.6, "use", "everything doubtful"),
    "conversion": (0.46, "use", "convert: a folder"),
    "planning": (1.45, "use", "ways from start to goal"),
    "companions": (2.45, "use", "queries, paths, roadmaps"),
    "batch": (1.95, "use", "files larger than memory"),
    "view": (2.95, "use", "pictures, films, a page"),
    "cli": (0.7, "program", "parses, calls, prints"),
    "testing": (2.95, "use", "assertions, a pytest plugin"),
    "__main__": (0.7, "program", "sets the process up"),
}
# Long arrows go down here, past the rooms of the floors between.
LANES = {("cli", "summary"): -0.07, ("cli", "translation"): -0.07}
# What the stages hand on, beside the room that makes it.
RESULTS = {
    "formats": "Environment",
    "geometry": "Assembly: meshes, shapes",
    "mjcf": "Document: MJCF and assets",
    "pipeline": "Compiled: all of these",
    "simulation": "Scene",
}
WIDE, HIGH, COLUMN, FLOOR = 214, 54, 232, 88
LEFT, TOP, WIDTH = 262, 66, 1080
TITLE = "The rooms of env2mjcf, the highest first"
STYLE = """
text { font-family: Helvetica, Arial, sans-serif; font-size: 15px; fill: #4b5563; text-anchor: middle }
.room { font-size: 18px; font-weight: bold; fill: #111827 }
.result { font-size: 16.5px; fill: #c2410c; text-anchor: start }
.title { font-size: 23px; font-weight: bold; fill: #111827; text-anchor: start }
.left { text-anchor: start; font-size: 16px }
.import { fill: none; stroke: #6b7280; stroke-width: 1.4 } .way { stroke: #c2410c; stroke-width: 2 }
"""


def imported(path: Path, public: dict[str, str]) -> set[str]:
    """Return the modules of the package that a module imports, wherever in it, as dotted names.

    Args:
        path: The module.
        public: Where the package's own public names are defined.
    """
    inside = ["env2mjcf", *path.relative_to(PACKAGE).with_suffix("").parts]
    found: set[str] = set()
    for node in ast.walk(ast.parse(path.read_text(encoding="utf-8"))):
        if not isinstance(node, ast.ImportFrom):
            continue
        base = (
            ".".join([*inside[: len(inside) - node.level], *filter(None, [node.module])]) if node.level else node.module
        )
        names = [public.get(a.name, f".{a.name}") for a in node.names] if base == "env2mjcf" else [""]
        found |= {f"{base}{name}" for name in names if base is not None and base.split(".")[0] == "env2mjcf"}
    return found


def imports() -> dict[str, set[str]]:
    """Return the rooms that each room imports."""
    stub = (PACKAGE / "__init__.pyi").read_text(encoding="utf-8")
    public = {name: home for home, name in re.findall(r"^from (\.\S+) import (\w+)", stub, re.MULTILINE)}
    below: dict[str, set[str]] = {}
    for path in sorted(PACKAGE.rglob("*.py")):
        room = path.relative_to(PACKAGE).with_suffix("").parts[0]
        if room != "__init__":
            rooms = {name.split(".")[1] for name in imported(path, public) if "." in name}
            below.setdefault(room, set()).update(rooms - {room, "__version__"})
    return below


def reduced(below: dict[str, set[str]]) -> list[tuple[str, str]]:
    """Return the imports that do not follow from others."""

    @cache
    def reached(room: str) -> frozenset[str]:
        return frozenset().union(*({r} | reached(r) for r in below[room]))

    return sorted((a, b) for a, rooms in below.items() for b in rooms if not any(b in reached(c) for c in rooms - {b}))


def floors(below: dict[str, set[str]]) -> dict[str, int]:
    """Return each room's floor: one above the highest that it imports."""

    @cache
    def floor(room: str) -> int:
        return 1 + max(map(floor, below[room]), default=-1)

    return {room: floor(room) for room in below}


def picture() -> str:
    """Return the SVG.

    Raises:
        KeyError: A room is new: it needs a place and a word in `ROOMS`.
        RecursionError: Rooms import each other in a circle.
    """
    below = imports()
    floor = floors(below)
    highest = max(floor.values())

    def place(room: str) -> tuple[float, float]:
        """Return the middle of a room's upper side."""
        return LEFT + ROOMS[room][0] * COLUMN, TOP + (highest - floor[room]) * FLOOR

    lines = handed_on({room: place(room)[1] + HIGH / 2 for room in RESULTS})
    lines += [arrow(place(a), place(b), LANES.get((a, b))) for a, b in reduced(below)]
    for room in sorted(below):
        x, y = place(room)
        _, group, words = ROOMS[room]
        _, fill, edge = GROUPS[group]
        box = f'x="{x - WIDE / 2:.0f}" y="{y:.0f}" width="{WIDE}" height="{HIGH}" rx="9"'
        lines.append(f'<rect {box} fill="{fill}" stroke="{edge}"/>')
        lines.append(f'<text x="{x:.0f}" y="{y + 23:.0f}" class="room">{room}</text>')
        lines.append(f'<text x="{x:.0f}" y="{y + 43:.0f}">{words}</text>')
    height = TOP + highest * FLOOR + HIGH + 24
    size = f'viewBox="0 0 {WIDTH} {height}" width="{WIDTH}" height="{height}"'
    markers = "".join(
        f'<marker id="{name}" viewBox="0 0 10 10" refX="8" refY="5" markerWidth="{width}" markerHeight="{width}" '
        f'orient="auto" markerUnits="userSpaceOnUse"><path d="M0 0 L10 5 L0 10 z" fill="{colour}"/></marker>'
        for name, width, colour in (("tip", 8, "#6b7280"), ("result", 11, "#c2410c"))
    )
    return "\n".join(
        [
            f'<svg xmlns="http://www.w3.org/2000/svg" {size} role="img">',
            f"<title>{TITLE}</title>",
            f"<style>{STYLE}</style>",
            f"<defs>{markers}</defs>",
            f'<rect width="{WIDTH}" height="{height}" fill="white"/>',
            f'<text x="24" y="36" class="title">{TITLE}</text>',
            *lines,
            *legend(height),
            "</svg>",
            "",
        ]
    )


def arrow(start: tuple[float, float], end: tuple[float, float], lane: float | None) -> str:
    """Return an arrow from the lower side of one room to the upper side of another, perhaps along a lane."""
    (x1, y1), (x2, y2) = start, end
    y1 += HIGH
    shift = 0.5 * max(-0.36 * WIDE, min(0.36 * WIDE, x2 - x1))
    path = f"M{x1 + shift:.0f} {y1:.0f}"
    if lane is None:
        path += curve(x1 + shift, y1, x2 - shift, y2 - 1)
    else:
        x, low, high = LEFT + lane * COLUMN, y1 + 2 * FLOOR - HIGH - 6, y1 + 2 * FLOOR + 6
        path += curve(x1 + shift, y1, x, low) + f" L{x:.0f} {high:.0f}" + curve(x, high, x2, y2 - 1)
    return f'<path d="{path}" class="import" marker-end="url(#tip)"/>'


def curve(x1: float, y1: float, x2: float, y2: float) -> str:
    """Return the part of a path that leaves one point downwards and comes to the other from above."""
    bend = max(0.55 * (y2 - y1), 18)
    return f" C{x1:.0f} {y1 + bend:.0f} {x2:.0f} {y2 - bend:.0f} {x2:.0f} {y2:.0f}"


def handed_on(heights: dict[str, float]) -> list[str]:
    """Return what becomes of a scene, from its files at the bottom to the top."""
    x, lowest, highest = 790, max(heights.values()), min(heights.values())
    lines = [
        f'<path d="M{x} {lowest + FLOOR - 14:.0f} V{highest - 20:.0f}" class="way" marker-end="url(#result)"/>',
        f'<text x="{x + 16}" y="{lowest + FLOOR - 16:.0f}" class="left">the text of the files, and meshes</text>',
    ]
    for room, y in heights.items():
        lines.append(f'<circle cx="{x}" cy="{y:.0f}" r="5" fill="#c2410c"/>')
        lines.append(f'<text x="{x + 16}" y="{y + 5:.0f}" class="result">{RESULTS[room]}</text>')
    lines.append(f'<text x="{x + 16}" y="{highest - 22:.0f}" class="left">what the stages hand on:</text>')
    return lines


def legend(height: int) -> list[str]:
    """Return what colours and arrows mean."""
    x, y = 690, height - 286
    lines: list[str] = []
    for n, (words, fill, edge) in enumerate(reversed(GROUPS.values())):
        lines.append(
            f'<rect x="{x}" y="{y + 28 * n}" width="26" height="16" rx="4" fill="{fill}" stroke="{edge}"/>'
            f'<text x="{x + 36}" y="{y + 28 * n + 13}" class="left">{words}</text>'
        )
    for n, words in enumerate(
        (
            "An arrow leads from a room to one that it imports.",
            "Imports that follow from other arrows are left out:",
            "every room may use all that its arrows lead to.",
        )
    ):
        lines.append(f'<text x="{x}" y="{y + 200 + 22 * n}" class="left">{words}</text>')
    return lines


def main() -> int:
    """Write the picture, or with `--check` compare it."""
    if "--check" in sys.argv[1:]:
        return int(not PICTURE.exists() or PICTURE.read_text(encoding="utf-8") != picture())
    PICTURE.write_text(picture(), encoding="utf-8")
    return 0


if __name__ == "__main__":
    sys.exit(main())
