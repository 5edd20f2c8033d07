"""Ways from start to goal, by the planners of OMPL (the extra `planning`) and by one that asks in batches."""

from __future__ import annotations

from importlib import import_module
from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:
    from .names import PLANNERS as PLANNERS
    from .planning import plan as plan
    from .planning import plan_through as plan_through
    from .result import Plan as Plan

# Imported when they are first used: the program's other verbs do without them.
_LAZY = {"PLANNERS": ".names", "plan": ".planning", "plan_through": ".planning", "Plan": ".result"}


def __getattr__(name: str) -> Any:
    if name in _LAZY:
        return getattr(import_module(_LAZY[name], __name__), name)
    raise AttributeError(f"module {__name__!r} has no attribute {name!r}")


def __dir__() -> list[str]:
    return sorted({*globals(), *_LAZY})
