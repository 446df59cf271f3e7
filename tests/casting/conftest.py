# SPDX-License-Identifier: GPL-3.0-or-later
"""A reference caster: every projector against every triangle, in float64.

It shares nothing with the caster under test: roots are eigenvalues of companion
matrices, insides are ratios of areas, and it uses neither Embree nor chords.
"""

from __future__ import annotations

from math import comb
from types import SimpleNamespace

import numpy as np
import pytest

from scfpf_addon.casting.cast import CastCounts, cast
from scfpf_addon.casting.frame import pixel_centres

# Curves that leave a triangle by less than this share of it count as inside.
INSIDE = 1e-9

# Pixels compared with all triangles at once, and pieces of a curve that are compared one by one.
BATCH = 256
PIECES = 8

# What is farther apart than this share of the largest coordinate does not meet: far more than rounding.
APART = 1e-9


def power_basis(heights):
    """Coefficients of the powers of t, lowest first, of Bernstein coefficients (d+1, N)."""
    degree = len(heights) - 1
    matrix = np.zeros((degree + 1, degree + 1))
    for j in range(degree + 1):
        for k in range(j + 1):
            matrix[j, k] = (-1) ** (j - k) * comb(degree, j) * comb(j, k)
    return matrix @ heights


def real_roots(heights):
    """Real roots in [0, 1] of N polynomials (d+1, N) in Bernstein form, (d, N), NaN where there is none."""
    powers = power_basis(heights)
    size = np.abs(powers).max(axis=0)
    roots = np.full((len(powers) - 1, powers.shape[1]), np.nan)
    lacking = np.ones(powers.shape[1], bool)
    # A leading coefficient that is rounding error belongs to a polynomial of lower degree.
    for degree in range(len(powers) - 1, 0, -1):
        now = np.flatnonzero(lacking & (np.abs(powers[degree]) > 1e-13 * size))
        lacking[now] = False
        roots[:degree, now] = eigenvalue_roots(powers[: degree + 1, now])
    return np.where((roots >= 0) & (roots <= 1), roots, np.nan)


def eigenvalue_roots(powers):
    """Real roots (d, N) of polynomials given by coefficients of powers (d+1, N), NaN for complex ones."""
    degree = len(powers) - 1
    companion = np.zeros((powers.shape[1], degree, degree))
    companion[:, np.arange(1, degree), np.arange(degree - 1)] = 1.0
    companion[:, :, -1] = -(powers[:-1] / powers[-1]).T
    roots = np.linalg.eigvals(companion).T
    real = np.where(np.abs(roots.imag) < 1e-7 * (1 + np.abs(roots.real)), roots.real, np.nan)
    for _ in range(4):  # Newton's method takes the eigenvalues' rounding out
        value, slope = np.zeros_like(real), np.zeros_like(real)
        for coefficient in powers[::-1]:
            slope = slope * real + value
            value = value * real + coefficient
        with np.errstate(divide="ignore", invalid="ignore"):
            step = value / slope
        real = np.where(np.abs(step) < 0.01, real - step, real)
    return real


def evaluate(controls, t, weights):
    """Points (3, N) of Bézier curves (d+1, 3, N) with weights (d+1,)."""
    degree = len(controls) - 1
    shares = np.stack([comb(degree, i) * t**i * (1 - t) ** (degree - i) for i in range(degree + 1)])
    shares *= weights[:, None]
    return np.einsum("kn,kcn->cn", shares, controls) / shares.sum(axis=0)


def inside(corners, points):
    """Return whether points (3, N) of the planes lie in triangles (N, 3 corners, 3)."""
    a, b, c = corners[:, 0].T, corners[:, 1].T, corners[:, 2].T
    normal = np.cross(b - a, c - a, axis=0)
    whole = (normal * normal).sum(axis=0)
    shares = [
        (np.cross(q - p, points - p, axis=0) * normal).sum(axis=0) / whole
        for p, q in ((a, b), (b, c), (c, a))
    ]
    return np.min(shares, axis=0) >= -INSIDE


def pieces(controls, weights):
    """The control points (d+1, 3, PIECES * N) of equal pieces of curves (d+1, 3, N)."""
    degree = len(controls) - 1
    half = np.array([[comb(i, j) / 2**i for j in range(degree + 1)] for i in range(degree + 1)])
    cuts = np.eye(degree + 1)[None]
    while len(cuts) < PIECES:
        cuts = np.concatenate([cuts @ half, cuts @ half[::-1, ::-1]])
    points = np.tensordot(cuts * weights, controls, 1) / (cuts @ weights)[:, :, None, None]
    return points.transpose(1, 2, 0, 3).reshape(*controls.shape[:2], -1)


