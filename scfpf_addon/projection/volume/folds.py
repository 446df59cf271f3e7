# SPDX-License-Identifier: GPL-3.0-or-later
"""Folds: the parts of a viewing volume that are turned inside out, so that their image is mirrored.

A fold is a change of the sign of det[Qx Qy Qt] = det[Qu Qv Qt] · det[d(u,v)/d(x,y)]. The two factors are
tested separately: at a polar centre one vanishes while the other is infinite, and only their signs matter.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from ..arrays import median
from ..typing import Array, BoolArray
from .bezier import bernstein, derivative, product
from .viewing_volume import ControlSample, Projection, ViewingVolume, VolumeSample, determinant

# A fold is looked for at this many positions along each side of the image and along t.
# Even, so that no position is the image's centre.
FOLD_GRID = 16
# The positions are this share nearer to the middle than the cells' middles. Lines of a control grid would
# meet those, and derivatives there are those of one side: a symmetric fold would be found lopsided.
INWARDS = 1.0 - 1.0 / 997.0
# Of the way through a cell along t, the share that a dash in ``Folds.dashes`` covers, and its points.
DASH, DASH_POINTS = 0.6, 3
# A determinant below this share of the product of its columns' lengths has no sign worth
# trusting: the columns are parallel to within rounding.
PARALLEL = 1e-9
# Nor has one below this share of the median over the projectors at the same t: parameters are
# float32 in Blender, so that a pole may lie 1e-7 of the way beyond where it is meant to be.
VANISHING = 1e-5


@dataclass(frozen=True)
class Folds:
    """The folds of a projection.

    share: of the shown volume, in image × t, that is folded, in [0, 0.5]. orientation:
    the sign of det[Qu Qv Qt] in the rest, -1 or 1, 0 if it vanishes everywhere.
    mirrored: whether the image is that of a mirror outside the folds.
    positions: (3, F) float64, the samples in the folds, as Q. dashes: (3, F, 3), short pieces of the
    projectors through them, for drawing.
    """

    share: float
    orientation: int
    positions: Array
    dashes: Array
    mirrored: bool = False

    def __bool__(self) -> bool:
        return self.share > 0.0


def find_folds(projection: Projection) -> Folds:
    """The folds in the part of the volume that is shown; of the two orientations the rarer one is the fold.

    Looked for on a coarse grid, so that a fold smaller than a cell may be missed.
    """
    middle = 0.5 + INWARDS * ((np.arange(FOLD_GRID) + 0.5) / FOLD_GRID - 0.5)
    x, y = (a.ravel() for a in np.meshgrid(middle, middle, indexing="ij"))
    image = projection.parameters(x, y)
    (ux, uy), (vx, vy) = image.jacobian
    turn = np.sign(ux * vy - uy * vx)
    controls = projection.volume.controls(image.u, image.v)
    shown = image.mask & controls.valid
    part = _part(controls, shown)
    signs = orientations(projection.volume, part, middle) * turn[shown, None]
    certain = np.count_nonzero(signs)
    if not certain:
        return Folds(0.0, 0, np.zeros((3, 0)), np.zeros((3, 0, DASH_POINTS)))
    majority = 1 if signs.sum() > 0 else -1
    folded = signs == -majority
    # Back from the image to u and v: the commoner handedness of the image map.
    handedness = 1 if turn[shown].sum() >= 0 else -1
    reach = np.linspace(-DASH / 2, DASH / 2, DASH_POINTS) / FOLD_GRID
    dashes = _dashes(projection.volume, part, folded, middle[:, None] + reach)
    share = float(folded.sum() / certain)
    return Folds(share, majority * handedness, dashes[..., DASH_POINTS // 2].copy(), dashes, majority > 0)


def _dashes(volume: ViewingVolume, controls: ControlSample, chosen: BoolArray, t: Array) -> Array:
    """(3, F, K): Q on the chosen (N, T) of N projectors at t, (T, K)."""
    if not chosen.any():
        return np.zeros((3, 0, t.shape[1]))
    weights, _ = volume.spans.weights(t.ravel())
    points = (np.moveaxis(controls.points, 0, -1) @ weights).reshape(3, *chosen.shape, t.shape[1])
    found: Array = points[:, chosen]
    return found


def orientations(
    volume: ViewingVolume, controls: ControlSample, t: Array, usual: Array | None = None
) -> Array:
    """The sign of det[Qu Qv Qt] on N projectors at each t (T,): (N, T), 0 where it cannot be told.

    usual: (T,) the size that the determinant has elsewhere; None: its median over these projectors.
    """
    count = len(controls.valid)
    sample = _evaluate(volume, controls, t)
    size = determinant(sample).reshape(count, len(t))
    lengths = [np.sqrt(np.einsum("cn,cn->n", d, d)) for d in (sample.du, sample.dv, sample.dt)]
    parallel = PARALLEL * np.prod(lengths, axis=0).reshape(size.shape)
    if usual is None:
        usual = median(np.abs(size)) if count else np.zeros(len(t))
    certain: BoolArray = np.abs(size) > np.maximum(parallel, VANISHING * usual)
    return np.where(certain, np.sign(size), 0.0)


def folded_pieces(volume: ViewingVolume, controls: ControlSample, t: Array, orientation: int) -> BoolArray:
    """Return whether ``orientations`` is opposite to ``orientation``, (N, T).

    The Bernstein coefficients of the determinant exclude projectors that cannot be folded anywhere; only the
    others are tested at each t.
    """
    folded = np.zeros((len(controls.valid), len(t)), bool)
    if orientation == 0:
        return folded
    coefficients = determinant_controls(volume, controls)
    doubtful = (orientation * coefficients < 0).any(axis=(0, 1))
    if not doubtful.any():
        return folded
    part = _part(controls, doubtful)
    against = orientations(volume, part, t, np.zeros(len(t))) == -orientation
    columns = np.flatnonzero(against.any(axis=0))
    if not len(columns):
        return folded
    # Only here does it matter how large the determinant is elsewhere.
    span, start, length = volume.spans.locate(t[columns])
    weights = bernstein(coefficients.shape[1] - 1, (t[columns] - start) / length)
    usual = np.array([median(np.abs(w @ coefficients[s])) for s, w in zip(span, weights.T, strict=True)])
    if volume.spans.point_weights is not None:
        local = bernstein(volume.spans.degree, (t[columns] - start) / length)
        usual /= np.einsum("kn,nk->n", local, volume.spans.point_weights[span]) ** 4
    folded[np.ix_(doubtful, columns)] = orientations(volume, part, t[columns], usual) == -orientation
    return folded


def _part(controls: ControlSample, chosen: BoolArray) -> ControlSample:
    return ControlSample(
        controls.points[..., chosen],
        controls.du[..., chosen],
        controls.dv[..., chosen],
        controls.tile[chosen],
        controls.valid[chosen],
    )


def determinant_controls(volume: ViewingVolume, controls: ControlSample) -> Array:
    """det[Qu Qv Qt] on N projectors in Bernstein form, (S, p+1, N) for S spans of degree d.

    Of each span's own parameter in [0, 1]; Qt is by t. p = 3d-1. Of rational projectors A/w, p = 4d-1,
    it is w^4 times the determinant, which has its sign.
    """
    spans = volume.spans
    found = []
    for span, (matrix, length) in enumerate(zip(spans.matrices, np.diff(spans.breaks), strict=True)):
        weights = None if spans.point_weights is None else spans.point_weights[span]
        if weights is not None:
            matrix = matrix * weights[:, None]
        points, du, dv = (
            np.einsum("kc,cdn->kdn", matrix, values) for values in (controls.points, controls.du, controls.dv)
        )
        dt = derivative(points) / length
        if weights is not None:
            # Of A/w the derivative is (A' w - A w') / w².
            slope = derivative(weights) / length
            rising = product(dt[:, None] * weights[:, None, None])
            dt = rising - product(points[:, None] * slope[:, None, None])
        (ax, ay, az), (bx, by, bz) = du.transpose(1, 0, 2)[:, :, None], dv.transpose(1, 0, 2)[:, None]
        cross = np.stack([ay * bz - az * by, az * bx - ax * bz, ax * by - ay * bx], axis=2)
        normal = product(cross)
        found.append(product(np.einsum("icn,jcn->ijn", normal, dt)))
    return np.stack(found)


def _evaluate(volume: ViewingVolume, controls: ControlSample, t: Array) -> VolumeSample:
    """Q and its derivatives on N projectors at T parameters, each (3, N·T), t varying fastest."""
    weights, slopes = volume.spans.weights(t)

    def along(values: Array, by: Array) -> Array:
        """Control values (K, 3, N) summed by weights (K, T), (3, N·T)."""
        found: Array = (np.moveaxis(values, 0, -1) @ by).reshape(3, -1)
        return found

    return VolumeSample(
        along(controls.points, weights),
        along(controls.du, weights),
        along(controls.dv, weights),
        along(controls.points, slopes),
    )
