# SPDX-License-Identifier: GPL-3.0-or-later
"""Views: pins sampled on what an ordinary camera sees of a thing."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from ..casting.common.hits import CastError
from ..projection.surfaces.nurbs import NurbsAxis, NurbsPatch
from ..projection.typing import Array, BoolArray, IndexArray
from ..projection.volume.viewing_volume import Projection, ViewingVolume
from .aim_scene import AimScene
from .solver.problem import AimPins
from .view_map import ViewMap

# Pins of a view, and their weight: they are many.
PINS, WEIGHT = 24, 0.3
# Rays across the thing, and up.
RAYS = 72
# Pins need surfaces that are seen at a larger cosine.
LEAST_COSINE = 0.3
# Rays begin this share of the thing's depth before it.
AHEAD = 0.05


class SeenPoints(NamedTuple):
    """The points of a view's thing that its eye sees, by rays that are even in its image.

    triangles: (N,). points: (3, N), in world space.
    """

    triangles: IndexArray
    points: Array


class AimView(NamedTuple):
    """A view. own: (T,), the triangles of its thing."""

    map: ViewMap
    own: BoolArray
    seen: SeenPoints


def sample_view(
    scene: AimScene, wanted: BoolArray, view: ViewMap, number: int = 0, count: int = PINS
) -> AimPins:
    """At most ``count`` pins on what a view's eye sees of its thing, at their places in the image.

    wanted: (T,), the thing's triangles; nothing else hides it. number: of the view, which its pins get.
    Raises CastError if the eye does not see the thing.
    """
    return pins_on(scene, seen_of(scene, wanted, view), view, number, count)


def pins_on(scene: AimScene, seen: SeenPoints, view: ViewMap, number: int = 0, count: int = PINS) -> AimPins:
    """At most ``count`` pins on what a view's eye sees, as ``sample_view``."""
    points = seen.points
    directions = view.directions(points)
    facing = np.abs(np.einsum("cn,cn->n", scene.cast.normals(seen.triangles), directions))
    good = np.flatnonzero(facing > LEAST_COSINE)
    if not len(good):
        good = np.arange(len(facing))
    places = view.positions(points) / np.array([[1.0], [view.aspect]])
    chosen = good[_spread(places[:, good], count)]
    points = points[:, chosen]
    across, upward = view.steps(points)
    return AimPins(
        points,
        view.positions(points),
        directions[:, chosen],
        across=across,
        upward=upward,
        weights=np.full(len(chosen), WEIGHT),
        views=np.full(len(chosen), number),
        pivots=np.repeat(view.centre[:, None], len(chosen), axis=1),
    )


def seen_of(scene: AimScene, wanted: BoolArray, view: ViewMap) -> SeenPoints:
    """Find the points of a thing that an eye sees.

    wanted: (T,), the thing's triangles. Raises CastError if the eye sees none of them.
    """
    thing = scene.cast.only(wanted) if wanted.any() else None
    if thing is None:
        raise CastError("the view's thing has no faces: choose a collection or an object with a mesh")
    used = np.unique(scene.cast.triangles[wanted])
    turn, shift = view.to_eye[:3, :3], view.to_eye[:3, 3:]
    vertices = turn @ scene.world(scene.cast.vertices[:, used]) + shift
    if not view.is_parallel:
        vertices = vertices[:, vertices[2] < 0.0]
    if not vertices.shape[1]:
        raise CastError("the view's camera does not see its thing: turn the camera towards it")
    depth = -vertices[2]
    near, far = depth.min(), depth.max()
    ahead = AHEAD * max(far - near, view.radius)
    far += ahead
    near = near - ahead if view.is_parallel else max(near - ahead, 0.01 * near)
    flat = vertices[:2] if view.is_parallel else vertices[:2] / depth
    low, high = flat.min(axis=1), flat.max(axis=1)
    planes = tuple(_plane(view, low, high, distance) for distance in (near, far))
    shares = (np.arange(RAYS) + 0.5) / RAYS
    x, y = (a.ravel() for a in np.meshgrid(shares, shares, indexing="ij"))
    hits = AimScene(thing, scene.objects).hits(Projection(ViewingVolume(planes)), x, y, RAYS)
    hit = hits.triangle >= 0
    if not hit.any():
        raise CastError("the view's camera does not see its thing: turn the camera towards it")
    return SeenPoints(hits.triangle[hit], scene.world(hits.position[:, hit]))


def _plane(view: ViewMap, low: Array, high: Array, distance: float) -> NurbsPatch:
    """The rectangle that a box of the eye's image plane covers at a distance, in world space."""
    scale = 1.0 if view.is_parallel else distance
    corners = [[(x * scale, y * scale, -distance) for x in (low[0], high[0])] for y in (low[1], high[1])]
    straight = NurbsAxis(order=2)
    # The inverse of a rigid matrix.
    world = (np.array(corners) - view.to_eye[:3, 3]) @ view.to_eye[:3, :3]
    return NurbsPatch(world, straight, straight)


def _spread(places: Array, count: int) -> IndexArray:
    """At most ``count`` of N places (2, N), far from each other: each the farthest from those before."""
    away_from_middle = places - places.mean(axis=1, keepdims=True)
    chosen = [int(np.einsum("cn,cn->n", away_from_middle, away_from_middle).argmin())]
    distance = np.full(places.shape[1], np.inf)
    while len(chosen) < min(count, places.shape[1]):
        step = places - places[:, chosen[-1], None]
        distance = np.minimum(distance, np.einsum("cn,cn->n", step, step))
        chosen.append(int(distance.argmax()))
    return np.array(chosen)
