# SPDX-License-Identifier: GPL-3.0-or-later
"""Rules that all planning of chords shares: where chords end, how they are graded, when a piece is halved.

Three planners follow them: ``schedule`` for a tile within a pixel error, ``exact.chord_bounds`` for chords
whose distance is certain, and ``cycles.chords`` for the sheets of a Cycles rig.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from ...projection.typing import Array, IndexArray
from ...projection.volume.bezier import restrict

# The end of a chord moves by this times q'' h². A chord over a step h strays ‖q''‖ h²/8 from its
# curve; shifting its ends by half of that leaves half the error on either side.
SHIFT = 1.0 / 16.0

# The first and the last chord of a span have one end that is not shifted, and so twice the
# error: √(2/3) of the length makes up for it.
END_CHORD = 0.8165

# More certain chords a span than this are never cast; they are added by the factor until the bound holds.
MOST_CERTAIN = 1 << 16
GROWTH = 1.03


@dataclass(frozen=True)
class Chords:
    """The chords of a tile's projectors, n in all.

    breaks: (n+1,) increasing t, those of the spans among them. ends: (n+1, K) weights of the K control
    points that give the chords' ends. span: (n,) the span of each chord.
    """

    breaks: Array
    ends: Array
    span: NDArray[np.intp]

    @property
    def count(self) -> int:
        """The number of chords."""
        return len(self.span)

    def ends_of(self, points: Array, chord: IndexArray) -> tuple[Array, Array]:
        """The start and end of the chords ``chord`` (M,) of projectors (K, 3, M), each (3, M)."""
        ends = self.ends.T
        return (
            np.einsum("kn,kcn->cn", ends.take(chord, 1), points),
            np.einsum("kn,kcn->cn", ends.take(chord + 1, 1), points),
        )


def joined(parts: Sequence[Chords]) -> Chords:
    """Return the chords of consecutive spans as one list: each part begins where the one before ends."""
    return Chords(
        np.concatenate([p.breaks[:-1] for p in parts] + [parts[-1].breaks[-1:]]),
        np.concatenate([p.ends[:-1] for p in parts] + [parts[-1].ends[-1:]]),
        np.concatenate([p.span for p in parts]),
    )


def half_cosine(angle: Array) -> Array:
    """s = (1 - cos θ)/2 in [0, 1] for angles θ in [0, π]: even steps in θ are fine at both ends of s."""
    return 0.5 - 0.5 * np.cos(angle)


def running_total(share: Array) -> Array:
    """The running sum of ``share`` (n,), from 0: (n+1,)."""
    return np.concatenate([[0.0], np.cumsum(share)])


def graded(total: Array, edges: Array, count: int) -> Array:
    """Breaks (count+1,) of a span, in its own parameter, at equal quantiles of a demand for chords.

    total: (m,) the demand before each of ``edges`` (m,), angles as in ``half_cosine``. The first and the
    last chord are shorter, by END_CHORD.
    """
    shares = np.ones(count)
    shares[[0, -1]] = END_CHORD
    quantiles = running_total(shares) * (total[-1] / shares.sum())
    return half_cosine(np.interp(quantiles, total, edges))


def fewest_certain(
    edges: Array, demand: Array, epsilon: float, bound: Callable[[Array], float]
) -> tuple[Array, float]:
    """The fewest breaks (n+1,) from the first to the last of ``edges`` whose bound is epsilon or less.

    demand: the chords needed between the edges, about. bound: the largest distance of chords between given
    breaks from their curves. Returns it too: it is above epsilon only where MOST_CERTAIN do not suffice.
    """
    total = running_total(demand)
    count = int(np.clip(np.ceil(total[-1]), 1, MOST_CERTAIN))
    while True:
        breaks = np.interp(np.linspace(0.0, total[-1], count + 1), total, edges)
        breaks[0], breaks[-1] = edges[0], edges[-1]
        distance = bound(breaks)
        if distance <= epsilon or count >= MOST_CERTAIN:
            return breaks, distance
        count = min(max(int(count * GROWTH), count + 1), MOST_CERTAIN)


def halved_until_steady(
    weights: Array, edges: Array, factor: float, place: Callable[[Array], Array] = np.asarray
) -> tuple[Array, Array]:
    """Halve pieces until a rational span's denominator varies by at most ``factor`` in each.

    weights: (d+1,), the denominator's Bézier coefficients; those of a piece bound it there. edges: of the
    pieces. place: the span's parameter at given edges. Returns the new edges (P+1,) and the factors (P,).
    """
    while True:
        local = place(edges)
        parts = restrict(weights[:, None], local[:-1], local[1:])
        varied = parts.max(axis=0) / parts.min(axis=0)
        much = np.flatnonzero(varied > factor)
        if len(much) == 0:
            return edges, varied
        edges = np.insert(edges, much + 1, 0.5 * (edges[much] + edges[much + 1]))
