# SPDX-License-Identifier: GPL-3.0-or-later
"""Roots of polynomials in Bernstein form: where a Bézier curve meets a plane.

The heights of a curve's control points over a plane are the Bernstein
coefficients of the curve's height; all functions here work on batches of such
coefficients, (d+1, N) float64, over the parameter interval [0, 1].
"""

from __future__ import annotations

from math import comb

import numpy as np

from ...projection.typing import Array, BoolArray, IndexArray
from ...projection.volume.bezier import restrict

# Splits a float64 into two halves of 26 bits (Veltkamp 1968).
SPLITTER = 2.0**27 + 1.0

# Newton steps and halvings until a bracket in [0, 1] is one rounding wide.
MOST_STEPS = 64

# Steps of Newton's method that nearly always converge where a polynomial is monotone.
NEWTON_STEPS = 3

# A root is final when a step moves it by less than this: the error left after a step of
# Newton's is its square over the distance of the nearest other root, and float64
# coefficients cannot separate roots nearer than 2⁻²⁶ to each other.
CONVERGED = 2.0**-40

# Roots farther from a part's middle than this share of half its length are left to rounding.
WITHIN = 1.0 - 2.0**-30

# A root is final, too, where the polynomial is below this share of its largest coefficient: two roundings.
NOISE = 2.0**-52


def unit_roots(coefficients: Array) -> Array:
    """The roots in [0, 1] of N polynomials, ascending, NaN where fewer exist.

    coefficients: (d+1, N), d >= 1, finite. Returns (d, N). Polynomials that are
    zero throughout have no roots.
    """
    with np.errstate(divide="ignore", invalid="ignore", over="ignore"):
        if len(coefficients) == 2:
            return _within(coefficients[:1] / (coefficients[:1] - coefficients[1:]))
        if len(coefficients) == 3:
            return _quadratic(coefficients)
        return _general(coefficients)


def _within(roots: Array) -> Array:
    return np.where((roots >= 0.0) & (roots <= 1.0), roots, np.nan)


def _quadratic(coefficients: Array) -> Array:
    """The ``unit_roots`` of quadratics. Most have ends on different sides and one root, most others none."""
    first, middle, last = coefficients
    roots = np.full((2, len(first)), np.nan)
    sides = first * last
    np.copyto(roots[0], crossing(first, middle, last), where=sides < 0.0)
    turning = np.flatnonzero((sides >= 0.0) & ((first * middle <= 0.0) | (sides == 0.0)))
    if len(turning):
        roots[:, turning] = _turning(*coefficients.take(turning, 1))
    return roots


def crossing(first: Array, middle: Array, last: Array) -> Array:
    """The one root of quadratics whose ends lie on different sides, as s/(1-s): nothing cancels."""
    upward = np.abs(middle) + np.sqrt(middle * middle - first * last)
    early = first * middle < 0.0
    start = np.where(early, np.abs(first), upward)
    root: Array = start / (start + np.where(early, upward, np.abs(last)))
    return root


def short_cubic_roots(coefficients: Array, low: Array, high: Array) -> tuple[Array, BoolArray]:
    """A root (N,) in [low, high] of N cubics, (4, N), and whether it is surely the only one there.

    About the middle m of a short part with half its length h a cubic is d0 + d1 x + d2 x² + d3 x³, x in
    [-1, 1]. Where |d1| > 2|d2| + 3|d3| it rises or falls throughout, and so has one root at most. Cubics
    for which that does not hold are not sure, nor are roots so near an end that rounding would decide.
    """
    first, second, third, fourth = coefficients
    one, two, three = second - first, third - second, fourth - third
    half, bend = 0.5 * (high - low), two - one
    middle = low + half
    # Powers at 0, shifted to the middle by Horner's scheme (Shaw and Traub 1974).
    cubic = (three - two) - bend
    inner = cubic * middle
    square = 3.0 * bend + inner
    line = 3.0 * one + square * middle
    d0 = first + line * middle
    square += inner
    d1 = line + square * middle
    square += inner
    d1 *= half
    half2 = half * half
    d2 = square * half2
    half2 *= half
    d3 = cubic * half2
    with np.errstate(divide="ignore", invalid="ignore", over="ignore"):
        # From the root of the quadratic, one step of Newton's method and one with the same slope.
        x = d1 + np.copysign(np.sqrt(d1 * d1 - 4.0 * d2 * d0), d1)
        x = -2.0 * d0 / x
        slope = 1.0 / (d1 + x * (2.0 * d2 + 3.0 * d3 * x))
        x -= (d0 + x * (d1 + x * (d2 + x * d3))) * slope
        step = (d0 + x * (d1 + x * (d2 + x * d3))) * slope
        x -= step
        sure = np.abs(d1) > 2.0 * np.abs(d2) + 3.0 * np.abs(d3)
        sure &= (np.abs(x) < WITHIN) & (np.abs(step) <= CONVERGED)
    x *= half
    x += middle
    return x, sure


