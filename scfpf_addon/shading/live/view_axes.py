# SPDX-License-Identifier: GPL-3.0-or-later
"""The axes of each pixel's own view: along its projector, and across it where the image's x and y grow."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from ...projection.typing import Array, BoolArray
from ...projection.volume.basis import SpanBasis
from ..typing import Single
from ..vectors import dot, perpendicular

# A neighbour whose projector is so many times as far away as the other neighbour's lies beyond a seam.
SEAM = 8.0
# The part of a step across the projector is no direction if it is a smaller share of the step.
ALONG = 1e-5


class ViewAxes(NamedTuple):
    """The axes of N projectors: forward, right, up (3, N), and whether the image is mirrored (N,)."""

    forward: Single
    right: Single
    up: Single
    is_mirrored: BoolArray


def neighbour_steps(points: Array, mask: BoolArray, columns: int) -> tuple[Single, Single]:
    """The steps of control points to the next pixel in x and in y, each (K, 3, N) float32.

    points: (K, 3, N) of whole rows of ``columns`` pixels, at least two of either. mask: (N,). The step from
    the pixel before counts where the next one has no projector, or lies beyond a seam of the surfaces.
    """
    grid = points.reshape(*points.shape[:2], -1, columns)
    exists = mask.reshape(-1, columns)
    across = _steps(grid, exists)
    up = _steps(grid.swapaxes(2, 3), exists.T).swapaxes(2, 3)
    return across.reshape(points.shape), up.reshape(points.shape)


def _steps(grid: Array, exists: BoolArray) -> Single:
    """Steps (K, 3, R, C) along the last axis of control points (K, 3, R, C). exists: (R, C)."""
    forth: Single = np.diff(grid, axis=3).astype(np.float32)
    with np.errstate(over="ignore"):
        size = np.einsum("kcij,kcij->ij", forth, forth)
    size[~(exists[:, 1:] & exists[:, :-1])] = np.inf
    steps = np.concatenate([forth, forth[..., -1:]], axis=3)
    # The step before is taken only where it is there and much the shorter one.
    row, column = np.nonzero(size[:, 1:] > SEAM**2 * size[:, :-1])
    steps[:, :, row, column + 1] = forth[:, :, row, column]
    return steps


def view_axes(
    spans: SpanBasis,
    steps: tuple[Single, Single],
    t: Array,
    tangent: NDArray[np.floating],
    is_usually_mirrored: bool,
) -> ViewAxes:
    """The axes at t (N,) of projectors.

    steps: see ``neighbour_steps``. tangent: (3, N) along the projectors, of any length. is_usually_mirrored:
    whether the image is that of a mirror where the volume is not folded.
    """
    if spans.is_straight:
        far = t.astype(np.float32)
        weights = np.stack([1.0 - far, far])
    else:
        weights = spans.weights(t)[0].astype(np.float32)
    across, up = (np.einsum("kn,kcn->cn", weights, step) for step in steps)
    forward = _unit(tangent.astype(np.float32))
    right = _across(across, forward)
    lost = np.flatnonzero(~right.any(axis=0))
    third = _cross(right, forward)
    if len(lost):
        # x runs along the projector there: y alone determines the axes, or else nothing.
        own = forward.take(lost, 1)
        upward = _across(up.take(lost, 1), own)
        other = perpendicular(own)[0]
        upward = np.where(upward.any(axis=0), upward, other)
        third[:, lost], right[:, lost] = upward, _cross(own, upward)
    is_left_handed: BoolArray = dot(up, third) < 0.0
    third *= np.where(is_left_handed, np.float32(-1), np.float32(1))
    return ViewAxes(forward, right, third, is_left_handed ^ is_usually_mirrored)


def _unit(vectors: Single) -> Single:
    """Vectors (3, N) of length 1, in place; zero vectors stay 0."""
    # Squares of float32 must neither overflow nor vanish.
    largest = np.abs(vectors).max(axis=0)
    vectors /= np.where(largest > 0.0, largest, np.float32(1))
    length = np.sqrt(dot(vectors, vectors))
    vectors /= np.where(length > 0.0, length, np.float32(1))
    return vectors


def _across(steps: Single, forward: Single) -> Single:
    """Unit vectors (3, N) of steps across unit vectors ``forward``; 0 for a step along these."""
    steps = _unit(steps)
    part = steps - forward * dot(steps, forward)
    part[:, dot(part, part) < ALONG**2] = 0.0
    return _unit(part)


def _cross(a: Single, b: Single) -> Single:
    """Vector products of two (3, N) arrays."""
    product = np.empty_like(a)
    for row, (i, j) in zip(product, ((1, 2), (2, 0), (0, 1)), strict=True):
        np.multiply(a[i], b[j], out=row)
        row -= a[j] * b[i]
    return product
