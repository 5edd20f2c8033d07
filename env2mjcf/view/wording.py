"""What the page says, as HTML in which names of files are text and nothing else."""

from __future__ import annotations

import html
import unicodedata
from collections.abc import Sequence

from ..contact.types import Contact
from ..simulation.scene import Scene
from ..transforms import Array
from .judging import Judgement

_GOOD, _BAD, _DIM = "#2f855a", "#c53030", "#718096"
_LISTED = 40
# A box that does not grow: the sliders below stay where they are while one of them is dragged.
_BOX = "height:9.5em;overflow-y:auto;margin:0.4em 0.8em 0.9em;font-size:0.82em;line-height:1.45"


def text(name: str) -> str:
    """Return a name fit for HTML: what has a meaning there, turns the direction of text, or is invisible, is shown."""
    return html.escape(label(name), quote=True)


def label(name: str) -> str:
    """Return a name fit for what the page shows as text anyway: what turns its direction, or is invisible, is shown."""
    return "".join(
        c.encode("unicode_escape").decode("ascii") if unicodedata.category(c) in ("Cc", "Cf", "Cs", "Zl", "Zp") else c
        for c in name
    )


def status(judgement: Judgement) -> str:
    """Return the line that says what is wrong with the configuration, if anything."""
    wrong = [
        what
        for what, so in (
            ("in collision", judgement.collides),
            ("out of limits", judgement.beyond),
            ("outside the boundary", judgement.outside),
        )
        if so
    ]
    words, colour = (", ".join(wrong), _BAD) if wrong else ("valid", _GOOD)
    return (
        f'<div id="status" style="margin:0.5em 0.8em;padding:0.35em 0.7em;border-radius:0.4em;color:#fff;'
        f'font-weight:600;background:{colour}">{words}</div>'
    )


def reasons(judgement: Judgement, scene: Scene, q: Array) -> str:
    """Return the list of what touches and how deep, of limits that are broken, and of links outside the boundary."""
    items = [*_touches(judgement.contacts), *_limits(judgement, scene, q)]
    items += [f"<b>{text(name)}</b> reaches outside the boundary" for name in judgement.outside]
    rows = "".join(f"<div>{item}</div>" for item in items[:_LISTED])
    more = f'<div style="color:{_DIM}">... and {len(items) - _LISTED} more</div>' if len(items) > _LISTED else ""
    nothing = f'<span style="color:{_DIM}">nothing touches</span>' if judgement.contacts == () and not items else ""
    return f'<div id="reasons" style="{_BOX}">{rows}{more}{nothing}</div>'


def _touches(contacts: Sequence[Contact] | None) -> list[str]:
    if contacts is None:
        return [f'<span style="color:{_DIM}">looking for contacts ...</span>']
    return [
        f"<b>{text(c.link)}</b> and <b>{text(c.other)}</b> "
        f'<span style="color:{_DIM}">({c.kind})</span> {_depth(c.distance)}'
        for c in _deepest(contacts)
    ]


def _deepest(contacts: Sequence[Contact]) -> list[Contact]:
    """Return one contact of each pair: the first, for the deepest come first."""
    found: dict[tuple[str, str], Contact] = {}
    for contact in contacts:
        found.setdefault((contact.link, contact.other), contact)
    return list(found.values())


def _depth(distance: float) -> str:
    return f"{-distance:.3g} m deep" if distance < 0 else "touching"


def _limits(judgement: Judgement, scene: Scene, q: Array) -> list[str]:
    space = scene.space
    numbers, lower, upper = (space.encode(v) for v in (q, space.lower, space.upper))
    return [
        f"<b>{text(space.names[i])}</b> is {numbers[i]:.6g}; limits {lower[i]:.6g} to {upper[i]:.6g}"
        for i in judgement.beyond
    ]
