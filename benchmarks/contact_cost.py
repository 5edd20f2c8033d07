"""Tell what contacts cost MuJoCo, and what it feels: `python benchmarks/contact_cost.py PYTHON [PYTHON] [--scenes]`.

Each scene of `models/`, and of the folder that ENV2MJCF_CORPUS names, is loaded with the first PYTHON, of an older
installation, and then with the second one; a "python" may be a command, such as "env PYTHONPATH=/a/tree python3".
`--sweep` adds a table of the last one with other sizes of cells, on a few scenes.
`--output` names the page, `benchmarks/contact-cost.md` by default where all scenes are measured.
"""

from __future__ import annotations

import argparse
import importlib
import json
import os
import shlex
import subprocess
import sys
import time
from collections.abc import Sequence
from dataclasses import asdict, dataclass
from pathlib import Path
from typing import Any

import mujoco
import numpy as np
from machine import machine
from table import Case, corpus_cases, model_cases

OUTPUT = Path(__file__).with_name("contact-cost.md")
# Random poses whose contacts are looked for, and the most that are drawn to find colliding and contained ones among.
POSES, DRAWN = 1000, 20_000
# What is felt is asked of so many poses of a kind; steps are taken from so many.
ASKED, STEPPED = 300, 12
# Seconds of one kind of look at one scene.
BUDGET = 4.0
LEGEND = """
Geoms: those that collide. Contacts: of a random pose that collides, median and most. Step: one `mj_step` from such a
pose (median of {stepped}, CPU time), in units of the time step that is written: above 1, the simulation is slower than
what it simulates. Load: reading, geometry, MJCF and MuJoCo, without caches. Model, arena: MuJoCo's memory; of the arena
only what is used is real. Full: of {poses:,} random poses, those at which contacts or their forces did not fit. Felt:
of poses that collide, and of those in which a body lies wholly within a solid, by the exact engine, the share at which
MuJoCo has a contact; up to {asked} poses each. Where older and newer are the same, one figure is shown. Scenes that are
there in two dialects are measured in the newer one.
"""

# Other sizes of cells, as module, name and value: depths in units of the mesh's diagonal, how far polygons that are one
# cell may be bent in units of the thickness of prisms.
_CELLS, _PIECES = "env2mjcf.geometry.shells.cells", "env2mjcf.geometry.pieces"
SWEEP: dict[str, list[tuple[str, str, float]]] = {
    "as it is: 0.02 to 0.2 deep, merged": [],
    "not merged": [(_PIECES, "_FLAT_PER_THICKNESS", 0.0)],
    "merged up to half the thickness": [(_PIECES, "_FLAT_PER_THICKNESS", 0.5)],
    "0.005 to 0.2 deep": [(_CELLS, "SHALLOWEST", 0.005)],
    "0.01 to 0.2 deep": [(_CELLS, "SHALLOWEST", 0.01)],
    "0.02 deep": [(_CELLS, "DEEPEST", 0.02)],
    "0.02 to 0.05 deep": [(_CELLS, "DEEPEST", 0.05)],
    "0.02 to 0.1 deep": [(_CELLS, "DEEPEST", 0.1)],
    "0.02 to 0.5 deep": [(_CELLS, "DEEPEST", 0.5)],
}
SWEPT = (
    "bug-trap", "gantry", "LTunnel.tunnel", "Maze.maze", "STunnel.tunnel", "alpha1.6.alpha", "bug_trap1.0.bug-trap",
    "ros2-factory_simulation.ppl_files.factory_patrol",
)  # fmt: skip


@dataclass(frozen=True, slots=True)
class Cost:
    """What one scene came to; shares and contacts are None where no pose collides, or is contained."""

    geoms: int
    load: float
    model: float
    arena: float
    full: int
    looked: int
    contacts: float | None
    most: int | None
    step: float | None
    felt: float | None
    contained: float | None
    samples: int
    inside: int


