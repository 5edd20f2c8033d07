"""The pages that scripts write are those that are committed."""

from __future__ import annotations

import subprocess
import sys
from pathlib import Path

DOCS = Path(__file__).parent.parent / "docs"


def test_the_page_of_diagnostics_lists_every_code() -> None:
    done = subprocess.run([sys.executable, DOCS / "diagnostics.py", "--check"], check=False)
    assert done.returncode == 0, "run `make tables`"
