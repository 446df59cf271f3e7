# SPDX-License-Identifier: GPL-3.0-or-later
"""Input and texture nodes: noise as published, the rest by closed forms."""

import math

import numpy as np
import pytest

from scfpf_addon.casting.common.geometry import Geometry, Layer
from scfpf_addon.shading.nodes import inputs, noise, textures
from scfpf_addon.shading.nodes.context import ShadingContext
from scfpf_addon.shading.nodes.graph import Closure, MaterialGraph, Operation, Ref
from scfpf_addon.shading.nodes.image import ImageData
from scfpf_addon.shading.nodes.operations import OPERATIONS
from scfpf_addon.shading.scene.world import World, WorldContext
from scfpf_addon.shading.vectors import unit

MASK = 0xFFFFFFFF
CORNERS = np.array([[0.0, 0.0, 0.0], [2.0, 0.0, 0.0], [0.0, 2.0, 0.0]])


def column(*values):
    return np.array(values, float).reshape(-1, 1)


def at_triangle(view=(0.0, 0.0, 1.0), back=0.0, layers=None, images=None, count=3):
    """Hits on a triangle in the plane z = 0 whose corners are CORNERS."""
    shares = np.random.default_rng(2).uniform(0.1, 0.4, (2, count))
    one = np.zeros((1, 3, 3), np.float32)
    one[..., 2] = 1.0
    zero = np.zeros(1, np.int32)
    geometry = Geometry(CORNERS, np.array([[0, 1, 2]], np.int32), one, zero, zero, layers=layers or {})
    up = np.repeat(column(0, 0, 1), count, axis=1)
    return ShadingContext(
        geometry,
        images or {},
        np.zeros(count, np.intp),
        shares,
        2.0 * np.vstack([shares, np.zeros(count)]),
        up,
        up,
        np.repeat(unit(column(*view)), count, axis=1),
        np.full((1, count), back),
    )


def jenkins(*keys):
    """The final mix of Bob Jenkins' lookup3, in Python integers."""
    start = (0xDEADBEEF + (len(keys) << 2) + 13) & MASK
    a, b, c = (start + key & MASK for key in (*keys, 0)[:3])

    def turned(word, bits):
        return (word << bits | word >> (32 - bits)) & MASK

    c = ((c ^ b) - turned(b, 14)) & MASK
    a = ((a ^ c) - turned(c, 11)) & MASK
    b = ((b ^ a) - turned(a, 25)) & MASK
    c = ((c ^ b) - turned(b, 16)) & MASK
    a = ((a ^ c) - turned(c, 4)) & MASK
    b = ((b ^ a) - turned(a, 14)) & MASK
    return ((c ^ b) - turned(b, 24)) & MASK


def improved_noise(x, y, z):
    """Perlin's Improving Noise (2002), with Jenkins' hash in place of his table."""
    low = [math.floor(v) for v in (x, y, z)]
    part = [v - f for v, f in zip((x, y, z), low, strict=True)]
    fade = [t * t * t * (t * (t * 6 - 15) + 10) for t in part]
    total = 0.0
    for i in (0, 1):
        for j in (0, 1):
            for k in (0, 1):
                h = jenkins(*((f + d) & MASK for f, d in zip(low, (i, j, k), strict=True))) & 15
                p = [t - d for t, d in zip(part, (i, j, k), strict=True)]
                u = p[0] if h < 8 else p[1]
                v = p[1] if h < 4 else p[0] if h in (12, 14) else p[2]
                value = (-u if h & 1 else u) + (-v if h & 2 else v)
                for f, d in zip(fade, (i, j, k), strict=True):
                    value *= f if d else 1 - f
                total += value
    return total * 0.982


def test_noise_is_the_published_one():
    places = np.random.default_rng(7).uniform(-30, 30, (3, 40))
    np.testing.assert_allclose(noise.perlin(places), [improved_noise(*p) for p in places.T], atol=1e-12)


@pytest.mark.parametrize("count", [2, 3])
def test_noise_is_zero_on_the_lattice_smooth_and_bounded(count):
    whole = np.random.default_rng(7).integers(-50, 50, (count, 100)).astype(float)
    np.testing.assert_array_equal(noise.perlin(whole), 0.0)
    some = np.random.default_rng(8).uniform(-50, 50, (count, 20000))
    values = noise.perlin(some)
    assert 0.7 < np.abs(values).max() <= 1.0 and abs(values.mean()) < 0.02
    # Its slope is the same on either side of a lattice plane.
    edge = some[:, :200].copy()
    edge[0] = np.round(edge[0])
    step = np.zeros((count, 1))
    step[0] = 1e-5
    before, here, after = (noise.perlin(edge + k * step) for k in (-1, 0, 1))
    np.testing.assert_allclose(after - here, here - before, atol=1e-9)


