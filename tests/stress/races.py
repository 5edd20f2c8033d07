"""Lets two to eight processes convert into one folder at once, while another reads it with plain MuJoCo.

    python tests/stress/races.py --rounds 50

Prints one line of figures for each way to get in each other's way; exit status 1 if something is not as it should be.
"""

from __future__ import annotations

import argparse
import sys
import tempfile
import time
from pathlib import Path

ROOT = Path(__file__).parents[2]
sys.path[:0] = [str(ROOT), str(ROOT / "tests/support")]

import folders

COUNTS = (2, 4, 8)


def ways(scenes: tuple[Path, Path], out: Path, count: int) -> dict[str, list[tuple[list[Path], Path]]]:
    """Return what each of some processes converts, and where to."""
    first, second = scenes
    return {
        "one scene": [([first], out)] * count,
        "two scenes of one name": [([first, second], out), ([second, first], out)] * (count // 2),
        "names that share assets": [([first, second], out / f"{'abc'[i % 3]}.xml") for i in range(count)],
    }


def main() -> int:
    """Race, and say what was found."""
    parser = argparse.ArgumentParser(description=__doc__.partition("\n")[0])
    parser.add_argument("--rounds", type=int, default=50)
    rounds, failed = parser.parse_args().rounds, False
    for count in COUNTS:
        for what in ways((Path(), Path()), Path(), count):
            with tempfile.TemporaryDirectory() as temporary:
                folder = Path(temporary).resolve()
                scenes, out = folders.two_scenes(folder), folder / "out"
                folders.add_foreign(out)
                began = time.monotonic()
                readings, wrong = folders.race(ways(scenes, out, count)[what], rounds, folder / "stop")
                seconds = time.monotonic() - began
                named = {n for xml in out.glob("*.xml") for n in folders.content(xml)}
                left = {Path(n).name for n in folders.files(out)} ^ {*named, *(Path(n).name for n in folders.FOREIGN)}
                if left or not folders.foreign_untouched(out):
                    wrong.append(f"files: {sorted(left)}")
            print(
                f"races: {count} processes x {rounds} rounds, {what}: {readings} readings meanwhile, "
                f"{len(wrong)} wrong; {seconds:.0f} s"
            )
            for message in wrong[:5]:
                print(f"    {message}")
            failed |= bool(wrong)
    return int(failed)


if __name__ == "__main__":
    sys.exit(main())
