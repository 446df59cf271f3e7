# SPDX-License-Identifier: GPL-3.0-or-later
"""Nodes on numbers, vectors and colours: against Python's math and colorsys, one value at a time."""

import colorsys
import math

import numpy as np
import pytest

from scfpf_addon.projection.presets.euler import euler_matrix
from scfpf_addon.shading.nodes import colors, numbers

VALUES = (-2.6, -1.0, -0.4, 0.0, 0.3, 0.5, 1.0, 2.7)
TRIPLES = [(a, b, c) for a in VALUES for b in (-1.5, 0.0, 0.4, 2.0) for c in (0.0, 0.25, 3.0)]
COLORS = np.random.default_rng(5).uniform(0.02, 0.98, (3, 60))

# One number at a time; what has no value is 0, as the manual has it.
MATH = {
    "ADD": lambda a, b, c: a + b,
    "SUBTRACT": lambda a, b, c: a - b,
    "MULTIPLY": lambda a, b, c: a * b,
    "DIVIDE": lambda a, b, c: a / b if b else 0.0,
    "MULTIPLY_ADD": lambda a, b, c: a * b + c,
    "POWER": lambda a, b, c: real_power(a, b),
    "LOGARITHM": lambda a, b, c: math.log(a) / math.log(b) if a > 0 < b and b != 1 else 0.0,
    "SQRT": lambda a, b, c: math.sqrt(a) if a > 0 else 0.0,
    "INVERSE_SQRT": lambda a, b, c: 1 / math.sqrt(a) if a > 0 else 0.0,
    "ABSOLUTE": lambda a, b, c: abs(a),
    "EXPONENT": lambda a, b, c: math.exp(a),
    "MINIMUM": lambda a, b, c: min(a, b),
    "MAXIMUM": lambda a, b, c: max(a, b),
    "LESS_THAN": lambda a, b, c: float(a < b),
    "GREATER_THAN": lambda a, b, c: float(a > b),
    "SIGN": lambda a, b, c: math.copysign(1, a) if a else 0.0,
    "COMPARE": lambda a, b, c: float(abs(a - b) <= max(c, 1e-5)),
    "ROUND": lambda a, b, c: math.floor(a + 0.5),
    "FLOOR": lambda a, b, c: math.floor(a),
    "CEIL": lambda a, b, c: math.ceil(a),
    "TRUNC": lambda a, b, c: math.trunc(a),
    "FRACT": lambda a, b, c: a % 1.0,
    "MODULO": lambda a, b, c: math.fmod(a, b) if b else 0.0,
    "FLOORED_MODULO": lambda a, b, c: a % b if b else 0.0,
    "WRAP": lambda a, b, c: c + (a - c) % (b - c) if b != c else c,
    "SNAP": lambda a, b, c: math.floor(a / b) * b if b else 0.0,
    "PINGPONG": lambda a, b, c: abs((a - b) % (2 * b) - b) if b else 0.0,
    "SINE": lambda a, b, c: math.sin(a),
    "COSINE": lambda a, b, c: math.cos(a),
    "TANGENT": lambda a, b, c: math.tan(a),
    "ARCSINE": lambda a, b, c: math.asin(min(max(a, -1.0), 1.0)),
    "ARCCOSINE": lambda a, b, c: math.acos(min(max(a, -1.0), 1.0)),
    "ARCTANGENT": lambda a, b, c: math.atan(a),
    "ARCTAN2": lambda a, b, c: math.atan2(a, b),
    "SINH": lambda a, b, c: math.sinh(a),
    "COSH": lambda a, b, c: math.cosh(a),
    "TANH": lambda a, b, c: math.tanh(a),
    "RADIANS": lambda a, b, c: math.radians(a),
    "DEGREES": lambda a, b, c: math.degrees(a),
}


def real_power(a, b):
    """0 where the power is complex or infinite."""
    try:
        value = a**b
    except ZeroDivisionError:
        return 0.0
    return 0.0 if isinstance(value, complex) else value