def short_roots(coefficients: Array, low: Array, high: Array) -> tuple[Array, IndexArray, Array]:
    """The roots in [low, high] of N polynomials (d+1, N), where those are short parts with a single root.

    Returns the first root (N,), the numbers (M,) of the polynomials that may have several roots, and
    the further roots of these (d-1, M); NaN for missing roots.
    """
    if len(coefficients) == 3:
        root, others = _single_roots(coefficients, low, high)
    elif len(coefficients) == 4:
        root, sure = short_cubic_roots(coefficients, low, high)
        others = np.flatnonzero(~sure)
    else:
        root, others = np.empty(len(low)), np.arange(len(low))
    between = _roots_between if len(coefficients) > 2 else _linear
    roots = between(coefficients.take(others, 1), low.take(others), high.take(others))
    root[others] = roots[0]
    return root, others, roots[1:]


def _roots_between(coefficients: Array, low: Array, high: Array) -> Array:
    """The roots in [low, high] of N polynomials, ascending, (d, N), NaN where fewer exist."""
    roots: Array = low + unit_roots(restrict(coefficients, low, high)) * (high - low)
    return roots


def _linear(coefficients: Array, low: Array, high: Array) -> Array:
    """The roots in [low, high] of linear polynomials, (1, N), NaN where there is none."""
    with np.errstate(divide="ignore", invalid="ignore", over="ignore"):
        root = coefficients[0] / (coefficients[0] - coefficients[1])
        return np.where((root >= low) & (root <= high), root, np.nan)[None]


def _single_roots(coefficients: Array, low: Array, high: Array) -> tuple[Array, IndexArray]:
    """The roots (N,) of quadratics whose ends lie on different sides, and the numbers of the others.

    The others have another number of roots, or their root is not in [low, high], or an end of that
    is 0 or 1, where rounding decides.
    """
    first, middle, last = coefficients
    with np.errstate(divide="ignore", invalid="ignore", over="ignore"):
        root = crossing(first, middle, last)
        known = (first * last < 0.0) & (root >= low) & (root <= high)
    known &= (low > 0.0) & (high < 1.0)
    return root, np.flatnonzero(~known)


def _turning(first: Array, middle: Array, last: Array) -> Array:
    """Both roots without cancellation: q/a and c/q (Blinn 2006, How to Solve a Quadratic Equation)."""
    half = middle - first
    leading = (first - middle) - (middle - last)
    # half² - leading·first, with the cancelling terms taken out by hand.
    root = np.sqrt(_difference_of_products(middle, middle, first, last))
    q = -(half + np.copysign(root, half))
    one, other = _within(np.stack([q / leading, first / q]))
    both = np.isfinite(one) & np.isfinite(other)
    return np.stack([np.fmin(one, other), np.where(both, np.maximum(one, other), np.nan)])


def _difference_of_products(a: Array, b: Array, c: Array, d: Array) -> Array:
    """ab - cd with the rounding errors of both products put back (Dekker 1971)."""
    first, second = a * b, c * d
    result: Array = (first - second) + (_product_error(a, b, first) - _product_error(c, d, second))
    return result


def _product_error(a: Array, b: Array, product: Array) -> Array:
    """The exact difference a·b - fl(a·b)."""
    scaled = SPLITTER * a
    a_high = scaled - (scaled - a)
    a_low = a - a_high
    scaled = SPLITTER * b
    b_high = scaled - (scaled - b)
    b_low = b - b_high
    return ((a_high * b_high - product) + a_high * b_low + a_low * b_high) + a_low * b_low


def _general(coefficients: Array) -> Array:
    """Any degree: between the derivative's roots the polynomial is monotone.

    Each monotone piece with a change of sign is bracketed and solved by Newton's
    method (Yuksel 2022, High-Performance Polynomial Root Finding for Graphics).
    """
    slopes = np.diff(coefficients, axis=0)
    roots = np.full((len(slopes), coefficients.shape[1]), np.nan)
    # Coefficients that only rise or only fall: one piece, the usual case near a hit.
    simple = (slopes > 0.0).all(axis=0) | (slopes < 0.0).all(axis=0)
    single = np.flatnonzero(simple & (coefficients[0] * coefficients[-1] <= 0.0))
    roots[0, single] = _monotone(coefficients.take(single, 1))
    # Coefficients of one sign: no roots.
    apart = (coefficients > 0.0).all(axis=0) | (coefficients < 0.0).all(axis=0)
    several = np.flatnonzero(~(simple | apart))
    if len(several):
        roots[:, several] = _piecewise(coefficients.take(several, 1), slopes.take(several, 1))
    return roots


