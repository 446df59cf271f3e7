# SPDX-License-Identifier: GPL-3.0-or-later
"""Projector continuation: the next hits of projectors past transparent ones, and straight secondary rays."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from functools import cached_property
from typing import Protocol

import numpy as np
from numpy.typing import NDArray

from ..projection.arrays import put_columns
from ..projection.typing import Array, BoolArray, IndexArray
from ..projection.volume.bezier import restrict
from ..projection.volume.viewing_volume import Projection
from .cast import SMALLEST_ERROR
from .common.hits import CastCounts, Hits
from .curves.chord_rules import Chords
from .curves.chords import NEIGHBOURHOOD, complete
from .curves.march import OVERLAP, Records
from .curves.plane_hits import move_to_neighbours, solve
from .curves.projector_batch import ProjectorBatch
from .curves.sampled_curves import sample_curves
from .curves.schedule import corners, plan, scene_reach
from .exact.exact_cast import cast_exact
from .scene.cast_scene import CastScene
from .straight import END_SLACK, cast_straight

# A projector continues off the triangle that it passed, but at most this far in t if it grazes it.
LARGEST_STEP = 1e-4

# Chords whose ends lie on their curves stray twice as far as those with shifted ends.
UNSHIFTED = 0.5

# The length of a ray from any point of the scene, in [-1, 1]³, to beyond all of it.
BEYOND = 4.0


@dataclass(frozen=True)
class TileProjectors:
    """The projectors of a tile, which share chords, whichever of them continue past their hits.

    projection: in cast space. x, y: (N,) image positions. mask: (N,) which exist. pixel_size, pixel_error:
    as for ``cast``.
    """

    scene: CastScene
    projection: Projection
    x: Array
    y: Array
    mask: BoolArray
    pixel_size: tuple[float, float]
    pixel_error: float

    def exit_tangents(self, which: IndexArray) -> Array:
        """Tangents (3, n) where the projectors ``which`` (n,) leave the volume."""
        misses = Hits.empty(len(which))._replace(mask=np.ones(len(which), bool))
        return complete(misses, self._batch(which)).tangent

    def positions(self, which: IndexArray, t: Array) -> Array:
        """Points (3, n) of the projectors ``which`` (n,) at t (n,)."""
        return self._batch(which).at(t)[0]

    def _batch(self, which: IndexArray) -> ProjectorBatch:
        points = self.projection.subset(which).projectors(self.x[which], self.y[which]).points
        return ProjectorBatch(self.projection.volume.spans, points)

    def next_hits(self, which: IndexArray, t: Array, triangle: IndexArray) -> Hits:
        """The next hits of the projectors ``which`` (n,) past those at t (n,) on ``triangle`` (n,).

        As ``cast``, but chords' hits that the curves do not confirm are kept.
        """
        batch = self._batch(which)
        start = self._start(batch, t, triangle)
        going = start < 1.0
        start = np.minimum(start, 1.0)
        spans = batch.spans
        if spans.is_straight or (spans.is_bezier and self.pixel_error == 0.0):
            rest = restrict(batch.points, start, np.ones_like(start))
            if spans.is_straight:
                found = cast_straight(self.scene, rest, going, False, CastCounts())
            else:
                found = cast_exact(self.scene, ProjectorBatch(spans, rest), going, None, CastCounts())
            found = found._replace(t=start + found.t * (1.0 - start))
        else:
            found = self._march(batch, start, going)
        return complete(found._replace(mask=np.ones_like(going)), batch)

    def _start(self, batch: ProjectorBatch, t: Array, triangle: IndexArray) -> Array:
        """The t (n,) at which the projectors have left the triangles."""
        position, tangent = batch.at(t)
        speed = np.abs(np.einsum("cn,cn->n", self.scene.normals(triangle), tangent))
        off = self.scene.offsets(triangle, position).astype(np.float64)
        start: Array = t + np.divide(
            off, speed, out=np.full_like(off, LARGEST_STEP), where=speed * LARGEST_STEP > off
        )
        return start

    @cached_property
    def _chords(self) -> Chords | None:
        """The chords of the tile; None if its projectors do not reach the scene."""
        spans = self.projection.volume.spans
        with np.errstate(invalid="ignore", over="ignore"):
            points = self._batch(np.flatnonzero(self.mask)).points
        reach = scene_reach(spans, points, self.scene)
        if reach is None:
            return None
        if spans.is_polyline:
            return corners(spans, reach)
        curves = sample_curves(self.projection, self.x, self.y, self.mask, self.pixel_size)
        return plan(spans, curves, reach, UNSHIFTED * max(self.pixel_error, SMALLEST_ERROR))

    def _march(self, batch: ProjectorBatch, first: Array, going: BoolArray) -> Hits:
        """The first chord past ``first`` (n,) that hits, intersected with the curve in float64."""
        chords = self._chords
        hits = Hits.empty(batch.count)
        if chords is None:
            return hits
        met, records, share = self._first_chords(chords, batch, first, going)
        low, high = chords.breaks[records.chord], chords.breaks[records.chord + 1]
        slack = NEIGHBOURHOOD * (high - low)
        low, high = np.maximum(low - slack, first[met]), high + slack
        curves, span = batch.take(met), chords.span[records.chord]
        found = solve(curves, self.scene, records.triangle, span, low, high)
        move_to_neighbours(curves, self.scene, span, low, high, found)
        t = np.where(found.inside, found.t, share)
        weights = self.scene.clipped_barycentric(curves.place(t), records.triangle)
        hits.t[met] = t
        hits.triangle[met] = np.where(found.inside, found.triangle, records.triangle)
        put_columns(hits.barycentric, met, np.where(found.inside, found.barycentric, weights))
        return hits

    def _first_chords(
        self, chords: Chords, batch: ProjectorBatch, first: Array, going: BoolArray
    ) -> tuple[IndexArray, Records, Array]:
        """The projectors (m,) that hit, their chords' hits, and where, in t (m,)."""
        begin = batch.at(first)[0]
        # On the curves, unlike the ends of ``chords``, which are shifted, perhaps back to the triangle left.
        ends = batch.spans.weights(chords.breaks)[0].T
        chord_of = np.full(batch.count, -1)
        triangle = np.full(batch.count, -1, np.int32)
        share = np.zeros(batch.count)
        for chord in range(chords.count):
            low, high = chords.breaks[chord : chord + 2]
            rays = np.flatnonzero(going & (triangle < 0) & (first < high))
            if len(rays) == 0:
                continue
            some = batch.points.take(rays, 2)
            start, end = (np.einsum("k,kcn->cn", ends[chord + k], some) for k in (0, 1))
            inside = first[rays] > low
            start = np.where(inside, begin.take(rays, 1), start)
            origins, ways = start.astype(np.float32), (end - start).astype(np.float32)
            limits = np.full(len(rays), 1.0 + OVERLAP, np.float32)
            found = self.scene.mesh.trace(origins, ways, limits)
            hit = np.flatnonzero(found >= 0)
            if len(hit):
                met = rays[hit]
                triangle[met], chord_of[met] = found[hit], chord
                far = self.scene.mesh.trace_distance(origins.take(hit, 1), ways.take(hit, 1), limits[hit])
                since = np.maximum(first[met], low)
                share[met] = since + np.minimum(far, 1.0) * (high - since)
        met = np.flatnonzero(triangle >= 0)
        return met, Records(met, chord_of[met], triangle[met]), share[met]


