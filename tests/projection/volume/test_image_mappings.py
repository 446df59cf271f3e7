# SPDX-License-Identifier: GPL-3.0-or-later
"""Mappings of the image: closed forms, Jacobians against differences, inverses, stacks, what files say."""

import json

import mpmath
import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from scfpf_addon.projection.file_limits import PresetError
from scfpf_addon.projection.mappings.grids import DeformedGrid, STMap
from scfpf_addon.projection.mappings.kinds import KINDS, mapping_data, read_mappings
from scfpf_addon.projection.mappings.radial import CurvedDisplay, Distortion, MagicLens, RadialCurve
from scfpf_addon.projection.mappings.stack import (
    InverseMapping,
    PartialMapping,
    Stack,
    is_disc,
    mapped_places,
    seen_through,
)
from scfpf_addon.projection.surfaces.surface import Plane
from scfpf_addon.projection.volume.inverse import find_in_image
from scfpf_addon.projection.volume.reparameterisation import Polar, Unrolled
from scfpf_addon.projection.volume.viewing_volume import Projection, ViewingVolume

SINE = np.linspace(0.0, 1.0, 257)
# Equidistant from equisolid: at radius r the angle's share of a quarter turn.
EQUISOLID = RadialCurve(np.stack([SINE, 4 / np.pi * np.arcsin(SINE * np.sin(np.pi / 4))], axis=1))


def wavy_grid(rows=5, columns=7, size=0.03):
    y, x = np.meshgrid(np.linspace(0, 1, rows), np.linspace(0, 1, columns), indexing="ij")
    return DeformedGrid(np.stack([x + size * np.sin(7 * y), y + size * np.cos(5 * x)], axis=-1))


def st_map(width=64, height=40):
    x, y = np.meshgrid((np.arange(width) + 0.5) / width, (np.arange(height) + 0.5) / height)
    values = np.stack([x + 0.02 * np.sin(5 * y), y - 0.03 * np.cos(4 * x)], axis=-1)
    return STMap(values, np.ones(values.shape[:2], bool))


MAPPINGS = {
    "curve": RadialCurve(np.array([[0, 0], [0.3, 0.2], [0.7, 0.5], [1.2, 1.3]])),
    "equisolid": EQUISOLID,
    "barrel": Distortion((0.1, 0.02, 0.003), radius=1.2, centre=(0.45, 0.55)),
    "division": Distortion((0.0, 0.0, 0.0), (-0.08, 0.0, 0.0), centre=(0.52, 0.5)),
    "rational": Distortion((-0.1, 0.03, 0.001), (0.05, 0.01, 0.002)),
    "lens": MagicLens(0.6, 2.5, 0.4, (0.4, 0.6)),
    "shrinking lens": MagicLens(0.5, 0.8, 0.8),
    "display": CurvedDisplay(1.9),
    "far display": CurvedDisplay(1.2, 1.7),
    "near display": CurvedDisplay(1.2, 0.6),
    "grid": wavy_grid(),
    "ST map": st_map(),
    "backwards": InverseMapping(Distortion((0.2, 0.0, 0.0))),
    "part": PartialMapping(MagicLens(0.5, 3.0, 0.5), 0.4),
    "stack": Stack(
        (MagicLens(0.4, 2.0, 0.5, (0.3, 0.4)), wavy_grid(), Distortion((-0.05, 0, 0))), Unrolled()
    ),
}


def image_places(count=400, seed=2):
    return np.random.default_rng(seed).uniform(0.01, 0.99, size=(2, count))


@pytest.mark.parametrize("name", MAPPINGS)
@pytest.mark.parametrize("aspect", [0.6, 1.0, 1.9])
def test_jacobians_are_the_derivatives(name, aspect):
    mapping, step = MAPPINGS[name], 1e-6
    x, y = image_places()
    image = mapping.map(x, y, aspect)
    assert image.mask.any()
    for axis, (dx, dy) in enumerate(((step, 0.0), (0.0, step))):
        more, less = mapping.map(x + dx, y + dy, aspect), mapping.map(x - dx, y - dy, aspect)
        usable = image.mask & more.mask & less.mask
        differences = np.stack([more.u - less.u, more.v - less.v]) / (2 * step)
        off = np.abs(differences - image.jacobian[:, axis])[:, usable]
        # Where pieces meet the derivative leaps or bends; those few places are within a step of it.
        assert np.quantile(off, 0.99) < 1e-4 and (name == "ST map" or off.max() < 1e-2)


