# SPDX-License-Identifier: GPL-3.0-or-later
"""The parts of a scene that the layers of an image show, each with its bounds."""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from ...projection.typing import Array, BoolArray
from ...projection.volume.viewing_volume import ImageLayer, Projection, Projectors
from ..scene.cast_scene import CastScene
from .image_bounds import ImageBounds
from .seen_cells import SeenCells

# Unit normals of the slabs of hulls: along axes, edges' and corners' diagonals of a cube, in this order.
DIRECTIONS: Array = np.array(
    [
        step / np.linalg.norm(step)
        for step in sorted(
            (np.array(np.unravel_index(number, (3, 3, 3))) - 1.0 for number in range(14, 27)),
            key=np.linalg.norm,
        )
    ]
)
# Projectors that miss a slab are left out of the next tests if fewer than this share of them are left.
DENSE = 0.75
# Bounds are wider than their contents by this, cast space: sixteen roundings of float32.
SLACK = 2.0**-20


@dataclass(frozen=True)
class Box:
    """Bounds, (3,) each, in the space of what they hold."""

    lower: Array
    upper: Array

    @classmethod
    def around(cls, points: Array) -> Box:
        """The bounds of points (3, N), N > 0."""
        return cls(points.min(axis=1), points.max(axis=1))

    @property
    def corners(self) -> Array:
        """The corners, (3, 8)."""
        ends = np.stack([self.lower, self.upper])
        corners: Array = np.stack([each.ravel() for each in np.meshgrid(*ends.T)])
        return corners

    @property
    def middle(self) -> Array:
        """The middle, (3,)."""
        middle: Array = (self.lower + self.upper) / 2
        return middle

    def widened(self, around: float) -> Box:
        """The bounds of everything within ``around``."""
        return Box(self.lower - around, self.upper + around)

    def distance(self, positions: Array) -> Array:
        """Distances (N,) of positions (3, N), 0 inside."""
        off = np.maximum(self.lower[:, None] - positions, positions - self.upper[:, None])
        distance: Array = np.linalg.norm(np.maximum(off, 0.0), axis=0)
        return distance


@dataclass(frozen=True)
class Hull:
    """A polytope around triangles, in the space of these: slabs low <= DIRECTIONS @ p <= high, (K,) each."""

    low: Array
    high: Array

    @classmethod
    def around(cls, points: Array) -> Hull:
        """The hull of points (3, N), N > 0."""
        ends = [(heights.min(), heights.max()) for heights in (each @ points for each in DIRECTIONS)]
        return cls(*np.array(ends).T)

    def may_be_met(self, projection: Projection, x: Array, y: Array, around: float) -> BoolArray:
        """Return whether projectors through positions (N,) may meet the hull widened by ``around``, (N,)."""
        return self.met_by(projection.projectors(x, y), projection.volume.spans.is_straight, around)

    def met_by(self, projectors: Projectors, is_straight: bool, around: float) -> BoolArray:
        """Return whether N projectors may meet the hull widened by ``around``, (N,).

        Certain for misses: a projector lies in the hull of its control points.
        """
        points, exist = projectors
        which, met = np.flatnonzero(exist), np.zeros(len(exist), bool)
        points, enters, leaves = points.take(which, 2), np.zeros(len(which)), np.ones(len(which))
        is_met = np.ones(len(which), bool)
        with np.errstate(invalid="ignore", over="ignore", divide="ignore"):
            for direction, low, high in zip(DIRECTIONS, self.low - around, self.high + around, strict=True):
                slack = SLACK * float(np.abs(direction).sum())
                low, high = low - slack, high + slack
                heights = direction @ points
                is_met &= (heights.min(axis=0) <= high) & (heights.max(axis=0) >= low)
                if is_straight:
                    way = heights[1] - heights[0]
                    first, last = (low - heights[0]) / way, (high - heights[0]) / way
                    # A projector along a slab is decided by the comparison above.
                    first[way == 0.0], last[way == 0.0] = 0.0, 1.0
                    enters = np.maximum(enters, np.minimum(first, last))
                    leaves = np.minimum(leaves, np.maximum(first, last))
                    is_met &= enters <= leaves + SLACK
                if np.count_nonzero(is_met) < DENSE * len(which):
                    # Most projectors miss the first slabs: the others go on.
                    kept = np.flatnonzero(is_met)
                    which, points = which[kept], points.take(kept, 2)
                    enters, leaves = enters[kept], leaves[kept]
                    is_met = np.ones(len(which), bool)
        met[which[is_met]] = True
        return met


