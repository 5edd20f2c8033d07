"""A plugin of pytest that notes which functions of the package each test enters, and how long it takes.

Loaded with `-p tracing`; writes JSON to the file that MUTANTS_TRACE names. What a fixture enters counts for every test
that asks for it. Compiled functions are not seen.
"""

from __future__ import annotations

import json
import os
import sys
import threading
import time
from collections.abc import Iterator
from pathlib import Path
from types import FrameType
from typing import Any

import pytest

_PACKAGE = str(Path(__file__).parents[2] / "env2mjcf") + os.sep
_ROOT = str(Path(__file__).parents[2]) + os.sep

_entered: set[str] = set()
_known: dict[Any, str] = {}
_of_fixtures: dict[int, set[str]] = {}
_of_tests: dict[str, tuple[float, set[str]]] = {}
_open: list[set[str]] = []


def _note(frame: FrameType, event: str, argument: Any) -> None:
    code = frame.f_code
    if code.co_filename.startswith(_PACKAGE):
        name = _known.get(code)
        if name is None:
            name = _known[code] = f"{code.co_filename.removeprefix(_ROOT)}:{code.co_qualname}"
        _entered.add(name)


@pytest.hookimpl(hookwrapper=True)
def pytest_fixture_setup(fixturedef: Any) -> Iterator[None]:
    """Keep apart what a fixture enters, and those that it asks for."""
    outer = set(_entered)
    _entered.clear()
    yield
    _of_fixtures[id(fixturedef)] = set(_entered)
    _entered.update(outer)


@pytest.hookimpl(hookwrapper=True, tryfirst=True)
def pytest_runtest_protocol(item: pytest.Item) -> Iterator[None]:
    """Note what one test enters, its fixtures included."""
    _entered.clear()
    start = time.process_time()
    sys.settrace(_note)
    threading.settrace(_note)
    yield
    sys.settrace(None)
    threading.settrace(None)  # type: ignore[arg-type]
    fixtures: Any = item._fixtureinfo.name2fixturedefs  # type: ignore[attr-defined]
    of_fixtures = [_of_fixtures.get(id(d), set()) for ds in fixtures.values() for d in ds]
    _of_tests[item.nodeid] = (time.process_time() - start, _entered.union(*of_fixtures))


def pytest_sessionfinish() -> None:
    """Write everything."""
    found = {test: [round(seconds, 3), sorted(names)] for test, (seconds, names) in _of_tests.items()}
    Path(os.environ["MUTANTS_TRACE"]).write_text(json.dumps(found))
