# SPDX-License-Identifier: GPL-3.0-or-later
"""From a thing in the scene to its place in the picture: ``pick`` the other way round."""

from __future__ import annotations

from collections.abc import Collection
from dataclasses import dataclass

import numpy as np

from ...casting.cast import cast
from ...casting.scene.cast_scene import CastScene
from ...projection.typing import Array, BoolArray
from ...projection.volume.inverse import ImagePlaces, find_in_image
from ...projection.volume.viewing_volume import Projection
from ..lights.ray_visibility import seen_directly
from ..scene.shading_scene import Scene
from .pick import PIXEL_ERROR

# Of a thing with more points these are looked up: the outermost in so many directions, and so many others.
DIRECTIONS, OTHERS = 96, 300
# A hit this much before a point, in t, hides it; what is nearer is the thing's own face or its rounding.
HIDING_STEP = 1e-6


@dataclass(frozen=True)
class Found:
    """Where a thing is in the picture.

    box: left, lower, right and upper border of what is in the picture, shares of it.
    centre: (x, y) of its middle, or of the shown point nearest to that. shown: share of the points
    looked up that are in the picture. hidden: share of these with something else before them. hider:
    name of what hides most, empty if nothing does.
    """

    box: tuple[float, float, float, float]
    centre: tuple[float, float]
    shown: float
    hidden: float
    hider: str


def points_of(scene: Scene, names: Collection[str]) -> Array:
    """The vertices of the objects of these names, (3, N); none for what has no faces."""
    geometry = scene.geometry
    own = _own(scene, names)
    vertices = np.unique(geometry.triangles[own[geometry.object_index]])
    return np.ascontiguousarray(geometry.vertices[vertices].T)


def find(
    projection: Projection,
    scene: Scene,
    points: Array,
    names: Collection[str],
    pixel_size: tuple[float, float],
) -> Found | None:
    """Where a thing is in the picture; None if all of it is outside.

    projection: in the scene's space. points: (3, N), N >= 1, of the thing. names: of the objects that
    do not hide it: itself. pixel_size: as for ``pick``. Raises CastError.
    """
    middle = (points.min(axis=1) + points.max(axis=1)) / 2
    some = np.concatenate([middle[:, None], _some(points)], axis=1)
    place = find_in_image(projection, some)
    inside = np.flatnonzero(place.found[1:]) + 1
    if not len(inside):
        return None
    x, y = place.x[inside], place.y[inside]
    if place.found[0]:
        nearest = 0
    else:
        nearest = inside[np.argmin(np.linalg.norm(some[:, inside] - middle[:, None], axis=0))]
    seen = ImagePlaces(x, y, place.t[inside], place.found[inside])
    hidden, hider = _hidden(projection, scene, seen, names, pixel_size)
    return Found(
        (float(x.min()), float(y.min()), float(x.max()), float(y.max())),
        (float(place.x[nearest]), float(place.y[nearest])),
        len(inside) / (some.shape[1] - 1),
        hidden,
        hider,
    )


def _own(scene: Scene, names: Collection[str]) -> BoolArray:
    """Whether each object of the scene has one of these names; one entry more, so that none is no error."""
    return np.array([*(name in names for name in scene.geometry.object_names), False])


def _some(points: Array) -> Array:
    """All points, or of many the outermost ones and some more."""
    count = points.shape[1]
    if count <= DIRECTIONS + OTHERS:
        return points
    # Evenly over the sphere: a spiral of the golden angle.
    rank = np.arange(DIRECTIONS) + 0.5
    z, angle = 1 - 2 * rank / DIRECTIONS, np.pi * (1 + np.sqrt(5)) * rank
    r = np.sqrt(1 - z * z)
    outer = [int(np.argmax(d @ points)) for d in np.stack([r * np.cos(angle), r * np.sin(angle), z], axis=1)]
    return points[:, np.union1d(outer, np.linspace(0, count - 1, OTHERS).astype(np.int64))]


def _hidden(
    projection: Projection,
    scene: Scene,
    place: ImagePlaces,
    names: Collection[str],
    pixel_size: tuple[float, float],
) -> tuple[float, str]:
    """The share of the points that something else is before, and what that mostly is."""
    geometry = scene.geometry
    if not len(geometry.triangles):
        return 0.0, ""
    cast_scene = seen_directly(geometry, CastScene(geometry.vertices, geometry.triangles))
    if cast_scene is None:
        return 0.0, ""
    moved = projection.transformed(cast_scene.matrix)
    hits = cast(cast_scene, moved, place.x, place.y, pixel_size, PIXEL_ERROR)
    met = geometry.object_index[hits.triangle]
    hiding = (hits.triangle >= 0) & ~_own(scene, names)[met] & (hits.t < place.t - HIDING_STEP)
    if not hiding.any():
        return 0.0, ""
    most = int(np.bincount(met[hiding]).argmax())
    name = geometry.object_names[most] if most < len(geometry.object_names) else ""
    return float(hiding.mean()), name
