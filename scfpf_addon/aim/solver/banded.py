# SPDX-License-Identifier: GPL-3.0-or-later
"""The normal equations of a banded least-squares problem, and their Cholesky factorisation.

The unknowns of a column of the control net are a block. A residual involves four neighbouring columns, so
that the matrix has three blocks beside its diagonal, and so has its Cholesky factor (Golub and Van Loan,
Matrix Computations, 4.3.5 and 4.5).
"""

from __future__ import annotations

from functools import cache
from typing import NamedTuple

import numpy as np

from ...projection.arrays import inverse_triangle, product
from ...projection.typing import Array, IndexArray
from .control_net import ACTING, ControlNet, NetBasis, Places


class Rows(NamedTuple):
    """Linearised residuals: coefficients · step ≈ residuals.

    column, row: (R,), the first acting column and row of the net. coefficients: (16 · free surfaces · 3, R).
    residuals: (R,), what the step shall make up for.
    """

    column: IndexArray
    row: IndexArray
    coefficients: Array
    residuals: Array

    @classmethod
    def joined(cls, parts: list[Rows]) -> Rows:
        """The rows of all parts."""
        return cls(*(np.concatenate(values, axis=-1) for values in zip(*parts, strict=True)))

    @classmethod
    def of(cls, places: Places, coefficients: Array, residuals: Array) -> Rows:
        """Rows of N places with E residuals each. coefficients: (C, E, N). residuals: (E, N)."""
        each = len(residuals)
        return cls(
            np.tile(places.column, each),
            np.tile(places.row, each),
            coefficients.reshape(len(coefficients), each * len(places.column)),
            residuals.reshape(-1),
        )


class GridTerms(NamedTuple):
    """The quadratic form of residuals of Q and Qt at the places of a grid, as far as t and direction go.

    products: (pairs of free surfaces · 6, U, V), by ``pairs``: Σ w wᵀ ⊗ Σ e eᵀ of the weights w of the
    surfaces and the vectors e of the residuals. right: (free surfaces · 3, U, V), Σ w ⊗ e · residual.
    """

    grid: NetBasis
    products: Array
    right: Array


@cache
def pairs(count: int) -> tuple[IndexArray, IndexArray]:
    """The rows and columns of the upper triangle of a symmetric (count, count) matrix."""
    return np.triu_indices(count)


@cache
def _pair_numbers(count: int) -> IndexArray:
    """The place in ``pairs`` of each entry of a symmetric matrix, (count, count)."""
    numbers = np.zeros((count, count), np.int64)
    first, second = pairs(count)
    numbers[first, second] = numbers[second, first] = np.arange(len(first))
    return numbers


