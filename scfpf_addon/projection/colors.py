# SPDX-License-Identifier: GPL-3.0-or-later
"""Luminance, and the curves of sRGB (IEC 61966-2-1)."""

from __future__ import annotations

import numpy as np

from .typing import Array, Float32Array

# Weights of red, green and blue in luminance (Rec.709, Blender's working space).
LUMINANCE = np.array([0.2126, 0.7152, 0.0722])


def linear_from_srgb(color: Array) -> Array:
    """Linear values of sRGB's, of any shape."""
    color = np.asarray(color)
    high = ((np.maximum(color, 0.0) + 0.055) / 1.055) ** 2.4
    result: Array = np.where(color <= 0.04045, color / 12.92, high)
    return result


def srgb_from_linear(color: Float32Array) -> Float32Array:
    """sRGB's values of linear ones: the inverse of ``linear_from_srgb``."""
    high = np.maximum(color, np.float32(0.0)) ** np.float32(1.0 / 2.4) * np.float32(1.055) - np.float32(0.055)
    return np.where(color <= 0.04045 / 12.92, color * np.float32(12.92), high)