def column(*values):
    return np.array(values, float).reshape(-1, 1)


@pytest.mark.parametrize("operation", sorted(MATH))
def test_math_is_pythons(operation):
    rows = np.array(TRIPLES).T[:, None]
    (found,) = numbers.math(tuple(rows), {"operation": operation, "clamp": False}, None)
    np.testing.assert_allclose(found[0], [MATH[operation](*each) for each in TRIPLES], atol=1e-12)
    (clamped,) = numbers.math(tuple(rows), {"operation": operation, "clamp": True}, None)
    np.testing.assert_array_equal(clamped, np.clip(found, 0.0, 1.0))


def test_all_operations_of_the_math_node_are_compared():
    assert set(numbers.MATH) == {*MATH, "SMOOTH_MIN", "SMOOTH_MAX"}


def test_a_smooth_minimum_is_the_minimum_with_a_rounded_corner():
    a, b = np.random.default_rng(1).uniform(-2, 2, (2, 1, 200))
    for distance in (0.0, 0.5):
        least = numbers.MATH["SMOOTH_MIN"](a, b, np.full_like(a, distance))
        most = numbers.MATH["SMOOTH_MAX"](a, b, np.full_like(a, distance))
        far = np.abs(a - b) >= distance
        np.testing.assert_array_equal(least[far], np.minimum(a, b)[far])
        # At the corner itself the cubic is a sixth of the distance below; above and below are alike.
        assert (least <= np.minimum(a, b)).all() and (least >= np.minimum(a, b) - distance / 6).all()
        np.testing.assert_allclose(least + most, a + b, atol=1e-12)
    assert numbers.MATH["SMOOTH_MIN"](column(1.0), column(1.0), column(0.6)) == pytest.approx(0.9)


def vectors(operation, *inputs, scale=0.0):
    inputs = [column(*each) for each in inputs] + [column(0, 0, 0)] * (3 - len(inputs))
    return numbers.vector_math((*inputs, column(scale)), {"operation": operation}, None)


def test_vector_math_is_geometry():
    a, b = (1.0, 2.0, -2.0), (0.0, 0.0, 3.0)
    assert vectors("DOT_PRODUCT", a, b)[1] == -6.0
    assert vectors("LENGTH", a)[1] == 3.0
    assert vectors("DISTANCE", a, b)[1] == pytest.approx(math.sqrt(1 + 4 + 25))
    for operation, expected in {
        "ADD": (1, 2, 1),
        "SUBTRACT": (1, 2, -5),
        "MULTIPLY": (0, 0, -6),
        "DIVIDE": (0, 0, -2 / 3),
        "CROSS_PRODUCT": (6, -3, 0),
        "PROJECT": (0, 0, -2),
        "REFLECT": (1, 2, 2),
        "NORMALIZE": (1 / 3, 2 / 3, -2 / 3),
        "ABSOLUTE": (1, 2, 2),
        "SIGN": (1, 1, -1),
        "MINIMUM": (0, 0, -2),
        "MAXIMUM": (1, 2, 3),
        "POWER": (1, 1, -8),
    }.items():
        np.testing.assert_allclose(vectors(operation, a, b)[0][:, 0], expected, atol=1e-15, err_msg=operation)
    np.testing.assert_allclose(vectors("SCALE", a, scale=2.5)[0][:, 0], (2.5, 5.0, -5.0))
    np.testing.assert_allclose(vectors("MULTIPLY_ADD", a, b, (1, 1, 1))[0][:, 0], (1, 1, -5))
    # Kept where the vector opposes the reference, flipped where it follows it.
    for incident, side in ((b, -1.0), ((0, 0, -3.0), 1.0)):
        turned = vectors("FACEFORWARD", a, incident, (0, 0, 1))[0][:, 0]
        np.testing.assert_array_equal(turned, side * np.array(a))
    each = (0.6, -1.7, 2.5)
    for operation, one in {
        "ROUND": lambda x: math.floor(x + 0.5),
        "FLOOR": math.floor,
        "CEIL": math.ceil,
        "FRACTION": lambda x: x % 1.0,
        "SINE": math.sin,
        "COSINE": math.cos,
        "TANGENT": math.tan,
    }.items():
        np.testing.assert_allclose(
            vectors(operation, each)[0][:, 0], [one(x) for x in each], err_msg=operation
        )
    by = (0.4, 0.5, 0.0)
    fmod = [math.fmod(x, y) if y else 0.0 for x, y in zip(each, by, strict=True)]
    np.testing.assert_allclose(vectors("MODULO", each, by)[0][:, 0], fmod)
    snapped = [math.floor(x / y) * y if y else 0.0 for x, y in zip(each, by, strict=True)]
    np.testing.assert_allclose(vectors("SNAP", each, by)[0][:, 0], snapped)
    np.testing.assert_allclose(vectors("WRAP", each, (1, 1, 1), (-1, -1, -1))[0][:, 0], (0.6, 0.3, 0.5))


