# SPDX-License-Identifier: GPL-3.0-or-later
"""Blends of three cameras and more, whose weights add up to 1, and maps around views of Aim."""

import bpy
import numpy as np
import pytest
from made_cameras import ASPECT, at, is_near, places, sampler, small_camera

# A grid's lines do not follow the crease where the weights of others add up to 1.
NEAR_CREASE = 0.03
PRESETS = ("perspective", "orthographic", "curved_convergence")


@pytest.fixture
def seen(addon):
    return sampler(addon)


@pytest.fixture
def cameras(seen):
    """Three flexible cameras by name, all selected, "B" active; Q at ``places`` of each, and the mask."""
    made = []
    for name, preset, turn in zip("ABC", PRESETS, (0.4, 0.5, 0.3), strict=True):
        camera = small_camera()
        camera.name = name
        assert bpy.ops.scfpf.preset_apply(preset=preset, fit=False) == {"FINISHED"}
        camera.rotation_euler.z = turn
        made.append(camera)
    select(*made, active=made[1])
    bpy.context.view_layer.update()
    samples = [seen(camera) for camera in made]
    return [q for q, _mask in samples], np.logical_and.reduce([mask for _q, mask in samples])


def select(*chosen, active):
    for obj in bpy.context.view_layer.objects:
        obj.select_set(obj in chosen)
    bpy.context.view_layer.objects.active = active


def smooth(inside, border):
    share = np.clip(0.5 + inside / border, 0, 1)
    return share**2 * (3 - 2 * share)


def ramp(x, middle, border=0.5):
    return smooth(x - middle, border)


def mean(ends, *weights):
    """The mean of the first camera and others by weights, divided by their sum where that is above 1."""
    shares = np.array(weights) / np.maximum(sum(weights), 1.0)
    return (1.0 - shares.sum(axis=0)) * ends[0] + sum(
        share * end for share, end in zip(shares, ends[1:], strict=True)
    )


def test_three_cameras_are_one_volume_with_weights_that_add_up_to_one(cameras, seen, tmp_path):
    ends, mask = cameras
    assert bpy.ops.scfpf.camera_blend() == {"FINISHED"}
    blend = bpy.context.object
    settings = blend.scfpf
    assert (settings.blend_ends.first.name, settings.blend_ends.second.name) == ("A", "B")
    assert [end.camera.name for end in settings.blend_more] == ["C"]
    one = np.ones(mask.shape)
    # Without maps both others count everywhere, and share.
    assert is_near(seen(at(blend, 1.0))[0], mean(ends, one, one), mask, 1e-5)
    assert is_near(seen(at(blend, 0.0))[0], ends[0], mask, 1e-5)
    x, y, _t = places()
    settings.blend_field.border = settings.blend_more[0].field.border = 0.5
    settings.blend_field.center, settings.blend_more[0].field.center = (0.4, 0.5), (0.5, 0.6)
    assert bpy.ops.scfpf.blend_map(kind="LINEAR") == {"FINISHED"}
    assert bpy.ops.scfpf.blend_map(kind="RADIAL", number=3) == {"FINISHED"}
    line = ramp(x, 0.4)
    circle = smooth(0.25 - np.hypot(x - 0.5, (y - 0.6) / ASPECT), 0.5)
    assert ((line + circle)[mask] > 1.2).sum() > 20 and ((line + circle)[mask] < 0.8).sum() > 20
    wanted = mean(ends, line, circle)
    crease, mask = mask, mask & (np.abs(line + circle - 1.0) > NEAR_CREASE)
    assert is_near(seen(at(blend, 1.0))[0], wanted, crease, 1e-2)
    assert is_near(seen(at(blend, 1.0))[0], wanted, mask, 1e-3)
    settings.blend_more[0].field.weight = 0.5
    half = mean(ends, line, 0.5 * circle)
    mask = mask & (np.abs(line + 0.5 * circle - 1.0) > NEAR_CREASE)
    assert is_near(seen(at(blend, 1.0))[0], half, mask, 1e-3)
    assert not is_near(half, wanted, mask, 2e-2)
    bpy.ops.wm.save_as_mainfile(filepath=str(tmp_path / "three.blend"))
    bpy.ops.wm.open_mainfile(filepath=str(tmp_path / "three.blend"))
    blend = bpy.context.scene.camera
    assert is_near(seen(blend)[0], half, mask, 1e-3)
    # The camera C, moved, is taken up; without it the blend is of two.
    c = bpy.data.objects["C"]
    c.location.x += 20
    bpy.context.view_layer.update()
    select(blend, active=blend)
    assert bpy.ops.scfpf.blend_update() == {"FINISHED"}
    moved = mean([*ends[:2], seen(c)[0]], line, 0.5 * circle)
    assert is_near(seen(blend)[0], moved, mask, 1e-3) and not is_near(moved, half, mask, 2e-2)
    assert bpy.ops.scfpf.blend_camera_remove() == {"FINISHED"}
    assert not bpy.ops.scfpf.blend_camera_remove.poll()
    assert is_near(seen(blend)[0], mean(ends[:2], line), mask, 1e-3)
    keys = blend.scfpf.surfaces[0].object.data.shape_keys.key_blocks
    assert not any(key.name.startswith("Camera") for key in keys)


