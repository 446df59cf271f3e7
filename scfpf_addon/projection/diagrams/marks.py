# SPDX-License-Identifier: GPL-3.0-or-later
"""Marks on a drawn volume: the image's rim, the far rim, safe areas, and arrows along u and v.

As in ``diagram``: segments (S, 2, 3) float32 in the space of the projection.
"""

from __future__ import annotations

from itertools import pairwise

import numpy as np

from ..surfaces.surface import ControlSurface
from ..typing import Array, BoolArray
from ..volume.reparameterisation import ImageMap
from ..volume.viewing_volume import Projection
from .segments import Segments, image_rim, joined, ranged, segments

# The far rim is dashed: this many dashes a side, each this share of its way long.
DASHES = 12
DASH_SHARE = 0.6
# Halvings that find the rim of what an image shows: to float32's 2^-24 of the image, as it is drawn.
RIM_STEPS = 24
# Segments of each side of the image's rim and of a safe area.
RIM_SEGMENTS = 48
# Arrows, as shares of the u and v ranges: distance from the corner, length, size of the head.
ARROW_MARGIN = 0.04
ARROW_LENGTH = 0.16
ARROW_HEAD = 0.02
ARROW_STEPS = 16
# An arrow goes to the opposite border where the surface is narrower than this share of that border,
# as about a pole.
NARROW = 0.25


def far_rim(projection: Projection) -> Segments:
    """The border of the far surface, dashed: so it is told from the near one, which is whole."""
    # Centred, so that the two sides of a seam have theirs in the same places.
    start = (np.arange(DASHES) + (1.0 - DASH_SHARE) / 2) / DASHES
    # Four points a dash follow the bend of a surface.
    along = (start[:, None] + np.linspace(0.0, DASH_SHARE / DASHES, 4)).ravel()
    along = np.tile(along, (4, 1))
    nought, one = np.zeros_like(along[0]), np.ones_like(along[0])
    x = np.stack([along[0], one, 1 - along[0], nought])
    y = np.stack([nought, along[0], one, 1 - along[0]])
    sample = projection.volume.surfaces[-1].evaluate(*ranged(projection, x.ravel(), y.ravel()))
    shape = (4 * DASHES, 4)
    drawn = sample.position.reshape(3, *shape)
    return segments(drawn, sample.valid.reshape(shape), sample.tile.reshape(shape))


def image_frame(projection: Projection, resolution: int = RIM_SEGMENTS) -> Segments:
    """The rim of the image on the near surface: resolution segments for each side of the image.

    Where the re-parameterisation shows only a part of the image the rim is that
    of the part, taken as star-shaped about the image's centre.
    """
    x, y = image_rim(resolution)
    inside, outside = np.zeros(len(x)), np.ones(len(x))

    def shown(share: Array) -> BoolArray:
        """Return whether the image shows points at shares (N,) of the way from centre to rim, (N,)."""
        return projection.parameters(0.5 + (x - 0.5) * share, 0.5 + (y - 0.5) * share).mask

    inside[shown(outside)] = 1.0
    for _ in range(0 if inside.all() else RIM_STEPS):
        middle = (inside + outside) / 2
        mask = shown(middle)
        inside, outside = np.where(mask, middle, inside), np.where(mask, outside, middle)
    image = projection.parameters(0.5 + (x - 0.5) * inside, 0.5 + (y - 0.5) * inside)
    return _on_near_surface(projection, image)


def safe_area(projection: Projection, margin_x: float, margin_y: float) -> Segments:
    """The border of a safe area of the image, on the near surface; whatever the image shows of it.

    margin_x, margin_y: in [0, 1], distance from the image's borders as a share of half its size.
    """
    x, y = image_rim(RIM_SEGMENTS)
    image = projection.parameters(0.5 + (x - 0.5) * (1 - margin_x), 0.5 + (y - 0.5) * (1 - margin_y))
    return _on_near_surface(projection, image)


def _on_near_surface(projection: Projection, image: ImageMap) -> Segments:
    """A polyline over the image as it lies on the near surface; the parts that the image shows."""
    sample = projection.volume.surfaces[0].evaluate(image.u, image.v)
    return segments(sample.position[:, None], (sample.valid & image.mask)[None], sample.tile[None])


def direction_arrows(projection: Projection) -> tuple[Segments, Segments]:
    """Arrows along u and arrows along v, from the corner where both are least.

    There is one of each on the near surface and one on the far, since either may be a point or too small to
    be seen. At a pole they stand at the opposite border.
    """
    volume = projection.volume
    ends = (volume.surfaces[0], volume.surfaces[-1])
    along_u, along_v = (joined([_arrow(surface, projection, axis) for surface in ends]) for axis in (0, 1))
    return along_u, along_v


def _arrow(surface: ControlSurface, projection: Projection, axis: int) -> Segments:
    """Shaft and head of the arrow along u (0) or v (1), at the border of the other parameter without a pole.

    Both borders are asked for at once: a surface's answer costs more by the call than by the point.
    """
    tip = ARROW_MARGIN + ARROW_LENGTH
    shaft = np.linspace(ARROW_MARGIN, tip, ARROW_STEPS + 1)
    barb = np.array([tip - 1.5 * ARROW_HEAD, tip])
    along = np.concatenate([shaft, barb, barb])
    aside = np.concatenate([np.zeros_like(shaft), [-ARROW_HEAD, 0.0], [ARROW_HEAD, 0.0]])
    along, beside = np.tile(along, 2), np.concatenate([ARROW_MARGIN + aside, 1.0 - ARROW_MARGIN + aside])
    sample = surface.evaluate(*ranged(projection, *((along, beside) if axis == 0 else (beside, along))))
    drawn = sample.position.reshape(3, 2, -1)
    valid, tile = sample.valid.reshape(2, -1), sample.tile.reshape(2, -1)
    here, there = np.linalg.norm(np.diff(drawn[..., : len(shaft)], axis=2), axis=0).sum(axis=1)
    chosen = 0 if here >= NARROW * there else 1
    cuts = np.cumsum([0, len(shaft), len(barb), len(barb)])
    return joined(
        [
            segments(drawn[:, [chosen], i:j], valid[[chosen], i:j], tile[[chosen], i:j])
            for i, j in pairwise(cuts)
        ]
    )