@pytest.mark.parametrize("name", MAPPINGS)
@pytest.mark.parametrize("aspect", [0.6, 1.9])
def test_points_are_those_of_the_map_and_the_inverse_leads_back(name, aspect):
    mapping = MAPPINGS[name]
    x, y = image_places()
    image, points = mapping.map(x, y, aspect), mapping.points(x, y, aspect)
    np.testing.assert_array_equal(points.mask[image.mask], True)
    np.testing.assert_allclose(points.u, image.u, rtol=0, atol=1e-15)
    np.testing.assert_allclose(points.v, image.v, rtol=0, atol=1e-15)
    back = np.stack(mapping.image_positions(image.u, image.v, aspect))[:, image.mask]
    assert np.isfinite(back).mean() > 0.99
    assert np.nanmax(np.abs(back - np.stack([x, y])[:, image.mask])) < 1e-8


@given(st.floats(0.01, 0.99), st.floats(0.01, 0.99), st.floats(0.3, 3.0), st.floats(-0.1, 0.3))
def test_brown_and_division_distortion_against_mpmath(x, y, aspect, k):
    with mpmath.workdps(30):
        a = (mpmath.mpf(x) - 0.5) * 2 * max(mpmath.mpf(aspect), 1)
        b = (mpmath.mpf(y) - 0.5) * 2 * max(1 / mpmath.mpf(aspect), 1)
        q = (a * a + b * b) / mpmath.mpf(1.5) ** 2
        brown = 1 + mpmath.mpf(k) * q + mpmath.mpf("0.02") * q**2 + mpmath.mpf("0.001") * q**3
        division = 1 / (1 + mpmath.mpf(k) * q)
    for share, mapping in (
        (brown, Distortion((k, 0.02, 0.001), radius=1.5)),
        (division, Distortion((0.0, 0.0, 0.0), (k, 0.0, 0.0), 1.5)),
    ):
        image = mapping.map(np.array([x]), np.array([y]), aspect)
        if image.mask[0]:
            assert image.u[0] == pytest.approx(float(0.5 + (x - 0.5) * share), abs=1e-13)
            assert image.v[0] == pytest.approx(float(0.5 + (y - 0.5) * share), abs=1e-13)


def test_a_distortion_backwards_solves_the_polynomial():
    """OpenCV's direction: distorted places of undistorted ones; Newton's method by mpmath."""
    mapping = InverseMapping(Distortion((0.15, -0.02, 0.004), (0.03, 0.0, 0.0)))
    x, y = image_places(20)
    image = mapping.map(x, y, 1.6)
    for k in range(20):
        with mpmath.workdps(30):
            a, b = (mpmath.mpf(x[k]) - 0.5) * 2 * mpmath.mpf(1.6), (mpmath.mpf(y[k]) - 0.5) * 2
            r = mpmath.sqrt(a * a + b * b)

            def off(s, r=r):
                q = s * s
                return s * (1 + 0.15 * q - 0.02 * q**2 + 0.004 * q**3) / (1 + 0.03 * q) - r

            share = float(mpmath.findroot(off, r) / r)
        assert image.u[k] == pytest.approx(0.5 + (x[k] - 0.5) * share, abs=1e-12)
        assert image.v[k] == pytest.approx(0.5 + (y[k] - 0.5) * share, abs=1e-12)


def test_a_distortion_ends_where_it_turns_back():
    # r - 0.3 r³ rises up to r² = 1 / 0.9.
    mapping = Distortion((-0.3, 0.0, 0.0))
    limit = np.sqrt(1 / 0.9)
    assert mapping.limit == pytest.approx(limit, rel=1e-12)
    x = 0.5 + 0.5 * np.array([0.999, 1.001]) * limit / 2.0
    assert mapping.map(x, np.full(2, 0.5), 2.0).mask.tolist() == [True, False]
    # A pole of the division model too.
    assert Distortion((0.0, 0.0, 0.0), (-0.25, 0.0, 0.0)).limit == pytest.approx(2.0)
    assert np.isnan(mapping.image_positions(np.array([0.99]), np.array([0.5]), 2.0)[0][0])


