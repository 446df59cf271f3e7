# SPDX-License-Identifier: GPL-3.0-or-later
"""Mappings of the image given by grids: ST maps, deformed grids; and the inverse of any mapping by search."""

from __future__ import annotations

from collections.abc import Hashable
from dataclasses import dataclass
from functools import cached_property, lru_cache
from typing import cast

import numpy as np

from ..surfaces.uv_chart import UVChart
from ..typing import Array, BoolArray, IndexArray
from ..volume.reparameterisation import ImageMap, ImagePoints, Reparameterisation

# Samples of a mapping, along each side, between which its inverse is looked for.
SEARCH_SAMPLES = 193
# They reach beyond the image by this share of it: another mapping may lead there.
SEARCH_MARGIN = 0.25
# Seen places are looked for this far beyond the image.
SEEN_MARGIN = 1.0
# Steps of Newton's method from a guess between samples, and its largest error, as a share of the image.
SEARCH_STEPS, SEARCH_ERROR = 16, 1e-10
# The longest step of Newton's method, as a share of the image.
LONGEST_STEP = 0.05
# A mapping whose derivatives span less than this share of their lengths has no inverse there.
SINGULAR = 1e-9
# Mappings whose samples are kept.
KEPT_CHARTS = 8


@dataclass(frozen=True, eq=False)
class STMap(Reparameterisation):
    """An image whose pixels say which place is seen there: s to the right and t up, in [0, 1].

    values: (H, W, 2), row 0 at the bottom, at least 2 × 2; a pixel's value is that of its centre, bilinear
    between centres and going on straight beyond the outermost. present: (H, W) bool, where
    the map has a value. Raises ValueError for other shapes.
    """

    values: Array
    present: BoolArray

    def __post_init__(self) -> None:
        shape = np.shape(self.values)
        if len(shape) != 3 or shape[2] != 2 or min(shape[:2]) < 2 or np.shape(self.present) != shape[:2]:
            raise ValueError("an ST map needs at least 2 × 2 pixels of two numbers")

    @cached_property
    def _flat(self) -> tuple[Array, BoolArray]:
        """Values (2, H·W), 0.5 where there are none, and presence (H·W,)."""
        values = np.where(self.present[..., None], self.values, 0.5).astype(np.float64)
        return np.ascontiguousarray(values.reshape(-1, 2).T), np.ravel(self.present)

    def map(self, x: Array, y: Array, aspect: float) -> ImageMap:
        ((low_left, low_right), (up_left, up_right)), a, b, mask = self._cell(x, y)
        height, width = self.present.shape
        below, above = low_left + a * (low_right - low_left), up_left + a * (up_right - up_left)
        by_x = (1 - b) * (low_right - low_left) + b * (up_right - up_left)
        u, v = below + b * (above - below)
        return ImageMap(u, v, np.stack([by_x * width, (above - below) * height], axis=1), mask)

    def points(self, x: Array, y: Array, aspect: float) -> ImagePoints:
        ((low_left, low_right), (up_left, up_right)), a, b, mask = self._cell(x, y)
        below, above = low_left + a * (low_right - low_left), up_left + a * (up_right - up_left)
        u, v = below + b * (above - below)
        return ImagePoints(u, v, mask)

    def _cell(self, x: Array, y: Array) -> tuple[list[list[Array]], Array, Array, BoolArray]:
        """Values (2, N) of the four pixels about places, rows of columns; shares; whether all have one."""
        height, width = self.present.shape
        across, up = x * width - 0.5, y * height - 0.5
        column = np.clip(np.floor(across), 0, width - 2).astype(np.int64)
        row = np.clip(np.floor(up), 0, height - 2).astype(np.int64)
        first = row * width + column
        flat, present = self._flat
        numbers = [[first, first + 1], [first + width, first + width + 1]]
        corners = [[flat.take(number, axis=1) for number in line] for line in numbers]
        mask = np.logical_and.reduce([present.take(number) for line in numbers for number in line])
        return corners, across - column, up - row, mask

    def image_positions(self, u: Array, v: Array, aspect: float) -> tuple[Array, Array]:
        return found_by_search(self, u, v, aspect)


@dataclass(frozen=True, eq=False)
class DeformedGrid(Reparameterisation):
    """A grid over the image whose points say which place is seen there.

    seen: (R, C, 2), rows upwards, at least 2 × 2, the places of the points at even steps from border to
    border. Between them bicubic pieces of Catmull and Rom (1974), which pass through the points with
    continuous derivatives; beyond them straight on. Raises ValueError for other shapes.
    """

    seen: Array

    def __post_init__(self) -> None:
        shape = np.shape(self.seen)
        if len(shape) != 3 or shape[2] != 2 or min(shape[:2]) < 2 or not np.isfinite(self.seen).all():
            raise ValueError("a deformed grid needs at least 2 × 2 points of two finite numbers")

    @cached_property
    def _padded(self) -> Array:
        """The points with one more line on each side, straight on, (R+2, C+2, 2)."""
        padded = np.pad(np.asarray(self.seen, np.float64), ((1, 1), (1, 1), (0, 0)))
        padded[:, 0], padded[:, -1] = 2 * padded[:, 1] - padded[:, 2], 2 * padded[:, -2] - padded[:, -3]
        padded[0], padded[-1] = 2 * padded[1] - padded[2], 2 * padded[-2] - padded[-3]
        return padded

    def map(self, x: Array, y: Array, aspect: float) -> ImageMap:
        rows, columns = self.seen.shape[:2]
        column, by_u, slope_u = _weights(x, columns)
        row, by_v, slope_v = _weights(y, rows)
        place, by_x, by_y = (np.zeros((2, len(x))) for _ in range(3))
        flat, stride = self._padded.reshape(-1, 2).T, columns + 2
        for j in range(4):
            first = (row + j) * stride + column
            points = [flat.take(first + i, axis=1) for i in range(4)]
            along = sum(w * p for w, p in zip(by_u, points, strict=True))
            place += by_v[j] * along
            by_y += slope_v[j] * along
            by_x += by_v[j] * sum(w * p for w, p in zip(slope_u, points, strict=True))
        return ImageMap(place[0], place[1], np.stack([by_x, by_y], axis=1), np.ones(len(x), bool))

    def image_positions(self, u: Array, v: Array, aspect: float) -> tuple[Array, Array]:
        return found_by_search(self, u, v, aspect)


