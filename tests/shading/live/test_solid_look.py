# SPDX-License-Identifier: GPL-3.0-or-later
"""The look of live images against closed forms: light, highlights, matcaps, axes, colours and backgrounds."""

from dataclasses import replace

import numpy as np
import pytest

from scfpf_addon.shading.live.background import Background
from scfpf_addon.shading.live.cavity import Cavity
from scfpf_addon.shading.live.live_hits import LiveHits
from scfpf_addon.shading.live.live_textures import LiveTexture, LiveTextures
from scfpf_addon.shading.live.matcap import Matcap
from scfpf_addon.shading.live.solid_look import SolidLook, SurfaceLooks, displayed, paint
from scfpf_addon.shading.live.studio_light import StudioLight, fast_reciprocal
from scfpf_addon.shading.live.view_space import camera_share

# Of a display value; an image of 8 bits has steps of 1/255.
CLOSE = 0.2 / 255
SIZE = 64
BLACK = Background((0.0, 0.0, 0.0))


def srgb(linear):
    """IEC 61966-2-1, written out."""
    linear = np.clip(np.asarray(linear, float), 0, 1)
    return np.where(linear <= 0.0031308, 12.92 * linear, 1.055 * linear ** (1 / 2.4) - 0.055)


def linear(encoded):
    """The inverse of ``srgb``."""
    encoded = np.asarray(encoded, float)
    return np.where(encoded <= 0.04045, encoded / 12.92, ((encoded + 0.055) / 1.055) ** 2.4)


def unit(vectors):
    return vectors / np.linalg.norm(vectors, axis=0)


def image_places(width, height):
    """Positions in [-1, 1] of pixels, row by row from the bottom."""
    x = (np.arange(width) + 0.5) / width * 2 - 1
    y = (np.arange(height) + 0.5) / height * 2 - 1
    across, upward = np.meshgrid(x, y)
    return across.ravel(), upward.ravel()


def hits_of(forward, normal, look=None, right=None, size=(SIZE, SIZE), **more):
    """Hits of given view directions and normals; right is level unless given."""
    count = size[0] * size[1]
    forward = np.broadcast_to(forward, (3, count))
    if right is None:
        right = np.stack([-forward[2], np.zeros(count), forward[0]])
        right = unit(right)
    up = np.cross(right, forward, axis=0)
    look = np.zeros(count, np.int32) if look is None else look.astype(np.int32)

    def single(values):
        return np.ascontiguousarray(np.broadcast_to(values, (3, count)), np.float32)

    made = LiveHits(
        width=size[0],
        height=size[1],
        mask=np.ones(count, bool),
        look=look,
        object=look.copy(),
        t=np.ones(count, np.float32),
        position=single(forward),
        forward=single(forward),
        right=single(right),
        up=single(up),
        is_mirrored=np.zeros(count, bool),
        normal=single(normal),
    )
    return made._replace(**more)


def looks(color=((0.8, 0.8, 0.8),), metallic=0.0, roughness=0.4, alpha=1.0, image=-1, attribute=False):
    count = len(color)
    return SurfaceLooks(
        color=np.array(color, np.float32).T.copy(),
        metallic=np.full(count, metallic, np.float32),
        roughness=np.full(count, roughness, np.float32),
        alpha=np.full(count, alpha, np.float32),
        image=np.broadcast_to(image, count).copy(),
        uses_attribute=np.full(count, attribute),
    )


def solid(light=None, highlights=False, surfaces=None, background=BLACK, **more):
    return SolidLook(light, highlights, surfaces or looks(), background, **more)


def lamp(direction, diffuse=1.0, specular=0.0, wrap=0.0, ambient=0.0, **more):
    def color(value):
        return np.full((3, 1), value, np.float32)

    return StudioLight(
        unit(np.array(direction, np.float32))[:, None],
        color(diffuse),
        color(specular),
        np.array([wrap], np.float32),
        np.full(3, ambient, np.float32),
        **more,
    )