def _monotone(coefficients: Array) -> Array:
    """The one root (N,) of polynomials that rise or fall throughout and cross 0.

    Newton's method from the root of the quadratic through both ends and the middle; with
    a bracket where that does not converge soon.
    """
    degree = len(coefficients) - 1
    start, end = coefficients[0], coefficients[-1]
    middle = _value(coefficients, np.full(1, 0.5))[0]
    s = crossing(start, 2.0 * middle - 0.5 * (start + end), end)
    powers = [start]
    differences = coefficients
    for k in range(1, degree + 1):
        differences = differences[1:] - differences[:-1]
        powers.append(comb(degree, k) * differences[0])
    for _ in range(NEWTON_STEPS):
        height, slope = powers[-1], np.zeros_like(s)
        for power in powers[-2::-1]:
            slope = slope * s + height
            height = height * s + power
        step = height / slope
        s = s - step
    lost = np.flatnonzero(~((np.abs(step) <= CONVERGED) & (s >= 0.0) & (s <= 1.0)))
    if len(lost):
        s[lost] = _bracketed(coefficients.take(lost, 1), np.zeros(len(lost)), np.ones(len(lost)))
    return s


def _piecewise(coefficients: Array, slopes: Array) -> Array:
    """The ``unit_roots``, one in each monotone piece. slopes: the differences of the coefficients."""
    # Sorted, with the missing turns at 1, where they make empty pieces.
    turns = unit_roots(slopes)
    turns = np.sort(np.where(np.isnan(turns), 1.0, turns), axis=0)
    zero, one = np.zeros((1, turns.shape[1])), np.ones((1, turns.shape[1]))
    breaks = np.concatenate([zero, turns, one])
    heights = np.stack([_value(coefficients, b)[0] for b in breaks])
    low, high = heights[:-1], heights[1:]
    crossed = (np.signbit(low) != np.signbit(high)) | (low == 0.0) | (high == 0.0)
    crossed &= (breaks[1:] > breaks[:-1]) & ((low != 0.0) | (high != 0.0))
    curve: IndexArray = np.nonzero(crossed)[1]
    roots = np.full(low.shape, np.nan)
    roots[crossed] = _bracketed(coefficients.take(curve, 1), breaks[:-1][crossed], breaks[1:][crossed])
    return np.sort(roots, axis=0)


def _value(coefficients: Array, s: Array) -> tuple[Array, Array]:
    """Height and its derivative by de Casteljau's algorithm, each (N,)."""
    points = coefficients
    while len(points) > 2:
        points = points[:-1] + (points[1:] - points[:-1]) * s
    slope = points[1] - points[0]
    return points[0] + slope * s, (len(coefficients) - 1) * slope


def _bracketed(coefficients: Array, low: Array, high: Array) -> Array:
    """The root of each monotone piece [low, high] that has one, (N,)."""
    (start, start_slope), (end, end_slope) = _value(coefficients, low), _value(coefficients, high)
    rising = end > start
    s = _guess(low, high, start, start_slope, end, end_slope)
    noise = NOISE * np.abs(coefficients).max(axis=0)
    result = s.copy()
    active = np.arange(len(s))
    for _ in range(MOST_STEPS):
        height, slope = _value(coefficients, s)
        below = (height < 0.0) == rising
        low, high = np.where(below, s, low), np.where(below, high, s)
        newton = height / slope
        step = s - newton
        # A last step leads out of the bracket by rounding alone.
        usable = ((step >= low) & (step <= high)) | (np.abs(newton) <= CONVERGED)
        step = np.where(usable, step, 0.5 * (low + high))
        step = np.where(height == 0.0, s, step)
        result[active] = step
        going = np.flatnonzero((np.abs(step - s) > CONVERGED) & (np.abs(height) > noise))
        if len(going) == 0:
            break
        s = step
        if len(going) < 0.5 * len(s):
            coefficients, active, rising = coefficients.take(going, 1), active[going], rising[going]
            s, low, high, noise = s[going], low[going], high[going], noise[going]
    np.clip(result, 0.0, 1.0, out=result)
    return result


def _guess(low: Array, high: Array, start: Array, start_slope: Array, end: Array, end_slope: Array) -> Array:
    """A first guess of where pieces cross 0, from their heights and slopes at both ends.

    The parabola with which a cubic with these values begins, from the end that is nearer to 0: there the
    piece may have just turned, and Newton's method would only halve its distance with each step.
    """
    back = np.abs(end) < np.abs(start)
    width = np.where(back, low - high, high - low)
    near, far = np.where(back, end, start), np.where(back, start, end)
    climb = np.where(back, end_slope, start_slope) * width
    other = np.where(back, start_slope, end_slope) * width
    bend = 3.0 * (far - near) - 2.0 * climb - other
    root = np.sqrt(climb * climb - 4.0 * bend * near)
    share = -2.0 * near / (climb + np.copysign(root, -near))
    share = np.where((share >= 0.0) & (share <= 1.0), share, near / (near - far))
    guess: Array = np.clip(np.where(back, high, low) + share * width, low, high)
    return guess
