"""The panel of the page: status, buttons, sliders and the controls of a path.

What it says is HTML in which names of files are text and nothing else.
"""

from __future__ import annotations

import html
from typing import TYPE_CHECKING, Protocol

from ...contact.types import Verdict, short
from ...errors import one_line, robots_named
from ...kinematics.space import ConfigurationSpace
from ...simulation.scene import Query, Scene
from ...transforms import Array
from .playback import Track
from .sliders import Slider, Sliders

if TYPE_CHECKING:
    import viser

_BRAND = (44, 93, 138)
_SPEEDS = {"0.25 x": 0.25, "0.5 x": 0.5, "1 x": 1.0, "2 x": 2.0, "4 x": 4.0}
# Via configurations get buttons of their own up to so many.
_BUTTONS = 4


class Controls(Protocol):
    """What the page may ask for."""

    def go(self, q: Array) -> None:
        """Show a configuration, (dim,)."""

    def moved(self, values: list[float]) -> None:
        """Show what the sliders say, in the file's numbers."""

    def random(self) -> None:
        """Show a valid configuration that is drawn at random."""

    def see_through(self, wanted: bool) -> None:
        """Make obstacles transparent, or solid again."""

    def toggle(self) -> None:
        """Play the path, or pause."""

    def scrub(self, fraction: float) -> None:
        """Show the path at a fraction of its length."""

    def set_pace(self, speed: float, loop: bool) -> None:
        """Say how fast the path plays, and whether it begins again at its end."""


class Page:
    """Builds the panel, and keeps it up to date.

    Args:
        server: The server of the page.
        sliders: The degrees of freedom.
        scene: The scene.
        track: The path, if there is one.
        controls: What is told when something is pressed or moved.
        see_through: Whether obstacles are transparent.
    """

    def __init__(
        self,
        server: viser.ViserServer,
        sliders: Sliders,
        scene: Scene,
        track: Track | None,
        controls: Controls,
        see_through: bool,
    ) -> None:
        self._server, self._scene, self._track, self._controls = server, scene, track, controls
        gui = server.gui
        gui.configure_theme(show_logo=False, show_share_button=False, brand_color=_BRAND, control_width="large")
        gui.main_panel.dock_right()
        self._status = gui.add_html("")
        self._reasons = gui.add_html("")
        self._listed = False
        self._add_places()
        if track is not None:
            self._add_path(track)
        self._sliders: list[viser.GuiSliderHandle[float]] = []
        for number, robot in enumerate(sliders.robots):
            self._add_robot(number, robot)
        with gui.add_folder("View"):
            see = gui.add_checkbox("see through", see_through, hint="Makes obstacles transparent.")
            see.on_update(lambda _: controls.see_through(see.value))

    # What is shown.

    def report(self, verdict: Verdict, looking: bool = False) -> None:
        """Say what is wrong with the configuration that is shown; `looking` for contacts, which are not told yet."""
        self._status.content = status(verdict, looking)
        # A list that is only a moment old is better than one that flickers while a slider is dragged.
        if not looking or not self._listed:
            self._reasons.content = reasons(verdict, self._scene.space, looking)
        if not looking:
            self._listed = bool(verdict.contacts)

    def notify(self, message: str) -> None:
        """Tell everybody something for a moment."""
        for client in self._server.get_clients().values():
            client.add_notification("env2mjcf", message, auto_close_seconds=5.0)

    def values(self) -> list[float]:
        """Return where the sliders stand, in the file's numbers."""
        return [slider.value for slider in self._sliders]

    def set_values(self, values: list[float]) -> None:
        """Put the sliders where the configuration is."""
        for slider, value in zip(self._sliders, values, strict=True):
            slider.value = value

    def set_fraction(self, fraction: float) -> None:
        """Put the slider of the path where the path is."""
        assert self._track is not None
        self._place.value = fraction
        self._row.content = _row_text(self._track.index(fraction), len(self._track.q))

    def playing(self) -> None:
        """Offer to pause."""
        self._play.label, self._play.icon = "pause", _icon("player-pause")

    def paused(self) -> None:
        """Offer to play."""
        self._play.label, self._play.icon = "play", _icon("player-play")

    # How it is built.

    def _add_places(self) -> None:
        gui, scene, controls = self._server.gui, self._scene, self._controls
        with gui.add_folder("Go to"):
            own = gui.add_button_group("", ["home", "random valid"])
            own.on_click(lambda _: controls.go(scene.space.home) if own.value == "home" else controls.random())
            for number, query in enumerate(scene.queries):
                self._add_query(number, query)
            if self._track is not None and not scene.queries:
                self._add_ends("path", self._track.q)

    def _add_query(self, number: int, query: Query) -> None:
        several = len(self._scene.queries) > 1
        robot = robots_named(query.robots) if len(self._scene.space.robot_slices) > 1 else f"task {number}"
        self._add_ends(query.label or (robot if several else ""), query.q)

    def _add_ends(self, label: str, rows: Array) -> None:
        places = {"start": rows[0]}
        if len(rows) <= _BUTTONS:
            places.update((f"via {i}", row) for i, row in enumerate(rows[1:-1], 1))
        if len(rows) > 1:
            places["goal"] = rows[-1]
        group = self._server.gui.add_button_group(one_line(label), list(places))
        group.on_click(lambda _: self._controls.go(places[group.value]))

    def _add_path(self, track: Track) -> None:
        gui, controls = self._server.gui, self._controls
        with gui.add_folder("Path"):
            self._play = gui.add_button("play", icon=_icon("player-play"))
            self._play.on_click(lambda _: controls.toggle())
            self._place = gui.add_slider("along", 0.0, 1.0, 0.001, 0.0, hint="Fraction of the path's length.")
            self._place.on_update(lambda e: None if e.client_id is None else controls.scrub(self._place.value))
            speed = gui.add_dropdown("speed", tuple(_SPEEDS), initial_value="1 x")
            loop = gui.add_checkbox("repeat", False)
            speed.on_update(lambda _: controls.set_pace(_SPEEDS[speed.value], loop.value))
            loop.on_update(lambda _: controls.set_pace(_SPEEDS[speed.value], loop.value))
            self._row = gui.add_html(_row_text(0, len(track.q)))

    def _add_robot(self, number: int, sliders: tuple[Slider, ...]) -> None:
        gui = self._server.gui
        several = len(self._scene.space.robot_slices) > 1
        unit = next((f" (angles in {s.unit})" for s in sliders if not s.length), "")
        with gui.add_folder(f"Robot{f' {number}' if several else ''}{unit}"):
            for s in sliders:
                hint = f"{s.name}: {'a length as in the file' if s.length else s.unit}; {s.limits}."
                still = s.low == s.high
                handle = gui.add_slider(s.label, s.low, s.high, s.step, s.low, disabled=still, hint=hint)
                handle.on_update(self._moved)
                self._sliders.append(handle)

    def _moved(self, event: viser.GuiEvent[viser.GuiSliderHandle[float]]) -> None:
        # Assigning to a slider calls back, too.
        if event.client_id is not None:
            self._controls.moved(self.values())


