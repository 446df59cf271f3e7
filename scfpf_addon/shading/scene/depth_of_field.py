# SPDX-License-Identifier: GPL-3.0-or-later
"""Depth of field, which is defined for straight projectors that meet in one point.

Each projector starts from a place on a lens around that point, and passes through the same point in focus as
without the lens. Points on a projector move in proportion to their distance from the focus, so a thin lens
moves the near and the far end of a straight projector, each by its share.
"""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np

from ...projection.typing import Array, IndexArray
from ...projection.volume.viewing_volume import Projection, Projectors, ViewingVolume

# Projectors along each direction of the image whose common point is computed.
LOOKED_AT = 9
# The greatest distance at which they pass it, as a share of their greatest distance.
CENTRAL_SHARE = 1e-4
# Lines whose normal equations are this singular are parallel.
PARALLEL = 1e-9


@dataclass(frozen=True)
class Aperture:
    """The aperture of a lens.

    radius: length. focus: distance of the sharp image, > 0. blades: corners, 0 for a disc. rotation: radians.
    ratio: height by width, 2 for an anamorphic lens.
    """

    radius: float
    focus: float
    blades: int = 0
    rotation: float = 0.0
    ratio: float = 1.0

    def places(self, share: Array) -> Array:
        """Places (2, n) evenly on the lens, in lengths, by numbers (2, n) in [0, 1)."""
        if self.blades < 3:
            angle, distance = 2.0 * np.pi * share[0], np.sqrt(share[1])
            x, y = distance * np.cos(angle), distance * np.sin(angle)
        else:
            # A triangle between the centre and two corners, evenly.
            sector = np.floor(share[0] * self.blades)
            along, distance = share[0] * self.blades - sector, np.sqrt(share[1])
            ends = [(sector + k) * (2.0 * np.pi / self.blades) for k in (0, 1)]
            x, y = (distance * ((1.0 - along) * f(ends[0]) + along * f(ends[1])) for f in (np.cos, np.sin))
        c, s = np.cos(self.rotation), np.sin(self.rotation)
        turned: Array = self.radius * np.stack([(c * x - s * y) / self.ratio, s * x + c * y])
        return turned


@dataclass(frozen=True)
class DepthOfField:
    """An aperture at a volume's centre of projection.

    centre: (3,). axes: (3, 3), the unit vectors right, up and forwards, in columns. flat: the focus is
    a plane across the last one; otherwise a sphere, as in Cycles' panoramas.
    """

    aperture: Aperture
    centre: Array
    axes: Array
    flat: bool

    def transformed(self, matrix: Array) -> DepthOfField:
        """The lens moved by a (4, 4) matrix that scales evenly and does not turn."""
        scale = float(matrix[0, 0])
        return replace(
            self,
            aperture=replace(
                self.aperture, radius=self.aperture.radius * scale, focus=self.aperture.focus * scale
            ),
            centre=matrix[:3, :3] @ self.centre + matrix[:3, 3],
        )

    def focused(self, distance: float) -> DepthOfField:
        """The lens focused at another distance."""
        return replace(self, aperture=replace(self.aperture, focus=distance))

    def moved(self, points: Array, share: Array) -> Array:
        """The ends of projectors (2, 3, n) moved to the lens' places for ``share`` (2, n)."""
        x, y = self.aperture.places(share)
        away = points - self.centre[:, None]
        right, up, forwards = self.axes.T
        if self.flat:
            distance = np.einsum("kcn,c->kn", away, forwards)
            shift = right[:, None] * x + up[:, None] * y
        else:
            distance = np.sqrt(np.einsum("kcn,kcn->kn", away, away))
            # Right and up about the projector's direction.
            along = away[1] / np.maximum(distance[1], np.finfo(np.float64).tiny)
            side = np.cross(along, np.broadcast_to(up[:, None], along.shape), axis=0)
            length = np.sqrt(np.einsum("cn,cn->n", side, side))
            side = np.where(length > PARALLEL, side / np.maximum(length, PARALLEL), right[:, None])
            shift = side * x + np.cross(side, along, axis=0) * y
        moved: Array = points + shift * (1.0 - distance / self.aperture.focus)[:, None]
        return moved


@dataclass(frozen=True)
class ThroughLens(Projection):
    """A projection through a lens. share: (2, n), the places on the lens of n projectors."""

    lens: DepthOfField | None = None
    share: Array | None = None

    def projectors(self, x: Array, y: Array) -> Projectors:
        """``Projection.projectors`` through the lens, for the n image positions of its places."""
        made = super().projectors(x, y)
        if self.lens is None or self.share is None:
            return made
        return made._replace(points=self.lens.moved(made.points, self.share))

    def subset(self, which: IndexArray) -> Projection:
        return replace(self, share=None if self.share is None else self.share.take(which, 1))


def through(projection: Projection, lens: DepthOfField, share: Array) -> ThroughLens:
    """The projection through a lens, in the same space; share: see ``ThroughLens``."""
    return ThroughLens(
        volume=projection.volume,
        reparameterisation=projection.reparameterisation,
        u_range=projection.u_range,
        v_range=projection.v_range,
        aspect=projection.aspect,
        layers=projection.layers,
        lens=lens,
        share=share,
    )


def lens_of(projection: Projection, aperture: Aperture, axes: Array) -> DepthOfField | None:
    """The lens of a volume; None if depth of field is not defined.

    It is defined for two control surfaces whose straight projectors all meet in one point, behind the near
    surface. axes: (3, 3), the camera's right, up and forward directions in columns.
    """
    if len(projection.volume.surfaces) != 2:
        return None
    grid = (np.arange(LOOKED_AT) + 0.5) / LOOKED_AT
    made = projection.projectors(np.tile(grid, LOOKED_AT), np.repeat(grid, LOOKED_AT))
    near, far = made.points[:, :, made.valid & np.isfinite(made.points).all(axis=(0, 1))]
    way = far - near
    length = np.sqrt(np.einsum("cn,cn->n", way, way))
    if near.shape[1] < 3 or not length.min() > 0.0:
        return None
    way /= length
    # The point with the least squared distance from all lines.
    across = np.eye(3)[:, :, None] - way[:, None] * way
    total = across.sum(axis=2)
    if np.linalg.svd(total, compute_uv=False)[-1] < PARALLEL * near.shape[1]:
        return None
    centre = np.linalg.solve(total, np.einsum("ijn,jn->i", across, near))
    from_centre = near - centre[:, None]
    passed = np.einsum("ijn,jn->in", across, from_centre)
    reach = np.abs(far - centre[:, None]).max()
    if np.abs(passed).max() > CENTRAL_SHARE * reach:
        return None
    if np.einsum("cn,cn->n", from_centre, way).min() < -CENTRAL_SHARE * reach:
        return None
    return DepthOfField(aperture, centre, axes, _is_flat(projection.volume, centre, axes[:, 2]))


def _is_flat(volume: ViewingVolume, centre: Array, forwards: Array) -> bool:
    """Return whether the far surface is a plane across ``forwards``, as a perspective camera's is."""
    edge = np.linspace(0.0, 1.0, LOOKED_AT)
    far = volume.surfaces[-1].evaluate(np.tile(edge, LOOKED_AT), np.repeat(edge, LOOKED_AT)).position
    depth = np.einsum("c,cn->n", forwards, far - centre[:, None])
    return bool(np.ptp(depth) <= CENTRAL_SHARE * np.abs(depth).max())
