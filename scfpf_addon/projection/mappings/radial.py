# SPDX-License-Identifier: GPL-3.0-or-later
"""Mappings of the image that move places along lines through a centre: curves, lens distortions, lenses.

A mapping leads from a place of the image to the place that is seen there, in the image without the mapping.
Distances r from the centre are in halves of the image's shorter side: the circle r = 1 about its middle
touches the nearer borders.
"""

from __future__ import annotations

from abc import abstractmethod
from dataclasses import dataclass
from functools import cached_property
from typing import NamedTuple

import numpy as np

from ..typing import Array, BoolArray
from ..volume.reparameterisation import ImageMap, ImagePoints, Reparameterisation

# Radii below this count as the centre, where f(r)/r is f'(0).
CENTRE = 1e-12
# Samples that bracket the inverse of a profile; Newton's method does the rest.
BRACKETS = 1025
# Steps of Newton's method, halving where it would leave its bracket; each settles half the digits or a bit.
INVERSE_STEPS = 60
# Radii are found to this share of the largest one.
INVERSE_ERROR = 1e-15
# A rising profile without a limit is followed up to here, far beyond the corners of any image.
FARTHEST = 64.0


class Profile(NamedTuple):
    """f(r) at N radii: share = f(r) / r, slope = f'(r), each (N,). mask: (N,) bool, where f is defined."""

    share: Array
    slope: Array
    mask: BoolArray


class Radial(Reparameterisation):
    """Places move from distance r to f(r), on the same side of the centre."""

    centre: tuple[float, float]

    @abstractmethod
    def profile(self, r: Array) -> Profile:
        """f at radii r (N,), 0 or above."""

    @property
    def limit(self) -> float:
        """The radius up to which f rises; what lies beyond is not looked for by the inverse."""
        return FARTHEST

    def map(self, x: Array, y: Array, aspect: float) -> ImageMap:
        """The (u, v) of image positions; x and y may lie outside of the image."""
        sx, sy = max(aspect, 1.0), max(1 / aspect, 1.0)
        a, b = (x - self.centre[0]) * 2 * sx, (y - self.centre[1]) * 2 * sy
        r = np.hypot(a, b)
        share, slope, mask = self.profile(r)
        safe = np.maximum(r, CENTRE)
        a, b = a / safe, b / safe
        bend = slope - share
        jacobian = np.array(
            [
                [share + bend * a * a, bend * a * b * (sy / sx)],
                [bend * a * b * (sx / sy), share + bend * b * b],
            ]
        )
        return ImageMap(*self._moved(x, y, share), jacobian, mask)

    def points(self, x: Array, y: Array, aspect: float) -> ImagePoints:
        share, _, mask = self.profile(self._radius(x, y, aspect))
        return ImagePoints(*self._moved(x, y, share), mask)

    def image_positions(self, u: Array, v: Array, aspect: float) -> tuple[Array, Array]:
        """The place that shows (u, v), (N,) each, NaN if no place does."""
        wanted = self._radius(u, v, aspect)
        radius = self.inverse_radius(wanted)
        centre = wanted < CENTRE
        share = np.divide(radius, wanted, out=np.ones_like(wanted), where=~centre)
        return self._moved(u, v, share)

    def _radius(self, x: Array, y: Array, aspect: float) -> Array:
        a = (x - self.centre[0]) * (2 * max(aspect, 1.0))
        radius: Array = np.hypot(a, (y - self.centre[1]) * (2 * max(1 / aspect, 1.0)))
        return radius

    def _moved(self, x: Array, y: Array, share: Array) -> tuple[Array, Array]:
        cx, cy = self.centre
        return cx + (x - cx) * share, cy + (y - cy) * share

    def inverse_radius(self, wanted: Array) -> Array:
        """The least radii at which f has the values wanted (N,); nan beyond its largest one."""
        top = self.limit
        line = np.linspace(0.0, 1.0, BRACKETS)
        # Even steps near the centre, where images are, and wider ones beyond.
        radii = line * top if top <= 4.0 else line * 2.0 + line**4 * (top - 2.0)
        highest = np.maximum.accumulate(radii * self.profile(radii).share)
        cell = np.searchsorted(highest, wanted)
        missing = (cell >= BRACKETS) | ~np.isfinite(wanted)
        cell = np.clip(cell, 1, BRACKETS - 1)
        low, high = radii[cell - 1], radii[cell]
        r = 0.5 * (low + high)
        # Most are found in a few steps, after which only the others go on.
        left = np.flatnonzero(~missing)
        low, high, goal = low[left], high[left], wanted[left]
        for _ in range(INVERSE_STEPS):
            now = r[left]
            share, slope, _ = self.profile(now)
            off = now * share - goal
            low, high = np.where(off <= 0.0, now, low), np.where(off >= 0.0, now, high)
            with np.errstate(divide="ignore", invalid="ignore", over="ignore"):
                step = now - off / slope
            inside = (step >= low) & (step <= high)
            moved = np.where(inside, step, 0.5 * (low + high))
            r[left] = moved
            going = np.flatnonzero(np.abs(moved - now) > INVERSE_ERROR * top)
            if not len(going):
                break
            left, low, high, goal = left[going], low[going], high[going], goal[going]
        return np.where(missing, np.nan, r)