def test_octaves_are_a_sum_and_the_last_counts_by_its_share():
    place = np.random.default_rng(9).uniform(-5, 5, (3, 50))

    def sums(detail, normalise):
        each = (np.full(50, value) for value in (detail, 0.6, 2.1))
        return noise.fractal(place, *each, normalise)

    octaves = [noise.perlin(place * 2.1**k) * 0.6**k for k in range(4)]
    for detail in range(4):
        whole = sum(octaves[: detail + 1])
        np.testing.assert_allclose(sums(float(detail), False), whole, atol=1e-12)
        most = sum(0.6**k for k in range(detail + 1))
        np.testing.assert_allclose(sums(float(detail), True), 0.5 + 0.5 * whole / most, atol=1e-12)
    for normalise in (False, True):
        between = 0.75 * sums(1.0, normalise) + 0.25 * sums(2.0, normalise)
        np.testing.assert_allclose(sums(1.25, normalise), between, atol=1e-12)


@pytest.mark.parametrize("count", [2, 3])
def test_the_noise_node_colours_and_distorts(count):
    vector = np.random.default_rng(3).uniform(-3, 3, (3, 20))
    settings = {"dimensions": count, "normalise": True, "colored": True}

    def made(distortion, **changed):
        values = (column(v) for v in (2.0, 1.0, 0.5, 2.0, distortion))
        return noise.noise((vector, *values), settings | changed, None)

    factor, color = made(0.0)
    each = (np.full(20, v) for v in (1.0, 0.5, 2.0))
    np.testing.assert_array_equal(factor[0], noise.fractal(2.0 * vector[:count], *each, True))
    np.testing.assert_array_equal(color[:1], factor)
    assert np.abs(np.corrcoef(color) - np.eye(3)).max() < 0.7
    np.testing.assert_array_equal(made(0.0, colored=False)[1], np.repeat(factor, 3, axis=0))
    assert np.abs(made(0.5)[0] - factor).max() > 0.01 >= np.abs(made(1e-6)[0] - factor).max()


def test_a_checker_has_two_colours_by_cell():
    places = np.random.default_rng(4).uniform(-3, 3, (3, 200))
    color, factor = textures.checker((places, column(1, 0, 0), column(0, 0, 1), column(2.0)), {}, None)
    odd = np.floor(places * 2.0).sum(axis=0) % 2 == 1
    np.testing.assert_array_equal(factor[0] > 0, odd)
    np.testing.assert_array_equal(color[0] > 0, odd)
    # A face in a plane between cells has one colour.
    flat = np.vstack([places[:2] % 0.5, np.zeros(200)])
    assert (
        len(np.unique(textures.checker((flat, column(1, 0, 0), column(0, 0, 1), column(2.0)), {}, None)[1]))
        == 1
    )


@pytest.mark.parametrize(
    ("kind", "expected"),
    [
        ("LINEAR", lambda x, y, z: x),
        ("QUADRATIC", lambda x, y, z: x * x),
        ("EASING", lambda x, y, z: 3 * x**2 - 2 * x**3),
        ("DIAGONAL", lambda x, y, z: (x + y) / 2),
        ("RADIAL", lambda x, y, z: math.atan2(y, x) / math.tau + 0.5),
        ("SPHERICAL", lambda x, y, z: max(1 - math.hypot(x, y, z), 0)),
        ("QUADRATIC_SPHERE", lambda x, y, z: max(1 - math.hypot(x, y, z), 0) ** 2),
    ],
)
def test_gradients(kind, expected):
    places = np.random.default_rng(4).uniform(0, 0.9, (3, 50))
    color, factor = textures.gradient((places,), {"kind": kind}, None)
    np.testing.assert_allclose(factor[0], [expected(*p) for p in places.T], atol=3e-6)
    np.testing.assert_array_equal(color, np.repeat(factor, 3, axis=0))


def coded(width=64, height=32):
    """An image whose red and green are its coordinates."""
    x, y = np.meshgrid((np.arange(width) + 0.5) / width, (np.arange(height) + 0.5) / height)
    pixels = np.stack([x, y, np.zeros_like(x), np.ones_like(x)], axis=-1).astype(np.float32)
    return ImageData(pixels, False)


def looked_up(operation, vector, projection):
    settings = {"image": "coded", "projection": projection, "interpolation": "Linear", "extension": "EXTEND"}
    made = operation(
        (vector,), settings | {"straight": False}, at_triangle(images={"coded": coded()}, count=1)
    )
    return made[0][:2]


