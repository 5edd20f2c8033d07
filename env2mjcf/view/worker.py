"""Draws pictures; run as a script by `offscreen`, with MUJOCO_GL set and the request as a line of JSON on stdin.

Answers on stdout with one line of JSON, which says what camera was chosen, and then the pictures, one after the other:
rows from the top, of RGB bytes, or of int32 geom numbers for a segmentation.
"""

from __future__ import annotations

import json
import math
import os
import sys
from collections.abc import Iterator
from typing import Any

import mujoco
import numpy as np
from numpy.typing import NDArray

# A single picture is drawn larger and scaled down, for finer edges than four samples a pixel give; a film is not,
# because that takes three times as long.
_OVERSAMPLING = 2
_SHADOW_SIZE = 2048
_GHOST_OPACITY = 0.22
_SEEN_THROUGH_OPACITY = 0.25
# Enough pixels to tell how much of a robot can be seen.
_PROBE_HEIGHT = 120
# A camera that sees this share of the links is good; where none sees the second, obstacles are drawn transparent.
_GOOD_SHARE, _POOR_SHARE = 0.7, 0.4
_HIDDEN_GROUP = 5


def main() -> None:
    """Draw what stdin asks for; `null` only tries the GL backend."""
    # Not up to the end: processes that were forked meanwhile may hold the other end of the pipe open.
    request = json.loads(sys.stdin.readline())
    if request is None:
        mujoco.GLContext(16, 16).make_current()
    else:
        Artist(request).draw(sys.stdout.buffer)
    sys.stdout.flush()
    # Contexts that are freed while Python shuts down complain; there is nothing left to free in earnest.
    os._exit(0)


