# SPDX-License-Identifier: GPL-3.0-or-later
"""The view of an anchor, traced by the caster, and the places of points in its picture."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import NamedTuple

import numpy as np

from ..casting.common.cancellation import raise_if_cancelled
from ..casting.tiles import TileJob, run_tiles
from ..projection.arrays import product
from ..projection.typing import Array, IndexArray
from ..shading.typing import Single
from .anchor import Anchor
from .seen_scene import SeenScene

# Rows of an anchor's picture whose depths are traced at once.
ROWS = 256


@dataclass(frozen=True)
class AnchorView:
    """An anchor and what it sees.

    depth: (H, W) float32, row 0 at the bottom, the distances along its axis of what the caster meets in its
    pixels' centres, inf for nothing.
    """

    anchor: Anchor
    depth: Single


@dataclass(frozen=True)
class ViewSet:
    """Anchors, by their numbers, whose colours are mixed; a picture may be a mixture of several sets.

    first: are asked for all points. rest: for points that none of the first shows. share: of the set in the
    picture.
    """

    first: tuple[int, ...]
    rest: tuple[int, ...] = ()
    share: float = 1.0


def traced_depth(seen: SeenScene, anchor: Anchor) -> Single:
    """The distances along an anchor's axis of the first hits of its pixels' centres, (H, W), inf for none."""
    (width, height), scene = anchor.size, seen.scene
    found = np.full((height, width), np.inf, np.float32)
    reach = np.float32(anchor.end - anchor.start)
    for first in range(0, height, ROWS):
        raise_if_cancelled()
        rows = np.arange(first, min(first + ROWS, height))
        column, row = np.tile(np.arange(width), len(rows)), np.repeat(rows, width)
        begin, way = anchor.rays(column, row)
        origin = ((begin - scene.centre[:, None]) * scene.scale).astype(np.float32)
        limits = np.full(len(column), reach, np.float32)
        distance = seen.distances(origin, (way * scene.scale).astype(np.float32), limits)
        depth = np.where(distance < reach, distance + np.float32(anchor.start), np.float32(np.inf))
        found[rows] = depth.reshape(len(rows), width)
    return found


def traced_views(scene: SeenScene, anchors: Sequence[Anchor], threads: int = 0) -> list[AnchorView]:
    """Trace the views of anchors. threads: 0 for all cores. Raises Cancelled."""
    found: dict[int, Single] = {}

    def work(job: TileJob) -> Single:
        """The depths of one anchor."""
        return traced_depth(scene, anchors[job.rows.start])

    def finished(which: slice, depth: Single) -> None:
        """Keep the depths of an anchor."""
        found[which.start] = depth

    run_tiles(work, [slice(k, k + 1) for k in range(len(anchors))], threads, finished)
    return [AnchorView(anchor, found[k]) for k, anchor in enumerate(anchors)]


def without_unused(
    views: Sequence[AnchorView], sets: Sequence[ViewSet]
) -> tuple[list[AnchorView], list[ViewSet]]:
    """Leave out the views that no set has; their sets name the others."""
    used = sorted({number for own in sets for number in (*own.first, *own.rest)})
    places = {number: place for place, number in enumerate(used)}
    first = [tuple(places[number] for number in own.first) for own in sets]
    rest = [tuple(places[number] for number in own.rest) for own in sets]
    kept = [ViewSet(*each) for each in zip(first, rest, (own.share for own in sets), strict=True)]
    return [views[number] for number in used], kept


class Placed(NamedTuple):
    """Points (n,) in an anchor's picture, float32.

    across, up: in pixels from the centre of its lower left pixel. depth: along its axis. slope: (2, n), of
    rays by depth. side: of a pixel at the points, in world units.
    """

    across: Single
    up: Single
    depth: Single
    slope: Single
    side: Single


def placed(anchor: Anchor, position: Array) -> Placed:
    """Place world points (3, n) in an anchor's picture. Those at or behind its eye have a depth <= 0."""
    local = product(anchor.matrix[:3, :3].T, position - anchor.matrix[:3, 3:]).astype(np.float32)
    depth = -local[2]
    texel = np.float32(anchor.texel)
    if anchor.is_parallel:
        slope, flat, side = np.zeros_like(local[:2]), local[:2], np.full_like(depth, texel)
    else:
        with np.errstate(divide="ignore", invalid="ignore", over="ignore"):
            slope = local[:2] / depth
        flat, side = slope, texel * depth
    across = (flat[0] - np.float32(anchor.window.left)) / texel - np.float32(0.5)
    up = (flat[1] - np.float32(anchor.window.bottom)) / texel - np.float32(0.5)
    return Placed(across, up, depth, slope, side)


def nearest_pixels(view: AnchorView, position: Array) -> tuple[IndexArray, Single, Single]:
    """The pixels, as flat indices (n,), nearest to world points (3, n).

    Also by how many sides of a pixel what they show lies behind the points, and these behind the near plane.
    """
    anchor = view.anchor
    at = placed(anchor, position)
    column = np.clip(np.rint(at.across).astype(np.intp), 0, anchor.size[0] - 1)
    row = np.clip(np.rint(at.up).astype(np.intp), 0, anchor.size[1] - 1)
    ahead: Single = (view.depth[row, column] - at.depth) / at.side
    return row * anchor.size[0] + column, ahead, (at.depth - np.float32(anchor.start)) / at.side
