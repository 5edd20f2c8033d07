"""From a file to a loaded scene, with a look at what touches at home."""

from __future__ import annotations

import dataclasses
from typing import Unpack

from ..contact.exact.engine import require
from ..contact.types import Contact, deepest
from ..diagnostics import DiagnosticLog
from ..errors import Span
from ..model.environment import Dialect, Environment
from ..options import OptionKeywords, Options, PathArgument
from ..pipeline import Compiled, compile_scene, recompile
from .mujoco_model import load_model
from .scene import Scene


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
    touching = deepest(scene.contacts(scene.space.home, engine="mujoco")) if scene.link_names else ()
    if touching and options.exclude_rest_contacts:
        names = ", ".join(f"{c.link} and {c.other}" for c in touching)
        log.info("KIN313", scene.environment.name, f"not tested, because they touch at home: {names}")
        # The first compilation has reported everything else already.
        return _scene(recompile(compiled, [(c.link, c.other) for c in touching], DiagnosticLog()), log)
    places = {p.name: p.body.span for p in compiled.assembly.parts()}
    for contact in touching:
        _report_touching(compiled, contact, places[contact.link], log)
    return scene.with_diagnostics(tuple(log))


def _scene(compiled: Compiled, log: DiagnosticLog) -> Scene:
    model = load_model(compiled.document, compiled.assembly, log)
    return Scene(dataclasses.replace(compiled, diagnostics=tuple(log)), model)


def _report_touching(compiled: Compiled, contact: Contact, span: Span | None, log: DiagnosticLog) -> None:
    link, other = contact.link, contact.other
    if contact.kind == "obstacle" and compiled.environment.dialect is not Dialect.A:
        # Dialects B to E give no base pose, so that home is the origin, wherever obstacles are.
        message = f"{link} and {other} touch at home, where the base is at the origin"
        hint = "" if compiled.environment.tasks else "give a query: simulations can begin at its start"
        log.info("KIN312", link, message, hint=hint, span=span)
        return
    hint = "exclude such pairs with exclude_rest_contacts=True (--exclude-rest-contacts) if they always touch"
    log.warn("KIN312", link, f"{link} and {other} touch at home", hint=hint, span=span)
