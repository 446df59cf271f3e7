# SPDX-License-Identifier: GPL-3.0-or-later
"""Free-form deformation by a lattice of points, as Blender's Lattice modifier does it (paper §4.1).

The modifier moves a point p of the lattice's box to p + Σ Ni(u) Nj(v) Nk(w) Dijk, where D are the
displacements of the lattice points. N are uniform cubics or straight pieces; the outer points stand for those
beyond the border. Our u and v are the lattice's U and V. Our t runs against its W: a lattice that is turned
as the camera is has its near side at +Z.
"""

from __future__ import annotations

from dataclasses import dataclass, field
from functools import cached_property
from typing import Literal

import numpy as np

from ..arrays import BLOCK, evaluate_pieces
from ..surfaces.surface import ControlSurface, SurfacePositions, SurfaceSample
from ..typing import Array, IndexArray
from .basis import SpanBasis, span_basis
from .viewing_volume import ViewingVolume

Interpolation = Literal["LINEAR", "CARDINAL", "CATMULL_ROM", "BSPLINE"]

# How tight Blender's two interpolating splines are.
_TENSIONS = {"CARDINAL": 0.71, "CATMULL_ROM": 0.5}
# Where a cubic lattice gets one surface more, the nearest to its near end: see ``_nodes``.
_EXTRA_SHARE = 0.25


def _powers(kind: Interpolation) -> Array:
    """Weights of the lattice points about a cell, as polynomials of the place in it.

    (4, 4): rows are the points -1, 0, 1, 2 from the cell's start, columns the powers 0 to 3.
    """
    if kind == "LINEAR":
        return np.array([[0.0, 0, 0, 0], [1, -1, 0, 0], [0, 1, 0, 0], [0, 0, 0, 0]])
    if kind == "BSPLINE":
        return np.array([[1.0, -3, 3, -1], [4, 0, -6, 3], [1, 3, 3, -3], [0, 0, 0, 1]]) / 6
    f = _TENSIONS[kind]
    return np.array([[0, -f, 2 * f, -f], [1, 0, f - 3, 2 - f], [0, f, 3 - 2 * f, f - 2], [0, 0, -f, f]])


# Bézier control values, rows, of the powers 1, s, s², s³.
_BEZIER_OF_POWERS = np.array([[1, 0, 0, 0], [1, 1 / 3, 0, 0], [1, 2 / 3, 1 / 3, 0], [1, 1, 1, 1]])


def _places(cell: IndexArray, count: int) -> IndexArray:
    """The points that act in cells, (4, N): at the border the outer one again."""
    places: IndexArray = np.clip(cell + np.arange(-1, 3)[:, None], 0, count - 1)
    return places