def cost(path: str, options: dict[str, Any]) -> Cost:
    """Measure one scene with the env2mjcf that is installed."""
    import env2mjcf

    start = time.process_time()
    scene = env2mjcf.load(path, cache=False, **options)
    load, model = time.process_time() - start, scene.model
    collides = (model.geom_contype | model.geom_conaffinity) != 0
    common: dict[str, Any] = {
        "geoms": int(collides.sum()),
        "load": load,
        "model": mujoco.mj_sizeModel(model) / 1e6,
        "arena": model.narena / 1e6,
    }
    q = scene.space.sample(POSES, seed=5)
    if not scene.space.dim:
        return Cost(**common, full=0, looked=0, contacts=None, most=None, step=None, felt=None, contained=None,
                    samples=0, inside=0)  # fmt: skip
    surface = env2mjcf.load(path, cache=False, **{**options, "collision": "surface"})
    drawn = np.concatenate([q, scene.space.sample(DRAWN - POSES, seed=6)])
    hits = np.concatenate([np.asarray(scene.in_collision(rows, threads=1)) for rows in np.array_split(drawn, 20)])
    hit = drawn[hits]
    within = hit[~np.asarray(surface.in_collision(hit, threads=1))] if len(hit) else hit
    look = _Looks(scene)
    random = look(q)
    colliding, contained = (look(rows[:ASKED]) for rows in (hit, within))
    least = sorted(range(len(colliding)), key=lambda i: colliding[i])
    spread = [hit[least[i]] for i in np.linspace(0, len(least) - 1, STEPPED).round().astype(int)] if least else []
    worst = sorted(range(len(random)), key=lambda i: -abs(random[i]))[:STEPPED]
    full = sum(r < 0 for r in random) or sum(look.lacks_room(q[i]) for i in worst)
    steps = [look.step(row) for row in spread]
    return Cost(
        **common,
        full=full,
        looked=len(random),
        contacts=float(np.median(np.abs(colliding))) if colliding else None,
        most=int(np.abs([*colliding, *random]).max()) if colliding else None,
        step=float(np.median(steps)) / model.opt.timestep if steps else None,
        felt=float(np.mean(np.array(colliding) != 0)) if colliding else None,
        contained=float(np.mean(np.array(contained) != 0)) if contained else None,
        samples=len(colliding),
        inside=len(contained),
    )


class _Looks:
    """Plain MuJoCo on a scene."""

    def __init__(self, scene: Any) -> None:
        self._scene, self._model = scene, scene.model
        self._data = mujoco.MjData(scene.model)

    def __call__(self, rows: np.ndarray) -> list[int]:
        """Return the number of contacts of each row, negative where memory was too small for more."""
        found: list[int] = []
        end = time.process_time() + BUDGET
        for q in rows:
            self._place(q)
            full = self._warned()
            try:
                mujoco.mj_kinematics(self._model, self._data)
                mujoco.mj_collision(self._model, self._data)
                count = self._data.ncon
            except mujoco.FatalError:
                count, full = -1, -1
            found.append(count if full == self._warned() else -max(1, abs(count)))
            if time.process_time() > end:
                break
        return found

    def lacks_room(self, q: np.ndarray) -> bool:
        """Return whether forces, or contacts, do not fit."""
        self._place(q)
        full = self._warned()
        try:
            mujoco.mj_forward(self._model, self._data)
        except mujoco.FatalError:
            return True
        return full != self._warned()

    def step(self, q: np.ndarray) -> float:
        """Return the CPU seconds of a step."""
        self._place(q)
        try:
            mujoco.mj_forward(self._model, self._data)
            start = time.process_time()
            mujoco.mj_step(self._model, self._data)
        except mujoco.FatalError:
            return np.nan
        return time.process_time() - start

    def _place(self, q: np.ndarray) -> None:
        mujoco.mj_resetData(self._model, self._data)
        # Its first warning of each kind would be printed.
        self._data.warning.number[:] = 1
        self._data.qpos[:] = self._scene.space.qpos(q)

    def _warned(self) -> int:
        kinds = mujoco.mjtWarning.mjWARN_CONTACTFULL, mujoco.mjtWarning.mjWARN_CNSTRFULL
        return int(sum(self._data.warning[int(kind)].number for kind in kinds))


def asked(python: str, case: Case, settings: Sequence[tuple[str, str, float]] = ()) -> Cost | str:
    """Return what a scene comes to with one installation and changed settings, or why there is none."""
    options = json.dumps({k: v for k, v in case.options.items() if k != "query"}, default=os.fspath)
    words = [
        *shlex.split(python),
        str(Path(__file__).resolve()),
        "--work",
        str(case.path),
        options,
        json.dumps(settings),
    ]
    done = subprocess.run(words, capture_output=True, text=True, check=False)
    return (
        Cost(**json.loads(done.stdout))
        if done.returncode == 0
        else next(
            (line.partition(": ")[2] for line in done.stderr.splitlines() if line.startswith("env2mjcf.")), "fails"
        )
    )


