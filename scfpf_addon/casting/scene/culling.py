# SPDX-License-Identifier: GPL-3.0-or-later
"""Which triangles a viewing volume can meet: the others need not be built to cast at.

Certain, not sampled: a projector's pieces lie in the hull of their control points, and
all control points of one place in the list in the hull of their control surface.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from ...projection.surfaces.surface import BilinearPatch, Plane, Point
from ...projection.typing import Array, BoolArray
from ...projection.volume.viewing_volume import ViewingVolume
from ..common.parallel import chunks, parallel_map
from .half_spaces import HalfSpaces
from .projector_boxes import piece_bounds, piece_weights

# Cells along each axis of the box round the volume.
CELLS = 64

# Boxes are wider than what they hold by this share of the volume, for rounding: control points are
# often float32 values, whose places are not known any better.
SLACK = 1e-6


def within_volume(vertices: Array, triangles: NDArray[np.int32], volume: ViewingVolume) -> BoolArray:
    """Whether each triangle may meet the volume, (T,); those with a vertex that is NaN too.

    vertices: (V, 3), in the volume's space. triangles: (T, 3).
    """
    sides = flat_sides(volume)
    if sides is not None:
        return sides.met_by(np.asarray(vertices, np.float64).reshape(-1, 3), triangles)
    frame = _frame(volume)
    with np.errstate(invalid="ignore", over="ignore"):
        hulls = [frame @ surface.hull() for surface in volume.surfaces]
        if not all(np.isfinite(hull).all() for hull in hulls):
            return np.ones(len(triangles), bool)
        least = np.stack([hull.min(axis=1) for hull in hulls])[:, :, None]
        most = np.stack([hull.max(axis=1) for hull in hulls])[:, :, None]
        low, high = (bound[:, :, 0].T for bound in piece_bounds(piece_weights(volume.spans), least, most))
    lower, upper = low.min(axis=0), high.max(axis=0)
    slack = SLACK * float(max(np.abs(lower).max(), np.abs(upper).max(), np.finfo(np.float64).tiny))
    lower, upper = lower - 2.0 * slack, upper + 2.0 * slack
    scale = CELLS / (upper - lower)
    held = np.zeros((CELLS,) * 3, bool)
    for first, last in zip(
        np.floor((low - slack - lower) * scale).astype(np.intp),
        np.floor((high + slack - lower) * scale).astype(np.intp) + 1,
        strict=True,
    ):
        held[tuple(slice(max(a, 0), b) for a, b in zip(first, last, strict=True))] = True
    sums = np.zeros((CELLS + 1,) * 3, np.int32)
    sums[1:, 1:, 1:] = held
    for axis in range(3):
        np.cumsum(sums, axis=axis, out=sums)
    points = np.asarray(vertices, np.float64).reshape(-1, 3)
    cells, finite = np.empty((3, len(points)), np.int8), np.empty(len(points), bool)
    kept = np.empty(len(triangles), bool)

    def find_cells(some: slice) -> None:
        """The cells that vertices are in."""
        with np.errstate(invalid="ignore", over="ignore"):
            places = np.einsum("ij,nj->in", frame * scale[:, None], points[some])
            places -= (lower * scale)[:, None]
            finite[some] = np.isfinite(places).all(axis=0)
            # Outside is one cell beyond on either side.
            cells[:, some] = np.clip(np.floor(np.where(finite[some], places, 0.0)), -1, CELLS)

    def look_at_triangles(some: slice) -> None:
        """Whether the box round a triangle's cells holds anything."""
        faces = triangles[some]
        kept[some] = _held_between(sums, *(cells.take(faces[:, k], 1) for k in range(3)))
        kept[some] |= ~finite[faces].all(axis=1)

    parallel_map(find_cells, chunks(len(points)))
    parallel_map(look_at_triangles, chunks(len(triangles)))
    return kept


def _held_between(sums: NDArray[np.int32], *corners: NDArray[np.int8]) -> BoolArray:
    """Whether anything is held in the boxes round three cells each, (3, n). sums: the integral image."""
    first = np.clip(np.minimum(np.minimum(*corners[:2]), corners[2]), 0, CELLS).astype(np.int32)
    last = np.maximum(np.maximum(*corners[:2]), corners[2]).astype(np.int32) + 1
    last = np.clip(last, 0, CELLS, out=last)
    row, plane, flat = CELLS + 1, (CELLS + 1) ** 2, sums.ravel()
    count = np.zeros(first.shape[1], np.int32)
    for z, sign in ((last[2], 1), (first[2], -1)):
        for y, turned in ((last[1], sign), (first[1], -sign)):
            for x, again in ((last[0], turned), (first[0], -turned)):
                count += again * flat[x * plane + y * row + z]
    held: BoolArray = count > 0
    return held


def flat_sides(volume: ViewingVolume) -> HalfSpaces | None:
    """A body round a volume of straight projectors between two flat surfaces, close to it; None for others.

    Its planes hold the sides of the volume, its ends, and a box along ``_frame``.
    """
    surfaces = volume.surfaces
    if len(surfaces) != 2 or any(type(surface) not in (Point, Plane, BilinearPatch) for surface in surfaces):
        return None
    around = np.array([0.0, 1.0, 1.0, 0.0]), np.array([0.0, 0.0, 1.0, 1.0])
    with np.errstate(invalid="ignore", over="ignore"):
        hull = np.concatenate([surface.hull() for surface in surfaces], axis=1)
        near, far = (surface.positions(*around).position for surface in surfaces)
        axes = _frame(volume)
        # Sides by the longer of their two edges: a surface may be a point.
        edges = np.stack([np.roll(end, -1, axis=1) - end for end in (near, far)])
        longer = edges[(edges**2).sum(axis=1).argmax(axis=0), :, np.arange(4)]
        sides = np.cross(longer, (far - near).T)
        # Outwards.
        sides *= np.sign(np.einsum("kc,kc->k", sides, ((near + far).T / 2) - hull.mean(axis=1)))[:, None]
        # Surfaces may be shifted sideways; of a point there is none.
        ends = np.cross(edges[:, :, 0], edges[:, :, 1])
        if not np.isfinite(hull).all() or not np.isfinite(sides).all():
            return None
        return HalfSpaces.around(np.concatenate([axes, -axes, sides, ends, -ends]), hull)


def _frame(volume: ViewingVolume) -> Array:
    """Axes (3, 3), rows, along which the volume is narrow: far surface's width and height, and depth."""
    ends = np.array([0.0, 1.0, 0.5, 0.5, 0.5]), np.array([0.5, 0.5, 0.0, 1.0, 0.5])
    with np.errstate(invalid="ignore", over="ignore"):
        near, far = (volume.surfaces[k].positions(*ends).position for k in (0, -1))
        columns = np.stack([far[:, 1] - far[:, 0], far[:, 3] - far[:, 2], far[:, 4] - near[:, 4]])
        length = np.linalg.norm(columns, axis=1, keepdims=True)
        columns = columns / np.maximum(length, np.finfo(np.float64).tiny)
        if not np.isfinite(columns).all():
            return np.eye(3)
    # The nearest rotation; where an axis vanishes any will do.
    left, _, right = np.linalg.svd(columns)
    frame: Array = left @ right
    return frame
