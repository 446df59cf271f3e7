# SPDX-License-Identifier: GPL-3.0-or-later
"""Points and normals of meshes as objects turn them."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from ...casting.common.parallel import chunks, parallel_map
from ...projection.typing import Array


def turn(vectors: NDArray[np.float32], matrix: NDArray, into: NDArray, shift: NDArray | None = None) -> None:
    """Write each of the matrices (N, 3, 3) times each of the vectors (P, 3) into ``into`` (N, P, 3).

    shift: (N, 3), what is added to these. Not by matmul: so slim a product costs more in waking threads than
    in itself.
    """

    def turn_some(some: slice) -> None:
        x, y, z = vectors[some].T
        # Files may hold normals that are no numbers.
        with np.errstate(invalid="ignore", over="ignore"):
            for row in range(3):
                sums = matrix[:, row, 0, None] * x
                sums += matrix[:, row, 1, None] * y
                sums += matrix[:, row, 2, None] * z
                if shift is not None:
                    sums += shift[:, row, None]
                into[:, some, row] = sums

    parallel_map(turn_some, chunks(len(vectors)))


def normal_transforms(linear: Array) -> tuple[NDArray[np.float32], NDArray[np.bool_]]:
    """What turns normals as ``linear`` (N, 3, 3) turns points, (N, 3, 3) float32, and which mirror.

    Up to a positive factor the inverse transpose, made of cofactors so that it also
    serves an object that is flattened.
    """
    x, y, z = linear.swapaxes(0, 1)
    cofactors = np.stack([np.cross(y, z), np.cross(z, x), np.cross(x, y)], axis=1)
    mirrored = np.einsum("nc,nc->n", cofactors[:, 0], x) < 0
    size = np.abs(cofactors).max(axis=(1, 2), keepdims=True)
    cofactors /= np.where(size == 0, 1.0, size)
    return np.where(mirrored[:, None, None], -cofactors, cofactors).astype(np.float32), mirrored


def normalize(normals: NDArray[np.float32]) -> None:
    """Make vectors (..., 3) unit in place; what has no direction points along +Z."""
    length = np.sqrt(np.einsum("...c,...c->...", normals, normals))[..., None]
    none = ~(length[..., 0] > 0)
    if none.any():
        normals[none] = (0.0, 0.0, 1.0)
        length[none] = 1.0
    normals /= length
