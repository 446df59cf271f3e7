# SPDX-License-Identifier: GPL-3.0-or-later
"""Projectors of several cubic spans: the first hit against dense sampling.

The reference is in float64.
"""

from functools import cache
from math import comb

import numpy as np
import pytest

from scfpf_addon.casting.cast import cast
from scfpf_addon.casting.common.hits import Hits
from scfpf_addon.casting.scene.cast_scene import CastScene
from scfpf_addon.projection.surfaces.nurbs import NurbsAxis, NurbsPatch
from scfpf_addon.projection.surfaces.surface import Grid
from scfpf_addon.projection.volume.lattice import Lattice
from scfpf_addon.projection.volume.viewing_volume import Projection, ViewingVolume

# Straight pieces a projector is cut into for the reference: they leave it by about 1e-6 of its length.
PIECES = 1500
# Hits of the reference and of the caster agree to the pieces' error, along a curve about 5 long.
T_ERROR = 1e-4
# Share of projectors that may meet another triangle: silhouettes within the pieces' and the chords' error.
SILHOUETTES = 0.01
# Interpolation and layers of lattices; of two layers a projector is one span.
LATTICES = [("BSPLINE", 2), ("BSPLINE", 5), ("CARDINAL", 3)]
# Pixels along and up the image, and how many of them are compared.
SIDE, COMPARED = 96, 160


def triangles():
    """Triangles of about a tenth of the volume, anywhere in it: vertices (V, 3) and triangles (T, 3)."""
    rng = np.random.default_rng(11)
    centres = rng.uniform((-1, -1, -5.5), (1, 1, -0.5), size=(150, 3))
    corners = centres[:, None] + rng.normal(scale=0.25, size=(150, 3, 3))
    return corners.reshape(-1, 3), np.arange(450, dtype=np.int32).reshape(-1, 3)


@cache
def scene():
    return CastScene(*triangles())


def projection(kind, count, basis="B_SPLINE"):
    """Wavering surfaces one behind the other, so that projectors bend in every span."""
    rng = np.random.default_rng(count)
    if kind in {"BSPLINE", "CARDINAL"}:
        moved = rng.normal(scale=0.05, size=(count, 4, 4, 3))
        moved += rng.uniform(-0.6, 0.6, (count, 1, 1, 3)) * (1, 1, 0)
        lattice = Lattice(np.array([-1.0, -1, -6]), np.array([1.0, 1, 0]), moved, (kind,) * 3)
        return Projection(lattice.volume(np.eye(4)))
    line = np.linspace(-1, 1, 4)
    x, y = np.meshgrid(line, line)
    surfaces = []
    for i in range(count):
        net = np.stack([x, y, np.full_like(x, -6.0 * i / (count - 1))], axis=2)
        net += rng.normal(scale=0.05, size=net.shape) + rng.uniform(-0.6, 0.6, 3) * (1, 1, 0)
        if kind == "NURBS":
            weights = rng.uniform(0.5, 2, (4, 4, 1))
            surfaces.append(NurbsPatch(np.concatenate([net, weights], axis=2), NurbsAxis(4), NurbsAxis(3)))
        else:
            surfaces.append(Grid(net))
    return Projection(ViewingVolume(tuple(surfaces), basis))


