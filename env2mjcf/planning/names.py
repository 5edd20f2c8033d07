"""The names of the planners."""

from __future__ import annotations

from importlib.util import find_spec

from ..errors import did_you_mean

# The names that are asked for, and OMPL's classes. Planners that need a space of their own kind (BIT*, AORRTC, informed
# RRT*) cannot have one with circles for angles.
OMPL_PLANNERS = {
    "RRTConnect": "RRTConnect",
    "RRT": "RRT",
    "RRTstar": "RRTstar",
    "KPIECE": "KPIECE1",
    "BKPIECE": "BKPIECE1",
    "LBKPIECE": "LBKPIECE1",
    "PRM": "PRM",
    "PRMstar": "PRMstar",
    "FMT": "FMT",
    "BFMT": "BFMT",
}
BATCH = "BatchEST"
"""The planner of our own, which asks in batches."""

AUTO = ("RRTConnect", BATCH)
"""The planners that `auto` lets take turns: the quick one, and one for narrow places."""

OPTIMISING = ("RRTstar", "PRMstar")
"""Planners that go on improving what they have found for as long as they may."""

PLANNERS = ("auto", *OMPL_PLANNERS, BATCH)


def known(name: str) -> str:
    """Return the name of a planner as it is listed, whatever its case; OMPL's own names will do.

    Raises:
        TypeError: It is no word.
        ValueError: There is no such planner; the message lists all.
    """
    if not isinstance(name, str):  # pyright: ignore[reportUnnecessaryIsInstance]
        raise TypeError(f"planner is {name!r}; expected one of {', '.join(PLANNERS)}")
    spelled = {n.lower(): n for n in PLANNERS} | {c.lower(): n for n, c in OMPL_PLANNERS.items()}
    if name.lower() not in spelled:
        guess = did_you_mean(name, PLANNERS)
        raise ValueError(
            f"there is no planner {name!r}{f'; {guess}' if guess else ''} (planners: {', '.join(PLANNERS)})"
        )
    return spelled[name.lower()]


def installed(name: str) -> str:
    """Return the name of a planner as it is listed; see `known`.

    Raises:
        ValueError: There is no such planner, or OMPL is not installed.
    """
    spelled = known(name)
    if find_spec("ompl") is None:
        raise ValueError(f"planner {spelled} needs one more package: pip install 'env2mjcf[planning]'")
    return spelled
