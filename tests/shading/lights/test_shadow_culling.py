# SPDX-License-Identifier: GPL-3.0-or-later
"""Shadow culling changes no image: culled triangles cast no visible shadow."""

from dataclasses import replace
from itertools import combinations

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from scfpf_addon.casting.common.ray_visibility import CATCHER, EVERYWHERE
from scfpf_addon.casting.scene.cast_scene import CastScene
from scfpf_addon.casting.scene.culling import within_volume
from scfpf_addon.casting.scene.half_spaces import MOST_PLANES, SAMPLES, WORTH
from scfpf_addon.projection.surfaces.surface import Plane
from scfpf_addon.projection.volume.viewing_volume import ViewingVolume
from scfpf_addon.shading.frame import render_frame
from scfpf_addon.shading.lights.shadow_culling import cull_shadow_casters
from scfpf_addon.shading.sampling.sample_sets import BALL_REACH, lamp_positions
from scfpf_addon.shading.scene.shading_scene import Light
from scfpf_addon.shading.settings.frame_settings import FrameSettings

POWER = np.full(3, 3.0)
LAMPS = {
    "sun": lambda build: Light("SUN", POWER, build.placed(shines=(0.9, 0.4, -1))),
    "wide sun": lambda build: Light("SUN", POWER, build.placed(shines=(0.5, 0.2, -1)), angle=0.3),
    "point": lambda build: Light("POINT", 200 * POWER, build.placed((-3, 1, 4)), radius=0.4),
    "area": lambda build: Light("AREA", 200 * POWER, build.placed((2, -2, 5)), size=(1.5, 0.7)),
    "sphere": lambda build: Light("POINT", 200 * POWER, build.placed((-3, 1, 4)), radius=0.9, sphere=True),
    "beam": lambda build: Light(
        "AREA", 200 * POWER, build.placed((2, -2, 5), (-2, 2, -5)), size=(2.0, 1.5), spread=1.2
    ),
}


def scattered(build, lights, smooth):
    """Balls all around a ground that continues beyond the image."""
    generator = np.random.default_rng(4)
    places = generator.uniform((-6, -6, -0.5), (6, 6, 3.5), (150, 3))
    balls = [build.sphere(5, place, 0.35) for place in places]
    if not smooth:
        balls = [(vertices, faces, None) for vertices, faces, _ in balls]
    return build.scene([build.square(8, -0.8), *balls], lights, (0.1, 0.1, 0.1))


@pytest.mark.parametrize(
    ("lamp", "heights", "smooth"),
    [(lamp, (3, -1), smooth) for lamp in LAMPS for smooth in (False, True)] + [("sun", (3, 1, -1), True)],
)
def test_images_are_those_of_the_whole_scene(build, lamp, heights, smooth):
    scene = scattered(build, [LAMPS[lamp](build)], smooth)
    view = build.looking_down(*heights, size=1.8, shifts=np.linspace(0.0, 1.0, len(heights)).tolist())
    settings = FrameSettings(32, 32, samples=2)
    geometry = scene.geometry
    shown = within_volume(geometry.vertices, geometry.triangles, view.volume)
    shading = cull_shadow_casters(scene, geometry.part(shown), view.volume) & ~shown
    # Fewer than the invisible triangles, but some.
    assert 0.005 < shading.mean() < 0.6 * (1 - shown.mean())
    made = render_frame(view, scene, settings).pixels
    whole = render_frame(view, scene, settings, CastScene(geometry.vertices, geometry.triangles)).pixels
    assert np.abs(made - whole).max() < 1e-4
    alone = replace(scene, geometry=geometry.part(shown))
    assert np.abs(render_frame(view, alone, settings).pixels - whole).max() > 0.1


def test_everything_above_may_shadow_a_sun_of_half_a_turn(build):
    """Blender's largest angle, as float32 larger than half a turn."""
    for angle in (3.0, np.pi, float(np.float32(np.pi))):
        sun = Light("SUN", POWER, build.placed(), angle=angle)
        scene = build.scene([build.square(1), build.square(1, 5.0, (9, 0))], [sun])
        shown = scene.geometry.part(np.array([True, True, False, False]))
        assert cull_shadow_casters(scene, shown, build.looking_down(2, -1).volume)[2:].all()


@pytest.mark.parametrize("length", [1 - 4e-4, 1.0, 1 + 4e-4])
def test_axes_of_a_sun_may_be_a_little_too_long(build, length):
    """Far from the origin, where heights along a longer axis differ."""
    matrix = np.diag([length, length, length, 1.0])
    scene = build.scene(
        [build.square(1, 1e5), build.square(1, 1e5 + 50.0, (20, 0))], [Light("SUN", POWER, matrix, angle=1.2)]
    )
    shown = scene.geometry.part(np.array([True, True, False, False]))
    assert cull_shadow_casters(scene, shown, build.looking_down(1e5 + 2, 1e5 - 1).volume)[2:].all()


