# SPDX-License-Identifier: GPL-3.0-or-later
"""Straight projectors: one Embree ray each, then t solved in float64."""

from __future__ import annotations

import numpy as np

from ..projection.typing import Array, BoolArray, Float32Array, IndexArray
from .common.hits import CastCounts, Hits
from .scene.cast_scene import CastScene

# Rays extend this share past t = 1, so that float32 cannot lose a hit just before
# it; hits that the float64 solve then finds past 1 are dropped.
END_SLACK = 1e-6

# Rays are turned by this share of their length, eight float32 roundings or a thousandth of a pixel: Embree
# loses some of those that pass exactly through a vertex, which a symmetric camera aims at (1,436 of 230,400
# on a grid, of those turned by one rounding 43 on a sphere, by eight none).
OFF_VERTICES = (2.0**-20 * np.array([1.0, 0.7, 0.4])).astype(np.float32)

# A float64 solution this far from [0, 1] means a triangle seen edge-on, whose
# plane determines nothing; Embree's own distance is kept then.
EDGE_ON = 1e-4


# Rays that are far out begin this far before the scene's bounds, in cast units.
BORDER = 1e-3


def entry(start: Array, way: Array, lower: Array, upper: Array) -> Array:
    """The shares (N,) of way (3, N) at which segments from start enter a box (3,), BORDER before it.

    0 if they begin inside. Where they miss the box, any number from 0 to 2.
    """
    with np.errstate(divide="ignore", invalid="ignore", over="ignore"):
        inverse = 1.0 / way
        sides = np.fmin(
            (lower[:, None] - BORDER - start) * inverse, (upper[:, None] + BORDER - start) * inverse
        )
        share: Array = np.clip(np.nan_to_num(sides, nan=0.0).max(axis=0), 0.0, 2.0)
    return share


def turn_off_vertices(directions: Float32Array) -> None:
    """Turn rays' directions (3, N) by a little, in place."""
    # NumPy takes twice as long to reduce so short an axis.
    sides = np.abs(directions)
    longest = np.maximum(np.maximum(sides[0], sides[1]), sides[2])
    for axis, share in zip(directions, OFF_VERTICES, strict=True):
        axis += share * longest


def _float32_rays(
    start: Array, way: Array, mask: BoolArray, skipped: Array | None
) -> tuple[Float32Array, Float32Array, Float32Array]:
    """Origins and directions (3, N) and limits (N,) of rays along the segments from start to start + way.

    start, way: (3, N), cast space. mask: (N,), other rays are switched off. skipped: (N,) the shares of the
    segments before the rays' origins, None for 0.
    """
    limits = np.full(len(mask), 1.0 + END_SLACK, np.float32)
    if skipped is not None:
        start = start + way * skipped
        # A ray that is switched off for passing the scene by has a negative limit.
        limits -= skipped.astype(np.float32)
    origins, directions = start.astype(np.float32), way.astype(np.float32)
    turn_off_vertices(directions)
    if not mask.all():
        limits[~mask] = -1.0
    return origins, directions, limits


def _plane_shares(
    scene: CastScene, triangle: IndexArray, start: Array, way: Array
) -> tuple[Array, IndexArray]:
    """Intersections t (N,) of segments from start to start + way, (3, N), with the planes of triangles (N,).

    Also the numbers of the segments that see their triangle edge-on, whose t is useless. The triangle -1
    means the last one.
    """
    plane = scene.planes.take(triangle, 1, mode="wrap")
    height = np.einsum("cn,cn->n", plane[:3], start)
    height += plane[3]
    slope = np.einsum("cn,cn->n", plane[:3], way)
    with np.errstate(divide="ignore", invalid="ignore", over="ignore"):
        t = np.divide(height, slope, out=height)
        np.negative(t, out=t)
        return t, np.flatnonzero(~((t > -EDGE_ON) & (t < 1.0 + EDGE_ON)))


def cast_straight(
    scene: CastScene, points: Array, mask: BoolArray, far: bool, counts: CastCounts, weighted: bool = True
) -> Hits:
    """Cast the segments from points[0] to points[1].

    points: (2, 3, N) finite, cast space. mask: (N,). far: whether points are so far out that rays should
    begin at the scene's bounds. weighted: whether barycentric weights are needed; otherwise they are 0.
    """
    start, way = points[0], points[1] - points[0]
    skipped = entry(start, way, scene.lower, scene.upper) if far else None
    origins, directions, limits = _float32_rays(start, way, mask, skipped)
    found = scene.mesh.trace(origins, directions, limits)
    count = int(np.count_nonzero(mask))
    counts.projectors, counts.rays = counts.projectors + count, counts.rays + count
    counts.chords += count

    # A miss gets the values of the last triangle, which are overwritten below.
    t, lost = _plane_shares(scene, found, start, way)
    hit = found >= 0
    lost = lost[hit[lost]]
    if len(lost):
        share = scene.mesh.trace_distance(origins[:, lost], directions[:, lost], limits[lost])
        t[lost] = np.minimum(share if skipped is None else share + skipped[lost], 1.0)
        counts.unresolved += len(lost)
    hit &= t <= 1.0
    place = np.maximum(np.where(hit, t, 1.0), 0.0)
    position = start + way * place
    barycentric = scene.barycentric(position, found) if weighted else np.zeros((2, len(mask)))
    if not hit.all():
        barycentric *= hit
        found = np.where(hit, found, np.int32(-1))
        t = np.where(hit, place, np.inf)
    else:
        t = place
    if not mask.all():
        position *= mask
        way *= mask
    return Hits(t=t, triangle=found, barycentric=barycentric, position=position, tangent=way, mask=mask)
