"""Fuzz a reader by mutation, each input under limits of time and memory.

    python tests/fuzz/run.py byu --seconds 1800 --seeds models /data/scenes

Findings are written to the folder of `--out`; the exit status is 1 where there is one.
"""

from __future__ import annotations

import argparse
import hashlib
import random
import resource
import signal
import sys
import time
import traceback
import warnings
from pathlib import Path
from types import FrameType

from mutations import mutated, seeds
from readers import MODELS, READERS, SEEDS

# Of the address space, on top of what the libraries take.
_MEMORY = 1 << 31
# For one input below 100 kilobytes; a reader takes milliseconds, MuJoCo's compiler may take seconds.
_SECONDS = 5.0


class TooSlow(BaseException):
    """An input took too long."""


def _too_slow(number: int, frame: FrameType | None) -> None:
    raise TooSlow


def main() -> int:
    """Run, and say how many inputs were tried."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("reader", choices=READERS)
    parser.add_argument("--seconds", type=float, default=60)
    parser.add_argument("--seed", type=int, default=0)
    parser.add_argument("--seeds", type=Path, nargs="*", default=[MODELS])
    parser.add_argument("--out", type=Path, default=Path("fuzz-findings"))
    options = parser.parse_args()
    run, starts = READERS[options.reader], seeds(SEEDS[options.reader], options.seeds)
    for data in starts[:3]:
        run(data)  # imports what is imported late
    in_use = int(Path("/proc/self/statm").read_text().split()[0]) * resource.getpagesize()
    resource.setrlimit(resource.RLIMIT_AS, (in_use + _MEMORY, resource.RLIM_INFINITY))
    signal.signal(signal.SIGALRM, _too_slow)
    warnings.simplefilter("error", RuntimeWarning)
    random_ = random.Random(options.seed)
    tried, read, slowest, found = 0, 0, 0.0, dict[str, int]()
    end = time.monotonic() + options.seconds
    while time.monotonic() < end:
        data = mutated(random_.choice(starts), random_.choice(starts), random_)
        tried += 1
        start = time.perf_counter()
        try:
            signal.setitimer(signal.ITIMER_REAL, _SECONDS)
            read += run(data)
        except (Exception, TooSlow) as error:
            signal.setitimer(signal.ITIMER_REAL, 0)
            at = traceback.extract_tb(error.__traceback__)[-1]
            kind = f"{type(error).__name__} at {at.filename}:{at.lineno}"
            found[kind] = found.get(kind, 0) + 1
            if found[kind] == 1:
                options.out.mkdir(parents=True, exist_ok=True)
                name = options.out / f"{options.reader}-{hashlib.sha256(data).hexdigest()[:12]}"
                name.write_bytes(data)
                print(f"{name}: {kind}: {error}", flush=True)
                traceback.print_exception(error, file=sys.stdout)
        finally:
            signal.setitimer(signal.ITIMER_REAL, 0)
        slowest = max(slowest, time.perf_counter() - start)
    print(
        f"{options.reader}: {tried} inputs, {read} of them read, slowest {slowest:.2f} s, "
        f"{len(found)} kinds of findings: {found}"
    )
    return 1 if found else 0


if __name__ == "__main__":
    sys.exit(main())
