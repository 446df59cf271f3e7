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

from ..surfaces.nurbs import Basis, NurbsAxis, NurbsPatch
from ..typing import Array, IndexArray
from ..volume.bezier import bernstein, bernstein_derivative, bernstein_second_derivative

# Control points that act at a parameter of a cubic.
ACTING = 4


@dataclass(frozen=True)
class Net:
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

    def at(self, u: Array, v: Array) -> Places:
        """The basis functions at parameters (N,)."""
        parts = []
        for count, parameter in ((self.columns, u), (self.rows, v)):
            basis = Basis(NurbsAxis(), count)
            acting = basis.acting(basis.at(parameter)[0])
            scale = basis.ends[1] - basis.ends[0]
            parts.append((acting.point[0], acting.value.T, acting.slope.T * scale))
        (column, a, da), (row, b, db) = parts
        local = np.stack([x[:, :, None] * y[:, None, :] for x, y in ((a, b), (da, b), (a, db))])
        return Places(self, column, row, local.reshape(3, len(u), ACTING**2))


@dataclass(frozen=True)
class Places:
    """Basis functions at N parameters (u, v).

    column, row: (N,), the first acting column and row. local: (3, N, 16), values and derivatives by u and v
    of the acting functions, column by column.
    """

    net: Net
    column: IndexArray
    row: IndexArray
    local: Array

    @cached_property
    def acting(self) -> IndexArray:
        """The numbers of the acting points, (N, 16)."""
        around = np.arange(ACTING)
        column, row = self.column[:, None, None] + around[:, None], self.row[:, None, None] + around
        return (column * self.net.rows + row).reshape(len(self.column), ACTING**2)

    def dense(self) -> Array:
        """The values over all points of the net, (N, points)."""
        full = np.zeros((len(self.column), self.net.points))
        full[np.arange(len(full))[:, None], self.acting] = self.local[0]
        return full

    def controls(self, points: Array) -> Array:
        """Control points of the projectors and their derivatives by u and v, (3, N, surfaces, 3)."""
        nets = points.reshape(len(points), -1)[self.acting]
        found = np.ascontiguousarray(np.matmul(self.local.swapaxes(0, 1), nets).swapaxes(0, 1))
        return found.reshape(3, len(self.column), *points.shape[1:])

    def take(self, which: IndexArray) -> Places:
        """The places of these numbers; a number may come several times."""
        return Places(self.net, self.column[which], self.row[which], self.local[:, which])

    def rows_of(self, kind: int, weights: Array, vectors: Array) -> Array:
        """Coefficients of vector · Σ weight · P over the acting points, (N, 16 · free surfaces · 3).

        kind: 0 for Q and Qt, 1 for Qu, 2 for Qv. weights: (N, surfaces) functions of t. vectors: (N, 3).
        """
        along = weights[:, 1:, None] * vectors[:, None, :]
        count, width = len(along), 3 * (self.net.surfaces - 1)
        rows: Array = self.local[kind][:, :, None] * along.reshape(count, 1, width)
        return rows.reshape(count, ACTING**2 * width)


@dataclass(frozen=True)
class Along:
    """Q and its derivatives at N places, (N, 3) each; with the functions of t, (N, surfaces)."""

    position: Array
    du: Array
    dv: Array
    dt: Array
    value: Array
    slope: Array

    @classmethod
    def of(cls, controls: Array, t: Array) -> Along:
        """Evaluate projectors (``Places.controls``) at t (N,)."""
        degree = controls.shape[2] - 1
        value, slope = bernstein(degree, t).T, bernstein_derivative(degree, t).T
        position, du, dv = np.matmul(value[:, None], controls)[:, :, 0]
        dt = np.matmul(slope[:, None], controls[0])[:, 0]
        return cls(position, du, dv, dt, value, slope)

    def bend(self, controls: Array, t: Array) -> Array:
        """The second derivative by t, (N, 3)."""
        weights = bernstein_second_derivative(controls.shape[2] - 1, t).T
        found: Array = np.matmul(weights[:, None], controls[0])[:, 0]
        return found
