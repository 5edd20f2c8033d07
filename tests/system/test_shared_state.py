"""Calls leave nothing behind: no state in modules but caches, none in the process, none after an error."""

from __future__ import annotations

import enum
import gc
import importlib
import locale
import os
import pkgutil
import random
import shutil
import signal
import subprocess
import sys
import threading
import warnings
from collections.abc import Callable, Iterator, MutableMapping, MutableSequence, MutableSet
from pathlib import Path
from typing import Any
from weakref import WeakKeyDictionary, WeakSet

import mujoco
import numpy as np
import pytest
from extras import needs, skip_without
from scenes import MODELS, free_cube, write_scene

import env2mjcf
from env2mjcf.planning import plan
from env2mjcf.view import offscreen, picture

ROOT = Path(__file__).parents[2]
ALPHA = MODELS / "alpha" / "alpha.env"

# All that changes in modules while they are used, and why that may be.
CHANGING = {
    "env2mjcf.system.locks._at_work": "threads that are at rows just now: the interpreter waits for them at its end",
    "env2mjcf.contact.executors._memory": "the scenes that a worker process was sent, by the digest of all they hold",
    "env2mjcf.contact.executors._parcels": "scenes as bytes, while the scenes live",
    "env2mjcf.system.locks._locks": "all locks, while they live: a forked child opens them",
    "env2mjcf.contact.exact.engine._loading": "held while numba is imported or compiles",
    "env2mjcf.contact.exact.engine._announce": "a cache: a process says once that it compiles",
    "env2mjcf.planning.route._one_at_a_time": "held while OMPL plans: its random numbers are the process's",
    "env2mjcf.geometry.store._provenance": "a cache: the digest of the geometry code",
    "env2mjcf.geometry.mesh._READERS": "readers of meshes by file ending; filled on import",
    "env2mjcf.planning.planner_space._remembered": "a cache of at most 512 read-only arrays, of 512 numbers at most",
    "env2mjcf.system.files._views_of_the_system": "a cache: which devices /proc and /sys are",
    "env2mjcf.view.offscreen._backend": "a cache: the GL backend, by what MUJOCO_GL asks for",
    "env2mjcf.testing.assertions._numbered": "numbers of pictures, by the name of the test that failed",
}


def modules() -> Iterator[Any]:
    for found in pkgutil.walk_packages(env2mjcf.__path__, "env2mjcf."):
        # Run as scripts, not imported.
        if not found.name.endswith(("__main__", ".worker")):
            yield importlib.import_module(found.name)


def is_state(name: str, value: object) -> bool:
    """Whether a module's variable can change: a table in capitals is one by intent only if it is ever written to."""
    if isinstance(value, (MutableMapping, MutableSequence, MutableSet, WeakKeyDictionary, WeakSet, threading.local)):
        return True
    if hasattr(value, "cache_info"):
        return True
    own = type(value).__module__.startswith("env2mjcf") and not isinstance(value, (type, enum.Enum))
    return own and not getattr(type(value), "__dataclass_params__", None) and hasattr(value, "__dict__")


def everything(folder: Path) -> None:
    """Use every room of the package once."""
    scene = env2mjcf.load(ALPHA)
    q = scene.space.sample(6, seed=0)
    for engine in ("exact", "mujoco"):
        scene.in_collision(q, engine=engine)
        scene.is_valid(q, engine=engine)
    scene.clearance(q)
    scene.packed_contacts(q)
    scene.edge_in_collision(q, q[::-1])
    scene.edge_is_free(q[:2], q[1:3])
    scene.check_path(q[:2])
    scene.set(q[0])
    env2mjcf.convert(ALPHA, folder / "out")
    found = env2mjcf.translate(scene.environment, "D")
    env2mjcf.write_environment(found.environment, folder / "new.env")
    env2mjcf.read_path(scene, env2mjcf.write_path(scene, q, folder / "a.path"))


def tables() -> dict[str, object]:
    """Return all module-level containers, caches and objects of the package that could hold state, by name."""
    found: dict[str, object] = {}
    for module in modules():
        for name, value in vars(module).items():
            if not name.startswith("__") and is_state(name, value):
                home = (
                    getattr(value, "__module__", module.__name__) if hasattr(value, "cache_info") else module.__name__
                )
                if home == module.__name__:
                    found[f"{module.__name__}.{name}"] = value
    return found