class ContinuedTile(Protocol):
    """The projectors of a tile, see ``TileProjectors``."""

    def next_hits(self, which: IndexArray, t: Array, triangle: IndexArray) -> Hits:
        """The next hits of projectors ``which`` (n,) past those at t (n,) on ``triangle`` (n,)."""
        ...

    def exit_tangents(self, which: IndexArray) -> Array:
        """The tangents (3, n) where projectors ``which`` (n,) leave the volume."""
        ...


@dataclass(frozen=True)
class Continuation:
    """Some projectors of tiles, to be continued past their hits.

    tiles: several if samples of the same pixels are traced together. tile: (n,) number of each projector's.
    number: (n,) of the projectors in their tiles. pixel: (n,) seeds of the random choices on their paths.
    """

    tiles: tuple[ContinuedTile, ...]
    tile: IndexArray
    number: IndexArray
    pixel: IndexArray

    @classmethod
    def of_tile(cls, tile: ContinuedTile, count: int) -> Continuation:
        """All ``count`` projectors of a tile, whose own numbers are the seeds."""
        number = np.arange(count)
        return cls((tile,), np.zeros_like(number), number, number)

    @classmethod
    def joined(cls, parts: Sequence[Continuation]) -> Continuation:
        """The projectors of all parts, in order."""
        first = np.cumsum([0, *(len(part.tiles) for part in parts)])
        return cls(
            tuple(tile for part in parts for tile in part.tiles),
            np.concatenate([part.tile + start for part, start in zip(parts, first[:-1], strict=True)]),
            np.concatenate([part.number for part in parts]),
            np.concatenate([part.pixel for part in parts]),
        )

    def take(self, index: IndexArray) -> Continuation:
        """The projectors at ``index``."""
        return Continuation(self.tiles, self.tile[index], self.number[index], self.pixel[index])

    def next_hits(self, which: IndexArray, t: Array, triangle: IndexArray) -> Hits:
        """The next hits of projectors ``which`` (m,) of these, see ``TileProjectors.next_hits``."""
        found = Hits.empty(len(which))
        for tile, some in self._by_tile(which):
            number = self.number[which[some]]
            found.put(some, self.tiles[tile].next_hits(number, t[some], triangle[some]))
        return found

    def exit_tangents(self, which: IndexArray) -> Array:
        """Tangents (3, m) where the projectors ``which`` (m,) of these leave the volume."""
        found = np.zeros((3, len(which)))
        for tile, some in self._by_tile(which):
            found[:, some] = self.tiles[tile].exit_tangents(self.number[which[some]])
        return found

    def _by_tile(self, which: IndexArray) -> Iterator[tuple[int, IndexArray]]:
        """The tiles of projectors ``which`` (m,), and which of these belong to each."""
        tile = self.tile[which]
        for number in range(len(self.tiles)):
            some = np.flatnonzero(tile == number)
            if len(some):
                yield number, some


def cast_rays(scene: CastScene, origins: Array, directions: Array) -> Hits:
    """The first hits of straight rays from origins (3, N) along unit directions (3, N), cast space.

    Their t is in units of BEYOND. They do not meet the scene's triangles ``beyond``.
    """
    count = origins.shape[1]
    points = np.stack([origins, origins + directions * BEYOND])
    return cast_straight(scene, points, np.ones(count, bool), False, CastCounts())


def first_triangles(scene: CastScene, origins: Array, directions: Array) -> NDArray[np.int32]:
    """The first triangles (N,) that the rays of ``cast_rays`` meet, -1 for none, as Embree finds them."""
    limits = np.full(origins.shape[1], 1.0 + END_SLACK, np.float32)
    ways = (directions * BEYOND).astype(np.float32)
    return scene.mesh.trace(origins.astype(np.float32), ways, limits)
