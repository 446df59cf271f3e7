# SPDX-License-Identifier: GPL-3.0-or-later
"""Scene culling: the triangles that a viewing volume may meet; Embree need not build the others.

Certain, not sampled: a projector's pieces lie in the hull of their control points, and
these in the hulls of the control surfaces.
"""

from __future__ import annotations

from typing import NamedTuple, Self

import numpy as np
from numpy.typing import NDArray

from ...projection.surfaces.surface import BilinearPatch, Plane, Point
from ...projection.typing import Array, BoolArray
from ...projection.volume.viewing_volume import Projection, ViewingVolume
from ..common.geometry import Geometry
from ..common.parallel import chunks, parallel_map
from .half_spaces import HalfSpaces
from .integral_image import count_in_boxes, integral_image
from .projector_boxes import piece_bounds, piece_weights

# Cells along each axis of the box around the volume.
CELLS = 64

# Boxes are wider than their contents by this share of the volume, for rounding: control points are
# often float32 values, whose positions are no more precise.
SLACK = 1e-6


def within_volume(vertices: Array, triangles: NDArray[np.int32], volume: ViewingVolume) -> BoolArray:
    """Return whether each triangle may meet the volume, (T,); those with a NaN vertex may.

    vertices: (V, 3), in the volume's space. triangles: (T, 3).
    """
    points = np.asarray(vertices, np.float64).reshape(-1, 3)
    sides = flat_sides(volume)
    if sides is not None:
        return sides.met_by(points, triangles)
    grid = _Grid.around(volume)
    return np.ones(len(triangles), bool) if grid is None else grid.met_by(points, triangles)


def within_projection(geometry: Geometry, projection: Projection) -> BoolArray:
    """Return whether each triangle may meet the volume that shows it, (T,).

    That is the projection's or that of the triangle's layer. A layer with a halo shows triangles of layer 0,
    too.
    """

    def within(volume: ViewingVolume) -> BoolArray:
        """Return whether each triangle may meet a volume."""
        return within_volume(geometry.vertices, geometry.triangles, volume)

    kept, numbers = within(projection.volume), geometry.image_layer
    if numbers is None or not projection.layers:
        return kept
    kept &= numbers == 0
    for number, layer in enumerate(projection.layers, 1):
        own = numbers == number
        if layer.halo > 0.0 or layer.front == "ANCHOR":
            # The box around all of its things counts, whatever the volume can meet.
            kept |= own
        if layer.halo > 0.0:
            own |= numbers == 0
        kept |= own & within(layer.projection.volume)
    return kept


class _Grid(NamedTuple):
    """CELLS³ cells of a box around a volume, those marked that its projectors may pass.

    axes: (3, 3) and origin: (3,), so that axes @ p - origin are the coordinates of a point p in cells.
    sums: the integral image of the marked cells.
    """

    axes: Array
    origin: Array
    sums: NDArray[np.int32]

    @classmethod
    def around(cls, volume: ViewingVolume) -> Self | None:
        """The grid of a volume, None if it is not finite."""
        frame = _frame(volume)
        with np.errstate(invalid="ignore", over="ignore"):
            hulls = [frame @ surface.hull() for surface in volume.surfaces]
            if not all(np.isfinite(hull).all() for hull in hulls):
                return None
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
        return cls(frame * scale[:, None], lower * scale, integral_image(held))

    def met_by(self, points: Array, triangles: NDArray[np.int32]) -> BoolArray:
        """Return whether the box around each triangle's cells holds a marked one, (T,). points: (V, 3)."""
        cells, finite = np.empty((3, len(points)), np.int8), np.empty(len(points), bool)
        kept = np.empty(len(triangles), bool)

        def find_cells(some: slice) -> None:
            """The cells of a chunk of vertices; those outside are one cell beyond on either side."""
            with np.errstate(invalid="ignore", over="ignore"):
                places = np.einsum("ij,nj->in", self.axes, points[some])
                places -= self.origin[:, None]
                finite[some] = np.isfinite(places).all(axis=0)
                cells[:, some] = np.clip(np.floor(np.where(finite[some], places, 0.0)), -1, CELLS)

        def find_triangles(some: slice) -> None:
            """Return whether a chunk of triangles may meet the volume."""
            faces = triangles[some]
            corners = [cells.take(faces[:, k], 1) for k in range(3)]
            first = np.clip(np.minimum(np.minimum(*corners[:2]), corners[2]), 0, CELLS).astype(np.int32)
            last = np.maximum(np.maximum(*corners[:2]), corners[2]).astype(np.int32) + 1
            last = np.clip(last, 0, CELLS, out=last)
            kept[some] = count_in_boxes(self.sums, first, last) > 0
            kept[some] |= ~finite[faces].all(axis=1)

        parallel_map(find_cells, chunks(len(points)))
        parallel_map(find_triangles, chunks(len(triangles)))
        return kept


def flat_sides(volume: ViewingVolume) -> HalfSpaces | None:
    """A convex body closely around a volume of straight projectors between two flat surfaces, else None.

    Its planes are those of the sides of the volume, its ends, and a box along ``_frame``.
    """
    surfaces = volume.surfaces
    if len(surfaces) != 2 or any(type(surface) not in (Point, Plane, BilinearPatch) for surface in surfaces):
        return None
    around = np.array([0.0, 1.0, 1.0, 0.0]), np.array([0.0, 0.0, 1.0, 1.0])
    with np.errstate(invalid="ignore", over="ignore"):
        hull = np.concatenate([surface.hull() for surface in surfaces], axis=1)
        near, far = (surface.positions(*around).position for surface in surfaces)
        axes = _frame(volume)
        # Sides from the longer of their two edges: a surface may be a point.
        edges = np.stack([np.roll(end, -1, axis=1) - end for end in (near, far)])
        longer = edges[(edges**2).sum(axis=1).argmax(axis=0), :, np.arange(4)]
        sides = np.cross(longer, (far - near).T)
        # Outwards.
        sides *= np.sign(np.einsum("kc,kc->k", sides, ((near + far).T / 2) - hull.mean(axis=1)))[:, None]
        # Ends may be shifted sideways; that of a point is no plane and is left out.
        ends = np.cross(edges[:, :, 0], edges[:, :, 1])
        if not np.isfinite(hull).all() or not np.isfinite(sides).all():
            return None
        return HalfSpaces.around(np.concatenate([axes, -axes, sides, ends, -ends]), hull)


def _frame(volume: ViewingVolume) -> Array:
    """Axes (3, 3), rows, along which the volume is narrow: the far surface's width and height, and depth."""
    ends = np.array([0.0, 1.0, 0.5, 0.5, 0.5]), np.array([0.5, 0.5, 0.0, 1.0, 0.5])
    with np.errstate(invalid="ignore", over="ignore"):
        near, far = (volume.surfaces[k].positions(*ends).position for k in (0, -1))
        columns = np.stack([far[:, 1] - far[:, 0], far[:, 3] - far[:, 2], far[:, 4] - near[:, 4]])
        length = np.linalg.norm(columns, axis=1, keepdims=True)
        columns = columns / np.maximum(length, np.finfo(np.float64).tiny)
        if not np.isfinite(columns).all():
            return np.eye(3)
    # The nearest rotation; any will do if an axis vanishes.
    left, _, right = np.linalg.svd(columns)
    frame: Array = left @ right
    return frame
