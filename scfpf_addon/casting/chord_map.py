# SPDX-License-Identifier: GPL-3.0-or-later
"""How projectors are cut into chords, pixel by pixel: what a render pass shows of the casting."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from ..projection.typing import Array, BoolArray
from ..projection.volume.viewing_volume import Projection, image_derivatives
from .cast import SMALLEST_ERROR, usable_projectors
from .curves.bends import bend_groups
from .curves.projector_batch import ProjectorBatch
from .curves.schedule import Schedule, corners, pixel_lengths, plan, sample_curves, scene_reach
from .scene.cast_scene import CastScene
from .scene.occupancy import boxes_of_blocks, stretches


@dataclass(frozen=True)
class ChordMap:
    """count: (N,) chords of each projector from where the scene begins to its hit, or to where the scene
    ends; those through empty space, which are never cast, count too. error: (N,) distance of the curve
    from its chord at that place, in pixels.
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
    """The chords of projectors that hit at t (N,), inf on a miss; the rest as for ``cast``.

    Straight projectors are one chord without an error; exact casting has no chords: 0.
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
    reach = stretches(scene.occupancy, spans, boxes_of_blocks(batch.single, columns)).reach
    if reach is None or not mask.any():
        return made
    for group in bend_groups(points, mask):
        curves = sample_curves(projection, x, y, group, pixel_size)
        schedule = plan(spans, curves, reach, max(pixel_error, SMALLEST_ERROR), 1)
        chord = _chord(schedule, t[group])
        made.count[group] = chord + 1
        made.error[group] = _error(projection, schedule, chord, x[group], y[group], t[group], pixel_size)
    hit: BoolArray = np.isfinite(t)
    made.error[~hit] = 0.0
    return made


def _chord(schedule: Schedule, t: Array) -> Array:
    """The number of the chord that t (N,) falls into; the last one for inf."""
    chord: Array = np.clip(np.searchsorted(schedule.breaks, t, "right") - 1, 0, schedule.count - 1)
    return chord


def _error(
    projection: Projection,
    schedule: Schedule,
    chord: Array,
    x: Array,
    y: Array,
    t: Array,
    pixel_size: tuple[float, float],
) -> Array:
    """Distance of the curves at t (N,) from their chords, in pixels as ``schedule.tolerance`` has them."""
    image = projection.parameters(x, y)
    controls = projection.volume.controls(image.u, image.v)
    dx, dy = image_derivatives(controls.du, controls.dv, image.jacobian)
    here, slope = projection.volume.spans.weights(np.minimum(t, 1.0))
    position = np.einsum("kn,kcn->cn", here, controls.points)
    tangent = np.einsum("kn,kcn->cn", slope, controls.points)
    start, end = (np.einsum("nk,kcn->cn", schedule.ends[chord + k], controls.points) for k in (0, 1))
    way, away = end - start, position - start
    share = np.clip(_share(away, way), 0.0, 1.0)
    distance = np.sqrt(_dot(away - way * share, away - way * share))
    across = []
    for derivative, size in zip((dx, dy), pixel_size, strict=True):
        step = np.einsum("kn,kcn->cn", here, derivative) * size
        across.append(step - tangent * _share(step, tangent))
    xx, yy, xy = _dot(across[0], across[0]), _dot(across[1], across[1]), _dot(*across)
    pixel = pixel_lengths(xx, yy, xy)
    error: Array = np.divide(distance, pixel, out=np.zeros_like(pixel), where=pixel > 0.0)
    return error


def _dot(a: Array, b: Array) -> Array:
    product: Array = np.einsum("cn,cn->n", a, b)
    return product


def _share(a: Array, along: Array) -> Array:
    """How much of ``along`` (3, N) lies in a (3, N): 0 where it has no length."""
    squared = _dot(along, along)
    return np.divide(_dot(a, along), squared, out=np.zeros_like(squared), where=squared > 0.0)
