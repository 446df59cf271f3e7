# SPDX-License-Identifier: GPL-3.0-or-later
"""Clay: a distance field on a regular grid, to which balls and tubes are added and from which they are taken.

Smooth minimum: Quilez, Smooth Minimum (2013). Mesh: naive surface nets, Gibson, Constrained Elastic Surface
Nets (MICCAI 1998).
"""

from __future__ import annotations

import itertools
from collections.abc import Sequence

import numpy as np
from numpy.typing import ArrayLike, NDArray

from ..mesh import Array

# The field far away from all clay, in units of the scene.
FAR = 10.0
# The least distance from a ball's middle, in radii.
TINY = 1e-6
# The four corners round an edge of the grid, by steps along the two other axes.
ROUND = ((0, 0), (1, 0), (1, 1), (0, 1))


class Clay:
    """Signed distances, negative inside, at the points of a grid; a tool touches its neighbourhood alone."""

    def __init__(self, low: ArrayLike, high: ArrayLike, step: float, felt: float = 0.1) -> None:
        """felt: the distance from clay in which the field is right, at least the widest melt that follows."""
        self.low, self.step, self.felt = np.asarray(low, float), step, felt
        count = np.ceil((np.asarray(high, float) - self.low) / step).astype(int) + 1
        self.field = np.full(count, FAR, np.float32)

    def ball(self, middle: ArrayLike, radii: ArrayLike, melt: float = 0.0, cut: bool = False) -> None:
        """Add an ellipsoid, or cut it away. melt: the width over which it goes over into the rest."""
        middle, radii = np.asarray(middle, float), np.broadcast_to(np.asarray(radii, float), 3)
        part, places = self._near(middle - radii, middle + radii, melt)
        own = [(place - at) / radius for place, at, radius in zip(places, middle, radii, strict=True)]
        near = np.maximum(np.sqrt(sum(value**2 for value in own)), TINY)
        slope = np.sqrt(sum((value / radius) ** 2 for value, radius in zip(own, radii, strict=True)))
        self._join(part, near * (near - 1.0) / np.maximum(slope, TINY / radii.min()), melt, cut)

    def tube(self, points: ArrayLike, radii: ArrayLike, melt: float = 0.0, cut: bool = False) -> None:
        """Add a chain of round cones through points (n, 3), or cut it away. radii: (n,) or one."""
        points = np.asarray(points, float)
        radii = np.broadcast_to(np.asarray(radii, float), len(points))
        widest = float(radii.max())
        part, places = self._near(points.min(axis=0) - widest, points.max(axis=0) + widest, melt)
        field = np.full([place.size for place in places], FAR)
        for number in range(len(points) - 1):
            (start, end), (wide, narrow) = points[number : number + 2], radii[number : number + 2]
            away = [place - at for place, at in zip(places, start, strict=True)]
            along = end - start
            share = sum(value * way for value, way in zip(away, along, strict=True)) / (along @ along)
            share = np.clip(share, 0.0, 1.0)
            gap = np.sqrt(sum((value - share * way) ** 2 for value, way in zip(away, along, strict=True)))
            field = np.minimum(field, gap - (wide + share * (narrow - wide)))
        self._join(part, field, melt, cut)

    def add(self, other: Clay, melt: float) -> None:
        """Add other clay, whose grid has the same step and is put on the nearest points of this one."""
        first = np.round((other.low - self.low) / self.step).astype(int)
        part = tuple(slice(at, at + count) for at, count in zip(first, other.field.shape, strict=True))
        self._join(part, other.field, melt, False)

    def below(self, height: float, melt: float = 0.0) -> None:
        """Cut away everything below a height."""
        z = self.low[2] + self.step * np.arange(self.field.shape[2])
        self._join((slice(None),) * 3, np.broadcast_to(z - height, self.field.shape), melt, True)

    def surface(self) -> tuple[Array, NDArray[np.int64]]:
        """Points (n, 3) and quads (m, 4), which face outwards, of the surface of the clay."""
        inside = self.field < 0
        corner = [slice(None, -1), slice(1, None)]
        total = np.zeros([count - 1 for count in self.field.shape])
        place = np.zeros((*total.shape, 3))
        for axis, across in itertools.product(range(3), itertools.product((0, 1), repeat=2)):
            first = list(across)
            first.insert(axis, 0)
            second = list(across)
            second.insert(axis, 1)
            a = self.field[tuple(corner[k] for k in first)]
            b = self.field[tuple(corner[k] for k in second)]
            crossed = (a < 0) != (b < 0)
            share = np.where(crossed, a / np.where(crossed, a - b, 1.0), 0.0)
            total += crossed
            for k in range(3):
                place[..., k] += crossed * (share if k == axis else first[k])
        used = total > 0
        number = np.cumsum(used).reshape(used.shape) - 1
        points = (np.argwhere(used) + place[used] / total[used][:, None]) * self.step + self.low
        return points, np.concatenate([self._quads(axis, inside, number) for axis in range(3)])

    @staticmethod
    def _quads(axis: int, inside: NDArray[np.bool_], number: NDArray[np.int64]) -> NDArray[np.int64]:
        """The quads round the edges along an axis that the surface crosses."""
        lines, cells = np.moveaxis(inside, axis, 0), np.moveaxis(number, axis, 0)
        crossed = np.add(np.argwhere((lines[:-1] != lines[1:])[:, 1:-1, 1:-1]), (0, 1, 1))
        i, j, k = crossed.T
        quads = np.stack([cells[i, j - 1 + a, k - 1 + b] for a, b in ROUND], axis=1)
        # The two other axes keep their order, which for the second axis is a left-handed one.
        turned = lines[i, j, k] == (axis == 1)
        return np.where(turned[:, None], quads[:, ::-1], quads)

    def _near(self, low: Array, high: Array, melt: float) -> tuple[tuple[slice, ...], Sequence[Array]]:
        """The part of the grid that a tool touches, and its coordinates along each axis."""
        margin = melt + self.felt + 2 * self.step
        first = np.maximum(np.floor((low - margin - self.low) / self.step).astype(int), 0)
        last = np.minimum(np.ceil((high + margin - self.low) / self.step).astype(int), self.field.shape)
        part = tuple(slice(a, max(b, a)) for a, b in zip(first, last, strict=True))
        lines = [at + self.step * np.arange(p.start, p.stop) for at, p in zip(self.low, part, strict=True)]
        return part, np.meshgrid(*lines, indexing="ij", sparse=True)

    def _join(self, part: tuple[slice, ...], tool: Array, melt: float, cut: bool) -> None:
        old = self.field[part]
        sign = -1.0 if cut else 1.0
        old, tool = sign * old, tool
        if melt:
            share = np.clip(0.5 + 0.5 * (old - tool) / melt, 0.0, 1.0)
            made = old + share * (tool - old) - melt * share * (1.0 - share)
        else:
            made = np.minimum(old, tool)
        self.field[part] = sign * made
