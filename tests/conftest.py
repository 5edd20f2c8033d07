"""What several test modules share."""

from __future__ import annotations

import os
import runpy
from collections.abc import Iterator
from pathlib import Path

import pytest
from texts import read, read_robot  # noqa: F401  fixtures

# Two workers share the cores: the threads of each one's OpenBLAS would wait for those of the other.
os.environ.setdefault("OPENBLAS_NUM_THREADS", "1")

# What is hidden from this process is hidden from its children too.
if os.environ.get("ENV2MJCF_TEST_WITHOUT"):
    _hiding = Path(__file__).parent / "support" / "without"
    runpy.run_path(str(_hiding / "sitecustomize.py"))
    os.environ["PYTHONPATH"] = os.pathsep.join(p for p in (str(_hiding), os.environ.get("PYTHONPATH", "")) if p)

_FOLDER = os.environ.get("ENV2MJCF_CORPUS")
CORPUS: Path | None = Path(_FOLDER) if _FOLDER else None


@pytest.fixture(scope="session", autouse=True)
def _own_cache(tmp_path_factory: pytest.TempPathFactory) -> Iterator[None]:
    """Keep the user's geometry cache out of the tests; processes that they start inherit this."""
    with pytest.MonkeyPatch.context() as patch:
        patch.setenv("ENV2MJCF_CACHE_DIR", str(tmp_path_factory.mktemp("cache")))
        yield


@pytest.fixture(scope="session")
def corpus() -> Path:
    """Folder of real scenes, which are not part of this repository."""
    if CORPUS is None:
        pytest.skip("ENV2MJCF_CORPUS does not name the folder of real scenes")
    if not CORPUS.is_dir():
        pytest.fail(f"ENV2MJCF_CORPUS names {CORPUS}, which is not a folder")
    return CORPUS


@pytest.hookimpl(tryfirst=True)
def pytest_collection_modifyitems(items: list[pytest.Item]) -> None:
    """Mark as slow every case of a `slow_but(*words)` test whose id holds none of the words."""
    for item in items:
        case = getattr(item, "callspec", None)
        for mark in item.iter_markers("slow_but"):
            if case and not any(word in case.id for word in mark.args):
                item.add_marker(pytest.mark.slow)
