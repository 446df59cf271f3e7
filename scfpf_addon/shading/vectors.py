# SPDX-License-Identifier: GPL-3.0-or-later
"""Arithmetic of many vectors, (3, n), in their own precision."""

from __future__ import annotations

from typing import TypeVar

import numpy as np

from ..projection.typing import Array
from .typing import Single

Vectors = TypeVar("Vectors", Array, Single)


def dot(a: Vectors, b: Vectors) -> Vectors:
    """Scalar products (n,) of (3, n) or (3, 1) arrays."""
    products: Vectors = np.einsum("cn,cn->n", a, b)
    return products


def dot_row(a: Array, b: Array) -> Array:
    """Scalar products of (3, n) or (3, 1) arrays as a row, (1, n), or (1, 1) of two (3, 1)."""
    products: Array = a[0:1] * b[0:1] + a[1:2] * b[1:2] + a[2:3] * b[2:3]
    return products


def unit(vectors: Array) -> Array:
    """Vectors (3, n) of length 1; zero vectors stay 0."""
    length = np.sqrt(np.einsum("cn,cn->n", vectors, vectors))
    return vectors / np.where(length > 0.0, length, 1.0)


def perpendicular(normal: Vectors) -> tuple[Vectors, Vectors]:
    """Two unit vectors (3, n) square to unit normals and to each other (Duff et al., JCGT 2017)."""
    x, y, z = normal
    sign = np.copysign(1.0, z)
    a = -1.0 / (sign + z)
    b = x * y * a
    return np.stack([1.0 + sign * x * x * a, sign * b, -sign * x]), np.stack([b, sign + y * y * a, -y])
