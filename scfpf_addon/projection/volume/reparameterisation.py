# SPDX-License-Identifier: GPL-3.0-or-later
"""Re-parameterisation: from the image to the parameters of the volume (paper §3.4).

Image positions (x, y) are in [0, 1]², origin bottom-left. A re-parameterisation
answers with (u, v), the Jacobian, and a mask of the positions that show anything.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import NamedTuple, Protocol

import numpy as np

from ..typing import Array, BoolArray

# A polar centre is moved out by this share of the image, so that du/dx stays
# finite; the products Qu·du/dx that anything uses are unaffected.
POLAR_CENTRE = 1e-12


class ImageMap(NamedTuple):
    """(u, v) of N image positions.

    u, v: (N,). jacobian: (2, 2, N), [[du/dx, du/dy], [dv/dx, dv/dy]].
    mask: (N,) bool, False where the image shows nothing.
    """

    u: Array
    v: Array
    jacobian: Array
    mask: BoolArray


class ImagePoints(NamedTuple):
    """ImageMap without the Jacobian."""

    u: Array
    v: Array
    mask: BoolArray


class Reparameterisation(Protocol):
    """A mapping from image positions to parameters in [0, 1]²."""

    def map(self, x: Array, y: Array, aspect: float) -> ImageMap:
        """x, y: (N,) in [0, 1]; aspect: width / height of the image, > 0."""
        ...

    def points(self, x: Array, y: Array, aspect: float) -> ImagePoints:
        """``map`` without the Jacobian; kinds override it where that saves work."""
        image = self.map(x, y, aspect)
        return ImagePoints(image.u, image.v, image.mask)

    def image_positions(self, u: Array, v: Array, aspect: float) -> tuple[Array, Array]:
        """The inverse of ``map``: x and y of parameters u, v (N,) in [0, 1]."""
        ...


@dataclass(frozen=True)
class Unrolled(Reparameterisation):
    """u = x, v = y: the image is the near surface unrolled."""

    def points(self, x: Array, y: Array, aspect: float) -> ImagePoints:
        return ImagePoints(x, y, np.ones(len(x), bool))

    def map(self, x: Array, y: Array, aspect: float) -> ImageMap:
        """The (u, v) of image positions; the whole image shows something."""
        one, zero = np.ones_like(x), np.zeros_like(x)
        return ImageMap(x, y, np.array([[one, zero], [zero, one]]), np.ones(len(x), bool))

    def image_positions(self, u: Array, v: Array, aspect: float) -> tuple[Array, Array]:
        return u, v


@dataclass(frozen=True)
class Polar(Reparameterisation):
    """u is the angle from +x counter-clockwise, v the distance from the centre.

    v = 1 on the circle that touches the image's nearer borders; outside it
    nothing is shown.
    """

    def map(self, x: Array, y: Array, aspect: float) -> ImageMap:
        scale_x, scale_y = 2 * max(aspect, 1.0), 2 * max(1 / aspect, 1.0)
        a, b = (x - 0.5) * scale_x, (y - 0.5) * scale_y
        r = np.hypot(a, b)
        centre = r < POLAR_CENTRE
        a, r = np.where(centre, POLAR_CENTRE, a), np.where(centre, POLAR_CENTRE, r)
        b = np.where(centre, 0.0, b)
        turn = np.arctan2(b, a) / (2 * np.pi)
        around = 2 * np.pi * r * r
        jacobian = np.array(
            [
                [-b / around * scale_x, a / around * scale_y],
                [a / r * scale_x, b / r * scale_y],
            ]
        )
        return ImageMap(turn % 1.0, r, jacobian, r <= 1.0)

    def image_positions(self, u: Array, v: Array, aspect: float) -> tuple[Array, Array]:
        angle = 2 * np.pi * u
        scale_x, scale_y = 2 * max(aspect, 1.0), 2 * max(1 / aspect, 1.0)
        return 0.5 + v * np.cos(angle) / scale_x, 0.5 + v * np.sin(angle) / scale_y


@dataclass(frozen=True)
class Framed(Reparameterisation):
    """A rectangle of the image, seen as an image of its own: its places in [0, 1]², others outside of that.

    centre: (x, y) and size: (width, height), shares of the image.
    """

    centre: tuple[float, float] = (0.5, 0.5)
    size: tuple[float, float] = (1.0, 1.0)

    def map(self, x: Array, y: Array, aspect: float) -> ImageMap:
        """The places in the rectangle; the whole image leads somewhere."""
        across, up, zero = (
            np.full_like(x, 1 / self.size[0]),
            np.full_like(y, 1 / self.size[1]),
            np.zeros_like(x),
        )
        image = self.points(x, y, aspect)
        return ImageMap(image.u, image.v, np.array([[across, zero], [zero, up]]), image.mask)

    def points(self, x: Array, y: Array, aspect: float) -> ImagePoints:
        u, v = ((p - c) / s + 0.5 for p, c, s in zip((x, y), self.centre, self.size, strict=True))
        return ImagePoints(u, v, np.ones(len(x), bool))

    def image_positions(self, u: Array, v: Array, aspect: float) -> tuple[Array, Array]:
        (x, y), (width, height) = self.centre, self.size
        return x + (u - 0.5) * width, y + (v - 0.5) * height


def reparameterisation(kind: str) -> Reparameterisation:
    """The re-parameterisation named RECTANGLE or POLAR; ValueError otherwise."""
    if kind == "RECTANGLE":
        return Unrolled()
    if kind == "POLAR":
        return Polar()
    raise ValueError(f"unknown reparameterization {kind!r}")


def cropped_ranges(
    u_range: tuple[float, float], v_range: tuple[float, float], widening: float
) -> tuple[tuple[float, float], tuple[float, float]]:
    """The largest ranges within [0, 1] about the same centres whose u : v is ``widening`` times as large."""
    ranges = np.array([u_range, v_range], np.float64)
    centres, halves = ranges.mean(axis=1), np.diff(ranges, axis=1)[:, 0] / 2 * (widening, 1.0)
    halves *= (np.minimum(centres, 1 - centres) / halves).min()
    low, high = (centres - halves).tolist(), (centres + halves).tolist()
    return (low[0], high[0]), (low[1], high[1])