def test_a_camera_is_added_to_a_blend_and_undo_takes_it_back(cameras, seen):
    ends, mask = cameras
    a, b = bpy.data.objects["A"], bpy.data.objects["B"]
    select(a, b, active=b)
    assert bpy.ops.scfpf.camera_blend() == {"FINISHED"}
    blend = at(bpy.context.object, 1.0)
    name = blend.name
    assert not bpy.ops.scfpf.blend_camera_add.poll()
    c = bpy.data.objects["C"]
    select(blend, c, active=blend)
    bpy.ops.ed.undo_push(message="Before")
    assert bpy.ops.scfpf.blend_camera_add() == {"FINISHED"}
    bpy.ops.ed.undo_push(message="Add Camera to Blend")
    one = np.ones(mask.shape)
    assert is_near(seen(blend)[0], mean(ends, one, one), mask, 1e-5)
    bpy.ops.ed.undo()
    blend = bpy.data.objects[name]
    assert not len(blend.scfpf.blend_more) and is_near(seen(blend)[0], ends[1], mask, 1e-5)
    bpy.ops.ed.redo()
    blend = bpy.data.objects[name]
    assert is_near(seen(blend)[0], mean(ends, one, one), mask, 1e-5)
    # A camera whose picture has holes is refused, and the list stays.
    broken = small_camera()
    broken.scfpf.mappings.add().kind = "DISTORTION"
    broken.scfpf.mappings[0].numerator = 0.5, 0, 0
    select(blend, broken, active=blend)
    with pytest.raises(RuntimeError, match="empty parts"):
        bpy.ops.scfpf.blend_camera_add()
    assert len(blend.scfpf.blend_more) == 1
    blend.scfpf.blend_more[0].camera = None
    with pytest.raises(RuntimeError, match="choose one in the list, or remove it there"):
        bpy.ops.scfpf.blend_update()
    with pytest.raises(RuntimeError, match="has no camera 7"):
        bpy.ops.scfpf.blend_map(kind="LINEAR", number=7)
    # A script removes the camera behind the add-on's back.
    blend.scfpf.blend_more.clear()
    blend.scfpf.blend_field.weight = 0.5
    bpy.context.view_layer.update()
    assert is_near(seen(blend)[0], mean(ends[:2], 0.5 * one), mask, 1e-5)


def test_a_blend_takes_only_so_many_cameras(cameras, addon, monkeypatch):
    monkeypatch.setattr(addon("operators.camera.blend"), "MOST_ENDS", 2)
    with pytest.raises(RuntimeError, match="at most 2 cameras: blend some of them first"):
        bpy.ops.scfpf.camera_blend()
    assert len([obj for obj in bpy.data.objects if obj.type == "CAMERA"]) == 3


def test_the_sharp_seams_of_three_cameras_are_exact(cameras, seen, addon):
    """Beyond both lines the two share, between them one counts alone."""
    ends, mask = cameras
    assert bpy.ops.scfpf.camera_blend() == {"FINISHED"}
    blend = bpy.context.object
    x, y, _t = places()
    fields = blend.scfpf.blend_field, blend.scfpf.blend_more[0].field
    for number, field in enumerate(fields, 2):
        field.border, field.center, field.angle = 0.0, (0.3 + 0.1 * number, 0.5), 0.4 * (number - 2)
        assert bpy.ops.scfpf.blend_map(kind="LINEAR", number=number) == {"FINISHED"}
    off = np.stack([x - 0.5, np.cos(0.4) * (x - 0.6) + np.sin(0.4) * (y - 0.5) / ASPECT])
    away = mask & (np.abs(off).min(axis=0) > 1e-4)
    inside = (off > 0).astype(float)
    assert (inside.sum(axis=0) == 2).sum() > 30 and (inside.sum(axis=0) == 0).sum() > 30
    assert is_near(seen(blend)[0], mean(ends, *inside), away, 1e-3)
    assert not addon("bridge.blends.camera_blend").is_too_coarse(blend)
    fields[1].is_inverted = True
    bpy.context.view_layer.update()
    assert is_near(seen(blend)[0], mean(ends, inside[0], 1.0 - inside[1]), away, 1e-3)


