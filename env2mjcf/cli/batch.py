"""`env2mjcf batch`."""

from __future__ import annotations

import dataclasses
from collections.abc import Generator
from concurrent.futures import Executor
from contextlib import contextmanager
from dataclasses import dataclass, field
from typing import TYPE_CHECKING, Annotated, Literal

import tyro
from rich.text import Text
from tyro.conf import Positional

from ..errors import counted
from ..options import Options
from .arguments import OptionFlags, Output, OutputFlags
from .meter import Meter
from .program import DONE
from .terminal import listed, loaded, one_line, print_diagnostics, print_json, print_parts, remark

if TYPE_CHECKING:
    from ..batch import BatchResult

# Seconds to wait for a scheduler, and for its first worker.
_DASK_PATIENCE = 15


@dataclass(frozen=True, slots=True)
class Batch:
    """Write a verdict on each configuration of a NumPy file to another one; neither needs to fit into memory.

    The configurations are an array of shape (n, dim), in metres and radians, as numpy.save writes it; the verdicts one
    of n bools, or of n floats for clearances. A run that is interrupted, or dies, goes on where it stopped when the
    same command is given again. Exit status 0 says that all verdicts are written, whatever they are.

    Examples:
      env2mjcf batch scene.env samples.npy -o verdicts.npy
      env2mjcf batch scene.env samples.npy -o valid.npy --what valid --threads 8
      env2mjcf batch scene.env samples.npy -o clearance.npy --what clearance --dask tcp://10.0.0.1:8786
      env2mjcf batch scene.env turns.npy -o verdicts.npy --file-units --json

    Attributes:
        scene: An env file, an XML environment or a problem XML.
        configurations: A .npy file of shape (n, dim).
        out: The .npy file to write, which appears when it is whole.
        what: Is a configuration in collision; is it valid (limits, boundary, collision); how far is it from touching.
        file_units: Numbers are the scene file's own (turns or fractions of pi, and its lengths).
        threads: Number of threads, if not all cores.
        dask: Address of a Dask scheduler whose workers do the work.
    """

    scene: Annotated[str, tyro.conf.arg(metavar="SCENE"), Positional]
    configurations: Annotated[str, tyro.conf.arg(metavar="CONFIGS.npy"), Positional]
    out: Annotated[str, tyro.conf.arg(aliases=("-o",), metavar="VERDICTS.npy")]
    what: Literal["collision", "valid", "clearance"] = "collision"
    file_units: bool = False
    threads: Annotated[int | None, tyro.conf.arg(metavar="N")] = None
    dask: Annotated[str | None, tyro.conf.arg(metavar="ADDRESS")] = None
    output: OutputFlags = field(default_factory=Output)
    options: OptionFlags = field(default_factory=Options)

    def run(self) -> int:
        """Write the verdicts, and print how many there are of each kind."""
        from ..batch import run

        if self.threads is not None and self.threads < 1:
            raise ValueError(f"--threads is {self.threads}; expected at least 1")
        scene, _ = loaded(self.scene, self.options)
        print_diagnostics(scene.diagnostics, self.output.verbose)
        with _executor(self.dask) as executor, Meter() as meter:
            result = run(
                scene, self.configurations, self.out, self.what,
                file_units=self.file_units, threads=self.threads, executor=executor, advance=meter.at, say=remark,
            )  # fmt: skip
        if self.output.json:
            print_json(
                {
                    **dataclasses.asdict(result),
                    "rate": result.rate,
                    "diagnostics": listed(scene.diagnostics, self.output.verbose),
                }
            )
        else:
            print_parts([_summary(result)])
        return DONE


@contextmanager
def _executor(address: str | None) -> Generator[Executor | None]:
    """Connect to a Dask scheduler.

    Raises:
        ValueError: Dask is not installed, or nobody answers, or nobody works there.
    """
    if address is None:
        yield None
        return
    try:
        from distributed import Client
    except ImportError:
        raise ValueError("--dask needs one more package: pip install 'env2mjcf[dask]'") from None
    try:
        client = Client(address, timeout=_DASK_PATIENCE, set_as_default=False)
    except (OSError, ValueError) as error:
        raise ValueError(f"no Dask scheduler answers at {address} ({error}); `dask scheduler` starts one") from error
    with client:
        try:
            client.wait_for_workers(1, timeout=_DASK_PATIENCE)
        except TimeoutError:
            raise ValueError(f"{address} has no workers; `dask worker {address}` starts some") from None
        yield client.get_executor()


def _summary(result: BatchResult) -> Text:
    counts = ", ".join(f"{n} {what}" for what, n in result.counts.items())
    least = "" if result.least is None else f"; least clearance {result.least:.6g} m"
    rows, written = counted(result.rows, "configuration"), one_line(str(result.output))
    return Text(f"{rows}: {counts}{least}; written to {written}", "bold")