@dataclass(frozen=True)
class LatticeLayer(ControlSurface):
    """A layer of a lattice: a rectangle and the displacements of its points.

    corner: (3,), where (u, v) = (0, 0) is at rest. extent: (2,), its size along X
    and Y. moved: (rows, columns, 3), rows along v, at least 2 × 2.
    """

    corner: Array = field(default_factory=lambda: np.array([-0.5, -0.5, 0.0]))
    extent: Array = field(default_factory=lambda: np.ones(2))
    moved: Array = field(default_factory=lambda: np.zeros((2, 2, 3)))
    along_u: Interpolation = "BSPLINE"
    along_v: Interpolation = "BSPLINE"

    def __post_init__(self) -> None:
        shape = np.shape(self.moved)
        if len(shape) != 3 or shape[2] != 3 or min(shape[:2]) < 2:
            raise ValueError(f"a lattice layer needs at least 2 × 2 points, got shape {shape}")

    @cached_property
    def _patches(self) -> Array:
        """Polynomials of each cell by u and v within it, (4, 4, 3, cells): powers of v, of u, component."""
        rows, columns = np.shape(self.moved)[:2]
        at_row = _places(np.arange(rows - 1), rows)
        at_column = _places(np.arange(columns - 1), columns)
        around = np.asarray(self.moved, np.float64)[at_row[:, None, :, None], at_column[None, :, None, :]]
        up, across = _powers(self.along_v), _powers(self.along_u)
        patches = np.einsum("rp,cq,rcyxk->pqkyx", up, across, around, optimize=True)
        return np.ascontiguousarray(patches.reshape(4, 4, 3, -1))

    def _cell(self, u: Array, v: Array) -> tuple[IndexArray, Array, Array]:
        rows, columns = np.shape(self.moved)[:2]
        across, up = u * (columns - 1), v * (rows - 1)
        column = np.clip(np.floor(across), 0, columns - 2)
        row = np.clip(np.floor(up), 0, rows - 2)
        return (row * (columns - 1) + column).astype(np.int64), across - column, up - row

    @cached_property
    def _bezier(self) -> Array:
        """Bézier control values of the displacements in each cell, (4, 4, 3, cells), along v, along u."""
        bezier: Array = np.einsum("ip,jq,pqxk->ijxk", _BEZIER_OF_POWERS, _BEZIER_OF_POWERS, self._patches)
        return bezier

    @property
    def bends(self) -> tuple[float, float]:
        """The bends: second derivatives are Bézier, of second differences."""
        rows, columns = np.shape(self.moved)[:2]
        by_v, by_u = (
            6.0 * (count - 1) ** 2 * float(np.linalg.norm(np.diff(self._bezier, 2, axis), axis=2).max())
            for axis, count in ((0, rows), (1, columns))
        )
        return by_u, by_v

    @property
    def creases(self) -> tuple[Array, Array]:
        rows, columns = np.shape(self.moved)[:2]
        return np.linspace(0.0, 1.0, columns), np.linspace(0.0, 1.0, rows)

    def local_hull(self) -> Array:
        bezier = self._bezier
        rest = self._rest(*(a.ravel() for a in np.meshgrid([0.0, 1.0], [0.0, 1.0])))
        # What the points are moved by anywhere, from anywhere in the rectangle.
        moved = bezier.transpose(2, 0, 1, 3).reshape(3, -1)
        ends = np.stack([moved.min(axis=1), moved.max(axis=1)])
        corners = np.stack(np.meshgrid(*ends.T)).reshape(3, -1)
        hull: Array = (rest[:, :, None] + corners[:, None]).reshape(3, -1)
        return hull

    def local_position(self, u: Array, v: Array) -> SurfacePositions:
        """The positions, computed for a block of points at a time."""
        position = self._rest(u, v)
        table = self._patches[: self._degree_v + 1, : self._degree_u + 1]
        moved = np.empty((3, min(len(u), BLOCK)))
        for start in range(0, len(u), BLOCK):
            part = slice(start, start + BLOCK)
            cell, a, b = self._cell(u[part], v[part])
            evaluate_pieces(table, cell, a, b, moved[:, : len(cell)])
            position[:, part] += moved[:, : len(cell)]
        return SurfacePositions(position, np.ones(len(u), bool))

    def local(self, u: Array, v: Array) -> SurfaceSample:
        cell, a, b = self._cell(u, v)
        rows, columns = np.shape(self.moved)[:2]
        position = self._rest(u, v)
        du, dv = np.zeros_like(position), np.zeros_like(position)
        du[0], dv[1] = self.extent
        for component in range(3):
            powers = range(self._degree_u + 1)
            by_u = [self._along_v(cell, b, power, component) for power in powers]
            slopes = [self._along_v(cell, b, power, component, True) for power in powers]
            position[component] += _horner(by_u, a)
            du[component] += (columns - 1) * _horner([p * c for p, c in enumerate(by_u)][1:], a)
            dv[component] += (rows - 1) * _horner(slopes, a)
        return self._whole(position, du, dv)

    @property
    def _degree_u(self) -> int:
        return 1 if self.along_u == "LINEAR" else 3

    @property
    def _degree_v(self) -> int:
        return 1 if self.along_v == "LINEAR" else 3

    def _rest(self, u: Array, v: Array) -> Array:
        position = np.empty((3, len(u)))
        position[0] = self.corner[0] + u * self.extent[0]
        position[1] = self.corner[1] + v * self.extent[1]
        position[2] = self.corner[2]
        return position

    def _along_v(self, cell: IndexArray, b: Array, power: int, component: int, slope: bool = False) -> Array:
        """The coefficient of a power of u in each cell, (N,), at b, or its derivative by b."""
        flat = self._patches[: self._degree_v + 1, power, component]
        if slope:
            return _horner([p * row.take(cell) for p, row in enumerate(flat)][1:], b)
        return _horner([row.take(cell) for row in flat], b)


def _horner(coefficients: list[Array], x: Array) -> Array:
    total = coefficients[-1]
    for coefficient in coefficients[-2::-1]:
        total = total * x + coefficient
    return total


