# SPDX-License-Identifier: GPL-3.0-or-later
"""A picture joined from those of its anchors, tile by tile."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass, field, replace
from typing import NamedTuple

import numpy as np

from ..anchors.anchor_view import AnchorView, ViewSet, traced_views
from ..anchors.depth_faces import DepthFaces
from ..anchors.image_parts import ImagePart
from ..anchors.join import join, join_sky
from ..anchors.shown_points import ShownPoints, joined_points
from ..bridge.render.render_inputs import RenderInputs
from ..casting.tiles import TileJob, image_tiles, run_tiles
from ..projection.typing import Array, BoolArray, IndexArray
from ..shading.sampling.sample_positions import SamplePositions
from ..shading.typing import Single
from .world_mist import WorldMist

# Samples that are looked up together, for each anchor and at most: NumPy's calls on few hold Python's lock,
# so that threads wait for each other, and many do not stay in the core's cache.
AN_ANCHOR, AT_ONCE = 1 << 14, 1 << 18
# A share of a sample that changes no pixel by more than a step of 16 bits is not seen.
LEAST_LEFT = 1.0 / 65535.0


@dataclass
class Pictures:
    """The pictures of anchors. sets: of the views. colors: (H, W, C) float32 each, row 0 at the bottom.

    depths, lack: of each if there are things without faces, else none: (H, W) along its axis, and whether
    it may lack some of these things.
    """

    views: list[AnchorView]
    sets: list[ViewSet] = field(default_factory=list)
    colors: list[Single] = field(default_factory=list)
    depths: list[Single] = field(default_factory=list)
    lack: list[bool] = field(default_factory=list)


class JoinedPart(NamedTuple):
    """What an image shows through one of its volumes, and the pictures of its anchors."""

    part: ImagePart
    pictures: Pictures
    faces: DepthFaces | None = None

    def with_faces(self, threads: int) -> JoinedPart:
        """The part without stand-ins, with faces made of what renders show instead."""
        bare, pictures = self.part.scene.bare, self.pictures
        if bare is None:
            return self
        views = traced_views(bare, [view.anchor for view in pictures.views], threads)
        faces = DepthFaces.of(bare, views, pictures.depths, pictures.lack)
        pictures.views = views if faces is None else faces.views
        return JoinedPart(replace(self.part, scene=bare), pictures, faces)

    def points(self, x: Array, y: Array, pixel_size: tuple[float, float], pixel_error: float) -> ShownPoints:
        """The points that the part shows at image positions (N,). See ``shown_points``."""
        if self.faces is None:
            return self.part.points(x, y, pixel_size, pixel_error)
        return self.faces.shown_points(self.part.projection, x, y, pixel_size, pixel_error)

    def colors(self, points: ShownPoints) -> tuple[Single, BoolArray]:
        """The colours (n, C) of some of these points, and which have none, (n,). See ``join``."""
        pictures = self.pictures
        if self.faces is None:
            return join(points, pictures.views, pictures.sets, pictures.colors)
        return self.faces.colors(points, pictures.sets, pictures.colors)


def joined_pixels(
    inputs: RenderInputs,
    parts: Sequence[JoinedPart],
    worlds: Pictures,
    mist: WorldMist | None = None,
    progress: Callable[[float], None] | None = None,
) -> tuple[Single, BoolArray]:
    """The picture (H, W, C), and which of its pixels no anchor shows, (H, W).

    parts: of the picture, the rest first. worlds: pictures of the sky. mist: to be added as the last channel.
    progress: is told the share that is done. Raises CastError and Cancelled.
    """
    settings = inputs.settings
    width, height = settings.width, settings.height
    positions = SamplePositions(width, height, settings.samples, settings.pixel_filter)
    joining = _Joining(inputs, parts, worlds, mist)
    pixels = np.zeros((height, width, joining.channels), np.float32)
    holes = np.zeros((height, width), bool)

    def work(job: TileJob) -> tuple[Single, BoolArray]:
        """The channels (n, C) of the pixels of a tile, and which of them have none."""
        count = (job.rows.stop - job.rows.start) * width
        color, weight = np.zeros((count, joining.channels), np.float32), np.zeros(count, np.float32)
        together = max(1, joining.at_once // count)
        for first in range(0, settings.samples, together):
            last = min(first + together, settings.samples)
            places = [positions.of_rows(job.rows, sample) for sample in range(first, last)]
            own, lacks = joining.samples(places)
            color += own.reshape(len(places), count, -1).sum(axis=0)
            weight += (~lacks).reshape(len(places), count).sum(axis=0)
            job.done = last / settings.samples
        empty = weight <= 0.0
        return color / np.where(empty, np.float32(1.0), weight)[:, None], empty

    def finished(rows: slice, made: tuple[Single, BoolArray]) -> None:
        """Write a tile into the picture."""
        pixels[rows] = made[0].reshape(-1, width, joining.channels)
        holes[rows] = made[1].reshape(-1, width)

    run_tiles(work, image_tiles(width, height), settings.threads, finished, progress)
    fill(pixels, holes)
    return pixels, holes


def samples_at_once(anchors: int) -> int:
    """How many samples are to be looked up together in so many anchors."""
    return min(AN_ANCHOR * anchors, AT_ONCE)


class _Joining:
    """Samples of a picture, each joined from the parts that it shows.

    channels: of the pictures. at_once: how many samples are to be looked up together.
    """

    def __init__(
        self,
        inputs: RenderInputs,
        parts: Sequence[JoinedPart],
        worlds: Pictures,
        mist: WorldMist | None,
    ) -> None:
        self._settings, self._layers = inputs.settings, inputs.projection.layers
        self._parts = [part.with_faces(inputs.settings.threads) for part in parts]
        self._worlds = worlds
        self._pixel_size = 1.0 / self._settings.width, 1.0 / self._settings.height
        pictures = [picture for each in parts for picture in each.pictures.colors]
        self._colors = next((each.shape[2] for each in (*pictures, *worlds.colors)), 4)
        self.at_once = samples_at_once(sum(len(each.pictures.views) for each in parts))
        self._mist, self.channels = mist, self._colors + (mist is not None)

    def samples(self, places: Sequence[tuple[Array, Array]]) -> tuple[Single, BoolArray]:
        """The channels (N, C) at image positions x, y, 0 where no anchor shows them, and where that is, (N,).

        places: x, y (n,) of tiles, which are cast one after the other.
        """
        count = sum(len(x) for x, _y in places)
        points = [self._points(each, places) for each in self._parts]
        things = [each.take(np.flatnonzero(each.is_hit)) for each in points]
        color, lacks = np.zeros((count, self.channels), np.float32), np.zeros(count, bool)
        # What the things in front leave of each sample.
        left = np.ones(count, np.float32)
        for place, which in self._from_front(count, things):
            seen = things[place].take(which[left[things[place].number[which]] > LEAST_LEFT])
            own, is_hole = self._parts[place].colors(seen)
            color[seen.number, : self._colors] += own * left[seen.number, None]
            if self._mist is not None:
                part = self._parts[place].part
                density = self._mist.density(part.number, part.projection, seen)
                color[seen.number, -1] += (1.0 - density) * left[seen.number]
            lacks[seen.number] |= is_hole
            # Behind the rest there is nothing: its pictures have the sky.
            alpha = np.clip(own[:, 3], 0.0, 1.0) if place else np.float32(1.0)
            left[seen.number] *= 1.0 - alpha
        if not self._settings.transparent:
            beyond = points[0].take(np.flatnonzero(~points[0].is_hit))
            beyond = beyond.take(np.flatnonzero(left[beyond.number] > LEAST_LEFT))
            own, is_hole = join_sky(beyond, self._worlds.views, self._worlds.colors)
            color[beyond.number, : self._colors] += own * left[beyond.number, None]
            lacks[beyond.number] |= is_hole
        color[lacks] = 0.0
        if self._mist is not None:
            color[~lacks, -1] = 1.0 - color[~lacks, -1]
        return color, lacks

    def _points(self, part: JoinedPart, places: Sequence[tuple[Array, Array]]) -> ShownPoints:
        """The points that a part shows at image positions, numbered on and on."""
        found, begin = [], 0
        for x, y in places:
            points = part.points(x, y, self._pixel_size, self._settings.pixel_error)
            found.append(points._replace(number=points.number + begin))
            begin += len(x)
        return joined_points(found)

    def _from_front(self, count: int, things: Sequence[ShownPoints]) -> Iterator[tuple[int, IndexArray]]:
        """The parts, and which of their points come next of all that a sample shows, from the front."""
        if len(things) == 1:
            yield 0, np.arange(len(things[0].number))
            return
        keys = np.full((len(things), count), np.inf)
        for place, (each, own) in enumerate(zip(self._parts, things, strict=True)):
            keys[place, own.number] = each.part.keys(self._layers, own)
        # Of equal keys the earlier part is in front.
        ranks = np.argsort(np.argsort(keys, axis=0, kind="stable"), axis=0)
        for rank in range(len(things)):
            for place, own in enumerate(things):
                which = np.flatnonzero(ranks[place, own.number] == rank)
                if len(which):
                    yield place, which


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
