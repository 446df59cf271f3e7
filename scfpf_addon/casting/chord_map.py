# SPDX-License-Identifier: GPL-3.0-or-later
"""The chords of each pixel's projector, for the render pass that shows them."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from ..projection.typing import Array, BoolArray, IndexArray
from ..projection.volume.viewing_volume import Projection
from .cast import SMALLEST_ERROR, usable_projectors
from .curves.chord_rules import Chords
from .curves.projector_batch import ProjectorBatch
from .curves.sampled_curves import curves_through, pixel_length, pixel_widths, sample_curves
from .curves.schedule import corners, plan, scene_reach
from .scene.cast_scene import CastScene
from .scene.stretches import stretches


@dataclass(frozen=True)
class ChordMap:
    """Chords of N projectors.

    count: (N,) chords from where the scene begins to the hit, or to where the scene ends on a miss. Chords
    through empty space, which are never cast, count too. error: (N,) distance of the curve from its chord
    there, in pixels.
    """

    count: Array
    error: Array


def chord_map(
    scene: CastScene,
    projection: Projection,
    x: Array,
    y: Array,
    t: Array,
    pixel_size: tuple[float, float],
    pixel_error: float,
    columns: int,
) -> ChordMap:
    """The chords of projectors that hit at t (N,), inf on a miss; other arguments as for ``cast``.

    Those of a straight volume are one chord without an error; exact casting has no chords: 0.
    """
    spans = projection.volume.spans
    made = ChordMap(np.zeros(len(x)), np.zeros(len(x)))
    points, mask, _ = usable_projectors(projection, x, y)
    if not len(x) or pixel_error == 0.0:
        return made
    if spans.is_polyline:
        reach = scene_reach(spans, points, scene)
        if spans.is_straight:
            made.count[mask] = 1
        elif reach is not None:
            made.count[mask] = _chord(corners(spans, reach), t[mask]) + 1
        return made
    batch = ProjectorBatch(spans, points)
    reach = stretches(scene.occupancy, spans, batch.single, columns).reach
    if reach is None or not mask.any():
        return made
    curves = sample_curves(projection, x, y, mask, pixel_size)
    schedule = plan(spans, curves, reach, max(pixel_error, SMALLEST_ERROR))
    chord = _chord(schedule, t[mask])
    made.count[mask] = chord + 1
    made.error[mask] = _error(projection, schedule, chord, x[mask], y[mask], t[mask], pixel_size)
    hit: BoolArray = np.isfinite(t)
    made.error[~hit] = 0.0
    return made


def _chord(chords: Chords, t: Array) -> IndexArray:
    """The number of the chord that t (N,) falls into; the last one for inf."""
    chord: IndexArray = np.clip(np.searchsorted(chords.breaks, t, "right") - 1, 0, chords.count - 1)
    return chord


def _error(
    projection: Projection,
    chords: Chords,
    chord: IndexArray,
    x: Array,
    y: Array,
    t: Array,
    pixel_size: tuple[float, float],
) -> Array:
    """Distances (N,) of the curves at t (N,) from their chords, in pixels as in ``schedule.tolerance``."""
    curves, _, _ = curves_through(projection, x, y)
    here, slope = projection.volume.spans.weights(np.minimum(t, 1.0))
    position = np.einsum("kn,kcn->cn", here, curves.points)
    tangent = np.einsum("kn,kcn->cn", slope, curves.points)
    start, end = chords.ends_of(curves.points, chord)
    way, away = end - start, position - start
    share = np.clip(_share(away, way), 0.0, 1.0)
    distance = np.sqrt(_dot(away - way * share, away - way * share))
    sides = []
    for derivative, size in zip((curves.dx, curves.dy), pixel_size, strict=True):
        step = np.einsum("kn,kcn->cn", here, derivative) * size
        sides.append(step - tangent * _share(step, tangent))
    pixel = pixel_length(*pixel_widths(_dot(sides[0], sides[0]), _dot(sides[1], sides[1]), _dot(*sides)))
    error: Array = np.divide(distance, pixel, out=np.zeros_like(pixel), where=pixel > 0.0)
    return error


def _dot(a: Array, b: Array) -> Array:
    product: Array = np.einsum("cn,cn->n", a, b)
    return product


def _share(a: Array, along: Array) -> Array:
    """The coefficient of ``along`` (3, N) in the projection of a (3, N) onto it; 0 where it has no length."""
    squared = _dot(along, along)
    return np.divide(_dot(a, along), squared, out=np.zeros_like(squared), where=squared > 0.0)