@dataclass(frozen=True)
class Lattice:
    """A lattice as its modifier sees it, own space.

    low, high: (3,), the box at rest. moved: (W, V, U, 3), how far each point has been moved,
    along U and V at least 2. kinds: the interpolation along U, V and W.
    """

    low: Array
    high: Array
    moved: Array
    kinds: tuple[Interpolation, Interpolation, Interpolation]

    @classmethod
    def through(cls, points: Array, kinds: tuple[Interpolation, Interpolation, Interpolation]) -> Lattice:
        """The lattice over the unit cube about the origin that takes its points at rest to ``points``.

        points: (W, V, U, 3), at least 2 along each. B-splines do not pass through the lattice's own points.
        """
        shape = points.shape[:3]
        rest = np.meshgrid(*(np.linspace(-0.5, 0.5, count) for count in shape), indexing="ij")
        moved = points - np.stack(rest[::-1], axis=-1)
        for axis, (count, kind) in enumerate(zip(shape, kinds[::-1], strict=True)):
            even = np.linspace(0.0, 1.0, count)
            at_points = _functions(kind, count).weights(even)[0][:count].T
            along = np.tensordot(np.linalg.inv(at_points), moved, (1, axis))
            moved = np.moveaxis(along, 0, axis)
        return cls(np.full(3, -0.5), np.full(3, 0.5), moved, kinds)

    @property
    def points(self) -> Array:
        """The places of the moved points, (W, V, U, 3)."""
        axes = zip(self.low[::-1], self.high[::-1], self.moved.shape[:3], strict=True)
        rest = np.meshgrid(*(np.linspace(low, high, count) for low, high, count in axes), indexing="ij")
        points: Array = self.moved + np.stack(rest[::-1], axis=-1)
        return points

    def layers(self, matrix: Array) -> tuple[LatticeLayer, ...]:
        """The layers as control surfaces, the near one first. matrix: (4, 4), own to volume space."""
        count = len(self.moved)
        heights = np.linspace(self.high[2], self.low[2], count) if count > 1 else self.low[2:]
        layers = zip(heights, self.moved[::-1], strict=True)
        return tuple(self._layer(height, moved, matrix) for height, moved in layers)

    def volume(self, matrix: Array) -> LatticeVolume:
        """The whole box, deformed as the modifier deforms it: Q(u, v, t).

        Its control surfaces are iso-surfaces, the near and the far one among them. Raises ValueError
        for a lattice of one layer.
        """
        count, kind = len(self.moved), self.kinds[2]
        nodes = _nodes(kind, count)
        weights = _functions(kind, count).weights(nodes)[0]
        layers = []
        for t, along in zip(nodes, weights.T, strict=True):
            height = self.high[2] + t * (self.low[2] - self.high[2])
            moved = np.einsum("k,kvuc->vuc", along[:count], self.moved[::-1])
            layers.append(self._layer(height, moved, matrix))
        return LatticeVolume(tuple(layers), along_w=kind)

    def _layer(self, height: float, moved: Array, matrix: Array) -> LatticeLayer:
        corner = np.array([self.low[0], self.low[1], height])
        extent = (self.high - self.low)[:2]
        return LatticeLayer(corner, extent, moved, self.kinds[0], self.kinds[1], matrix=matrix)


@dataclass(frozen=True)
class LatticeVolume(ViewingVolume):
    """The viewing volume that a lattice makes; ``Lattice.volume`` has it.

    The surfaces are those at ``_nodes``; the projectors run through them as the interpolation along
    W has it. basis has no say.
    """

    along_w: Interpolation = "BSPLINE"

    @cached_property
    def spans(self) -> SpanBasis:
        """The Bézier spans of every projector, a span for each cell along W."""
        count = len(self.surfaces)
        if self.along_w == "LINEAR":
            return span_basis("POLYLINE", count)
        functions = _functions(self.along_w, count - 1)
        at_nodes = functions.weights(_nodes(self.along_w, count - 1))[0].T
        return SpanBasis(functions.breaks, functions.matrices @ np.linalg.inv(at_nodes))


def _nodes(kind: Interpolation, layers: int) -> Array:
    """The t of the surfaces that span a lattice's volume.

    p + Σ Nk Dk is a sum of the functions Nk and of t itself. Where Σ Nk·k is not t, as in all cubic
    kinds near the ends, it takes a surface more than there are layers; in the first cell it differs most.
    """
    if layers < 2:
        raise ValueError("a lattice that is a viewing volume needs two layers along W")
    even = np.linspace(0.0, 1.0, layers)
    if kind == "LINEAR":
        return even
    return np.insert(even, 1, _EXTRA_SHARE * even[1])


def _functions(kind: Interpolation, layers: int) -> SpanBasis:
    """The functions Nk of t, layers of them, and for cubic kinds t itself, as Bézier spans."""
    if kind == "LINEAR":
        return span_basis("POLYLINE", layers)
    breaks = np.linspace(0.0, 1.0, layers)
    matrices = np.zeros((layers - 1, 4, layers + 1))
    around = _BEZIER_OF_POWERS @ _powers(kind).T
    for span, places in enumerate(_places(np.arange(layers - 1), layers).T):
        for place, column in zip(places, around.T, strict=True):
            matrices[span, :, place] += column
        matrices[span, :, layers] = breaks[span] + np.arange(4) / 3 * (breaks[span + 1] - breaks[span])
    return SpanBasis(breaks, matrices)
