# SPDX-License-Identifier: GPL-3.0-or-later
"""The short ways for projectors of degree 2 answer what the general ones do."""

import numpy as np
from hypothesis import given
from hypothesis import strategies as st

from scfpf_addon.casting.curves import Bundle, _restricted, _single_roots
from scfpf_addon.projection.basis import span_basis
from scfpf_addon.projection.bezier import bernstein, bernstein_derivative


@given(st.integers(0, 100_000), st.floats(-12, 0))
def test_single_roots_are_the_first_in_their_part(seed, smallest):
    """Coefficients down to 1e-12 of each other, parts from a point to all of [0, 1]."""
    generator = np.random.default_rng(seed)
    coefficients = generator.normal(size=(3, 400)) * 10.0 ** generator.uniform(smallest, 0, (3, 400))
    low, high = np.sort(generator.uniform(-0.2, 1.2, (2, 400)).clip(0, 1), axis=0)
    root, others = _single_roots(coefficients, low, high)
    general = _restricted(coefficients, low, high)
    known = np.setdiff1d(np.arange(400), others)
    # A root at the very end of a part may fall to either side of it by rounding.
    inside = known[~np.isnan(general[0, known])]
    assert np.isnan(general[1, inside]).all()
    np.testing.assert_allclose(root[inside], general[0, inside], rtol=0, atol=1e-14)
    lost = np.setdiff1d(known, inside)
    assert (np.minimum(root[lost] - low[lost], high[lost] - root[lost]) < 1e-14).all()
    assert np.isnan(general[0, others]).sum() >= np.isnan(general[0]).sum() - len(lost)


@given(st.integers(0, 100_000), st.floats(-3, 15))
def test_places_and_tangents_are_bernstein_s(seed, size):
    generator = np.random.default_rng(seed)
    points = generator.normal(size=(3, 3, 50)) * 10.0**size
    t = generator.random(50)
    position, tangent = Bundle(span_basis("BEZIER", 3), points).at(t)
    rounding = 1e-14 * np.abs(points).max()
    assert np.abs(position - np.einsum("kn,kcn->cn", bernstein(2, t), points)).max() <= rounding
    assert np.abs(tangent - np.einsum("kn,kcn->cn", bernstein_derivative(2, t), points)).max() <= rounding


def test_a_projector_that_stops_has_no_tangent_to_the_last_bit():
    """Where control surfaces coincide at an end; the direction is then looked for elsewhere."""
    points = np.random.default_rng(2).normal(size=(3, 3, 1000))
    for end, other in ((0, 0.0), (2, 1.0)):
        still = points.copy()
        still[1] = still[end]
        _, tangent = Bundle(span_basis("BEZIER", 3), still)._at_quadratic(np.full(1000, other))
        assert not tangent.any()