def ball():
    """The visible half of a unit ball from the front in parallel projection; misses around it."""
    x, y = image_places(SIZE, SIZE)
    inside = x * x + y * y < 1
    z = np.sqrt(np.where(inside, 1 - x * x - y * y, 0))
    return hits_of(np.array([[0.0], [0], [-1]]), np.stack([x, y, z]), np.where(inside, 0, -1)), inside


@pytest.mark.parametrize("wrap", [0.0, 0.3, 1.0])
def test_a_ball_is_lit_around_its_border(wrap):
    """Wrapped light is linear in the cosine: 0 where it is -wrap, full at 1 but for the fast reciprocal."""
    hits, inside = ball()
    direction = unit(np.array([0.4, 0.5, 0.6]))
    image = paint(hits, solid(lamp(direction, 0.5, wrap=wrap)))
    cosine = direction @ hits.normal.astype(float)
    exact = np.clip((cosine + wrap) / (1 + wrap) ** 2, 0, 1)
    scale = float(fast_reciprocal(np.float32((1 + wrap) ** 2)[None])[0]) * (1 + wrap) ** 2
    assert abs(scale - 1) < 0.13
    expected = srgb(0.8 * 0.5 * exact * scale)
    assert np.abs(image[..., 0].ravel() - expected)[inside].max() < CLOSE
    assert (image[..., :3].reshape(-1, 3)[~inside] == 0).all() and (image[..., 3] == 1).all()


def test_a_highlight_is_where_the_half_vector_is():
    """The brightest pixel of a shiny ball has its normal between the lamp and the viewer."""
    hits, _ = ball()
    direction = unit(np.array([0.5, 0.3, 0.7]))
    surfaces = looks(color=((0.0, 0.0, 0.0),), roughness=0.1)
    image = paint(hits, solid(lamp(direction, 0.0, 0.3), True, surfaces))
    brightest = hits.normal[:, image[..., 0].argmax()]
    half = unit(direction + np.array([0, 0, 1]))
    assert np.degrees(np.arccos(brightest @ half)) < 2.5


def test_metal_reflects_its_colour_and_has_no_diffuse_light():
    hits, _ = ball()
    surfaces = looks(color=((1.0, 0.5, 0.0),), metallic=1.0, roughness=1.0)
    middle = SIZE // 2, SIZE // 2
    image = paint(hits, solid(lamp((0, 0, 1), 5.0), True, surfaces))
    assert (image[middle][:3] < 0.02).all()
    image = paint(hits, solid(lamp((0, 0, 1), 0.0, ambient=0.5), True, surfaces))
    assert np.abs(image[middle][:3] - srgb([0.5, 0.25, 0.0])).max() < 0.02


def test_a_matcap_is_looked_up_by_the_normal():
    """A matcap that holds its own positions: n = (x, y) is 0.496 from the middle at the ball's rim."""
    hits, inside = ball()
    place = (np.arange(256, dtype=np.float32) + 0.5) / 256
    u, v = np.meshgrid(place, place)
    own = np.stack([u, v, 0 * u], axis=2)
    white = looks(color=((1.0, 1.0, 1.0),))
    for flip in (False, True):
        image = paint(hits, solid(Matcap(own, is_flipped=flip), surfaces=white)).reshape(-1, 4)
        x, y = hits.normal[0] * (-1 if flip else 1), hits.normal[1]
        for channel, value in enumerate((x, y)):
            expected = srgb(0.5 + 0.496 * value)
            assert np.abs(image[:, channel] - expected)[inside].max() < 2 * CLOSE


def test_a_matcap_shows_its_middle_wherever_a_surface_faces_the_viewer():
    x, y = image_places(SIZE, SIZE)
    forward = unit(np.stack([x, 0.6 * y, np.full_like(x, -1.0)]))
    bright = np.zeros((65, 65, 3), np.float32)
    bright[31:34, 31:34] = 1
    hits = hits_of(forward, -forward)
    image = paint(hits, solid(Matcap(bright), surfaces=looks(((1.0, 1, 1),)), camera_axes=np.eye(3)))
    assert (image[..., :3] > 0.99).all()


