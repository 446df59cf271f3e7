# SPDX-License-Identifier: GPL-3.0-or-later
"""Projectors sampled to plan chords, and the footprint of a pixel along them."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from ...projection.typing import Array, BoolArray
from ...projection.volume.basis import SpanBasis
from ...projection.volume.viewing_volume import Projection, image_derivatives
from ..scene.cast_triangles import LARGEST_COORDINATE

# Sampled projectors of a tile, besides its corners.
SAMPLES = 56

# Where pixels are squeezed more than this in one direction (near a pole, at a
# fold) the error counts against this share of the wide direction: the chords
# would multiply for a difference that nobody sees.
MOST_SQUEEZE = 64.0

# Chords closer to the curve than this share of its coordinates are lost on
# Embree's float32 (2⁻²⁴ a rounding).
FINEST = 2.0**-22


class Curves(NamedTuple):
    """Sampled projectors with their derivatives in x and in y, (K, 3, S) each."""

    points: Array
    dx: Array
    dy: Array

    def only(self, chosen: BoolArray | slice) -> Curves:
        """The curves that are ``chosen``."""
        return Curves(*(control[:, :, chosen] for control in self))

    def finite(self, largest: float = np.inf) -> BoolArray:
        """Return whether all coordinates of each curve are below ``largest``, (S,)."""
        with np.errstate(invalid="ignore"):
            finite: BoolArray = np.logical_and.reduce(
                [(np.abs(control) < largest).all(axis=(0, 1)) for control in self]
            )
        return finite


class Footprint(NamedTuple):
    """Pixels in space, at G places of S projectors.

    position, tangent, bend: (3, G, S), Q and its derivatives in the span. dx, dy: (3, G, S), a pixel's sides
    across the projector. xx, yy, xy: (G, S), their scalar products. wide, narrow: (G, S), squares of
    a pixel's widths in its widest direction and the other.
    """

    position: Array
    tangent: Array
    bend: Array
    dx: Array
    dy: Array
    xx: Array
    yy: Array
    xy: Array
    wide: Array
    narrow: Array


def curves_through(projection: Projection, x: Array, y: Array) -> tuple[Curves, BoolArray, BoolArray]:
    """The projectors through image positions x, y (S,), with derivatives by these.

    Also whether the surfaces exist there, and whether the image does, each (S,).
    """
    image = projection.parameters(x, y)
    with np.errstate(invalid="ignore", over="ignore"):
        controls = projection.volume.controls(image.u, image.v)
        dx, dy = image_derivatives(controls.du, controls.dv, image.jacobian)
    return Curves(controls.points, dx, dy), controls.valid, image.mask


def sample_curves(
    projection: Projection,
    x: Array,
    y: Array,
    mask: BoolArray,
    pixel_size: tuple[float, float],
    columns: int | None = None,
) -> Curves:
    """A spread of a tile's projectors with derivatives by one pixel: its outermost ones and SAMPLES within.

    columns: given if they are whole rows of that many pixels.
    """
    present = np.flatnonzero(mask)
    if len(present) > SAMPLES:
        if columns is not None and len(present) == len(mask):
            last = len(mask) - 1
            outermost = [0, columns - 1, last - columns + 1, last]
        else:
            px, py = x[present], y[present]
            outermost = [int(f(a)) for a in (px, py, px + py, px - py) for f in (np.argmin, np.argmax)]
        # Multiples of the golden section spread evenly over rows and columns alike.
        spread = (np.arange(SAMPLES) * 0.6180339887498949 % 1.0 * len(present)).astype(np.int64)
        present = present[np.concatenate([outermost, spread])]
    points, dx, dy = curves_through(projection, x[present], y[present])[0]
    curves = Curves(points, dx * pixel_size[0], dy * pixel_size[1])
    # A surface need not have a derivative everywhere.
    return curves.only(curves.finite(LARGEST_COORDINATE))


def blend(weights: Array, points: Array) -> Array:
    """Sums of points (K, 3, S) by weights (G, K): (3, G, S)."""
    sums: Array = (weights @ points.reshape(len(points), -1)).reshape(-1, *points.shape[1:])
    return sums.swapaxes(0, 1)


def across(vector: Array, tangent: Array) -> Array:
    """The part of vectors (3, …) across tangents (3, …); all of a vector where the tangent vanishes."""
    squared = (tangent**2).sum(axis=0)
    inverse = np.divide(1.0, squared, out=np.zeros_like(squared), where=squared > 0.0)
    part: Array = vector - tangent * ((vector * tangent).sum(axis=0) * inverse)
    return part


def footprint(curves: Curves, spans: SpanBasis, span: int, local: Array) -> Footprint:
    """The footprints of pixels at ``local`` (G,) in a span."""
    here, slope, second = spans.within(span, local)
    position, dx, dy = (blend(here, control) for control in curves)
    tangent, bend = blend(slope, curves.points), blend(second, curves.points)
    dx, dy = across(dx, tangent), across(dy, tangent)
    xx, yy, xy = (dx * dx).sum(axis=0), (dy * dy).sum(axis=0), (dx * dy).sum(axis=0)
    wide, narrow = pixel_widths(xx, yy, xy)
    return Footprint(
        position=position,
        tangent=tangent,
        bend=bend,
        dx=dx,
        dy=dy,
        xx=xx,
        yy=yy,
        xy=xy,
        wide=wide,
        narrow=narrow,
    )


def pixel_widths(xx: Array, yy: Array, xy: Array) -> tuple[Array, Array]:
    """Squares of a pixel's widths in space, in its widest direction and the other.

    xx, yy, xy: the scalar products of the pixel's sides, of any shape.
    """
    wide: Array = 0.5 * (xx + yy + np.sqrt((xx - yy) ** 2 + 4.0 * xy * xy))
    area = np.maximum(xx * yy - xy * xy, 0.0)
    return wide, np.divide(area, wide, out=np.zeros_like(area), where=wide > 0.0)


def pixel_length(wide: Array, narrow: Array) -> Array:
    """The length that counts as one pixel: its narrow width, or a share of the other if that is more."""
    size: Array = np.sqrt(np.maximum(narrow, wide / MOST_SQUEEZE**2))
    return size
