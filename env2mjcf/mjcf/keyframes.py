"""Keyframes: the home configuration, and start and goal of the first task."""

from __future__ import annotations

from ..model import Task
from ..space import ConfigurationSpace
from .writer import Element, add, numbers


def add_keyframes(root: Element, space: ConfigurationSpace, tasks: tuple[Task, ...], *, actuated: bool) -> None:
    """Append `home`, and `start` and `goal` where there is a task."""
    keys = {"home": space.home}
    if tasks and len(tasks[0].configurations):
        q = space.of_task(tasks[0])
        keys |= {"start": q[0], "goal": q[-1]}
    if not space.nq:
        return
    keyframe = add(root, "keyframe")
    for name, q in keys.items():
        qpos = space.qpos(q)
        ctrl = [qpos[s.address] for slots in space.slots for s in slots if not s.free]
        add(keyframe, "key", name=name, qpos=numbers(qpos), ctrl=numbers(ctrl) if actuated and ctrl else None)
