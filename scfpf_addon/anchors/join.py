# SPDX-License-Identifier: GPL-3.0-or-later
"""Colours of points that an image shows, looked up in the pictures of its anchors.

Of the four pixels around a point's place those count that show the same surface there. Anchors are weighted
by the angle to the projector and by their pixels' size. Weights fall to 0 at the borders of windows and at
the first anchor that is left out, as in Buehler et al. 2001, Unstructured Lumigraph Rendering.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from ..casting.common.cancellation import raise_if_cancelled
from ..casting.scene.cast_scene import CastScene
from ..projection.typing import Array, BoolArray, IndexArray
from ..shading.typing import Single
from .anchor import Anchor, AnchorPlaces
from .shown_points import ShownPoints

# Anchors that share in a point's colour, at most.
SHARERS = 3
# Weights fall to 0 within this share of the window's shorter side from its border.
BORDER = 0.06
# A pixel of an anchor shows a point's surface if it is within so many of its sides from the point's plane, or
# within this share of the distance, for positions are rounded.
OFF_PLANE, ROUNDED = 0.35, 1e-5
# And not farther from the point than so many of its sides, seen at the surface's slope.
APART, STEEPEST = 2.5, 0.05
# Where no pixel does, those count that are so near to the point that they may show a neighbouring surface.
BESIDE = 1.5
# An anchor whose pixels are as large as the image's counts as much worse as one whose ray is so far off.
COARSE_ANGLE = float(np.radians(10.0))
# The least cosine between an anchor's ray and a normal.
LEAST_COSINE = 0.02
# Rows of an anchor's picture whose depths are traced at once.
ROWS = 256


@dataclass(frozen=True)
class AnchorPicture:
    """The picture of an anchor. color: (H, W, C) float32, row 0 at the bottom. depth: (H, W) float32, the
    distances along its axis of what the caster meets there, inf for nothing."""

    anchor: Anchor
    color: Single
    depth: Single


def traced_depth(scene: CastScene, anchor: Anchor) -> Single:
    """The distances along an anchor's axis of the first hits of its pixels' centres, (H, W), inf for none."""
    width, height = anchor.size
    found = np.full((height, width), np.inf, np.float32)
    reach = np.float32(anchor.end - anchor.start)
    for first in range(0, height, ROWS):
        raise_if_cancelled()
        rows = np.arange(first, min(first + ROWS, height))
        column, row = np.tile(np.arange(width), len(rows)), np.repeat(rows, width)
        begin, way = anchor.rays(column, row)
        origin = ((begin - scene.centre[:, None]) * scene.scale).astype(np.float32)
        limits = np.full(len(column), reach, np.float32)
        distance = scene.mesh.trace_distance(origin, (way * scene.scale).astype(np.float32), limits)
        depth = np.where(distance < reach, distance + np.float32(anchor.start), np.float32(np.inf))
        found[rows] = depth.reshape(len(rows), width)
    return found


@dataclass(frozen=True)
class Joined:
    """The colours (N, C) of points, and which of them no anchor shows, (N,)."""

    color: Single
    is_hole: BoolArray


def join(points: ShownPoints, pictures: Sequence[AnchorPicture], angle: float) -> Joined:
    """Look up the colours of points (N,), all of them on things.

    pictures: of one number of channels C. angle: radians, from which on an anchor counts least.
    """
    count = len(points.number)
    channels = pictures[0].color.shape[2] if pictures else 4
    total, weight = np.zeros((count, channels), np.float32), np.zeros(count, np.float32)
    penalty = np.stack([_penalties(points, picture.anchor) for picture in pictures]) if pictures else None
    left = np.arange(count)
    # Where the best anchors turn out to show something else, the next ones are asked.
    for first in range(0, len(pictures), SHARERS):
        if not len(left) or penalty is None:
            break
        raise_if_cancelled()
        own = penalty[:, left]
        order = np.argsort(own, axis=0, kind="stable")
        ranked = np.take_along_axis(own, order, axis=0)
        last = first + SHARERS
        bound = ranked[last] if last < len(pictures) else np.full(len(left), np.inf)
        bound = np.minimum(bound, np.maximum(2.0 * ranked[first], angle))
        for number, picture in enumerate(pictures):
            asked = np.isfinite(own[number]) & ((order[first:last] == number).any(axis=0))
            which = np.flatnonzero(asked)
            if not len(which):
                continue
            # One anchor alone has no other to fade to.
            share = np.maximum(1.0 - own[number, which] / np.maximum(bound[which], 1e-9), 1e-3)
            color, found = _looked_up(points.take(left[which]), picture)
            share = np.where(found, share * _fade(points.take(left[which]), picture.anchor), 0.0)
            total[left[which]] += (color * share[:, None]).astype(np.float32)
            weight[left[which]] += share.astype(np.float32)
        left = left[weight[left] <= 0.0]
    is_hole = weight <= 0.0
    total /= np.where(is_hole, np.float32(1.0), weight)[:, None]
    return Joined(total, is_hole)


def join_sky(points: ShownPoints, pictures: Sequence[AnchorPicture]) -> Joined:
    """Look up the colours of points (N,) that are on no thing, by their direction alone."""
    count = len(points.number)
    total, weight = np.zeros((count, 4), np.float32), np.zeros(count, np.float32)
    for picture in pictures:
        anchor = picture.anchor
        if anchor.is_parallel:
            continue
        far = anchor.eye[:, None] + points.direction * (0.5 * (anchor.start + anchor.end))
        places = anchor.places(far)
        which = np.flatnonzero(anchor.holds(places))
        column = np.floor(places.across[which] - 0.5).astype(np.intp)
        row = np.floor(places.up[which] - 0.5).astype(np.intp)
        right, upper = places.across[which] - 0.5 - column, places.up[which] - 0.5 - row
        fade = _fade(points.take(which)._replace(position=far[:, which]), anchor)
        for step_up, share_up in ((0, 1.0 - upper), (1, upper)):
            for step, share in ((0, 1.0 - right), (1, right)):
                at = row + step_up, column + step
                own = ((share * share_up + 1e-6) * fade * np.isinf(picture.depth[at])).astype(np.float32)
                total[which] += picture.color[at] * own[:, None]
                weight[which] += own
    is_hole = weight <= 0.0
    total /= np.where(is_hole, np.float32(1.0), weight)[:, None]
    return Joined(total, is_hole)


def _penalties(points: ShownPoints, anchor: Anchor) -> Array:
    """Return the penalties (N,) by which an anchor is ranked for points, inf where it cannot show them.

    A penalty is the angle between ray and projector in radians, and more where the anchor's pixels are large.
    """
    places = anchor.places(points.position)
    ray = anchor.directions(points.position)
    off = np.arccos(np.clip(np.einsum("cn,cn->n", ray, points.direction), -1.0, 1.0))
    coarse = anchor.lengths(places.depth) / np.maximum(points.length, np.finfo(np.float64).tiny)
    found: Array = off + COARSE_ANGLE * np.maximum(coarse - 1.0, 0.0)
    facing = -np.einsum("cn,cn->n", points.normal, ray)
    own = -np.einsum("cn,cn->n", points.normal, points.direction)
    found[~anchor.holds(places) | (facing < np.minimum(LEAST_COSINE, 0.5 * own))] = np.inf
    return found


def _fade(points: ShownPoints, anchor: Anchor) -> Array:
    """1 inside an anchor's window, falling to nearly 0 at its border, (N,)."""
    places, (width, height) = anchor.places(points.position), anchor.size
    inside = np.minimum(
        np.minimum(places.across, width - places.across), np.minimum(places.up, height - places.up)
    )
    share = np.clip(inside / (BORDER * min(width, height)), 0.0, 1.0)
    fade: Array = np.maximum(share * share * (3.0 - 2.0 * share), 1e-3)
    return fade