@pytest.mark.parametrize("angle", [0.0, 0.4, 1.2])
def test_vectors_are_refracted_by_snells_law(angle):
    """Sines have the ratio of the indices; beyond the critical angle the result is 0."""
    incident = (math.sin(angle), 0.0, -math.cos(angle))
    for ratio in (0.7, 1.4):
        bent = vectors("REFRACT", incident, (0, 0, 2.0), scale=ratio)[0][:, 0]
        sine = ratio * math.sin(angle)
        expected = (sine, 0.0, -math.sqrt(1 - sine * sine)) if sine <= 1.0 else (0.0, 0.0, 0.0)
        np.testing.assert_allclose(bent, expected, atol=1e-12)


def test_mapping_scales_turns_and_moves():
    generator = np.random.default_rng(3)
    vector, location, scale = generator.uniform(0.5, 2.0, (3, 3, 1))
    angles = generator.uniform(-3, 3, (3, 1))
    turn = euler_matrix(tuple(angles[:, 0]))[:3, :3]

    def mapped(kind, what):
        return numbers.mapping((what, location, angles, scale), {"kind": kind}, None)[0]

    np.testing.assert_allclose(mapped("POINT", vector), turn @ (vector * scale) + location)
    np.testing.assert_allclose(mapped("VECTOR", vector), turn @ (vector * scale))
    np.testing.assert_allclose(mapped("TEXTURE", mapped("POINT", vector)), vector)
    # A normal stays perpendicular to directions in the surface.
    along = np.cross(vector[:, 0], (1.0, 2.0, 3.0))[:, None]
    assert abs(mapped("NORMAL", vector)[:, 0] @ mapped("VECTOR", along)[:, 0]) < 1e-12
    assert np.linalg.norm(mapped("NORMAL", vector)) == pytest.approx(1.0)


def test_map_range_and_clamp_keep_their_ends():
    at = np.linspace(-1.0, 5.0, 61)[None]
    ends = [column(x) for x in (0.0, 4.0, 10.0, 30.0, 4.0)]
    within = np.clip(at / 4.0, 0.0, 1.0)
    for kind, clamped, share in (
        ("LINEAR", False, at / 4.0),
        ("LINEAR", True, within),
        ("STEPPED", True, np.clip(np.floor(at / 4.0 * 5.0) / 4.0, 0.0, 1.0)),
        ("SMOOTHSTEP", False, within**2 * (3 - 2 * within)),
        ("SMOOTHERSTEP", False, 6 * within**5 - 15 * within**4 + 10 * within**3),
    ):
        (found,) = numbers.map_range((at, *ends), {"kind": kind, "clamp": clamped}, None)
        np.testing.assert_allclose(found, 10.0 + 20.0 * share, atol=1e-12, err_msg=kind)
    low, high = column(2.0), column(-1.0)
    assert numbers.clamp((column(5.0), low, high), {"range": True}, None)[0] == 2.0
    assert numbers.clamp((column(5.0), low, high), {"range": False}, None)[0] == -1.0


