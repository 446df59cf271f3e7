# SPDX-License-Identifier: GPL-3.0-or-later
"""NURBS patches: against the definition in exact arithmetic, closed forms and derivatives in high precision.

Blender's own tessellation is compared in tests/blender/surfaces/test_nurbs_objects.py.
"""

import itertools
from fractions import Fraction

import mpmath
import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from scfpf_addon.projection.surfaces.nurbs import Basis, NurbsAxis, NurbsPatch, fitted_points
from scfpf_addon.projection.surfaces.surface import BilinearPatch, Grid
from scfpf_addon.projection.volume.viewing_volume import ViewingVolume

# Coordinates and weights here are near 1; each comes from some 50 roundings.
ROUNDING = 1e-13
# Derivatives by the knots, of which a patch has up to ten, and quotients of them.
SLOPE_ROUNDING = 1e-11

FLAGS = list(itertools.product((False, True), repeat=3))
PLACES = np.array([0.0, 0.125, 0.3, 0.5, 0.71875, 0.96875, 1.0])

axes = st.builds(NurbsAxis, st.integers(2, 6), *[st.booleans()] * 3)
counts = st.integers(2, 9)


def blender_knots(axis, count):
    """The knots by their description, in fractions: whole steps, inner ones repeated for Bézier."""
    order = axis.order
    if axis.cyclic:
        repeat = order - 1 if axis.bezier else 1
        first = order - 1 if axis.endpoint else min(2, repeat)
        one_turn = [0] if axis.endpoint else []
        value = len(one_turn)
        left = first
        while len(one_turn) < count:
            one_turn.append(value)
            left -= 1
            if left == 0:
                value, left = value + 1, repeat
        knots = list(one_turn)
        while len(knots) < count + 2 * order - 1:
            knots.append(value + knots[len(knots) - count] - knots[0])
        return [Fraction(knot) for knot in knots]
    repeat = order - 1 if axis.bezier else 1
    first = order if axis.endpoint else min(2, repeat)
    knots, value, left = [], 0, first
    while len(knots) < count + order - (order if axis.endpoint else 0):
        knots.append(value)
        left -= 1
        if left == 0:
            value, left = value + 1, repeat
    knots += [value] * (order if axis.endpoint else 0)
    return [Fraction(knot) for knot in knots]


def exact_functions(axis, count, u):
    """The basis functions at u in [0, 1] by Cox and de Boor's definition, in fractions, wrapped if cyclic."""
    knots, order = blender_knots(axis, count), axis.order
    low, high = knots[order - 1], knots[count + (order - 1) * axis.cyclic]
    t = low + (high - low) * Fraction(u)
    pairs = itertools.pairwise(knots)
    functions = [Fraction(a < t <= b if t == high else a <= t < b) for a, b in pairs]
    for degree in range(1, order):
        raised = []
        for i in range(len(functions) - 1):
            total = Fraction(0)
            if knots[i + degree] > knots[i]:
                total += (t - knots[i]) / (knots[i + degree] - knots[i]) * functions[i]
            if knots[i + degree + 1] > knots[i + 1]:
                share = (knots[i + degree + 1] - t) / (knots[i + degree + 1] - knots[i + 1])
                total += share * functions[i + 1]
            raised.append(total)
        functions = raised
    wrapped = [Fraction(0)] * count
    for i, value in enumerate(functions):
        wrapped[i % count] += value
    return wrapped


@pytest.mark.parametrize("order", range(2, 7))
@pytest.mark.parametrize("flags", FLAGS)
def test_basis_functions_are_those_of_the_definition(order, flags):
    axis = NurbsAxis(order, *flags)
    tested = 0
    for count in range(2, 16):
        if axis.problem(count):
            continue
        basis = Basis(axis, count)
        assert basis.knots.tolist() == [float(knot) for knot in blender_knots(axis, count)]
        acting = basis.acting(basis.at(PLACES)[0])
        dense = np.zeros((len(PLACES), count))
        np.add.at(dense, (np.arange(len(PLACES)), acting.point), acting.value)
        exact = [[float(value) for value in exact_functions(axis, count, float(u))] for u in PLACES]
        assert np.abs(dense - exact).max() < ROUNDING
        assert np.abs(acting.slope.sum(axis=0)).max() < SLOPE_ROUNDING
        tested += 1
    assert tested >= 2


