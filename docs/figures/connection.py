"""Writes docs/figures/connection.svg, the picture of one connection: `python docs/figures/connection.py`."""

from __future__ import annotations

import sys
from pathlib import Path

import numpy as np

PICTURE = Path(__file__).with_suffix(".svg")
WIDTH, HEIGHT = 1000, 550
AXES = (("x", "#c0392b"), ("y", "#2e8b57"), ("z", "#1f5fbf"))
# Two directions of the paper for three of space: x to the right, y into the page, z up.
PROJECTION = np.array([[1.0, 0.5, 0.0], [0.0, -0.36, -1.0]])


def about(axis: int, degrees: float) -> np.ndarray:
    """Return a rotation about a coordinate axis."""
    c, s = np.cos(np.radians(degrees)), np.sin(np.radians(degrees))
    i, j = (axis + 1) % 3, (axis + 2) % 3
    r = np.eye(3)
    r[i, i], r[i, j], r[j, i], r[j, j] = c, -s, s, c
    return r


class Drawing:
    """Lines of SVG, in the coordinates of one panel."""

    def __init__(self, origin: tuple[float, float]) -> None:
        self.origin = np.array(origin)
        self.lines: list[str] = []

    def at(self, point: np.ndarray) -> np.ndarray:
        """Return where a point of space is on the paper."""
        return self.origin + PROJECTION @ point

    def line(self, start: np.ndarray, end: np.ndarray, style: str) -> None:
        """Draw from one point of space to another."""
        (x1, y1), (x2, y2) = self.at(start), self.at(end)
        self.lines.append(f'<line x1="{x1:.1f}" y1="{y1:.1f}" x2="{x2:.1f}" y2="{y2:.1f}" {style}/>')

    def text(self, place: np.ndarray, words: str, style: str = "", shift: tuple[float, float] = (0, 0)) -> None:
        """Write at a point of space, moved on the paper."""
        x, y = self.at(place) + shift
        self.lines.append(f'<text x="{x:.1f}" y="{y:.1f}" {style}>{words}</text>')

    def frame(self, rotation: np.ndarray, place: np.ndarray, size: float = 62, mark: str = "") -> None:
        """Draw the axes of a frame."""
        for (name, colour), axis in zip(AXES, rotation.T, strict=True):
            self.line(place, place + size * axis, f'stroke="{colour}" stroke-width="3" marker-end="url(#{name})"')
            self.text(place + (size + 16) * axis, f"{name}{mark}", f'fill="{colour}" class="axis"', (-4, 5))

    def arc(self, place: np.ndarray, start: np.ndarray, end: np.ndarray, words: str, size: float = 44) -> None:
        """Draw an angle between two unit vectors."""
        angle = np.arccos(np.clip(start @ end, -1, 1))
        side = (end - (start @ end) * start) / np.sin(angle)
        points = [place + size * (np.cos(t) * start + np.sin(t) * side) for t in np.linspace(0, angle, 24)]
        path = " ".join(f"{x:.1f},{y:.1f}" for x, y in (self.at(p) for p in points))
        self.lines.append(f'<polyline points="{path}" class="angle" marker-end="url(#angle)"/>')
        middle = place + (size + 17) * (np.cos(angle / 2) * start + np.sin(angle / 2) * side)
        self.text(middle, words, 'class="dh"', (-5, 5))


DASHED = 'stroke="#9aa0a6" stroke-width="1.4" stroke-dasharray="5 4"'
LENGTH = 'stroke="#d97706" stroke-width="3.5"'


def chain() -> list[str]:
    """Return the way from the previous body to the next one."""
    stations = ((110, "previous body", "i"), (350, "frame before the joint", "1"), (620, "DH frame", "2"),
                (880, "next body", "j"))  # fmt: skip
    arrows = (("T_toDH", "x y z rx ry rz", "fixed"), ("T_DH", "alpha, a, d, theta", "theta is the joint's value"),
              ("T_toBody", "x y z rx ry rz", "fixed"))  # fmt: skip
    turns = (np.eye(3), about(0, -35), about(0, -35) @ about(2, 40), about(2, -35) @ about(0, -15))
    out: list[str] = []
    for (x, name, mark), turn in zip(stations, turns, strict=True):
        drawing = Drawing((x, 150))
        if name.endswith("body"):
            out.append(f'<rect x="{x - 62}" y="96" width="124" height="88" rx="18" class="body"/>')
        drawing.frame(turn, np.zeros(3), 44, f"<tspan baseline-shift='sub' font-size='10'>{mark}</tspan>")
        out += drawing.lines
        out.append(f'<text x="{x}" y="218" text-anchor="middle" class="name">{name}</text>')
    for (left, _, _), (right, _, _), (name, numbers, what) in zip(stations, stations[1:], arrows, strict=False):
        middle = (left + right) / 2
        out.append(f'<path d="M {left + 25} 74 Q {middle} 30 {right - 25} 74" class="way" marker-end="url(#way)"/>')
        out.append(f'<text x="{middle}" y="30" text-anchor="middle" class="step">{name}</text>')
        out.append(f'<text x="{middle}" y="70" text-anchor="middle" class="small">{numbers}</text>')
        out.append(f'<text x="{middle}" y="86" text-anchor="middle" class="small faint">{what}</text>')
    return out


