"""Without an extra: one sentence that says what to install, from each verb that needs it, and only from those."""

from __future__ import annotations

import importlib.util
import os
import re
import sys
from collections.abc import Callable
from pathlib import Path
from typing import Any

import folders
import interrupting
import numpy as np
import pytest
from scenes import MODELS

from env2mjcf.view import offscreen

pytestmark = pytest.mark.skipif(os.name != "posix", reason="forks")
needs_gl = pytest.mark.skipif(offscreen.backend() is None, reason=f"no GL: {offscreen.missing()}")
MODULES = {
    "fast": ("numba", "llvmlite"), "view": ("PIL", "imageio", "imageio_ffmpeg", "viser"), "planning": ("ompl",),
    "dask": ("dask", "distributed"), "decompose": ("coacd",),
}  # fmt: skip
ALPHA = str(MODELS / "alpha" / "alpha.env")


class Without:
    """A finder that does not find some modules."""

    def __init__(self, finder: Any, names: tuple[str, ...]) -> None:
        self._finder, self._names = finder, names

    def find_spec(self, name: str, path: Any = None, target: Any = None) -> Any:
        return None if name.partition(".")[0] in self._names else self._finder.find_spec(name, path, target)

    def invalidate_caches(self) -> None:
        pass


def without(*extras: str) -> Callable[[], None]:
    """Return what makes a process one in which some extras are not installed."""
    names = tuple(n for extra in extras for n in MODULES[extra])

    def forget() -> None:
        sys.meta_path[:] = [Without(finder, names) for finder in sys.meta_path]
        own = "env2mjcf.contact.exact.kernels"
        for name in [m for m in sys.modules if m.partition(".")[0] in names or m.startswith(own)]:
            del sys.modules[name]
        assert all(importlib.util.find_spec(n) is None for n in names)

    return forget


@pytest.fixture(scope="module")
def folder(tmp_path_factory: pytest.TempPathFactory) -> Path:
    folder = tmp_path_factory.mktemp("extras")
    interrupting.prepare(folder)
    return folder


@pytest.mark.parametrize(
    ("extra", "words"),
    [
        ("fast", "check scene.env --engine exact"),
        ("fast", "batch scene.env q.npy -o made/v.npy --engine exact"),
        ("fast", "convert scene.env made --engine exact"),
        ("fast", "cache warm"),
        pytest.param("view", "render scene.env -o made/a.png --size 160x120", marks=needs_gl),
        pytest.param("view", "check scene.env --picture made/a.png", marks=needs_gl),
        ("view", "play scene.env a.path -o made/a.mp4"),
        ("view", "play scene.env a.path -o made/a.gif"),
        ("view", "view scene.env"),
        ("planning", "plan scene.env --query a.query -o made/b.path --planner RRTConnect"),
        ("planning", "plan scene.env --query a.query -o made/b.path"),
        ("dask", "batch scene.env q.npy -o made/v.npy --dask tcp://127.0.0.1:1"),
        ("decompose", f"convert {ALPHA} made --collision coacd --no-cache"),
    ],
)
def test_a_verb_says_what_to_install(extra: str, words: str, folder: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.chdir(folder)
    status, out, err = folders.verb(words.split(), without(extra))
    assert status in (2, 3)
    assert len(err.splitlines()) == 1
    assert re.fullmatch(r"env2mjcf: \w+: .*pip install 'env2mjcf\[" + extra + r"\]'\n", err)
    if "--picture" in words:
        assert "1 configuration: 1 valid" in out, "the report does not wait for the picture"
    else:
        assert out == ""
    assert list((folder / "made").rglob("*")) == []


@pytest.mark.parametrize(
    "words",
    [
        "info scene.env",
        "lint scene.env",
        "check scene.env a.path",
        "convert scene.env {out}",
        "translate scene.env -o {out}/b.env --dialect C",
        "batch scene.env q.npy -o {out}/v.npy",
        "cache info",
    ],
)
def test_everything_else_works_without_any(
    words: str, folder: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.chdir(folder)
    status, out, err = folders.verb(words.format(out=tmp_path).split(), without(*MODULES))
    assert status in ((0, 1) if words.startswith("lint") else (0,)), err
    assert out
    assert "pip install" not in err
    if words.startswith("batch"):
        assert len(np.load(tmp_path / "v.npy")) == 4000
