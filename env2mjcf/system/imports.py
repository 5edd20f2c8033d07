"""Public names that are loaded when they are first used, work that waits for a package, and versions of packages."""

from __future__ import annotations

import os
import sys
from collections.abc import Callable, Sequence
from importlib import import_module
from importlib.abc import Loader, MetaPathFinder
from importlib.machinery import ModuleSpec
from itertools import dropwhile
from types import ModuleType
from typing import Any, cast


def lazy_exports(package: str) -> tuple[Callable[[str], Any], Callable[[], list[str]], list[str]]:
    """Return `__getattr__`, `__dir__` and `__all__` of a package whose public names are listed in its stub.

    The stub, `__init__.pyi`, is what type checkers and editors read; each name stands there alone, once, and nowhere
    else, as `from .module import Name as Name`.

    Args:
        package: The package that is being imported.
    """
    module = sys.modules[package]
    loader = cast("Any", module.__spec__).loader
    # Beside the code, which may be compiled: `__init__.pyc`.
    stub = loader.get_data(os.path.join(module.__path__[0], "__init__.pyi")).decode("utf-8")
    lines = (line.split() for line in stub.splitlines() if line.startswith("from ."))
    homes = {name: home for _, home, _, name, *_ in lines}

    def export(name: str) -> Any:
        home = homes.get(name)
        if home is None:
            raise AttributeError(f"module {package!r} has no attribute {name!r}")
        value = import_module(f".{name}", package) if home == "." else getattr(import_module(home, package), name)
        setattr(module, name, value)
        return value

    names = sorted(homes)
    return export, names.copy, names


def after_import(name: str, work: Callable[[ModuleType], None]) -> None:
    """Work on a module as soon as it is imported, which may have happened already.

    Args:
        name: The module's full name.
        work: What to do; called with the module.
    """
    # A name that may not be imported stands there as None.
    if sys.modules.get(name) is not None:
        work(import_module(name))  # waits where another thread is still importing it
    else:
        sys.meta_path.insert(0, _Finder(name, work))


def installed_version(package: str = "env2mjcf") -> str | None:
    """Return the version of a package; None where it is not installed, such as in a checkout."""
    from importlib.metadata import PackageNotFoundError, version

    try:
        return version(package)
    except PackageNotFoundError:
        return None


class _Finder(MetaPathFinder):
    """Finds one module as Python does, and has work done once its code has run."""

    def __init__(self, name: str, work: Callable[[ModuleType], None]) -> None:
        self._name, self._work = name, work

    def find_spec(
        self, fullname: str, path: Sequence[str] | None, target: ModuleType | None = None
    ) -> ModuleSpec | None:
        if fullname != self._name:
            return None
        # Those before it have been asked already; one of them may wait for the same module, and ask this one.
        others = list(dropwhile(lambda finder: finder is not self, list(sys.meta_path)))[1:]
        spec = next((s for finder in others if (s := finder.find_spec(fullname, path, target)) is not None), None)
        if spec is not None and spec.loader is not None:
            spec.loader = _Loader(spec.loader, self._finish)
        return spec

    def _finish(self, module: ModuleType) -> None:
        if self in sys.meta_path:
            sys.meta_path.remove(self)
        self._work(module)


class _Loader(Loader):
    """Loads a module as its own loader does, then works on it."""

    def __init__(self, loader: Loader, work: Callable[[ModuleType], None]) -> None:
        self._loader, self._work = loader, work

    def __getattr__(self, name: str) -> Any:
        return getattr(self._loader, name)

    def create_module(self, spec: ModuleSpec) -> ModuleType | None:
        return self._loader.create_module(spec)

    def exec_module(self, module: ModuleType) -> None:
        self._loader.exec_module(module)
        own = self._loader
        while isinstance(own, _Loader):
            own = own._loader
        cast("Any", module.__spec__).loader = module.__loader__ = own
        self._work(module)
