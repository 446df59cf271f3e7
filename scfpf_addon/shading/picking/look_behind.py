# SPDX-License-Identifier: GPL-3.0-or-later
"""Look Behind: the things that an image hides though they are large in it, or asked for.

Projectors are followed past their first hits to the end of the volume. Each thing so has two areas in the
image: one as if nothing else were there, and one that is seen. Where the seen depth jumps, rays can be led
past what is in front: such discontinuities are what Wang et al. look for ("VR Exploration Assistance through
Automatic Occlusion Removal", 2019).
"""

from __future__ import annotations

from collections.abc import Callable, Collection
from typing import NamedTuple

import numpy as np

from ...casting.cast import cast
from ...casting.common.hits import CastCounts
from ...casting.continuation import TileProjectors
from ...casting.frame import pixel_centres
from ...casting.scene.cast_scene import CastScene
from ...casting.tiles import TileJob, image_tiles, run_tiles
from ...projection.typing import Array, BoolArray, IndexArray
from ...projection.volume.viewing_volume import Projection
from ..scene.shading_scene import Scene
from .pick import layered_cast, visible_scene

# Pixels across the image that is counted, and the error of silhouettes in them.
COLUMNS, PIXEL_ERROR = 256, 0.1
# Hits that a projector passes at most. What is behind more of them does not count.
MOST_PASSED = 256
# Things are listed that nothing asks for if they would cover this share of the image, of which this share is
# hidden.
LEAST_SHARE, LEAST_HIDDEN = 0.005, 0.5
# Linings and fillings are left out: they are behind what hides them by less than this share of their size.
LEAST_GAP = 0.01
# Ways in the image, as ``_nearest_side`` lists them, and the percentage of hidden pixels that it looks at.
SIDES, NEARLY_ALL = ("LEFT", "RIGHT", "DOWN", "UP"), 95.0


class HiddenThing(NamedTuple):
    """A thing that the image hides.

    number: of the object in ``Geometry.object_names``. share: of the image that it would cover alone. hidden:
    the part of that which other things hide, in [0, 1]. hider: number of the object that hides most. gap:
    distance from what hides it, the median over the image, in the scene's units. side: the way in the image,
    of SIDES, on which the image sees past what hides it soonest; empty if on none. away: how far that is for
    nearly all of it, as a share of the image's width or height; 0 if on none.
    """

    number: int
    share: float
    hidden: float
    hider: int
    gap: float
    side: str
    away: float


class SeenDepths(NamedTuple):
    """An image of N pixels, and the P pairs of a pixel and an object that its projector meets.

    front: (N,) the object that hides what is behind it, -1 for none. front_depth: (N,) its distance from the
    near surface, inf for none. mask: (N,) whether there is a projector. pixel, number: (P,) of each pair.
    depth: (P,) distance of the object's first hit from the near surface. gap: (P,) its distance from what
    hides it, 0 if nothing does. All distances are in the scene's units.
    """

    front: IndexArray
    front_depth: Array
    mask: BoolArray
    pixel: IndexArray
    number: IndexArray
    depth: Array
    gap: Array

    @property
    def is_hidden(self) -> BoolArray:
        """Return whether the object of each pair is hidden at its pixel, (P,)."""
        hidden: BoolArray = self.gap > 0.0
        return hidden


def hidden_things(
    projection: Projection,
    scene: Scene,
    wanted: Collection[int] = (),
    progress: Callable[[float], None] | None = None,
    cancelled: Callable[[], bool] | None = None,
) -> list[HiddenThing] | None:
    """List the things that an image hides; first those that are wanted, the largest hidden area first.

    projection: in the scene's space. wanted: numbers of objects that are listed wherever any part of them is
    hidden. progress(share), cancelled: as for ``run_tiles``. Returns None if cancelled. Image layers hide
    things, but what they show is not looked for. Materials that may let light through hide nothing. Raises
    CastError.
    """
    rows = max(round(COLUMNS / projection.aspect), 1)
    cast_scene = visible_scene(scene)
    if cast_scene is None:
        return []
    looker = _Looker(cast_scene, projection, scene, rows)
    parts: dict[int, SeenDepths] = {}

    def finished(tile: slice, made: SeenDepths) -> None:
        """Keep a tile by its first row."""
        parts[tile.start] = made

    tiles = image_tiles(COLUMNS, rows)
    if not run_tiles(looker.look, tiles, 0, finished, progress, cancelled):
        return None
    seen = SeenDepths(*(np.concatenate(each) for each in zip(*(parts[t.start] for t in tiles), strict=True)))
    return _listed(seen, scene, set(wanted), rows)