@pytest.mark.parametrize("falloff", [0.0, 0.3, 1.0])
def test_a_lens_magnifies_as_it_says_and_leaves_the_rest(falloff):
    lens = MagicLens(0.4, 3.0, falloff, (0.6, 0.45))
    step = 1e-5
    seen = lens.map(0.6 + np.array([-step, step]), np.full(2, 0.45), 1.7)
    assert 2 * step / np.ptp(seen.u) == pytest.approx(3.0, rel=2e-3 if falloff == 1.0 else 1e-9)
    x, y = image_places(2000)
    image = lens.map(x, y, 1.7)
    r = np.hypot((x - 0.6) * 2 * 1.7, (y - 0.45) * 2)
    outside, inside = r >= 0.4, r < 0.4 * (1 - falloff)
    np.testing.assert_allclose(image.u[outside], x[outside], rtol=0, atol=1e-15)
    np.testing.assert_allclose(image.u[inside], 0.6 + (x[inside] - 0.6) / 3, atol=1e-15)
    determinant = image.jacobian[0, 0] * image.jacobian[1, 1] - image.jacobian[0, 1] * image.jacobian[1, 0]
    assert (determinant > 0).all()
    np.testing.assert_allclose(determinant[inside], 1 / 9, rtol=1e-12)


@given(st.lists(st.tuples(st.floats(0.05, 1.0), st.floats(0.0, 1.0)), min_size=1, max_size=12))
def test_a_radial_curve_passes_through_its_points_and_is_monotone(steps):
    r, f = np.cumsum([[0.0, 0.0], *steps], axis=0).T
    curve = RadialCurve(np.stack([r, f], axis=1))
    profile = curve.profile(r)
    np.testing.assert_allclose(r * profile.share, f, atol=1e-12)
    fine = np.linspace(0.0, r[-1] * 1.3, 500)
    values = curve.profile(fine)
    assert (np.diff(fine * values.share) >= -1e-12).all() and (values.slope >= -1e-9).all()


def test_a_straight_radial_curve_is_a_change_of_size():
    x, y = image_places()
    image = RadialCurve(np.array([[0.0, 0.3], [0.4, 0.2], [1.0, 0.5]])).map(x, y, 1.3)
    np.testing.assert_allclose(image.u, 0.5 + (x - 0.5) / 2, atol=1e-15)
    np.testing.assert_allclose(image.jacobian[0, 0], 0.5)


def test_a_radial_curve_makes_an_equidistant_fisheye_equisolid():
    """r = sin(θ/2) / sin(45°) over an image of r = θ / 90°, between its 257 points too."""
    theta = np.linspace(0.001, np.pi / 2, 1000)
    r = np.sin(theta / 2) / np.sin(np.pi / 4)
    profile = EQUISOLID.profile(r)
    np.testing.assert_allclose(r * profile.share, theta / (np.pi / 2), atol=2e-8)
    np.testing.assert_allclose(profile.slope, 4 / np.pi * np.sin(np.pi / 4) / np.cos(theta / 2), rtol=2e-4)


@pytest.mark.parametrize("distance", [0.6, 1.0, 2.5])
def test_a_curved_display_shows_its_viewer_the_flat_image(distance):
    """Rays from the viewer through the screen meet the plane behind it at what the screen shows."""
    arc, aspect = 1.4, 2.2
    x, y = image_places()
    image = CurvedDisplay(arc, distance).map(x, y, aspect)
    # Of a screen of radius 1: width along the arc, height, places in the viewer's space.
    angle, height = (x - 0.5) * arc, (y - 0.5) * arc / aspect
    place = np.stack([np.sin(angle), height, -(distance - 1 + np.cos(angle))])
    flat = place[:2] / -place[2]
    shown = np.stack([image.u - 0.5, (image.v - 0.5) / aspect])
    scale = (flat[0] @ shown[0]) / (shown[0] @ shown[0])
    np.testing.assert_allclose(shown * scale, flat, atol=1e-12)
    corners = CurvedDisplay(arc, distance).map(np.array([0.0, 1.0]), np.array([0.0, 1.0]), aspect)
    np.testing.assert_allclose(corners.v, [0.0, 1.0], atol=1e-12)
    assert image.mask.all() and (np.abs(image.u - 0.5) <= 0.5).all()
    with pytest.raises(ValueError, match="move away"):
        CurvedDisplay(2.9, 0.5)


