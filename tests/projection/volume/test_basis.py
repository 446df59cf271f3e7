# SPDX-License-Identifier: GPL-3.0-or-later
"""Projector bases as Bézier spans."""

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from scfpf_addon.projection.volume.basis import SpanBasis, span_basis
from scfpf_addon.projection.volume.bezier import bernstein

kinds = st.sampled_from(["BEZIER", "POLYLINE"])
# Two quadratic spans of a uniform B-spline over four control points: a basis of several curved spans.
BSPLINE = SpanBasis(
    np.array([0.0, 0.5, 1.0]),
    np.array(
        [
            [[0.5, 0.5, 0, 0], [0, 1, 0, 0], [0, 0.5, 0.5, 0]],
            [[0, 0.5, 0.5, 0], [0, 0, 1, 0], [0, 0, 0.5, 0.5]],
        ]
    ),
)


@given(kinds, st.integers(2, 7), st.floats(0, 1))
def test_weights_sum_to_one_and_their_slopes_to_none(kind, count, t):
    weights, slopes = span_basis(kind, count).weights(np.array([t]))
    assert weights.shape == slopes.shape == (count, 1)
    assert weights.sum() == pytest.approx(1.0, abs=1e-13)
    assert slopes.sum() == pytest.approx(0.0, abs=1e-11)
    assert (weights >= -1e-15).all()


@given(st.integers(2, 7), st.floats(0, 1))
def test_bezier_weights_are_bernstein_polynomials(count, t):
    weights, _ = span_basis("BEZIER", count).weights(np.array([t]))
    np.testing.assert_allclose(weights[:, 0], bernstein(count - 1, t), atol=1e-14)


@given(kinds, st.integers(2, 6))
def test_projectors_begin_and_end_on_the_outer_surfaces(kind, count):
    weights, _ = span_basis(kind, count).weights(np.array([0.0, 1.0]))
    np.testing.assert_allclose(weights[:, 0], np.eye(count)[0], atol=1e-15)
    np.testing.assert_allclose(weights[:, 1], np.eye(count)[-1], atol=1e-15)


@given(st.integers(2, 8))
def test_a_polyline_passes_through_every_control_point(count):
    weights, _ = span_basis("POLYLINE", count).weights(np.linspace(0, 1, count))
    np.testing.assert_allclose(weights, np.eye(count), atol=1e-12)


@pytest.mark.parametrize("basis", [span_basis("BEZIER", 4), span_basis("POLYLINE", 4), BSPLINE])
def test_slopes_are_derivatives(basis):
    t = np.array([0.11, 0.27, 0.42, 0.61, 0.88])
    step = 1e-6
    difference = (basis.weights(t + step)[0] - basis.weights(t - step)[0]) / (2 * step)
    np.testing.assert_allclose(basis.weights(t)[1], difference, atol=1e-8)


def test_several_curved_spans_join():
    before, after = BSPLINE.weights(np.array([0.5 - 1e-12]))[0], BSPLINE.weights(np.array([0.5]))[0]
    np.testing.assert_allclose(before, after, atol=1e-11)
    assert BSPLINE.degree == 2
    span, start, length = BSPLINE.locate(np.array([0.0, 0.49, 0.5, 1.0]))
    assert span.tolist() == [0, 0, 1, 1]
    assert start.tolist() == [0, 0, 0.5, 0.5] and length.tolist() == [0.5] * 4


def test_bad_bases_are_refused():
    with pytest.raises(ValueError, match="at least two"):
        span_basis("BEZIER", 1)
    with pytest.raises(ValueError, match="unknown"):
        span_basis("CATMULL_ROM", 3)


@pytest.mark.parametrize(
    ("basis", "bezier", "polyline", "straight"),
    [
        (span_basis("BEZIER", 2), True, True, True),
        (span_basis("B_SPLINE", 2), True, True, True),
        (span_basis("POLYLINE", 2), True, True, True),
        (span_basis("NURBS", 2, (2.0, 2.0)), True, True, True),
        # On a line as well, but t does not advance evenly along it.
        (span_basis("NURBS", 2, (1.0, 2.0)), False, False, False),
        (span_basis("POLYLINE", 3), False, True, False),
        (span_basis("BEZIER", 3), True, False, False),
        (span_basis("B_SPLINE", 5), False, False, False),
        (span_basis("NURBS", 3, (1.0, 2.0, 1.0)), False, False, False),
    ],
)
def test_a_basis_tells_whether_its_curves_are_straight(basis, bezier, polyline, straight):
    assert (basis.is_bezier, basis.is_polyline, basis.is_straight) == (bezier, polyline, straight)
