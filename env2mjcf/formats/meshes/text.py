"""What the text formats of meshes share: how numbers are taken, what is checked, polygons as triangles."""

from __future__ import annotations

from collections.abc import Callable
from typing import NoReturn

import numpy as np
from numpy.typing import NDArray

from ...diagnostics import DiagnosticLog
from ...errors import Span
from ...limits import Limits, TooMuchWorkError, Work
from ..lexer import number_hint
from .numbers import Numbers, find_numbers, span_of
from .polygons import triangulate

# Vertices (n, 3) and triangles (m, 3): what every mesh reader returns.
MeshArrays = tuple[NDArray[np.float64], NDArray[np.int64]]

_BOM = b"\xef\xbb\xbf"
# CP/M filled the last block of a text with 0x1A, others with zeros, and editors put line ends behind it.
_FILLING = b"\x1a\0 \t\n\v\f\r"


def text_of(text: str | bytes, path: str, log: DiagnosticLog) -> bytes:
    """Return the bytes of a file's text without a byte order mark, and without DOS's mark of the end, with a warning.

    Args:
        text: The content of the file.
        path: The file, for messages.
        log: Where findings go.
    """
    data = text.encode("utf-8", "surrogateescape") if isinstance(text, str) else text
    data = data.removeprefix(_BOM)
    kept = len(data.rstrip(_FILLING))
    end = data.find(b"\x1a", kept)
    if end < 0:
        return data
    message = f"{path} ends with DOS's mark of the end, the byte 0x1A; it is not read"
    log.warn("GEO229", path, message, hint="remove it", span=span_of(path, data, end, end + 1))
    return data[:end]