def test_images_lie_flat_round_a_sphere_and_round_a_tube():
    for u, v in ((0.2, 0.3), (0.6, 0.8), (0.9, 0.4)):
        np.testing.assert_allclose(
            looked_up(textures.image, column(u, v, 0.7), "FLAT"), column(u, v), atol=1e-6
        )
        # Half way round from -Y over -X, and from pole to pole, about (1/2, 1/2, 1/2).
        turn, rise = (1 - 2 * u) * math.pi, (v - 0.5) * math.pi
        around = np.array([math.sin(turn), math.cos(turn)])
        ball = 0.5 + 0.5 * np.array([*(0.8 * math.cos(rise) * around), 0.8 * math.sin(rise)])
        np.testing.assert_allclose(
            looked_up(textures.image, column(*ball), "SPHERE"), column(u, v), atol=1e-6
        )
        tube = 0.5 + 0.5 * np.array([*(0.3 * around), 2 * v - 1])
        np.testing.assert_allclose(looked_up(textures.image, column(*tube), "TUBE"), column(u, v), atol=1e-6)


def test_environments_are_panoramas_and_mirror_balls():
    for u, v in ((0.3, 0.4), (0.5, 0.5), (0.7, 0.8)):
        turn, rise = (0.5 - u) * math.tau, (v - 0.5) * math.pi
        way = column(math.cos(turn) * math.cos(rise), math.sin(turn) * math.cos(rise), math.sin(rise))
        np.testing.assert_allclose(
            looked_up(textures.environment, 3.0 * way, "EQUIRECTANGULAR"), column(u, v), atol=1e-6
        )
        # The ball's normal there, and the view from far along -Y mirrored by it.
        x, z = 2 * u - 1, 2 * v - 1
        normal = np.array([x, -math.sqrt(1 - x * x - z * z), z])
        seen = np.array([0.0, 1.0, 0.0])
        mirrored = seen - 2 * (seen @ normal) * normal
        np.testing.assert_allclose(
            looked_up(textures.environment, column(*mirrored), "MIRROR_BALL"), column(u, v), atol=1e-6
        )


def test_layers_are_interpolated_and_missing_ones_are_zero():
    generator = np.random.default_rng(1)
    values = generator.uniform(size=(1, 3, 4)).astype(np.float32)
    layers = {"here": Layer(np.zeros(1, np.int32), values), "not": Layer(np.full(1, -1, np.int32), values)}
    place = at_triangle(layers=layers)
    weights = np.vstack([1 - place.barycentric.sum(axis=0), place.barycentric])
    expected = np.einsum("kc,kn->cn", values[0].astype(float), weights)
    three, number, alpha, there = inputs.layer((), {"name": "here", "channels": 4}, place)
    np.testing.assert_allclose(three, expected[:3])
    np.testing.assert_allclose(number[0], expected[:3].mean(axis=0))
    np.testing.assert_allclose(alpha[0], expected[3])
    assert (there == 1.0).all()
    for name in ("not", "nowhere"):
        three, number, alpha, there = inputs.layer((), {"name": name, "channels": 4}, place)
        assert not three.any() and not number.any() and not there.any() and (alpha == 1.0).all()
    one = inputs.layer((), {"name": "here", "channels": 1}, place)
    np.testing.assert_allclose(one[1][0], expected[0])


def test_inputs_at_a_hit():
    place = at_triangle((0.6, 0.0, 0.8))
    (here,) = inputs.position((), {}, place)
    np.testing.assert_array_equal(here, place.position)
    matrix = np.diag([2.0, 3.0, 4.0, 1.0])
    matrix[:3, 3] = 1, 2, 3
    np.testing.assert_allclose(
        inputs.position((), {"matrix": matrix}, place)[0], (matrix @ [*here, np.ones(3)])[:3]
    )
    normal, flat, view, back = inputs.geometry((), {}, place)
    assert normal is place.normal and flat is place.flat and view is place.view and back is place.back
    assert inputs.normal((), {}, place)[0] is place.normal
    np.testing.assert_allclose(inputs.reflection((), {}, place)[0][:, 0], (-0.6, 0.0, 0.8), atol=1e-15)


@pytest.mark.parametrize("angle", [0.0, 0.5, 1.3])
def test_fresnel_and_layer_weight(angle):
    """Fresnel's equations by the two angles that Snell's law gives."""
    cosine = math.cos(angle)
    for back, ior in ((0.0, 1.5), (1.0, 1.5)):
        place = at_triangle((math.sin(angle), 0.0, cosine), back)
        ratio = 1 / ior if back else ior
        sine = math.sin(angle) / ratio
        if sine >= 1.0:
            expected = 1.0
        else:
            other = math.sqrt(1 - sine * sine)
            s = (cosine - ratio * other) / (cosine + ratio * other)
            p = (ratio * cosine - other) / (ratio * cosine + other)
            expected = (s * s + p * p) / 2
        (found,) = inputs.fresnel((column(ior), place.normal), {}, place)
        np.testing.assert_allclose(found, expected, atol=1e-12)
        blend = 1 - 1 / ior
        layered, _ = inputs.layer_weight((column(blend), place.normal), {}, place)
        np.testing.assert_allclose(layered, expected, atol=1e-12)
    place = at_triangle((math.sin(angle), 0.0, cosine))
    for blend, exponent in ((0.5, 1.0), (0.25, 0.5), (0.75, 2.0)):
        _, facing = inputs.layer_weight((column(blend), place.normal), {}, place)
        np.testing.assert_allclose(facing, 1 - cosine**exponent, atol=1e-12)


