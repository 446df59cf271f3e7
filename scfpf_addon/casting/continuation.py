# SPDX-License-Identifier: GPL-3.0-or-later
"""What comes behind a hit on the same projector, for things that can be seen through; straight rays too."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from functools import cached_property
from typing import TypeAlias

import numpy as np

from ..projection.typing import Array, BoolArray, IndexArray
from ..projection.volume.bezier import restrict
from ..projection.volume.viewing_volume import Projection
from .cast import SMALLEST_ERROR
from .common.hits import CastCounts, Hits
from .curves.chords import NEIGHBOURHOOD, complete
from .curves.march import OVERLAP
from .curves.projector_batch import ProjectorBatch
from .curves.schedule import Schedule, corners, plan, sample_curves, scene_reach
from .exact.exact_cast import cast_exact
from .scene.cast_scene import CastScene
from .straight import OFF_VERTICES, cast_straight

# A projector goes on off the triangle that it passed, but not farther than this in t where it grazes it.
LARGEST_STEP = 1e-4

# Chords whose ends are on their curves stray twice as far as those that are shifted.
UNSHIFTED = 0.5

# From any point of the scene, which lies in [-1, 1]³, to beyond all of it.
BEYOND = 4.0


# The next hits of projectors (n,) behind those at t (n,) on triangles (n,).
Behind: TypeAlias = Callable[[IndexArray, Array, IndexArray], Hits]
# Where projectors (n,) leave the volume, (3, n).
WaysOut: TypeAlias = Callable[[IndexArray], Array]


@dataclass(frozen=True)
class Continuation:
    """The projectors of a tile, to be followed on behind their hits.

    projection: in cast space. x, y: (N,) image positions of the whole tile, whose projectors share
    their chords, whichever of them go on. mask: (N,) which exist. known: numbers of those that hits are
    kept of, None for all. pixel_size, pixel_error: as for ``cast``. pixels: of the image, of the known hits,
    None where it does not matter.
    """

    scene: CastScene
    projection: Projection
    x: Array
    y: Array
    mask: BoolArray
    known: IndexArray | None
    pixel_size: tuple[float, float]
    pixel_error: float
    pixels: IndexArray | None = None

    def pixels_of(self, where: IndexArray) -> IndexArray:
        """What is drawn by lot for the known hits ``where`` is drawn by these numbers."""
        return where if self.pixels is None else self.pixels[where]

    def of(self, where: IndexArray) -> Behind:
        """``hits`` by place among the known hits ``where``."""
        number = where if self.known is None else self.known[where]
        return lambda which, t, triangle: self.hits(number[which], t, triangle)

    def leaving(self, where: IndexArray) -> WaysOut:
        """``ways_out`` by place among the known hits ``where``."""
        number = where if self.known is None else self.known[where]
        return lambda which: self.ways_out(number[which])

    def ways_out(self, which: IndexArray) -> Array:
        """Tangents (3, n) where the projectors ``which`` (n,) leave the volume."""
        points = self.projection.taken(which).projectors(self.x[which], self.y[which]).points
        nothing = Hits.empty(len(which))._replace(mask=np.ones(len(which), bool))
        return complete(nothing, ProjectorBatch(self.projection.volume.spans, points)).tangent

    def hits(self, which: IndexArray, t: Array, triangle: IndexArray) -> Hits:
        """The next hits of the projectors ``which`` (n,) behind those at t (n,) on ``triangle`` (n,).

        As ``cast``, but that hits which the curves do not bear out are taken as the chords have them.
        """
        points = self.projection.taken(which).projectors(self.x[which], self.y[which]).points
        batch = ProjectorBatch(self.projection.volume.spans, points)
        start = self._start(batch, t, triangle)
        going = start < 1.0
        start = np.minimum(start, 1.0)
        spans = batch.spans
        if spans.is_straight or (spans.is_bezier and self.pixel_error == 0.0):
            rest = restrict(points, start, np.ones_like(start))
            if spans.is_straight:
                found = cast_straight(self.scene, rest, going, (0.0, 1.0), CastCounts())
            else:
                found = cast_exact(self.scene, ProjectorBatch(spans, rest), going, None, CastCounts())
            found = found._replace(t=start + found.t * (1.0 - start))
        else:
            found = self._march(batch, start, going)
        return complete(found._replace(mask=np.ones_like(going)), batch)

    def _start(self, batch: ProjectorBatch, t: Array, triangle: IndexArray) -> Array:
        """Where the projectors have left the triangles, (n,) in t."""
        tangent = batch.at(t)[1]
        speed = np.abs(np.einsum("cn,cn->n", self.scene.normals(triangle), tangent))
        off = self.scene.offsets(triangle).astype(np.float64)
        start: Array = t + np.divide(
            off, speed, out=np.full_like(off, LARGEST_STEP), where=speed * LARGEST_STEP > off
        )
        return start

    @cached_property
    def _schedule(self) -> Schedule | None:
        """The chords of the tile; None where nothing is on its projectors."""
        spans = self.projection.volume.spans
        with np.errstate(invalid="ignore", over="ignore"):
            there = np.flatnonzero(self.mask)
            points = self.projection.taken(there).projectors(self.x[there], self.y[there]).points
        reach = scene_reach(spans, points, self.scene)
        if reach is None:
            return None
        if spans.is_polyline:
            return corners(spans, reach)
        curves = sample_curves(self.projection, self.x, self.y, self.mask, self.pixel_size)
        return plan(spans, curves, reach, UNSHIFTED * max(self.pixel_error, SMALLEST_ERROR), 1)

    def _march(self, batch: ProjectorBatch, first: Array, going: BoolArray) -> Hits:
        """The first chord behind ``first`` (n,) that hits, met by the curve in float64."""
        hits = Hits.empty(batch.count)
        schedule = self._schedule
        if schedule is None:
            return hits
        begin = batch.at(first)[0]
        # On the curves, unlike the schedule's own, which are shifted: those might lie before what was passed.
        ends = batch.spans.weights(schedule.breaks)[0].T
        chord_of = np.full(batch.count, -1)
        triangle = np.full(batch.count, -1, np.int32)
        share = np.zeros(batch.count)
        for chord in range(schedule.count):
            low, high = schedule.breaks[chord : chord + 2]
            rays = np.flatnonzero(going & (triangle < 0) & (first < high))
            if len(rays) == 0:
                continue
            some = batch.points.take(rays, 2)
            start, end = (np.einsum("k,kcn->cn", ends[chord + k], some) for k in (0, 1))
            inside = first[rays] > low
            start = np.where(inside, begin[:, rays], start)
            origins, ways = start.astype(np.float32), (end - start).astype(np.float32)
            limits = np.full(len(rays), 1.0 + OVERLAP, np.float32)
            found = self.scene.mesh.trace(origins, ways, limits)
            hit = np.flatnonzero(found >= 0)
            if len(hit):
                met = rays[hit]
                triangle[met], chord_of[met] = found[hit], chord
                far = self.scene.mesh.trace_distance(origins[:, hit], ways[:, hit], limits[hit])
                since = np.maximum(first[met], low)
                share[met] = since + np.minimum(far, 1.0) * (high - since)
        return self._solved(batch, hits, first, triangle, chord_of, share)

    def _solved(
        self,
        batch: ProjectorBatch,
        hits: Hits,
        first: Array,
        triangle: IndexArray,
        chord: IndexArray,
        share: Array,
    ) -> Hits:
        """The hits as the curves have them, or as the chords do where they have none.

        share: (n,) t by the chords.
        """
        met = np.flatnonzero(triangle >= 0)
        schedule = self._schedule
        if schedule is None or len(met) == 0:
            return hits
        low, high = schedule.breaks[chord[met]], schedule.breaks[chord[met] + 1]
        span = batch.spans.locate(0.5 * (low + high))[0]
        slack = NEIGHBOURHOOD * (high - low)
        low, high = np.maximum(low - slack, first[met]), high + slack
        curves = batch.take(met)
        found = curves.solve(self.scene, triangle[met], span, low, high)
        curves.walk(self.scene, span, low, high, found)
        t = np.where(found.inside, found.t, share[met])
        weights = np.clip(self.scene.barycentric(curves.place(t), triangle[met]), 0.0, 1.0)
        weights /= np.maximum(weights.sum(axis=0), 1.0)
        hits.t[met] = t
        hits.triangle[met] = np.where(found.inside, found.triangle, triangle[met])
        hits.barycentric[:, met] = np.where(found.inside, found.barycentric, weights)
        return hits


def cast_rays(scene: CastScene, origins: Array, directions: Array) -> Hits:
    """The first hits of straight rays from origins (3, N) along unit directions (3, N), cast space.

    Their t counts in BEYOND. What the scene was made without (``beyond`` of it) is not met.
    """
    count = origins.shape[1]
    # Casting moves rays by a rounding of the scene's size: back through the face of a thing that is small.
    start = origins - OFF_VERTICES
    points = np.stack([start, start + directions * BEYOND])
    return cast_straight(scene, points, np.ones(count, bool), (0.0, 1.0), CastCounts())
