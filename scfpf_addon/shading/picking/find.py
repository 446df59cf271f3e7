# SPDX-License-Identifier: GPL-3.0-or-later
"""The place of an object in the image: the inverse of ``pick``."""

from __future__ import annotations

from collections.abc import Collection
from dataclasses import dataclass

import numpy as np

from ...casting.cast import cast
from ...casting.common.hits import CastCounts, Hits
from ...projection.typing import Array, BoolArray
from ...projection.volume.inverse import ImagePlaces, find_in_image
from ...projection.volume.viewing_volume import Projection
from ..scene.shading_scene import Scene
from .pick import PIXEL_ERROR, layered_cast, object_name, visible_scene

# Of an object with more points these are looked up: the outermost in so many directions, and so many others.
DIRECTIONS, OTHERS = 96, 300
# A hit this much before a point, in t, hides it; a nearer one is the object's own face.
HIDING_STEP = 1e-6


@dataclass(frozen=True)
class FoundObject:
    """The place of an object in the image.

    box: left, lower, right and upper border of its visible part, shares of the image. centre: (x, y) of its
    middle, or of the nearest point in the image. shown: share of the points looked up that are in the image.
    hidden: share of these behind other objects. hider: name of the object that hides most, or empty.
    """

    box: tuple[float, float, float, float]
    centre: tuple[float, float]
    shown: float
    hidden: float
    hider: str


def points_of(scene: Scene, names: Collection[str]) -> Array:
    """The vertices of the objects of these names, (3, N), without those of objects without faces."""
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
) -> FoundObject | None:
    """Find an object in the image; None if all of it is outside.

    projection: in the scene's space. points: (3, N), N >= 1, of the object. names: of the objects that
    cannot hide it: its own. pixel_size: as for ``pick``. Raises CastError.
    """
    number = _layer_of(scene, names)
    middle = (points.min(axis=1) + points.max(axis=1)) / 2
    some = np.concatenate([middle[:, None], _some(points)], axis=1)
    place = find_in_image(projection.of_layers[number], some)
    inside = np.flatnonzero(place.found[1:]) + 1
    if not len(inside):
        return None
    x, y = place.x[inside], place.y[inside]
    if place.found[0]:
        nearest = 0
    else:
        nearest = inside[np.argmin(np.linalg.norm(some[:, inside] - middle[:, None], axis=0))]
    shown = ImagePlaces(x, y, place.t[inside], place.found[inside])
    hidden, hider = _hidden(projection, scene, shown, some[:, inside], names, pixel_size)
    return FoundObject(
        box=(float(x.min()), float(y.min()), float(x.max()), float(y.max())),
        centre=(float(place.x[nearest]), float(place.y[nearest])),
        shown=len(inside) / (some.shape[1] - 1),
        hidden=hidden,
        hider=hider,
    )


def _layer_of(scene: Scene, names: Collection[str]) -> int:
    """The number of the layer that shows most triangles of the objects of these names."""
    geometry = scene.geometry
    if geometry.image_layer is None:
        return 0
    numbers = geometry.image_layer[_own(scene, names)[geometry.object_index]]
    return int(np.bincount(numbers).argmax()) if len(numbers) else 0


def _own(scene: Scene, names: Collection[str]) -> BoolArray:
    """Return whether each object of the scene has one of these names; one entry more, for misses."""
    return np.array([*(name in names for name in scene.geometry.object_names), False])


def _some(points: Array) -> Array:
    """All points; of many the outermost ones and some more."""
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
    points: Array,
    names: Collection[str],
    pixel_size: tuple[float, float],
) -> tuple[float, str]:
    """The share of points (3, N) at ``place`` behind other objects; the name of the one that hides most."""
    cast_scene = visible_scene(scene)
    if cast_scene is None:
        return 0.0, ""
    layered = layered_cast(cast_scene, projection, scene.geometry.image_layer, pixel_size)
    if layered is None:
        moved = projection.transformed(cast_scene.matrix)
        hits = cast(cast_scene, moved, place.x, place.y, pixel_size, PIXEL_ERROR)
        before = hits.t < place.t - HIDING_STEP
    else:
        hits, layer = layered.first_hits(place.x, place.y, CastCounts())
        number = _layer_of(scene, names)
        within = cast_scene.matrix[:3, :3] @ points + cast_scene.matrix[:3, 3:]
        there = Hits.empty(len(place.t))._replace(position=within, triangle=np.zeros(len(place.t), np.int32))
        keys = [layered.keys(each, hits) for each in range(len(projection.of_layers))]
        in_front = np.stack(keys)[layer, np.arange(len(layer))] < layered.keys(number, there)
        before = np.where(layer == number, hits.t < place.t - HIDING_STEP, in_front)
    met = scene.geometry.object_index[hits.triangle]
    hiding = (hits.triangle >= 0) & ~_own(scene, names)[met] & before
    if not hiding.any():
        return 0.0, ""
    most = int(np.bincount(met[hiding]).argmax())
    return float(hiding.mean()), object_name(scene, most)
