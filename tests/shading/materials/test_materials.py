# SPDX-License-Identifier: GPL-3.0-or-later
"""Material graphs without Blender: images, layers, transparency and refraction."""

from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from scfpf_addon.casting.cast import cast
from scfpf_addon.casting.common.geometry import Geometry, Layer
from scfpf_addon.casting.continuation import TileProjectors
from scfpf_addon.casting.scene.cast_scene import CastScene
from scfpf_addon.projection.colors import linear_from_srgb
from scfpf_addon.projection.surfaces.surface import Plane
from scfpf_addon.projection.volume.viewing_volume import Projection, ViewingVolume
from scfpf_addon.shading.frame import render_frame
from scfpf_addon.shading.materials.constants import Materials
from scfpf_addon.shading.nodes.context import ShadingContext
from scfpf_addon.shading.nodes.graph import Closure, MaterialGraph, Operation, Ref
from scfpf_addon.shading.nodes.image import MISSING, ImageData, sample
from scfpf_addon.shading.nodes.inputs import fresnel_dielectric
from scfpf_addon.shading.scene.shading_scene import LightPaths, Scene
from scfpf_addon.shading.settings.frame_settings import FrameSettings
from scfpf_addon.shading.tracing.lobe_sampling import mirrored, refracted


def plane_at(z, size):
    matrix = np.eye(4)
    matrix[2, 3] = z
    return Plane(width=size, height=size, matrix=matrix)


def sheets(*heights):
    """A square over [-2, 2]² at each height, one material each."""
    corners = np.array([[-2.0, -2], [2, -2], [2, 2], [-2, 2]])
    vertices = np.concatenate([np.column_stack([corners, np.full(4, z)]) for z in heights])
    triangles = np.concatenate([np.array([[0, 1, 2], [0, 2, 3]]) + 4 * k for k in range(len(heights))])
    number = np.repeat(np.arange(len(heights)), 2).astype(np.int32)
    up = np.tile(np.array([0, 0, 1], np.float32), (len(triangles), 3, 1))
    return Geometry(vertices, triangles.astype(np.int32), up, number, number)


def bent(degree):
    """Projectors that start at z = 3 and end at z = -3, bent along x."""
    shifts = np.sin(np.arange(degree + 1) * 2.0) * (np.arange(degree + 1) > 0)
    surfaces = []
    for k, shift in enumerate(shifts):
        matrix = np.eye(4)
        matrix[:3, 3] = shift, 0, 3 - 6 * k / degree
        surfaces.append(Plane(width=1.0 + 0.2 * k, height=1.0 + 0.2 * k, matrix=matrix))
    return Projection(ViewingVolume(tuple(surfaces)), aspect=1)


def constant(*value):
    return Operation("CONSTANT", (), {"value": np.array(value, float)})


def clear(color, glow=(0.0, 0.0, 0.0)):
    """A transparent surface of a colour that also emits."""
    operations = (constant(1.0), constant(*color), constant(*glow), Operation("NORMAL"))
    through = Closure("TRANSPARENT", Ref(0), {"color": Ref(1), "normal": Ref(3)})
    return MaterialGraph(
        operations, (through, Closure("EMISSION", Ref(0), {"color": Ref(2), "normal": Ref(3)}))
    )


def constants(count, emission=(0.0, 0.0, 0.0), graphs=None):
    return Materials(
        np.zeros((count, 3)),
        np.zeros(count),
        np.ones(count),
        np.zeros(count),
        np.tile(np.asarray(emission, float), (count, 1)),
        graphs=graphs or {},
    )


