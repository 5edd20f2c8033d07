"""Damages entries of the geometry cache at random, again and again, and looks whether the scenes stay what they are.

    python tests/stress/damage.py --count 2000

Each time the entries of one scene of `models/` are cut short, or some of their bits, blocks or bytes at the end are
changed, or they are exchanged; then the scene is loaded twice. Prints one line of figures; exit status 1 if a scene was
another one, or an entry that was damaged was damaged still.
"""

from __future__ import annotations

import argparse
import os
import random
import sys
import tempfile
import time
from collections import Counter
from pathlib import Path

ROOT = Path(__file__).parents[2]
sys.path.insert(0, str(ROOT))

import env2mjcf
from env2mjcf.geometry.store import FOLDER_VARIABLE

SCENES = ("maze", "two-robots", "spherical-arm", "bug-trap")


def cut(data: bytearray, chance: random.Random) -> None:
    """Keep the beginning."""
    del data[chance.randrange(len(data)) :]


def flip(data: bytearray, chance: random.Random) -> None:
    """Change some bits."""
    for _ in range(chance.choice((1, 1, 8))):
        data[chance.randrange(len(data))] ^= 1 << chance.randrange(8)


def blank(data: bytearray, chance: random.Random) -> None:
    """Let a block be zero, as a file system may after a crash."""
    start = chance.randrange(len(data))
    block = data[start : start + chance.choice((8, 512, 4096))]
    data[start : start + len(block)] = bytes(len(block))


def scramble(data: bytearray, chance: random.Random) -> None:
    """Change the directory of the archive, which is at its end."""
    for _ in range(4):
        data[-1 - chance.randrange(min(len(data), 400))] = chance.randrange(256)


def repeat(data: bytearray, chance: random.Random) -> None:
    """Write a part twice."""
    start = chance.randrange(len(data))
    data[start:start] = data[start : start + chance.randrange(1, 4096)]


DAMAGES = (cut, flip, blank, scramble, repeat)


def content(scene: env2mjcf.Scene) -> tuple[str, dict[str, bytes]]:
    """Return all that plain MuJoCo is given."""
    return scene.xml, scene.assets


def main() -> int:
    """Damage, and say what was found."""
    parser = argparse.ArgumentParser(description=__doc__.partition("\n")[0])
    parser.add_argument("--count", type=int, default=2000)
    parser.add_argument("--seed", type=int, default=0)
    arguments = parser.parse_args()
    began, chance = time.monotonic(), random.Random(arguments.seed)
    said: Counter[str] = Counter()
    damaged, wrong = 0, 0
    with tempfile.TemporaryDirectory() as temporary:
        prepared = []
        for name in SCENES:
            folder = Path(temporary, name)
            os.environ[FOLDER_VARIABLE] = str(folder)
            reference = content(env2mjcf.load(ROOT / "models" / name / f"{name}.env"))
            prepared.append((name, folder, reference, {p: p.read_bytes() for p in sorted(folder.iterdir())}))
        for _ in range(arguments.count):
            # The first is loaded fastest, and most often.
            name, folder, reference, entries = chance.choices(prepared, (12, 6, 1, 1))[0]
            os.environ[FOLDER_VARIABLE] = str(folder)
            changed = 0
            for path, good in entries.items():
                data = bytearray(good)
                chance.choice(DAMAGES)(data, chance)
                path.write_bytes(data)
                changed += data != good
            damaged += changed
            for again in (False, True):
                scene = env2mjcf.load(ROOT / "models" / name / f"{name}.env")
                codes = [d.code for d in scene.diagnostics if d.code in ("GEO260", "GEO261")]
                said.update(codes)
                same = content(scene) == reference
                if not same or (again and codes) or len(codes) > changed:
                    wrong += 1
                    print(f"    {name}: {codes}, {'the same' if same else 'another'} scene")
    print(
        f"damage: {damaged} entries of {len(SCENES)} scenes; {said['GEO260']} made anew, the others were changed where "
        f"nobody reads; {wrong} wrong; {time.monotonic() - began:.0f} s"
    )
    return 1 if wrong else 0


if __name__ == "__main__":
    sys.exit(main())
