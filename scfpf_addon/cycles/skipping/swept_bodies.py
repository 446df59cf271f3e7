# SPDX-License-Identifier: GPL-3.0-or-later
"""Bodies that contain what moves while the shutter is open, as Cycles blurs it.

Cycles samples an object at 2^s + 1 times, s its motion steps (``object_motion_steps`` in
intern/cycles/blender/object.cpp). Between two of them vertices move straight in the object's own space, and
its matrix is interpolated as a translation, a rotation and a symmetric rest (``transform_decompose`` in
intern/cycles/util/transform.cpp).
"""

from __future__ import annotations

import math
from collections.abc import Callable
from typing import NamedTuple

import numpy as np

from ...bridge.scene.instances import Instance
from ...casting.cells.body_tree import boxes_as_bodies
from ...projection.typing import Array, IndexArray
from .bodies import Bodies, Part, Unbounded, placed_points, seen_parts

# A matrix whose least singular value is a smaller share of the largest has no certain rotation.
FLAT = 1e-6
VANISHES = "A mesh that changes its vertices is blurred"


class Shutter(NamedTuple):
    """The times at which a scene is blurred. centre: from the frame, in frames. half: half its length."""

    centre: float = 0.0
    half: float = 0.0


def shutter_of(render) -> Shutter:
    """The shutter of a scene's render settings, closed without motion blur."""
    if not render.use_motion_blur:
        return Shutter()
    half = 0.5 * render.motion_blur_shutter
    return Shutter({"START": half, "END": -half}.get(render.motion_blur_position, 0.0), half)


class SweptBodies:
    """The moving instances of a view layer at the sampled times of one frame."""

    def __init__(self, moves: Callable[[Instance], bool]) -> None:
        self._moves = moves
        self._steps: dict[tuple, list[tuple[float, Array, list[Part]]]] = {}
        self.times: set[float] = set()

    def read(self, depsgraph, time: float) -> None:
        """Add what a depsgraph shows at a time, from -1 to 1, of those that are sampled there.

        The time 0 comes first. Raises Unbounded.
        """

        def wanted(instance: Instance) -> bool:
            if not self._moves(instance):
                return False
            times = _times(_motion_steps(instance))
            if time == 0.0:
                _require_known_velocity(instance.obj)
                self.times.update(times)
            return time in times

        for key, matrix, parts in seen_parts(depsgraph, wanted):
            if time == 0.0 or key in self._steps:
                self._steps.setdefault(key, []).append((time, matrix, parts))

    def add_to(self, bodies: Bodies) -> None:
        """Add boxes around what was read. Raises Unbounded."""
        for steps in self._steps.values():
            steps.sort(key=lambda step: step[0])
            if len({len(parts) for _, _, parts in steps}) > 1:
                raise Unbounded(VANISHES)
            matrices = [matrix for _, matrix, _ in steps]
            middle = [time for time, _, _ in steps].index(0.0)
            for parts in zip(*(parts for _, _, parts in steps), strict=True):
                bodies.add_boxes(swept_boxes(matrices, [p.points for p in parts], parts[middle].triangles))


def swept_boxes(matrices: list[Array], points: list[Array], triangles: IndexArray | None) -> Array:
    """Boxes by their corners (8, 3, M) around each triangle, or the hull, of points (V, 3) that move.

    matrices, points: at successive times. Raises Unbounded if there are other points at one of them.
    """
    if len({len(some) for some in points}) > 1:
        raise Unbounded(VANISHES)
    corners = np.arange(len(points[0]))[None] if triangles is None else triangles
    lower = np.full((3, len(corners)), np.inf)
    upper = -lower
    pads = [_deviation(matrices[i : i + 2], points[i : i + 2]) for i in range(len(points) - 1)]
    for number, (some, matrix) in enumerate(zip(points, matrices, strict=True)):
        pad = max(pads[max(0, number - 1) : number + 1], default=0.0)
        at = placed_points(some, matrix)[corners]
        lower = np.minimum(lower, at.min(axis=1).T - pad)
        upper = np.maximum(upper, at.max(axis=1).T + pad)
    return boxes_as_bodies(lower, upper)


def _deviation(matrices: list[Array], points: list[Array]) -> float:
    """The largest distance of points (V, 3) that move between two poses from the straight way.

    With q = S p it is at most 2 s (1 - s) · angle · |q| for the rotation, at s of the way, and
    s (1 - s) · |ΔS| |Δp| for the product of S and p, which are both linear.
    """
    (first, size_a, stretch_a), (second, size_b, stretch_b) = (_polar(matrix) for matrix in matrices)
    reach = [float(np.sqrt((p * p).sum(axis=1).max())) for p in points]
    if first is None or second is None:
        angle, change = math.pi, size_a + size_b
    else:
        turn = 0.5 * (np.trace(first.T @ second) - 1.0)
        angle = math.acos(min(1.0, max(-1.0, turn)))
        change = float(np.linalg.norm(stretch_b - stretch_a))
    farthest = max(size_a * reach[0], size_b * reach[1], size_a * reach[1], size_b * reach[0])
    return 0.5 * angle * farthest + 0.25 * change * (reach[0] + reach[1])


def _polar(matrix: Array) -> tuple[Array | None, float, Array]:
    """The rotation of a matrix, None if it is not certain, its largest stretch, and its symmetric rest."""
    left, stretches, right = np.linalg.svd(matrix[:3, :3])
    rotation = left @ right
    rest = right.T @ np.diag(stretches) @ right
    if stretches[2] <= FLAT * stretches[0]:
        return None, float(stretches[0]), rest
    if np.linalg.det(rotation) < 0.0:
        rotation, rest = -rotation, -rest
    return rotation, float(stretches[0]), rest


def _times(steps: int) -> list[float]:
    """The times of an object with so many motion steps, from -1 to 1; 0 steps: the middle alone."""
    count = 1 << steps
    return [2.0 * number / count - 1.0 for number in range(count + 1)] if steps else [0.0]


def _motion_steps(instance: Instance) -> int:
    """The motion steps of an instance; those of what makes it count as well."""
    owners = instance.obj.original, instance.owner
    if not all(owner.cycles.use_motion_blur for owner in owners):
        return 0
    return max(1, *(owner.cycles.motion_steps for owner in owners))


def _require_known_velocity(obj) -> None:
    """Raise Unbounded if Cycles blurs an object by velocities instead of by its motion."""
    attributes = getattr(obj.data, "attributes", None)
    if obj.type == "VOLUME" or (attributes is not None and attributes.get("velocity") is not None):
        raise Unbounded(f"The velocities of '{obj.name}' blur it without known bounds")
