"""Everything that env2mjcf does, as operations on known scenes that check their own results."""

from __future__ import annotations

import contextlib
import copy
import io
import multiprocessing
import pickle
import random
import shutil
import socket
from collections.abc import Callable
from concurrent.futures import ProcessPoolExecutor, ThreadPoolExecutor
from pathlib import Path
from typing import Any

import mujoco
import numpy as np
from known import Known, bytes_of

import env2mjcf
from env2mjcf.cli.main import main as command
from env2mjcf.errors import ConversionError
from env2mjcf.geometry.store import GeometryCache, default_folder
from env2mjcf.planning import plan
from env2mjcf.view import RenderError, film, offscreen, picture
from env2mjcf.view.web.viewer import Viewer
from env2mjcf.view.web.server import HOST, free_port, serving

# What changes neither verdicts nor poses.
_HARMLESS: dict[str, tuple[Any, ...]] = {
    "ground": (False, True),
    "boundary": (None, "visual", "solid"),
    "actuators": (None, "position"),
    "density": (1000.0, 500.0),
    "cache": (True, True, False),
    "engine": ("auto", "exact", "mujoco"),
}


class Wrong(AssertionError):
    """An answer that is not what it was."""


class Operations:
    """What may be done with known scenes, in any order.

    Args:
        known: The scenes.
        folder: Where files may be written; left empty.
        rng: Chooses.

    Attributes:
        configurations: How many configurations were judged, each engine and edge counted.
        expected_errors: How many bad files were refused.
        pictures: How many pictures were drawn.
    """

    def __init__(self, known: list[Known], folder: Path, rng: random.Random) -> None:
        self._known, self._folder, self._rng = known, folder, rng
        self._spawned = ProcessPoolExecutor(2, mp_context=multiprocessing.get_context("spawn"))
        self._drawn: dict[str, bytes] = {}
        self._converted: dict[str, bytes] = {}
        self.configurations = self.expected_errors = self.pictures = 0

    def all(self) -> dict[str, tuple[Callable[[Known], None], int]]:
        """Return every operation by name, and how often it comes."""
        found: dict[str, tuple[Callable[[Known], None], int]] = {
            "verdicts": (self.verdicts, 30), "verdicts elsewhere": (self.verdicts_elsewhere, 8),
            "verdicts after fork": (self.verdicts_after_fork, 1), "clearance": (self.clearance, 10),
            "contacts": (self.contacts, 10), "edges": (self.edges, 10), "poses": (self.poses, 10),
            "read": (self.read, 10), "bad file": (self.bad_file, 20), "load": (self.load, 8),
            "load otherwise": (self.load_otherwise, 3), "convert": (self.convert, 4), "translate": (self.translate, 4),
            "companions": (self.companions, 8), "check": (self.check, 6), "verbs": (self.verbs, 4),
            "plan": (self.plan, 3), "travel": (self.travel, 4), "simulate": (self.simulate, 4),
            "cache": (self.cache, 3), "viewer": (self.viewer, 2),
        }  # fmt: skip
        if offscreen.backend() is not None:
            found |= {"picture": (self.picture, 2), "film": (self.film, 1)}
        return found

    def close(self) -> None:
        """End the workers."""
        self._spawned.shutdown()

    # Questions.

    def verdicts(self, known: Known) -> None:
        """Ask for verdicts here, with any engine, of any rows, in any number of threads."""
        engine, threads = self._engine(), self._rng.choice((None, 1, 2, 4))
        rows = self._rows(known)
        self._same(
            known, "collisions", engine, known.scene.in_collision(known.q[rows], engine=engine, threads=threads), rows
        )
        self._same(known, "validity", engine, known.scene.is_valid(known.q[rows], engine=engine, threads=threads), rows)
        one = int(self._rng.choice(rows))
        self._same(
            known, "collisions", engine, np.array([known.scene.in_collision(known.q[one], engine=engine)]), [one]
        )

    def verdicts_elsewhere(self, known: Known) -> None:
        """Ask for verdicts on an executor."""
        engine, many = self._engine(), np.tile(known.q, (20, 1))
        if self._rng.random() < 0.5:
            found = known.scene.in_collision(many, engine=engine, executor=self._spawned)
        else:
            # Threads that stay would keep scratch data for each scene that they have ever been asked about.
            with ThreadPoolExecutor(3) as pool:
                found = known.scene.in_collision(many, engine=engine, executor=pool)
        self._same(known, "collisions", engine, found, np.tile(np.arange(len(known.q)), 20))

    def verdicts_after_fork(self, known: Known) -> None:
        """Ask for verdicts in processes that are forked for it."""
        engine = self._engine()
        with ProcessPoolExecutor(2, mp_context=multiprocessing.get_context("fork")) as pool:
            self._same(known, "collisions", engine, known.scene.in_collision(known.q, engine=engine, executor=pool))
            self._same(known, "edges", "exact", known.scene.edge_in_collision(known.q, known.to, executor=pool))

    def clearance(self, known: Known) -> None:
        """Ask for distances."""
        self._same(known, "clearance", "exact", known.scene.clearance(known.q[:12], threads=self._rng.choice((1, 2))))

    def contacts(self, known: Known) -> None:
        """Ask for contacts."""
        engine = self._engine()
        threads = self._rng.choice((1, 2))
        found = bytes_of(known.scene.packed_contacts(known.q[:12], engine=engine, threads=threads))
        self._same(known, "contacts", engine, found)

    def edges(self, known: Known) -> None:
        """Ask for edges, at steps and proved."""
        rows = self._rows(known)
        self._same(known, "edges", "exact", known.scene.edge_in_collision(known.q[rows], known.to[rows]), rows)
        self._same(known, "proofs", "exact", known.scene.edge_is_free(known.q[:20], known.to[:20]))

    def poses(self, known: Known) -> None:
        """Ask where links are."""
        rows = self._rows(known)
        self._same(known, "poses", "exact", known.scene.link_poses(known.q[rows]), rows)
        known.scene.loop_error(known.q[0])
        known.scene.space.sample(5, seed=self._rng.randrange(1000))

    # Files.

    def read(self, known: Known) -> None:
        """Read the scene's files."""
        if env2mjcf.read(known.path, **known.options) != known.scene.environment:
            raise Wrong(f"{known.name}: the files were read as something else")

    def bad_file(self, known: Known) -> None:
        """Read files that are cut short or altered: read, or refused as bad input."""
        text = known.path.read_bytes()
        at = self._rng.randrange(len(text))
        broken = self._rng.choice((text[:at], text[:at] + b"\x00nan 1e999 -" + text[at:], text[:at] + text[at + 40 :]))
        with self._place() as folder:
            path = folder / known.path.name
            path.write_bytes(broken)
            try:
                env2mjcf.load(path, **known.options, mesh_dirs=(known.path.parent,), allow_outside=True)
            except env2mjcf.Env2MjcfError:
                self.expected_errors += 1

    def load(self, known: Known) -> None:
        """Load with options that change no verdict, ask a little, and drop it."""
        chosen = {name: self._rng.choice(values) for name, values in _HARMLESS.items()}
        scene = env2mjcf.load(known.path, **known.options, **chosen)
        for engine in ("exact", "mujoco"):
            self._same(known, "collisions", engine, scene.in_collision(known.q, engine=engine))

    def load_otherwise(self, known: Known) -> None:
        """Load with other shapes: hulls hold solids, which hold surfaces."""
        collision = self._rng.choice(("hull", "surface", "solid"))
        scene = env2mjcf.load(known.path, **{**known.options, "collision": collision})
        found = scene.in_collision(known.q)
        self.configurations += len(found)
        hits = known.answers["collisions", "exact"]
        wrong = {"hull": hits & ~found, "surface": found & ~hits, "solid": found ^ hits}[collision]
        if wrong.any():
            raise Wrong(f"{known.name}: {int(wrong.sum())} verdicts of {collision!r} contradict those of 'auto'")

    def convert(self, known: Known) -> None:
        """Convert, load in plain MuJoCo, and compare the bytes."""
        with self._place() as folder:
            result = env2mjcf.convert(known.path, folder / "out", **known.options)
            model = mujoco.MjModel.from_xml_path(str(result.xml))
            written = b"".join(p.read_bytes() for p in (result.xml, *result.assets))
        if self._converted.setdefault(known.name, written) != written or model.nq != known.scene.model.nq:
            raise Wrong(f"{known.name}: converted into other bytes")

    def translate(self, known: Known) -> None:
        """Translate, write, load, and look at home."""
        with self._place() as folder:
            try:
                found = env2mjcf.translate(known.scene.environment, self._rng.choice("ABCDE"))
            except env2mjcf.Env2MjcfError:
                self.expected_errors += 1
                return
            written = env2mjcf.write_environment(found.environment, folder / "new.env")
            options: dict[str, Any] = {"robots": written.robots, "allow_outside": True}
            scene = env2mjcf.load(written.environment, mesh_dirs=written.mesh_dirs, **options)
            home, there = (s.link_poses(s.space.home) for s in (known.scene, scene))
        if home.shape != there.shape or not np.allclose(home, there, atol=1e-9 * (1 + known.scene.extent)):
            raise Wrong(f"{known.name}: links stand elsewhere after a translation to {found.environment.dialect}")

    def companions(self, known: Known) -> None:
        """Write and read a path, a roadmap and a query."""
        scene, edges = known.scene, np.array([[0, 1], [1, 2], [3, 4]])
        others = np.ones(scene.space.dim, dtype=bool)
        others[scene.space.robot_slices[0]] = False
        q = np.where(others, scene.space.home, known.q[:8])
        with self._place() as folder:
            path = env2mjcf.write_path(scene, q, folder / "a.path")
            roadmap = env2mjcf.write_roadmap(scene, env2mjcf.Roadmap.of(q, edges), folder / "a.map")
            query = env2mjcf.write_query(scene, env2mjcf.Query(0, q), folder / "a.query")
            read = env2mjcf.read_path(scene, path), env2mjcf.read_roadmap(scene, roadmap)
            again = [*(r.q for r in read), env2mjcf.read_query(scene, query)[0].q]
        for rows in again:
            if rows.shape != q.shape or not np.allclose(scene.space.difference(rows, q), 0, atol=1e-9):
                raise Wrong(f"{known.name}: configurations changed on their way through a file")

    # The command line, and what else there is.

    def check(self, known: Known) -> None:
        """Check a file of configurations with the program."""
        rows = known.q[:6]
        with self._place() as folder:
            np.save(folder / "rows.npy", rows)
            words = [] if not known.options.get("robots") else ["--robots", *map(str, known.options["robots"])]
            outside = ["--allow-outside"] if known.options.get("allow_outside") else []
            status = _quiet(
                ["check", str(known.path), str(folder / "rows.npy"), "--radians", "--json", *outside, *words]
            )
        if status != int(not known.scene.is_valid(rows).all()):
            raise Wrong(f"{known.name}: check ends with status {status}")
        self.configurations += len(rows)

    def verbs(self, known: Known) -> None:
        """Run a verb that only tells, or one that is refused."""
        words, expected = self._rng.choice([
            (["info", str(known.path), "--json", "--allow-outside"], (0,)), (["cache", "info"], (0,)),
            (["lint", str(known.path), "--json"], (0, 1)), (["chek"], (2,)), (["--help"], (0,)),
            (["check", str(self._folder / "none.env")], (3,)), (["plan", "--nonsense"], (2,)),
        ])  # fmt: skip
        status = _quiet(words)
        if status not in expected:
            raise Wrong(f"{' '.join(words)} ends with status {status}")

    def plan(self, known: Known) -> None:
        """Plan for a moment between two free rows; what is found is valid."""
        free = np.flatnonzero(known.answers["validity", "exact"] & known.answers["validity", "mujoco"])
        if len(free) < 2:
            return
        start, goal = known.q[free[0]], known.q[free[-1]]
        name = self._rng.choice(("auto", "RRTConnect", "PRM", "KPIECE", "BatchEST"))
        found = plan(known.scene, start, goal, planner=name, time=0.5, seed=self._rng.randrange(1000))
        self.configurations += found.checks
        if not known.scene.is_valid(found.path).all() or (found.solved and not found.dense.all()):
            raise Wrong(f"{known.name}: planned an invalid path")

    def travel(self, known: Known) -> None:
        """Pickle and copy scenes, ask the copies."""
        scene = self._rng.choice((copy.copy, copy.deepcopy, _pickled))(known.scene)
        engine = self._engine()
        self._same(known, "collisions", engine, scene.in_collision(known.q, engine=engine))

    def simulate(self, known: Known) -> None:
        """Load, simulate a moment, compile its spec."""
        scene = env2mjcf.load(known.path, **known.options)
        scene.set(known.q[0])
        mujoco.mj_step(scene.model, scene.data, 5)
        if scene.spec().compile().nq != scene.model.nq:
            raise Wrong(f"{known.name}: its spec is another model")

    def cache(self, known: Known) -> None:
        """Empty the cache, or fill it, or take from it."""
        if self._rng.random() < 0.3:
            # Not by the verb, which removes what is compiled, too.
            GeometryCache(default_folder()).clear()
        for _ in range(2):
            scene = env2mjcf.load(known.path, **{**known.options, "collision": "solid"})
            self._same(known, "collisions", "exact", scene.in_collision(known.q, engine="exact"))

    def viewer(self, known: Known) -> None:
        """Serve the page, move a robot, stop: the port is free again."""
        port = free_port(self._rng.randrange(20_000, 30_000))
        with serving(port, known.name) as server:
            viewer = Viewer(server, known.scene, known.q[:3])
            viewer.show(known.q[0])
            viewer.close()
        with socket.socket() as probe:
            probe.setsockopt(socket.SOL_SOCKET, socket.SO_REUSEADDR, 1)
            probe.bind((HOST, port))

    def picture(self, known: Known) -> None:
        """Draw: always the same picture."""
        pixels = picture(known.scene, known.q[0], size=(64, 48), contacts=True).tobytes()
        self.pictures += 1
        if self._drawn.setdefault(known.name, pixels) != pixels:
            raise Wrong(f"{known.name}: another picture")

    def film(self, known: Known) -> None:
        """Film a little; or try to, where that fails."""
        with self._place() as folder:
            name = self._rng.choice(("a.gif", "a.mp4"))
            film(known.scene, known.q[:2], folder / name, seconds=0.2, fps=10, size=(64, 48))
            self.pictures += 2
            with contextlib.suppress(RenderError, ConversionError):
                film(known.scene, known.q[:2], folder / "none" / "a.gif", seconds=0.2, fps=10, size=(64, 48))

    # Helpers.

    def _engine(self) -> Any:
        return self._rng.choice(("exact", "mujoco"))

    def _rows(self, known: Known) -> list[int]:
        return sorted(self._rng.sample(range(len(known.q)), self._rng.randrange(1, len(known.q))))

    def _same(self, known: Known, question: str, engine: str, found: Any, rows: Any = None) -> None:
        expected = known.answers[question, engine]
        expected = expected if rows is None else expected[rows]
        self.configurations += len(known.q) if question == "contacts" else len(found)
        if not np.array_equal(found, expected):
            raise Wrong(f"{known.name}: {question} ({engine}) are not what they were")

    @contextlib.contextmanager
    def _place(self) -> Any:
        folder = self._folder / f"{self._rng.randrange(1 << 60):x}"
        folder.mkdir()
        try:
            yield folder
        finally:
            shutil.rmtree(folder)


def _pickled(scene: env2mjcf.Scene) -> env2mjcf.Scene:
    return pickle.loads(pickle.dumps(scene))


def _quiet(words: list[str]) -> int:
    with contextlib.redirect_stdout(io.StringIO()), contextlib.redirect_stderr(io.StringIO()):
        return command(words)