def test_matcap_highlights_are_added_if_they_are_on():
    hits, inside = ball()
    dark, half = np.zeros((4, 4, 3), np.float32), np.full((4, 4, 3), 0.25, np.float32)
    for highlights in (False, True):
        image = paint(hits, solid(Matcap(dark, half), highlights))[..., 0].ravel()[inside]
        assert np.abs(image - srgb(0.25 * highlights)).max() < CLOSE


def panorama():
    """Projectors all round, with surfaces turned by 30° to the right of the viewer everywhere."""
    x, _ = image_places(SIZE, SIZE)
    angle = np.pi * x
    zero = np.zeros_like(angle)
    forward = np.stack([np.sin(angle), zero, -np.cos(angle)])
    right = np.stack([np.cos(angle), zero, np.sin(angle)])
    normal = np.cos(np.pi / 6) * -forward + np.sin(np.pi / 6) * right
    return hits_of(forward, normal, right=right)


def test_a_panorama_is_lit_alike_all_round():
    hits = panorama()
    look = solid(lamp((0.5, 0.3, 0.7), 0.6, 0.2), True, camera_axes=np.eye(3))
    assert camera_share(hits, np.eye(3)) == 0
    image = paint(hits, look)[..., 0]
    assert image.min() > 0.3 and np.ptp(image) < CLOSE


def test_light_in_world_space_depends_on_the_normal_alone():
    hits = panorama()
    image = paint(hits, solid(lamp((1.0, 0, 0), 0.7, in_world=True), camera_axes=np.eye(3)))[..., 0]
    scale = float(fast_reciprocal(np.ones(1, np.float32))[0])
    expected = srgb(0.8 * 0.7 * scale * np.clip(hits.normal[0], 0, 1))
    assert np.abs(image.ravel() - expected).max() < CLOSE


def test_a_perspective_is_lit_from_the_cameras_axes():
    """A wall square to the axis of a turned camera has one normal, so one colour, in all of the image."""
    turn = np.linalg.qr(np.random.default_rng(3).normal(size=(3, 3)))[0]
    turn *= np.linalg.det(turn)
    x, y = image_places(SIZE, SIZE)
    forward = turn @ unit(np.stack([0.8 * x, 0.6 * y, np.full_like(x, -1.0)]))
    hits = hits_of(forward, turn[:, 2:], right=unit(np.cross(forward, turn[:, 1:2], axis=0)))
    assert camera_share(hits, turn) == 1
    assert np.ptp(paint(hits, solid(lamp((0.5, 0.3, 0.7), 0.6), camera_axes=turn))[..., 0]) < CLOSE
    assert np.ptp(paint(hits, solid(lamp((0.5, 0.3, 0.7), 0.6)))[..., 0]) > 0.1


def test_bending_changes_the_light_step_by_step():
    """From a perspective to projectors turned by 12°, the share of the camera's axes falls without a jump."""
    x, y = image_places(SIZE, SIZE)
    shares = []
    for bend in np.linspace(0, np.radians(12), 25):
        angle = bend * np.sin(2 * np.pi * x)
        base = np.arctan(0.5 * x) + angle
        forward = unit(np.stack([np.tan(base), 0.4 * y, np.full_like(x, -1.0)]))
        shares.append(camera_share(hits_of(forward, -forward), np.eye(3)))
    assert shares[0] == 1 and shares[-1] == 0 and (np.diff(shares) <= 0).all()
    assert np.abs(np.diff(shares)).max() < 0.12


def test_display_values_are_those_of_srgb():
    linear = np.linspace(-0.1, 1.2, 100_001).astype(np.float32)
    assert np.abs(displayed(linear.copy()) - srgb(linear)).max() < CLOSE