def test_sockets_of_other_kinds_are_converted():
    color = column(0.2, 0.5, 0.8)
    assert numbers.convert((color,), {"to": "GREY"}, None)[0] == pytest.approx(
        0.2126 * 0.2 + 0.7152 * 0.5 + 0.0722 * 0.8
    )
    assert colors.grey((color,), {}, None)[0] == numbers.convert((color,), {"to": "GREY"}, None)[0]
    assert numbers.convert((color,), {"to": "MEAN"}, None)[0] == pytest.approx(0.5)
    np.testing.assert_array_equal(
        numbers.convert((column(0.3),), {"to": "SPREAD"}, None)[0], column(0.3, 0.3, 0.3)
    )
    parts = numbers.separate((color,), {}, None)
    np.testing.assert_array_equal(numbers.combine(parts, {}, None)[0], color)
    np.testing.assert_array_equal(numbers.constant((), {"value": (1, 2, 3)}, None)[0], column(1, 2, 3))
    assert numbers.multiply((column(2.0), column(3.0)), {}, None)[0] == 6.0
    for share, expected in ((0.3, (0.7, 0.3)), (2.0, (0.0, 1.0))):
        assert [float(each[0, 0]) for each in numbers.rest((column(share),), {}, None)] == pytest.approx(
            expected
        )


def by_pixel(function, color):
    return np.array([function(*each) for each in color.T]).T


def test_hue_saturation_and_value_are_colorsys():
    grey = np.array([[0.0, 0.5, 1.0]] * 3)
    every = np.concatenate([COLORS, grey, np.eye(3), 1.0 - np.eye(3)], axis=1)
    np.testing.assert_allclose(colors.hsv_from_rgb(every), by_pixel(colorsys.rgb_to_hsv, every), atol=1e-12)
    np.testing.assert_allclose(colors.rgb_from_hsv(every), by_pixel(colorsys.hsv_to_rgb, every), atol=1e-12)
    hls = by_pixel(colorsys.rgb_to_hls, every)
    np.testing.assert_allclose(colors.hsl_from_rgb(every), hls[[0, 2, 1]], atol=1e-12)
    np.testing.assert_allclose(colors.rgb_from_hsl(hls[[0, 2, 1]]), every, atol=1e-12)
    for mode in ("RGB", "HSV", "HSL"):
        parts = colors.separate_color((every,), {"mode": mode}, None)
        (back,) = colors.combine_color(parts, {"mode": mode}, None)
        np.testing.assert_allclose(back, every, atol=1e-12)


# Of a below b, whole: as image editors define them (W3C, Compositing and Blending; GIMP's manual).
BLENDS = {
    "MIX": lambda a, b: b,
    "DARKEN": min,
    "MULTIPLY": lambda a, b: a * b,
    "BURN": lambda a, b: max(1 - (1 - a) / b, 0.0),
    "LIGHTEN": max,
    "SCREEN": lambda a, b: 1 - (1 - a) * (1 - b),
    "DODGE": lambda a, b: min(a / (1 - b), 1.0),
    "ADD": lambda a, b: a + b,
    "OVERLAY": lambda a, b: 2 * a * b if a < 0.5 else 1 - 2 * (1 - a) * (1 - b),
    "SOFT_LIGHT": lambda a, b: (1 - a) * a * b + a * (1 - (1 - a) * (1 - b)),
    "LINEAR_LIGHT": lambda a, b: a + 2 * b - 1,
    "DIFFERENCE": lambda a, b: abs(a - b),
    "EXCLUSION": lambda a, b: a + b - 2 * a * b,
    "SUBTRACT": lambda a, b: a - b,
    "DIVIDE": lambda a, b: a / b,
}
# Which of hue, saturation and value come from b.
TAKEN = {"HUE": (0,), "COLOR": (0, 1), "SATURATION": (1,), "VALUE": (2,)}


