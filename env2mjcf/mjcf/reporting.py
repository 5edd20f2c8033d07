"""Says what a scene holds that has no meaning in its MJCF: nothing is dropped in silence."""

from __future__ import annotations

from ..errors import DiagnosticLog
from ..model import Environment
from ..options import Options

# Attributes of an <Environment> node that concern the planner's own simulation.
_PHYSICS = ("gravity", "frictionCoefficient")


def report_unused(environment: Environment, options: Options, log: DiagnosticLog) -> None:
    """Report textures, controls and physical attributes, which are kept and not written, and options without effect."""
    if options.boundary is not None and environment.boundary is None:
        log.info("MJC415", environment.name, f"boundary={options.boundary!r} has no effect: the scene has no boundary")
    attributes = dict(environment.attributes)
    for name in _PHYSICS:
        if name in attributes:
            log.info(
                "MJC412",
                name,
                f"{name}={attributes[name]!r} of the file is the planner's, and is not written",
                hint="give gravity=(x, y, z) (--gravity)" if name == "gravity" else "",
            )
    for multibody in environment.multibodies:
        if multibody.controls or multibody.velocity_bounds:
            log.info(
                "MJC413",
                "NonHolonomic",
                f"{len(multibody.controls)} controls and the velocity bounds of the robot are kept, not written",
                span=multibody.span,
            )
        for body in multibody.bodies:
            if body.texture is not None:
                log.info("MJC414", body.filename, f"texture {body.texture!r} is kept, not drawn", span=body.span)
