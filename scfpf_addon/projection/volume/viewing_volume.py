# SPDX-License-Identifier: GPL-3.0-or-later
"""The viewing volume Q(u, v, t) and the projection that an image makes of it."""

from __future__ import annotations

from dataclasses import dataclass, field, replace
from functools import cached_property
from typing import Literal, NamedTuple, TypeAlias

import numpy as np

from ..surfaces.surface import ControlSurface
from ..typing import Array, BoolArray, IndexArray
from .basis import BasisKind, SpanBasis, span_basis
from .reparameterisation import ImageMap, Reparameterisation, Unrolled

# How it is decided whether a layer hides the rest of the image: by the depth of each point, by the depth of
# the middle of the layer's things, or by the order of the list.
LayerFront: TypeAlias = Literal["DEPTH", "ANCHOR", "ORDER"]

# Two surfaces are compared at this many values of u and of v. They are similar if no point is farther off
# than this share of the volume's size: rounding only.
SIMILARITY_SAMPLES, SIMILARITY_TOLERANCE = 9, 1e-9


class ControlSample(NamedTuple):
    """Control points of N projectors, with their derivatives by u and v.

    points, du, dv: (m+1, 3, N). tile: (N,) int64, one number a combination of
    the surfaces' tiles. valid: (N,) bool.
    """

    points: Array
    du: Array
    dv: Array
    tile: IndexArray
    valid: BoolArray


class Projectors(NamedTuple):
    """Control points of N projectors. points: (m+1, 3, N). valid: (N,) bool."""

    points: Array
    valid: BoolArray


class VolumeSample(NamedTuple):
    """Q and its derivatives at N points (u, v, t), each (3, N)."""

    position: Array
    du: Array
    dv: Array
    dt: Array


@dataclass(frozen=True)
class ViewingVolume:
    """Control surfaces Q0 (near) to Qm (far) joined by a projector basis.

    Q(u, v, t) = Σ B(i, m)(t) Qi(u, v), t in [0, 1] (paper §4.1); other bases
    replace the Bernstein polynomials. weights: one a surface, above 0, for the
    bases of ``WEIGHTED``; other bases ignore them. Raises ValueError for fewer than two surfaces.
    """

    surfaces: tuple[ControlSurface, ...]
    basis: BasisKind = "BEZIER"
    weights: tuple[float, ...] | None = None

    def __post_init__(self) -> None:
        if len(self.surfaces) < 2:
            raise ValueError("a viewing volume needs at least two control surfaces")

    @cached_property
    def spans(self) -> SpanBasis:
        """The Bézier spans of every projector. Raises ValueError for invalid weights."""
        return span_basis(self.basis, len(self.surfaces), self.weights)

    def controls(self, u: Array, v: Array) -> ControlSample:
        """Control points of the projectors through (u, v), each (N,)."""
        samples = [surface.evaluate(u, v) for surface in self.surfaces]
        tile = np.zeros(len(samples[0].tile), np.int64)
        for sample in samples:
            tile = tile * (int(sample.tile.max(initial=0)) + 1) + sample.tile
        return ControlSample(
            np.stack([s.position for s in samples]),
            np.stack([s.du for s in samples]),
            np.stack([s.dv for s in samples]),
            tile,
            np.logical_and.reduce([s.valid for s in samples]),
        )

    def projectors(self, u: Array, v: Array) -> Projectors:
        """``controls`` without derivatives and tiles, as casting needs them for every pixel."""
        points = np.empty((len(self.surfaces), 3, len(u)))
        valid = np.ones(len(u), bool)
        for surface, target in zip(self.surfaces, points, strict=True):
            target[:], present = surface.positions(u, v)
            valid &= present
        return Projectors(points, valid)

    def evaluate(self, u: Array, v: Array, t: Array) -> VolumeSample:
        """Q, Qu, Qv and Qt at u, v, t, each (N,)."""
        controls = self.controls(u, v)
        return self.evaluate_controls(controls, np.broadcast_to(t, controls.tile.shape))

    def evaluate_controls(self, controls: ControlSample, t: Array) -> VolumeSample:
        """Q, Qu, Qv and Qt of projectors already sampled, at t (N,)."""
        weights, slopes = self.spans.weights(t)
        return VolumeSample(
            np.einsum("kn,kcn->cn", weights, controls.points),
            np.einsum("kn,kcn->cn", weights, controls.du),
            np.einsum("kn,kcn->cn", weights, controls.dv),
            np.einsum("kn,kcn->cn", slopes, controls.points),
        )

    def transformed(self, matrix: Array) -> ViewingVolume:
        """The volume with an affine (4, 4) matrix applied to every surface."""
        return replace(self, surfaces=tuple(s.transformed(matrix) for s in self.surfaces))

    def similarity_of_ends(self) -> tuple[float, Array] | None:
        """Return k and c, (3,), such that the first surface is k times the last one plus c, or None.

        There are such numbers for a volume of two surfaces whose projectors meet in one point, or are
        parallel (k = 1). Then Q0 + s (Q1 - Q0) is for each s the last surface, k + s (1 - k) times as large
        and moved by (1 - s) c.
        """
        if len(self.surfaces) != 2:
            return None
        line = np.linspace(0.0, 1.0, SIMILARITY_SAMPLES)
        u, v = (axis.ravel() for axis in np.meshgrid(line, line))
        first, last = (surface.evaluate(u, v).position for surface in self.surfaces)
        middle = last.mean(axis=1, keepdims=True)
        spread = float(np.vdot(last - middle, last - middle))
        if not spread > 0:
            return None
        k = float(np.vdot(first, last - middle)) / spread
        offset = first - k * last
        c: Array = offset.mean(axis=1)
        size = max(float(np.abs(first).max()), float(np.abs(last).max()))
        return (k, c) if np.abs(offset - c[:, None]).max() <= SIMILARITY_TOLERANCE * size else None


