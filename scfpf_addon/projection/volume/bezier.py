# SPDX-License-Identifier: GPL-3.0-or-later
"""Batches of Bézier curves in Bernstein form.

A batch of N curves of degree d in 3-D is one array of control points, (d+1, 3, N) float64. The component axis
comes before the curve axis so that every operation runs over contiguous memory.
"""

from __future__ import annotations

from math import comb

import numpy as np

from ..typing import Array


def bernstein(degree: int, t: Array) -> Array:
    """Values of the Bernstein polynomials B(i, degree) at t.

    t: any shape, float64. Returns (degree+1, *t.shape).
    """
    t = np.asarray(t, np.float64)
    rest = 1.0 - t
    values = np.empty((degree + 1, *t.shape))
    values[0] = 1.0
    for i in range(1, degree + 1):
        np.multiply(values[i - 1], t, out=values[i, ...])
    falling = rest
    for i in range(degree - 1, -1, -1):
        values[i, ...] *= falling if i == 0 else comb(degree, i) * falling
        falling = falling * rest
    return values


def bernstein_derivative(degree: int, t: Array) -> Array:
    """First derivatives of the Bernstein polynomials at t, (degree+1, *t.shape)."""
    t = np.asarray(t, np.float64)
    if degree == 0:
        return np.zeros((1, *t.shape))
    lower = bernstein(degree - 1, t)
    result = np.zeros((degree + 1, *t.shape))
    result[:-1] -= degree * lower
    result[1:] += degree * lower
    return result


def bernstein_second_derivative(degree: int, t: Array) -> Array:
    """Second derivatives of the Bernstein polynomials at t, (degree+1, *t.shape)."""
    t = np.asarray(t, np.float64)
    result = np.zeros((degree + 1, *t.shape))
    if degree >= 2:
        lower = degree * (degree - 1) * bernstein(degree - 2, t)
        result[:-2] += lower
        result[1:-1] -= 2 * lower
        result[2:] += lower
    return result


def evaluate(controls: Array, t: Array) -> tuple[Array, Array]:
    """Point and tangent of each curve by de Casteljau's algorithm.

    controls: (d+1, 3, N) with d >= 1. t: scalar or (N,), one parameter a curve.
    Returns position (3, N) and derivative by t (3, N).
    """
    points = np.asarray(controls, np.float64)
    degree = len(points) - 1
    for _ in range(degree - 1):
        points = points[:-1] + (points[1:] - points[:-1]) * t
    step = points[1] - points[0]
    return points[0] + step * t, degree * step


def derivative(controls: Array) -> Array:
    """Control points of the hodograph (the derivative curve), (d, 3, N)."""
    differences: Array = np.diff(controls, axis=0)
    return (len(controls) - 1) * differences


def restrict(controls: Array, start: Array, end: Array) -> Array:
    """Control points of the same curves over [start, end] of their parameter.

    start, end: scalar or (N,). Blossoming: control point j of the result is the
    blossom at (start × (d-j), end × j). Farin, Curves and Surfaces for CAGD, §4.
    """
    # After r rounds the j-th holds those blossoms of r arguments of which j are the end.
    blossoms = [np.asarray(controls, np.float64)]
    for _ in range(len(controls) - 1):
        last = blossoms[-1]
        blossoms = [points[:-1] + (points[1:] - points[:-1]) * start for points in blossoms]
        blossoms.append(last[:-1] + (last[1:] - last[:-1]) * end)
    return np.stack([points[0] for points in blossoms])


def product(terms: Array) -> Array:
    """Bernstein coefficients of a product of polynomials of degrees p and q, (p+q+1, …).

    terms: (p+1, q+1, …), the products of their coefficients, summed over what the caller likes.
    Farouki and Rajan, Algorithms for polynomials in Bernstein form (1988).
    """
    p, q = terms.shape[0] - 1, terms.shape[1] - 1
    result = np.zeros((p + q + 1, *terms.shape[2:]))
    for i in range(p + 1):
        for j in range(q + 1):
            result[i + j] += comb(p, i) * comb(q, j) / comb(p + q, i + j) * terms[i, j]
    return result


def second_difference(controls: Array) -> Array:
    """Largest length of the second differences of the control polygon, (N,).

    This is max ‖Q(i+2) - 2 Q(i+1) + Q(i)‖, the quantity in Wang's bound.
    """
    if len(controls) < 3:
        return np.zeros(np.shape(controls)[-1])
    lengths: Array = np.linalg.norm(np.diff(controls, 2, axis=0), axis=1)
    largest: Array = lengths.max(axis=0)
    return largest


def chord_count(controls: Array, tolerance: Array | float) -> Array:
    """Chords that keep each curve within tolerance of its polyline (Wang's bound).

    tolerance: scalar or (N,), same length unit as the controls, > 0.
    Returns (N,) int64, at least 1: N = ceil(sqrt(d(d-1)/8 · max‖Δ²Q‖ / tolerance)).
    Source: Goldman, Pyramid Algorithms (2003); exact for d = 2 with uniform chords.
    """
    degree = len(controls) - 1
    bend = degree * (degree - 1) / 8.0 * second_difference(controls)
    return np.maximum(1, np.ceil(np.sqrt(bend / tolerance))).astype(np.int64)
