# SPDX-License-Identifier: GPL-3.0-or-later
"""Motion blur: several moments while the shutter is open, and the samples at each."""

from __future__ import annotations

from functools import lru_cache
from typing import NamedTuple

import numpy as np

from ...projection.typing import Array
from ...projection.volume.viewing_volume import Projection
from ..sampling.sample_sets import THIRD, shuffled
from .depth_of_field import DepthOfField
from .shading_scene import Scene

# Nodes of the table that inverts a shutter's curve.
NODES = 257


class Moment(NamedTuple):
    """A projection, in world space, and a scene at one time. depth_of_field: in
    world space.

    Moments without motion share one scene, the same object as the frame's.
    """

    projection: Projection
    scene: Scene
    depth_of_field: DepthOfField | None = None


@lru_cache
def moment_of_samples(samples: int, moments: int) -> tuple[int, ...]:
    """The moment of each sample, by number.

    Any first samples are spread over all moments, independently of their places in the pixel.
    """
    return tuple((shuffled(samples, THIRD) * moments // samples).tolist())


def shutter_times(count: int, opens: float, closes: float, weight: Array | None = None) -> Array:
    """``count`` times of equal exposure between two, (count,) in order.

    weight: (k,) opening of the shutter at equal steps of the time, >= 0; None if it is fully open.
    """
    share = (np.arange(count) + 0.5) / count
    if weight is not None:
        place = np.linspace(0.0, 1.0, NODES)
        openness = np.interp(place, np.linspace(0.0, 1.0, len(weight)), np.maximum(weight, 0.0))
        exposed = np.concatenate([[0.0], np.cumsum(0.5 * (openness[1:] + openness[:-1]))])
        if exposed[-1] > 0.0:
            share = np.interp(share, exposed / exposed[-1], place)
    times: Array = opens + (closes - opens) * share
    return times
