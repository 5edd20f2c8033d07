"""From a file to a loaded scene, with a look at what touches at home."""

from __future__ import annotations

import dataclasses
from typing import Unpack

import mujoco
import numpy as np

from ..contact.arena import ROOM_HINT, lack, new_data
from ..contact.exact.engine import require
from ..diagnostics import DiagnosticLog
from ..errors import Span
from ..mjcf.dense_contacts import possible_contacts
from ..model.environment import Dialect, Environment
from ..options import OptionKeywords, Options, PathArgument
from ..pairs import Pair
from ..pipeline import Compiled, compile_scene, recompile
from .mujoco_model import load_model
from .scene import Scene

# As many pairs that touch at home are named; there may be a million.
_LISTED = 50
# MuJoCo finds some hundred thousand contacts a second, and cannot be interrupted.
_CROWD = 20_000_000


def load(path: PathArgument, **options: Unpack[OptionKeywords]) -> Scene:
    """Load a scene into MuJoCo; nothing is written.

    Args:
        path: An env file of any dialect, an XML environment, or the planner's problem XML.
        **options: Fields of `Options`.

    Raises:
        FormatError: A text file cannot be read.
        GeometryError: A mesh is missing or unusable.
        KinematicsError: The bodies of a robot do not hang together.
        ConversionError: MuJoCo cannot express, or refuses, the scene.
        TypeError, ValueError: An option cannot be used.
    """
    chosen = Options.from_keywords(options)
    return prepare(path, chosen, DiagnosticLog(chosen.strict))


def prepare(source: PathArgument | Environment, options: Options, log: DiagnosticLog) -> Scene:
    """Load a file, or what was read from it with the same log, with options already checked; see `load`."""
    if options.engine == "exact":
        require()
    compiled = compile_scene(source, options, log)
    scene = _scene(compiled, log)
    # One look is not worth compiling the exact engine for.
    crowd = _crowd_at_home(scene)
    if crowd > _CROWD and not options.exclude_rest_contacts:
        message = f"bodies that may touch at home could have {crowd} contacts there: what touches is not looked up"
        log.warn("KIN315", scene.environment.name, message, hint="see Scene.touching_pairs(q), which may take hours")
        return scene.with_diagnostics(tuple(log))
    touching = scene.touching_pairs(scene.space.home) if scene.link_names else ()
    if touching and options.exclude_rest_contacts:
        names = [" and ".join(pair) for pair in touching[:_LISTED]]
        if len(touching) > _LISTED:
            names.append(f"{len(touching) - _LISTED} more")
        log.info("KIN313", scene.environment.name, f"not tested, because they touch at home: {', '.join(names)}")
        # The first compilation has reported everything else already.
        compiled = recompile(compiled, touching, DiagnosticLog())
        scene, touching = _scene(compiled, log), ()
    known = {(p.link, p.other): p for p in compiled.pairs.tested}
    places = {p.name: p.body.span for p in compiled.assembly.links}
    for pair in touching[:_LISTED]:
        _report_touching(compiled, known[pair], places[pair[0]], log)
    if len(touching) > _LISTED:
        message = f"{len(touching)} pairs of bodies touch at home, of which {_LISTED} are listed"
        say = log.info if all(_expected(compiled, known[pair]) for pair in touching[_LISTED:]) else log.warn
        say("KIN315", scene.environment.name, message, hint="Scene.touching_pairs(q) returns all of them")
    _report_shortage(scene, log)
    return scene.with_diagnostics(tuple(log))


def _scene(compiled: Compiled, log: DiagnosticLog) -> Scene:
    model = load_model(compiled.document, compiled.assembly, log)
    return Scene(dataclasses.replace(compiled, diagnostics=tuple(log)), model)


def _crowd_at_home(scene: Scene) -> int:
    """Return how many contacts there may be at home, of bodies whose bounding balls meet."""
    compiled = scene.compiled
    parts = {p.name: p for p in compiled.assembly.parts()}
    poses = dict(zip(scene.link_names, scene.link_poses(scene.space.home), strict=True))
    poses |= dict(zip(scene.obstacle_names, scene.obstacle_poses(), strict=True))
    number = {name: i for i, name in enumerate(poses)}
    places = np.array([pose[:3, 3] for pose in poses.values()]).reshape(-1, 3)
    radii = np.array([parts[name].radius for name in poses])
    pairs = compiled.pairs
    first, second = np.array([(number[p.link], number[p.other]) for p in pairs.tested], dtype=np.int64).reshape(-1, 2).T
    meet = np.linalg.norm(places[first] - places[second], axis=1) <= radii[first] + radii[second]
    return int(possible_contacts(compiled.assembly, pairs)[meet].sum())


def _report_shortage(scene: Scene, log: DiagnosticLog) -> None:
    """Report keys at which MuJoCo's memory cannot hold what touches."""
    model = scene.model
    if not model.nkey:
        return
    data = new_data(model)
    for key in range(model.nkey):
        mujoco.mj_resetDataKeyframe(model, data, key)
        said = lack(mujoco.mj_forward, model, data)
        if said:
            name = model.key(key).name
            message = f"MuJoCo cannot hold all that touches at {name}, and cannot simulate from there: {said}"
            log.warn("MJC405", scene.environment.name, message, hint=ROOM_HINT)


def _report_touching(compiled: Compiled, pair: Pair, span: Span | None, log: DiagnosticLog) -> None:
    link, other = pair.link, pair.other
    if _expected(compiled, pair):
        message = f"{link} and {other} touch at home, where the base is at the origin"
        hint = "" if compiled.environment.tasks else "give a query: simulations can begin at its start"
        log.info("KIN312", link, message, hint=hint, span=span)
        return
    hint = "exclude such pairs with exclude_rest_contacts=True (--exclude-rest-contacts) if they always touch"
    log.warn("KIN312", link, f"{link} and {other} touch at home", hint=hint, span=span)


def _expected(compiled: Compiled, pair: Pair) -> bool:
    # Dialects B to E give no base pose, so that home is the origin, wherever obstacles are.
    return pair.kind == "obstacle" and compiled.environment.dialect is not Dialect.A