def _icon(name: str) -> viser.IconName:
    import viser

    return viser.IconName(name)


def _row_text(index: int, count: int) -> str:
    return (
        f'<div style="margin:0 0.8em 0.4em;font-size:0.82em;color:#718096">configuration {index + 1} of {count}</div>'
    )


_GOOD, _BAD, _DIM = "#2f855a", "#c53030", "#718096"
_LISTED = 40
# A box that does not grow: the sliders below stay where they are while one of them is dragged.
_BOX = "height:9.5em;overflow-y:auto;margin:0.4em 0.8em 0.9em;font-size:0.82em;line-height:1.45"


def as_text(name: str) -> str:
    """Return a name fit for HTML: what has a meaning there, turns the direction of text, or is invisible, is shown."""
    return html.escape(one_line(name), quote=True)


def status(verdict: Verdict, looking: bool = False) -> str:
    """Return the line that says what is wrong with the configuration, if anything."""
    wrong = ", ".join(filter(None, ("in collision" if looking else "", verdict.summary)))
    words, colour = (wrong, _BAD) if wrong else ("valid", _GOOD)
    return (
        f'<div id="status" style="margin:0.5em 0.8em;padding:0.35em 0.7em;border-radius:0.4em;color:#fff;'
        f'font-weight:600;background:{colour}">{words}</div>'
    )


def reasons(verdict: Verdict, space: ConfigurationSpace, looking: bool = False) -> str:
    """Return the list of what touches and how deep, of limits that are broken, and of links outside the boundary."""
    items = [_dim("looking for contacts ...")] if looking else []
    for c in verdict.contacts:
        items.append(f"<b>{as_text(c.link)}</b> and <b>{as_text(c.other)}</b> {_dim(f'({c.kind})')} {c.depth}")
    numbers, lower, upper = (space.in_file_units(v) for v in (verdict.q, space.lower, space.upper))
    for i in map(space.names.index, (limit.name for limit in verdict.limits)):
        text = f"is {short(numbers[i])}; limits {short(lower[i])} to {short(upper[i])}"
        items.append(f"<b>{as_text(space.names[i])}</b> {text}")
    items += [f"<b>{as_text(name)}</b> reaches outside the boundary" for name in verdict.outside]
    if len(items) > _LISTED:
        items[_LISTED:] = [_dim(f"... and {len(items) - _LISTED} more")]
    rows = "".join(f"<div>{item}</div>" for item in items or [_dim("nothing touches")])
    return f'<div id="reasons" style="{_BOX}">{rows}</div>'


def _dim(text: str) -> str:
    return f'<span style="color:{_DIM}">{text}</span>'
