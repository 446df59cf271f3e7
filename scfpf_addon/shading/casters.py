# SPDX-License-Identifier: GPL-3.0-or-later
"""Which triangles may cast a shadow on what a volume shows: the others need not be built.

Certain, not sampled: what stands in the way of light lies in the hull of the lamp and of what it lights.
"""

from __future__ import annotations

import numpy as np

from ..casting.geometry import Geometry
from ..casting.half_spaces import HalfSpaces, highest
from ..casting.portions import portions
from ..casting.scene import ORIGIN_OFFSET
from ..projection.typing import Array, BoolArray
from ..projection.volume import ViewingVolume
from .scene import Light, Scene
from .visible import catches

# Turns of 22.5° about a sun's direction; axes and diagonals of space for other lamps.
TURNS = np.arange(8) * (np.pi / 4)
DIAGONALS = np.array([[x, y, z] for x in (-1, 0, 1) for y in (-1, 0, 1) for z in (-1, 0, 1)], float)
DIAGONALS = DIAGONALS[(np.abs(DIAGONALS).sum(axis=1) != 2) & DIAGONALS.any(axis=1)]
# Shadow rays start off their triangle by less than this share of the largest coordinate.
OFFSET = 4.0 * ORIGIN_OFFSET
# A sun whose axes are farther from a rotation's shines on all.
SKEW = 1e-3


def may_shade(scene: Scene, shown: Geometry, volume: ViewingVolume) -> BoolArray:
    """Which triangles (T,) of a scene may cast a shadow on a part of it, where the volume meets that."""
    whole = scene.geometry
    everything = np.ones(len(whole.triangles), bool)
    # A world of one colour casts shadows on catchers alone.
    if scene.world is not None or (catches(whole) and np.any(scene.world_color)):
        return everything
    corners = np.ascontiguousarray(np.asarray(shown.vertices, np.float64).T)
    with np.errstate(invalid="ignore", over="ignore"):
        hull = np.concatenate([surface.hull() for surface in volume.surfaces], axis=1)
    if not (np.isfinite(corners).all() and np.isfinite(hull).all()):
        return everything
    # Projectors of other bases may leave the hull of their surfaces; the triangles that they meet do not.
    bodies = [corners, hull] if volume.basis in ("BEZIER", "POLYLINE") else [corners]
    margin = OFFSET * float(np.abs(corners).max()) + _roundness(shown, corners)
    found = np.zeros(len(everything), bool)
    for light in scene.lights:
        if light.casts_shadow and np.any(light.color):
            between = _between(light, bodies, margin, whole.vertices)
            if between is None:
                return everything
            found |= between.met_by(whole.vertices, whole.triangles)
    return found


def _roundness(shown: Geometry, vertices: Array) -> float:
    """How far shadow rays may start off triangles: the surface that smooth shading pretends
    to lies nowhere farther from them than one corner from the plane of another's normal.

    vertices: (3, V), of ``shown``.
    """
    most = 0.0
    if shown.corner_normals is None:
        return most
    for some in portions(len(shown.triangles)):
        corners = [vertices.take(shown.triangles[some, k], axis=1, mode="clip") for k in range(3)]
        normals = shown.corner_normals[some, : 1 if shown.flat else 3].transpose(1, 2, 0)
        for own, normal in enumerate(np.ascontiguousarray(normals, np.float64)):
            high = [np.einsum("cn,cn->n", normal, corner) for corner in corners]
            off = [np.abs(high[k] - high[own]) for k in range(3) if k != own]
            if shown.flat:
                off.append(np.abs(high[2] - high[1]))
            most = max(most, *(float(each.max()) for each in off))
    return most


def _between(light: Light, bodies: list[Array], margin: float, vertices: Array) -> HalfSpaces | None:
    """What lies between a lamp and what is in all of the bodies, each (3, N), and ``margin`` farther.

    None where that may be anything.
    """
    matrix = np.asarray(light.matrix, np.float64)
    if not np.isfinite(matrix).all():
        return None
    if light.kind == "SUN":
        axes = matrix[:3, :3]
        if np.abs(axes.T @ axes - np.eye(3)).max() > SKEW:
            return None
        x, y, towards = axes.T
        sides = np.outer(np.cos(TURNS), x) + np.outer(np.sin(TURNS), y)
        lit = _common(np.concatenate([sides, -towards[None]]), bodies)
        with np.errstate(invalid="ignore", over="ignore"):
            top = float(highest(towards[None], vertices.T)[0])
        if not np.isfinite(top):
            return None
        # A sun that fills some of the sky shines past what is high up at an angle.
        spread = max(top + lit.limits[-1], 0.0) * (1.0 + SKEW) * np.tan(light.angle / 2)
        lit.limits[:-1] += spread
    else:
        lit = _common(DIAGONALS, bodies)
        size = light.radius
        if light.kind == "AREA":
            size = 0.5 * float(np.linalg.norm(matrix[:3, :2] * np.asarray(light.size), axis=0).sum())
        lit.limits[:] = np.maximum(lit.limits, lit.normals @ matrix[:3, 3] + size)
    lit.limits[:] += margin
    return lit


def _common(normals: Array, bodies: list[Array]) -> HalfSpaces:
    """Half-spaces that hold what is in all of the bodies."""
    each = [HalfSpaces.around(normals, body) for body in bodies]
    limits: Array = np.stack([one.limits for one in each]).min(axis=0)
    return HalfSpaces(each[0].normals, limits)
