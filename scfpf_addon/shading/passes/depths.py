# SPDX-License-Identifier: GPL-3.0-or-later
"""Depth along projectors: their length, and the depth of linear perspective."""

from __future__ import annotations

from itertools import pairwise

import numpy as np

from ...projection.typing import Array
from ...projection.volume.basis import SpanBasis
from ...projection.volume.viewing_volume import ViewingVolume

# Nodes of the Gauss quadrature of a projector's length, per span: 1e-6 for a half turn.
LENGTH_NODES = 12


def projector_length(spans: SpanBasis, points: Array, t: Array) -> Array:
    """Length of projectors with control points (K, 3, n) from the near surface to t (n,), (n,)."""
    nodes, shares = np.polynomial.legendre.leggauss(1 if spans.is_polyline else LENGTH_NODES)
    length = np.zeros(len(t))
    for start, end in pairwise(spans.breaks):
        half = (np.clip(t, start, end) - start) / 2
        for node, share in zip(nodes, shares, strict=True):
            _, slopes = spans.weights(start + half * (1 + node))
            velocity = np.einsum("kn,kcn->cn", slopes, points)
            length += share * half * np.sqrt(np.einsum("cn,cn->n", velocity, velocity))
    return length


def perspective_depth(volume: ViewingVolume, u: Array, v: Array, t: Array) -> Array:
    """The depth of linear perspective for t, both (n,) in [0, 1] (paper §3.2, after Watt 2000).

    f (1 - d/z) / (f - d), where d, f and z are the distances from the centre of projection to the near and
    far plane and to the point. A general volume has no centre. In place of f/d stands the spread of its
    projectors from the near to the far end, √(|Qu × Qv| far / near). That is f/d for every frustum, and 1,
    which leaves t as it is, for parallel projectors.
    """
    near, far = (volume.evaluate(u, v, np.full_like(t, end)) for end in (0.0, 1.0))
    spread_near, spread_far = (
        np.sqrt(np.linalg.norm(np.cross(q.du, q.dv, axis=0), axis=0)) for q in (near, far)
    )
    # t f / ((1 - t) d + t f), with f and d up to a common factor.
    whole = (1.0 - t) * spread_near + t * spread_far
    return np.divide(t * spread_far, whole, out=t.copy(), where=whole > 0.0)