@cache
def first_by_sampling(kind, count):
    """The pixels compared, and t (inf for none) and triangle where their fine polylines first meet one."""
    chosen = np.random.default_rng(5).choice(SIDE * SIDE, COMPARED, replace=False)
    lines = polylines(projection(kind, count), *(place[chosen] for place in places()))
    vertices, faces = triangles()
    corners = vertices[faces]
    edge1, edge2 = corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0]
    normal = np.cross(edge1, edge2)
    offset = np.einsum("tc,tc->t", corners[:, 0], normal)
    best, which = np.full(COMPARED, np.inf), np.full(COMPARED, -1)
    for ray in range(COMPARED):
        points = lines[:, :, ray]
        height = points @ normal.T - offset
        piece, triangle = np.nonzero((height[:-1] < 0) != (height[1:] < 0))
        low, high = height[piece, triangle], height[piece + 1, triangle]
        share = low / (low - high)
        hit = points[piece] * (1 - share[:, None]) + points[piece + 1] * share[:, None]
        away = hit - corners[triangle, 0]
        area = np.einsum("nc,nc->n", normal[triangle], normal[triangle])
        b = np.einsum("nc,nc->n", np.cross(away, edge2[triangle]), normal[triangle]) / area
        c = np.einsum("nc,nc->n", np.cross(edge1[triangle], away), normal[triangle]) / area
        inside = (b >= 0) & (c >= 0) & (b + c <= 1)
        if inside.any():
            at = (piece[inside] + share[inside]) / PIECES
            best[ray], which[ray] = at.min(), triangle[inside][at.argmin()]
    return chosen, best, which


def polylines(world, x, y):
    """Points (PIECES + 1, 3, N) of projectors at equal steps of t, from the Bernstein form of their spans."""
    points, _ = world.projectors(x, y)
    spans = world.volume.spans
    assert spans.point_weights is None
    t = np.linspace(0, 1, PIECES + 1)
    span = np.clip(np.searchsorted(spans.breaks, t, side="right") - 1, 0, len(spans.matrices) - 1)
    t = (t - spans.breaks[span]) / np.diff(spans.breaks)[span]
    degree = spans.matrices.shape[1] - 1
    shares = np.stack([comb(degree, i) * t**i * (1 - t) ** (degree - i) for i in range(degree + 1)], axis=1)
    return np.einsum("ti,tik,kcn->tcn", shares, spans.matrices[span], points, optimize=True)


def places():
    """The centres of all pixels of the image."""
    place = (np.arange(SIDE) + 0.5) / SIDE
    return [grid.ravel() for grid in np.meshgrid(place, place)]


@pytest.mark.parametrize(("kind", "count"), [("GRID", 5), ("GRID", 8), ("NURBS", 6), ("NURBS", 4), *LATTICES])
@pytest.mark.parametrize("columns", [None, SIDE])
def test_the_first_hit_is_that_of_dense_sampling(kind, count, columns):
    world = projection(kind, count)
    cast_scene = scene()
    x, y = places()
    moved = world.transformed(cast_scene.matrix)
    hits = cast(cast_scene, moved, x, y, (1 / SIDE, 1 / SIDE), 0.001, columns=columns)
    chosen, t, triangle = first_by_sampling(kind, count)
    hits = Hits(*(field[..., chosen] for field in hits))
    x, y = x[chosen], y[chosen]
    assert 0.3 < np.isfinite(t).mean() < 1.0
    assert (hits.triangle != triangle).mean() <= SILHOUETTES
    same = (hits.triangle == triangle) & (triangle >= 0)
    assert np.abs(hits.t[same] - t[same]).max() < T_ERROR
    # Every span takes part, and the hit lies on the true curve.
    spans = np.searchsorted(world.volume.spans.breaks, hits.t[same], side="right") - 1
    assert set(spans) == set(range(len(world.volume.spans.matrices)))
    exact = moved.volume.evaluate(x[same], y[same], hits.t[same])
    assert np.abs(exact.position - hits.position[:, same]).max() < 1e-12
    assert np.abs(exact.dt - hits.tangent[:, same]).max() < 1e-9


def test_few_surfaces_give_the_image_of_the_bezier_basis():
    cast_scene = scene()
    x, y = places()
    one, other = (
        cast(cast_scene, projection("NURBS", 4, basis).transformed(cast_scene.matrix), x, y, (1 / SIDE,) * 2)
        for basis in ("B_SPLINE", "BEZIER")
    )
    assert np.array_equal(one.t, other.t) and np.array_equal(one.triangle, other.triangle)
