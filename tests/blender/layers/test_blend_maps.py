# SPDX-License-Identifier: GPL-3.0-or-later
"""Maps of blends: weights place by place, sharp seams, keyframes that are baked, and nested blends."""

import bpy
import numpy as np
import pytest
from made_cameras import ASPECT, at, is_near, places, sampler, small_camera
from mathutils import Vector


@pytest.fixture
def camera():
    return small_camera()


@pytest.fixture
def seen(addon):
    return sampler(addon)


def blended(camera, seen, preset):
    """A blend of the preset perspective with another one, what each shows alone, and a mask of places."""
    assert bpy.ops.scfpf.preset_apply(preset=preset, fit=False) == {"FINISHED"}
    second, _ = seen(camera)
    assert bpy.ops.scfpf.preset_apply(preset="perspective", fit=False) == {"FINISHED"}
    first, mask = seen(camera)
    assert bpy.ops.scfpf.camera_blend_preset(preset=preset) == {"FINISHED"}
    return bpy.context.object, first, second, mask


def test_a_map_mixes_the_cameras_place_by_place(camera, seen, tmp_path):
    """Q is the mean of both by the map's weight; a file keeps it, and without a map all is as before."""
    blend, first, second, mask = blended(camera, seen, "curved_convergence")
    x = places()[0]
    assert bpy.ops.scfpf.blend_map(kind="LINEAR") == {"FINISHED"}
    assert blend.scfpf.blend_factor == 1.0
    blend.scfpf.blend_field.border = 0.5
    blend.scfpf.blend_field.center = 0.4, 0.5
    share = np.clip(0.5 + (x - 0.4) / 0.5, 0, 1)
    weight = share**2 * (3 - 2 * share)
    wanted = (1 - weight) * first + weight * second
    bpy.context.view_layer.update()
    assert is_near(seen(blend)[0], wanted, mask, 1e-3)
    # Half of it.
    assert is_near(seen(at(blend, 0.5))[0], 0.5 * (wanted + first), mask, 1e-3)
    at(blend, 1.0)
    bpy.ops.wm.save_as_mainfile(filepath=str(tmp_path / "map.blend"))
    bpy.ops.wm.open_mainfile(filepath=str(tmp_path / "map.blend"))
    blend = bpy.context.scene.camera
    assert is_near(seen(blend)[0], wanted, mask, 1e-3)
    bpy.context.view_layer.objects.active = blend
    assert bpy.ops.scfpf.blend_map(kind="NONE") == {"FINISHED"}
    assert is_near(seen(at(blend, 1.0))[0], second, mask, 1e-3)


def test_a_painted_map_with_a_seam_shows_one_camera_on_either_side(camera, seen):
    blend, first, second, mask = blended(camera, seen, "orthographic")
    image = bpy.data.images.new("Painted", 64, 64)
    pixels = np.zeros((64, 64, 4), np.float32)
    pixels[:, 32:] = 1.0
    image.pixels.foreach_set(pixels.ravel())
    blend.scfpf.blend_field.image = image
    assert bpy.ops.scfpf.blend_map(kind="IMAGE") == {"FINISHED"}
    found, _ = seen(blend)
    x = places()[0]
    seam = 1 / 64 + 1 / 128
    left, right = mask & (x < 0.5 - seam), mask & (x > 0.5 + seam)
    assert is_near(found, first, left, 1e-6) and is_near(found, second, right, 1e-6)
    blend.scfpf.blend_field.is_inverted = True
    bpy.context.view_layer.update()
    found, _ = seen(blend)
    assert is_near(found, second, left, 1e-6) and is_near(found, first, right, 1e-6)


