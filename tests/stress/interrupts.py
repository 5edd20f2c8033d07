"""Interrupts every verb at random moments, as Ctrl-C does, and looks at what it says and leaves.

    python tests/stress/interrupts.py --count 20

Each has to end with status 130 (or to have been done before), without a traceback, half-written files or processes that
go on. Prints one line of figures for each verb; exit status 1 if something is not as it should be.
"""

from __future__ import annotations

import argparse
import sys
import tempfile
from pathlib import Path

ROOT = Path(__file__).parents[2]
sys.path[:0] = [str(ROOT), str(ROOT / "tests/support")]

import interrupting


def main() -> int:
    """Interrupt, and say what was found."""
    parser = argparse.ArgumentParser(description=__doc__.partition("\n")[0])
    parser.add_argument("--count", type=int, default=20)
    parser.add_argument("--seed", type=int, default=0)
    parser.add_argument("verbs", nargs="*", default=list(interrupting.VERBS))
    arguments = parser.parse_args()
    failed = False
    for verb in arguments.verbs:
        with tempfile.TemporaryDirectory() as temporary:
            folder = Path(temporary).resolve()
            interrupting.prepare(folder)
            tally = interrupting.interrupt_randomly(verb, folder, arguments.count, arguments.seed)
        print(
            f"interrupts: {verb}: {arguments.count} signals, {tally.interrupted} interrupted, "
            f"{tally.finished} done before, {len(tally.wrong)} wrong",
            flush=True,
        )
        for message in tally.wrong:
            print(f"    {message}")
        failed |= bool(tally.wrong)
    return int(failed)


if __name__ == "__main__":
    sys.exit(main())