class NumberFile:
    """A mesh file that holds only numbers, read by position.

    Args:
        numbers: The file's numbers.
        path: The file, for messages.
        log: Where findings go.
        limits: Bounds on hostile input.
    """

    def __init__(self, numbers: Numbers, path: str, log: DiagnosticLog, limits: Limits) -> None:
        self.numbers = numbers
        self.path = path
        self.log = log
        self.limits = limits

    @classmethod
    def of(cls, data: bytes, path: str, log: DiagnosticLog, limits: Limits) -> NumberFile:
        """Find the numbers of a text as Fortran or C print them."""
        return cls(find_numbers(data, fortran=True), path, log, limits)

    def span(self, token: int) -> Span:
        """Return the place of a token; of the last one for tokens behind the end."""
        if len(self.numbers.starts) == 0:
            return Span(self.path, 1, 1)
        return span_of(self.path, self.numbers.data, *self.numbers.extent(min(token, len(self.numbers.starts) - 1)))

    def fail(self, code: str, token: int, message: str, hint: str = "") -> NoReturn:
        """Raise a `GeometryError` at a token."""
        self.log.fail(code, self.path, message, hint=hint, span=self.span(token))

    def need(self, token: int, what: Callable[[int], str]) -> None:
        """Make sure that the tokens in front of `token` are there and are numbers.

        Args:
            token: First token that is not needed.
            what: Says what a token ought to be.
        """
        good = len(self.numbers)
        if good >= token:
            return
        if self.numbers.complete:
            self.fail("GEO213", good, f"the file ends where {what(good)} was expected", hint="is the file cut off?")
        found = self.numbers.text(good)
        if found.lower().lstrip("+-")[:3] in ("nan", "inf") or (found[-1:].isdigit() and "e" in found.lower()):
            self.fail("GEO212", good, f"{what(good)} is {_short(found)}; expected a finite number")
        hint = "a file of numbers has no comments" if found.startswith(("#", "%", "/")) else ""
        if not found.isprintable():
            hint = "is it a binary file?"
        self.fail("GEO211", good, f"expected {what(good)}, found {_short(found)}", hint=hint or number_hint(found))

    def integers(self, first: int, last: int, what: Callable[[int], str]) -> NDArray[np.int64]:
        """Return the tokens `first` to `last - 1`, which must be integers."""
        self.need(last, what)
        fraction = self.numbers.first_fraction(first, last)
        if fraction is not None:
            self.fail("GEO216", fraction, f"{what(fraction)} is {self.numbers.text(fraction)}; expected an integer")
        # No index is anywhere near the bounds, beyond which an integer would wrap around.
        return np.clip(self.numbers.values[first:last], -(2.0**62), 2.0**62).astype(np.int64)

    def count(self, token: int, what: str) -> int:
        """Return a count of vertices or polygons, which must be positive and within the limits."""
        value = int(self.integers(token, token + 1, lambda _: what)[0])
        if value < 0:
            self.fail("GEO216", token, f"{what} is {self.numbers.text(token)}; expected a positive number")
        if value == 0:
            self.fail("GEO210", token, f"{what} is 0: the mesh is empty", hint="expected at least one triangle")
        if value > self.limits.mesh_elements:
            message = f"{what} is {self.numbers.text(token)}; at most {self.limits.mesh_elements} are read"
            self.fail("GEO209", token, message, Limits.hint("mesh_elements"))
        return value

    def points(self, first: int, count: int) -> NDArray[np.float64]:
        """Return `count` vertices from token `first` on."""

        def what(token: int) -> str:
            row, axis = divmod(token - first, 3)
            return f"{'xyz'[axis]} of vertex {row + 1} of {count}"

        self.need(first + 3 * count, what)
        return self.numbers.values[first : first + 3 * count].reshape(-1, 3)

    def nothing_after(self, token: int, expected: str) -> None:
        """Make sure that the file ends in front of a token."""
        left = len(self.numbers.starts) - token
        if left > 0:
            found = f"{left} more words behind {expected}, first {_short(self.numbers.text(token))}"
            hint = "do the counts of the header fit the file?"
            self.fail("GEO215", token, f"{found}; expected the end of the file", hint)

    def faces(
        self,
        vertices: NDArray[np.float64],
        corners: NDArray[np.int64],
        counts: NDArray[np.int64],
        place: Callable[[int], Span],
    ) -> NDArray[np.int64]:
        """Cut the file's polygons into triangles and say where they are more, or less, than triangles.

        Args:
            vertices: (n, 3) points.
            corners: Valid indices into `vertices`, polygon after polygon.
            counts: Number of corners of each polygon.
            place: Where a polygon stands in the file.
        """
        path, log, limits = self.path, self.log, self.limits
        if counts.size and counts.max() > limits.polygon_corners:
            worst = int(counts.argmax())
            message = f"a polygon has {counts[worst]} corners; at most {limits.polygon_corners} are read"
            hint = f"triangulate the mesh, or {Limits.hint('polygon_corners')}"
            log.fail("GEO227", path, message, hint=hint, span=place(worst))
        small = np.flatnonzero(counts < 3)
        if small.size:
            message = f"{small.size} of {counts.size} polygons have fewer than three corners; skipped"
            log.warn("GEO221", path, message, span=place(int(small[0])))
        large = np.flatnonzero(counts > 3)
        if large.size:
            message = (
                f"{large.size} of {counts.size} polygons have more than three corners; cut into triangles, where the "
                "original planner collides only the first three corners (dialect A, .obj) or refuses the file (.g, "
                "B to E)"
            )
            log.warn("GEO220", path, message, hint="triangulate the mesh", span=place(int(large[0])))
        kept = np.flatnonzero(counts >= 3)
        if not kept.size:
            log.fail("GEO210", path, f"{path} has no triangle", hint="expected at least one triangle")
        try:
            faces, crossing = triangulate(
                vertices, corners[np.repeat(counts >= 3, counts)], counts[kept], Work(limits.polygon_work)
            )
        except TooMuchWorkError as stopped:
            worst = int(kept[stopped.part])
            message = (
                f"cutting the polygons into triangles takes too long: more than {limits.polygon_work} points would "
                f"have to be looked at; this polygon has {counts[worst]} corners and is not convex"
            )
            hint = f"triangulate the mesh, or {Limits.hint('polygon_work')}"
            log.fail("GEO270", path, message, hint=hint, span=place(worst))
        if crossing:
            message = f"{len(crossing)} polygons cross themselves; what they enclose is a guess"
            log.warn("GEO222", path, message, span=place(int(kept[crossing[0]])))
        return faces


def _short(word: str) -> str:
    return repr(word if len(word) <= 40 else word[:40] + "...")
