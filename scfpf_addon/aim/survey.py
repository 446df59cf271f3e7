# SPDX-License-Identifier: GPL-3.0-or-later
"""A survey of a solution: how far things and the background are from their places, and where farthest.

Pins are a few points of a thing. What lies between them may bend, and their distances do not tell.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from ..projection.typing import Array
from ..projection.volume.inverse import Inverse
from ..projection.volume.viewing_volume import Projection
from .judge import NEARLY_ALL, Judge, near_places, percentile, visibility
from .released import Released

# Of so many pixels of the judged image one is looked at for the background.
EACH = 2


class Spread(NamedTuple):
    """Distances of visible points from their places in the image, in pixels, inf for points that are lost.

    nearly_all: at most so for 95 % of the points. worst: the largest. place: (2,), the image position that
    shows the worst point, or that shall show it if it is lost.
    """

    nearly_all: float
    worst: float
    place: Array


def spread_of(judge: Judge, after: Projection, points: Array, positions: Array) -> Spread | None:
    """The spread of world points (3, N) about image positions (2, N); None if none is visible.

    Points that something hides, or whose places are outside the image, do not count.
    """
    inside = ((positions >= 0.0) & (positions <= 1.0)).all(axis=0)
    points, positions = points[:, inside], positions[:, inside]
    place = near_places(after, points, positions)
    _, hidden_by = visibility(judge.scene, after, place, judge.width)
    counts = np.flatnonzero(hidden_by < 0)
    if not len(counts):
        return None
    place = Inverse(place.u[counts], place.v[counts], place.t[counts], place.found[counts])
    positions = positions[:, counts]
    pixels = judge.distances(place, positions)
    worst = int(pixels.argmax())
    shown = np.array([place.u[worst], place.v[worst]]) if place.found[worst] else positions[:, worst]
    return Spread(percentile(pixels, NEARLY_ALL), float(pixels[worst]), shown)


def background_spread(judge: Judge, after: Projection, released: Released | None = None) -> Spread | None:
    """The spread of the background outside the halos and of what is released, where the judge looks."""
    points, pixels, objects = judge.background(EACH)
    positions = np.stack(judge.centres)[:, pixels]
    if released is not None:
        kept = ~released.covers(points, objects)
        points, positions = points[:, kept], positions[:, kept]
    return spread_of(judge, after, points, positions)
