# SPDX-License-Identifier: GPL-3.0-or-later
"""Roots of polynomials in Bernstein form, against mpmath."""

import warnings
from math import comb

import mpmath
import numpy as np
import pytest
from hypothesis import assume, example, given, reject
from hypothesis import strategies as st

from scfpf_addon.casting.curves.plane_roots import short_cubic_roots, unit_roots

coefficient = st.floats(-1.0, 1.0, allow_subnormal=False).filter(lambda c: c == 0 or abs(c) > 1e-6)


def exact_roots(coefficients):
    """The real roots in [0, 1], ascending, to 50 digits; None where one is nearly double or at an end."""
    degree = len(coefficients) - 1
    with mpmath.workdps(50):
        powers = []
        for j in range(degree, -1, -1):
            powers.append(
                mpmath.fsum(
                    (-1) ** (j - k) * comb(degree, j) * comb(j, k) * mpmath.mpf(coefficients[k])
                    for k in range(j + 1)
                )
            )
        while len(powers) > 1 and powers[0] == 0:
            powers.pop(0)
        if len(powers) == 1:
            return []
        with warnings.catch_warnings():
            # mpmath 1.4 wants the order of coefficients named, 1.3 does not know the name.
            warnings.simplefilter("ignore", DeprecationWarning)
            try:
                roots = mpmath.polyroots(powers, maxsteps=500, extraprec=500)
            except mpmath.mp.NoConvergence:
                reject()  # mpmath has no answer to compare with: a root of high multiplicity
            near_real = [r for r in roots if abs(mpmath.im(r)) < 1e-6 and -1e-6 < mpmath.re(r) < 1 + 1e-6]
            slopes = [mpmath.polyval(powers, r, derivative=1)[1] for r in near_real]
        for r, slope in zip(near_real, slopes, strict=True):
            if abs(slope) < 1e-3 or min(abs(mpmath.re(r)), abs(1 - mpmath.re(r))) < 1e-9:
                return None
        return sorted(float(mpmath.re(r)) for r in near_real if 0 < mpmath.re(r) < 1)


@example([1.0, 0.0, 0.0, 1.0, 3e-06])  # a root at 1.000001
@given(st.integers(1, 6).flatmap(lambda d: st.lists(coefficient, min_size=d + 1, max_size=d + 1)))
def test_roots_against_mpmath(coefficients):
    expected = exact_roots(coefficients)
    assume(expected is not None)
    found = unit_roots(np.array(coefficients)[:, None])[:, 0]
    assert found.shape == (len(coefficients) - 1,)
    np.testing.assert_allclose(found[: len(expected)], expected, atol=1e-12)
    assert np.isnan(found[len(expected) :]).all()


@given(st.lists(coefficient, min_size=4, max_size=4), st.floats(0, 0.95), st.floats(0.001, 0.05))
def test_sure_roots_of_parts_of_cubics_against_mpmath(coefficients, low, length):
    expected = exact_roots(coefficients)
    assume(expected is not None)
    root, sure = short_cubic_roots(np.array(coefficients)[:, None], np.full(1, low), np.full(1, low + length))
    if sure[0]:
        (only,) = (r for r in expected if low <= r <= low + length)
        np.testing.assert_allclose(root, only, atol=1e-12)


@pytest.mark.parametrize("leading", [0.0, 1e-18, 1e-12, 1e-8, 1e-4, -1e-10, 1.0])
def test_a_vanishing_leading_coefficient_needs_no_special_case(leading):
    # leading·s² + s - ½, in Bernstein form
    coefficients = np.array([-0.5, 0.0, 0.5 + leading])[:, None]
    with mpmath.workdps(50):
        a = mpmath.mpf(coefficients[2, 0]) - mpmath.mpf("0.5")
        exact = 1 / (1 + mpmath.sqrt(1 + 2 * a))
    found = unit_roots(coefficients)
    assert found[0, 0] == pytest.approx(float(exact), rel=4e-16)
    assert np.isnan(found[1, 0])


@pytest.mark.parametrize("gap", [1e-3, 1e-6, 1e-9])
def test_nearly_double_roots_keep_their_digits(gap):
    # (s - ½ + gap)(s - ½ - gap), whose Bernstein coefficients are rounded once.
    coefficients = np.array([0.25 - gap**2, -0.25 - gap**2, 0.25 - gap**2])[:, None]
    with mpmath.workdps(60):
        b = [mpmath.mpf(c) for c in coefficients[:, 0]]
        a, h = b[0] - 2 * b[1] + b[2], b[1] - b[0]
        root = mpmath.sqrt(h * h - a * b[0])
        exact = [float((-h - root) / a), float((-h + root) / a)]
    np.testing.assert_allclose(unit_roots(coefficients)[:, 0], exact, rtol=0, atol=3e-16)


@pytest.mark.parametrize("degree", range(1, 7))
def test_roots_at_the_ends_and_none_at_all(degree):
    rising = np.linspace(0.0, 1.0, degree + 1)[:, None]
    assert unit_roots(rising)[0, 0] == 0.0
    assert unit_roots(rising - 1.0)[0, 0] == pytest.approx(1.0, abs=1e-15)
    assert np.isnan(unit_roots(np.ones((degree + 1, 3)))).all()
    assert np.isnan(unit_roots(np.zeros((degree + 1, 2)))).all()
    assert unit_roots(np.empty((degree + 1, 0))).shape == (degree, 0)


def test_a_quintic_with_five_roots():
    expected = [0.1, 0.3, 0.5, 0.7, 0.9]
    powers = np.poly(expected)[::-1]
    coefficients = [sum(comb(i, j) / comb(5, j) * powers[j] for j in range(i + 1)) for i in range(6)]
    np.testing.assert_allclose(unit_roots(np.array(coefficients)[:, None])[:, 0], expected, atol=1e-11)
