# SPDX-License-Identifier: GPL-3.0-or-later
"""Shadow culling: triangles that cast no shadow on the visible part of the scene need not be built.

Conservative: whatever blocks light lies in the convex hull of the lamp and of the lit geometry.
"""

from __future__ import annotations

import numpy as np

from ...casting.common.geometry import Geometry
from ...casting.common.parallel import chunks
from ...casting.scene.cast_triangles import ORIGIN_OFFSET
from ...casting.scene.culling import flat_sides
from ...casting.scene.half_spaces import HalfSpaces, highest
from ...projection.typing import Array, BoolArray
from ...projection.volume.viewing_volume import ViewingVolume
from ..sampling.sample_sets import BALL_REACH
from ..scene.shading_scene import Light, Scene
from .ray_visibility import has_catchers

# Directions of bounding planes: multiples of 45° about a sun's direction; for other lamps axes and diagonals.
TURNS = np.arange(8) * (np.pi / 4)
DIAGONALS = np.array([[x, y, z] for x in (-1, 0, 1) for y in (-1, 0, 1) for z in (-1, 0, 1)], float)
DIAGONALS = DIAGONALS[(np.abs(DIAGONALS).sum(axis=1) != 2) & DIAGONALS.any(axis=1)]
# The most points of a volume's hull whose silhouette is searched, pair by pair.
MOST_POINTS = 64
# Rounding: the share of its size by which a silhouette's edge may miss points of the hull.
STRAIGHT = 1e-9
# Normals that differ by less than this, in radians, share one plane.
SAME_ANGLE = 1e-6
# Shadow rays start closer to their triangle than this share of the largest coordinate.
OFFSET = 4.0 * ORIGIN_OFFSET
# Culling ignores suns whose axes differ by more from a rotation's.
SKEW = 1e-3


def cull_shadow_casters(scene: Scene, shown: Geometry, volume: ViewingVolume) -> BoolArray:
    """Return whether each triangle (T,) of a scene may shade its part ``shown`` inside the volume."""
    whole = scene.geometry
    everything = np.ones(len(whole.triangles), bool)
    # A uniform environment casts shadows on catchers alone.
    if scene.world is not None or (has_catchers(whole) and np.any(scene.world_color)):
        return everything
    corners = np.ascontiguousarray(np.asarray(shown.vertices, np.float64).T)
    with np.errstate(invalid="ignore", over="ignore"):
        hull = np.concatenate([surface.hull() for surface in volume.surfaces], axis=1)
    if not (np.isfinite(corners).all() and np.isfinite(hull).all()):
        return everything
    # Projectors of other bases may leave the hull of their surfaces, so only the triangles bound their hits.
    bodies = [corners, hull] if volume.basis in ("BEZIER", "POLYLINE") else [corners]
    sides = flat_sides(volume)
    margin = OFFSET * float(np.abs(corners).max()) + _roundness(shown, corners)
    found = np.zeros(len(everything), bool)
    for light in scene.lights:
        if light.casts_shadow and np.any(light.color):
            between = _between(light, bodies, sides, margin, whole.vertices)
            if between is None:
                return everything
            found |= between.met_by(whole.vertices, whole.triangles)
    return found


def _roundness(shown: Geometry, vertices: Array) -> float:
    """The greatest distance between triangles and the rounded surface that smooth shading pretends.

    Shadow rays may start there. It is bounded by the distance of corners from the tangent planes at others.
    vertices: (3, V), of ``shown``.
    """
    most = 0.0
    if shown.corner_normals is None:
        return most
    for some in chunks(len(shown.triangles)):
        corners = [vertices.take(shown.triangles[some, k], axis=1, mode="clip") for k in range(3)]
        normals = shown.corner_normals[some, : 1 if shown.flat else 3].transpose(1, 2, 0)
        for own, normal in enumerate(np.ascontiguousarray(normals, np.float64)):
            high = [np.einsum("cn,cn->n", normal, corner) for corner in corners]
            off = [np.abs(high[k] - high[own]) for k in range(3) if k != own]
            if shown.flat:
                off.append(np.abs(high[2] - high[1]))
            most = max(most, *(float(each.max()) for each in off))
    return most


