"""Every reader under changed files lets only errors of our own out. ENV2MJCF_FUZZ=100 tries a hundred times as many."""

from __future__ import annotations

import os
import random
import sys
from pathlib import Path

import pytest

FOLDER = Path(__file__).parent / "fuzz"
sys.path.insert(0, str(FOLDER))

from mutations import mutated, seeds  # noqa: E402
from readers import MODELS, READERS, SEEDS  # noqa: E402

TIMES = int(os.environ.get("ENV2MJCF_FUZZ", "1"))
FOLDERS = [MODELS, *(Path(os.environ[name]) for name in ("ENV2MJCF_CORPUS",) if name in os.environ)]
# These go the whole way to MuJoCo.
WHOLE = ("mesh", "scene")
LARGE = 10_000


@pytest.mark.filterwarnings("error::RuntimeWarning")
@pytest.mark.parametrize("reader", READERS)
def test_only_errors_of_our_own_come_out(reader: str) -> None:
    starts = [data for data in seeds(SEEDS[reader], FOLDERS) if len(data) < LARGE]
    random_ = random.Random(f"{reader}: the same on every run")
    # Else nothing but the refusal would be tested.
    assert any(READERS[reader](data) for data in starts)
    for _ in range(TIMES * (60 if reader in WHOLE else 500)):
        READERS[reader](mutated(random_.choice(starts), random_.choice(starts), random_))
