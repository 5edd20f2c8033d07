"""MuJoCo's memory for contacts, its arena: calls that tell when it is full, and contacts in parts where it is."""

from __future__ import annotations

import copy
from collections.abc import Callable, Iterator
from typing import NoReturn

import mujoco
import numpy as np
from numpy.typing import NDArray

from ..diagnostics import DiagnosticLog

Geoms = NDArray[np.int64]
Call = Callable[[mujoco.MjModel, mujoco.MjData], object]

ROOM_HINT = (
    "exclude pairs that need not be tested (exclude_pairs, exclude_rest_contacts=True, self_collision=False), "
    "or give MuJoCo more memory: <size memory=...> in the MJCF, `memory` of Scene.spec()"
)
"""What to do where contacts are more than MuJoCo's memory holds."""

_FULL = [int(mujoco.mjtWarning.mjWARN_CONTACTFULL), int(mujoco.mjtWarning.mjWARN_CNSTRFULL)]


def new_data(model: mujoco.MjModel) -> mujoco.MjData:
    """Return new data of a model.

    Raises:
        MemoryError: The system has no room for it.
    """
    try:
        return mujoco.MjData(model)
    except (ValueError, mujoco.FatalError) as error:
        raise MemoryError(str(error)) from error


def silence(data: mujoco.MjData) -> None:
    """Let MuJoCo count its warnings only: else it prints the first of each kind, and writes it to a file."""
    np.maximum(data.warning.number, 1, out=data.warning.number)


def lack(call: Call, model: mujoco.MjModel, data: mujoco.MjData) -> str:
    """Call MuJoCo in silence; return what its memory had no room for, or an empty string.

    Warnings are counted in `data.warning` as MuJoCo does. Where it gave up altogether, `data` holds the state that it
    held before, and nothing that is computed from it.
    """
    counts = data.warning.number.copy()
    silence(data)
    before = data.warning.number.copy()
    said = ""
    try:
        call(model, data)
    except mujoco.FatalError as error:
        said = " ".join(str(error).split())
        before[_FULL[0]] -= 1
        restart(model, data)
    raised = data.warning.number - before
    data.warning.number[:] = counts + raised
    if said:
        return said
    room = f"its memory of {model.narena / 2**20:.3g} MB"
    if raised[_FULL[0]] > 0:
        return f"{room} is full after {data.ncon} contacts"
    return f"{room} has no room for the forces of {data.ncon} contacts" if raised[_FULL[1]] > 0 else ""


def restart(model: mujoco.MjModel, data: mujoco.MjData) -> None:
    """Make data usable after a fatal error, which leaves its stack as it was: the state is kept."""
    kind = int(mujoco.mjtState.mjSTATE_INTEGRATION)
    state = np.zeros(mujoco.mj_stateSize(model, kind))
    mujoco.mj_getState(model, data, state, kind)
    counts = data.warning.number.copy()
    mujoco.mj_resetData(model, data)
    mujoco.mj_setState(model, data, state, kind)
    data.warning.number[:] = counts


def collide(model: mujoco.MjModel, data: mujoco.MjData) -> str:
    """Find the contacts of placed geoms, in silence; return what memory had no room for, or an empty string."""
    full = _FULL[0]
    before = data.warning[full].number
    try:
        mujoco.mj_collision(model, data)
    except mujoco.FatalError as error:
        restart(model, data)
        mujoco.mj_kinematics(model, data)
        return " ".join(str(error).split())
    if data.warning[full].number == before:
        return ""
    return f"its memory of {model.narena / 2**20:.3g} MB is full after {data.ncon} contacts"


def collide_in_parts(
    model: mujoco.MjModel, data: mujoco.MjData, links: Geoms, obstacles: Geoms
) -> Iterator[mujoco.MjData]:
    """Find the contacts of placed geoms some at a time: `data` holds the next of them at each turn.

    Links are tested against each other and against obstacles. What does not fit into memory is halved until it does.

    Args:
        model: The model; a copy of it is worked with.
        data: Has kinematics.
        links: Geoms of links.
        obstacles: Geoms that are tested against those of links only.

    Raises:
        ConversionError: There is no room for what two geoms, and explicit pairs, have.
    """
    masked = copy.copy(model)
    masked.body_contype[:] = masked.body_conaffinity[:] = 1
    # Two groups that are tested against each other; one that is tested against itself has no second one.
    todo: list[tuple[Geoms, Geoms | None]] = [(links, obstacles), (links, None)]
    while todo:
        first, second = todo.pop()
        masked.geom_contype[:] = masked.geom_conaffinity[:] = 0
        masked.geom_contype[first] = 1
        masked.geom_conaffinity[first if second is None else second] = 1
        said = collide(masked, data)
        if not said:
            yield data
        elif second is None and len(first) > 1:
            a, b = _halves(first)
            todo += [(a, None), (b, None), (a, b)]
        elif second is not None and len(first) * len(second) > 1:
            if len(first) > len(second):
                todo += [(part, second) for part in _halves(first)]
            else:
                todo += [(first, part) for part in _halves(second)]
        else:
            refuse("two geoms", said)


def _halves(geoms: Geoms) -> tuple[Geoms, Geoms]:
    return geoms[: len(geoms) // 2], geoms[len(geoms) // 2 :]


def refuse(subject: str, said: str) -> NoReturn:
    """Raise the error of contacts that do not fit into MuJoCo's memory."""
    DiagnosticLog().fail("MJC405", subject, f"MuJoCo cannot hold the contacts of {subject}: {said}", hint=ROOM_HINT)
