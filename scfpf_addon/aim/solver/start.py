# SPDX-License-Identifier: GPL-3.0-or-later
"""The start of aiming: any viewing volume as cubic B-spline surfaces, with the same image."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from ...projection.arrays import product
from ...projection.surfaces.nurbs import NurbsPatch
from ...projection.typing import Array, BoolArray
from ...projection.volume.bezier import bernstein
from ...projection.volume.viewing_volume import Projection, ViewingVolume
from .control_net import Along, ControlNet
from .vectors import across_of, dot, unit

# Samples along x and y for each span of the net, and along t.
SAMPLES_A_SPAN, SAMPLES_ALONG = 4, 17
# The weight of the smoothness that fills parts of the image that show nothing, as a share of the samples'.
FILLING = 1e-7
# Degrees of the projectors.
LEAST_DEGREE, MOST_DEGREE = 2, 4
# Depths of inner surfaces as shares of the subject's, for each degree: they put it near the middle of t.
INNER_DEPTHS = {2: (0.8,), 3: (0.5, 1.4), 4: (0.4, 0.9, 1.6)}
# Surfaces stay apart by this share of the projectors' length where the subject is near their end, and it
# counts as at least so far away: where surfaces coincide Qt is zero, and no step leads away from that.
LEAST_GAP, NEAREST = 0.1, 1e-3


@dataclass(frozen=True)
class Start:
    """A volume to aim with.

    patches: near to far, for a projection without re-parameterisation. error: the largest and the median
    distance of old and new projectors, in pixels.
    """

    patches: tuple[NurbsPatch, ...]
    error: float
    median_error: float


def start_volume(
    projection: Projection,
    width: int,
    net: tuple[int, int] = (12, 8),
    degree: int = 2,
    subject: float | None = None,
    far: float = 1.0,
) -> Start:
    """Turn a projection into patches with columns × rows (``net``) control points over the image.

    degree: of the new projectors, at least; a Bézier volume of a higher degree keeps its own, up to 4.
    subject: where the subject is along straight projectors, a share of the way from near to far; inner
    surfaces are put before and behind it. far: the share at which straight projectors end: nothing visible
    may lie beyond. Both are ignored for curved projectors, whose degree is raised or, beyond degree 4
    and in other bases, fitted.
    """
    columns, rows = net
    spans = projection.volume.spans
    straight = spans.is_straight
    degree = min(max(degree, spans.degree if spans.is_bezier else MOST_DEGREE), MOST_DEGREE)
    if straight:
        degree = max(degree, LEAST_DEGREE)
    size = ControlNet(columns, rows, degree + 1)
    x, y = _samples(size, 0.0)
    along, mask = _bezier(projection, x, y, degree, subject, far)
    matrix = size.at(x, y).dense()
    kept, values = matrix[mask], along[:, :, mask]
    filling = _filling(size) * (FILLING * max(len(kept), 1) / size.points)
    flat = values.transpose(2, 0, 1).reshape(len(kept), -1)
    square = product(kept.T, kept) + filling
    points = np.linalg.solve(square, product(kept.T, flat)).reshape(size.points, degree + 1, 3)
    # One step of iterative refinement takes the filling's weight out where samples are.
    rest = flat - product(kept, points.reshape(size.points, -1))
    points += np.linalg.solve(square, product(kept.T, rest)).reshape(points.shape)
    patches = size.patches(points)
    error = _errors(projection, size, points, width)
    return Start(patches, float(error.max(initial=0.0)), float(np.median(error)) if len(error) else 0.0)


def _samples(net: ControlNet, shift: float) -> tuple[Array, Array]:
    """x and y of samples of the image, (N,), borders included; ``shift`` in steps moves them inwards."""
    axes = []
    for count in (net.columns, net.rows):
        steps = SAMPLES_A_SPAN * (count - 3)
        axes.append(np.clip((np.arange(steps + 1) + shift) / steps, 0.0, 1.0))
    x, y = (a.ravel() for a in np.meshgrid(*axes, indexing="ij"))
    return x, y


def _bezier(
    projection: Projection, x: Array, y: Array, degree: int, subject: float | None, far: float
) -> tuple[Array, BoolArray]:
    """Bézier control points of the projectors, (degree + 1, 3, N), and which of them exist, (N,)."""
    points, mask = projection.projectors(x, y)
    mask = mask & np.isfinite(points).all(axis=(0, 1))
    spans = projection.volume.spans
    if spans.is_straight:
        middle = 0.5 * far if subject is None else subject
        shares = np.array([0.0, *INNER_DEPTHS[degree], np.inf])
        latest = 1.0 - LEAST_GAP * np.arange(degree + 1)[::-1]
        depths = far * np.minimum(shares * max(middle / far, NEAREST), latest)
        return points[0] + depths[:, None, None] * (points[1] - points[0]), mask
    t = np.linspace(0.0, 1.0, SAMPLES_ALONG)
    weights, _ = spans.weights(t)
    fit: Array = np.linalg.pinv(bernstein(degree, t).T) @ weights.T
    return np.einsum("jk,kcn->jcn", fit, points), mask


def _filling(net: ControlNet) -> Array:
    """Squared second differences of the net's points, (points, points)."""
    along_u = np.kron(np.diff(np.eye(net.columns), 2, axis=0), np.eye(net.rows))
    along_v = np.kron(np.eye(net.columns), np.diff(np.eye(net.rows), 2, axis=0))
    total: Array = along_u.T @ along_u + along_v.T @ along_v
    return total


def _errors(projection: Projection, net: ControlNet, points: Array, width: int) -> Array:
    """Distances of the new projectors from the old ones between the samples of the fit, in pixels."""
    x, y = _samples(net, 0.5)
    old, mask = projection.projectors(x, y)
    t = np.linspace(0.0, 1.0, SAMPLES_ALONG)
    weights, slopes = projection.volume.spans.weights(np.linspace(0.0, 1.0, 8 * SAMPLES_ALONG))
    curve = np.einsum("kt,kcn->ctn", weights, old[..., mask])
    tangent = unit(np.einsum("kt,kcn->ctn", slopes, old[..., mask]))
    controls = net.at(x, y).controls(points)[..., mask]
    count = controls.shape[3]
    worst, every = np.zeros(count), np.arange(count)
    for at in t[1:]:
        along = Along.of(controls, np.full(count, at))
        miss = along.position[:, None] - curve
        nearest = dot(miss, miss).argmin(axis=0)
        off = across_of(miss[:, nearest, every], tangent[:, nearest, every])
        across = across_of(along.du, unit(along.dt))
        worst = np.maximum(worst, np.sqrt(dot(off, off) / np.maximum(dot(across, across), 1e-300)) * width)
    return worst


def projection_of(patches: tuple[NurbsPatch, ...], aspect: float) -> Projection:
    """The projection of patches over the image."""
    return Projection(ViewingVolume(patches), aspect=aspect)