def test_a_grid_passes_through_its_points_and_a_regular_one_is_the_identity():
    grid = wavy_grid()
    y, x = np.meshgrid(np.linspace(0, 1, 5), np.linspace(0, 1, 7), indexing="ij")
    image = grid.map(x.ravel(), y.ravel(), 1.0)
    np.testing.assert_allclose(np.stack([image.u, image.v], axis=-1).reshape(5, 7, 2), grid.seen, atol=1e-15)
    x, y = np.random.default_rng(1).uniform(-0.3, 1.3, size=(2, 300))
    plain = wavy_grid(size=0.0).map(x, y, 1.0)
    np.testing.assert_allclose([plain.u, plain.v], [x, y], atol=1e-14)
    np.testing.assert_allclose(plain.jacobian, np.broadcast_to(np.eye(2)[..., None], (2, 2, 300)), atol=1e-13)


def test_an_st_map_of_a_stack_is_the_stack():
    """Written at pixel centres, read bilinearly: off by an eighth of the curvature times a pixel squared."""
    stack = (MagicLens(0.5, 2.0, 0.6, (0.4, 0.5)), Distortion((0.08, 0.0, 0.0)))
    errors = []
    for width, height in ((320, 180), (640, 360)):
        grid = np.meshgrid((np.arange(width) + 0.5) / width, (np.arange(height) + 0.5) / height)
        places = mapped_places(stack, *(a.ravel() for a in grid), width / height)
        values = np.stack([places.u, places.v], axis=-1).reshape(height, width, 2)
        read = STMap(values, places.mask.reshape(height, width))
        x, y = image_places(3000)
        want, got = mapped_places(stack, x, y, width / height), read.points(x, y, width / height)
        off = np.abs(np.stack([got.u - want.u, got.v - want.v]))[:, got.mask & want.mask]
        errors.append(off.max() * width)
    # In pixels: it halves with the pixel's size.
    assert errors[0] < 0.06 and errors[1] < 0.6 * errors[0]


def test_pixels_without_a_value_show_nothing():
    whole = st_map(4, 4)
    present = np.ones((4, 4), bool)
    present[:, 0] = False
    holed = STMap(np.where(present[..., None], whole.values, np.nan), present)
    image = holed.map(np.array([0.1, 0.3, 0.6]), np.full(3, 0.5), 1.0)
    assert image.mask.tolist() == [False, False, True]
    assert np.isfinite(image.u).all() and np.isfinite(image.jacobian).all()


def test_a_stack_goes_from_the_first_to_the_last_and_ends_at_the_border():
    twice = RadialCurve(np.array([[0.0, 0.0], [1.0, 2.0]]))
    lens = MagicLens(0.3, 2.0, 0.0, (0.75, 0.5))
    x, y = np.array([0.6, 0.65, 0.9]), np.full(3, 0.5)
    first = Stack((twice, lens), Unrolled()).map(x, y, 1.0)
    np.testing.assert_allclose(first.u[:2], [0.725, 0.775])
    assert first.mask.tolist() == [True, True, False]
    second = Stack((lens, twice), Unrolled()).map(x, y, 1.0)
    np.testing.assert_allclose(second.u[0], 0.5 + 2 * (0.75 + (0.6 - 0.75) - 0.5))
    assert seen_through((), Polar()) == Polar()


def test_a_polar_base_keeps_its_disc_if_the_rim_stays():
    rim_stays = RadialCurve(np.array([[0.0, 0.0], [0.5, 0.7], [1.0, 1.0]]))
    for aspect in (0.5, 1.0, 1.8):
        assert is_disc(Polar(), aspect) and not is_disc(Unrolled(), aspect)
        assert is_disc(Stack((rim_stays, MagicLens(0.2)), Polar()), aspect)
        assert not is_disc(Stack((Distortion((0.2, 0, 0)),), Polar()), aspect)
        assert not is_disc(Stack((rim_stays,), Unrolled()), aspect)


def test_points_of_space_are_found_in_a_distorted_image():
    matrix = np.eye(4)
    matrix[2, 3] = -10.0
    volume = ViewingVolume((Plane(2.0, 1.0), Plane(20.0, 10.0, matrix=matrix)))
    stack = Stack((MagicLens(0.5, 2.0, 0.5), Distortion((0.3, 0.0, 0.0))), Unrolled())
    projection = Projection(volume, stack, (0.1, 0.9), (0.0, 1.0), aspect=2.0)
    x, y = image_places(60)
    image = projection.parameters(x, y)
    t = np.linspace(0.1, 0.9, 60)
    found = find_in_image(projection, volume.evaluate(image.u, image.v, t).position)
    shown = image.mask
    assert found.found[shown].all()
    np.testing.assert_allclose([found.x[shown], found.y[shown]], [x[shown], y[shown]], atol=1e-8)