@needs("fast")
def test_modules_hold_no_state_but_what_is_listed_here(tmp_path: Path) -> None:
    """Tables that are never written to are constants, whatever their type; all else has a reason above."""
    constants = {n: repr(v) for n, v in tables().items() if n not in CHANGING and isinstance(v, (dict, list, set))}
    others = {n for n in tables() if n not in CHANGING and n not in constants}
    assert others == set()
    everything(tmp_path)
    assert {n: repr(v) for n, v in tables().items() if n in constants} == constants
    listed = set(CHANGING) - set(tables())
    assert listed <= {"env2mjcf.geometry.mesh._READERS"}, "what is not there any more"


def test_no_function_assigns_to_variables_of_its_module() -> None:
    # What ends the program belongs to the process, and concerns no library.
    sources = [p.read_text() for p in (ROOT / "env2mjcf").rglob("*.py") if p.name != "program.py"]
    assert len(sources) > 100
    assert [line for text in sources for line in text.splitlines() if line.lstrip().startswith("global ")] == []


def test_nothing_of_a_scene_is_left_when_it_is_gone() -> None:
    from env2mjcf.contact import executors as remote
    from env2mjcf.system import locks as forking

    def holdings() -> tuple[int, int, int]:
        gc.collect()
        alive = sum(isinstance(o, env2mjcf.Scene) for o in gc.get_objects())
        return alive, len(remote._parcels), len(forking._locks)

    before = holdings()
    for _ in range(3):
        scene = env2mjcf.load(ALPHA)
        scene.clearance(scene.space.home)
        remote.parcel(scene._solver)
    del scene
    assert holdings() == before


class Recorded:
    """What every library in a process shares."""

    def __init__(self) -> None:
        self.state = {
            "numpy's errors": np.geterr(),
            "numpy's printing": repr(np.get_printoptions()),
            "numpy's random numbers": repr(np.random.get_state()),  # noqa: NPY002
            "random numbers": random.getstate(),
            "filters of warnings": list(warnings.filters),
            "locale": locale.setlocale(locale.LC_ALL),
            "signals": [signal.getsignal(n) for n in (signal.SIGINT, signal.SIGTERM, signal.SIGPIPE, signal.SIGCHLD)],
            "folder": os.getcwd(),
            "environment": dict(os.environ),
            "umask": _umask(),
            "recursion": sys.getrecursionlimit(),
            "hooks": (sys.excepthook, threading.excepthook, sys.stdout, sys.stderr, sys.displayhook),
            "switch interval": sys.getswitchinterval(),
            "garbage collection": (gc.isenabled(), gc.get_threshold()),
            "paths": list(sys.path),
            "mujoco": (mujoco.get_mju_user_warning(), *(getattr(mujoco, f"get_mjcb_{n}")() for n in _CALLBACKS)),
        }

    def changed(self) -> list[str]:
        now = Recorded().state
        return [name for name, value in self.state.items() if now[name] != value]


_CALLBACKS = ("passive", "control", "contactfilter", "sensor", "act_gain", "act_bias", "act_dyn")


def _umask() -> int:
    mask = os.umask(0o022)
    os.umask(mask)
    return mask


@needs("fast")
def test_the_process_is_as_it_was_after_every_kind_of_call(tmp_path: Path) -> None:
    before = Recorded()
    everything(tmp_path)
    assert before.changed() == []
    thread = threading.Thread(target=everything, args=(tmp_path / "in a thread",))
    (tmp_path / "in a thread").mkdir()
    thread.start()
    thread.join()
    assert before.changed() == []


def test_the_process_is_as_it_was_after_planning_and_pictures() -> None:
    scene = env2mjcf.load(MODELS / "seed" / "seed.env")
    before = Recorded()
    if offscreen.backend() is not None:
        picture(scene, size=(32, 24))
    skip_without("planning")
    alpha = env2mjcf.load(ALPHA)
    q = alpha.space.sample(60, seed=0)
    q = q[alpha.is_valid(q)]
    plan(alpha, q[0], q[-1], time=20, shorten=False)
    assert before.changed() == []


def test_numpys_own_settings_do_not_change_answers(tmp_path: Path) -> None:
    """A caller that lets numpy raise on invalid results gets the same answers."""
    scene = env2mjcf.load(ALPHA)
    q = scene.space.sample(10, seed=0)
    expected = scene.clearance(q).tolist(), scene.is_valid(q, engine="mujoco").tolist()
    with np.errstate(invalid="raise", divide="raise", over="raise"):
        again = env2mjcf.load(ALPHA, cache=False)
        assert (again.clearance(q).tolist(), again.is_valid(q, engine="mujoco").tolist()) == expected


