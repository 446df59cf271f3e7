# SPDX-License-Identifier: GPL-3.0-or-later
"""Groups of a tile's projectors by their bend, so that straight ones do not need the chords of others."""

from __future__ import annotations

import numpy as np

from ...projection.typing import Array, BoolArray

# Projectors that bend less than this share of the tile's largest bend need a quarter of its chords.
SLIGHT = 1.0 / 16.0

# Projectors that bend less than this share of the coordinates are straight but for rounding.
STRAIGHT = 1e-9

# A group gets chords of its own if it has at least this share of the projectors.
LEAST_SHARE = 0.125

# Every so many projectors are sampled to see whether groups can pay at all.
STRIDE = 37


def bend_groups(points: Array, mask: BoolArray) -> list[BoolArray]:
    """The projectors of ``mask`` (N,) in groups of about equal bend, (N,) bool each, none empty if any exist.

    points: (K, 3, N) control points.
    """
    some = bends(points[:, :, ::STRIDE])[mask[::STRIDE]]
    if len(some) == 0 or (some >= SLIGHT * some.max()).mean() > 1.0 - LEAST_SHARE:
        return [mask]
    size = bends(points)
    most = float(size.max(where=mask, initial=0.0))
    straight = mask & (size <= STRAIGHT * np.abs(points).max())
    slight = mask & ~straight & (size < SLIGHT * most)
    groups, rest = [], mask
    for group in (straight, slight):
        if np.count_nonzero(group) >= LEAST_SHARE * np.count_nonzero(mask):
            groups.append(group)
            rest = rest & ~group
    return [*groups, rest] if rest.any() else groups


def bends(points: Array) -> Array:
    """Bends (N,) of control points (K, 3, N): the largest second difference across the way between ends."""
    way = points[-1] - points[0]
    length = np.einsum("cn,cn->n", way, way)
    most = np.zeros(points.shape[2])
    for second in np.diff(points, 2, axis=0):
        along = np.einsum("cn,cn->n", second, way)
        # All of it counts if both ends coincide.
        share = np.divide(along, length, out=np.zeros_like(along), where=length > 0.0)
        across = second - way * share
        np.maximum(most, np.einsum("cn,cn->n", across, across), out=most)
    result: Array = np.sqrt(most)
    return result
