# SPDX-License-Identifier: GPL-3.0-or-later
"""The object that an image position shows."""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from ...casting.cast import cast
from ...casting.common.hits import CastCounts
from ...casting.layers.layer_parts import LayerParts
from ...casting.layers.layered_cast import LayeredCast
from ...casting.scene.cast_scene import CastScene
from ...projection.typing import Array
from ...projection.volume.viewing_volume import Projection
from ..lights.ray_visibility import camera_scene
from ..scene.shading_scene import Scene

# Error of the hit at a silhouette, in pixels; small, as it is one projector only.
PIXEL_ERROR = 1e-3
# Straight pieces that approximate the length of a projector; the error falls with their square.
LENGTH_PIECES = 512


@dataclass(frozen=True)
class Pick:
    """The projector through an image position.

    curve: (LENGTH_PIECES + 1, 3) float64, from the near to the far surface, evenly in t.
    t: of the first hit, in [0, 1]; None on a miss, where the other fields are empty or 0. position: (3,) of
    the hit. object_name: of the object hit. distance: along the projector from the near surface to the hit,
    in units of the projection's space.
    """

    curve: Array
    t: float | None
    position: Array
    object_name: str
    distance: float


def pick(
    projection: Projection, scene: Scene, x: float, y: float, pixel_size: tuple[float, float]
) -> Pick | None:
    """Pick at (x, y), each in [0, 1], origin bottom-left; None where there is no projector.

    projection: in the scene's space. pixel_size: a pixel's width and height as shares
    of the image. Raises CastError.
    """
    cast_scene = visible_scene(scene)
    triangle, t = -1, math.inf
    if cast_scene is not None:
        triangle, t, layer = first_hit(cast_scene, projection, x, y, pixel_size, scene.geometry.image_layer)
        projection = projection.of_layers[layer]
    curve_at = projector_at(projection, x, y)
    if curve_at is None:
        return None
    curve = curve_at(np.linspace(0.0, 1.0, LENGTH_PIECES + 1))
    if triangle < 0:
        return Pick(curve, None, np.zeros(3), "", 0.0)
    way = curve_at(np.linspace(0.0, t, LENGTH_PIECES + 1))
    distance = float(np.linalg.norm(np.diff(way, axis=0), axis=1).sum())
    name = object_name(scene, int(scene.geometry.object_index[triangle]))
    return Pick(curve, t, way[-1], name, distance)


def projector_at(projection: Projection, x: float, y: float) -> Callable[[Array], Array] | None:
    """A function from t (S,) to the points (S, 3) of the projector at (x, y), or None without a projector."""
    projectors = projection.projectors(np.array([x]), np.array([y]))
    if not projectors.valid[0] or not np.isfinite(projectors.points).all():
        return None
    spans, controls = projection.volume.spans, projectors.points[:, :, 0]

    def curve_at(t: Array) -> Array:
        """The points (S, 3) at t (S,)."""
        weights, _ = spans.weights(t)
        points: Array = np.einsum("ks,kc->sc", weights, controls)
        return points

    return curve_at


def layered_cast(
    cast_scene: CastScene,
    projection: Projection,
    layers: NDArray[np.uint8] | None,
    pixel_size: tuple[float, float],
) -> LayeredCast | None:
    """The cast at a scene's layers, None if the projection itself shows all.

    layers: (T,) of the triangles, see ``Geometry.image_layer``. projection, pixel_size: as for ``pick``.
    """
    moved = projection.transformed(cast_scene.matrix)
    parts = LayerParts.of(layers, cast_scene, moved.layers)
    if parts is None:
        return None
    return LayeredCast(parts=parts, projection=moved, pixel_size=pixel_size, pixel_error=PIXEL_ERROR)


def first_hit(
    cast_scene: CastScene,
    projection: Projection,
    x: float,
    y: float,
    pixel_size: tuple[float, float],
    layers: NDArray[np.uint8] | None = None,
) -> tuple[int, float, int]:
    """The first triangle that is seen at (x, y), its t and the layer that shows it; (-1, inf, 0) on a miss.

    The arguments are those of ``layered_cast``. Raises CastError.
    """
    place, layer = (np.array([x]), np.array([y])), 0
    layered = layered_cast(cast_scene, projection, layers, pixel_size)
    if layered is None:
        moved = projection.transformed(cast_scene.matrix)
        hits = cast(cast_scene, moved, *place, pixel_size, PIXEL_ERROR)
    else:
        hits, numbers = layered.first_hits(*place, CastCounts())
        layer = int(numbers[0])
    triangle = int(hits.triangle[0])
    return (triangle, float(hits.t[0]), layer) if triangle >= 0 else (-1, math.inf, 0)


def visible_scene(scene: Scene) -> CastScene | None:
    """The triangles that projectors can hit; None for none. Raises CastError."""
    geometry = scene.geometry
    if not len(geometry.triangles):
        return None
    return camera_scene(geometry, CastScene(geometry.vertices, geometry.triangles))


def object_name(scene: Scene, number: int) -> str:
    """The name of an object of the scene, empty if unknown."""
    names = scene.geometry.object_names
    return names[number] if number < len(names) else ""