def patch(rng, rows, columns, along_u, along_v, rational=True):
    points = rng.normal(size=(rows, columns, 3))
    if rational:
        points = np.concatenate([points, rng.uniform(0.5, 2.0, (rows, columns, 1))], axis=2)
    return NurbsPatch(points, along_u, along_v)


@given(axes, axes, counts, counts, st.booleans(), st.integers(0, 2**32 - 1))
def test_patches_are_rational_combinations_of_their_points(along_u, along_v, columns, rows, rational, seed):
    if along_u.problem(columns) or along_v.problem(rows):
        with pytest.raises(ValueError, match=r"along [uv], "):
            NurbsPatch(np.zeros((rows, columns, 3)), along_u, along_v)
        return
    surface = patch(np.random.default_rng(seed), rows, columns, along_u, along_v, rational)
    points = surface.points if rational else np.dstack([surface.points, np.ones((rows, columns))])
    for u, v in itertools.product((0.0, 0.3, 1.0), (0.0, 0.71875, 1.0)):
        of_column = np.array([float(f) for f in exact_functions(along_u, columns, u)])
        of_row = np.array([float(f) for f in exact_functions(along_v, rows, v)])
        share = of_row[:, None] * of_column * points[..., 3]
        exact = (share[..., None] * points[..., :3]).sum(axis=(0, 1)) / share.sum()
        sample = surface.evaluate(u, v)
        assert np.abs(sample.position[:, 0] - exact).max() < ROUNDING
        assert np.abs(surface.positions(np.array([u]), np.array([v])).position[:, 0] - exact).max() < ROUNDING


@pytest.mark.parametrize("order", [2, 4, 7, 11])
@pytest.mark.parametrize("rational", [False, True])
@pytest.mark.parametrize("cyclic", [False, True])
def test_positions_in_bulk_are_those_of_evaluate(order, rational, cyclic):
    """In rows of an image and anywhere, more than are taken at once, beyond the borders too."""
    rng = np.random.default_rng(order)
    surface = patch(rng, 5, 15, NurbsAxis(order, cyclic=cyclic), NurbsAxis(4), rational)
    rows = np.meshgrid(np.linspace(0, 1, 200), np.linspace(0, 1, 41))
    anywhere = rng.uniform(-0.01, 1.01, (2, 9001))
    one_row = (np.linspace(0, 1, 500), np.full(500, 0.3))
    for u, v in ([axis.ravel() for axis in rows], anywhere, one_row, np.zeros((2, 0)), np.zeros((2, 1))):
        got, expected = surface.positions(u, v).position, surface.evaluate(u, v).position
        assert got.shape == expected.shape
        assert np.abs(got - expected).max(initial=0.0) < 10 * ROUNDING


@pytest.mark.parametrize("order", range(2, 7))
@pytest.mark.parametrize("flags", FLAGS)
def test_derivatives_are_those_of_the_position_within_a_tile(order, flags):
    """Central differences of the definition in 40 digits."""
    axis, other = NurbsAxis(order, *flags), NurbsAxis(3, False, False, False)
    columns, rows = 10 if axis.problem(12) else 12, 4
    surface = patch(np.random.default_rng(order), rows, columns, axis, other)
    points = surface.points

    def position(u, v):
        of_column, of_row = exact_functions(axis, columns, u), exact_functions(other, rows, v)
        total = [mpmath.mpf(0)] * 4
        for row, column in itertools.product(range(rows), range(columns)):
            share = of_row[row] * of_column[column]
            weight = mpmath.mpf(share.numerator) / share.denominator * points[row, column, 3]
            for i in range(3):
                total[i] += weight * points[row, column, i]
            total[3] += weight
        return [component / total[3] for component in total[:3]]

    step = Fraction(1, 10**12)
    with mpmath.workdps(40):
        for u, v in ((0.34375, 0.3), (0.78125, 0.71)):
            sample = surface.evaluate(u, v)
            for slope, du, dv in ((sample.du, step, 0), (sample.dv, 0, step)):
                ahead = position(Fraction(u) + du, Fraction(v) + dv)
                behind = position(Fraction(u) - du, Fraction(v) - dv)
                exact = [
                    float((a - b) / (2 * mpmath.mpf("1e-12"))) for a, b in zip(ahead, behind, strict=True)
                ]
                assert slope[:, 0] == pytest.approx(exact, rel=SLOPE_ROUNDING, abs=SLOPE_ROUNDING * 10)


