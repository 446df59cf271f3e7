# SPDX-License-Identifier: GPL-3.0-or-later
"""What a scene shows that has no faces, read from a depsgraph: Grease Pencil, hair and points.

Stand-ins tell plans where these are. They follow control points, and of many lines they take some.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator, Mapping

import numpy as np

from ..anchors.stand_ins import StandIns, fans, octahedra, tubes
from ..bridge.scene.instances import Instance, instances, is_finite
from ..bridge.scene.read_visibility import ShownInRenders, has_hair
from ..casting.common.ray_visibility import CAMERA
from ..projection.arrays import transform
from ..projection.typing import Array, IndexArray

# Lines, and points, of one thing that get a stand-in; of more every so many.
MOST_LINES, MOST_POINTS = 20_000, 100_000
# The radius of curves and points that have none.
USUAL_RADIUS = 0.01


def read_stand_ins(depsgraph, members: Mapping[int, int] | None = None) -> StandIns | None:
    """The stand-ins of all that renders of a depsgraph show to cameras and that has no faces; None if none.

    Smoke has none. members: the numbers of image layers by session id; things in a layer have none.
    """
    found: list[StandIns] = []
    for instance in instances(depsgraph, {*READERS, "MESH"}, ShownInRenders(depsgraph)):
        if not instance.rays & CAMERA or not is_finite(instance.matrix):
            continue
        if members and instance.key.image_layer(members):
            continue
        if instance.obj.type == "MESH":
            if has_hair(instance.obj):
                found += _particle_hair(instance.obj)
        else:
            found += (_placed(instance, part) for part in READERS[instance.obj.type](instance.obj))
    return StandIns.joined(found)


def _placed(instance: Instance, part: StandIns) -> StandIns:
    matrix = instance.matrix

    def moved(points: Array) -> Array:
        return transform(matrix[:3, :3], points.reshape(-1, 3).T, matrix[:3, 3]).T.reshape(points.shape)

    return part._replace(vertices=moved(part.vertices), whole=moved(part.whole))


def _curves(obj) -> Iterator[StandIns]:
    """The stand-ins of hair curves."""
    curves = obj.data
    points = _vectors(curves.attributes, "position")
    if len(points):
        radius = _numbers(curves.attributes, "radius", len(points), USUAL_RADIUS)
        yield tubes(*_some_lines(points, _counts(curves.curve_offset_data), radius))


def _points(obj) -> Iterator[StandIns]:
    """The stand-ins of a point cloud."""
    points = _vectors(obj.data.attributes, "position")
    if len(points):
        radius = _numbers(obj.data.attributes, "radius", len(points), USUAL_RADIUS)
        step = -(-len(points) // MOST_POINTS)
        yield octahedra(points[::step], radius[::step])


def _strokes(obj) -> Iterator[StandIns]:
    """The stand-ins of Grease Pencil's strokes and fills."""
    box = np.array([[*corner] for corner in obj.bound_box], np.float64)[None]
    for layer in obj.data.layers:
        frame = None if layer.hide else layer.current_frame()
        if frame is None:
            continue
        drawing = frame.drawing
        points = _vectors(drawing.attributes, "position")
        if not len(points):
            continue
        matrix = np.array(layer.matrix_local, np.float64)
        points = transform(matrix[:3, :3], points.T, matrix[:3, 3]).T
        radius = _numbers(drawing.attributes, "radius", len(points), USUAL_RADIUS)
        counts = _counts(drawing.curve_offsets)
        yield tubes(*_some_lines(points, counts, radius))
        yield fans(points, counts)._replace(whole=box)


def _particle_hair(obj) -> Iterator[StandIns]:
    """The stand-ins of hair by particles, which Blender gives in world space."""
    for modifier in obj.modifiers:
        if modifier.type != "PARTICLE_SYSTEM" or not modifier.show_render:
            continue
        system = modifier.particle_system
        settings = system.settings
        if settings.type != "HAIR" or settings.render_type != "PATH":
            continue
        parents, children = len(system.particles), len(system.child_particles)
        first = parents if children and not settings.use_parent_particles else 0
        numbers = range(first, parents + children, -(-(parents + children) // MOST_LINES))
        steps = 2**settings.render_step + 1
        points = np.array(
            [
                system.co_hair(obj, particle_no=number, step=step)
                for number in numbers
                for step in range(steps)
            ],
            np.float64,
        ).reshape(-1, steps, 3)
        # Hair that is shorter than others has no place at its last steps.
        points = points[np.isfinite(points).all(axis=(1, 2)) & (points != 0.0).any(axis=2).all(axis=1)]
        radius = np.full(points.size // 3, settings.root_radius * settings.radius_scale)
        yield tubes(points.reshape(-1, 3), np.full(len(points), steps), radius)


READERS: dict[str, Callable[[object], Iterator[StandIns]]] = {
    "CURVES": _curves,
    "POINTCLOUD": _points,
    "GREASEPENCIL": _strokes,
}


def _vectors(attributes, name: str) -> Array:
    """The values (N, 3) of an attribute of vectors."""
    data = attributes[name].data if name in attributes else ()
    values = np.empty(3 * len(data), np.float32)
    if len(data):
        data.foreach_get("vector", values)
    return values.reshape(-1, 3).astype(np.float64)


def _numbers(attributes, name: str, count: int, otherwise: float) -> Array:
    """The values (count,) of an attribute of numbers."""
    data = attributes[name].data if name in attributes else ()
    values = np.full(count, otherwise, np.float32)
    if len(data) == count:
        data.foreach_get("value", values)
    return values.astype(np.float64)


def _counts(offsets) -> IndexArray:
    """The number of points of each line, (L,)."""
    values = np.empty(len(offsets), np.int32)
    offsets.foreach_get("value", values)
    return np.diff(values).astype(np.intp)


def _some_lines(points: Array, counts: IndexArray, radius: Array) -> tuple[Array, IndexArray, Array]:
    """At most MOST_LINES of polylines. See ``tubes``."""
    step = -(-len(counts) // MOST_LINES)
    kept = np.repeat(np.arange(len(counts)) % step == 0, counts)
    return points[kept], counts[::step], radius[kept]
