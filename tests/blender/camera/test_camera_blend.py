# SPDX-License-Identifier: GPL-3.0-or-later
"""Cameras between two others: both ends, the middle, beyond; keyframes; files; what cannot be blended."""

import bpy
import numpy as np
import pytest
from made_cameras import at, is_near, sampler, small_camera


@pytest.fixture
def camera():
    return small_camera()


@pytest.fixture
def seen(addon):
    return sampler(addon)


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
    is_blend = addon("bridge.blends.camera_blend").is_blend
    assert not is_blend(camera)
    assert bpy.ops.scfpf.camera_blend_preset(preset="orthographic") == {"FINISHED"}
    assert is_blend(bpy.context.object)


def key_factor(blend):
    for frame, value in ((1, 0.0), (11, 1.0)):
        blend.scfpf.blend_factor = value
        blend.keyframe_insert("scfpf.blend_factor", frame=frame)


def keyed(blend):
    """The factor at three frames."""
    values = []
    for frame in (1, 6, 11):
        bpy.context.scene.frame_set(frame)
        values.append(blend.scfpf.blend_factor)
    return values


def ends_as_seen(seen, first, second):
    return seen(first), seen(second)


@pytest.fixture
def two(camera):
    """Two flexible cameras, the second one active, both selected."""
    assert bpy.ops.scfpf.preset_apply(preset="perspective", fit=False) == {"FINISHED"}
    assert bpy.ops.scfpf.camera_add() == {"FINISHED"}
    other = bpy.context.object
    other.location, other.rotation_euler = (4, 1, 2), (1.0, 0.0, 0.9)
    assert bpy.ops.scfpf.preset_apply(preset="orthographic", fit=False) == {"FINISHED"}
    camera.select_set(True)
    bpy.context.view_layer.update()
    return camera, other


def test_a_blend_is_brought_up_to_date_in_place_with_its_keyframes(camera, two, seen, tmp_path):
    """Both cameras moved, one surface edited: the same objects, the same keys; after a file too."""
    first, second = two
    assert bpy.ops.scfpf.camera_blend() == {"FINISHED"}
    blend = bpy.context.object
    key_factor(blend)
    keys = keyed(blend)
    objects = [slot.object for slot in blend.scfpf.surfaces]
    first.location.x += 2
    second.rotation_euler.z -= 0.4
    blend.location.y += 1
    first.scfpf.surfaces[1].object.scale = 2, 1.5, 1
    bpy.context.view_layer.update()
    ends = ends_as_seen(seen, first, second)
    assert bpy.ops.scfpf.blend_update() == {"FINISHED"}
    assert [slot.object for slot in blend.scfpf.surfaces] == objects
    assert keyed(blend) == keys and keys[0] == 0 and keys[2] == 1
    blend.animation_data_clear()
    check_blend(seen, blend, ends, 1e-6)
    bpy.ops.wm.save_as_mainfile(filepath=str(tmp_path / "blend.blend"))
    bpy.ops.wm.open_mainfile(filepath=str(tmp_path / "blend.blend"))
    blend = bpy.context.scene.camera
    blend.scfpf.blend_ends.first.location.z += 3
    bpy.context.view_layer.update()
    ends = ends_as_seen(seen, blend.scfpf.blend_ends.first, blend.scfpf.blend_ends.second)
    assert bpy.ops.scfpf.blend_update() == {"FINISHED"}
    check_blend(seen, blend, ends, 1e-6)


def test_other_kinds_and_another_resolution_make_other_surfaces(camera, two, seen):
    """Straight ones become bent, then a fisheye's; keyframes stay, and the drivers act."""
    first, second = two
    assert bpy.ops.scfpf.camera_blend() == {"FINISHED"}
    blend = bpy.context.object
    key_factor(blend)
    for preset, share, count in (("deep_curvy_volume", 4e-4, 3), ("angular_fisheye", 4e-4, 2)):
        bpy.context.view_layer.objects.active = second
        assert bpy.ops.scfpf.preset_apply(preset=preset, fit=False) == {"FINISHED"}
        bpy.context.view_layer.objects.active = blend
        ends = ends_as_seen(seen, first, second)
        assert bpy.ops.scfpf.blend_update() == {"FINISHED"}
        assert len(blend.scfpf.surfaces) == count
        check_blend(seen, blend, ends, share)
    widths = []
    for frame in (1, 11):
        bpy.context.scene.frame_set(frame)
        widths.append(seen(blend)[0])
    assert is_near(widths[0], ends[0][0], ends[1][1], 4e-4) and is_near(
        widths[1], ends[1][0], ends[1][1], 4e-4
    )


def test_a_preset_s_end_follows_the_first_camera_or_gives_way_to_a_camera(camera, seen):
    assert bpy.ops.scfpf.preset_apply(preset="perspective", fit=False) == {"FINISHED"}
    assert bpy.ops.scfpf.camera_blend_preset(preset="orthographic") == {"FINISHED"}
    blend = bpy.context.object
    camera.location.x += 5
    bpy.context.view_layer.update()
    start = seen(camera)
    assert bpy.ops.scfpf.blend_update() == {"FINISHED"}
    at(blend, 0.0)
    assert is_near(seen(blend)[0], *start, 1e-6)
    shifted = seen(at(blend, 1.0))[0]
    bpy.context.view_layer.objects.active = camera
    assert bpy.ops.scfpf.preset_apply(preset="orthographic", fit=False) == {"FINISHED"}
    assert is_near(shifted, *seen(camera), 1e-6)
    other = camera.copy()
    bpy.context.scene.collection.objects.link(other)
    other.location.x -= 2
    bpy.context.view_layer.objects.active = blend
    blend.scfpf.blend_ends.second = other
    bpy.context.view_layer.update()
    assert bpy.ops.scfpf.blend_update() == {"FINISHED"}
    assert is_near(seen(at(blend, 1.0))[0], *seen(other), 1e-6)


def test_updates_say_what_is_missing_and_undo_takes_them_back(camera, two, seen):
    _, second = two
    assert not bpy.ops.scfpf.blend_update.poll()
    assert bpy.ops.scfpf.camera_blend() == {"FINISHED"}
    blend = bpy.context.object
    before = seen(at(blend, 1.0))[0]
    bpy.ops.ed.undo_push(message="Blend")
    second.location.x += 7
    bpy.context.view_layer.update()
    bpy.ops.ed.undo_push(message="Move")
    name = blend.name
    assert bpy.ops.scfpf.blend_update() == {"FINISHED"}
    assert np.abs(seen(blend)[0] - before).max() > 1
    bpy.ops.ed.undo_push(message="Update Blend")
    bpy.ops.ed.undo()
    blend = bpy.data.objects[name]
    assert np.allclose(seen(blend)[0], before, rtol=0, atol=1e-6)
    bpy.data.objects.remove(bpy.data.objects["Flexible Camera"])
    bpy.context.view_layer.objects.active = blend
    assert not bpy.ops.scfpf.blend_update.poll()
    blend.scfpf.blend_ends.first = blend.scfpf.blend_ends.second
    gone = blend.scfpf.blend_ends.second
    bpy.context.scene.collection.objects.unlink(gone)
    with pytest.raises(RuntimeError, match="was deleted: undo that"):
        bpy.ops.scfpf.blend_update()
    blend.scfpf.blend_ends.preset = "../nothing"
    bpy.context.scene.collection.objects.link(gone)
    blend.scfpf.blend_ends.second = None
    with pytest.raises(RuntimeError, match="no preset"):
        bpy.ops.scfpf.blend_update()
