"""A scene in other units of length."""

from __future__ import annotations

import dataclasses

from .environment import Boundary, Connection, Environment, JointType, MultiBody, Pose, SMAShape


def scaled(environment: Environment, factor: float) -> Environment:
    """Return the environment with every length multiplied by `factor`; tasks stay in the file's own numbers."""
    if factor == 1.0:
        return environment
    boundary = environment.boundary
    if boundary is not None:
        boundary = dataclasses.replace(
            boundary,
            lower=_times(boundary.lower, factor),
            upper=_times(boundary.upper, factor),
            center=_times(boundary.center, factor),
            radius=boundary.radius * factor,
        )
    resolution = environment.resolution
    if resolution.position is not None:
        resolution = dataclasses.replace(resolution, position=resolution.position * factor)
    return dataclasses.replace(
        environment,
        multibodies=tuple(_scaled_multibody(m, factor) for m in environment.multibodies),
        boundary=boundary,
        resolution=resolution,
    )


def moved_boundary(boundary: Boundary, origin: tuple[float, float, float]) -> Boundary:
    """Return a boundary about another origin."""
    if not any(origin):
        return boundary
    corners = {"lower": boundary.lower, "upper": boundary.upper, "center": boundary.center}
    moved = {k: tuple(c - o for c, o in zip(v, origin, strict=False)) for k, v in corners.items()}
    return dataclasses.replace(boundary, **moved)


def _scaled_multibody(multibody: MultiBody, factor: float) -> MultiBody:
    bounds = multibody.velocity_bounds
    if bounds is not None:
        bounds = dataclasses.replace(bounds, linear=bounds.linear * factor)
    return dataclasses.replace(
        multibody,
        velocity_bounds=bounds,
        bodies=tuple(
            b if b.pose is None else dataclasses.replace(b, pose=_scaled_pose(b.pose, factor)) for b in multibody.bodies
        ),
        connections=tuple(_scaled_connection(c, factor) for c in multibody.connections),
    )


def _scaled_connection(connection: Connection, factor: float) -> Connection:
    limits = connection.limits
    if connection.joint is JointType.PRISMATIC:
        limits = tuple(dataclasses.replace(x, lower=x.lower * factor, upper=x.upper * factor) for x in limits)
    sma = connection.sma
    if sma is not None:
        sma = SMAShape(sma.length * factor, sma.width * factor)
    return dataclasses.replace(
        connection,
        sma=sma,
        to_dh=_scaled_pose(connection.to_dh, factor),
        dh=dataclasses.replace(connection.dh, a=connection.dh.a * factor, d=connection.dh.d * factor),
        to_body=_scaled_pose(connection.to_body, factor),
        limits=limits,
    )


def _scaled_pose(pose: Pose, factor: float) -> Pose:
    x, y, z = pose.position
    return dataclasses.replace(pose, position=(x * factor, y * factor, z * factor))


def _times(values: tuple[float, ...], factor: float) -> tuple[float, ...]:
    return tuple(v * factor for v in values)