def test_keyframes_of_weights_are_baked(cameras, seen):
    ends, mask = cameras
    assert bpy.ops.scfpf.camera_blend() == {"FINISHED"}
    blend, scene = at(bpy.context.object, 1.0), bpy.context.scene
    fields = blend.scfpf.blend_field, blend.scfpf.blend_more[0].field
    for frame, weights in ((1, (1.0, 0.0)), (5, (0.0, 1.0))):
        for field, weight in zip(fields, weights, strict=True):
            field.weight = weight
            field.keyframe_insert("weight", frame=frame)
    assert bpy.ops.scfpf.blend_map_bake(start=1, end=5) == {"FINISHED"}
    for frame in (1, 2, 3, 5):
        scene.frame_set(frame)
        weights = [np.full(mask.shape, field.weight) for field in fields]
        assert is_near(seen(blend)[0], mean(ends, *weights), mask, 1e-2), frame
    assert weights[0][0] == 0.0 and weights[1][0] == 1.0


def test_a_map_falls_off_around_the_views_of_the_second_camera(cameras, seen, addon):
    """It is 1 in the circle that each view has in the image, and 0 from its border on."""
    ends, mask = cameras
    a, b = bpy.data.objects["A"], bpy.data.objects["B"]
    select(a, b, active=b)
    assert bpy.ops.scfpf.camera_blend() == {"FINISHED"}
    blend = bpy.context.object
    with pytest.raises(RuntimeError, match="'B' has no views of Aim: press Add View"):
        bpy.ops.scfpf.blend_map(kind="VIEWS")
    assert blend.scfpf.blend_field.kind == "NONE"
    views = [b.scfpf.aim_targets.add() for _ in range(3)]
    for view, place, wide in zip(views, ((0.3, 0.4), (0.7, 0.6), (0.5, 0.1)), (0.2, 0.3, 0.5), strict=True):
        view.position, view.width = place, wide
    b.scfpf.aim_targets[2].is_on = False
    b.scfpf.aim_targets.add().kind = "PIN"
    blend.scfpf.blend_field.border = 0.15
    assert bpy.ops.scfpf.blend_map(kind="VIEWS") == {"FINISHED"}
    x, y, _t = places()

    def factors(*circles):
        """The factors at each place, by its distance from the nearest circle."""
        beyond = [np.hypot(x - p, (y - q) / ASPECT) - wide / 2 for p, q, wide in circles]
        left = 1.0 - np.clip(np.min(beyond, axis=0) / 0.15, 0, 1)
        return left**2 * (3 - 2 * left)

    wanted = factors((0.3, 0.4, 0.2), (0.7, 0.6, 0.3))
    assert (wanted == 1).sum() > 20 and (wanted == 0).sum() > 20
    assert is_near(seen(blend)[0], mean(ends[:2], wanted), mask, 2e-3)
    # The views move, and Update Blend takes it up; without a border the seam is sharp.
    b.scfpf.aim_targets[0].position = 0.5, 0.5
    assert bpy.ops.scfpf.blend_update() == {"FINISHED"}
    wanted = factors((0.5, 0.5, 0.2), (0.7, 0.6, 0.3))
    assert is_near(seen(blend)[0], mean(ends[:2], wanted), mask, 2e-3)
    blend.scfpf.blend_field.border = 0.0
    assert addon("bridge.blends.camera_blend").is_too_coarse(blend)
    assert bpy.ops.scfpf.blend_update() == {"FINISHED"}
    beyond = [np.hypot(x - p, (y - q) / ASPECT) - r for p, q, r in ((0.5, 0.5, 0.1), (0.7, 0.6, 0.15))]
    away = mask & (np.abs(np.min(beyond, axis=0)) > 2e-3)
    inside = (np.min(beyond, axis=0) < 0).astype(float)
    assert is_near(seen(blend)[0], mean(ends[:2], inside), away, 1e-3)
    b.scfpf.aim_targets[0].width = 0.3
    assert addon("bridge.blends.camera_blend").is_too_coarse(blend)