@pytest.mark.parametrize("degree, pixel_error", [(1, 0.1), (2, 0.1), (3, 0.1), (1, 0.0), (3, 0.0)])
def test_next_hits_on_a_projector_lie_at_the_known_heights(degree, pixel_error):
    """Control surfaces at even heights make z linear in t: each sheet is hit at a known t."""
    heights = [1.7, 0.4, 0.3, -1.0, -2.6]
    geometry, projection = sheets(*heights), bent(degree)
    scene = CastScene(geometry.vertices, geometry.triangles)
    inside = projection.transformed(scene.matrix)
    x, y = (a.ravel() for a in np.meshgrid((np.arange(12) + 0.5) / 12, (np.arange(12) + 0.5) / 12))
    pixel = (1 / 12, 1 / 12)
    hits = cast(scene, inside, x, y, pixel, pixel_error, columns=12)
    projectors = TileProjectors(scene, inside, x, y, hits.mask, pixel, pixel_error)
    which = np.arange(len(x))
    for number, z in enumerate(heights):
        assert (geometry.material[hits.triangle] == number).all()
        assert np.abs(hits.t - (3 - z) / 6).max() < 1e-9
        hits = projectors.next_hits(which, hits.t, hits.triangle)
    assert (hits.triangle < 0).all()


@pytest.mark.parametrize("degree", [1, 3])
@pytest.mark.parametrize("transparent", [False, True])
def test_light_through_sheets_is_the_sum_of_their_emission(degree, transparent):
    """Three panes before a glowing ground, which ends half way across the image."""
    geometry = sheets(1.5, 1.0, 0.5, -1.0)
    middle = {1: 0.6, 3: 0.0}[degree]
    geometry.vertices[12:, 0] = np.where(geometry.vertices[12:, 0] > 0, 2.0, middle)
    panes = {
        0: ((0.5, 0.7, 0.9), (0.1, 0, 0)),
        1: ((0.8, 0.8, 0.4), (0, 0.2, 0)),
        2: ((0.6, 1, 1), (0, 0, 0.3)),
    }
    graphs = {number: clear(*pane) for number, pane in panes.items()}
    materials = constants(4, (0.4, 0.5, 0.6), graphs)
    world = np.array([0.3, 0.2, 0.1])
    scene = Scene(geometry, materials, world_color=world)
    settings = FrameSettings(16, 16, samples=1, transparent=transparent)
    pixels = render_frame(bent(degree), scene, settings).pixels
    glow, share = np.zeros(3), np.ones(3)
    for color, light in panes.values():
        glow, share = glow + share * light, share * color
    ground = glow + share * (0.4, 0.5, 0.6)
    empty = glow if transparent else glow + share * world
    alpha = 1 - share.mean() if transparent else 1.0
    expected = np.array([[*ground, 1.0], [*empty, alpha]])
    difference = np.abs(pixels[:, :, None] - expected).max(axis=3)
    assert difference.min(axis=2).max() < 1e-6
    assert (difference.argmin(axis=2) == 0).any() and (difference.argmin(axis=2) == 1).any()


@pytest.mark.parametrize("limit, seen", [(3, True), (2, True), (1, False)])
def test_light_ends_at_the_limit(limit, seen):
    graphs = {number: clear((1, 1, 1)) for number in range(3)}
    scene = Scene(
        sheets(1.5, 1.0, 0.5, -1.0), constants(4, (1, 1, 1), graphs), bounces=LightPaths(transparent=limit)
    )
    pixels = render_frame(bent(1), scene, FrameSettings(4, 4, samples=1)).pixels
    assert (pixels[..., :3] == (1.0 if seen else 0.0)).all() and (pixels[..., 3] == 1).all()


def test_a_layer_is_interpolated_in_float64_on_the_hit_triangle():
    """Coordinates of a large plane: x and y of the hit to 1e-12 of its size, though stored in float32."""
    geometry = sheets(0.0)
    corners = geometry.vertices[geometry.triangles].astype(np.float32)
    layers = {"UV:": Layer(np.arange(2, dtype=np.int32), corners[:, :, :2].copy())}
    geometry = replace(geometry, layers=layers)
    scene = CastScene(geometry.vertices, geometry.triangles)
    projection = bent(1).transformed(scene.matrix)
    x, y = np.random.default_rng(0).random((2, 500))
    hits = cast(scene, projection, x, y, (0.1, 0.1))
    nothing = np.zeros((3, 500))
    place = ShadingContext(
        geometry, {}, hits.triangle, hits.barycentric, nothing, nothing, nothing, nothing, nothing[:1]
    )
    found, there = place.layer("UV:", 3)
    world = hits.position / scene.scale + scene.centre[:, None]
    assert np.abs(found[:2] - world[:2]).max() < 1e-12 and there.all()
    missing, there = place.layer("UV:Other", 3)
    assert not missing.any() and not there.any()


