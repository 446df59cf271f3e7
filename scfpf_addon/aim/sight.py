# SPDX-License-Identifier: GPL-3.0-or-later
"""Straight lines of sight from the eyes of views: what hides a thing, and where nothing does."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from ..projection.typing import Array, BoolArray
from .aim_scene import AimScene
from .view_map import ViewMap, orbit

# Lines end this share of their length before the point, on whose own surface it lies, and begin as far from
# the eye.
ENDS = 1e-3
# A parallel eye is so many radii of the thing away at least.
FAR_RADII = 100.0
# Turns that are tried: rings of this many directions, this far apart, up to the largest angle, radians.
RING, STEP, LARGEST = 16, np.radians(3.0), np.radians(75.0)
# A direction is free if so large a share of the points is seen.
ENOUGH = 0.95


def sees(scene: AimScene, hiding: BoolArray, view: ViewMap, points: Array) -> BoolArray:
    """Return whether the eye of a view sees world points (3, N) past the triangles ``hiding`` (T,)."""
    count = points.shape[1]
    blockers = scene.cast.only(hiding) if hiding.any() else None
    if blockers is None:
        return np.ones(count, bool)
    if view.is_parallel:
        start = points - view.directions(points) * (FAR_RADII * view.radius)
    else:
        start = np.repeat(np.linalg.inv(view.to_eye)[:3, 3:], count, axis=1)
    way = points - start
    begin = (start + ENDS * way - scene.cast.centre[:, None]) * scene.cast.scale
    rays = way * ((1.0 - 2.0 * ENDS) * scene.cast.scale)
    limits = np.ones(count, np.float32)
    found = blockers.mesh.trace(begin.astype(np.float32), rays.astype(np.float32), limits)
    seen: BoolArray = found < 0
    return seen


def free_turn(
    scene: AimScene, hiding: BoolArray, view: ViewMap, points: Array, way: float | None = None
) -> tuple[float, float] | None:
    """The nearest turn of a view's eye round its thing, to its left and up, that lets it see points (3, N).

    hiding: (T,), triangles that may be in the way. way: the only direction of turns, radians from the left
    upwards; None for all. (0, 0) if nothing is in the way; None if no turn helps.
    """
    if sees(scene, hiding, view, points).mean() >= ENOUGH:
        return 0.0, 0.0
    eye = np.linalg.inv(view.to_eye)
    ways = np.arange(RING) * (2.0 * np.pi / RING) if way is None else np.array([way])
    for ring in range(1, int(LARGEST / STEP) + 1):
        for angle in ways:
            left, up = ring * STEP * np.cos(angle), ring * STEP * np.sin(angle)
            turned = replace(view, to_eye=np.linalg.inv(orbit(eye, view.centre, left, up) @ eye))
            if turned.is_visible and sees(scene, hiding, turned, points).mean() >= ENOUGH:
                return float(left), float(up)
    return None
