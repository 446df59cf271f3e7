# SPDX-License-Identifier: GPL-3.0-or-later
"""The thin-plate energy of displacements, the regulariser of aiming (Bookstein 1989)."""

from __future__ import annotations

import numpy as np

from ...projection.arrays import product
from ...projection.typing import Array
from .control_net import ACTING, ControlNet
from .problem import AimWeights


def _difference(count: int, order: int) -> Array:
    """The matrix of differences of an order between ``count`` values."""
    return np.diff(np.eye(count), order, axis=0)


class ThinPlate:
    """The smoothness of displacements and the pull home.

    Second differences along u and v and the mixed one, weak first differences along u, v and from surface to
    surface, and the displacements themselves. Differences shrink with the net's spacing; their weights make
    up for it. matrix: (unknowns / 3, unknowns / 3), equal for x, y and z. band: as that of ``Normal``.
    """

    def __init__(self, net: ControlNet, weights: AimWeights, footprints: Array) -> None:
        columns, rows, free = np.eye(net.columns), np.eye(net.rows), np.diag(1.0 / footprints)
        fine_u, fine_v = net.columns / 8, net.rows / 6
        terms = [
            (_difference(net.columns, 2), rows, free, weights.smooth * fine_u**1.5),
            (columns, _difference(net.rows, 2), free, weights.smooth * fine_v**1.5),
            (_difference(net.columns, 1), _difference(net.rows, 1), free, 1.4 * weights.smooth),
            (_difference(net.columns, 1), rows, free, 0.3 * weights.smooth * fine_u**0.5),
            (columns, _difference(net.rows, 1), free, 0.3 * weights.smooth * fine_v**0.5),
            (columns, rows, _difference(net.surfaces - 1, 1) @ free, 0.3 * weights.smooth),
            (columns, rows, free, weights.home),
        ]
        self.matrix = np.zeros((net.unknowns // 3, net.unknowns // 3))
        for a, b, c, weight in terms:
            self.matrix += np.kron(a.T @ a, np.kron(b.T @ b, c.T @ c)) * weight**2
        size = net.block // 3
        blocks = self.matrix.reshape(net.columns, size, net.columns, size)
        self.band = np.zeros((ACTING, net.columns, net.block, net.block))
        for apart in range(ACTING):
            for column in range(net.columns - apart):
                self.band[apart, column] = np.kron(blocks[column + apart, :, column], np.eye(3))

    def value(self, offset: Array) -> float:
        """The energy of displacements of the moving control points, (unknowns / 3, 3)."""
        return float((offset * self.forces(offset)).sum())

    def forces(self, offset: Array) -> Array:
        """Half the energy's gradient, (unknowns / 3, 3)."""
        return product(self.matrix, offset)
