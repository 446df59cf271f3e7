# SPDX-License-Identifier: GPL-3.0-or-later
"""The cone of a pixel: how wide the pixels of an image are in space, as Cycles carries it along its rays.

Cycles measures bump, levels of textures and wires in pixels over a ray's footprint. It begins at the camera
and grows with the length of the ray by one angle, also through portals (``differential_transfer_compact`` in
kernel/util/differential.h). The camera of a rig gives the cone that fits the pixels of its volume best.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import NamedTuple

import numpy as np

from ...casting.curves.sampled_curves import Curves, footprint
from ...projection.typing import Array
from ...projection.volume.basis import SpanBasis

# Steps along a projector at which its pixels are compared, over all spans.
STEPS = 24
# Projectors that are compared, at most.
MOST_SAMPLES = 72
# Hits closer to the near surface than this share of a projector are rare and count less.
NEAR_SHARE = 1.0 / 64.0
# Widths of the image over the distance of the apex. Of narrower cones float32 would move rays by a share of a
# pixel. Wider ones have ends that are seen at too flat an angle.
NARROWEST, WIDEST = 1.0 / 16.0, 12.0
# Distances of the apex as shares of the length of a projector.
CLOSEST, FARTHEST = 1e-4, 64.0
# A factor by which pixels differ counts up to this.
MOST_OFF = 8.0
# The search: candidates each way at first, and how many steps to the best of the neighbors follow, which are
# halved wherever there is no better one.
CANDIDATES, SEARCH_STEPS = 11, 20
# The share of the samples that ``spread`` holds for.
MOST = 0.9


class PixelCone(NamedTuple):
    """The footprint of an image's pixels: ``width`` over the pixels across it, where projectors begin.

    width: of the image there. distance: from there back to where the footprint is 0; 0 if it does not grow.
    spread: the factor within which the pixels of MOST samples are. reach: the largest coordinate of the
    volume. apex: (3,), world space, where the cones begin.
    """

    width: float
    distance: float
    spread: float
    reach: float
    apex: tuple[float, float, float]

    @property
    def is_parallel(self) -> bool:
        """Return whether the footprint is the same everywhere."""
        return self.distance == 0.0


class _Samples(NamedTuple):
    """Pixels at G places of S projectors.

    width, weight, length: (G, S), of pixels, of samples, of projectors so far. x, y: (S,) image positions
    from the middle, in widths of the image. columns: pixels across. tall: their height over their width.
    """

    width: Array
    weight: Array
    length: Array
    x: Array
    y: Array
    columns: int
    tall: float


def pixel_cone(
    spans: SpanBasis, sampled: Sequence[tuple[Curves, Array, Array]], size: tuple[int, int], aspect: float
) -> PixelCone:
    """Fit the cone to sampled projectors.

    sampled: of each frame the curves with derivatives by a pixel, and their x and y, (S,) each. size: of the
    image in pixels. aspect: its width over its height.
    """
    parts = [_measure(spans, curves, x, y, size, aspect) for curves, x, y in sampled]
    samples = parts[0]._replace(
        width=np.concatenate([part.width for part in parts], axis=1),
        weight=np.concatenate([part.weight for part in parts], axis=1),
        length=np.concatenate([part.length for part in parts], axis=1),
        x=np.concatenate([part.x for part in parts]),
        y=np.concatenate([part.y for part in parts]),
    )
    reach = max(float(np.abs(curves.points).max()) for curves, _, _ in sampled)
    known = (samples.weight > 0.0) & (samples.width > 0.0)
    if not known.any():
        return PixelCone(1.0, 0.0, 1.0, reach, (0.0, 0.0, 0.0))
    samples = samples._replace(weight=np.where(known, samples.weight, 0.0))
    wanted = np.log(np.where(known, samples.width, 1.0))
    level = float(_quantile(wanted, samples.weight, 0.5))
    off = np.abs(wanted - level)
    width = float(np.exp(level)) * samples.columns * 2.0 / (1.0 + samples.tall)
    parallel = width, 0.0, _cost(off, samples.weight), off
    angle, start, cost, cone_off = _fit(samples, wanted)
    best = (angle * start, start, cost, cone_off)
    if parallel[2] <= cost:
        best = parallel
    width, distance, _, off = best
    spread = float(np.exp(_quantile(off, samples.weight, MOST)))
    return PixelCone(width, distance, spread, reach, _apex(spans, sampled[0], distance, width, aspect))


def _measure(
    spans: SpanBasis, curves: Curves, x: Array, y: Array, size: tuple[int, int], aspect: float
) -> _Samples:
    step = -(-curves.points.shape[2] // MOST_SAMPLES)
    curves, x, y = curves.only(slice(None, None, step)), x[::step], y[::step]
    count = len(spans.breaks) - 1
    local = np.linspace(0.0, 1.0, max(4, STEPS // count) + 1)
    there = [footprint(curves, spans, span, local if span == 0 else local[1:]) for span in range(count)]
    position = np.concatenate([part.position for part in there], axis=1)
    width = np.concatenate([0.5 * (np.sqrt(part.xx) + np.sqrt(part.yy)) for part in there])
    steps = np.sqrt((np.diff(position, axis=1) ** 2).sum(axis=0))
    length = np.concatenate([np.zeros((1, steps.shape[1])), np.cumsum(steps, axis=0)])
    with np.errstate(invalid="ignore", divide="ignore"):
        shares = np.maximum(length / length[-1], NEAR_SHARE)
        weight = np.gradient(np.log(shares), axis=0)
    weight = np.nan_to_num(weight)
    tall = size[0] / (aspect * size[1])
    return _Samples(width, weight, length, x - 0.5, (y - 0.5) / aspect, size[0], tall)


def _fit(samples: _Samples, wanted: Array) -> tuple[float, float, float, Array]:
    """The best angle, width over distance; the distance, the cost, and the logarithms of the errors."""
    total = float(np.median(samples.length[-1]))
    low = np.log([NARROWEST, CLOSEST * total])
    high = np.log([WIDEST, FARTHEST * total])

    def tried(place: Array) -> tuple[float, Array, Array]:
        place = np.clip(place, low, high)
        off = np.abs(np.log(_footprints(samples, *np.exp(place))) - wanted)
        return _cost(off, samples.weight), place, off

    shares = np.stack(np.meshgrid(*(np.linspace(0.0, 1.0, CANDIDATES),) * 2), axis=-1).reshape(-1, 2)
    best = min((tried(low + (high - low) * share) for share in shares), key=lambda each: each[0])
    step, around = (high - low) / (CANDIDATES - 1), [(a, b) for a in (-1, 0, 1) for b in (-1, 0, 1) if a or b]
    for _ in range(SEARCH_STEPS):
        found = min((tried(best[1] + step * way) for way in around), key=lambda each: each[0])
        if found[0] < best[0]:
            best = found
        else:
            step = step / 2.0
    cost, place, off = best
    return float(np.exp(place[0])), float(np.exp(place[1])), cost, off


def _footprints(samples: _Samples, angle: float, distance: float) -> Array:
    """The footprints that Cycles' perspective camera gives, (G, S): see ``camera_sample_perspective``."""
    a, b = angle * samples.x, angle * samples.y
    away = 1.0 + a * a + b * b
    spread = 0.5 * (np.sqrt(1.0 + b * b) + samples.tall * np.sqrt(1.0 + a * a)) / away
    result: Array = angle / samples.columns * spread * (distance * np.sqrt(away) + samples.length)
    return result


def _cost(off: Array, weight: Array) -> float:
    return float((np.minimum(off, np.log(MOST_OFF)) ** 2 * weight).sum())


def _quantile(values: Array, weight: Array, share: float) -> Array:
    order = np.argsort(values, axis=None)
    total = np.cumsum(weight.ravel()[order])
    found: Array = values.ravel()[order[np.searchsorted(total, share * total[-1])]]
    return found


def _apex(
    spans: SpanBasis, sampled: tuple[Curves, Array, Array], distance: float, width: float, aspect: float
) -> tuple[float, float, float]:
    curves, x, y = sampled
    start = footprint(curves, spans, 0, np.zeros(1))
    along = start.tangent / np.maximum(np.sqrt((start.tangent**2).sum(axis=0)), np.finfo(float).tiny)
    angle = width / distance if distance > 0.0 else 0.0
    back = distance * np.sqrt(1.0 + (angle * (x - 0.5)) ** 2 + (angle * (y - 0.5) / aspect) ** 2)
    a, b, c = (start.position - along * back).mean(axis=(1, 2))
    return float(a), float(b), float(c)