def test_a_painted_edge_cuts_the_surfaces(camera, seen, addon):
    """A disc by the formula: each place is one camera's, but for the polygon and the pixels at its rim."""
    blend, first, second, mask = blended(camera, seen, "orthographic")
    image = bpy.data.images.new("Painted", 512, 512)
    column, row = np.meshgrid(*2 * [(np.arange(512) + 0.5) / 512])
    painted = np.hypot(column - 0.55, row - 0.45) < 0.3
    image.pixels.foreach_set(np.repeat(painted.ravel(), 4).astype(np.float32))
    blend.scfpf.blend_field.image = image
    assert bpy.ops.scfpf.blend_map(kind="IMAGE") == {"FINISHED"}
    is_too_coarse = addon("bridge.blends.camera_blend").is_too_coarse
    assert not is_too_coarse(blend)
    blend.scfpf.blend_field.is_sharp = True
    assert is_too_coarse(blend)
    assert bpy.ops.scfpf.blend_update() == {"FINISHED"}
    assert not is_too_coarse(blend)
    x, y, _ = places()
    off = 0.3 - np.hypot(x - 0.55, y - 0.45)
    away = mask & (np.abs(off) > 1 / 512)
    assert away.sum() > 350 and (off > 0).sum() > 80
    found, _ = seen(blend)
    assert is_near(found, np.where(off > 0, second, first), away, 1e-4)
    apart = np.minimum(*(np.abs(found - end).max(axis=0) for end in (first, second)))
    assert apart[mask].max() < 1e-4


def test_a_blend_of_a_blend_has_weights_that_add_up_to_one(camera, seen):
    """Three cameras: the third one in a circle, the other two beside a line."""
    ends = []
    for preset in ("orthographic", "curved_convergence", "perspective"):
        assert bpy.ops.scfpf.preset_apply(preset=preset, fit=False) == {"FINISHED"}
        end, mask = seen(camera)
        ends.append(end)
    assert bpy.ops.scfpf.camera_blend_preset(preset="orthographic") == {"FINISHED"}
    assert bpy.ops.scfpf.blend_map(kind="LINEAR") == {"FINISHED"}
    assert bpy.ops.scfpf.camera_blend_preset(preset="curved_convergence") == {"FINISHED"}
    assert bpy.ops.scfpf.blend_map(kind="RADIAL") == {"FINISHED"}
    x, y, _ = places()

    def smooth(inside):
        share = np.clip(0.5 + inside / 0.2, 0, 1)
        return share**2 * (3 - 2 * share)

    line, circle = smooth(x - 0.5), smooth(0.25 - np.hypot(x - 0.5, (y - 0.5) / ASPECT))
    wanted = (1 - circle) * ((1 - line) * ends[2] + line * ends[0]) + circle * ends[1]
    assert is_near(seen(bpy.context.object)[0], wanted, mask, 3e-3)


def test_an_image_without_pixels_is_refused_and_the_map_stays(camera):
    assert bpy.ops.scfpf.camera_blend_preset(preset="orthographic") == {"FINISHED"}
    blend = bpy.context.object
    image = bpy.data.images.new("Lost", 4, 4)
    image.source, image.filepath = "FILE", "//is-not-there.png"
    blend.scfpf.blend_field.image = image
    with pytest.raises(RuntimeError, match="has no pixels: paint or load it"):
        bpy.ops.scfpf.blend_map(kind="IMAGE")
    assert blend.scfpf.blend_field.kind == "NONE" and blend.scfpf.blend_factor == 0.0


@pytest.mark.parametrize("kind", ["RADIAL", "RECTANGLE"])
def test_a_map_is_put_around_objects_as_the_first_camera_sees_them(camera, kind):
    """The corners of a cube by Blender's own camera lie where the map is 1; beyond its border it is 0."""
    from bpy_extras.object_utils import world_to_camera_view

    bpy.ops.mesh.primitive_cube_add(size=1.0)
    cube = bpy.context.object
    cube.matrix_world = camera.matrix_world @ cube.matrix_world
    cube.location += camera.matrix_world.to_3x3() @ Vector((0.5, 0.3, -8.0))
    bpy.context.view_layer.objects.active = camera
    bpy.context.view_layer.update()
    assert bpy.ops.scfpf.camera_from_camera() == {"FINISHED"}
    places = [
        world_to_camera_view(bpy.context.scene, camera, cube.matrix_world @ v.co) for v in cube.data.vertices
    ]
    assert bpy.ops.scfpf.camera_blend_preset(preset="orthographic") == {"FINISHED"}
    blend = bpy.context.object
    assert bpy.ops.scfpf.blend_map(kind=kind) == {"FINISHED"}
    blend.scfpf.blend_field.border = 0.1
    assert not bpy.ops.scfpf.blend_map_around.poll()
    cube.select_set(True)
    assert bpy.ops.scfpf.blend_map_around() == {"FINISHED"}
    field = blend.scfpf.blend_field
    x, y = np.array([(p.x, p.y) for p in places]).T
    middle = (x.min() + x.max()) / 2, (y.min() + y.max()) / 2
    assert np.allclose(field.center, middle, atol=2e-3)
    wide, high = np.ptp(x), np.ptp(y)
    if kind == "RECTANGLE":
        assert np.allclose(field.size, (wide + 0.1, high + 0.1 * ASPECT), atol=4e-3)
    else:
        assert field.size[0] == pytest.approx(np.hypot(wide, high / ASPECT) + 0.1, abs=4e-3)


