# SPDX-License-Identifier: GPL-3.0-or-later
"""Cast space: where its origin is, its unit, and how near the origin small things are.

Float32 is finest at the origin, which belongs among the small things. Beside one large thing, a ground of
1,000 km or a sky, these are a small part of the scene: they are found by the sizes of triangles.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from ...projection.arrays import median
from ...projection.typing import Array, BoolArray, IndexArray

# Vertices whose median stands for that of all.
ENOUGH_FOR_MEDIAN = 1 << 15

# Triangles that stand for all, and the smallest that count besides: a few small things among many large ones.
SAMPLES, SMALLEST = 1 << 12, 1 << 11

# Of two places with small things, far from each other, one becomes the origin: most halvings until it is
# found, and the share of the small things that may be there.
HALVINGS, NEAREST = 16, 0.25

# The core reaches so many times as far as the nearest small things, or as they are large. Embree's error on
# a triangle as large as the core, 2⁻²² of it, is then 2e-5 of the small things' distance from each other: no
# pixel shows that.
CORE = 64.0

# A scene that reaches this many times as far as the core is worth a core.
WORTH = 4.0

# Triangles smaller than this share of the scene count as so large: dust does not determine the core alone.
DUST = 1e-9


class CastSpace(NamedTuple):
    """A transform from world space, (p - centre) · scale, and the core.

    centre: (3,) world. scale: cast-space units in a world unit. core: the distance from the origin, in cast
    units, within which small things are; inf if the scene has no large things besides.
    """

    centre: Array
    scale: float
    core: float = np.inf

    @classmethod
    def around(cls, points: Array) -> CastSpace:
        """The space of vertices (V, 3), without a core."""
        # The median, not the middle of the bounds, which may be the middle of a sky. A subset determines it
        # well enough.
        some = points[:: 1 + len(points) // ENOUGH_FOR_MEDIAN]
        return cls._filled(points, np.array([median(places) for places in some.T]))

    def with_core(
        self, vertices: Array, triangles: NDArray[np.int32], usable: BoolArray, sizes: NDArray[np.float32]
    ) -> CastSpace | None:
        """The space around the small things of the scene that fills this one, None if it has no large ones.

        vertices: (V, 3), world. triangles: (T, 3), those that are usable (T,) finite. sizes: (T,) lengths of
        their edges, cast units.
        """
        centre, near, size = small_things(vertices, triangles, usable, sizes)
        core = CORE * max(near, size / self.scale)
        # From one centre a scene reaches at most twice as far as from another one in it.
        if core * WORTH * self.scale > 1.0:
            return None
        space = self._filled(vertices.take(np.unique(triangles[usable]), axis=0), centre)
        return space._replace(core=core * space.scale)

    @classmethod
    def _filled(cls, points: Array, centre: Array) -> CastSpace:
        """The space around a centre in which points (N, 3) reach to 1."""
        # Axis by axis: NumPy takes several times as long for all three at once.
        reach = max(
            float(max(places.max() - middle, middle - places.min()))
            for places, middle in zip(points.T, centre, strict=True)
        )
        return cls(centre, 1.0 / reach if reach > 0.0 else 1.0)


def small_things(
    vertices: Array, triangles: NDArray[np.int32], usable: BoolArray, sizes: NDArray[np.floating]
) -> tuple[Array, float, float]:
    """The place (3,) among the small triangles of a scene, their distance from it, and their size.

    vertices: (V, 3). triangles: (T, 3). usable: (T,). sizes: (T,), in any unit, that of the size returned.
    """
    some, count = _sample(usable, sizes)
    # Squares: a hundred triangles of 1 m count as a million of 100 m.
    size = np.maximum(sizes.take(some).astype(np.float64), DUST * float(sizes.max()))
    weights = count * size**-2.0
    places = vertices.take(triangles[:, 0].take(some), axis=0)
    centre = _densest(places, weights)
    near = _quantile(np.abs(places - centre).max(axis=1), weights, NEAREST)
    return centre, near, _quantile(size, weights, 0.5)


def _sample(usable: BoolArray, sizes: NDArray[np.float32]) -> tuple[IndexArray, Array]:
    """Numbers of triangles that stand for all usable ones (n,), and for how many each stands (n,)."""
    which = np.flatnonzero(usable)
    if len(which) <= SAMPLES + SMALLEST:
        return which, np.ones(len(which))
    order = np.argpartition(sizes.take(which), SMALLEST)
    step = len(which) // SAMPLES
    spread = order[SMALLEST::step]
    some = which.take(np.concatenate([order[:SMALLEST], spread]))
    return some, np.repeat([1.0, float(step)], [SMALLEST, len(spread)])


def _densest(places: Array, weights: Array) -> Array:
    """A point among most of the weights of places (N, 3): the median, of the nearer half again and again."""
    for _ in range(HALVINGS):
        centre = np.array([_quantile(axis, weights, 0.5) for axis in places.T])
        away = np.abs(places - centre).max(axis=1)
        near = away <= _quantile(away, weights, 0.5)
        if near.all():
            break
        places, weights = places[near], weights[near]
    return centre


def _quantile(values: Array, weights: Array, share: float) -> float:
    """The value below which a share of the weights (N,) lie."""
    order = np.argsort(values)
    total = np.cumsum(weights.take(order))
    return float(values[order[np.searchsorted(total, share * total[-1])]])