def row(name: str, costs: Sequence[Cost]) -> str:
    """Return a line of the table: older / newer."""

    def both(field: str, form: str, scale: float = 1) -> str:
        values = [getattr(c, field) for c in costs]
        texts = ["" if v is None else format(v if scale == 1 else scale * v, form) for v in values]
        return texts[0] if len(set(texts)) == 1 else " / ".join(texts)

    cells = [
        name.replace("_", "\\_"),
        both("geoms", "d"),
        both("contacts", ".0f"),
        both("most", "d"),
        both("step", ".2g"),
        f"{costs[-1].step / costs[0].step:.2f}" if costs[0].step and costs[-1].step and len(costs) > 1 else "",
        both("load", ".2f"),
        both("model", ".1f"),
        both("arena", ".0f"),
        both("full", "d"),
        both("felt", ".1f", 100),
        both("contained", ".1f", 100),
    ]
    return f"| {' | '.join(cells)} |"


_NAMES = (
    "geoms",
    "contacts",
    "most",
    "step",
    "ratio",
    "load, s",
    "model, MB",
    "arena, MB",
    "full",
    "felt, %",
    "contained, %",
)
HEADER = f"| scene | {' | '.join(_NAMES)} |\n| --- |{' ---: |' * len(_NAMES)}"


def sweep(python: str, cases: Sequence[Case]) -> list[str]:
    """Return the lines of the table of other cells: for each scene what it comes to as it is / with them."""
    lines = [HEADER]
    for case in (case for case in cases if case.name in SWEPT):
        usual = asked(python, case)
        for name, settings in SWEEP.items():
            found = asked(python, case, settings) if settings else usual
            costs = [c for c in ([usual, found] if settings else [usual]) if isinstance(c, Cost)]
            lines.append(row(f"{case.name}: {name}", costs))
            print(lines[-1], flush=True)
    return lines


def main(arguments: Sequence[str] | None = None) -> int:
    """Measure, print and perhaps write the table."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("pythons", nargs="+", metavar="PYTHON", help="of the old installation, and of the new one")
    parser.add_argument("--scenes", nargs="*", help="names, or parts of names; all by default")
    parser.add_argument("--sweep", action="store_true", help="measure other sizes of cells, too")
    parser.add_argument("--output", type=Path, help="where the page is written")
    chosen = parser.parse_args(arguments)
    corpus = os.environ.get("ENV2MJCF_CORPUS")
    cases = [*model_cases(), *(corpus_cases(Path(corpus)) if corpus else ())]
    names = {c.name for c in cases}
    # The same scene in an older dialect.
    cases = [c for c in cases if not (c.name.endswith("-vizmo") and c.name.removesuffix("-vizmo") in names)]
    if chosen.scenes is not None:
        cases = [c for c in cases if any(part in c.name for part in chosen.scenes)]
    print(HEADER, flush=True)
    lines, left_out = [HEADER], []
    for case in cases:
        found = [asked(python, case) for python in chosen.pythons[:2]]
        costs = [f for f in found if isinstance(f, Cost)]
        if len(costs) < len(found):
            left_out.append(case.name)
            continue
        lines.append(row(case.name, costs))
        print(lines[-1], flush=True)
    page = [
        "# What contacts cost",
        "",
        "Made by `benchmarks/contact_cost.py`: older / newer installation. " + machine(),
    ]
    page += ["", LEGEND.format(stepped=STEPPED, poses=POSES, asked=ASKED).strip(), "", *lines, ""]
    if left_out:
        page += [f"Scenes that do not convert: {', '.join(left_out)}.", ""]
    if chosen.sweep:
        page += ["## Other sizes of cells", "", "As it is / with other cells.", ""]
        page += [*sweep(chosen.pythons[-1], cases), ""]
    output = chosen.output or (None if chosen.scenes else OUTPUT)
    if output is not None:
        output.write_text("\n".join(page), encoding="utf-8")
    return 0


if __name__ == "__main__":
    if sys.argv[1:2] == ["--work"]:
        for module, name, value in json.loads(sys.argv[4]):
            setattr(importlib.import_module(module), name, value)
        print(json.dumps(asdict(cost(sys.argv[2], json.loads(sys.argv[3])))))
        sys.exit(0)
    sys.exit(main())
