# SPDX-License-Identifier: GPL-3.0-or-later
"""A lattice's volume: against the modifier's sum, point by point, and derivatives in high precision.

Blender's own Lattice modifier is compared in tests/blender/camera/test_lattice_object.py.
"""

import itertools

import mpmath
import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from scfpf_addon.projection.surfaces.surface import Grid
from scfpf_addon.projection.volume.lattice import Lattice
from scfpf_addon.projection.volume.viewing_volume import Projection, ViewingVolume

KINDS = ("LINEAR", "CARDINAL", "CATMULL_ROM", "BSPLINE")
# Coordinates are near 1; a cubic W solves for the surfaces that span it, condition up to 100 per layer.
ROUNDING = 1e-12
SLOPE_ROUNDING = 1e-10
LOW, HIGH = np.array([-1.5, -1.0, -2.0]), np.array([1.5, 1.0, 2.0])


def weights(kind, s):
    """Weights of the four points about a cell, at s in it; numbers of any type."""
    if kind == "LINEAR":
        return [0, 1 - s, s, 0]
    if kind == "BSPLINE":
        return [
            (1 - s) ** 3 / 6,
            (3 * s**3 - 6 * s**2 + 4) / 6,
            (3 * (1 - s) ** 3 - 6 * (1 - s) ** 2 + 4) / 6,
            s**3 / 6,
        ]
    f = mpmath.mpf("0.71") if kind == "CARDINAL" else mpmath.mpf("0.5")
    # Hermite: tangents are f times the way between the neighbours.
    h0, h1, t0, t1 = 2 * s**3 - 3 * s**2 + 1, 3 * s**2 - 2 * s**3, s**3 - 2 * s**2 + s, s**3 - s**2
    return [-f * t0, h0 - f * t1, h1 + f * t0, f * t1]


def deformed(lattice, u, v, w):
    """The point at shares u, v, w of the box after the modifier, mpmath numbers."""
    shape = lattice.moved.shape[2::-1]
    parts = []
    for share, count, kind in zip((u, v, w), shape, lattice.kinds, strict=True):
        place = share * (count - 1)
        cell = min(max(int(mpmath.floor(place)), 0), count - 2)
        parts.append(
            [(min(max(cell - 1 + k, 0), count - 1), x) for k, x in enumerate(weights(kind, place - cell))]
        )
    total = [low + share * (high - low) for low, high, share in zip(LOW, HIGH, (u, v, w), strict=True)]
    for (i, a), (j, b), (k, c) in itertools.product(*parts):
        for axis in range(3):
            total[axis] += a * b * c * float(lattice.moved[k, j, i, axis])
    return total


def some_lattice(shape, kinds, seed=0):
    rng = np.random.default_rng(seed)
    return Lattice(LOW, HIGH, rng.normal(0, 0.3, (*shape, 3)), kinds)


shapes = st.tuples(st.integers(2, 5), st.integers(2, 5), st.integers(2, 5))
kinds = st.tuples(*[st.sampled_from(KINDS)] * 3)
# Off the cells' borders for up to five points: there derivatives are one-sided.
inner = st.sampled_from([0.11, 0.2, 0.37, 0.62, 0.83, 0.97])


@given(shapes, kinds, st.floats(0, 1), st.floats(0, 1), st.floats(0, 1))
def test_the_volume_is_the_deformed_box(shape, kinds, u, v, t):
    lattice = some_lattice(shape, kinds)
    got = lattice.volume(np.eye(4)).evaluate(np.array([u]), np.array([v]), np.array([t])).position[:, 0]
    exact = deformed(lattice, mpmath.mpf(u), mpmath.mpf(v), 1 - mpmath.mpf(t))
    assert np.abs(got - np.array(exact, float)).max() < ROUNDING