IMAGE = np.random.default_rng(5).random((5, 7, 4)).astype(np.float32)


@given(st.integers(-20, 20), st.integers(-20, 20))
def test_texel_centres_are_the_texels_by_any_extension(column, row):
    u, v = np.array([(column + 0.5) / 7]), np.array([(row + 0.5) / 5])
    image = ImageData(IMAGE, False)
    turn = {
        "REPEAT": (column % 7, row % 5),
        "EXTEND": (min(max(column, 0), 6), min(max(row, 0), 4)),
        "MIRROR": (min(column % 14, 13 - column % 14), min(row % 10, 9 - row % 10)),
    }
    for extension, (i, j) in turn.items():
        for interpolation in ("Linear", "Closest"):
            found = sample(image, u, v, interpolation, extension, False)
            assert found[:, 0] == pytest.approx(IMAGE[j, i], abs=1e-6)
    inside = 0 <= column < 7 and 0 <= row < 5
    found = sample(image, u, v, "Closest", "CLIP", False)
    assert found[:, 0] == pytest.approx(IMAGE[row, column] if inside else np.zeros(4))


@given(st.floats(-3, 3), st.floats(-3, 3))
def test_interpolation_reproduces_a_plane(u, v):
    """Linear and cubic interpolation both reproduce linear functions."""
    y, x = np.mgrid[:60, :60]
    ramp = np.stack([x, y, x + y, x - y], -1).astype(np.float32)
    at = np.array([20 + 5 * u]), np.array([30 + 5 * v])
    expected = [at[0][0] - 0.5, at[1][0] - 0.5, at[0][0] + at[1][0] - 1, at[0][0] - at[1][0]]
    for interpolation in ("Linear", "Cubic"):
        found = sample(ImageData(ramp, False), at[0] / 60, at[1] / 60, interpolation, "EXTEND", False)
        assert found[:, 0] == pytest.approx(expected, abs=1e-4)


def test_bytes_are_decoded_after_interpolation_and_missing_images_are_magenta():
    bytes_image = ImageData(np.array([[[0, 128, 255, 255], [255, 128, 0, 255]]], np.uint8), True)
    half = np.array([0.5]), np.array([0.5])
    found = sample(bytes_image, *half, "Linear", "EXTEND", False)
    assert found[:, 0] == pytest.approx([*linear_from_srgb(np.array([0.5, 128 / 255, 0.5])), 1.0])
    assert sample(None, *half, "Linear", "EXTEND", False)[:, 0] == pytest.approx(MISSING)
    lost = np.array([np.nan]), np.array([np.inf])
    assert np.isfinite(sample(bytes_image, *lost, "Cubic", "REPEAT", True)).all()


@given(st.floats(0.01, 1.5), st.floats(1.05, 3.0))
def test_light_bends_by_snells_law_and_its_shares_are_fresnels(angle, ior):
    ahead = np.array([[np.sin(angle)], [0.0], [-np.cos(angle)]])
    normal = np.array([[0.0], [0.0], [1.0]])
    bent_way = refracted(ahead, normal, normal, np.array([[ior]]))
    assert bent_way[0, 0] * ior == pytest.approx(np.sin(angle), abs=1e-12)
    assert mirrored(ahead, normal, normal)[:, 0] == pytest.approx([np.sin(angle), 0, np.cos(angle)])
    # Polarised shares from the two angles.
    inside = np.arcsin(np.sin(angle) / ior)
    s = (np.sin(angle - inside) / np.sin(angle + inside)) ** 2
    p = (np.tan(angle - inside) / np.tan(angle + inside)) ** 2
    share = fresnel_dielectric(np.array([[np.cos(angle)]]), np.array([[ior]]))
    assert share[0, 0] == pytest.approx((s + p) / 2, rel=1e-9)
