"""What several test modules share."""

from __future__ import annotations

import os
from pathlib import Path

import pytest
from texts import read, read_robot  # noqa: F401  fixtures

_FOLDER = os.environ.get("ENV2MJCF_CORPUS")
CORPUS: Path | None = Path(_FOLDER) if _FOLDER else None


@pytest.fixture(scope="session")
def corpus() -> Path:
    """Folder of real scenes, which are not part of this repository."""
    if CORPUS is None:
        pytest.skip("ENV2MJCF_CORPUS does not name the folder of real scenes")
    if not CORPUS.is_dir():
        pytest.fail(f"ENV2MJCF_CORPUS names {CORPUS}, which is no folder")
    return CORPUS
