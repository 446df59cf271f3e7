# SPDX-License-Identifier: GPL-3.0-or-later
"""Colours of spectra: the CIE 1931 observer."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from ...projection.typing import Array

# Lobes that sum to the observer's curves X, Y and Z: heights, peaks in nm, and widths below and above the
# peaks (Wyman, Sloan and Shirley, JCGT 2013).
OBSERVER = (
    ((1.056, 599.8, 37.9, 31.0), (0.362, 442.0, 16.0, 26.7), (-0.065, 501.1, 20.4, 26.2)),
    ((0.821, 568.8, 46.9, 40.5), (0.286, 530.9, 16.3, 31.1)),
    ((1.217, 437.0, 11.8, 36.0), (0.681, 459.0, 26.0, 13.8)),
)
XYZ_TO_RGB = np.array(
    [
        [3.2404542, -1.5371385, -0.4985314],
        [-0.9692660, 1.8760108, 0.0415560],
        [0.0556434, -0.2040259, 1.0572252],
    ]
)


def observer(wavelengths: Array) -> Array:
    """The observer's curves at wavelengths (W,) in nm, (3, W)."""
    return np.stack([_curve(lobes, wavelengths) for lobes in OBSERVER])


def _curve(lobes: Sequence[tuple[float, ...]], nm: Array) -> Array:
    total = np.zeros(len(nm))
    for height, peak, below, above in lobes:
        total += height * np.exp(-0.5 * ((nm - peak) / np.where(nm < peak, below, above)) ** 2)
    return total
