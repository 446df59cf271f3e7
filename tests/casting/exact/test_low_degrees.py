# SPDX-License-Identifier: GPL-3.0-or-later
"""The fast paths for projectors of low degrees give the results of the general ones."""

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from scfpf_addon.casting.curves.plane_roots import _roots_between, _single_roots, short_cubic_roots
from scfpf_addon.casting.curves.projector_batch import ProjectorBatch
from scfpf_addon.projection.volume.basis import span_basis
from scfpf_addon.projection.volume.bezier import bernstein, bernstein_derivative


@given(st.integers(0, 100_000), st.floats(-12, 0))
def test_single_roots_are_the_first_in_their_part(seed, smallest):
    """Coefficients down to 1e-12 of each other, parts from a point to all of [0, 1]."""
    generator = np.random.default_rng(seed)
    coefficients = generator.normal(size=(3, 400)) * 10.0 ** generator.uniform(smallest, 0, (3, 400))
    low, high = np.sort(generator.uniform(-0.2, 1.2, (2, 400)).clip(0, 1), axis=0)
    root, others = _single_roots(coefficients, low, high)
    general = _roots_between(coefficients, low, high)
    known = np.setdiff1d(np.arange(400), others)
    # A root at the very end of a part may fall to either side of it by rounding.
    inside = known[~np.isnan(general[0, known])]
    assert np.isnan(general[1, inside]).all()
    np.testing.assert_allclose(root[inside], general[0, inside], rtol=0, atol=1e-14)
    lost = np.setdiff1d(known, inside)
    assert (np.minimum(root[lost] - low[lost], high[lost] - root[lost]) < 1e-14).all()
    assert np.isnan(general[0, others]).sum() >= np.isnan(general[0]).sum() - len(lost)


@given(st.integers(0, 100_000), st.floats(-12, 0), st.floats(-6, 0))
def test_the_only_roots_of_cubics_in_their_part(seed, smallest, longest):
    """Coefficients down to 1e-12 of each other, parts from a millionth of [0, 1] to all of it."""
    generator = np.random.default_rng(seed)
    coefficients = generator.normal(size=(4, 400)) * 10.0 ** generator.uniform(smallest, 0, (4, 400))
    # Half of them cross 0 in their part, as what a chord has met does.
    low = generator.uniform(0, 1, 400)
    high = np.minimum(low + 10.0 ** generator.uniform(longest, 0, 400), 1.0)
    middle = low + (high - low) * generator.random(400)
    coefficients[:, ::2] -= np.einsum("kn,kn->n", bernstein(3, middle), coefficients)[::2]
    root, sure = short_cubic_roots(coefficients, low, high)
    general = _roots_between(coefficients, low, high)
    assert np.isnan(general[1:, sure]).all()
    # A root is where its polynomial is 0 but for rounding, which its slope makes more or less of.
    slope = np.abs(np.einsum("kn,kn->n", bernstein_derivative(3, root), coefficients))
    rounding = 1e-14 * np.abs(coefficients).max(axis=0) / slope + 1e-15
    lost = sure & np.isnan(general[0])
    known = sure & ~lost
    assert (np.abs(root - general[0])[known] <= rounding[known]).all()
    assert (np.minimum(root - low, high - root)[lost] <= rounding[lost]).all()


def test_what_chords_meet_is_nearly_always_sure():
    """Short parts of smooth cubics."""
    generator = np.random.default_rng(3)
    coefficients = generator.normal(size=(4, 10_000))
    low = generator.uniform(0, 0.99, 10_000)
    middle = low + 0.005
    coefficients -= np.einsum("kn,kn->n", bernstein(3, middle), coefficients)
    assert short_cubic_roots(coefficients, low, low + 0.01)[1].mean() > 0.98


@given(st.integers(0, 100_000), st.floats(-3, 15), st.integers(1, 5))
def test_places_and_tangents_are_bernstein_s(seed, size, degree):
    generator = np.random.default_rng(seed)
    points = generator.normal(size=(degree + 1, 3, 50)) * 10.0**size
    t = generator.random(50)
    position, tangent = ProjectorBatch(span_basis("BEZIER", degree + 1), points).at(t)
    rounding = 1e-14 * degree * np.abs(points).max()
    assert np.abs(position - np.einsum("kn,kcn->cn", bernstein(degree, t), points)).max() <= rounding
    assert (
        np.abs(tangent - np.einsum("kn,kcn->cn", bernstein_derivative(degree, t), points)).max() <= rounding
    )


@pytest.mark.parametrize("degree", [2, 3, 5])
def test_a_projector_that_stops_has_no_tangent_to_the_last_bit(degree):
    """Control surfaces coincide at an end, where the direction comes from a higher derivative."""
    points = np.random.default_rng(2).normal(size=(degree + 1, 3, 10_000))
    for end, beside, t in ((0, 1, 0.0), (degree, degree - 1, 1.0)):
        still = points.copy()
        still[beside] = still[end]
        _, tangent = ProjectorBatch(span_basis("BEZIER", degree + 1), still).at(np.full(10_000, t))
        assert not tangent.any()