class Normal:
    """Normal equations H · step = g, (columns, block) unknowns.

    band: (4, columns, block, block); [d, k] is the block of column k + d, row-wise, and column k.
    """

    def __init__(self, net: ControlNet, band: Array, right: Array) -> None:
        self.net, self.cell = net, net.block // net.rows
        self.band = band
        self.right = right.reshape(net.columns, net.block)

    def add(self, rows: Rows) -> None:
        """Add the normal equations of rows, those with the same acting points at once."""
        key = rows.column * self.net.rows + rows.row
        order = np.argsort(key, kind="stable")
        keys, starts = np.unique(key[order], return_index=True)
        width = ACTING * self.cell
        coefficients, residuals = rows.coefficients[:, order], rows.residuals[order]
        for number, start, end in zip(keys, starts, np.append(starts, len(order))[1:], strict=True):
            column, row = divmod(int(number), self.net.rows)
            up = slice(row * self.cell, row * self.cell + width)
            # By columns: products of these sizes stay in this thread.
            part = coefficients[:, start:end].reshape(ACTING, width, end - start)
            for apart in range(ACTING):
                across = slice(column, column + ACTING - apart)
                products = np.matmul(part[apart:], part[: ACTING - apart].swapaxes(1, 2))
                self.band[apart, across, up, up] += products
            self.right[column : column + ACTING, up] += part @ residuals[start:end]

    def add_grid(self, terms: GridTerms) -> None:
        """Add residuals at a grid, one axis after the other.

        H is Σ (Nᵤ Nᵤᵀ) ⊗ (Nᵥ Nᵥᵀ) ⊗ (w wᵀ) ⊗ (e eᵀ), a sum of Kronecker products: each factor is summed
        for itself (sum factorisation, Orszag 1980).
        """
        net, grid, cell = self.net, terms.grid, self.cell
        a, b = grid.along_u[0], grid.along_v[0]
        first, second = pairs(net.rows)
        size, counts = len(terms.products), (len(grid.u), len(grid.v))
        flat = terms.products.swapaxes(0, 1).reshape(counts[0] * size, counts[1])
        summed = product(flat, b[:, first] * b[:, second]).reshape(counts[0], -1)
        across = np.zeros((ACTING, net.columns, counts[0]))
        for apart in range(ACTING):
            across[apart, : net.columns - apart] = (a[:, : net.columns - apart] * a[:, apart:]).T
        total = product(across.reshape(-1, counts[0]), summed)
        spread = total.take(_spread(net.rows, cell // 3), axis=1, mode="clip")
        self.band += spread.reshape(self.band.shape)
        right = product(terms.right.swapaxes(0, 1).reshape(-1, counts[1]), b).reshape(counts[0], -1)
        pulled = product(np.ascontiguousarray(a.T), right).reshape(net.columns, cell, net.rows)
        self.right += pulled.swapaxes(1, 2).reshape(self.right.shape)

    def resist(self, weights: Array) -> None:
        """Let moves cost their squares. weights: (free surfaces,), of the control points' coordinates."""
        squares = np.tile(np.repeat(weights**2, 3), self.net.rows)
        self.band[0, :, range(self.net.block), range(self.net.block)] += squares[:, None]

    def solve(self, damping: float) -> Array:
        """The step (unknowns,) of H with its diagonal multiplied by 1 + damping.

        Raises LinAlgError if H is not positive definite.
        """
        columns, block = self.right.shape
        left, solution = self.band.copy(), self.right.copy()
        left[0, :, range(block), range(block)] *= 1.0 + damping
        inverses, below = [], []
        for k in range(columns):
            inverse = inverse_triangle(np.linalg.cholesky(left[0, k]))
            size = min(ACTING - 1, columns - 1 - k)
            side = product(left[1 : 1 + size, k].reshape(-1, block), inverse.T)
            for own in range(size):
                part = side[own * block : (own + 1) * block]
                # The lower triangle of blocks suffices.
                square = product(part, side[: (own + 1) * block].T).reshape(block, own + 1, block)
                for other in range(own + 1):
                    left[own - other, k + 1 + other] -= square[:, other]
            inverses.append(inverse)
            below.append(side)
            solution[k] = inverse @ solution[k]
            solution[k + 1 : k + 1 + size] -= (side @ solution[k]).reshape(size, block)
        for k in reversed(range(columns)):
            size = min(ACTING - 1, columns - 1 - k)
            rest = solution[k] - solution[k + 1 : k + 1 + size].ravel() @ below[k]
            solution[k] = rest @ inverses[k]
        return solution.reshape(-1)


@cache
def _spread(rows: int, free: int) -> IndexArray:
    """The numbers (block²,) of a block's entries among the products of ``GridTerms`` × ``pairs`` of rows."""
    row, surface, axis = (numbers.ravel() for numbers in np.indices((rows, free, 3)))
    surfaces, axes, along = (_pair_numbers(n) for n in (free, 3, rows))
    inner = surfaces[surface[:, None], surface] * 6 + axes[axis[:, None], axis]
    found: IndexArray = (inner * (rows * (rows + 1) // 2) + along[row[:, None], row]).ravel()
    return found
