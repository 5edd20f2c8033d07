"""From words of the command line to a verb, through tyro, and to cameras and sizes of pictures."""

from __future__ import annotations

import dataclasses
import inspect
import math
from collections.abc import Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING, Annotated, Protocol, TypeVar, cast

import tyro
from tyro.constructors import ConstructorRegistry, PrimitiveConstructorSpec, PrimitiveTypeInfo

from ..options import OptionKeywords, Options, PathArgument
from .terminal import one_line

if TYPE_CHECKING:
    from ..view.cameras import Direction


@dataclass(frozen=True, slots=True)
class Output:
    """How a verb reports.

    Attributes:
        json: Print the result as JSON.
        verbose: Show notes, too, and all findings and rows instead of the first few of each kind.
        debug: Show a traceback when something fails.
    """

    json: bool = False
    verbose: bool = False
    debug: bool = False


# Both stand flat among a verb's own flags.
OutputFlags = Annotated[Output, tyro.conf.arg(name="")]
OptionFlags = Annotated[Options, tyro.conf.arg(name="")]


class Verb(Protocol):
    """What every verb is: a dataclass of its arguments that can be run."""

    @property
    def output(self) -> Output:
        """How it reports."""
        ...

    def run(self) -> int:
        """Do it, and return the exit status."""
        ...


V = TypeVar("V", bound=Verb)


def parse(verb: type[V], name: str, words: Sequence[str]) -> V:
    """Turn words into a verb.

    Raises:
        SystemExit: Help was asked for (0), or the words are wrong (2); tyro has said so.
    """
    shown = [one_line(word) for word in words]
    if shown == list(words):
        return _parse(verb, name, words)
    try:
        return _parse(verb, name, words, silent=True)
    except SystemExit:
        _parse(verb, name, shown)  # says what is wrong, in words that are fit for a terminal
        raise


def _parse(verb: type[V], name: str, words: Sequence[str], *, silent: bool = False) -> V:
    return tyro.cli(
        verb,
        prog=f"env2mjcf {name}",
        # tyro would drop the examples.
        description=inspect.cleandoc(verb.__doc__ or "").split("\n\nAttributes:")[0],
        args=list(words),
        console_outputs=not silent,
        registry=_paths_as_text(),
        config=(tyro.conf.DisallowNone,),
    )


def keywords(options: Options) -> OptionKeywords:
    """Return options as keyword arguments of the API."""
    return cast("OptionKeywords", {f.name: getattr(options, f.name) for f in dataclasses.fields(options)})


def _paths_as_text() -> ConstructorRegistry:
    """Teach tyro that a path argument is a word."""
    registry = ConstructorRegistry()

    @registry.primitive_rule
    def path_rule(  # pyright: ignore[reportUnusedFunction]
        info: PrimitiveTypeInfo,
    ) -> PrimitiveConstructorSpec[str | None] | None:
        if info.type not in (PathArgument, PathArgument | None):
            return None
        return PrimitiveConstructorSpec(
            nargs=1,
            metavar="PATH",
            instance_from_str=lambda words: words[0],
            is_instance=lambda value: value is None or isinstance(value, str),
            str_from_instance=lambda value: [str(value)],
        )

    return registry


def camera_of(word: str | None) -> str | Direction | None:
    """Return the camera that a word stands for: a name, or azimuth and elevation in degrees.

    Raises:
        ValueError: It is neither.
    """
    from ..view.cameras import DIRECTION_NAMES, Direction

    if word is None or word in DIRECTION_NAMES:
        return word
    try:
        azimuth, elevation = (float(part) for part in word.split(","))
    except ValueError:
        azimuth = elevation = math.nan
    if not (math.isfinite(azimuth) and -90 <= elevation <= 90):
        names = ", ".join(DIRECTION_NAMES)
        raise ValueError(f"--camera is {word}; expected {names}, or azimuth,elevation in degrees, as in 120,-35")
    return Direction(math.radians(azimuth), math.radians(elevation))


def size_of(word: str) -> tuple[int, int]:
    """Return the width and height that a word stands for.

    Raises:
        ValueError: It is not a size.
    """
    parts = word.lower().split("x")
    if len(parts) != 2 or not all(p.isascii() and p.isdigit() and len(p) < 9 for p in parts):
        raise ValueError(f"--size is {word}; expected width and height in pixels, as in 1280x960")
    return int(parts[0]), int(parts[1])