def quarter_cylinder():
    """The textbook's rational quarter circle (weights 1, √½, 1), of order 3, times a line."""
    arc = np.array([[1.0, 0, 1], [1, 1, np.sqrt(0.5)], [0, 1, 1]])
    points = np.array([[[x, y, z, w] for x, y, w in arc] for z in (0.0, 2.0)])
    return NurbsPatch(points, NurbsAxis(3), NurbsAxis(2))


def test_a_rational_quarter_circle_is_a_circle():
    u, v = (axis.ravel() for axis in np.meshgrid(np.linspace(0, 1, 101), [0.0, 0.25, 1.0]))
    sample = quarter_cylinder().evaluate(u, v)
    x, y, z = sample.position
    assert np.abs(np.hypot(x, y) - 1).max() < 4 * np.finfo(float).eps
    assert np.abs(z - 2 * v).max() < ROUNDING
    # A tangent to a circle is at right angles to the radius.
    assert np.abs(x * sample.du[0] + y * sample.du[1]).max() < ROUNDING
    assert sample.dv == pytest.approx(np.broadcast_to([[0], [0], [2]], sample.dv.shape), abs=ROUNDING)


def test_a_closed_rational_circle_has_no_seam():
    """Four quarter circles as closed Bézier pieces: eight points, weights 1 and √½ in turn."""
    corners = [(1, 0), (1, 1), (0, 1), (-1, 1), (-1, 0), (-1, -1), (0, -1), (1, -1)]
    for shift in range(2):
        ring = [(x, y, np.sqrt(0.5) if x and y else 1.0) for x, y in corners[shift:] + corners[:shift]]
        points = np.array([[[x, y, z, w] for x, y, w in ring] for z in (0.0, 1.0)])
        surface = NurbsPatch(points, NurbsAxis(3, False, True, True), NurbsAxis(2))
        u = np.linspace(0, 1, 201)
        sample = surface.evaluate(u, np.full(201, 0.5))
        radius = np.hypot(*sample.position[:2])
        # The pieces begin where Blender's knots say: at one of the two shifts that is on the circle.
        if np.abs(radius - 1).max() < ROUNDING:
            assert np.abs(sample.position[:, 0] - sample.position[:, -1]).max() < ROUNDING
            assert np.abs(sample.du[:, 0] - sample.du[:, -1]).max() < ROUNDING * 100
            return
    pytest.fail("closed Bézier pieces make no circle")


def test_the_least_orders_are_the_bilinear_kinds():
    rng = np.random.default_rng(3)
    linear = NurbsAxis(2)
    u, v = rng.uniform(size=(2, 50))
    for shape in ((2, 2), (4, 3)):
        points = rng.normal(size=(*shape, 3))
        ours = NurbsPatch(points, linear, linear).evaluate(u, v)
        known = BilinearPatch(points.reshape(4, 3)) if shape == (2, 2) else Grid(points)
        for one, other in zip(ours[:3], known.evaluate(u, v)[:3], strict=True):
            assert np.abs(one - other).max() < ROUNDING * 10


@given(st.integers(0, 2**32 - 1), axes)
def test_patches_are_affinely_invariant_and_equal_weights_do_not_matter(seed, axis):
    rng = np.random.default_rng(seed)
    surface = patch(rng, 5, 12 if not axis.problem(12) else 10, axis, NurbsAxis(4))
    matrix = np.vstack([rng.normal(size=(3, 4)), [0, 0, 0, 1]])
    moved = surface.points.copy()
    moved[..., :3] = surface.points[..., :3] @ matrix[:3, :3].T + matrix[:3, 3]
    u, v = rng.uniform(size=(2, 20))
    one = surface.transformed(matrix).evaluate(u, v)
    other = NurbsPatch(moved, surface.along_u, surface.along_v).evaluate(u, v)
    for a, b in zip(one[:3], other[:3], strict=True):
        assert np.abs(a - b).max() < SLOPE_ROUNDING * 10
    doubled = surface.points * np.array([1, 1, 1, 2.0])
    assert (
        np.abs(NurbsPatch(doubled, axis, NurbsAxis(4)).evaluate(u, v)[0] - surface.evaluate(u, v)[0]).max()
        < ROUNDING
    )
    even = np.dstack([surface.points[..., :3], np.full(surface.points.shape[:2], 3.0)])
    plain = NurbsPatch(surface.points[..., :3], axis, NurbsAxis(4))
    assert np.array_equal(
        NurbsPatch(even, axis, NurbsAxis(4)).evaluate(u, v).position, plain.evaluate(u, v).position
    )