def _weights(x: Array, count: int) -> tuple[IndexArray, Array, Array]:
    """First padded point of the four about places x, their weights (4, N), and the derivatives of these."""
    along = x * (count - 1)
    cell = np.clip(np.floor(along), 0, count - 2).astype(np.int64)
    free = along - cell
    s = np.clip(free, 0.0, 1.0)
    weights = 0.5 * np.array(
        [((2 - s) * s - 1) * s, (3 * s - 5) * s * s + 2, ((4 - 3 * s) * s + 1) * s, (s - 1) * s * s]
    )
    slopes = 0.5 * np.array([(4 - 3 * s) * s - 1, (9 * s - 10) * s, (8 - 9 * s) * s + 1, (3 * s - 2) * s])
    # Outside of the image along the tangent of its border.
    return cell, weights + (free - s) * slopes, slopes * (count - 1)


def found_by_search(mapping: Reparameterisation, u: Array, v: Array, aspect: float) -> tuple[Array, Array]:
    """Find places at which a mapping sees (u, v), (N,) each: one of several, NaN if none was found.

    A guess by linear pieces between samples, then Newton's method.
    """
    chart, samples = _chart(cast(Hashable, mapping), float(aspect))
    found = chart.find(*(_into_chart(a) for a in (u, v)))
    corners = samples[:, chart.vertices[found.triangle]]
    first, second, third = corners.transpose(2, 0, 1)
    x, y = first + found.weights[0] * (second - first) + found.weights[1] * (third - first)
    missing = found.triangle < 0
    if missing.all():
        return np.full_like(x, np.nan), np.full_like(x, np.nan)
    for _ in range(SEARCH_STEPS):
        image = mapping.map(x, y, aspect)
        off_u, off_v = u - image.u, v - image.v
        inverse, _regular = inverse_jacobian(image.jacobian)
        # A step too far would leave the piece that the guess is on.
        dx, dy = (np.clip(row[0] * off_u + row[1] * off_v, -LONGEST_STEP, LONGEST_STEP) for row in inverse)
        done = np.maximum(np.abs(off_u), np.abs(off_v)) <= SEARCH_ERROR * 1e-3
        if (done | missing).all():
            break
        x, y = x + np.where(done, 0.0, dx), y + np.where(done, 0.0, dy)
    image = mapping.map(x, y, aspect)
    with np.errstate(invalid="ignore"):
        right = np.maximum(np.abs(u - image.u), np.abs(v - image.v)) <= SEARCH_ERROR
    right &= image.mask & ~missing
    return np.where(right, x, np.nan), np.where(right, y, np.nan)


def inverse_jacobian(jacobian: Array) -> tuple[Array, BoolArray]:
    """Inverses (2, 2, N) of Jacobians, 0 for singular ones, and whether each Jacobian is regular."""
    (a, b), (c, d) = jacobian
    determinant = a * d - b * c
    regular = np.abs(determinant) > SINGULAR * np.hypot(a, c) * np.hypot(b, d)
    inverse = np.divide(1.0, determinant, out=np.zeros_like(a), where=regular)
    return np.array([[d, -b], [-c, a]]) * inverse, regular


def _into_chart(seen: Array) -> Array:
    return (seen + SEEN_MARGIN) / (1.0 + 2 * SEEN_MARGIN)


@lru_cache(maxsize=KEPT_CHARTS)
def _chart(mapping: Hashable, aspect: float) -> tuple[UVChart, Array]:
    """Triangles between samples of a mapping in the space of seen places; and the samples' places, (2, S)."""
    line = np.linspace(-SEARCH_MARGIN, 1.0 + SEARCH_MARGIN, SEARCH_SAMPLES)
    x, y = (a.ravel() for a in np.meshgrid(line, line))
    image = cast(Reparameterisation, mapping).map(x, y, aspect)
    first = (np.arange(SEARCH_SAMPLES - 1)[:, None] * SEARCH_SAMPLES + np.arange(SEARCH_SAMPLES - 1)).ravel()
    right, up, far = first + 1, first + SEARCH_SAMPLES, first + SEARCH_SAMPLES + 1
    triangles = np.stack([[first, right, far], [first, far, up]]).transpose(2, 0, 1).reshape(-1, 3)
    seen = np.stack([_into_chart(image.u), _into_chart(image.v)], axis=1)
    usable = (image.mask & np.isfinite(seen).all(axis=1))[triangles].all(axis=1)
    # Triangles in the image itself come first: of several places the lowest triangle counts.
    outside = np.maximum(np.abs(x - 0.5), np.abs(y - 0.5))[triangles].min(axis=1) > 0.5
    triangles = triangles[usable][np.argsort(outside[usable], kind="stable")]
    if not len(triangles):
        triangles = np.zeros((1, 3), np.int64)
        seen = np.zeros_like(seen)
    return UVChart(seen[triangles], triangles), np.stack([x, y])
