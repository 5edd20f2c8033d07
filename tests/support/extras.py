"""Tests of what an extra is for are skipped where it is not installed, and no other ones."""

from __future__ import annotations

from importlib.util import find_spec

import pytest

PACKAGES = {
    "fast": ("numba",),
    "view": ("PIL", "imageio", "imageio_ffmpeg", "viser"),
    "planning": ("ompl",),
    "dask": ("dask", "distributed"),
    "decompose": ("coacd",),
    "solids": ("manifold3d",),
}


def missing(extra: str) -> str:
    """Return why tests of an extra are skipped; an empty text if they are not."""
    absent = [name for name in PACKAGES[extra] if find_spec(name) is None]
    return f"no {', no '.join(absent)}: pip install 'env2mjcf[{extra}]'" if absent else ""


def needs(extra: str) -> pytest.MarkDecorator:
    """Mark a test of an extra."""
    return pytest.mark.skipif(bool(missing(extra)), reason=missing(extra) or "it is there")


def skip_without(extra: str) -> None:
    """Skip the test, or the module, that is at this line."""
    if reason := missing(extra):
        pytest.skip(reason, allow_module_level=True)