def _looked_up(points: ShownPoints, picture: AnchorPicture) -> tuple[Single, BoolArray]:
    """The colours (N, C) of points in one picture, and whether it shows them, (N,)."""
    anchor = picture.anchor
    places = anchor.places(points.position)
    column, row = np.floor(places.across - 0.5).astype(np.intp), np.floor(places.up - 0.5).astype(np.intp)
    right, upper = places.across - 0.5 - column, places.up - 0.5 - row
    color = np.zeros((2, len(column), picture.color.shape[2]), np.float32)
    total = np.zeros((2, len(column)))
    for step_up, share_up in ((0, 1.0 - upper), (1, upper)):
        for step, share in ((0, 1.0 - right), (1, right)):
            at = row + step_up, column + step
            # The nearest pixel may have no share left.
            share_of = share * share_up + 1e-6
            for own, shows in enumerate(_shows(points, places, anchor, picture.depth[at], *at)):
                color[own] += picture.color[at] * (share_of * shows)[:, None].astype(np.float32)
                total[own] += share_of * shows
    own = (total[0] <= 0.0).astype(np.intp)
    color, total = color[own, np.arange(len(own))], total[own, np.arange(len(own))]
    found: BoolArray = total > 0.0
    color /= np.where(found, total, 1.0)[:, None].astype(np.float32)
    return color, found


def _shows(
    points: ShownPoints,
    places: AnchorPlaces,
    anchor: Anchor,
    depth: Single,
    row: IndexArray,
    column: IndexArray,
) -> tuple[BoolArray, BoolArray]:
    """Return whether pixels (N,) of an anchor show the surfaces of points (N,), and whether what is near."""
    is_there = np.isfinite(depth)
    depth = np.where(is_there, depth, 1.0).astype(np.float64)
    begin, way = anchor.rays(column, row)
    off = begin + way * (depth - anchor.start) - points.position
    side = anchor.lengths(places.depth)
    height = np.abs(np.einsum("cn,cn->n", points.normal, off))
    ray = anchor.directions(points.position)
    cosine = np.abs(np.einsum("cn,cn->n", points.normal, ray))
    square = np.einsum("cn,cn->n", off, off)
    near = square <= (APART * side / np.maximum(cosine, STEEPEST)) ** 2
    shows = is_there & near & (height <= OFF_PLANE * side + ROUNDED * places.depth)
    return shows, is_there & (square <= (BESIDE * side) ** 2)