def test_end_points_flag_interpolates_the_corners():
    surface = patch(np.random.default_rng(1), 5, 6, NurbsAxis(4), NurbsAxis(3))
    corners = surface.evaluate([0, 1, 0, 1], [0, 0, 1, 1]).position.T
    assert corners == pytest.approx(surface.points[[0, 0, -1, -1], [0, -1, 0, -1], :3], abs=ROUNDING)


def test_tiles_end_where_the_derivative_jumps():
    # Two Bézier pieces of order 3 along u, seven points of order 2 (six cells) along v.
    surface = patch(np.random.default_rng(2), 7, 5, NurbsAxis(3, True, True), NurbsAxis(2))
    u, v = (axis.ravel() for axis in np.meshgrid([0.0, 0.4999, 0.5, 1.0], (np.arange(6) + 0.5) / 6))
    assert surface.evaluate(u, v).tile.reshape(6, 4).tolist() == [
        [2 * i, 2 * i, 2 * i + 1, 2 * i + 1] for i in range(6)
    ]
    h = 1e-9
    below, at = surface.evaluate([0.5 - h, 0.5], [0.25, 0.25]).du.T
    assert np.abs(at - below).max() > 0.1
    above = surface.evaluate([0.5 + h], [0.25]).du[:, 0]
    assert np.abs(at - above).max() < 1e-6
    smooth = patch(np.random.default_rng(2), 7, 5, NurbsAxis(3), NurbsAxis(4, False, False, True))
    assert smooth.evaluate(u, v).tile.tolist() == [0] * len(u)


@pytest.mark.parametrize(
    ("points", "along_u", "message"),
    [
        (np.zeros((4, 4, 2)), NurbsAxis(), "rows × columns"),
        (np.zeros((4, 3, 3)), NurbsAxis(), "along u, order 4 needs at least 4 control points, not 3"),
        (np.zeros((4, 4, 3)), NurbsAxis(1), "along u, its order is 1"),
        (np.zeros((4, 4, 3)), NurbsAxis(4, False, True, True), "multiple of 3"),
        (np.zeros((4, 4, 3)), NurbsAxis(4, False, True), "need more than 4"),
        (np.zeros((4, 4, 4)), NurbsAxis(), "weights"),
        (np.full((4, 4, 4), np.nan), NurbsAxis(), "weights"),
    ],
)
def test_what_makes_no_patch_is_refused(points, along_u, message):
    with pytest.raises(ValueError, match=message):
        NurbsPatch(points, along_u)


@pytest.mark.parametrize("flags", FLAGS)
def test_points_are_recovered_from_even_samples(flags):
    """Not the points where some have no effect, but the patch that they make."""
    axis = NurbsAxis(4, *flags)
    surface = patch(np.random.default_rng(5), 5, 9, axis, NurbsAxis(3))
    samples_u, samples_v = 27, 10
    u = np.arange(samples_u) / (samples_u if axis.cyclic else samples_u - 1)
    u, v = (grid.ravel() for grid in np.meshgrid(u, np.linspace(0, 1, samples_v)))
    samples = surface.evaluate(u, v).position.T.reshape(samples_v, samples_u, 3)
    weights = surface.points[..., 3]
    points = fitted_points(samples, weights, axis, NurbsAxis(3))
    again = NurbsPatch(np.dstack([points, weights]), axis, NurbsAxis(3))
    u, v = np.random.default_rng(6).uniform(size=(2, 200))
    assert np.abs(again.evaluate(u, v).position - surface.evaluate(u, v).position).max() < 1e-10


def test_a_patch_is_a_surface_of_a_volume():
    rng = np.random.default_rng(9)
    volume = ViewingVolume(tuple(patch(rng, 4, 4, NurbsAxis(), NurbsAxis()) for _ in range(6)), "B_SPLINE")
    sample = volume.evaluate(np.array([0.3]), np.array([0.6]), np.array([0.45]))
    assert sample.position.shape == (3, 1) and np.isfinite(np.concatenate(sample)).all()