@dataclass(frozen=True, eq=False)
class RadialCurve(Radial):
    """f is a smooth curve through points (r, f), monotone between them; straight on beyond the last.

    points_of: (K, 2), K at least 2, r strictly rising from 0; the first f counts as 0, or the centre would be
    a hole. Between points: cubic pieces with the slopes of Fritsch and Carlson, "Monotone piecewise
    cubic interpolation" (1980). Raises ValueError for other points.
    """

    points_of: Array
    centre: tuple[float, float] = (0.5, 0.5)

    def __post_init__(self) -> None:
        points = np.asarray(self.points_of, np.float64)
        if points.ndim != 2 or points.shape[1] != 2 or len(points) < 2 or not np.isfinite(points).all():
            raise ValueError("a radial curve needs at least two points of two numbers")
        if points[0, 0] != 0.0 or not (np.diff(points[:, 0]) > 0.0).all():
            raise ValueError("the points of a radial curve must begin at radius 0 and rise in radius")

    @cached_property
    def _knots(self) -> tuple[Array, Array, Array]:
        """Radii, values and slopes at the points."""
        r, f = np.array(self.points_of, np.float64).T
        f[0] = 0.0
        return r, f, monotone_slopes(r, f)

    def profile(self, r: Array) -> Profile:
        at, f, slopes = self._knots
        cell = np.clip(np.searchsorted(at, r, side="right") - 1, 0, len(at) - 2)
        width = at[cell + 1] - at[cell]
        s = np.minimum((r - at[cell]) / width, 1.0)
        f0, f1, m0, m1 = f[cell], f[cell + 1], slopes[cell] * width, slopes[cell + 1] * width
        a, b = 2 * (f0 - f1) + m0 + m1, 3 * (f1 - f0) - 2 * m0 - m1
        value = ((a * s + b) * s + m0) * s + f0
        slope = ((3 * a * s + 2 * b) * s + m0) / width
        value = value + np.maximum(r - at[-1], 0.0) * slope
        share = np.divide(value, r, out=np.full_like(r, slopes[0]), where=r > CENTRE)
        return Profile(share, slope, np.ones(len(r), bool))


def monotone_slopes(x: Array, y: Array) -> Array:
    """Slopes (K,) at points of a curve such that cubic pieces rise or fall where the points do."""
    width = np.diff(x)
    secant = np.diff(y) / width
    if len(secant) == 1:
        return np.repeat(secant, 2)
    slopes = np.empty(len(x))
    # The parabola through three points, then as much less as monotony asks for.
    slopes[1:-1] = (secant[:-1] * width[1:] + secant[1:] * width[:-1]) / (width[:-1] + width[1:])
    slopes[0], slopes[-1] = 2 * secant[0] - slopes[1], 2 * secant[-1] - slopes[-2]
    slopes[1:-1][secant[:-1] * secant[1:] <= 0.0] = 0.0
    before, after = slopes[:-1], slopes[1:]
    before[before * secant < 0.0] = 0.0
    after[after * secant < 0.0] = 0.0
    length = np.hypot(before, after)
    scale = np.minimum(1.0, 3 * np.abs(secant) / np.where(length > 0.0, length, 1.0))
    # A slope is part of two pieces: the lesser share counts for both.
    least = np.ones(len(x))
    least[:-1] = scale
    least[1:] = np.minimum(least[1:], scale)
    return slopes * least


@dataclass(frozen=True)
class Distortion(Radial):
    """f(r) = r (1 + k1 q + k2 q² + k3 q³) / (1 + k4 q + k5 q² + k6 q³), with q = (r / radius)².

    k4 = k5 = k6 = 0 gives the radial part of Brown's polynomial (1966), k4 alone the division model of
    Fitzgibbon (2001). A rational function as in Claus and Fitzgibbon (2005). OpenCV's rational model has
    these six and the inverse direction. The image ends where f stops rising.
    """

    numerator: tuple[float, ...] = (0.0, 0.0, 0.0)
    denominator: tuple[float, ...] = (0.0, 0.0, 0.0)
    radius: float = 1.0
    centre: tuple[float, float] = (0.5, 0.5)

    @cached_property
    def _polynomials(self) -> tuple[np.polynomial.Polynomial, np.polynomial.Polynomial]:
        return (
            np.polynomial.Polynomial((1.0, *self.numerator)),
            np.polynomial.Polynomial((1.0, *self.denominator)),
        )

    @cached_property
    def _limit(self) -> float:
        over, under = self._polynomials
        q = np.polynomial.Polynomial((0.0, 1.0))
        # Numerator of f': where it vanishes f turns back, where the denominator does f has a pole.
        rising = (over + 2 * q * over.deriv()) * under - 2 * q * over * under.deriv()
        ends = [FARTHEST**2 / self.radius**2]
        for polynomial in (rising, under):
            with np.errstate(over="ignore", divide="ignore", invalid="ignore"):
                roots = polynomial.trim(0.0).roots()
            roots = roots[np.isfinite(roots)]
            real = roots.real[(np.abs(roots.imag) <= 1e-12 * np.abs(roots)) & (roots.real > 0.0)]
            ends += real.tolist()
        return float(np.sqrt(min(ends))) * self.radius

    @property
    def limit(self) -> float:
        return self._limit

    def profile(self, r: Array) -> Profile:
        over, under = self._polynomials
        q = (r / self.radius) ** 2
        top, bottom = over(q), under(q)
        with np.errstate(divide="ignore", invalid="ignore", over="ignore"):
            share = top / bottom
            slope = share + 2 * q * (over.deriv()(q) * bottom - top * under.deriv()(q)) / bottom**2
        mask = (r <= self.limit) & np.isfinite(share) & np.isfinite(slope)
        return Profile(np.where(mask, share, 1.0), np.where(mask, slope, 1.0), mask)


