# SPDX-License-Identifier: GPL-3.0-or-later
"""The control net of a volume of cubic B-spline surfaces, and linear functions of its points.

Q(u, v, t) = Σ Bk(t) Nj(u) Ni(v) P(j, i, k) is linear in the control points P. Point (column, row) of the net
has the number column · rows + row. Unknowns are ordered by point, surface and component, without the fixed
near surface, so that a residual at (u, v) involves four neighbouring columns: the equations are banded.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property

import numpy as np

from ...projection.arrays import product
from ...projection.surfaces.nurbs import Basis, NurbsAxis, NurbsPatch
from ...projection.typing import Array, IndexArray
from ...projection.volume.bezier import bernstein, bernstein_derivative, bernstein_second_derivative

# Control points that act at a parameter of a cubic.
ACTING = 4


@dataclass(frozen=True)
class ControlNet:
    """The size of the control net. surfaces: of the volume, the fixed near one included."""

    columns: int
    rows: int
    surfaces: int

    @property
    def points(self) -> int:
        """Control points of a surface."""
        return self.columns * self.rows

    @property
    def block(self) -> int:
        """Unknowns of a column."""
        return self.rows * (self.surfaces - 1) * 3

    @property
    def unknowns(self) -> int:
        """Unknown coordinates."""
        return self.columns * self.block

    def gather(self, patches: tuple[NurbsPatch, ...]) -> Array:
        """The control points of patches, (points, surfaces, 3)."""
        return np.stack([np.swapaxes(p.points[..., :3], 0, 1).reshape(-1, 3) for p in patches], axis=1)

    def patches(self, points: Array) -> tuple[NurbsPatch, ...]:
        """The inverse of ``gather``."""
        nets = points.reshape(self.columns, self.rows, self.surfaces, 3)
        return tuple(
            NurbsPatch(np.ascontiguousarray(nets[:, :, k].swapaxes(0, 1))) for k in range(self.surfaces)
        )

    def moved(self, points: Array, step: Array) -> Array:
        """Control points moved by a step of the unknowns."""
        result = points.copy()
        result[:, 1:] += step.reshape(self.points, self.surfaces - 1, 3)
        return result

    def axis(self, count: int, parameter: Array) -> tuple[IndexArray, Array, Array]:
        """The first acting functions of an axis at parameters (N,), and their values and slopes, (4, N)."""
        basis = Basis(NurbsAxis(), count)
        acting = basis.acting(basis.at(parameter)[0])
        return acting.point[0], acting.value, acting.slope * (basis.ends[1] - basis.ends[0])

    def at(self, u: Array, v: Array) -> Places:
        """The basis functions at parameters (N,)."""
        column, a, da = self.axis(self.columns, u)
        row, b, db = self.axis(self.rows, v)
        local = np.stack([x[:, None] * y[None] for x, y in ((a, b), (da, b), (a, db))])
        return Places(self, column, row, local.reshape(3, ACTING**2, len(u)))

    def grid(self, u: Array, v: Array) -> NetBasis:
        """The basis functions at all pairs of parameters (U,) and (V,)."""
        return NetBasis(self, u, v, *(self._dense(*part) for part in ((self.columns, u), (self.rows, v))))

    def _dense(self, count: int, parameter: Array) -> Array:
        """Values and slopes of all functions of an axis at parameters (N,), (2, N, count)."""
        first, *found = self.axis(count, parameter)
        full = np.zeros((2, len(parameter), count))
        for kind, part in enumerate(found):
            full[kind, np.arange(len(parameter))[:, None], first[:, None] + np.arange(ACTING)] = part.T
        return full


@dataclass(frozen=True)
class Places:
    """Basis functions at N parameters (u, v).

    column, row: (N,), the first acting column and row. local: (3, 16, N), values and derivatives by u and v
    of the acting functions, column by column.
    """

    net: ControlNet
    column: IndexArray
    row: IndexArray
    local: Array

    @property
    def count(self) -> int:
        """The number of places."""
        return len(self.column)

    @cached_property
    def acting(self) -> IndexArray:
        """The numbers of the acting points, (16, N)."""
        around = np.arange(ACTING)
        column, row = self.column + around[:, None, None], self.row + around[:, None]
        return (column * self.net.rows + row).reshape(ACTING**2, len(self.column))

    def dense(self) -> Array:
        """The values over all points of the net, (N, points)."""
        full = np.zeros((len(self.column), self.net.points))
        full[np.arange(len(full)), self.acting] = self.local[0]
        return full

    def controls(self, points: Array) -> Array:
        """Control points of the projectors and their derivatives by u and v, (3, surfaces, 3, N)."""
        nets = points.reshape(len(points), -1).T[:, self.acting]
        found: Array = np.einsum("kan,can->kcn", self.local, nets)
        return found.reshape(3, *points.shape[1:], len(self.column))

    def take(self, which: IndexArray) -> Places:
        """The places of these numbers; a number may come several times."""
        return Places(self.net, self.column[which], self.row[which], self.local[:, :, which])

    @classmethod
    def joined(cls, parts: list[Places]) -> Places:
        """The places of all parts, at least one, in order."""
        arrays = zip(*((part.column, part.row, part.local) for part in parts), strict=True)
        return cls(parts[0].net, *(np.concatenate(each, axis=-1) for each in arrays))

    def rows_of(self, kind: int, weights: Array, vectors: Array) -> Array:
        """Coefficients of vector · Σ weight · P over the acting points, (16 · free surfaces · 3, N).

        kind: 0 for Q and Qt, 1 for Qu, 2 for Qv. weights: (surfaces, N) functions of t. vectors: (3, N).
        """
        count, width = vectors.shape[1], 3 * (self.net.surfaces - 1)
        along = (weights[1:, None] * vectors).reshape(width, count)
        rows: Array = self.local[kind][:, None] * along
        return rows.reshape(ACTING**2 * width, count)


@dataclass(frozen=True)
class NetBasis:
    """Basis functions at U × V places, numbered u · V + v: products of those of both axes.

    u, v: (U,) and (V,). along_u: (2, U, columns), along_v: (2, V, rows), values and slopes.
    """

    net: ControlNet
    u: Array
    v: Array
    along_u: Array
    along_v: Array

    @property
    def count(self) -> int:
        """The number of places."""
        return len(self.u) * len(self.v)

    @cached_property
    def places(self) -> Places:
        """The same places one by one."""
        return self.net.at(np.repeat(self.u, len(self.v)), np.tile(self.v, len(self.u)))

    def take(self, which: IndexArray) -> Places:
        """The places of these numbers, without the grid."""
        return self.places.take(which)

    def controls(self, points: Array) -> Array:
        """Control points of the projectors and their derivatives by u and v, (3, surfaces, 3, U · V)."""
        net = self.net
        nets = points.reshape(net.columns, net.rows, -1).transpose(2, 0, 1).reshape(-1, net.rows)
        size = nets.shape[0] // net.columns
        found = np.empty((3, size, len(self.u), len(self.v)))
        for kinds, slope in (((0, 1), 0), ((2,), 1)):
            part = product(nets, self.along_v[slope].T).reshape(size, net.columns, len(self.v))
            flat = np.ascontiguousarray(part.transpose(1, 0, 2)).reshape(net.columns, -1)
            for kind in kinds:
                both = product(self.along_u[kind % 2], flat)
                found[kind] = both.reshape(len(self.u), size, len(self.v)).transpose(1, 0, 2)
        return found.reshape(3, *points.shape[1:], len(self.u) * len(self.v))


def combined(weights: Array, controls: Array) -> Array:
    """Σ weight · control over the surfaces, (3, ..., N).

    weights: (surfaces, ..., N). controls: (surfaces, 3, N).
    """
    total: Array = np.einsum("s...n,scn->c...n", weights, controls)
    return total


@dataclass(frozen=True)
class Along:
    """Q and its derivatives at N places, (3, ..., N) each; with the functions of t, (surfaces, ..., N)."""

    position: Array
    du: Array
    dv: Array
    dt: Array
    value: Array
    slope: Array

    @classmethod
    def of(cls, controls: Array, t: Array) -> Along:
        """Evaluate projectors (``Places.controls``) at t (N,), or at several t of each, (K, N)."""
        degree = controls.shape[1] - 1
        value, slope = bernstein(degree, t), bernstein_derivative(degree, t)
        position, du, dv = (combined(value, part) for part in controls)
        return cls(position, du, dv, combined(slope, controls[0]), value, slope)


def position_and_tangent(controls: Array, t: Array) -> tuple[Array, Array]:
    """Q and Qt at t (..., N) on projectors (surfaces, 3, N), (3, ..., N) each."""
    degree = len(controls) - 1
    return combined(bernstein(degree, t), controls), combined(bernstein_derivative(degree, t), controls)


def bend(controls: Array, t: Array) -> Array:
    """The second derivative by t at t (N,) on projectors (surfaces, 3, N), (3, N)."""
    return combined(bernstein_second_derivative(len(controls) - 1, t), controls)