class Artist:
    """Draws one request of `shots.Shot`."""

    def __init__(self, request: dict[str, Any]) -> None:
        self._request = request
        self._model = model = mujoco.MjModel.from_binary_path(request["model"])
        self._width, self._height = request["size"]
        model.vis.quality.shadowsize = _SHADOW_SIZE
        # Bodies are meshes; only marks are made of slices, and a trail is hundreds of them.
        model.vis.quality.numslices, model.vis.quality.numstacks = 12, 6
        model.vis.global_.fovy = math.degrees(request["field_of_view"])
        # Clipping planes, shadows and the sizes of marks follow what is looked at, not what stands at home.
        model.stat.center[:], model.stat.extent = request["center"], request["extent"]
        self._option = mujoco.MjvOption()
        self._ghosts = [self._placed(qpos) for qpos in request["ghosts"]]
        model.geom_group[request["hidden"]] = _HIDDEN_GROUP

    def draw(self, out: Any) -> None:
        """Write the answer's head and its pictures."""
        number, share = self._best_camera()
        see_through = self._request["see_through"]
        if see_through is None:
            see_through = share < _POOR_SHARE
        if see_through:
            self._model.geom_rgba[self._request["obstacles"], 3] *= _SEEN_THROUGH_OPACITY
        head = {"camera": number, "share": share, "see_through": see_through}
        out.write(json.dumps(head).encode() + b"\n")
        for picture in self._pictures(number):
            out.write(np.ascontiguousarray(picture).tobytes())
            out.flush()

    def _pictures(self, number: int) -> Iterator[NDArray[Any]]:
        segmentation = self._request["segmentation"]
        scale = _OVERSAMPLING if len(self._request["frames"]) == 1 and not segmentation else 1
        renderer = self._renderer(self._width * scale, self._height * scale)
        if segmentation:
            renderer.enable_segmentation_rendering()
        colors = self._model.geom_rgba.copy()
        data = mujoco.MjData(self._model)
        for frame in self._request["frames"]:
            self._place(data, frame["qpos"])
            for geom, color in frame["tints"]:
                self._model.geom_rgba[geom] = color
            renderer.update_scene(data, self._camera(number), self._option)
            self._model.geom_rgba[:] = colors
            if segmentation:
                yield _geoms(renderer.render())
                continue
            for ghost in self._ghosts:
                _add_ghost(renderer.scene, self._model, ghost, self._option)
            _add_marks(renderer.scene, [*self._request["marks"], *frame["marks"]], self._request["extent"] / 1000)
            yield _reduced(renderer.render(), scale)

    def _best_camera(self) -> tuple[int, float]:
        """Return the first camera that sees the links well, else the best one, and the share of them that it sees."""
        watched, count = self._request["watched"], len(self._request["cameras"])
        if not watched or (count == 1 and self._request["see_through"] is not None):
            return 0, 1.0
        renderer = self._renderer(max(1, _PROBE_HEIGHT * self._width // self._height), _PROBE_HEIGHT)
        renderer.enable_segmentation_rendering()
        frames = self._request["frames"]
        probes = [self._placed(frames[i]["qpos"]) for i in sorted({0, len(frames) // 2, len(frames) - 1})]
        best, best_share = 0, -1.0
        for number in range(count):
            share = float(np.mean([self._share(renderer, data, number) for data in probes]))
            if share > best_share:
                best, best_share = number, share
            if share >= _GOOD_SHARE:
                break
        renderer.close()
        return best, best_share

    def _share(self, renderer: Any, data: mujoco.MjData, number: int) -> float:
        """Return the share of the links' pixels that obstacles do not hide; 1 for links without pixels."""
        model, watched = self._model, self._request["watched"]
        counts: list[int] = []
        groups = model.geom_group.copy()
        for hidden in ([], self._request["obstacles"]):
            model.geom_group[hidden] = _HIDDEN_GROUP
            renderer.update_scene(data, self._camera(number), self._option)
            counts.append(int(np.isin(_geoms(renderer.render()), watched).sum()))
        model.geom_group[:] = groups
        return counts[0] / counts[1] if counts[1] else 1.0

    def _camera(self, number: int) -> Any:
        chosen = self._request["cameras"][number]
        position, forward = np.array(chosen["position"]), np.array(chosen["forward"])
        camera = mujoco.MjvCamera()
        camera.type = mujoco.mjtCamera.mjCAMERA_FREE
        camera.distance = float(np.linalg.norm(np.array(self._request["center"]) - position))
        camera.lookat[:] = position + camera.distance * forward
        camera.azimuth = math.degrees(math.atan2(forward[1], forward[0]))
        camera.elevation = math.degrees(math.asin(forward[2]))
        return camera

    def _renderer(self, width: int, height: int) -> Any:
        self._model.vis.global_.offwidth, self._model.vis.global_.offheight = width, height
        marks = _points(self._request["marks"]) + max(_points(frame["marks"]) for frame in self._request["frames"])
        room = 1000 + self._model.ngeom * (1 + len(self._ghosts)) + marks
        renderer = mujoco.Renderer(self._model, height, width, max_geom=room)
        # Sheets have two sides.
        renderer.scene.flags[mujoco.mjtRndFlag.mjRND_CULL_FACE] = 0
        return renderer

    def _placed(self, qpos: list[float]) -> mujoco.MjData:
        data = mujoco.MjData(self._model)
        self._place(data, qpos)
        return data

    def _place(self, data: mujoco.MjData, qpos: list[float]) -> None:
        data.qpos[:] = qpos
        # Contacts, the costly part of mj_forward, are not drawn.
        mujoco.mj_kinematics(self._model, data)
        mujoco.mj_comPos(self._model, data)
        mujoco.mj_camlight(self._model, data)


def _points(marks: list[dict[str, Any]]) -> int:
    return sum(len(mark["points"]) for mark in marks)


def _geoms(segmentation: NDArray[np.int32]) -> NDArray[np.int32]:
    """Return the geom of each pixel, -1 where there is none."""
    is_geom = segmentation[..., 1] == int(mujoco.mjtObj.mjOBJ_GEOM)
    return np.where(is_geom, segmentation[..., 0], -1).astype(np.int32)


def _reduced(pixels: NDArray[np.uint8], factor: int) -> NDArray[np.uint8]:
    """Average blocks of pixels."""
    if factor == 1:
        return pixels
    height, width = pixels.shape[0] // factor, pixels.shape[1] // factor
    blocks = pixels.reshape(height, factor, width, factor, 3).astype(np.uint16)
    return ((blocks.sum(axis=(1, 3)) + factor * factor // 2) // (factor * factor)).astype(np.uint8)


def _add_ghost(scene: Any, model: mujoco.MjModel, data: mujoco.MjData, option: mujoco.MjvOption) -> None:
    """Add everything that moves, nearly transparent."""
    before = scene.ngeom
    mujoco.mjv_addGeoms(model, data, option, mujoco.MjvPerturb(), mujoco.mjtCatBit.mjCAT_DYNAMIC, scene)
    for geom in scene.geoms[before : scene.ngeom]:
        geom.rgba[3] = _GHOST_OPACITY
        # Decoration casts no shadow.
        geom.category = mujoco.mjtCatBit.mjCAT_DECOR


def _add_marks(scene: Any, marks: list[dict[str, Any]], unit: float) -> None:
    # Each look at `geoms` makes a new list of all of them.
    geoms = iter(scene.geoms[scene.ngeom :])
    for mark in marks:
        points, size, color = np.array(mark["points"]).reshape(-1, 3), mark["size"] * unit, mark["color"]
        if mark["kind"] == "dots":
            for point in points:
                _sphere(next(geoms), point, size / 2, color)
            scene.ngeom += len(points)
            continue
        if mark["kind"] == "arrows":
            kind, width = mujoco.mjtGeom.mjGEOM_ARROW, size / 12
            starts, ends = points, points + size * np.array(mark["directions"])
        else:
            kind, width = mujoco.mjtGeom.mjGEOM_CAPSULE, size / 2
            starts, ends = points[:-1], points[1:]
        for start, end in zip(starts, ends, strict=True):
            _connector(next(geoms), kind, width, start, end, color)
        scene.ngeom += len(starts)


def _sphere(geom: Any, center: NDArray[np.float64], radius: float, color: list[float]) -> None:
    _new(geom, mujoco.mjtGeom.mjGEOM_SPHERE, color)
    geom.size[:], geom.pos[:] = radius, center


def _connector(
    geom: Any, kind: Any, width: float, start: NDArray[np.float64], end: NDArray[np.float64], color: list[float]
) -> None:
    _new(geom, kind, color)
    mujoco.mjv_connector(geom, kind, width, start, end)


def _new(geom: Any, kind: Any, color: list[float]) -> None:
    mujoco.mjv_initGeom(geom, kind, np.zeros(3), np.zeros(3), np.eye(3).ravel(), np.array(color, dtype=np.float32))
    geom.category = mujoco.mjtCatBit.mjCAT_DECOR


if __name__ == "__main__":
    main()
