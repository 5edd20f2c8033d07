"""Fuzz a reader guided by coverage, with atheris.

    python tests/fuzz/guided.py byu corpus-of-byu/ -max_total_time=1800

What follows the reader goes to libFuzzer: folders of inputs, the first of which grows, and its flags.
"""

from __future__ import annotations

import sys

import atheris

with atheris.instrument_imports(include=["env2mjcf"]):
    from readers import READERS


def main() -> None:
    """Run until a fault, or the time that libFuzzer was given."""
    if len(sys.argv) < 2 or sys.argv[1] not in READERS:
        sys.exit(f"{__doc__}\nreaders: {', '.join(READERS)}")
    atheris.Setup(
        [sys.argv[0], "-timeout=10", "-rss_limit_mb=3000", "-max_len=20000", *sys.argv[2:]], READERS[sys.argv[1]]
    )
    atheris.Fuzz()


if __name__ == "__main__":
    main()