def test_normal_maps_turn_normals():
    # Texture coordinates grow along x and y: shares of the edges, and of their normal.
    values = np.zeros((1, 3, 4), np.float32)
    values[..., 0] = values[..., 3] = 1.0
    place = at_triangle(layers={"tangent": Layer(np.zeros(1, np.int32), values)})
    wanted = unit(column(0.3, 0.2, 0.9))
    color = (wanted + 1) / 2
    settings = {"space": "TANGENT", "layer": "tangent"}
    for space in ("TANGENT", "WORLD"):
        (found,) = inputs.normal_map((column(1.0), color), settings | {"space": space}, place)
        np.testing.assert_allclose(found, np.repeat(wanted, 3, axis=1), atol=1e-12, err_msg=space)
        (none,) = inputs.normal_map((column(0.0), color), settings | {"space": space}, place)
        np.testing.assert_allclose(none, place.normal, atol=1e-12)
    (missing,) = inputs.normal_map((column(1.0), color), settings | {"layer": "nowhere"}, place)
    np.testing.assert_allclose(missing, place.normal, atol=1e-12)
    behind = inputs.towards_viewer(column(1.0, 0.0, -0.1), place)
    assert (behind[2] > 0).all() and np.linalg.norm(behind[:, 0]) == pytest.approx(1.0)
    assert inputs.towards_viewer(np.full((3, 3), np.nan), place) == pytest.approx(place.normal)


@pytest.mark.parametrize(("strength", "sign"), [(1.0, 1.0), (1.0, -1.0), (0.5, 1.0), (0.0, 1.0)])
def test_a_bump_tilts_by_the_slope_of_its_height(strength, sign):
    """A height 0.3 x + 0.1 y over the plane z = 0 has the normal (-0.3, -0.1, 1), made unit."""
    height = MaterialGraph(
        (
            Operation("POSITION"),
            Operation("CONSTANT", settings={"value": (0.3, 0.1, 0.0)}),
            Operation("VECTOR_MATH", (Ref(0), Ref(1), Ref(1), Ref(1)), {"operation": "DOT_PRODUCT"}),
        ),
        (),
    )
    place = at_triangle()
    settings = {"height": height, "output": Ref(2, 1), "sign": sign}
    (found,) = OPERATIONS["BUMP"]((column(strength), column(1.0), place.normal), settings, place)
    raised = unit(column(-0.3 * sign, -0.1 * sign, 1.0))
    expected = unit(strength * raised + (1 - strength) * column(0, 0, 1))
    np.testing.assert_allclose(found, np.repeat(expected, 3, axis=1), atol=1e-9)


def test_directions_are_the_inputs_of_worlds():
    way = unit(np.random.default_rng(1).normal(size=(3, 5)))
    place = WorldContext.of(way, {}, 0.0)
    for name in ("GENERATED", "OBJECT"):
        value, there = place.layer(name, 3)
        assert value is way and (there == 1.0).all()
    value, there = place.layer("UVMap", 2)
    assert not value.any() and not there.any()
    np.testing.assert_allclose(place.edge(), 1.0)


@pytest.mark.parametrize("asks", [False, True])
def test_a_world_is_uniform_if_its_emission_depends_on_no_input(asks):
    """A constant colour, or the direction itself; operations without a closure have no effect."""
    operations = (
        Operation("CONSTANT", settings={"value": 2.0}),
        Operation("CONSTANT", settings={"value": (0.1, 0.2, 0.3)}),
        Operation("LAYER", settings={"name": "GENERATED", "channels": 3}),
        Operation("VECTOR_MATH", (Ref(1), Ref(2), Ref(1), Ref(0)), {"operation": "ADD"}),
    )
    world = World(MaterialGraph(operations, (Closure("EMISSION", Ref(0), {"color": Ref(3 if asks else 1)}),)))
    assert world.uniform != asks
    way = unit(np.random.default_rng(1).normal(size=(3, 7)))
    light = world.radiance(5.0 * way)
    expected = 2.0 * (column(0.1, 0.2, 0.3) + asks * way)
    np.testing.assert_allclose(light, np.maximum(expected, 0.0))
