# SPDX-License-Identifier: GPL-3.0-or-later
"""The normal equations of a banded least-squares problem, and their Cholesky factorisation.

The unknowns of a column of the control net are a block. A residual involves four neighbouring columns, so
that the matrix has three blocks beside its diagonal, and so has its Cholesky factor (Golub and Van Loan,
Matrix Computations, 4.3.5 and 4.5).
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from ..arrays import inverse_triangle, product
from ..typing import Array, IndexArray
from .control_net import ACTING, Net, Places


class Rows(NamedTuple):
    """Linearised residuals: coefficients · step ≈ residuals.

    column, row: (R,), the first acting column and row of the net. coefficients: (R, 16 · free surfaces · 3).
    residuals: (R,), what the step shall make up for.
    """

    column: IndexArray
    row: IndexArray
    coefficients: Array
    residuals: Array

    @classmethod
    def of(cls, places: Places, coefficients: Array, residuals: Array) -> Rows:
        """Rows of N places with E residuals each. coefficients: (N, E, C). residuals: (N, E)."""
        each = residuals.shape[1]
        return cls(
            np.repeat(places.column, each),
            np.repeat(places.row, each),
            coefficients.reshape(len(residuals) * each, coefficients.shape[2]),
            residuals.reshape(-1),
        )


class Normal:
    """Normal equations H · step = g, (columns, block) unknowns. The upper triangle of H counts."""

    def __init__(self, net: Net, matrix: Array, right: Array) -> None:
        self.net, self.cell = net, net.block // net.rows
        self.matrix = matrix.reshape(net.columns, net.block, net.columns, net.block)
        self.right = right.reshape(net.columns, net.block)

    def add(self, rows: Rows) -> None:
        """Add the normal equations of rows, those with the same acting points at once."""
        key = rows.column * self.net.rows + rows.row
        order = np.argsort(key, kind="stable")
        keys, starts = np.unique(key[order], return_index=True)
        shape = (ACTING, ACTING * self.cell)
        coefficients, residuals = rows.coefficients[order], rows.residuals[order]
        for number, start, end in zip(keys, starts, np.append(starts, len(order))[1:], strict=True):
            column, row = divmod(int(number), self.net.rows)
            across = slice(column, column + ACTING)
            up = slice(row * self.cell, (row + ACTING) * self.cell)
            part = coefficients[start:end]
            self.matrix[across, up, across, up] += product(part.T, part).reshape(*shape, *shape)
            self.right[across, up] += np.einsum("r,rc->c", residuals[start:end], part).reshape(shape)

    def solve(self, damping: float) -> Array:
        """The step (unknowns,) of H with its diagonal multiplied by 1 + damping.

        Raises LinAlgError if H is not positive definite.
        """
        columns, block = self.right.shape
        reach = ACTING - 1
        window = np.zeros((ACTING * block, ACTING * block))
        solution = self.right.copy()
        inverses, below = [], []
        for k in range(columns):
            window[:-block, :-block] = window[block:, block:]
            window[-block:], window[:, -block:] = 0.0, 0.0
            for place in range(0 if k == 0 else reach, min(ACTING, columns - k)):
                self._enter(window, k, place, damping)
            inverse = inverse_triangle(np.linalg.cholesky(window[:block, :block]))
            side = product(window[block:, :block], inverse.T)
            window[block:, block:] -= product(side, side.T)
            inverses.append(inverse)
            below.append(side)
            solution[k] = inverse @ solution[k]
            size = min(reach, columns - 1 - k)
            solution[k + 1 : k + 1 + size] -= (side[: size * block] @ solution[k]).reshape(size, block)
        for k in reversed(range(columns)):
            size = min(reach, columns - 1 - k)
            rest = solution[k] - solution[k + 1 : k + 1 + size].ravel() @ below[k][: size * block]
            solution[k] = rest @ inverses[k]
        return solution.reshape(-1)

    def _enter(self, window: Array, first: int, place: int, damping: float) -> None:
        """Copy the blocks of column ``first + place`` into the window, symmetrically."""
        block = self.net.block
        own = slice(place * block, (place + 1) * block)
        for other in range(place + 1):
            there = slice(other * block, (other + 1) * block)
            part = self.matrix[first + other, :, first + place]
            window[there, own] += part
            if other < place:
                window[own, there] += part.T
        diagonal = window[own, own]
        diagonal[np.diag_indices(block)] += damping * self.matrix[first + place, :, first + place].diagonal()
