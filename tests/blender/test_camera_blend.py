# SPDX-License-Identifier: GPL-3.0-or-later
"""Cameras between two others: both ends, the middle, beyond; keyframes; files; what cannot be blended."""

import bpy
import numpy as np
import pytest

ASPECT = 16 / 9


@pytest.fixture
def camera():
    render = bpy.context.scene.render
    render.resolution_x, render.resolution_y, render.resolution_percentage = 160, 90, 100
    assert bpy.ops.scfpf.camera_add() == {"FINISHED"}
    made = bpy.context.object
    made.location, made.rotation_euler = (1, -2, 3), (1.2, 0.1, 0.4)
    return made


@pytest.fixture
def seen(addon):
    """Q at places of the picture and t, in world space: (3, N), and which are shown."""
    read = addon("scfpf_addon.bridge.read_projection").read_projection

    def sample(camera, seed=5):
        x, y, t = np.random.default_rng(seed).uniform(0.02, 0.98, size=(3, 400))
        projection = read(camera, bpy.context.evaluated_depsgraph_get(), ASPECT)
        image = projection.parameters(x, y)
        return projection.volume.evaluate(image.u, image.v, t).position, image.mask

    return sample


def at(camera, factor):
    camera.scfpf.blend_factor = factor
    bpy.context.view_layer.update()
    return camera


def is_near(found, wanted, mask, share):
    size = np.ptp(wanted[:, mask], axis=1).max()
    return np.linalg.norm(found - wanted, axis=0)[mask].max() <= share * size


def check_blend(seen, blend, ends, share, factors=(-0.5, 0.3, 1.0, 1.5)):
    (first, mask), (second, other_mask) = ends
    mask = mask & other_mask
    for factor in (0.0, *factors):
        found, _ = seen(at(blend, factor))
        wanted = (1 - factor) * first + factor * second
        scale = share * (1 + 2 * abs(factor))
        assert is_near(found, wanted, mask, scale), factor


# Straight; bent with straight; grids of curved kinds; polar with polar; polar with flat.
PAIRS = {
    ("perspective", "orthographic"): 1e-6,
    ("perspective", "inverted_perspective"): 1e-6,
    ("perspective", "curved_convergence"): 1e-6,
    ("perspective", "angular_fisheye"): 4e-4,
    ("sample_rate_lens", "orthographic"): 4e-4,
}


@pytest.mark.parametrize(("pair", "share"), PAIRS.items(), ids=lambda each: str(each))
def test_a_camera_and_a_preset_are_blended_and_beyond(camera, seen, pair, share):
    assert bpy.ops.scfpf.preset_apply(preset=pair[1], fit=False) == {"FINISHED"}
    end = seen(camera)
    assert bpy.ops.scfpf.preset_apply(preset=pair[0], fit=False) == {"FINISHED"}
    start = seen(camera)
    assert bpy.ops.scfpf.camera_blend_preset(preset=pair[1]) == {"FINISHED"}
    blend = bpy.context.object
    assert blend != camera and blend == bpy.context.scene.camera
    check_blend(seen, blend, (start, end), share)


def test_two_cameras_are_blended_in_space(camera, seen):
    assert bpy.ops.scfpf.preset_apply(preset="perspective", fit=False) == {"FINISHED"}
    assert bpy.ops.scfpf.camera_add() == {"FINISHED"}
    other = bpy.context.object
    other.location, other.rotation_euler = (4, 1, 2), (1.0, 0.0, 0.9)
    assert bpy.ops.scfpf.preset_apply(preset="deep_curvy_volume", fit=False) == {"FINISHED"}
    assert not bpy.ops.scfpf.camera_blend.poll()
    camera.select_set(True)
    bpy.context.view_layer.update()
    ends = seen(camera), seen(other)
    assert bpy.ops.scfpf.camera_blend() == {"FINISHED"}
    check_blend(seen, bpy.context.object, ends, 4e-4)


def test_the_factor_is_animated_without_handlers_and_survives_a_file(camera, seen, tmp_path):
    assert bpy.ops.scfpf.preset_apply(preset="perspective", fit=False) == {"FINISHED"}
    assert bpy.ops.scfpf.camera_blend_preset(preset="orthographic") == {"FINISHED"}
    blend = bpy.context.object
    for frame, value in ((1, 0.0), (11, 1.0)):
        blend.scfpf.blend_factor = value
        blend.keyframe_insert("scfpf.blend_factor", frame=frame)
    bpy.ops.wm.save_as_mainfile(filepath=str(tmp_path / "blend.blend"))
    bpy.ops.wm.open_mainfile(filepath=str(tmp_path / "blend.blend"))
    blend = bpy.context.scene.camera
    widths = []
    for frame in (1, 6, 11):
        bpy.context.scene.frame_set(frame)
        far = blend.scfpf.surfaces[-1].object.evaluated_get(bpy.context.evaluated_depsgraph_get())
        widths.append(np.ptp([vertex.co.x for vertex in far.data.vertices]))
        assert blend.scfpf.surfaces[0].object.data.shape_keys.key_blocks[1].value == pytest.approx(
            blend.scfpf.blend_factor
        )
    assert widths[0] > widths[1] > widths[2]
    assert widths[1] == pytest.approx((widths[0] + widths[2]) / 2, rel=1e-5)


def test_what_has_holes_is_not_blended_and_nothing_is_left(camera):
    camera.scfpf.mappings.add().kind = "DISTORTION"
    camera.scfpf.mappings[0].numerator = 0.5, 0, 0
    before = set(bpy.data.objects)
    with pytest.raises(RuntimeError, match="empty parts"):
        bpy.ops.scfpf.camera_blend_preset(preset="orthographic")
    assert set(bpy.data.objects) == before


def test_a_blend_shows_its_factor(addon, camera):
    is_blend = addon("scfpf_addon.bridge.camera_blend").is_blend
    assert not is_blend(camera)
    assert bpy.ops.scfpf.camera_blend_preset(preset="orthographic") == {"FINISHED"}
    assert is_blend(bpy.context.object)
