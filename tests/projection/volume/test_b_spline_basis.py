# SPDX-License-Identifier: GPL-3.0-or-later
"""B-spline projectors: against de Boor in exact arithmetic, and smooth where spans meet."""

from fractions import Fraction

import numpy as np
import pytest

from scfpf_addon.projection.volume.basis import span_basis
from scfpf_addon.projection.volume.bezier import bernstein

# A few roundings of numbers up to 1.
ROUNDING = 1e-14


def exact_functions(count, t):
    """The clamped uniform B-spline functions by their definition (Cox and de Boor), in fractions."""
    degree = min(3, count - 1)
    pieces = count - degree
    knots = [Fraction(min(max(i - degree, 0), pieces), pieces) for i in range(count + degree + 1)]

    def function(i, degree):
        if degree == 0:
            closed = t == 1 == knots[i + 1]
            return Fraction(knots[i] < knots[i + 1] and (knots[i] <= t < knots[i + 1] or closed))
        total = Fraction(0)
        if knots[i + degree] > knots[i]:
            total += (t - knots[i]) / (knots[i + degree] - knots[i]) * function(i, degree - 1)
        if knots[i + degree + 1] > knots[i + 1]:
            share = (knots[i + degree + 1] - t) / (knots[i + degree + 1] - knots[i + 1])
            total += share * function(i + 1, degree - 1)
        return total

    return [function(i, degree) for i in range(count)]


@pytest.mark.parametrize("count", range(2, 10))
def test_b_spline_weights_are_those_of_the_definition(count):
    basis = span_basis("B_SPLINE", count)
    places = [Fraction(i, 48) for i in range(49)]
    values, slopes = basis.weights(np.array([float(t) for t in places]))
    expected = np.array([[float(value) for value in exact_functions(count, t)] for t in places]).T
    assert np.abs(values - expected).max() < ROUNDING
    assert np.abs(values.sum(axis=0) - 1).max() < ROUNDING
    assert np.abs(slopes.sum(axis=0)).max() < ROUNDING * count * 10


@pytest.mark.parametrize("count", [2, 3, 4])
def test_a_b_spline_of_few_surfaces_is_the_bezier_curve(count):
    spline, bezier = span_basis("B_SPLINE", count), span_basis("BEZIER", count)
    assert np.array_equal(spline.matrices, bezier.matrices)
    assert np.array_equal(spline.breaks, bezier.breaks)


@pytest.mark.parametrize("count", [5, 6, 9, 20])
def test_spans_of_a_b_spline_meet_with_one_curvature(count):
    basis = span_basis("B_SPLINE", count)
    assert basis.degree == 3 and len(basis.matrices) == count - 3
    before, after = basis.matrices[:-1], basis.matrices[1:]
    for order in range(3):
        ends = np.diff(before, order, axis=1)[:, -1]
        starts = np.diff(after, order, axis=1)[:, 0]
        assert np.abs(ends - starts).max() < ROUNDING
    # Not smoother than that: the third derivative jumps.
    assert np.abs(np.diff(before, 3, axis=1)[:, -1] - np.diff(after, 3, axis=1)[:, 0]).max() > 0.1


def test_a_b_spline_runs_from_the_first_to_the_last_surface_and_each_acts_near_by():
    basis = span_basis("B_SPLINE", 12)
    ends, _ = basis.weights(np.array([0.0, 1.0]))
    assert np.array_equal(ends.T, np.eye(12)[[0, 11]])
    near = basis.weights(np.linspace(0, 1 / 9, 20))[0]
    assert np.abs(near[4:]).max() < ROUNDING


def test_slopes_are_the_derivative():
    basis = span_basis("B_SPLINE", 7)
    # Inside the spans, so that a central difference of a cubic is off by h² times a sixth of Q‴.
    t = (np.arange(16) + 0.37) / 16
    h = 1e-5
    (high, _), (low, _) = basis.weights(t + h), basis.weights(t - h)
    assert np.abs((high - low) / (2 * h) - basis.weights(t)[1]).max() < 1e-6


def test_spans_are_bezier_curves_of_their_matrices():
    basis = span_basis("B_SPLINE", 6)
    rng = np.random.default_rng(4)
    points = rng.normal(size=(6, 3))
    local = np.linspace(0, 1, 9)[:-1]
    for span, matrix in enumerate(basis.matrices):
        t = basis.breaks[span] + local * (basis.breaks[span + 1] - basis.breaks[span])
        curve = bernstein(3, local).T @ (matrix @ points)
        assert np.abs(basis.weights(t)[0].T @ points - curve).max() < ROUNDING * 10
