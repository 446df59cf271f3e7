# SPDX-License-Identifier: GPL-3.0-or-later
"""Projections interpolated between two moments: their control surfaces and ranges."""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import Self

import numpy as np

from ..surfaces.surface import ControlSurface, SurfacePositions, SurfaceSample
from ..typing import Array
from ..volume.viewing_volume import ImageLayer, Projection, ViewingVolume


@dataclass(frozen=True)
class InterpolatedSurface(ControlSurface):
    """A surface whose points lie ``share`` of the way from those of ``before`` to those of ``after``."""

    before: ControlSurface
    after: ControlSurface
    share: float

    def local(self, u: Array, v: Array) -> SurfaceSample:
        """The sample; its tiles are those of ``before``."""
        a, b = self.before.evaluate(u, v), self.after.evaluate(u, v)
        return SurfaceSample(
            self._mixed(a.position, b.position),
            self._mixed(a.du, b.du),
            self._mixed(a.dv, b.dv),
            a.tile,
            a.valid & b.valid,
        )

    def _mixed(self, a: Array, b: Array) -> Array:
        return a + (b - a) * self.share

    def local_position(self, u: Array, v: Array) -> SurfacePositions:
        a, b = self.before.positions(u, v), self.after.positions(u, v)
        return SurfacePositions(self._mixed(a.position, b.position), a.valid & b.valid)

    def local_hull(self) -> Array:
        """The points of both hulls: every point between two convex sets lies in the hull of both."""
        return np.concatenate([self.before.hull(), self.after.hull()], axis=1)

    @property
    def bends(self) -> tuple[float, float] | None:
        one, other = _bends_outside(self.before), _bends_outside(self.after)
        if one is None or other is None:
            return None
        return max(one[0], other[0]), max(one[1], other[1])

    @property
    def creases(self) -> tuple[Array, Array]:
        (one_u, one_v), (other_u, other_v) = self.before.creases, self.after.creases
        return np.union1d(one_u, other_u), np.union1d(one_v, other_v)

    def transformed(self, matrix: Array) -> Self:
        return replace(self, before=self.before.transformed(matrix), after=self.after.transformed(matrix))


def _bends_outside(surface: ControlSurface) -> tuple[float, float] | None:
    """The bends of a surface where its matrix places it, at most."""
    if surface.bends is None:
        return None
    scale = float(np.linalg.norm(surface.matrix[:3, :3], 2))
    return surface.bends[0] * scale, surface.bends[1] * scale


def interpolated_projection(before: Projection, after: Projection, share: float) -> Projection:
    """The projection ``share`` of the way from one to the other.

    Only control surfaces and the shown range are interpolated, those of layers as well. Volumes with other
    numbers of surfaces, other bases or lattices give the nearer of both.
    """
    one, other = before.volume, after.volume
    nearer = before if share < 0.5 else after
    if share in (0.0, 1.0) or not (type(one) is type(other) is ViewingVolume):
        return nearer
    if len(one.surfaces) != len(other.surfaces) or one.basis != other.basis:
        return nearer
    surfaces = tuple(
        InterpolatedSurface(a, b, share) for a, b in zip(one.surfaces, other.surfaces, strict=True)
    )
    weights = one.weights
    if one.weights is not None and other.weights is not None:
        weights = tuple(a + (b - a) * share for a, b in zip(one.weights, other.weights, strict=True))
    layers = nearer.layers
    if len(before.layers) == len(after.layers):
        layers = tuple(_layer(*both, share) for both in zip(before.layers, after.layers, strict=True))
    return replace(
        nearer,
        layers=layers,
        volume=ViewingVolume(surfaces, one.basis, weights),
        u_range=_pair(before.u_range, after.u_range, share),
        v_range=_pair(before.v_range, after.v_range, share),
    )


def _layer(before: ImageLayer, after: ImageLayer, share: float) -> ImageLayer:
    return replace(
        before if share < 0.5 else after,
        projection=interpolated_projection(before.projection, after.projection, share),
        eye=before.eye + (after.eye - before.eye) * share,
    )


def _pair(one: tuple[float, float], other: tuple[float, float], share: float) -> tuple[float, float]:
    return one[0] + (other[0] - one[0]) * share, one[1] + (other[1] - one[1]) * share
