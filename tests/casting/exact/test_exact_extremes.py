# SPDX-License-Identifier: GPL-3.0-or-later
"""Exact casting at the extremes, each with its figure; docs/accuracy.md has the table.

SCFPF_FULL_TESTS=1 in the environment asks for the full number of curves and volumes.
"""

import math
import os
import warnings

import numpy as np
import pytest

from benchmarks import extremes
from benchmarks.scenes import bent_projection, boxes
from scfpf_addon.casting.frame import pixel_centres
from scfpf_addon.casting.scene.cast_scene import CastScene
from scfpf_addon.projection.surfaces.surface import Grid, Plane
from scfpf_addon.projection.volume.viewing_volume import Projection, ViewingVolume

FULL = bool(os.environ.get("SCFPF_FULL_TESTS"))


@pytest.mark.parametrize(
    ("offset", "factor", "most"),
    [
        (1e3, 1.0, 1e-12),
        (1e5, 1.0, 1e-10),
        (1e8, 1.0, 1e-7),
        (0.0, 1e-6, 1e-14),
        (0.0, 1e6, 1e-14),
        (1e8, 1e6, 1e-12),
        (1e3, 1e-6, 1e-6),
    ],
)
@pytest.mark.parametrize(("degree", "angle"), [(1, 0.0), (2, 60.0), (3, 180.0)])
def test_moved_and_scaled(offset, factor, most, degree, angle):
    """float64 vertices far away are round themselves: ``most`` is that, and no pixel in 5184 changes."""
    figures = extremes.moved(offset, factor, degree, angle)
    assert figures["largest change of t elsewhere"] < most
    assert figures["pixels that see another triangle"] == 0


@pytest.mark.parametrize("degree", [1, 3, 5])
def test_nothing_slips_through_vertices_and_edges(degree):
    figures = extremes.edge_leaks(100_000 if FULL else 4000, degree)
    assert figures["curves"] >= 4000 and figures["leaks"] == 0


@pytest.mark.parametrize("degree", [1, 2, 3])
@pytest.mark.parametrize("angle", [1e-2, 1e-4, 1e-6, 1e-8])
def test_grazing(angle, degree):
    figures = extremes.grazing(angle, degree)
    assert figures["lost"] == 0 and figures["error of t"] < 1e-15


@pytest.mark.parametrize("degree", [2, 3, 5])
@pytest.mark.parametrize("size", [0.0, 1e-18, 1e-15, 1e-12, 1e-6])
def test_vanishing_leading_coefficients(size, degree):
    figures = extremes.leading(size, degree)
    assert figures["lost"] == 0 and figures["error of t"] < 1e-15


@pytest.mark.parametrize("degree", [1, 2, 3])
@pytest.mark.parametrize("where", ["0", "1", "1e-15", "1e-12", "1e-9", "1e-6", "1e-4", "1e-3"])
def test_beginnings_and_ends_on_surfaces(where, degree):
    """Projectors begin beside a surface, inside its prism, which no chord enters there."""
    figures = extremes.ends(where, degree)
    assert figures["lost"] == 0 and figures["error of t"] < 1e-14


@pytest.mark.parametrize("degree", [1, 2, 3])
@pytest.mark.parametrize("ratio", [1e3, 1e6, 1e7])
def test_volumes_much_longer_than_wide(ratio, degree):
    figures = extremes.long_volume(ratio, degree)
    assert figures["lost"] == 0 and figures["error of t"] < 1e-14


def differing_share(reference, mesh, projection, width, height):
    """The share of pixels whose t differs from that of all triangles in float64."""
    x, y = pixel_centres(width, height, (0, height))
    t, _ = reference.brute_force(*mesh, projection, x, y)
    hits = reference.cast_image(CastScene(*mesh), projection, width, height, 0.0)
    assert np.isfinite(t).mean() > 0.5 and extremes.sound(hits)
    ours, true = (np.where(np.isfinite(a), a, 2.0) for a in (hits.t, t))
    return float((np.abs(ours - true) > 1e-9).mean())


@pytest.mark.parametrize("degree", [1, 2, 3])
@pytest.mark.parametrize("size", [1e-4, 3e-6])
def test_above_the_floor_every_pixel_is_exact(reference, size, degree):
    """Edges of 6e-7 of the scene's reach and more, in a volume that begins in hundreds of prisms."""
    assert differing_share(reference, *extremes.small_detail(size, degree), 18, 12) == 0.0


@pytest.mark.parametrize("degree", [1, 2, 3])
def test_below_the_floor_it_is_not(reference, degree):
    """Edges of 2e-8 of the scene's reach: a third of float32's step. Pixels differ, but few."""
    assert 0.0 < differing_share(reference, *extremes.small_detail(1e-7, degree), 24, 16) < 0.1


def test_random_volumes():
    """Any kinds of surfaces, collapsed, coinciding, folded, crossing themselves: always an answer."""
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        figures = extremes.random_volumes(100_000 if FULL else 120)
    assert figures["not sound"] == 0 and figures["share hit"] > 0.2


def degenerate(kind):
    """Surfaces that coincide, collapse or cross themselves, along a view of the boxes."""
    near, middle, far = bent_projection(2, math.radians(60)).volume.surfaces
    flat = np.diag([1.0, 0.0, 1.0, 1.0])
    u, v = np.meshgrid(np.linspace(-1, 1, 9), np.linspace(-1, 1, 5))
    bow = Grid(np.stack([3 + 6 * u * v, 4 * v + 0.2 * u, -9 - 2 * u * u], axis=-1))
    pleat = Grid(np.stack([5 + 4 * u + 5 * np.sin(4 * u), 4 * v, -9 - 3 * np.cos(5 * u)], axis=-1))
    surfaces = {
        "first two coincide": (near, near, far),
        "last two coincide": (near, far, far),
        "near and far coincide": (near, far, near),
        "near is a point": (Plane(0.0, 0.0, matrix=near.matrix), middle, far),
        "near is a line": (near.transformed(flat), middle, far),
        "far is a line": (near, middle, Plane(far.width, 0.0, matrix=far.matrix)),
        "middle crosses itself": (near, bow, far),
        "middle is folded": (near, pleat, far),
        "straight through a fold": (near, pleat),
    }[kind]
    return Projection(ViewingVolume(surfaces))


@pytest.mark.parametrize(
    "kind",
    [
        "first two coincide",
        "last two coincide",
        "near and far coincide",
        "near is a point",
        "near is a line",
        "far is a line",
        "middle crosses itself",
        "middle is folded",
        "straight through a fold",
    ],
)
def test_surfaces_that_coincide_collapse_or_cross_themselves(reference, kind):
    """No pixel of 1536 differs from all triangles in float64."""
    vertices, triangles = boxes(1000)
    x, y = pixel_centres(48, 32, (0, 32))
    t, _ = reference.brute_force(vertices, triangles, degenerate(kind), x, y)
    hits = reference.cast_image(CastScene(vertices, triangles), degenerate(kind), 48, 32, 0.0)
    ours, true = (np.where(np.isfinite(a), a, 2.0) for a in (hits.t, t))
    assert (np.abs(ours - true) < 1e-9).all() and np.isfinite(t).mean() > 0.05
    assert extremes.sound(hits)