def test_sharp_seams_of_nested_blends_are_exact(camera, seen, addon, tmp_path):
    """Three cameras, two turned rectangles without borders: each point is one camera's. Files keep it."""
    ends = []
    for preset in ("orthographic", "curved_convergence", "perspective"):
        assert bpy.ops.scfpf.preset_apply(preset=preset, fit=False) == {"FINISHED"}
        end, mask = seen(camera)
        ends.append(end)
    x, y, _ = places()
    boxes, off = [], []
    for preset, center, angle in (
        ("orthographic", (0.4, 0.5), 0.3),
        ("curved_convergence", (0.6, 0.6), -0.5),
    ):
        assert bpy.ops.scfpf.camera_blend_preset(preset=preset) == {"FINISHED"}
        field = bpy.context.object.scfpf.blend_field
        field.center, field.angle, field.border, field.size = center, angle, 0.0, (0.5, 0.4)
        assert bpy.ops.scfpf.blend_map(kind="RECTANGLE") == {"FINISHED"}
        # A turn by complex numbers.
        place = (x - center[0] + 1j * (y - center[1]) / ASPECT) * np.exp(-1j * angle)
        sides = np.stack([0.25 - np.abs(place.real), 0.2 / ASPECT - np.abs(place.imag)])
        boxes.append(sides.min(axis=0) > 0)
        off.append(np.abs(sides).min(axis=0))
    blend = bpy.context.object
    away = mask & (np.min(off, axis=0) > 1e-4)
    assert away.sum() > 350 and boxes[0].sum() > 50 and boxes[1].sum() > 50
    wanted = np.where(boxes[1], ends[1], np.where(boxes[0], ends[0], ends[2]))
    assert is_near(seen(blend)[0], wanted, away, 1e-3)
    assert not addon("bridge.blends.camera_blend").is_too_coarse(blend)
    bpy.ops.wm.save_as_mainfile(filepath=str(tmp_path / "seams.blend"))
    bpy.ops.wm.open_mainfile(filepath=str(tmp_path / "seams.blend"))
    blend = bpy.context.scene.camera
    assert is_near(seen(blend)[0], wanted, away, 1e-3)
    # Half way between the cameras within, the first one beyond.
    below = np.where(boxes[0], ends[0], ends[2])
    assert is_near(seen(at(blend, 0.5))[0], 0.5 * (wanted + below), away, 1e-3)
    bpy.context.view_layer.objects.active = at(blend, 1.0)
    blend.scfpf.blend_field.is_inverted = True
    bpy.context.view_layer.update()
    assert is_near(seen(blend)[0], np.where(boxes[1], below, ends[1]), away, 1e-3)
    # Another place needs other cuts: the panel says so, and Update Blend makes them.
    blend.scfpf.blend_field.is_inverted, blend.scfpf.blend_field.center = False, (0.55, 0.6)
    assert addon("bridge.blends.camera_blend").is_too_coarse(blend)
    assert bpy.ops.scfpf.blend_update() == {"FINISHED"}
    assert not addon("bridge.blends.camera_blend").is_too_coarse(blend)
    blend.scfpf.blend_field.border = 0.3
    assert bpy.ops.scfpf.blend_update() == {"FINISHED"}
    assert not addon("bridge.blends.camera_blend").is_too_coarse(blend)