def craig() -> list[str]:
    """Return the four parameters in the order of Craig's book."""
    draw = Drawing((90, 490))
    one = np.zeros(3)
    tilt = about(0, -50)
    offset = np.array([190.0, 0, 0])
    end = offset + 105 * tilt[:, 2]
    turn = tilt @ about(2, 40)
    draw.line(one, one + 120 * tilt[:, 2], DASHED)
    draw.line(offset, offset + 190 * tilt[:, 2], DASHED)
    draw.line(end, end + 90 * tilt[:, 0], DASHED)
    draw.line(one, offset, LENGTH)
    draw.line(offset, end, LENGTH)
    draw.frame(np.eye(3), one, 66, "<tspan baseline-shift='sub' font-size='10'>1</tspan>")
    draw.frame(turn, end, 62, "<tspan baseline-shift='sub' font-size='10'>2</tspan>")
    draw.arc(one, np.array([0, 0, 1.0]), tilt[:, 2], "alpha", 62)
    draw.arc(end, tilt[:, 0], turn[:, 0], "theta", 52)
    draw.text(0.7 * offset, "a", 'class="dh"', (0, 20))
    draw.text((offset + end) / 2, "d", 'class="dh"', (14, 8))
    return draw.lines


def standard() -> list[str]:
    """Return the four parameters in the order of the textbooks."""
    draw = Drawing((590, 515))
    one = np.zeros(3)
    turn = about(2, 65)
    up = np.array([0, 0, 90.0])
    end = up + 150 * turn[:, 0]
    last = turn @ about(0, 55)
    draw.line(one, one + np.array([0, 0, 165.0]), DASHED)
    draw.line(up, up + np.array([110.0, 0, 0]), DASHED)
    draw.line(end, end + 62 * turn[:, 2], DASHED)
    draw.line(one, up, LENGTH)
    draw.line(up, end, LENGTH)
    draw.frame(np.eye(3), one, 66, "<tspan baseline-shift='sub' font-size='10'>1</tspan>")
    draw.frame(last, end, 62, "<tspan baseline-shift='sub' font-size='10'>2</tspan>")
    draw.arc(up, np.array([1.0, 0, 0]), turn[:, 0], "theta", 88)
    draw.arc(end, turn[:, 2], last[:, 2], "alpha", 58)
    draw.text((up + end) / 2, "a", 'class="dh"', (-10, -12))
    draw.text(up / 2, "d", 'class="dh"', (-22, 5))
    return draw.lines


def marker(name: str, colour: str) -> str:
    """Return the head of an arrow; those of axes grow with the line."""
    size, units = (5, "strokeWidth") if name in "xyz" else (8, "userSpaceOnUse")
    return (
        f'<marker id="{name}" viewBox="0 0 10 10" refX="7" refY="5" markerWidth="{size}" markerHeight="{size}" '
        f'orient="auto" markerUnits="{units}"><path d="M0 0 L10 5 L0 10 z" fill="{colour}"/></marker>'
    )


def picture() -> str:
    """Return the SVG."""
    colours = (*AXES, ("way", "#444"), ("angle", "#7c3aed"))
    markers = "".join(marker(name, colour) for name, colour in colours)
    style = """
text { font-family: Helvetica, Arial, sans-serif; font-size: 14px; fill: #222 }
.axis { font-size: 13px; font-weight: bold } .name { font-weight: bold } .step { font-size: 17px; font-weight: bold }
.small { font-size: 13px } .faint { fill: #666 } .dh { fill: #7c3aed; font-weight: bold; font-style: italic }
.body { fill: #eef2f6; stroke: #b9c2cc } .way { fill: none; stroke: #444; stroke-width: 1.8 }
.angle { fill: none; stroke: #7c3aed; stroke-width: 1.8 } .title { font-size: 16px; font-weight: bold }
"""
    titles = [
        '<text x="40" y="272" class="title">T_DH in dialects A to D (Craig)</text>',
        '<text x="40" y="294" class="small">Rx(alpha) Tx(a) Rz(theta) Tz(d): '
        "the joint turns about the z axis of frame 2</text>",
        '<text x="530" y="272" class="title">T_DH in dialect E (standard)</text>',
        '<text x="530" y="294" class="small">Rz(theta) Tz(d) Tx(a) Rx(alpha): '
        "the joint turns about the z axis of frame 1</text>",
        '<line x1="20" y1="242" x2="980" y2="242" stroke="#d0d5da"/>',
        '<line x1="505" y1="258" x2="505" y2="530" stroke="#d0d5da"/>',
    ]
    lines = [*chain(), *titles, *craig(), *standard()]
    return "\n".join(
        [
            f'<svg xmlns="http://www.w3.org/2000/svg" viewBox="0 0 {WIDTH} {HEIGHT}" '
            f'width="{WIDTH}" height="{HEIGHT}" role="img">',
            "<title>One connection: from the frame of the previous body to the frame of the next</title>",
            f"<style>{style}</style>",
            f"<defs>{markers}</defs>",
            f'<rect width="{WIDTH}" height="{HEIGHT}" fill="white"/>',
            *lines,
            "</svg>",
            "",
        ]
    )


def main() -> int:
    """Write the picture, or with `--check` compare it."""
    if "--check" in sys.argv[1:]:
        return int(not PICTURE.exists() or PICTURE.read_text(encoding="utf-8") != picture())
    PICTURE.write_text(picture(), encoding="utf-8")
    return 0


if __name__ == "__main__":
    sys.exit(main())
