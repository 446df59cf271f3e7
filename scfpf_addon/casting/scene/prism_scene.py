# SPDX-License-Identifier: GPL-3.0-or-later
"""What exact casting walks through: the prisms of all triangles, in Embree."""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import NDArray

from ...projection.typing import Array, Float32Array
from ..common.cancellation import raise_if_cancelled
from .occupancy import Occupancy
from .prisms import Prisms


class PrismScene:
    """Prisms round all triangles, in Embree (see ``prisms``).

    epsilon: how far chords may be from their curves, cast units. lower, upper: (3,) the
    box that holds all prisms. occupancy: where there are prisms. steepest: (T,) the largest slope
    of the triangles' barycentric weights, 1 over the least height. modules: see ``mesh_in_embree``.
    Safe to use from several threads.
    """

    def __init__(self, prisms: Prisms, steepest: Array, modules: tuple[Any, Any]) -> None:
        self.steepest = steepest
        self.epsilon, self.thickness = prisms.epsilon, prisms.thickness
        self.lower: Array = prisms.corners.min(axis=(0, 1)).astype(np.float64)
        self.upper: Array = prisms.corners.max(axis=(0, 1)).astype(np.float64)
        raise_if_cancelled()
        self._embree, self._mesh, self._faces = prisms.embree_scene(modules)
        raise_if_cancelled()
        outlines = prisms.corners[:, :3][np.ptp(prisms.corners, axis=1).any(axis=1)]
        # One cap of a prism is nowhere farther than this from the other.
        self.occupancy = Occupancy.of(outlines.transpose(1, 2, 0).astype(np.float64), 2.0 * self.thickness)

    def trace(
        self, origins: Float32Array, directions: Float32Array, limits: Float32Array
    ) -> tuple[NDArray[np.int32], Float32Array]:
        """The triangles whose prisms the rays enter or leave first, -1 for none, and where.

        As ``CastScene.trace``; the second array (N,) is in units of the direction's length.
        """
        raise_if_cancelled()
        found = self._embree.run(origins.T, directions.T, limits.copy(), output=True)
        triangle: NDArray[np.int32] = found["primID"]
        # -1 stays what it is.
        triangle //= self._faces
        return triangle, found["tfar"]