def mixed(blend, share, a, b, **settings):
    settings = {"blend": blend, "clamp_factor": True, "clamp_result": False} | settings
    return colors.mix((column(share), a, b), settings, None)[0]


@pytest.mark.parametrize("blend", sorted(colors.BLENDS))
def test_blends_are_those_of_image_editors(blend):
    a, b = COLORS[:, :30], COLORS[:, 30:]
    np.testing.assert_allclose(mixed(blend, 0.0, a, b), a, atol=1e-12)
    if blend in TAKEN:
        one, other = by_pixel(colorsys.rgb_to_hsv, a), by_pixel(colorsys.rgb_to_hsv, b)
        one[list(TAKEN[blend])] = other[list(TAKEN[blend])]
        expected = by_pixel(colorsys.hsv_to_rgb, one)
    else:
        expected = np.vectorize(BLENDS[blend])(a, b)
    np.testing.assert_allclose(mixed(blend, 1.0, a, b), expected, atol=1e-12)
    np.testing.assert_array_equal(mixed(blend, 7.0, a, b), mixed(blend, 1.0, a, b))
    clamped = mixed(blend, 1.0, a, b, clamp_result=True)
    np.testing.assert_allclose(clamped, np.clip(expected, 0.0, 1.0), atol=1e-12)


def test_curves_ramps_and_small_converters():
    table = np.array([[0.0, 0.1, 0.2, 1.0], [1.0, 0.5, 0.0, 0.5], [0.0, 0.0, 1.0, 0.0]])
    at = np.array([[-1.0, 0.0, 0.2, 0.5, 0.8, 2.0]])
    smooth, alpha = colors.table((at,), {"table": table, "smooth": True}, None)
    inside = np.clip(at[0], 0.0, 1.0)
    for channel, found in enumerate((*smooth, *alpha)):
        np.testing.assert_allclose(found, np.interp(inside, [0, 0.5, 1], table[:, channel]))
    steps, _ = colors.table((at,), {"table": table, "smooth": False}, None)
    np.testing.assert_array_equal(steps[0], [0, 0, 0, 1, 1, 0])

    line = {"table": np.array([[0.0], [0.2], [1.0]]), "low": 0.0, "high": 2.0, "extend": True}
    (bent,) = colors.curves((column(1.0), np.array([[-1.0, 0.5, 1.5, 3.0]])), line, None)
    np.testing.assert_allclose(bent[0], [-0.2, 0.1, 0.6, 1.8])
    (flat,) = colors.curves((column(1.0), np.array([[-1.0, 3.0]])), line | {"extend": False}, None)
    np.testing.assert_allclose(flat[0], [0.0, 1.0])
    (half,) = colors.curves((column(0.5), column(0.5)), line, None)
    assert half == pytest.approx(0.3)

    color = column(0.2, 0.5, -0.1)
    np.testing.assert_allclose(colors.invert((column(1.0), color), {}, None)[0], 1.0 - color)
    np.testing.assert_allclose(colors.gamma((color, column(2.0)), {}, None)[0], column(0.04, 0.25, -0.1))
    (bright,) = colors.bright_contrast((color, column(0.1), column(1.0)), {}, None)
    np.testing.assert_allclose(bright, column(0.0, 0.6, 0.0), atol=1e-15)


def test_hue_saturation_node_is_colorsys():
    def changed(r, g, b):
        h, s, v = colorsys.rgb_to_hsv(r, g, b)
        return colorsys.hsv_to_rgb((h + 0.8 + 0.5) % 1.0, min(s * 0.4, 1.0), v * 1.5)

    inputs = (column(0.8), column(0.4), column(1.5), column(1.0), COLORS)
    (found,) = colors.hue_saturation(inputs, {}, None)
    np.testing.assert_allclose(found, by_pixel(changed, COLORS), atol=1e-12)
