# SPDX-License-Identifier: GPL-3.0-or-later
"""The same sheet with its points spaced evenly along itself: shape stays, density is equalised."""

from __future__ import annotations

import numpy as np

from ...projection.user_error import UserError
from ..surfaces.surface import ControlSurface
from ..typing import Array
from .volume_edits import HOLES, sampled

# Steps along a line are even when they differ by no more than this share of their mean.
EVEN = 1e-4
# Each round takes most of the unevenness out; both directions together may never be quite even.
ROUNDS = 100


def equalised(
    surface: ControlSurface, columns: int, rows: int, along_u: bool, along_v: bool
) -> tuple[Array, float]:
    """Points (rows, columns, 3) of a surface, in volume space, in even steps along their lines.

    along_u: along each row of points; along_v: along each column. Every line stays in its place if
    only one is asked for. Also returns the ``unevenness`` that is left. Raises UserError for a surface
    with holes.
    """
    sampled(surface, columns, rows)  # refuses holes
    u, v = np.meshgrid(np.linspace(0.0, 1.0, columns), np.linspace(0.0, 1.0, rows))
    axes = [axis for axis, asked in ((1, along_u), (0, along_v)) if asked]
    points = _points(surface, u, v)
    for _ in range(ROUNDS):
        if max((unevenness(points, axis) for axis in axes), default=0.0) <= EVEN:
            break
        for axis in axes:
            u, v = _respaced(points, u, v, axis)
            points = _points(surface, u, v)
    return points, max((unevenness(points, axis) for axis in axes), default=0.0)


def unevenness(points: Array, axis: int) -> float:
    """The largest difference of a step between points from the mean of its line, as a share of it.

    points: (rows, columns, 3). axis: 1 along rows, 0 along columns. Lines of no length are even.
    """
    steps = np.linalg.norm(np.diff(points, axis=axis), axis=2)
    mean = steps.mean(axis=axis, keepdims=True)
    size = float(np.ptp(points.reshape(-1, 3), axis=0).max())
    some = mean > EVEN * EVEN * size
    return float((np.abs(steps - mean) / np.where(some, mean, np.inf)).max(initial=0.0))


def _points(surface: ControlSurface, u: Array, v: Array) -> Array:
    placed = surface.positions(u.ravel(), v.ravel())
    if not placed.valid.all():
        raise UserError(HOLES)
    return placed.position.T.reshape(*u.shape, 3)


def _respaced(points: Array, u: Array, v: Array, axis: int) -> tuple[Array, Array]:
    """u and v moved along an axis's lines to where the length so far is even, by linear interpolation."""
    points, u, v = (np.moveaxis(one, axis, 1) for one in (points, u, v))
    steps = np.linalg.norm(np.diff(points, axis=1), axis=2)
    so_far = np.concatenate([np.zeros((len(steps), 1)), np.cumsum(steps, axis=1)], axis=1)
    count = so_far.shape[1]
    total = so_far[:, -1:]
    # Lines of no length, as at a pole, keep their parameters.
    share = np.where(total > 0, so_far / np.where(total > 0, total, 1.0), np.linspace(0.0, 1.0, count))
    wanted = np.linspace(0.0, 1.0, count)
    # One search for all lines: line i's lengths are put at 2i to 2i + 1, so that they increase throughout.
    lift = 2.0 * np.arange(len(share))[:, None]
    found = np.searchsorted((share + lift).ravel(), (wanted + lift).ravel(), side="right") - 1
    first = np.clip(found.reshape(share.shape) - count * np.arange(len(share))[:, None], 0, count - 2)
    low, high = (np.take_along_axis(share, first + i, 1) for i in (0, 1))
    part = np.clip((wanted - low) / np.where(high > low, high - low, 1.0), 0.0, 1.0)
    moved = []
    for parameter in (u, v):
        start, end = (np.take_along_axis(parameter, first + i, 1) for i in (0, 1))
        along = start + (end - start) * part
        along[:, 0], along[:, -1] = parameter[:, 0], parameter[:, -1]
        moved.append(np.moveaxis(along, 1, axis))
    return moved[0], moved[1]
