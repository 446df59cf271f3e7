# SPDX-License-Identifier: GPL-3.0-or-later
"""Folds: the parts of a viewing volume that are turned inside out, so that their picture is mirrored.

A fold is a change of the sign of det[Qx Qy Qt] = det[Qu Qv Qt] · det[d(u,v)/d(x,y)].
The two factors are looked at apart: at a polar centre the one vanishes where the
other is infinite, and only their signs matter.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from .typing import Array, BoolArray
from .volume import ControlSample, Projection, ViewingVolume, VolumeSample, determinant

# A fold is looked for at this many positions along each side of the image and along t.
# Even, so that none of them is the image's centre.
FOLD_GRID = 16
# A determinant below this share of the product of its columns' lengths has no sign worth
# trusting: the columns are parallel to within rounding.
PARALLEL = 1e-9
# Nor has one below this share of the median over the projectors at the same t: parameters are
# float32 in Blender, so that a pole may lie 1e-7 of the way beyond where it is meant to be.
VANISHING = 1e-5


@dataclass(frozen=True)
class Folds:
    """What ``find_folds`` found.

    share: of the shown volume, in image × t, that is folded, in [0, 0.5]. orientation:
    the sign of det[Qu Qv Qt] in the rest, -1 or 1, 0 if it vanishes everywhere.
    mirrored: whether the picture is that of a mirror outside the folds.
    positions: (3, F) float64, the samples in the folds, as Q.
    """

    share: float
    orientation: int
    positions: Array
    mirrored: bool = False

    def __bool__(self) -> bool:
        return self.share > 0.0


def find_folds(projection: Projection) -> Folds:
    """The folds in the part of the volume that is shown; of the two orientations the rarer one is the fold.

    Looked for on a coarse grid, so that a fold smaller than a cell may be missed.
    """
    middle = (np.arange(FOLD_GRID) + 0.5) / FOLD_GRID
    x, y = (a.ravel() for a in np.meshgrid(middle, middle, indexing="ij"))
    image = projection.parameters(x, y)
    (ux, uy), (vx, vy) = image.jacobian
    turn = np.sign(ux * vy - uy * vx)
    controls = projection.volume.controls(image.u, image.v)
    shown = image.mask & controls.valid
    part = ControlSample(
        controls.points[..., shown],
        controls.du[..., shown],
        controls.dv[..., shown],
        controls.tile[shown],
        controls.valid[shown],
    )
    signs = orientations(projection.volume, part, middle) * turn[shown, None]
    certain = np.count_nonzero(signs)
    if not certain:
        return Folds(0.0, 0, np.zeros((3, 0)))
    majority = 1 if signs.sum() > 0 else -1
    folded = signs == -majority
    positions = _evaluate(projection.volume, part, middle).position.reshape(3, *signs.shape)
    # Back from the image to u and v: the commoner handedness of the image map.
    handedness = 1 if turn[shown].sum() >= 0 else -1
    return Folds(float(folded.sum() / certain), majority * handedness, positions[:, folded], majority > 0)


def orientations(volume: ViewingVolume, controls: ControlSample, t: Array) -> Array:
    """The sign of det[Qu Qv Qt] on N projectors at each t (T,): (N, T), 0 where it cannot be told."""
    count = len(controls.valid)
    sample = _evaluate(volume, controls, t)
    size = determinant(sample).reshape(count, len(t))
    lengths = [np.sqrt(np.einsum("cn,cn->n", d, d)) for d in (sample.du, sample.dv, sample.dt)]
    parallel = PARALLEL * np.prod(lengths, axis=0).reshape(size.shape)
    usual = np.median(np.abs(size), axis=0) if count else np.zeros(len(t))
    certain: BoolArray = np.abs(size) > np.maximum(parallel, VANISHING * usual)
    return np.where(certain, np.sign(size), 0.0)


def _evaluate(volume: ViewingVolume, controls: ControlSample, t: Array) -> VolumeSample:
    """Q and its derivatives on N projectors at T parameters, each (3, N·T), t varying fastest."""
    weights, slopes = volume.spans.weights(t)

    def along(values: Array, by: Array) -> Array:
        found: Array = np.einsum("ks,kcn->cns", by, values).reshape(3, -1)
        return found

    return VolumeSample(
        along(controls.points, weights),
        along(controls.du, weights),
        along(controls.dv, weights),
        along(controls.points, slopes),
    )