def test_keyframes_of_a_map_are_baked_into_shapes(camera, seen, addon, tmp_path):
    """A gradient moves: in each frame Q is the mean by that frame's map. Nothing runs Python."""
    assert bpy.ops.scfpf.preset_apply(preset="curved_convergence", fit=False) == {"FINISHED"}
    second, _ = seen(camera)
    assert bpy.ops.scfpf.preset_apply(preset="perspective", fit=False) == {"FINISHED"}
    first, mask = seen(camera)
    assert bpy.ops.scfpf.camera_blend_preset(preset="curved_convergence") == {"FINISHED"}
    blend, scene = bpy.context.object, bpy.context.scene
    name = blend.name
    field = blend.scfpf.blend_field
    field.border = 0.5
    assert bpy.ops.scfpf.blend_map(kind="LINEAR") == {"FINISHED"}
    assert not bpy.ops.scfpf.blend_map_bake.poll()
    for frame, x in ((1, 0.2), (13, 0.7)):
        field.center = x, 0.5
        field.keyframe_insert("center", frame=frame)
    unbaked = addon("bridge.blends.camera_blend").unbaked
    assert "press Bake Map" in unbaked(blend)
    assert bpy.ops.scfpf.blend_map_bake(start=1, end=13) == {"FINISHED"}
    assert unbaked(blend) == ""
    keys = blend.scfpf.surfaces[0].object.data.shape_keys
    drivers = [curve.driver for curve in keys.animation_data.drivers if curve.driver.type == "SCRIPTED"]
    assert drivers and all(driver.is_simple_expression for driver in drivers)
    count = sum(key.name.startswith("Baked Map") for key in keys.key_blocks)
    assert count == len(drivers) <= 13

    def check(factor=1.0):
        x = places()[0]
        for frame in (1, 2, 6, 11, 13, 20):
            scene.frame_set(frame)
            # Blender's own interpolation of the keyframes.
            middle = bpy.data.objects[name].scfpf.blend_field.center[0]
            share = np.clip(0.5 + (x - middle) / 0.5, 0, 1)
            weight = factor * share**2 * (3 - 2 * share)
            wanted = (1 - weight) * first + weight * second
            assert is_near(seen(bpy.data.objects[name])[0], wanted, mask, 5e-3), frame

    check()
    bpy.ops.wm.save_as_mainfile(filepath=str(tmp_path / "baked.blend"))
    bpy.ops.wm.open_mainfile(filepath=str(tmp_path / "baked.blend"))
    scene, blend = bpy.context.scene, bpy.data.objects[name]
    check()
    blend.scfpf.blend_factor = 0.5
    check(0.5)
    # Update Blend bakes again; an edit of the map drops what was baked, and the panel and renders say so.
    scene.frame_start, scene.frame_end, blend.scfpf.blend_factor = 1, 13, 1.0
    bpy.context.view_layer.objects.active = blend
    assert bpy.ops.scfpf.blend_update() == {"FINISHED"} and unbaked(blend) == ""
    check()
    blend.scfpf.blend_field.border = 0.4
    keys = blend.scfpf.surfaces[0].object.data.shape_keys
    assert "press Bake Map" in unbaked(blend) and not keys.key_blocks["Second Camera"].mute
    assert not [curve for curve in keys.animation_data.drivers if "Baked" in curve.data_path]
    bpy.ops.mesh.primitive_cube_add()
    inputs = addon("bridge.render.render_inputs").prepare(scene, bpy.context.view_layer, blend)
    assert any("press Bake Map" in line for line in inputs.scene.warnings)


def test_few_frames_of_a_map_are_kept(addon):
    """Straight stretches need their ends alone, and nothing is off by more than the tolerance."""
    module = addon("bridge.blends.blend_bake")
    time = np.linspace(0, 1, 41)[:, None]
    values = np.where(time < 0.5, time, 1.0 - time) * np.linspace(0, 1, 7)
    assert module.kept_frames(values) == [0, 20, 40]
    values = np.sin(3 * time) * np.linspace(0, 1, 7)
    kept = module.kept_frames(values)
    mixed = np.stack([np.interp(time[:, 0], time[kept, 0], column[kept]) for column in values.T], axis=1)
    assert len(kept) < 20 and np.abs(mixed - values).max() <= 1.01 * module.TOLERANCE
