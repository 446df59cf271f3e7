# SPDX-License-Identifier: GPL-3.0-or-later
"""Empty space before the first thing, for whole blocks of pixels at once.

The space is cut into cells; those that hold a prism, and all next to them, are the
hull. One coarse chord line in the middle of a block of projectors stands for all
of them, as long as they stay closer to it than a cell: until it enters the hull,
none of them meets anything.
"""

from __future__ import annotations

from itertools import product
from typing import Any

import numpy as np
from numpy.typing import NDArray

from ..projection.basis import SpanBasis
from ..projection.typing import Array, BoolArray
from .certify import Chords, certain_chords
from .prisms import Float32Array, Prisms

# Cells along the longest side of the scene.
CELLS = 96

# Triangles are cut in four until each covers at most this many cells along any axis.
MOST_COVERED = 2

# Pixels in a block, along and across.
BLOCK = 8

# The chord line of a block may leave its curve by this share of a cell.
COARSE_SHARE = 0.2

# Chords overlap by this share, or float32 might lose what lies where two meet.
OVERLAP = 1e-4

# float32 rounding of a chord's end, as a share of its largest coordinate.
ROUNDING = 2.0**-21


class Hull:
    """The cells around all prisms, and their surface in Embree.

    lower: (3,) corner of the grid; cell: side of a cell, cast units. holding: (X, Y, Z),
    cells with a prism in them; filled: these and their neighbours.
    """

    def __init__(self, prisms: Prisms, scenes: Any, meshes: Any) -> None:
        corners = prisms.corners[np.ptp(prisms.corners, axis=1).any(axis=1)]
        lower, upper = corners.min(axis=(0, 1)), corners.max(axis=(0, 1))
        self.cell = float((upper - lower).max()) / CELLS
        # Two cells of border: one for the hull, one that is empty.
        self.lower: Array = lower.astype(np.float64) - 2.0 * self.cell
        shape = np.floor((upper - self.lower) / self.cell).astype(np.intp) + 3
        filled = np.zeros(shape, bool)
        self._fill(filled, corners, 2.0 * prisms.thickness)
        self.holding: BoolArray = filled
        for axis in range(3):
            wide = filled.copy()
            first, last = [slice(None)] * 3, [slice(None)] * 3
            first[axis], last[axis] = slice(1, None), slice(None, -1)
            wide[tuple(first)] |= filled[tuple(last)]
            wide[tuple(last)] |= filled[tuple(first)]
            filled = wide
        self.filled: BoolArray = filled
        self._embree = scenes.EmbreeScene(robust=True)
        vertices, faces = self._surface()
        self._mesh = meshes.TriangleMesh(self._embree, vertices, faces)
        self._run(np.zeros((3, 1)), np.zeros((3, 1)))

    def _fill(self, filled: BoolArray, corners: Float32Array, thickness: float) -> None:
        """Mark the cells of the prisms' bounds, of large ones piece by piece."""
        small, large = [], corners[:, :3].astype(np.float64)
        while len(large):
            size = np.ptp(large, axis=1).max(axis=1)
            small.append(large[size <= MOST_COVERED * self.cell])
            a, b, c = large[size > MOST_COVERED * self.cell].transpose(1, 0, 2)
            ab, bc, ca = 0.5 * (a + b), 0.5 * (b + c), 0.5 * (c + a)
            pieces = ((a, ab, ca), (ab, b, bc), (ca, bc, c), (ab, bc, ca))
            large = np.concatenate([np.stack(piece, axis=1) for piece in pieces])
        flat = np.concatenate(small)
        first = np.floor((flat.min(axis=1) - thickness - self.lower) / self.cell).astype(np.intp)
        last = np.floor((flat.max(axis=1) + thickness - self.lower) / self.cell).astype(np.intp)
        most = np.array(filled.shape) - 1
        first, last = np.clip(first, 0, most), np.clip(last, 0, most)
        for step in product(*(range(n + 1) for n in (last - first).max(axis=0))):
            cells = first + np.array(step)
            x, y, z = cells[(cells <= last).all(axis=1)].T
            filled[x, y, z] = True

    def _surface(self) -> tuple[Float32Array, NDArray[np.int32]]:
        """Two triangles for every face between a filled and an empty cell."""
        quads = []
        for axis in range(3):
            step = [0, 0, 0]
            step[axis] = 1
            place = np.argwhere(np.diff(self.filled, axis=axis)) + np.array(step)
            one, other = np.zeros(3, np.intp), np.zeros(3, np.intp)
            one[(axis + 1) % 3], other[(axis + 2) % 3] = 1, 1
            quads.append(place[:, None] + np.stack([0 * one, one, one + other, other]))
        corners = np.concatenate(quads)
        vertices = (self.lower + self.cell * corners.reshape(-1, 3)).astype(np.float32)
        base = 4 * np.arange(len(corners), dtype=np.int32)[:, None, None]
        faces = base + np.array([[0, 1, 2], [0, 2, 3]], np.int32)
        return vertices, faces.reshape(-1, 3)

    def contains(self, points: Array, cells: BoolArray) -> BoolArray:
        """Whether points (3, N) lie in one of the cells, ``filled`` or ``holding``."""
        number = np.floor((points - self.lower[:, None]) / self.cell)
        within = ((number >= 0) & (number < np.array(cells.shape)[:, None])).all(axis=0)
        x, y, z = np.where(within, number, 0).astype(np.intp)
        inside: BoolArray = within & cells[x, y, z]
        return inside

    def _run(self, start: Array, way: Array) -> tuple[NDArray[np.int32], Float32Array]:
        limits = np.full(start.shape[1], 1.0 + OVERLAP, np.float32)
        found = self._embree.run(start.T.astype(np.float32), way.T.astype(np.float32), limits, output=True)
        return found["primID"], found["tfar"]

    def empty_until(
        self,
        spans: SpanBasis,
        points: Array,
        columns: int,
        last: float,
        box: tuple[Array, Array],
        apart: float,
    ) -> Array:
        """The t (N,) before which projectors stay ``apart`` from all prisms.

        points: (K, 3, N), rows of ``columns`` pixels. last: t of those that always do.
        box: lower and upper corner of the box that holds the prisms.
        """
        grid = points.reshape(*points.shape[:2], -1, columns)
        rows, across = np.arange(0, grid.shape[2], BLOCK), np.arange(0, columns, BLOCK)
        low = np.minimum.reduceat(np.minimum.reduceat(grid, rows, axis=2), across, axis=3)
        high = np.maximum.reduceat(np.maximum.reduceat(grid, rows, axis=2), across, axis=3)
        low, high = low.reshape(*low.shape[:2], -1), high.reshape(*high.shape[:2], -1)
        middle, radius = 0.5 * (low + high), 0.5 * np.sqrt(((high - low) ** 2).sum(axis=1))
        line, certain = certain_chords(spans, points, *box, COARSE_SHARE * self.cell)
        until = np.full(middle.shape[2], last)
        if line is not None:
            self._follow(line, middle, radius, until, certain + apart)
        blocks = until.reshape(len(rows), len(across))
        spread: Array = np.repeat(np.repeat(blocks, BLOCK, axis=0)[: grid.shape[2]], BLOCK, axis=1)
        return spread[:, :columns].ravel()

    def _follow(self, line: Chords, middle: Array, radius: Array, until: Array, apart: float) -> None:
        """Lower ``until`` (B,) to where the lines of the blocks enter the hull or become too wide."""
        going = np.arange(middle.shape[2])
        start = np.einsum("k,kcn->cn", line.ends[0], middle)
        wide = self._width(line.ends[0], radius, start) + apart > self.cell
        bad = wide | self.contains(start, self.filled)
        until[bad] = line.breaks[0]
        going, start = going[~bad], start[:, ~bad]
        for chord, weights in enumerate(line.ends[1:]):
            if len(going) == 0:
                break
            end = np.einsum("k,kcn->cn", weights, middle[:, :, going])
            found, far = self._run(start, end - start)
            low, high = line.breaks[chord], line.breaks[chord + 1]
            # Inside without having come in: float32 has lost the way in.
            lost = (found < 0) & self.contains(end, self.filled)
            lost |= self._width(weights, radius[:, going], end) + apart > self.cell
            until[going[lost]] = low
            met = (found >= 0) & ~lost
            until[going[met]] = low + np.minimum(far[met], 1.0) * (high - low)
            on = np.flatnonzero(~lost & (found < 0))
            going, start = going[on], end[:, on]

    @staticmethod
    def _width(weights: Array, radius: Array, at: Array) -> Array:
        """How far the projectors of blocks may be from their middles, and float32 from these."""
        width: Array = np.abs(weights) @ radius + ROUNDING * (1.0 + np.abs(at).max(axis=0))
        return width
