# SPDX-License-Identifier: GPL-3.0-or-later
"""Faces made of what anchors' renders show in front of the caster's hits: strokes, hair, points.

An engine's depth tells where the thing in a pixel is. Each pixel that is clearly nearer than the caster's hit
becomes a small face at that depth, joined to its neighbours at like depths. Projectors are cast at these
faces as at others: they march through the depths of all anchors at once, in bent volumes too. The faces of
each anchor are half a pixel too wide or too narrow, so one anchor alone decides at each place: the best one
from which nothing hides it. What that anchor sees through is passed.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from ..casting.common.hits import Hits
from ..casting.continuation import TileProjectors
from ..casting.scene.cast_scene import CastScene
from ..projection.typing import Array, BoolArray, IndexArray
from ..projection.volume.viewing_volume import Projection
from ..shading.typing import Single
from .anchor import Anchor
from .anchor_view import AnchorView, ViewSet, nearest_pixels
from .join import join
from .ranks import MOST_ANCHORS, NO_RANK, ranked
from .seen_scene import SeenScene
from .shown_points import ShownPoints, from_all_sides, points_of

# A pixel is in front of a hit if it is nearer by so many of its sides, and by this share of the distance.
NEARER, ROUNDED = 0.5, 1e-5
# Depth buffers have so many steps, by the inverse of the distance, from the nearest one on.
DEPTH_STEPS = float(1 << 22)
# Engine and caster may differ about a pixel at an outline: it is within so many sides of a hit beside it.
AT_OUTLINE = 2.0
# Neighbours within so many sides are one surface, and a point is at a pixel's depth within as many.
JOINED = 4.0
# Faces that a projector passes, at most.
MOST_PASSED = 32
# Anchors that are asked about a point, at most.
ASKED = 6


def sides(anchor: Anchor, depth: Single) -> Single:
    """The sides of an anchor's pixels at depths, in world units."""
    texel = np.float32(anchor.texel)
    found: Single = np.full_like(depth, texel) if anchor.is_parallel else texel * depth
    return found


def in_front(view: AnchorView, depth: Single) -> BoolArray:
    """Return which pixels (H, W) of an anchor show what is in front of the caster's hits.

    depth: (H, W), as rendered, along the axis.
    """
    anchor, traced = view.anchor, view.depth
    side = sides(anchor, depth)
    slack = np.float32(NEARER) * side + np.float32(ROUNDED) * depth
    if not anchor.is_parallel and anchor.start > 0.0:
        slack = slack + depth * depth * np.float32(1.0 / (anchor.start * DEPTH_STEPS))
    with np.errstate(invalid="ignore", over="ignore"):
        found: BoolArray = (depth > anchor.start) & (depth < anchor.end) & (depth < traced - slack)
    if not found.any():
        return found
    row, column = np.nonzero(found)
    own, reach, hit = depth[row, column], AT_OUTLINE * side[row, column], traced[row, column]
    around = np.pad(traced, 1, constant_values=np.inf)
    at_outline = np.zeros(len(row), bool)
    with np.errstate(invalid="ignore"):
        for step in np.ndindex(3, 3):
            beside = around[row + step[0], column + step[1]]
            at_outline |= (np.abs(own - beside) <= reach) & (beside < hit - slack[row, column])
    found[row[at_outline], column[at_outline]] = False
    return found


def faces_of(anchor: Anchor, depth: Single, which: BoolArray) -> tuple[Array, IndexArray]:
    """A square for each pixel ``which`` (H, W) of an anchor, at its depth (H, W), bent to meet others.

    Returns vertices (V, 3) in world space, and triangles (T, 3) that face the anchor.
    """
    row, column = np.nonzero(which)
    own = depth[row, column].astype(np.float64)
    reach = JOINED * sides(anchor, depth)[row, column]
    around = np.pad(np.where(which, depth, np.inf), 1, constant_values=np.inf)
    corners = []
    for across, up in ((-1, -1), (1, -1), (1, 1), (-1, 1)):
        total, count = own.copy(), np.ones(len(row))
        for step, step_up in ((across, 0), (0, up), (across, up)):
            beside = around[row + 1 + step_up, column + 1 + step]
            is_near = np.abs(beside - own) <= reach
            total += np.where(is_near, beside, 0.0)
            count += is_near
        begin, way = anchor.rays(column + np.float64(0.5 * across), row + np.float64(0.5 * up))
        corners.append(begin + way * (total / count - anchor.start))
    vertices = np.stack(corners, axis=2)
    first = 4 * np.arange(len(row), dtype=np.int32)[:, None]
    triangles = np.concatenate([first + np.array(half, np.int32) for half in ((0, 1, 2), (0, 2, 3))])
    return vertices.reshape(3, -1).T, triangles


