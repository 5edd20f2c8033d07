"""Many simulations at once: mujoco.rollout and MuJoCo Warp on the scenes of models/, as they are written.

    python benchmarks/rollouts.py [--other PYTHON] [--output PAGE]

`--other` is a Python that has mujoco-warp, which need not be the one that has env2mjcf: it may want another MuJoCo.
Without it its column is empty.
"""

from __future__ import annotations

import argparse
import json
import os
import subprocess
import tempfile
import time
from pathlib import Path

import mujoco
import mujoco.rollout
import numpy as np
from pages import table

import env2mjcf

MODELS = Path(__file__).parents[1] / "models"
ROLLOUTS, STEPS, COMPARED = 64, 200, 500
SPEED = 0.1  # standard deviation of each speed, m/s or rad/s
PATIENCE = 120  # seconds

LEGEND = """
Made by `python benchmarks/rollouts.py --other PYTHON`. {rollouts} simulations of {steps} steps from the scene's first
keyframe, with speeds at random: one after the other by `mj_step` from Python, and by `mujoco.rollout` with one thread
and with {cores}. Warp: by how much any number of qpos differs from MuJoCo's after {compared} steps of the first of
these simulations, on Warp's CPU device, in single precision.
""".strip()

# Runs in the other Python; prints what it found, null where the scene is refused or takes too long.
WARP = """
import json, sys
import mujoco, numpy as np
import warp as wp
wp.config.quiet = True
import mujoco_warp as mjw
model = mujoco.MjModel.from_xml_path(sys.argv[1]); data = mujoco.MjData(model)
mujoco.mj_resetDataKeyframe(model, data, 0)
data.qvel[:] = np.random.default_rng(0).normal(0, float(sys.argv[3]), model.nv)
mujoco.mj_forward(model, data)
m, d = mjw.put_model(model), mjw.put_data(model, data, nconmax=4096, njmax=8192)
for _ in range(int(sys.argv[2])):
    mjw.step(m, d); mujoco.mj_step(model, data)
print(json.dumps(float(np.abs(d.qpos.numpy()[0] - data.qpos).max())))
"""


def main() -> None:
    """Measure, and print or write the page."""
    parser = argparse.ArgumentParser(description="Simulations at once, of each scene of models/.")
    parser.add_argument("--other", help="a Python with mujoco-warp")
    parser.add_argument("--output", type=Path, help="the page; without it, it is printed")
    options = parser.parse_args()
    files = sorted(f for d in MODELS.iterdir() if d.is_dir() for f in (*d.glob("*.env"), *d.glob("*.xml")))
    chosen = {f.parent.name: f for f in files}
    rows = [_row(name, file, options.other) for name, file in sorted(chosen.items())]
    lines = [
        "# Thousands at once, measured",
        "",
        LEGEND.format(rollouts=ROLLOUTS, steps=STEPS, cores=os.cpu_count(), compared=COMPARED),
        "",
        *table(
            (
                *("scene", "geoms", "mj_step, steps/s", "rollout, 1 thread"),
                *(f"{os.cpu_count()} threads", "Warp differs by"),
            ),
            rows,
        ),
    ]
    text = "\n".join(lines) + "\n"
    if options.output:
        options.output.write_text(text, encoding="utf-8")
    else:
        print(text)


def _row(name: str, file: Path, other: str | None) -> tuple[str, ...]:
    scene = env2mjcf.load(file)
    model, rng = scene.model, np.random.default_rng(0)
    data = mujoco.MjData(model)
    mujoco.mj_resetDataKeyframe(model, data, 0)
    states = []
    for _ in range(ROLLOUTS):
        data.qvel[:] = rng.normal(0, SPEED, model.nv)
        state = np.empty(mujoco.mj_stateSize(model, mujoco.mjtState.mjSTATE_FULLPHYSICS))
        mujoco.mj_getState(model, data, state, mujoco.mjtState.mjSTATE_FULLPHYSICS)
        states.append(state)
    initial = np.array(states)
    begin = time.perf_counter()
    for state in initial:
        mujoco.mj_setState(model, data, state, mujoco.mjtState.mjSTATE_FULLPHYSICS)
        for _ in range(STEPS):
            mujoco.mj_step(model, data)
    speeds = [ROLLOUTS * STEPS / (time.perf_counter() - begin)]
    for threads in (1, os.cpu_count() or 1):
        room = [mujoco.MjData(model) for _ in range(threads)]
        begin = time.perf_counter()
        found, _ = mujoco.rollout.rollout(model, room, initial, nstep=STEPS)
        speeds.append(ROLLOUTS * STEPS / (time.perf_counter() - begin))
        assert found.shape[:2] == (ROLLOUTS, STEPS)
    differs = ""
    if other:
        with tempfile.TemporaryDirectory() as folder:
            differs = _differs(other, env2mjcf.convert(file, folder).xml)
    print(name, speeds, differs, flush=True)
    return name, str(scene.report.geoms), *(f"{s:,.0f}" for s in speeds), differs


def _differs(python: str, xml: Path) -> str:
    try:
        run = subprocess.run(
            [python, "-c", WARP, str(xml), str(COMPARED), str(SPEED)],
            capture_output=True,
            text=True,
            timeout=PATIENCE,
            check=True,
        )
        return f"{json.loads(run.stdout.splitlines()[-1]):.0e}"
    except subprocess.TimeoutExpired:
        return f"over {PATIENCE} s"
    except subprocess.CalledProcessError as error:
        return "refused: " + error.stderr.strip().splitlines()[-1].split(":")[-1].strip()[:60]


if __name__ == "__main__":
    main()
