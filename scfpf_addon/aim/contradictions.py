# SPDX-License-Identifier: GPL-3.0-or-later
"""Targets that contradict each other: no volume meets both, however long a solver looks for one."""

from __future__ import annotations

from collections.abc import Mapping
from itertools import combinations, permutations
from typing import NamedTuple

import numpy as np

from ..projection.typing import Array, IndexArray
from ..projection.volume.viewing_volume import Projection
from .aim_scene import AimScene
from .judge import HIDING_PIXELS, footprint_of, places_of
from .sight import sees
from .solver.problem import AimPins
from .solver.vectors import nearest_t, unit
from .views import AimView

# Points within a pixel are the same one, and so are places.
SAME = 1.0
# Places of the same point differ if they are farther apart than this, in pixels. A volume may draw points
# apart by this factor: its control points are more than a hundred pixels from each other.
APART, STRETCH = 3.0, 50.0
# The image before shows a point at a place if it is nearer to it than this share of the way to the other
# place: a panorama of more than a whole turn shows some points twice.
SHOWN = 0.25
# Directions of the same point differ by more than this, degrees.
TURNED = 5.0
# A surface through a point is looked for within so many pixels around it.
NEAR_SURFACE = 2.0
# A point is on a view's thing if it is nearer than this share of its radius.
ON_THING = 0.01


# Views show a point in two places that are farther apart than this share of the image. They contradict each
# other if one of them sees more than such a share of the other's points elsewhere: that explains why a
# solution misses them, and beyond a larger share none is looked for.
ELSEWHERE, TWICE, MOSTLY = 0.05, 0.25, 0.75

POINT, DIRECTION, PLACE, VIEW, VIEWS = "POINT", "DIRECTION", "PLACE", "VIEW", "VIEWS"


class Contradiction(NamedTuple):
    """Two targets that no volume meets both, by the number of a pin of each.

    kind: POINT, the same point at two places; DIRECTION, the same point from two directions; PLACE, two
    points at the same place, of which the first hides the second; VIEW, a point of a view's thing elsewhere
    than the view shows it; VIEWS, two views that show the same part in two places.
    """

    kind: str
    first: int
    second: int


def find_contradiction(
    scene: AimScene, before: Projection, pins: AimPins, views: Mapping[int, AimView], width: int
) -> Contradiction | None:
    """The first contradiction among targets.

    before: the projection of the start. views: by the numbers that their pins have. width: of the image in
    pixels.
    """
    found = _among_pins(scene, before, pins, width) if (pins.views < 0).sum() > 1 else None
    return found or _of_pins_and_views(scene, pins, views) or shown_twice(scene, pins, views, MOSTLY)


def _among_pins(scene: AimScene, before: Projection, pins: AimPins, width: int) -> Contradiction | None:
    """The first contradiction among pins by themselves."""
    single = np.flatnonzero(pins.views < 0)
    own = pins.take(single)
    u, v = own.positions
    t = nearest_t(before.volume.controls(u, v).points, own.points)
    pixel = footprint_of(before.volume.evaluate(u, v, t), width)
    shown, surfaces = _shown(before, own, width), surfaces_at(scene, own.points, pixel)
    for one, other in combinations(range(own.count), 2):
        reach = max(float(pixel[one]), float(pixel[other]), 1e-300)
        away = float(np.linalg.norm(own.points[:, one] - own.points[:, other])) / reach
        across, up = own.positions[:, one] - own.positions[:, other]
        apart = float(np.hypot(across, up / before.aspect)) * width
        both = int(single[one]), int(single[other])
        if apart > APART + STRETCH * max(away - SAME, 0.0):
            if max(shown[one], shown[other]) > SHOWN * apart:
                return Contradiction(POINT, *both)
        elif away <= SAME:
            first, second = unit(own.directions[:, [one, other]]).T
            # NaN where a direction is free.
            if float(first @ second) < np.cos(np.radians(TURNED)):
                return Contradiction(DIRECTION, *both)
        elif apart <= SAME and away > HIDING_PIXELS:
            near, far = (one, other) if t[one] <= t[other] else (other, one)
            if surfaces[near] >= 0:
                return Contradiction(PLACE, int(single[near]), int(single[far]))
    return None


def _of_pins_and_views(scene: AimScene, pins: AimPins, views: Mapping[int, AimView]) -> Contradiction | None:
    """The first pin on a view's thing that the view shows elsewhere."""
    single = np.flatnonzero(pins.views < 0)
    points, positions = pins.points[:, single], pins.positions[:, single]
    for number, view in views.items() if len(single) else ():
        pixel = np.full(len(single), view.map.radius / NEAR_SURFACE * ON_THING)
        met = surfaces_at(scene, points, pixel)
        on_thing = (met >= 0) & view.own[met]
        apart = np.hypot(*(view.map.positions(points) - positions))
        which = np.flatnonzero(on_thing & (apart > ELSEWHERE))
        if len(which) and len(of_view := np.flatnonzero(pins.views == number)):
            seen = which[sees(scene, view.own, view.map, points[:, which])]
            if len(seen):
                return Contradiction(VIEW, int(single[seen[0]]), int(of_view[0]))
    return None


def shown_twice(
    scene: AimScene, pins: AimPins, views: Mapping[int, AimView], share: float = TWICE
) -> Contradiction | None:
    """The first two views of which one sees more than ``share`` of the other's points elsewhere."""
    for one, other in permutations(views, 2):
        view, thing = views[other], views[other].own & views[one].own
        which = np.flatnonzero(pins.views == one)
        if not thing.any() or not len(which):
            continue
        points = pins.points[:, which]
        apart = np.hypot(*(view.map.positions(points) - pins.positions[:, which]))
        twice = (apart > ELSEWHERE) & sees(scene, thing, view.map, points)
        if twice.mean() > share:
            first, second = sorted((one, other))
            return Contradiction(VIEWS, *(int(np.flatnonzero(pins.views == n)[0]) for n in (first, second)))
    return None


def _shown(before: Projection, pins: AimPins, width: int) -> Array:
    """The distance, (P,) pixels, of each pin's point in an image from its position; inf if it is not seen."""
    place = places_of(before, pins.points, pins.positions)
    across, up = place.u - pins.positions[0], (place.v - pins.positions[1]) / before.aspect
    return np.where(place.found, np.hypot(across, up) * width, np.inf)


def surfaces_at(scene: AimScene, points: Array, pixel: Array) -> IndexArray:
    """The numbers (N,) of triangles within NEAR_SURFACE pixels of world points (3, N), -1 without one.

    pixel: (N,), world units across a pixel at each point.
    """
    found = np.full(points.shape[1], -1)
    local = (points - scene.cast.centre[:, None]) * scene.cast.scale
    limits = np.ones(points.shape[1], np.float32)
    for axis in np.eye(3):
        way = axis[:, None] * (NEAR_SURFACE * scene.cast.scale * pixel)
        met = scene.cast.mesh.trace((local - way).astype(np.float32), (2.0 * way).astype(np.float32), limits)
        found = np.where(found < 0, met, found)
    return found
