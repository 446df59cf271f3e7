# SPDX-License-Identifier: GPL-3.0-or-later
"""Spherical stereo: eyes on a circle, which turn with the direction in which they look.

Formulas: ``spherical_stereo_transform`` in Cycles' ``kernel/camera/projection.h``.
"""

from __future__ import annotations

from dataclasses import replace
from typing import NamedTuple

import numpy as np

from ..surfaces.surface import Grid
from ..typing import Array
from .viewing_volume import Projection, ViewingVolume

# Points of the surfaces of an eye, along u and v.
COLUMNS, ROWS = 257, 129
# The directions at the borders of v, where they may be vertical, are taken this share of v inside.
INSIDE = 1e-4


class SphericalStereo(NamedTuple):
    """Two eyes. interocular: their distance. convergence: distance of what both have in one place, or inf.

    merge: elevations, radians, from which the eyes come together, and at which they are in one place; None
    without poles that merge.
    """

    interocular: float
    convergence: float
    merge: tuple[float, float] | None

    def eye(self, side: float, direction: Array, rightwards: Array) -> tuple[Array, Array]:
        """Where an eye is and looks, both (3, ...), for unit directions (3, ...) with y up.

        side: -1 for the left eye, 1 for the right. rightwards: (3, ...), level and perpendicular to these.
        """
        offset = np.full(direction.shape[1:], side * self.interocular / 2.0)
        if self.merge is not None:
            begin, end = self.merge
            elevation = np.abs(np.arcsin(np.clip(direction[1], -1.0, 1.0)))
            share = np.clip((elevation - begin) / max(end - begin, np.finfo(np.float32).eps), 0.0, 1.0)
            offset = offset * np.cos(share * np.pi / 2.0)
        place = rightwards * offset
        if not np.isfinite(self.convergence):
            return place, direction
        towards = self.convergence * direction - place
        return place, towards / np.linalg.norm(towards, axis=0)


def may_be_spherical(projection: Projection) -> bool:
    """Return whether a projection has the straight projectors that spherical stereo is defined for."""
    if len(projection.volume.surfaces) != 2 or not projection.volume.spans.is_straight:
        return False
    u, v = (axis.ravel() for axis in np.meshgrid(np.linspace(0, 1, COLUMNS), np.linspace(0, 1, ROWS)))
    return bool(projection.volume.projectors(u, v).valid.all())


def spherical_eye(projection: Projection, stereo: SphericalStereo, side: float) -> Projection:
    """A projection that ``may_be_spherical`` as one eye sees it; all in the space of its camera.

    Its surfaces are grids, whose points are exact. side: as for ``SphericalStereo.eye``.
    """
    u, v = (axis.ravel() for axis in np.meshgrid(np.linspace(0, 1, COLUMNS), np.linspace(0, 1, ROWS)))
    start, end = projection.volume.projectors(u, v).points
    inner = projection.volume.projectors(u, np.clip(v, INSIDE, 1.0 - INSIDE)).points
    direction, length = _unit(end - start)
    way = inner[1] - inner[0]
    rightwards, _ = _unit(np.stack([-way[2], np.zeros_like(way[0]), way[0]]))
    place, towards = stereo.eye(side, direction, rightwards)
    # An eye is beside the place on its projector that is nearest to the camera.
    before = np.einsum("cn,cn->n", start, direction)
    foot = start - before * direction + place
    points = foot + before * towards, foot + (before + length) * towards
    grids = tuple(Grid(each.T.reshape(ROWS, COLUMNS, 3)) for each in points)
    return replace(projection, volume=ViewingVolume(grids))


def _unit(vectors: Array) -> tuple[Array, Array]:
    """Vectors (3, N) of length 1, or 0 where they have none, and their lengths (N,)."""
    length = np.linalg.norm(vectors, axis=0)
    return vectors / np.maximum(length, np.finfo(float).tiny), length