def _between(
    light: Light, bodies: list[Array], sides: HalfSpaces | None, margin: float, vertices: Array
) -> HalfSpaces | None:
    """Half-spaces that hold everything between a lamp and the common part of the bodies, (3, N) each.

    margin: widens them. sides: more half-spaces of the common part. None if nothing bounds it.
    """
    matrix = np.asarray(light.matrix, np.float64)
    if not np.isfinite(matrix).all():
        return None
    if light.kind == "SUN":
        axes = matrix[:3, :3]
        if np.abs(axes.T @ axes - np.eye(3)).max() > SKEW:
            return None
        lit = _beneath(axes, bodies, sides)
        if light.angle:
            towards = axes[:, 2] / np.linalg.norm(axes[:, 2])
            with np.errstate(invalid="ignore", over="ignore"):
                top = float(highest(towards[None], vertices.T)[0])
            if not np.isfinite(top):
                return None
            # The light of a sun of some size is inclined: the higher its blockers, the wider the hull.
            height = max(top + lit.limits[len(TURNS)], 0.0)
            # Blender's largest angle, π as a float32, is more than half a turn.
            lit.limits[:] += height * (1.0 + 4.0 * SKEW) * np.tan(min(light.angle, np.pi) / 2)
    else:
        lit = _common(DIAGONALS, bodies)
        if sides is not None:
            lit = lit.with_planes_of(sides)
        size = light.radius * BALL_REACH
        if light.kind == "AREA":
            size = 0.5 * float(np.linalg.norm(matrix[:3, :2] * np.asarray(light.size), axis=0).sum())
        lit.limits[:] = np.maximum(lit.limits, lit.normals @ matrix[:3, 3] + size)
    lit.limits[:] += margin
    return lit


def _beneath(axes: Array, bodies: list[Array], sides: HalfSpaces | None) -> HalfSpaces:
    """Half-spaces that hold everything between the common part of the bodies and a sun.

    axes: (3, 3), the sun's; it shines along -Z. The planes of TURNS come first, then the one that faces away
    from the sun.
    """
    towards = axes[:, 2]
    x, y = np.linalg.qr(axes[:, ::-1])[0][:, 1:].T
    around = np.outer(np.cos(TURNS), x) + np.outer(np.sin(TURNS), y)
    lit = _common(np.concatenate([around, -towards[None]]), bodies)
    body = bodies[-1]
    if body.shape[1] <= MOST_POINTS:
        lit = lit.with_planes_of(HalfSpaces.around(_silhouette(body, x, y), body))
    if sides is not None:
        # Towards a sun behind a plane everything stays behind that plane.
        away = sides.normals @ towards <= 0.0
        lit = lit.with_planes_of(HalfSpaces(sides.normals[away], sides.limits[away]))
    return lit


def _silhouette(points: Array, x: Array, y: Array) -> Array:
    """Normals (K, 3) of the outline of points (3, N) on the plane of two unit axes (3,)."""
    flat = np.stack([x @ points, y @ points])
    ways = flat[:, None] - flat[:, :, None]
    length = np.hypot(*ways)
    slack = STRAIGHT * length.max()
    first, second = np.nonzero(length > slack)
    turned = np.stack([ways[1], -ways[0]])[:, first, second] / length[first, second]
    own = np.einsum("cn,cn->n", turned, flat[:, first])
    turned = turned[:, (turned.T @ flat).max(axis=1) <= own + slack]
    angle = np.arctan2(turned[1], turned[0])
    order = angle.argsort()
    # One of the edges in a line; np.unique would first import masked arrays.
    once = order[np.diff(angle[order], prepend=-np.inf) > SAME_ANGLE]
    normals: Array = turned[:, once].T @ np.stack([x, y])
    return normals


def _common(normals: Array, bodies: list[Array]) -> HalfSpaces:
    """Half-spaces of given normals that hold the common part of the bodies."""
    each = [HalfSpaces.around(normals, body) for body in bodies]
    limits: Array = np.stack([one.limits for one in each]).min(axis=0)
    return HalfSpaces(each[0].normals, limits)