def candidates(controls, corners, weights):
    """The pairs of curves (P,) and triangles (P,) that may meet.

    A piece of a curve lies in the hull of its control points. That is compared with the triangle's box, plane
    and edges.
    """
    points = pieces(controls, weights)
    margin = APART * max(np.abs(points).max(), np.abs(corners).max())
    low, high = points.min(axis=0) - margin, points.max(axis=0) + margin
    lower, upper = corners.min(axis=1), corners.max(axis=1)
    near = (lower <= high.max(axis=1)).all(axis=1) & (upper >= low.min(axis=1)).all(axis=1)
    near = np.flatnonzero(near)
    overlap = np.ones((points.shape[2], len(near)), bool)
    for axis in range(3):
        overlap &= low[axis, :, None] <= upper[near, axis]
        overlap &= high[axis, :, None] >= lower[near, axis]
    piece, face = np.nonzero(overlap)
    face = near[face]
    normal = np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0])
    edges = np.roll(corners, -1, axis=1) - corners
    for k, across in enumerate((normal, *(np.cross(normal, edges[:, k]) for k in range(3)))):
        with np.errstate(invalid="ignore"):  # triangles without an area, which nothing meets
            across = across / np.linalg.norm(across, axis=1)[:, None]
        distance = points[:, :, piece] - corners[face, max(k - 1, 0)].T
        distance = np.einsum("nc,kcn->kn", across[face], distance)
        kept = distance.max(axis=0) >= -margin
        if k == 0:
            kept &= distance.min(axis=0) <= margin
        piece, face = piece[kept], face[kept]
    pairs = np.unique(piece % controls.shape[2] * len(corners) + face)
    return pairs // len(corners), pairs % len(corners)


def first_hits(controls, corners, weights):
    """First t and triangle of Bézier curves (d+1, 3, N) with weights (d+1,) and triangles (T, 3, 3)."""
    count = controls.shape[2]
    t, triangle = np.full(count, np.inf), np.full(count, -1)
    normal = np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0])
    offset = np.einsum("tc,tc->t", normal, corners[:, 0])
    for first in range(0, count, BATCH):
        some = controls[:, :, first : first + BATCH]
        curve, face = candidates(some, corners, weights)
        heights = np.einsum("nc,kcn->kn", normal[face], some[:, :, curve]) - offset[face]
        for roots in real_roots(heights * weights[:, None]):
            known = np.flatnonzero(~np.isnan(roots))
            points = evaluate(some[:, :, curve[known]], roots[known], weights)
            hit = known[inside(corners[face[known]], points)]
            # The last of several writes to one pixel is the nearest.
            hit = hit[np.argsort(-roots[hit])]
            nearer = hit[roots[hit] < t[first + curve[hit]]]
            t[first + curve[nearer]], triangle[first + curve[nearer]] = roots[nearer], face[nearer]
    return t, triangle


def brute_force(vertices, triangles, projection, x, y):
    """First t (inf for none) and triangle (-1) of the projectors through x, y, in world space."""
    points, valid = projection.projectors(x, y)
    spans = projection.volume.spans
    t, triangle = np.full(len(x), np.inf), np.full(len(x), -1)
    for span in reversed(range(len(spans.matrices))):
        controls = np.einsum("ik,kcn->icn", spans.matrices[span], points)
        weights = np.ones(len(controls)) if spans.point_weights is None else spans.point_weights[span]
        local, found = first_hits(controls, vertices[triangles], weights)
        start, end = spans.breaks[span], spans.breaks[span + 1]
        hit = np.isfinite(local) & valid
        t[hit], triangle[hit] = start + local[hit] * (end - start), found[hit]
    return t, triangle


def interior(triangle, width):
    """Pixels (N,) whose 3 × 3 block sees one and the same triangle, or nothing throughout."""
    rows = triangle.reshape(-1, width)
    same = np.zeros(rows.shape, bool)
    height = len(rows)
    blocks = [rows[1 + j : height - 1 + j, 1 + i : width - 1 + i] for j in (-1, 0, 1) for i in (-1, 0, 1)]
    same[1:-1, 1:-1] = np.logical_and.reduce([b == rows[1:-1, 1:-1] for b in blocks])
    return same.ravel()


def cast_image(scene, projection, width, height, pixel_error=0.1, grid=True, counts=None):
    """A whole image as one tile, projection in world space."""
    x, y = pixel_centres(width, height, (0, height))
    counts = CastCounts() if counts is None else counts
    return cast(
        scene,
        projection.transformed(scene.matrix),
        x,
        y,
        (1 / width, 1 / height),
        pixel_error,
        counts,
        width if grid else None,
    )


@pytest.fixture(scope="session")
def reference():
    """The functions of this file."""
    return SimpleNamespace(brute_force=brute_force, interior=interior, cast_image=cast_image)