def test_all_places_of_round_lamps_are_in_the_hull(build):
    """A speck just before the lamp's farthest place, towards a volume that begins inside the lamp."""
    for samples in range(1, 200):
        assert np.linalg.norm(lamp_positions(samples, "BALL"), axis=0).max() < BALL_REACH
    farthest = max(lamp_positions(159, "BALL").T, key=lambda place: place @ place)
    shown = build.square(1)[0] - 2.0 * farthest, build.square(1)[1], None
    speck = farthest + 1e-4 * (np.eye(3) - 1.0), [[0, 1, 2]], None
    scene = build.scene([shown, speck], [Light("POINT", POWER, build.placed(), radius=1.0)])
    volume = ViewingVolume(
        tuple(Plane(matrix=build.placed(-ahead * farthest, shines=-farthest)) for ahead in (0.0, 3.0))
    )
    assert cull_shadow_casters(scene, scene.geometry.part(np.array([True, True, False])), volume)[2]


def test_everything_may_shadow_the_sky(build):
    scene = replace(scattered(build, [], False), world=object())
    shown = scene.geometry.part(np.arange(len(scene.geometry.triangles)) == 0)
    assert cull_shadow_casters(scene, shown, build.looking_down(2, -1).volume).all()


def test_everything_may_shadow_a_catcher_under_a_uniform_environment(build):
    """A uniform environment casts shadows on catchers alone."""
    scene = build.scene([build.square(), build.square(0.2, 9.0, (5, 5))], world=(0.1, 0.1, 0.1))
    shown, volume = np.array([True, True, False, False]), build.looking_down(1, -1).volume
    assert not cull_shadow_casters(scene, scene.geometry.part(shown), volume)[2:].any()
    visibility = np.array([EVERYWHERE | CATCHER] * 2 + [EVERYWHERE] * 2, np.uint8)
    caught = replace(scene, geometry=replace(scene.geometry, visibility=visibility))
    assert cull_shadow_casters(caught, caught.geometry.part(shown), volume).all()


def frustum(generator):
    """A volume between two level rectangles, turned at random, and its eight corners, (8, 3)."""
    turn = np.eye(4)
    turn[:3, :3] = np.linalg.qr(generator.normal(size=(3, 3)))[0]
    sizes, far = generator.uniform(0.2, 3.0, (2, 2)), np.eye(4)
    far[:3, 3] = *generator.uniform(-1.0, 1.0, 2), -generator.uniform(1.0, 6.0)
    surfaces = Plane(*sizes[0], matrix=turn), Plane(*sizes[1], matrix=turn @ far)
    around = np.array([0.0, 1, 1, 0]), np.array([0.0, 0, 1, 1])
    corners = np.concatenate([surface.positions(*around).position.T for surface in surfaces])
    return ViewingVolume(surfaces), corners


def planes_round(corners):
    """Normals (K, 3) and limits (K,) of the planes through three points with the others behind them."""
    normals, limits = [], []
    for a, b, c in combinations(corners, 3):
        normal = np.cross(b - a, c - a)
        for sign in (1.0, -1.0):
            if np.linalg.norm(normal) > 1e-6:
                unit = sign * normal / np.linalg.norm(normal)
                if (corners @ unit).max() < a @ unit + 1e-9:
                    normals.append(unit)
                    limits.append(a @ unit)
    return np.array(normals), np.array(limits)


def towards_it(places, corners, towards, apart):
    """Return whether a ray away from a sun meets the hull of the corners, widened by ``apart``, (N,)."""
    normals, limits = planes_round(corners)
    along = normals @ towards
    # normal · (place - t towards) <= limit, for a t that is not negative.
    over = places @ normals.T - limits - apart
    with np.errstate(divide="ignore", invalid="ignore"):
        t = over / along
    soonest = np.where(along > 1e-12, t, 0.0).max(axis=1, initial=0.0)
    latest = np.where(along < -1e-12, t, np.inf).min(axis=1)
    beside = ((np.abs(along) <= 1e-12) & (over > 0.0)).any(axis=1)
    return (soonest <= latest) & ~beside


@given(st.integers(0, 2**32 - 1), st.sampled_from([500, 3 * SAMPLES + 7]))
@settings(deadline=None, max_examples=60)
def test_triangles_between_a_sun_and_a_volume_are_kept(build, seed, count):
    """Specks all around, compared with rays of light against the planes of the volume's hull."""
    generator = np.random.default_rng(seed)
    volume, corners = frustum(generator)
    shines = generator.normal(size=3)
    towards = -shines / np.linalg.norm(shines)
    places = generator.uniform(-9.0, 9.0, (count, 3))
    vertices = (places[:, None] + 1e-7 * generator.normal(size=(3, 3))).reshape(-1, 3)
    specks = vertices, np.arange(3 * count).reshape(-1, 3), None
    scene = build.scene([specks], [Light("SUN", POWER, build.placed(shines=shines))])
    # The visible geometry reaches beyond the volume.
    shown = build.scene([build.square(30.0, height) for height in (-30.0, 30.0)]).geometry
    found = cull_shadow_casters(scene, shown, volume)
    assert found[towards_it(places, corners, towards, -1e-6)].all()
    extra = found & ~towards_it(places, corners, towards, 0.02)
    # Of many triangles, planes that cull almost none are not tested.
    assert extra.sum() <= (0 if count < SAMPLES else MOST_PLANES * WORTH * count)
