# SPDX-License-Identifier: GPL-3.0-or-later
"""Bézier curves in batches, against sums of Bernstein polynomials and against measured distances."""

from math import comb

import mpmath
import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from scfpf_addon.projection.volume import bezier

degrees = st.integers(1, 6)
seeds = st.integers(0, 2**32 - 1)


def curves(seed, degree, count=5):
    return np.random.default_rng(seed).normal(size=(degree + 1, 3, count))


@given(st.integers(0, 8), st.floats(-0.5, 1.5))
def test_bernstein_against_mpmath(degree, t):
    values, slopes = bezier.bernstein(degree, t), bezier.bernstein_derivative(degree, t)
    with mpmath.workdps(40):
        for i in range(degree + 1):

            def exact(s, i=i):
                return comb(degree, i) * s**i * (1 - s) ** (degree - i)

            assert values[i] == pytest.approx(float(exact(mpmath.mpf(t))), rel=1e-12, abs=1e-14)
            assert slopes[i] == pytest.approx(float(mpmath.diff(exact, mpmath.mpf(t))), rel=1e-10, abs=1e-12)


@given(seeds, degrees)
def test_evaluate_is_the_bernstein_sum(seed, degree):
    controls = curves(seed, degree)
    t = np.random.default_rng(seed + 1).uniform(size=5)
    position, tangent = bezier.evaluate(controls, t)
    np.testing.assert_allclose(
        position, np.einsum("kn,kcn->cn", bezier.bernstein(degree, t), controls), atol=1e-13
    )
    np.testing.assert_allclose(
        tangent, np.einsum("kn,kcn->cn", bezier.bernstein_derivative(degree, t), controls), atol=1e-12
    )


@given(seeds, degrees)
def test_end_points_and_end_tangents(seed, degree):
    controls = curves(seed, degree)
    for t, end, leg in ((0.0, 0, controls[1] - controls[0]), (1.0, -1, controls[-1] - controls[-2])):
        position, tangent = bezier.evaluate(controls, t)
        np.testing.assert_allclose(position, controls[end], atol=1e-14)
        np.testing.assert_allclose(tangent, degree * leg, atol=1e-13)


@given(seeds, degrees)
def test_the_hodograph_is_the_derivative(seed, degree):
    controls = curves(seed, degree)
    hodograph = bezier.derivative(controls)
    t = 0.3
    values = np.einsum("k,kcn->cn", bezier.bernstein(degree - 1, np.float64(t)), hodograph)
    np.testing.assert_allclose(values, bezier.evaluate(controls, t)[1], atol=1e-12)


@given(seeds, degrees, st.floats(-0.5, 1.5), st.floats(-0.5, 1.5))
def test_a_restricted_curve_is_the_same_curve(seed, degree, start, end):
    controls = curves(seed, degree)
    part = bezier.restrict(controls, np.full(5, start), np.full(5, end))
    s = np.random.default_rng(seed).uniform(size=5)
    np.testing.assert_allclose(
        bezier.evaluate(part, s)[0], bezier.evaluate(controls, start + s * (end - start))[0], atol=1e-11
    )


def deviation(controls, count):
    """The largest distance at equal t between curves and their polylines of ``count`` chords."""
    s = np.linspace(0, 1, 41)
    worst = 0.0
    for i in range(count):
        t = (i + s) / count
        points = np.stack([bezier.evaluate(controls, value)[0] for value in t], axis=-1)
        chord = points[..., :1] + (points[..., -1:] - points[..., :1]) * s
        worst = max(worst, np.linalg.norm(points - chord, axis=0).max())
    return worst


@settings(deadline=None, max_examples=30)
@given(seeds, st.integers(2, 5), st.floats(0.003, 0.3))
def test_the_chord_bound_holds(seed, degree, tolerance):
    controls = curves(seed, degree, 1)
    count = int(bezier.chord_count(controls, tolerance)[0])
    assert deviation(controls, count) <= tolerance * (1 + 1e-12)


def test_the_chord_bound_is_exact_for_quadratics():
    controls = curves(7, 2, 1)
    bend = bezier.second_difference(controls)[0]
    for count in (1, 2, 5, 9):
        assert deviation(controls, count) == pytest.approx(bend / (4 * count**2), rel=1e-9)
        assert bezier.chord_count(controls, bend / (4 * count**2) * 1.0001)[0] == count
        assert bezier.chord_count(controls, bend / (4 * count**2) * 0.9999)[0] == count + 1


def test_straight_curves_need_one_chord():
    straight = np.array([[0.0, 0, 0], [1, 2, 3]])[:, :, None]
    even = np.array([[0.0, 0, 0], [1, 2, 3], [2, 4, 6]])[:, :, None]
    assert bezier.chord_count(straight, 1e-9)[0] == bezier.chord_count(even, 1e-9)[0] == 1