class _Looker:
    """Follows the projectors of tiles to the end of the volume."""

    def __init__(self, cast_scene: CastScene, projection: Projection, scene: Scene, rows: int) -> None:
        self._pixel_size, self._rows = (1 / COLUMNS, 1 / rows), rows
        self._whole, self._objects = cast_scene, scene.geometry.object_index
        self._clear = scene.materials.is_clear[scene.geometry.material]
        self._layered = layered_cast(cast_scene, projection, scene.geometry.image_layer, self._pixel_size)
        self._projection = projection.transformed(cast_scene.matrix)
        self._own = self._layered.parts.rest if self._layered else cast_scene

    def look(self, job: TileJob) -> SeenDepths:
        """What the projectors of a tile meet."""
        x, y = pixel_centres(COLUMNS, self._rows, (job.rows.start, job.rows.stop))
        count, scale = len(x), self._whole.scale
        front, end = np.full(count, -1), np.zeros((3, count))
        rest = self._pixel_size, PIXEL_ERROR
        hits = cast(self._own or self._whole, self._projection, x, y, *rest, CastCounts(), COLUMNS)
        tile = TileProjectors(self._own or self._whole, self._projection, x, y, hits.mask, *rest)
        begin = np.zeros((3, count))
        there = np.flatnonzero(hits.mask)
        begin[:, there] = tile.positions(there, np.zeros(len(there)))
        if self._layered is not None:
            found, layer = self._layered.first_hits(x, y, CastCounts(), COLUMNS)
            ahead = np.flatnonzero((layer > 0) & (found.triangle >= 0))
            front[ahead], end[:, ahead] = self._objects[found.triangle[ahead]], found.position[:, ahead]
        which = np.flatnonzero(hits.triangle >= 0) if self._own else np.zeros(0, np.intp)
        hits = hits.take(which)
        pairs: list[tuple[IndexArray, IndexArray, Array, Array]] = []
        known = np.zeros(0, np.int64)
        objects = int(self._objects.max(initial=0)) + 1
        for _ in range(MOST_PASSED):
            if not len(which):
                break
            number = self._objects[hits.triangle]
            code = which * objects + number
            new = ~np.isin(code, known)
            known = np.concatenate([known, code[new]])
            some, position = which[new], hits.position[:, new]
            depth = np.linalg.norm(position - begin[:, some], axis=0) / scale
            behind = (front[some] >= 0) & (front[some] != number[new])
            # A thing that lies in what hides it is behind it all the same.
            gap = np.maximum(np.linalg.norm(position - end[:, some], axis=0) / scale, np.finfo(float).tiny)
            pairs.append((some, number[new], depth, np.where(behind, gap, 0.0)))
            solid = (front[which] < 0) & ~self._clear[hits.triangle]
            front[which[solid]], end[:, which[solid]] = number[solid], hits.position[:, solid]
            hits = tile.next_hits(which, hits.t, hits.triangle)
            met = np.flatnonzero(hits.triangle >= 0)
            which, hits = which[met], hits.take(met)
        empty = (np.zeros(0, np.int64), np.zeros(0, np.int64), np.zeros(0), np.zeros(0))
        pixel, number, depth, gap = (np.concatenate(each) for each in zip(empty, *pairs, strict=True))
        front_depth = np.where(front >= 0, np.linalg.norm(end - begin, axis=0) / scale, np.inf)
        first = job.rows.start * COLUMNS
        return SeenDepths(front, front_depth, tile.mask, pixel + first, number, depth, gap)


def _listed(seen: SeenDepths, scene: Scene, wanted: set[int], rows: int) -> list[HiddenThing]:
    """The things to list, in order."""
    count = len(scene.geometry.object_names)
    hidden = seen.is_hidden
    alone = np.bincount(seen.number, minlength=count)
    lost = np.bincount(seen.number[hidden], minlength=count)
    is_large = (alone >= LEAST_SHARE * len(seen.mask)) & (lost >= LEAST_HIDDEN * alone)
    found = []
    for number in np.flatnonzero(lost).tolist():
        if not (is_large[number] or number in wanted):
            continue
        own = np.flatnonzero(hidden & (seen.number == number))
        gap = float(np.median(seen.gap[own]))
        if number not in wanted and gap < LEAST_GAP * _size(scene, number):
            continue
        hider = int(np.bincount(seen.front[seen.pixel[own]]).argmax())
        side, away = _nearest_side(seen, number, own, rows)
        share, part = alone[number] / len(seen.mask), lost[number] / alone[number]
        found.append(HiddenThing(number, float(share), float(part), hider, gap, side, away))
    return sorted(found, key=lambda each: (each.number not in wanted, -each.share * each.hidden))


def _size(scene: Scene, number: int) -> float:
    """The diagonal of the box around an object."""
    geometry = scene.geometry
    own = geometry.triangles[np.broadcast_to(geometry.object_index, len(geometry.triangles)) == number]
    return float(np.linalg.norm(np.ptp(geometry.vertices[own.ravel()], axis=0)))


def _nearest_side(seen: SeenDepths, number: int, own: IndexArray, rows: int) -> tuple[str, float]:
    """The way from a thing's hidden pixels ``own`` to the nearest places past its depth, and how far."""
    deep = float(np.median(seen.depth[own]))
    open_ = (seen.mask & (seen.front_depth >= deep)).reshape(rows, COLUMNS)
    open_.reshape(-1)[seen.pixel[(seen.number == number) & ~seen.is_hidden]] = True
    row, column = np.divmod(seen.pixel[own], COLUMNS)
    ways = (
        _steps(open_)[row, column] / COLUMNS,
        _steps(open_[:, ::-1])[row, COLUMNS - 1 - column] / COLUMNS,
        _steps(open_.T)[column, row] / rows,
        _steps(open_.T[:, ::-1])[column, rows - 1 - row] / rows,
    )
    away = [float(np.percentile(each, NEARLY_ALL, method="higher")) for each in ways]
    nearest = int(np.argmin(away))
    return (SIDES[nearest], away[nearest]) if np.isfinite(away[nearest]) else ("", 0.0)


def _steps(open_: BoolArray) -> Array:
    """Pixels (R, C) back along each row to the last open one, inf if there is none."""
    column = np.arange(open_.shape[1], dtype=float)
    last = np.maximum.accumulate(np.where(open_, column, -np.inf), axis=1)
    return column - last