def determinant(sample: VolumeSample) -> Array:
    """det[Qu Qv Qt], (N,): negative in a good volume, a change of sign is a fold."""
    result: Array = np.einsum("cn,cn->n", np.cross(sample.du, sample.dv, axis=0), sample.dt)
    return result


@dataclass(frozen=True)
class Projection:
    """A viewing volume, the part of it that is shown, and its image.

    u_range, v_range: the parameters at the image's borders, within [0, 1].
    aspect: width / height of the image. layers: things that the image shows through other volumes, whose
    numbers begin at 1; those of the volume itself are in layer 0.
    """

    volume: ViewingVolume
    reparameterisation: Reparameterisation = field(default_factory=Unrolled)
    u_range: tuple[float, float] = (0.0, 1.0)
    v_range: tuple[float, float] = (0.0, 1.0)
    aspect: float = 1.0
    layers: tuple[ImageLayer, ...] = ()

    def parameters(self, x: Array, y: Array) -> ImageMap:
        """(u, v), their Jacobian by (x, y) and the mask, for x, y (N,) in [0, 1]."""
        image = self.reparameterisation.map(
            np.atleast_1d(np.asarray(x, np.float64)),
            np.atleast_1d(np.asarray(y, np.float64)),
            self.aspect,
        )
        extent_u, extent_v = self.u_range[1] - self.u_range[0], self.v_range[1] - self.v_range[0]
        jacobian = image.jacobian * np.array([extent_u, extent_v])[:, None, None]
        return ImageMap(
            self.u_range[0] + image.u * extent_u,
            self.v_range[0] + image.v * extent_v,
            jacobian,
            image.mask,
        )

    def projectors(self, x: Array, y: Array) -> Projectors:
        """Control points of the projectors through image positions x, y (N,) in [0, 1].

        valid is False where the image shows nothing or a surface has a hole.
        """
        u, v, mask = self.reparameterisation.points(x, y, self.aspect)
        (u0, u1), (v0, v1) = self.u_range, self.v_range
        if (u0, u1, v0, v1) != (0.0, 1.0, 0.0, 1.0):
            u, v = u0 + u * (u1 - u0), v0 + v * (v1 - v0)
        projectors = self.volume.projectors(u, v)
        return projectors._replace(valid=projectors.valid & mask)

    def subset(self, which: IndexArray) -> Projection:
        """The projection restricted to a subset (n,) of its image positions, if it is bound to some."""
        return self

    def transformed(self, matrix: Array) -> Projection:
        """The projection with its volume, and those of its layers, moved by an affine (4, 4) matrix."""
        layers = tuple(layer.transformed(matrix) for layer in self.layers)
        return replace(self, volume=self.volume.transformed(matrix), layers=layers)

    @property
    def of_layers(self) -> tuple[Projection, ...]:
        """The projection of each layer, by number, the first of layer 0."""
        return (self, *(layer.projection for layer in self.layers))


@dataclass(frozen=True)
class ImageLayer:
    """Things that an image shows through another volume than the rest.

    projection: of the same image. front: see ``LayerFront``. eye: (3,) the point from which depth is measured
    for layer and rest alike. mask: (H, W) from the bottom up, over the whole image: the layer is shown where
    it is at least one half; None for everywhere. halo: distance around the layer's things within which the
    layer shows the things of layer 0, too. feather: the outer share of the halo, in [0, 1], in which these
    fade out.
    """

    projection: Projection
    front: LayerFront
    eye: Array
    mask: Array | None = None
    halo: float = 0.0
    feather: float = 0.0

    def transformed(self, matrix: Array) -> ImageLayer:
        """The layer moved by an affine (4, 4) matrix that scales evenly."""
        scale = float(np.cbrt(abs(np.linalg.det(matrix[:3, :3]))))
        return replace(
            self,
            projection=self.projection.transformed(matrix),
            eye=matrix[:3, :3] @ self.eye + matrix[:3, 3],
            halo=self.halo * scale,
        )

    def halo_share(self, distance: Array) -> Array:
        """The shares, in [0, 1], of its surroundings that the layer shows at distances from its things."""
        if not self.feather:
            return (distance <= self.halo).astype(np.float64)
        left = np.clip((self.halo - distance) / (self.halo * self.feather), 0.0, 1.0)
        share: Array = left * left * (3.0 - 2.0 * left)
        return share

    def shown_at(self, x: Array, y: Array) -> BoolArray:
        """Return whether the mask shows the layer at image positions (n,) in [0, 1], (n,)."""
        if self.mask is None:
            return np.ones(len(x), bool)
        height, width = self.mask.shape
        column = np.clip(x * width, 0, width - 1).astype(np.intp)
        row = np.clip(y * height, 0, height - 1).astype(np.intp)
        shown: BoolArray = self.mask[row, column] >= 0.5
        return shown


def image_derivatives(du: Array, dv: Array, jacobian: Array) -> tuple[Array, Array]:
    """Qx and Qy from Qu and Qv (each (..., 3, N)) and the Jacobian (2, 2, N).

    Formed directly because at a polar centre [Qu Qv] is singular and [Qx Qy] is not.
    """
    (ux, uy), (vx, vy) = jacobian
    return du * ux + dv * vx, du * uy + dv * vy
