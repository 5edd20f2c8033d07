"""The viewer: what is shown, what may change it, and verdicts on it while somebody looks on."""

from __future__ import annotations

import threading
from collections.abc import Callable
from typing import TYPE_CHECKING, Generic, TypeVar

import numpy as np

from ...contact.types import Contact, Verdict, deepest
from ...options import Engine
from ...simulation.scene import Scene
from ...transforms import Array
from ..trails import paced, reference_points
from .nodes import WebScene, set_stage
from .page import Page
from .playback import Player, Track
from .sliders import Sliders

if TYPE_CHECKING:
    import viser

# Draws for one valid configuration before giving up.
_DRAWS = 2000
_TRAIL_POINTS = 240

T = TypeVar("T")


class Viewer:
    """Shows one configuration of a scene on a page; sliders, buttons and the player change it.

    All tabs that look at the page see the same.

    Args:
        server: The server of the page.
        scene: The scene.
        path: (k, dim) configurations to be played, or None.

    Attributes:
        q: (dim,) what is shown.
        page: The panel.
    """

    def __init__(self, server: viser.ViserServer, scene: Scene, path: Array | None = None) -> None:
        self._server, self._scene = server, scene
        # Reentrant: assigning to a slider calls back at once.
        self._lock = threading.RLock()
        # The exact engine may have to be compiled for a minute, and gains nothing on single verdicts.
        chosen = scene.compiled.options.engine
        self._engine: Engine = "mujoco" if chosen == "auto" else chosen
        shown = [q.q for q in scene.queries] + ([path] if path is not None else [])
        rows = np.vstack([np.zeros((0, scene.space.dim)), *shown])
        self._sliders = Sliders(scene, rows)
        set_stage(server, scene, rows)
        self._web = WebScene(server, scene)
        self._track = None if path is None else Track(scene, path)
        self._draws = 0
        self._player: Player | None = None
        first = self._first(path)
        hidden = _is_enclosed(scene, first)
        self._web.see_through(hidden)
        self.page = Page(server, self._sliders, scene, self._track, self, hidden)
        if self._track is not None:
            self._player = Player(self._track.seconds, self._tick, self.page.paused)
            self._web.trail(reference_points(scene, paced(scene, self._track.q, _TRAIL_POINTS)[0]))
        self._latest = Latest[Array](self._explain)
        self.q = scene.space.home.copy()
        self.show(first)

    def close(self) -> None:
        """End its threads."""
        self._latest.close()
        if self._player is not None:
            self._player.close()

    def show(self, q: Array) -> None:
        """Show a configuration, (dim,)."""
        with self._lock:
            self.q = q
            with self._server.atomic():
                self._web.place(self._scene.link_poses(q))
                self.page.set_values(self._sliders.values(q))
            self._latest.submit(q)

    def go(self, q: Array) -> None:
        """Show a configuration that somebody chose; the path stops."""
        with self._lock:
            self.pause()
            self.show(q)

    def moved(self, values: list[float]) -> None:
        """Show what the sliders say."""
        with self._lock:
            q = self._sliders.configuration(values)
            if q is not None:
                self.go(q)

    def random(self) -> None:
        """Show a valid configuration that is drawn at random."""
        for _ in range(_DRAWS):
            self._draws += 1
            q = self._scene.space.sample(1, self._draws)[0]
            if self._scene.is_valid(q, engine=self._engine):
                self.go(q)
                return
        self.page.notify(f"no valid configuration among {_DRAWS} that were drawn")

    def see_through(self, wanted: bool) -> None:
        """Make obstacles transparent, or solid again."""
        with self._lock:
            self._web.see_through(wanted)

    # The path.

    def toggle(self) -> None:
        """Play, or pause."""
        with self._lock:
            if self._player is None:
                return
            if self._player.playing:
                self.pause()
            else:
                self._player.play()
                self.page.playing()

    def pause(self) -> None:
        """Stay where the path is."""
        if self._player is not None and self._player.playing:
            self._player.pause()
            self.page.paused()

    def scrub(self, fraction: float) -> None:
        """Show the path at a fraction of its length."""
        with self._lock:
            if self._player is None or self._track is None:
                return
            self.pause()
            self._player.fraction = fraction
            self.page.set_fraction(fraction)
            self.show(self._track.at(fraction))

    def set_pace(self, speed: float, loop: bool) -> None:
        """Say how fast the path plays, and whether it begins again at its end."""
        if self._player is not None:
            self._player.speed, self._player.loop = speed, loop

    def _tick(self, fraction: float) -> None:
        with self._lock:
            # What paused it may have shown something else since.
            if self._track is not None and self._player is not None and self._player.playing:
                self.page.set_fraction(fraction)
                self.show(self._track.at(fraction))

    def _first(self, path: Array | None) -> Array:
        if path is not None:
            return path[0]
        return self._scene.queries[0].q[0] if self._scene.queries else self._scene.space.home

    def _explain(self, q: Array, overtaken: Callable[[], bool]) -> None:
        """Say what is wrong with q: at once whether anything touches, and what it is when that is found."""
        touching = bool(self._scene.in_collision(q, engine=self._engine))
        verdict, contacts = Verdict(q, self._scene.out_of_bounds(q)), list[Contact]()
        if touching:
            if overtaken():
                return
            self.page.report(verdict, looking=True)
            contacts = self._scene.contacts(q, engine=self._engine)
        with self._lock, self._server.atomic():
            self.page.report(Verdict(q, (*deepest(contacts), *verdict.reasons)))
            self._web.mark(contacts)


def _is_enclosed(scene: Scene, q: Array) -> bool:
    """Return whether the box of an obstacle holds a whole robot, which might not be seen then."""
    places = scene.link_poses(q)[:, :3, 3] - scene.origin
    boxes: list[tuple[Array, Array]] = []
    for part in scene.compiled.assembly.obstacles:
        pose = part.mesh_pose
        world = part.mesh.vertices @ pose[:3, :3].T + pose[:3, 3]
        boxes.append((world.min(axis=0), world.max(axis=0)))
    return len(places) > 0 and any(bool(np.all((places > low) & (places < high))) for low, high in boxes)


class Latest(Generic[T]):
    """Works on what was handed in last, in a thread of its own; what has been overtaken meanwhile is dropped.

    Args:
        work: What to do. It is handed a function, too, that says whether something newer waits.
    """

    def __init__(self, work: Callable[[T, Callable[[], bool]], None]) -> None:
        self._work = work
        self._waiting: T | None = None
        self._changed = threading.Condition()
        self._closed = False
        threading.Thread(target=self._run, name="env2mjcf-judge", daemon=True).start()

    def submit(self, item: T) -> None:
        """Hand in something newer."""
        with self._changed:
            self._waiting = item
            self._changed.notify()

    def close(self) -> None:
        """End the thread after what it is working on."""
        with self._changed:
            self._closed = True
            self._changed.notify()

    def _overtaken(self) -> bool:
        return self._waiting is not None or self._closed

    def _run(self) -> None:
        while True:
            with self._changed:
                self._changed.wait_for(self._overtaken)
                if self._closed:
                    return
                item, self._waiting = self._waiting, None
            assert item is not None
            self._work(item, self._overtaken)