@dataclass(frozen=True)
class LayerPart:
    """The things of one layer, in cast space, with their bounds.

    scene: if ``has_surroundings``, also the triangles of layer 0 that may be near enough for the halo.
    bounds: of the layer in the image, None if they are not known. cells: of its parameters in which it can be
    met, None if they are not known or not needed.
    """

    scene: CastScene
    has_surroundings: bool
    box: Box
    hull: Hull
    bounds: ImageBounds | None
    cells: SeenCells | None

    def around(self, layer: ImageLayer) -> float:
        """The width around the things within which the layer shows surroundings, 0 without any."""
        return layer.halo if self.has_surroundings else 0.0

    def seen_by(self, layer: ImageLayer, points: Array | None = None) -> LayerPart:
        """The same things in the layer with its projection, in cast space.

        points: (3, N) whose hull holds all that it shows; the box's corners if not given.
        """
        shown, cells = self.box.widened(self.around(layer)), None
        bounds = ImageBounds.around(layer.projection, shown.corners if points is None else points)
        # Straight projectors need no grid of empty space, and making it takes longer than their hull's test.
        if bounds is None and not layer.projection.volume.spans.is_straight:
            cells = SeenCells.of(layer.projection, self.scene.occupancy, shown.lower, shown.upper)
        return replace(self, bounds=bounds, cells=cells)


@dataclass(frozen=True)
class LayerParts:
    """A scene cut into the parts of an image's layers.

    whole: all that projectors can hit. rest: the part of layer 0, None if it is empty. parts: of the layers
    from number 1 on; None for one without triangles. numbers: (T,) each triangle's layer.
    """

    whole: CastScene
    rest: CastScene | None
    parts: tuple[LayerPart | None, ...]
    numbers: NDArray[np.uint8]

    @classmethod
    def of(
        cls, numbers: NDArray[np.uint8] | None, cast_scene: CastScene, layers: tuple[ImageLayer, ...]
    ) -> LayerParts | None:
        """The parts of a scene that projectors can hit; None if no layer shows any of it.

        numbers: (T,) of each triangle's layer, None for 0. layers: in cast space.
        """
        if numbers is None or not layers:
            return None
        parts = tuple(_part(cast_scene, numbers, number, layer) for number, layer in enumerate(layers, 1))
        if not any(parts):
            return None
        return cls(cast_scene, cast_scene.only(numbers == 0), parts, numbers)

    def seen_by(self, layers: tuple[ImageLayer, ...]) -> LayerParts:
        """The same parts seen by other projections, in cast space, of the same layers."""
        parts = (part and part.seen_by(layer) for part, layer in zip(self.parts, layers, strict=True))
        return replace(self, parts=tuple(parts))


def _part(
    cast_scene: CastScene, numbers: NDArray[np.uint8], number: int, layer: ImageLayer
) -> LayerPart | None:
    own = (numbers == number) & cast_scene.usable
    if not own.any():
        return None
    points = cast_scene.points_of(own)
    box = Box.around(points)
    shown = box.widened(layer.halo)
    scene = cast_scene.enclosed(own | (numbers == 0) if layer.halo > 0.0 else own, shown.lower, shown.upper)
    if scene is None:
        return None
    has_surroundings = bool((scene.usable & (numbers == 0)).any())
    # Halos are distances from the box.
    hull = Hull.around(box.corners if has_surroundings else points)
    part = LayerPart(
        scene=scene, has_surroundings=has_surroundings, box=box, hull=hull, bounds=None, cells=None
    )
    return part.seen_by(layer, None if has_surroundings else points)
