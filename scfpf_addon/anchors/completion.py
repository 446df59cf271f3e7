# SPDX-License-Identifier: GPL-3.0-or-later
"""Further anchors for what a plan's anchors turn out not to show, at all pixels of an image.

A plan looks at a few thousand positions. Between them things hide each other, and what is thinner than an
anchor's pixels may fall between these. Small anchors near to what is left see it, from farther beside the
projectors if need be.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass, replace

import numpy as np

from ..casting.tiles import TileJob, image_tiles, run_tiles
from ..projection.typing import Array, IndexArray
from ..projection.volume.viewing_volume import Projection
from .anchor import Anchor
from .anchor_view import AnchorView, ViewSet, traced_views
from .join import asked, find_texels
from .plan import Camera, CameraOfPart, Cover, PlanLimits, camera_matrix, looking_along
from .seen_scene import SeenScene
from .shown_points import ShownPoints, joined_points, shown_points

# Positions that are looked at along a side, at most.
MOST_COLUMNS = 1280
# Rounds, and the share of all points that may be left.
ROUNDS, ENOUGH = 3, 4e-4
# A further anchor adds this share of all points at least, and so many points.
LEAST_GAIN, LEAST_POINTS = 2e-5, 2
# Further anchors, at most, how much finer their pixels are, and their angle to projectors, radians.
MOST, FINER, WIDE_ANGLE = 32, 1.5, float(np.radians(70.0))
# Groups of points that further anchors are made for are halved so often.
HALVINGS = 5
# Near cameras stand so many radii of a group away.
NEAR = (1.5, 4.0)


@dataclass(frozen=True)
class CompletedSet:
    """The views of an image's anchors.

    views: of those before, and of further ones. own: the set of all that have a share in a pixel. added: the
    further anchors. count: of the pixels' centres on things. shown: the share of these that an anchor shows.
    """

    views: list[AnchorView]
    own: ViewSet
    added: tuple[Anchor, ...]
    shown: float
    count: int


def completed(
    scene: SeenScene,
    projection: Projection,
    size: tuple[int, int],
    views: Sequence[AnchorView],
    own: ViewSet | None = None,
    limits: PlanLimits | None = None,
    threads: int = 0,
) -> CompletedSet:
    """Add anchors for the pixels of an image that none shows, and leave out those that show nothing.

    projection: in world space. size: of the image in pixels. own: the set of its anchors, by default all of
    the views; further ones are in its rest. threads: 0 for all cores. Raises CastError and Cancelled.
    """
    limits, views = limits or PlanLimits(), list(views)
    own = own or ViewSet(tuple(range(len(views))))
    left, count, own = looked_through(scene, projection, size, views, own, threads)
    nearer = replace(limits, finer=FINER, most=MOST)
    least = max(LEAST_GAIN * count, LEAST_POINTS)
    added: list[Anchor] = []
    for _ in range(ROUNDS):
        if len(left.number) <= ENOUGH * count:
            break
        from_beside = left._replace(angle=np.full(len(left.number), WIDE_ANGLE))
        cameras = _cameras(left, least)
        found = Cover([scene], size, nearer).chosen(added, from_beside, cameras, ENOUGH * count, least)
        new = traced_views(scene, found[len(added) :], threads)
        if not new:
            break
        numbers = range(len(views), len(views) + len(new))
        added, views, own = found, [*views, *new], replace(own, rest=(*own.rest, *numbers))
        left = left.take(np.flatnonzero(find_texels(left, new).is_hole))
    return CompletedSet(views, own, tuple(added), 1.0 - len(left.number) / max(count, 1), count)


def looked_through(
    scene: SeenScene,
    projection: Projection,
    size: tuple[int, int],
    views: Sequence[AnchorView],
    own: ViewSet,
    threads: int = 0,
) -> tuple[ShownPoints, int, ViewSet]:
    """Look up all pixels of an image in a set of anchors.

    Returns the points on things that no anchor shows, the number of all on things, and those of the set that
    have a share in any.
    """
    width, height = (max(1, round(side * min(1.0, MOST_COLUMNS / max(size)))) for side in size)
    pixel_size = 1.0 / size[0], 1.0 / size[1]
    found: dict[int, tuple[ShownPoints, int]] = {}
    is_used = np.zeros(len(views), bool)

    def work(job: TileJob) -> tuple[ShownPoints, int, list[int]]:
        """The same of a tile, with the numbers of the anchors that have a share."""
        rows = np.arange(job.rows.start, job.rows.stop)
        x = np.tile((np.arange(width) + 0.5) / width, len(rows))
        y = np.repeat((rows + 0.5) / height, width)
        points = shown_points(scene, projection, x, y, pixel_size)
        points = points.take(np.flatnonzero(points.is_hit))
        left, used = np.arange(len(points.number)), []
        for shares, which, numbers in asked(points, views, own):
            left = which[shares.is_hole]
            used += np.asarray(numbers)[shares.used(len(numbers))].tolist()
        return points.take(left), len(points.number), used

    def finished(rows: slice, made: tuple[ShownPoints, int, list[int]]) -> None:
        """Keep what is left of a tile."""
        found[rows.start] = made[:2]
        is_used[made[2]] = True

    run_tiles(work, image_tiles(width, height), threads, finished)
    parts = [found[start] for start in sorted(found)]
    first, rest = (tuple(number for number in part if is_used[number]) for part in (own.first, own.rest))
    left = joined_points([points for points, _ in parts])
    return left, sum(count for _, count in parts), replace(own, first=first, rest=rest)


def _cameras(points: ShownPoints, least: float) -> Iterator[CameraOfPart]:
    """Cameras for groups of points (N,): all, those whose surfaces face alike, and ever smaller halves.

    least: the number of points that an anchor must add, which one for fewer does not.
    """
    axis, sides = np.abs(points.normal).argmax(axis=0), np.arange(len(points.number))
    side = 2 * axis + (points.normal[axis, sides] > 0.0)
    groups = [np.arange(len(points.number)), *(np.flatnonzero(side == k) for k in range(6))]
    for _ in range(HALVINGS + 1):
        groups = [group for group in groups if len(group) >= least]
        for group in groups:
            for camera in _near_to(points.take(group)):
                yield group, camera
        groups = [half for group in groups for half in _halves(points.position, group)]


def _halves(position: Array, group: IndexArray) -> list[IndexArray]:
    """Split a group (n,) of points at the median of its longest extent; [] for a single one."""
    own = position.take(group, 1)
    if len(group) < 2:
        return []
    axis = int(np.ptp(own, axis=1).argmax())
    order = np.argsort(own[axis], kind="stable")
    middle = len(group) // 2
    return [group[order[:middle]], group[order[middle:]]]


def _near_to(points: ShownPoints) -> Iterator[Camera]:
    """Cameras that look at points along their projectors, and from more before their surfaces."""
    middle = points.position.mean(axis=1)
    radius = float(np.linalg.norm(points.position - middle[:, None], axis=0).max())
    radius = max(radius, 4.0 * float(points.length.max()))
    along, before = points.direction.mean(axis=1), -points.normal.mean(axis=1)
    # What nearest surfaces cut open is seen by cameras whose own planes lie alike.
    _, axes = np.linalg.eigh(np.cov(points.begin) if len(points.number) > 2 else np.eye(3))
    cut = axes[:, 0] * np.sign(axes[:, 0] @ along)
    for way in (along, along + before, along + 3.0 * before, cut):
        strength = np.linalg.norm(way)
        if strength < 0.2:
            continue
        way = way / strength
        axes = looking_along(way)
        yield camera_matrix(axes, middle), True
        for factor in NEAR:
            yield camera_matrix(axes, middle - way * (factor * radius)), False