def test_flat_colours_come_from_rows_attributes_and_images():
    x, _ = image_places(SIZE, SIZE)
    row = np.digitize(x, [-0.5, 0.0, 0.5])
    count = len(x)
    attribute = np.broadcast_to(np.array([[0.2], [0.4], [0.6]], np.float32), (3, count))
    textures = LiveTextures.of([LiveTexture(np.full((8, 8, 4), (0.1, 0.5, 0.9, 1), np.float32))])
    surfaces = replace(
        looks(((1.0, 0, 0), (0.0, 1, 0), (0.0, 0, 1), (0.5, 0.5, 0.5))),
        image=np.array([-1, -1, -1, 0]),
        uses_attribute=np.array([False, True, False, False]),
    )
    uv = np.random.default_rng(1).random((2, count), dtype=np.float32)
    hits = hits_of(np.array([[0.0], [0], [-1]]), np.array([[0.0], [0], [1]]), row, uv=uv, color=attribute)
    image = paint(hits, solid(None, surfaces=surfaces, textures=textures)).reshape(-1, 4)
    for number, linear in enumerate(((1, 0, 0), (0.2, 0.4, 0.6), (0, 0, 1), (0.1, 0.5, 0.9))):
        assert np.abs(image[row == number, :3] - srgb(linear)).max() < CLOSE


def test_transparent_surfaces_are_mixed_with_the_background_in_linear_light():
    hits, inside = ball()
    look = solid(None, surfaces=looks(((1.0, 0, 0),), alpha=0.25), background=Background((1.0, 1.0, 1.0)))
    image = paint(hits, look).reshape(-1, 4)
    assert np.abs(image[inside, :3] - srgb([1.0, 0.75, 0.75])).max() < 2 * CLOSE
    assert (image[:, 3] == 1).all()


def test_gradients_go_from_one_colour_to_the_other():
    x, y = image_places(SIZE, SIZE)
    hits = hits_of(np.array([[0.0], [0], [-1]]), np.zeros((3, 1)), np.full(SIZE * SIZE, -1))
    ends = {"color": (0.9, 0.5, 0.1), "other": (0.1, 0.5, 0.9)}
    image = paint(hits, solid(background=Background(**ends, gradient="LINEAR")))
    # Blender encodes what is not a surface by a power of 1/2.2.
    top, bottom = (linear(ends[name]) ** (1 / 2.2) for name in ("color", "other"))
    assert np.abs(image[-1, 0, :3] - top).max() < 0.01
    assert np.abs(image[0, 0, :3] - bottom).max() < 0.01
    assert (np.diff(image[:, 5, 0]) > 0).all()
    # The lower half of the viewport holds the lower half of the gradient.
    low = paint(hits, solid(background=Background(**ends, gradient="LINEAR", area=(0, 0, 1, 0.5))))
    assert np.abs(low[-1, 0, :3] - image[SIZE // 2, 0, :3]).max() < 0.02
    radial = paint(hits, solid(background=Background(**ends, gradient="RADIAL")))[..., 0].ravel()
    order = np.argsort(np.hypot(x, y))
    assert (np.diff(radial[order]) < 1e-5).all() and radial.max() > 0.88 and radial.min() < 0.16


def test_a_groove_is_dark_and_a_ridge_bright():
    """A roof with a ridge on the left and a valley on the right, seen from the front."""
    x, _ = image_places(SIZE, SIZE)
    slope = np.where(np.abs(x) < 0.5, 0.3, -0.3)
    normal = unit(np.stack([slope, np.zeros_like(x), np.ones_like(x)]))
    hits = hits_of(np.array([[0.0], [0], [-1]]), normal)
    plain = paint(hits, solid())[5, :, 0]
    image = paint(hits, solid(cavity=Cavity(1.0, 1.0)))[5, :, 0]
    ridge, valley = int(SIZE * 0.25), int(SIZE * 0.75)
    assert (image[ridge - 1 : ridge + 1] > plain[0] + 0.05).all()
    assert (image[valley - 1 : valley + 1] < plain[0] - 0.05).all()
    beside = np.delete(image, [ridge - 1, ridge, valley - 1, valley])
    assert np.abs(beside - plain[0]).max() < CLOSE