STORED = [
    {"name": "Fish", "kind": "RADIAL_CURVE", "points": [[0, 0], [0.5, 0.6], [1, 1]]},
    {"name": "L", "kind": "LENS", "centre_x": 0.3, "radius": 0.4, "magnification": 2, "falloff": 0.5},
    {"name": "D", "kind": "DISTORTION", "radius": 1.5, "k1": 0.1, "k4": -0.02, "backwards": True},
    {"name": "Screen", "kind": "DISPLAY", "arc_degrees": 90, "distance": 1.25},
    {"name": "G", "kind": "GRID", "points": [[[0, 0], [1, 0]], [[0, 1], [1.1, 1]]], "influence": 0.5},
    {
        "name": "C",
        "kind": "CALIBRATION",
        "lens": {
            "model": "EQUIDISTANT",
            "size": [640, 480],
            "matrix": [200.1, 0.5, 0, 201],
            "centre": [321, 239.5],
            "numerator": [0.01, -0.002],
            "frame": [0, 0, 4, 4],
        },
    },
]


def test_files_give_mappings_back():
    assert {item["kind"] for item in STORED} == set(KINDS)
    read = read_mappings(json.loads(json.dumps(STORED)))
    again = read_mappings(json.loads(json.dumps([mapping_data(one) for one in read])))
    x, y = image_places(50)
    for one, other in zip(read, again, strict=True):
        assert one.parameters == other.parameters and one.name == other.name
        for a, b in zip(one.mapping().map(x, y, 1.4), other.mapping().map(x, y, 1.4), strict=True):
            np.testing.assert_array_equal(a, b)


@pytest.mark.parametrize(
    ("change", "message"),
    [
        ({"kind": "SPIRAL"}, "mapping 1: kind must be one of"),
        ({"magnification": 0}, "mapping 1: magnification must be a number above 0"),
        ({"falloff": 1.5}, "mapping 1: falloff must be a number between 0 and 1"),
        ({"falloff": float("nan")}, "falloff"),
        ({"k1": 1}, "unknown key 'k1'"),
        ({"influence": "all"}, "influence"),
        ({"backwards": 1}, "backwards must be true or false"),
        ({"kind": "GRID"}, "mapping 1"),
    ],
)
def test_bad_mappings_say_what_is_wrong(change, message):
    with pytest.raises(PresetError, match=message):
        read_mappings([STORED[1] | change])


@pytest.mark.parametrize(
    "points", [[[0, 0]], [[0.1, 0], [1, 1]], [[0, 0], [0, 1]], [[0, 0], [1]], "x", [[0, 0], [1, 99]], None]
)
def test_bad_curves_say_what_is_wrong(points):
    with pytest.raises(PresetError, match="mapping 1"):
        read_mappings([STORED[0] | {"points": points}])


def test_a_stack_is_bounded():
    with pytest.raises(PresetError, match="at most 32"):
        read_mappings([STORED[1]] * 33)
    with pytest.raises(PresetError, match="move away"):
        read_mappings([STORED[3] | {"arc_degrees": 170, "distance": 0.1}])


anything = st.recursive(
    st.none()
    | st.booleans()
    | st.floats()
    | st.integers()
    | st.text(max_size=5)
    | st.sampled_from(list(KINDS)),
    lambda inner: (
        st.lists(inner, max_size=4)
        | st.dictionaries(
            st.sampled_from(["name", "kind", "points", "radius", "k1", "influence", "arc_degrees"]), inner
        )
    ),
    max_leaves=12,
)


@settings(max_examples=60)
@given(anything | st.lists(st.sampled_from(STORED).flatmap(lambda item: st.fixed_dictionaries(
    {key: st.just(value) | anything for key, value in item.items()})), max_size=3))  # fmt: skip
def test_whatever_a_file_holds_the_answer_is_mappings_or_one_message(data):
    try:
        read = read_mappings(data)
    except PresetError as error:
        assert str(error).startswith("mapping")
    else:
        x, y = image_places(20)
        for one in read:
            image = one.mapping().map(x, y, 1.5)
            assert np.isfinite(image.u[image.mask]).all()
