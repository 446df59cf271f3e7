# SPDX-License-Identifier: GPL-3.0-or-later
"""Vectors as arrays (3, ..., N), and the nearest points of projectors."""

from __future__ import annotations

import numpy as np

from ...projection.typing import Array
from .control_net import position_and_tangent

# Samples of a projector among which the nearest one is searched, and steps that follow.
SAMPLES, NEAREST_STEPS = 65, 3


def dot(a: Array, b: Array) -> Array:
    """Dot products along the first axes."""
    total: Array = a[0] * b[0]
    total += a[1] * b[1]
    total += a[2] * b[2]
    return total


def cross(a: Array, b: Array) -> Array:
    """Vector products along the first axes."""
    found: Array = np.stack([a[1] * b[2] - a[2] * b[1], a[2] * b[0] - a[0] * b[2], a[0] * b[1] - a[1] * b[0]])
    return found


def unit(vectors: Array) -> Array:
    """Vectors of length 1; zero stays zero."""
    result: Array = vectors / np.maximum(np.sqrt(dot(vectors, vectors)), 1e-300)
    return result


def across_of(vectors: Array, tangents: Array) -> Array:
    """The parts of vectors perpendicular to unit tangents."""
    result: Array = vectors - dot(vectors, tangents) * tangents
    return result


def rotation_between(start: Array, end: Array) -> Array:
    """The least rotation (3, 3) from a unit vector (3,) to another."""
    axis = cross(start, end)
    sine, cosine = float(np.sqrt(dot(axis, axis))), float(dot(start, end))
    if sine < 1e-9:
        # Opposite vectors have no axis of their own: any perpendicular one will do.
        axis, sine = cross(start, np.eye(3)[np.abs(start).argmin()]), 0.0
    return rotation(unit(axis), float(np.arctan2(sine, cosine)))


def rotation(axis: Array, angle: float) -> Array:
    """The rotation (3, 3) about a unit axis (3,), by Rodrigues' formula."""
    x, y, z = axis
    turn = np.array([[0.0, -z, y], [z, 0.0, -x], [-y, x, 0.0]])
    result: Array = np.eye(3) + np.sin(angle) * turn + (1.0 - np.cos(angle)) * (turn @ turn)
    return result


def turned_by(matrix: Array, share: float) -> Array:
    """The rotation about the same axis by a share of the angle of ``matrix`` (3, 3)."""
    skew = np.array([matrix[2, 1] - matrix[1, 2], matrix[0, 2] - matrix[2, 0], matrix[1, 0] - matrix[0, 1]])
    sine, cosine = float(np.linalg.norm(skew)) / 2.0, (float(np.trace(matrix)) - 1.0) / 2.0
    if sine < 1e-6 and cosine < 0.0:
        # Half a turn: the symmetric part is 2 a aᵀ - 1.
        axes = (matrix + np.eye(3)) / 2.0
        skew = axes[:, axes.diagonal().argmax()]
    elif sine < 1e-12:
        return np.eye(3)
    return rotation(unit(skew), share * float(np.arctan2(sine, cosine)))


def nearest_t(controls: Array, points: Array) -> Array:
    """The t (N,) at which projectors (surfaces, 3, N) are nearest to points (3, N)."""
    samples = np.linspace(0.0, 1.0, SAMPLES)
    position, _ = position_and_tangent(controls, np.repeat(samples[:, None], points.shape[1], axis=1))
    miss = position - points[:, None]
    t = samples[dot(miss, miss).argmin(axis=0)]
    # Gauss and Newton's steps from the nearest sample.
    for _ in range(NEAREST_STEPS):
        position, dt = position_and_tangent(controls, t)
        t = np.clip(t + dot(points - position, dt) / np.maximum(dot(dt, dt), 1e-300), 0.0, 1.0)
    return t