@given(shapes, kinds, inner, inner, inner)
def test_derivatives(shape, kinds, u, v, t):
    lattice = some_lattice(shape, kinds)
    sample = lattice.volume(np.eye(4)).evaluate(np.array([u]), np.array([v]), np.array([t]))
    with mpmath.workdps(40):
        at = [mpmath.mpf(u), mpmath.mpf(v), mpmath.mpf(t)]
        for axis, got in enumerate((sample.du, sample.dv, sample.dt)):
            step = mpmath.mpf(10) ** -12

            def moved(by, axis=axis):
                place = [x + by * (i == axis) for i, x in enumerate(at)]
                return deformed(lattice, place[0], place[1], 1 - place[2])

            exact = [(a - b) / (2 * step) for a, b in zip(moved(step), moved(-step), strict=True)]
            assert np.abs(got[:, 0] - np.array(exact, float)).max() < SLOPE_ROUNDING


@pytest.mark.parametrize("kind", KINDS)
@pytest.mark.parametrize("layers", [2, 3, 12])
def test_surfaces_are_what_the_projectors_pass_through(kind, layers):
    """So near and far surface are drawn where the volume ends."""
    volume = some_lattice((layers, 3, 4), (kind, kind, kind)).volume(np.eye(4))
    u, v = np.random.default_rng(1).uniform(size=(2, 20))
    for t, surface in ((0.0, volume.surfaces[0]), (1.0, volume.surfaces[-1])):
        assert np.allclose(
            volume.evaluate(u, v, np.full(20, t)).position, surface.evaluate(u, v).position, atol=ROUNDING
        )
    total = volume.spans.weights(np.linspace(0, 1, 50))[0].sum(0)
    assert np.allclose(total, 1, atol=ROUNDING)


@given(shapes, kinds, st.integers(0, 2**32 - 1))
def test_affine_invariance(shape, kinds, seed):
    rng = np.random.default_rng(seed)
    matrix = np.eye(4)
    matrix[:3] = rng.normal(size=(3, 4))
    u, v, t = rng.uniform(size=(3, 9))
    lattice = some_lattice(shape, kinds)
    inside = lattice.volume(np.eye(4)).evaluate(u, v, t).position
    placed = lattice.volume(matrix)
    assert np.allclose(
        placed.evaluate(u, v, t).position, matrix[:3, :3] @ inside + matrix[:3, 3:], atol=10 * ROUNDING
    )
    assert type(placed.transformed(matrix)) is type(placed)


def test_positions_without_derivatives_are_the_same():
    for kinds in itertools.product(KINDS, repeat=2):
        layer = some_lattice((2, 4, 5), (*kinds, "LINEAR")).layers(np.eye(4))[1]
        u, v = np.random.default_rng(2).uniform(size=(2, 99))
        assert np.array_equal(layer.positions(u, v).position, layer.evaluate(u, v).position)


def test_linear_layers_are_grids_near_one_first():
    lattice = some_lattice((3, 4, 5), ("LINEAR",) * 3)
    x, y = np.meshgrid(np.linspace(-1.5, 1.5, 5), np.linspace(-1, 1, 4))
    u, v = np.random.default_rng(3).uniform(size=(2, 50))
    for layer, z, moved in zip(lattice.layers(np.eye(4)), (2.0, 0.0, -2.0), lattice.moved[::-1], strict=True):
        grid = Grid(np.stack([x, y, np.full_like(x, z)], 2) + moved)
        for got, expected in zip(layer.evaluate(u, v)[:3], grid.evaluate(u, v)[:3], strict=True):
            assert np.allclose(got, expected, atol=ROUNDING)


def test_layers_make_a_volume_with_any_basis():
    lattice = some_lattice((4, 3, 3), ("BSPLINE",) * 3)
    volume = ViewingVolume(lattice.layers(np.eye(4)))
    assert Projection(volume).projectors(np.array([0.5]), np.array([0.5])).points.shape == (4, 3, 1)


def test_one_layer_is_no_volume():
    with pytest.raises(ValueError, match="two layers"):
        some_lattice((1, 2, 2), ("LINEAR",) * 3).volume(np.eye(4))
