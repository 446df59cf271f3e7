# SPDX-License-Identifier: GPL-3.0-or-later
"""Smooth projectors: against SciPy's Hermite curves with the slopes of parabolas through three points."""

import numpy as np
import pytest
from scipy.interpolate import CubicHermiteSpline

from scfpf_addon.projection.volume.basis import span_basis

ROUNDING = 1e-12


def parabola_slopes(places, values):
    """The slope at each place of the parabola through it and its neighbours, or the nearest three places."""
    slopes = []
    for number in range(len(places)):
        first = min(max(number - 1, 0), len(places) - 3)
        fit = np.polyfit(places[first : first + 3] - places[number], values[first : first + 3], 2)
        slopes.append(fit[1])
    return np.array(slopes)


@pytest.mark.parametrize("count", [3, 4, 7, 20])
@pytest.mark.parametrize("falls", [False, True])
def test_smooth_weights_are_those_of_bessel_interpolation(count, falls):
    random = np.random.default_rng(count)
    places = np.cumsum(random.uniform(0.1, 3.0, count))
    values = random.normal(size=count)
    if falls:
        places = places[::-1].copy()
    basis = span_basis("SMOOTH", count, tuple(places))
    t = np.linspace(0, 1, 301)
    ours = basis.weights(t)[0].T @ values
    # Spans have equal length in t.
    at = np.interp(t, np.linspace(0, 1, count), places)
    order = slice(None, None, -1) if falls else slice(None)
    slopes = parabola_slopes(places[order], values[order])
    expected = CubicHermiteSpline(places[order], values[order], slopes)(at)
    assert np.allclose(ours, expected, atol=ROUNDING * np.abs(values).max() * 100)


@pytest.mark.parametrize("count", [2, 3, 5, 9])
def test_it_runs_through_all_points_and_keeps_what_is_linear(count):
    places = 10.0 ** np.linspace(-1, 3, count)
    basis = span_basis("SMOOTH", count, tuple(places))
    at_points, _ = basis.weights(np.linspace(0, 1, count))
    assert np.allclose(at_points, np.eye(count), atol=ROUNDING)
    t = np.linspace(0, 1, 100)
    assert np.allclose(
        basis.weights(t)[0].T @ places,
        np.interp(t, np.linspace(0, 1, count), places),
        rtol=1e-10,
        atol=1e-10 * places.max(),
    )


@pytest.mark.parametrize("places", [None, (1.0, 1.0, 1.0, 1.0), (1.0, 3.0, 2.0, 4.0)])
def test_places_that_neither_rise_nor_fall_are_even(places):
    even = span_basis("SMOOTH", 4, (0.0, 1.0, 2.0, 3.0))
    found = span_basis("SMOOTH", 4, places)
    assert np.allclose(found.matrices, even.matrices, atol=ROUNDING)


def test_two_points_make_the_straight_line():
    assert span_basis("SMOOTH", 2, (1.0, 7.0)).is_straight


def test_wrong_places_are_refused():
    with pytest.raises(ValueError, match="as many places"):
        span_basis("SMOOTH", 3, (1.0, 2.0))
