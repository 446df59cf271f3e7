# SPDX-License-Identifier: GPL-3.0-or-later
"""What a finished frame says about itself."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from ..projection.volume import Projection, determinant

# A fold is looked for at this many positions along each side of the image and along t.
FOLD_GRID = 17
# A determinant below this share of the product of its columns' lengths has no sign worth
# trusting: the columns are parallel to within rounding.
FOLD_TOLERANCE = 1e-9


@dataclass(frozen=True)
class RenderReport:
    """Figures of one frame.

    seconds: everything; build_seconds: the part spent preparing the scene. straight:
    whether a projector is one straight line. projectors: how many were cast, one a
    sample where the image shows something; chords: straight pieces they were cut into
    where the scene is; rays: all that were traced for them, shadow rays not counted.
    hit_fraction: of the projectors, in [0, 1]. error_bound: pixels between a projector
    and its chords, at most. folded: whether the volume turns inside out somewhere, so
    that parts of the picture are mirrored.
    """

    width: int
    height: int
    seconds: float
    build_seconds: float
    straight: bool
    projectors: int
    rays: int
    chords: int
    hit_fraction: float
    error_bound: float
    folded: bool

    @property
    def chords_per_projector(self) -> float:
        """Mean number of chords in a projector, 0 when nothing was cast."""
        return self.chords / self.projectors if self.projectors else 0.0

    def summary(self) -> str:
        """One line for the interface."""
        parts = [f"{self.width}×{self.height} in {self.seconds:.2f} s"]
        if not self.projectors:
            parts.append("nothing to cast at")
        else:
            parts.append(f"{_short(self.rays)} rays")
            if self.straight:
                parts.append("straight projectors")
            else:
                parts.append(f"{self.chords_per_projector:.1f} chords a projector")
                parts.append(f"error ≤ {self.error_bound:.2g} px")
        if self.folded:
            parts.append("the volume folds")
        return " · ".join(parts)


def _short(count: int) -> str:
    """1234567 as 1.2 M."""
    for size, unit in ((1e9, "G"), (1e6, "M"), (1e3, "k")):
        if count >= size:
            return f"{count / size:.1f} {unit}"
    return str(count)


def is_folded(projection: Projection) -> bool:
    """Whether det[Qu Qv Qt] changes its sign in the part of the volume that is shown.

    Looked for on a coarse grid, so that a fold smaller than a cell may be missed.
    """
    middle = (np.arange(FOLD_GRID) + 0.5) / FOLD_GRID
    x, y, t = (a.ravel() for a in np.meshgrid(middle, middle, middle, indexing="ij"))
    image = projection.parameters(x, y)
    controls = projection.volume.controls(image.u, image.v)
    sample = projection.volume.evaluate_controls(controls, t)
    lengths = [np.sqrt(np.einsum("cn,cn->n", d, d)) for d in (sample.du, sample.dv, sample.dt)]
    size = determinant(sample)
    certain = np.abs(size) > FOLD_TOLERANCE * np.prod(lengths, axis=0)
    signs = np.sign(size[certain & image.mask & controls.valid])
    return bool(len(signs) and signs.min() < 0 < signs.max())
