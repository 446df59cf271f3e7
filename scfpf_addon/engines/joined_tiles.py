# SPDX-License-Identifier: GPL-3.0-or-later
"""A picture joined from those of its anchors, tile by tile."""

from __future__ import annotations

from dataclasses import dataclass, field

import numpy as np

from ..anchors.anchor_view import AnchorView, ViewSet
from ..anchors.join import join, join_sky
from ..anchors.plan import PlanLimits
from ..anchors.seen_scene import SeenScene
from ..anchors.shown_points import shown_points
from ..bridge.render.render_inputs import RenderInputs
from ..casting.tiles import TileJob, image_tiles, run_tiles
from ..projection.typing import BoolArray
from ..shading.sampling.sample_positions import SamplePositions
from ..shading.typing import Single


@dataclass
class Pictures:
    """The pictures of anchors. sets: of the views. colors: (H, W, C) float32 each, row 0 at the bottom."""

    views: list[AnchorView]
    sets: list[ViewSet] = field(default_factory=list)
    colors: list[Single] = field(default_factory=list)


def joined_pixels(
    inputs: RenderInputs, scene: SeenScene, seen: Pictures, worlds: Pictures
) -> tuple[Single, BoolArray]:
    """The picture (H, W, C), and which of its pixels no anchor shows, (H, W).

    scene: what the camera sees. worlds: pictures of the sky. Raises CastError and Cancelled.
    """
    settings, projection = inputs.settings, inputs.projection
    width, height, angle = settings.width, settings.height, PlanLimits().angle
    positions = SamplePositions(width, height, settings.samples, settings.pixel_filter)
    pixel_size = 1.0 / width, 1.0 / height
    channels = next((each.shape[2] for each in (*seen.colors, *worlds.colors)), 4)
    pixels = np.zeros((height, width, channels), np.float32)
    holes = np.zeros((height, width), bool)

    def work(job: TileJob) -> tuple[Single, np.ndarray]:
        """The channels (n, C) of the pixels of a tile, and which of them have none."""
        count = (job.rows.stop - job.rows.start) * width
        color, weight = np.zeros((count, channels), np.float32), np.zeros(count, np.float32)
        for sample in range(settings.samples):
            x, y = positions.of_rows(job.rows, sample)
            points = shown_points(scene, projection, x, y, pixel_size, settings.pixel_error)
            # Where there is no projector, the picture shows nothing.
            present = np.zeros(count, bool)
            present[points.number] = True
            weight[~present] += 1.0
            things = points.take(np.flatnonzero(points.is_hit))
            own, lacks = join(things, seen.views, seen.sets, seen.colors, angle)
            color[things.number] += own
            weight[things.number] += ~lacks
            if settings.transparent:
                weight[points.number[~points.is_hit]] += 1.0
            else:
                beyond = points.take(np.flatnonzero(~points.is_hit))
                own, lacks = join_sky(beyond, worlds.views, worlds.colors)
                color[beyond.number] += own
                weight[beyond.number] += ~lacks
        empty = weight <= 0.0
        return color / np.where(empty, np.float32(1.0), weight)[:, None], empty

    def finished(rows: slice, made: tuple[Single, np.ndarray]) -> None:
        """Write a tile into the picture."""
        pixels[rows] = made[0].reshape(-1, width, channels)
        holes[rows] = made[1].reshape(-1, width)

    run_tiles(work, image_tiles(width, height), settings.threads, finished)
    fill(pixels, holes)
    return pixels, holes


def fill(pixels: Single, holes: BoolArray) -> None:
    """Fill the holes (H, W) of a picture (H, W, C) from their borders inwards, with what is beside them."""
    left = holes.copy()
    while left.any() and not left.all():
        row, column = np.nonzero(left)
        total, count = np.zeros((len(row), pixels.shape[2]), np.float32), np.zeros(len(row), np.float32)
        for step in ((-1, 0), (1, 0), (0, -1), (0, 1)):
            beside = (
                np.clip(row + step[0], 0, left.shape[0] - 1),
                np.clip(column + step[1], 0, left.shape[1] - 1),
            )
            is_there = ~left[beside]
            total += pixels[beside] * is_there[:, None]
            count += is_there
        found = count > 0.0
        own = row[found], column[found]
        pixels[own] = total[found] / count[found, None]
        left[own] = False
