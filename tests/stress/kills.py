"""Kills `env2mjcf convert` at random moments of its life, again and again, and looks at what it leaves.

    python tests/stress/kills.py --kills 200

Two scenes are converted to one name in one folder, which also holds files of somebody else. After every kill the folder
has to hold the old scene or the new one, whole. Prints one line of figures; exit status 1 if something is not as it
should be.
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
from killing import kill_randomly

import env2mjcf

SCENES = (ROOT / "models" / "seed" / "seed.env", ROOT / "models" / "gantry" / "gantry.env")


def main() -> int:
    """Kill, and say what was found."""
    parser = argparse.ArgumentParser(description=__doc__.partition("\n")[0])
    parser.add_argument("--kills", type=int, default=200)
    parser.add_argument("--seed", type=int, default=0)
    arguments = parser.parse_args()
    began = time.monotonic()
    with tempfile.TemporaryDirectory() as temporary:
        folder = Path(temporary).resolve()
        references = [
            folders.content(env2mjcf.convert(scene, folder / f"reference{i}" / "scene.xml").xml)
            for i, scene in enumerate(SCENES)
        ]
        out = folder / "out"
        folders.add_foreign(out)
        env2mjcf.convert(SCENES[0], out / "scene.xml")
        tally = kill_randomly(SCENES, references, out, arguments.kills, arguments.seed)
        left = len(folders.staged(out))
        folders.age(out)
        last = env2mjcf.convert(SCENES[0], out / "scene.xml")
        kept = {*folders.FOREIGN, *(p.relative_to(out).as_posix() for p in (last.xml, *last.assets))}
        if folders.files(out) != kept:
            tally.wrong.append(f"not tidied up: {sorted(folders.files(out) ^ kept)}")
    print(
        f"kills: {tally.killed} conversions ({tally.writing} while writing), "
        f"{tally.finished} too quick; old scene {tally.old}, new scene {tally.new}; {left} staged files left, "
        f"removed when stale; {len(tally.wrong)} wrong; {time.monotonic() - began:.0f} s"
    )
    for message in tally.wrong:
        print(f"    {message}")
    return 1 if tally.wrong else 0


if __name__ == "__main__":
    sys.exit(main())
