# SPDX-License-Identifier: GPL-3.0-or-later
"""Ray visibility: the parts of a scene that are built, and images as if the rest did not exist."""

from dataclasses import replace

import numpy as np
import pytest

from scfpf_addon.casting.common.ray_visibility import CAMERA, EVERYWHERE, HOLDOUT, SHADOW, visible_to
from scfpf_addon.casting.scene.cast_scene import CastScene
from scfpf_addon.shading.frame import render_frame
from scfpf_addon.shading.lights.scene_culling import cull_scene
from scfpf_addon.shading.picking.pick import pick
from scfpf_addon.shading.scene.shading_scene import Light
from scfpf_addon.shading.settings.frame_settings import FrameSettings
from scfpf_addon.shading.tracing.hit_colors import Shading


def ball_over_ground(build, rays, lights=()):
    """A ball visible to ``rays`` over a ground visible to all."""
    scene = build.scene([build.square(1.5, -0.8), build.sphere(8, radius=0.5)], lights, (0.2, 0.3, 0.4))
    ball = scene.geometry.object_index == 1
    seen = np.where(ball, rays, EVERYWHERE).astype(np.uint8)
    return replace(scene, geometry=replace(scene.geometry, visibility=seen)), ball


def curved(build):
    return build.looking_down(2, 0.3, -1, size=1.8, shifts=(0, 0.5, 0))


@pytest.mark.parametrize("pixel_error", [0.1, 0.0])
@pytest.mark.parametrize("kept", [False, True])
def test_projectors_pass_through_objects_invisible_to_them(build, pixel_error, kept):
    """kept: all of the scene was built before, as with persistent data."""
    scene, ball = ball_over_ground(build, EVERYWHERE & ~CAMERA)
    settings = FrameSettings(20, 20, samples=1, pixel_error=pixel_error)
    before = CastScene(scene.geometry.vertices, scene.geometry.triangles) if kept else None
    made = render_frame(curved(build), scene, settings, before).pixels
    without = replace(scene, geometry=replace(scene.geometry, visibility=None).part(~ball))
    expected = render_frame(curved(build), without, settings).pixels
    if kept:
        assert np.allclose(made, expected, atol=1e-6)
    else:
        assert np.array_equal(made, expected)
    assert pick(curved(build), scene, 0.5, 0.5, (0.1, 0.1)).position[2] == pytest.approx(-0.8, abs=1e-6)


def test_shadow_casters_outside_the_view_are_built_for_shadows_only(build):
    lamp = Light("SUN", np.full(3, 2.0), build.placed(shines=(0.5, 0, -1)))
    scene, ball = ball_over_ground(build, EVERYWHERE & ~CAMERA, [lamp])
    part, cast_scene = cull_scene(scene, build.looking_down(2, -1, size=1.8))
    assert len(part.geometry.triangles) == len(cast_scene.triangles) == (~ball).sum()
    shading = Shading.of(part, cast_scene, FrameSettings(4, 4))
    assert shading.lighting.lamps[0].occluders is None
    settings = FrameSettings(32, 32, samples=1)
    view = build.looking_down(2, -1, size=1.8)
    made, seen = (
        render_frame(view, replace(scene, geometry=replace(scene.geometry, visibility=rays)), settings).pixels
        for rays in (scene.geometry.visibility, None)
    )
    ground = np.abs(made - seen).max(axis=2) == 0.0
    assert 0.7 < ground.mean() < 0.9 and made[ground, 0].min() < 0.5 * made.max()


def test_parts_are_built_once_and_only_if_they_are_parts(build):
    scene, ball = ball_over_ground(build, EVERYWHERE & ~SHADOW)
    cast_scene = CastScene(scene.geometry.vertices, scene.geometry.triangles)
    assert cast_scene.only(None) is cast_scene.only(np.ones_like(ball)) is cast_scene
    assert cast_scene.only(np.zeros_like(ball)) is None
    part = cast_scene.only(~ball)
    assert part is cast_scene.only(~ball) and part.planes is cast_scene.planes
    assert visible_to(scene.geometry.visibility, CAMERA) is None
    down = np.array([[0.0], [0.0], [-2.0]])
    start = cast_scene.matrix[:3, :3] @ np.array([[0.0], [0.0], [1.0]]) + cast_scene.matrix[:3, 3:]
    for each, triangle in ((cast_scene, ball), (part, ~ball)):
        found = each.mesh.trace(start.astype(np.float32), down.astype(np.float32), np.ones(1, np.float32))
        assert triangle[found[0]]


def test_a_holdout_is_a_hole_even_in_an_opaque_film(build):
    scene, _ball = ball_over_ground(build, EVERYWHERE | HOLDOUT)
    made = render_frame(build.looking_down(2, -1, size=1.8), scene, FrameSettings(16, 16)).pixels
    assert not made[8, 8].any() and made[0, 0, 3] == 1.0