def bad_calls(scene: env2mjcf.Scene, folder: Path) -> list[Callable[[], object]]:
    q = scene.space.sample(4, seed=1)
    broken = write_scene(folder / "broken", free_cube("missing.g 0 0 0 0 0 0"))
    half = write_scene(folder / "half", free_cube("5 0 0 0 0 0")[:60])
    return [
        lambda: scene.in_collision(q * np.nan),
        lambda: scene.in_collision(q, engine="none"),  # type: ignore[arg-type]
        lambda: scene.clearance(q[:, :2]),
        lambda: scene.edge_in_collision(q, q, -1.0),
        lambda: scene.contacts_of_poses(np.zeros((9, 9))),
        lambda: scene.set(q[0] * np.inf),
        lambda: scene.is_valid(q, executor=object()),  # type: ignore[arg-type]
        lambda: scene.in_collision(q, threads=0),
        lambda: env2mjcf.read(folder / "none.env"),
        lambda: env2mjcf.load(broken),
        lambda: env2mjcf.load(half),
        lambda: env2mjcf.load(ALPHA, nonsense=1),
        lambda: env2mjcf.convert(ALPHA, ALPHA),
        lambda: env2mjcf.write_path(scene, q, folder / "no" / "such" / "a.path"),
    ]


@needs("fast")
def test_a_call_that_fails_leaves_nothing_behind(tmp_path: Path) -> None:
    scene = env2mjcf.load(ALPHA)
    q = scene.space.sample(12, seed=2)

    def answers() -> tuple[object, ...]:
        verdicts = [scene.in_collision(q, engine=e).tolist() for e in ("exact", "mujoco")]
        return *verdicts, scene.clearance(q[:3]).tolist(), scene.q().tolist(), scene.model.nq

    expected, calls = answers(), bad_calls(scene, tmp_path)
    before, files = Recorded(), sorted(tmp_path.rglob("*"))
    threads, descriptors = threading.active_count(), _descriptors()
    for call in calls:
        with pytest.raises((ValueError, TypeError, env2mjcf.Env2MjcfError)):
            call()
        assert answers() == expected
    assert before.changed() == []
    assert sorted(tmp_path.rglob("*")) == files
    assert (threading.active_count(), _descriptors()) == (threads, descriptors)


def _descriptors() -> int:
    folder = Path("/proc/self/fd")
    return len(list(folder.iterdir())) if folder.is_dir() else 0


COMMAS = """
import locale, sys
from pathlib import Path
print(locale.setlocale(locale.LC_ALL, ""), locale.localeconv()["decimal_point"])
import env2mjcf
scene = env2mjcf.load(sys.argv[1], engine="mujoco")
q = scene.space.sample(40, seed=0)
print(scene.in_collision(q).tolist(), scene.clearance(q[:5]).tolist(), scene.link_poses(q).sum())
result = env2mjcf.convert(sys.argv[1], sys.argv[2])
print(result.xml.read_bytes().hex(), [p.read_bytes().hex() for p in result.assets])
print(env2mjcf.write_path(scene, q, Path(sys.argv[2]) / "a.path").read_text())
"""


@pytest.mark.slow
@pytest.mark.skipif(not shutil.which("localedef"), reason="localedef, which makes locales, is not installed")
def test_commas_of_a_locale_are_not_read_or_written(tmp_path: Path) -> None:
    """A process that has set a German locale, for MuJoCo's own reading of numbers, too."""
    made = subprocess.run(
        ["localedef", "-i", "de_DE", "-f", "UTF-8", str(tmp_path / "de_DE.UTF-8")], check=False, capture_output=True
    )
    if not (tmp_path / "de_DE.UTF-8").exists():
        pytest.skip(f"the locale cannot be made: {made.stderr.decode()}")
    said = []
    for name in ("C.UTF-8", "de_DE.UTF-8"):
        environment = {**os.environ, "LOCPATH": str(tmp_path), "LC_ALL": name, "PYTHONPATH": str(ROOT)}
        finished = subprocess.run(
            [sys.executable, "-c", COMMAS, str(ALPHA), str(tmp_path / name.partition(".")[0])],
            env=environment, capture_output=True, text=True, check=False,
        )  # fmt: skip
        assert finished.returncode == 0, finished.stderr
        said.append(finished.stdout.partition("\n"))
    assert said[1][0] == "de_DE.UTF-8 ,"
    assert said[0][2] == said[1][2]