@dataclass(frozen=True)
class MagicLens(Radial):
    """A magic lens: the image is magnified within a circle and unchanged outside.

    radius: of the circle, above 0. magnification: above 0, less than 1 shrinks. falloff: the share of
    the radius, [0, 1], over which the magnification fades smoothly. One-to-one if the magnification is above
    1 - falloff. Without a falloff it must be at least 1, and the image lacks what the rim hides.
    """

    radius: float = 0.5
    magnification: float = 2.0
    falloff: float = 0.5
    centre: tuple[float, float] = (0.5, 0.5)

    def profile(self, r: Array) -> Profile:
        inner, least = self.radius * (1.0 - self.falloff), 1.0 / self.magnification
        width = self.radius - inner
        value, slope = np.where(r < inner, r * least, r), np.where(r < inner, least, 1.0)
        ring = np.flatnonzero((r >= inner) & (r < self.radius))
        if width > 0.0 and len(ring):
            s = (r[ring] - inner) / width
            start, m0, m1 = inner * least, width * least, width
            a, b = 2 * (start - self.radius) + m0 + m1, 3 * (self.radius - start) - 2 * m0 - m1
            value[ring] = ((a * s + b) * s + m0) * s + start
            slope[ring] = ((3 * a * s + 2 * b) * s + m0) / width
        share = np.divide(value, r, out=slope.copy(), where=r > CENTRE)
        return Profile(share, slope, np.ones(len(r), bool))


@dataclass(frozen=True)
class CurvedDisplay(Reparameterisation):
    """The content of an upright cylindrical screen that lets a viewer see the flat image (paper §3.4).

    arc: the angle that the screen spans about its axis, radians, (0, π). distance: of the viewer from the
    screen's middle, as a multiple of its radius; 1 is the axis. Places on the screen are even along the arc
    and up. Each shows the point that a ray from the viewer through it meets of the flat image behind it, the
    smallest image that covers the screen. Raises ValueError if the viewer would stand at or before the
    screen's ends.
    """

    arc: float
    distance: float = 1.0

    def __post_init__(self) -> None:
        if self._depth(0.5 * self.arc) <= 0.0:
            raise ValueError(
                "the viewer of the curved display is in front of its ends: move away, or reduce the arc"
            )

    def _depth(self, angle: float) -> float:
        """The distance of a place on the screen in front of the viewer, in radii."""
        return float(self.distance - 1.0 + np.cos(angle))

    @property
    def _across(self) -> float:
        """The depth of the ends over the arc: half the flat image is half the arc, seen from there."""
        return self._depth(0.5 * self.arc) / self.arc

    def map(self, x: Array, y: Array, aspect: float) -> ImageMap:
        """The (u, v) of image positions; the mask is False where the screen would be behind the viewer."""
        angle = (x - 0.5) * self.arc
        sine, cosine = np.sin(angle), np.cos(angle)
        depth = self.distance - 1.0 + cosine
        mask = (depth > 0.0) & (np.abs(angle) < np.pi)
        depth = np.where(mask, depth, 1.0)
        scale, up = self._across, y - 0.5
        zero = np.zeros_like(x)
        jacobian = np.array(
            [
                [scale * self.arc * (cosine * depth + sine * sine) / depth**2, zero],
                [up * (self.arc * scale) * sine * self.arc / depth**2, self.arc * scale / depth],
            ]
        )
        return ImageMap(0.5 + scale * sine / depth, 0.5 + up * (self.arc * scale) / depth, jacobian, mask)

    def image_positions(self, u: Array, v: Array, aspect: float) -> tuple[Array, Array]:
        tangent = (u - 0.5) / self._across
        # sin θ = k (e + cos θ): the farther end of the ray's way through the circle.
        beyond = (self.distance - 1.0) * tangent / np.hypot(1.0, tangent)
        with np.errstate(invalid="ignore"):
            angle = np.arctan(tangent) + np.arcsin(beyond)
        depth = self.distance - 1.0 + np.cos(angle)
        return 0.5 + angle / self.arc, 0.5 + (v - 0.5) * depth / (self.arc * self._across)