@dataclass(frozen=True)
class DepthFaces:
    """A scene, and what its anchors' renders show besides.

    traced: the views of the anchors. views: the same, with the rendered depth where something is in front of
    hits. faces: of these pixels. lack: whether each view may lack something that others show.
    """

    scene: SeenScene
    traced: list[AnchorView]
    views: list[AnchorView]
    faces: CastScene
    lack: Sequence[bool]

    @classmethod
    def of(
        cls, scene: SeenScene, views: Sequence[AnchorView], depths: Sequence[Single], lack: Sequence[bool]
    ) -> DepthFaces | None:
        """The faces of rendered depths, (H, W) of each view; None if there are none."""
        found, vertices, triangles, count = [], [], [], 0
        for view, depth in zip(views, depths, strict=True):
            which = in_front(view, depth)
            found.append(view)
            if which.any():
                found[-1] = AnchorView(view.anchor, np.where(which, depth, view.depth))
                corners, halves = faces_of(view.anchor, depth, which)
                vertices.append(corners)
                triangles.append(halves + np.int32(count))
                count += len(corners)
        if not count:
            return None
        faces = CastScene(np.concatenate(vertices), np.concatenate(triangles))
        return cls(scene, list(views), found, faces, lack)

    def shown_points(
        self,
        projection: Projection,
        x: Array,
        y: Array,
        pixel_size: tuple[float, float],
        pixel_error: float = 0.1,
    ) -> ShownPoints:
        """The points on things or on these faces, whichever are first. See the function ``shown_points``."""
        hits = self.scene.first_hits(projection, x, y, pixel_size, pixel_error)
        points = points_of(self.scene, projection, hits, x, y, pixel_size)
        which, own = self._first_faces(projection, hits, x, y, pixel_size, pixel_error)
        at = np.searchsorted(points.number, which)
        for whole, part in zip(points, own, strict=True):
            whole[..., at] = part
        return points._replace(number=np.flatnonzero(hits.mask))

    def _first_faces(
        self,
        projection: Projection,
        hits: Hits,
        x: Array,
        y: Array,
        pixel_size: tuple[float, float],
        pixel_error: float,
    ) -> tuple[IndexArray, ShownPoints]:
        """The numbers (n,) of projectors that meet a face that counts before they hit a thing, and where."""
        seen = SeenScene(self.faces)
        found = seen.first_hits(projection, x, y, pixel_size, pixel_error)
        inside = projection.transformed(self.faces.matrix)
        tile = TileProjectors(self.faces, inside, x, y, found.mask, pixel_size, pixel_error)

        def points_at(which: IndexArray) -> ShownPoints:
            """The points on faces that projectors ``which`` (n,) have met last."""
            own = projection.subset(which)
            return points_of(seen, own, found.take(which), x[which], y[which], pixel_size)

        counts = np.zeros(len(x), bool)
        left = np.flatnonzero(hits.mask & (found.triangle >= 0) & (found.t < hits.t))
        for _ in range(MOST_PASSED):
            if not len(left):
                break
            counts[left] = self._showing(points_at(left))[0] >= 0
            left = left[~counts[left]]
            found.put(left, tile.next_hits(left, found.t[left], found.triangle[left]))
            left = left[(found.triangle[left] >= 0) & (found.t[left] < hits.t[left])]
        which = np.flatnonzero(counts)
        return which, points_at(which)

    def _showing(self, points: ShownPoints) -> tuple[IndexArray, IndexArray]:
        """The number (N,) of the best anchor that nothing hides each point from, and its pixel, a flat index.

        -1 if it sees through the point.
        """
        found, pixels = (np.full(len(points.number), -1) for _ in range(2))
        left = np.arange(len(points.number))
        for rank in ranked(from_all_sides(points), self.views, np.zeros(len(left), np.uint32), ASKED):
            numbers = (rank & np.uint32(MOST_ANCHORS)).astype(np.intp)
            numbers[rank == NO_RANK] = -1
            is_hidden = np.zeros(len(numbers), bool)
            for number in np.unique(numbers[left]):
                which = left[numbers[left] == number]
                if number < 0:
                    continue
                pixel, ahead, behind_start = nearest_pixels(
                    self.views[number], points.position.take(which, 1)
                )
                shows = np.abs(ahead) <= JOINED
                found[which[shows]], pixels[which[shows]] = number, pixel[shows]
                # What the near plane cuts open is not seen through.
                sees_through = (ahead > JOINED) & (behind_start > JOINED)
                is_hidden[which] = ~shows if self.lack[number] else ~(shows | sees_through)
            left = left[is_hidden[left]]
        return found, pixels

    def colors(
        self,
        points: ShownPoints,
        sets: Sequence[ViewSet],
        pictures: Sequence[Single],
    ) -> tuple[Single, BoolArray]:
        """The colours (N, C) of points on things and faces, and which no anchor shows, (N,). See ``join``.

        Things that anchors show only with something in front of them have the colours of that.
        """
        color, lacks = join(points, self.views, sets, pictures)
        which = np.flatnonzero(lacks)
        if not len(which):
            return color, lacks
        # Where a slope is too steep for planes.
        numbers, pixels = self._showing(points.take(which))
        for number in np.unique(numbers[numbers >= 0]):
            own = numbers == number
            color[which[own]] = pictures[number].reshape(-1, color.shape[1]).take(pixels[own], 0)
        which = which[numbers < 0]
        lacks[:] = False
        color[which], lacks[which] = join(points.take(which), self.traced, sets, pictures)
        return color, lacks
