# SPDX-License-Identifier: GPL-3.0-or-later
"""The stack of image mappings in Blender: edited, animated, read, saved, written as an ST map."""

from itertools import pairwise

import bpy
import numpy as np
import pytest


@pytest.fixture
def camera():
    """A flexible camera in a 160 × 90 image."""
    render = bpy.context.scene.render
    render.resolution_x, render.resolution_y, render.resolution_percentage = 160, 90, 100
    assert bpy.ops.scfpf.camera_add() == {"FINISHED"}
    return bpy.context.object


@pytest.fixture
def look(addon):
    """The projection's image mapping at places: look(camera, x, y) → ImageMap."""
    read = addon("bridge.camera.read_projection").read_projection

    def found(camera, x=(0.3, 0.6, 0.8), y=(0.2, 0.55, 0.7)):
        projection = read(camera, bpy.context.evaluated_depsgraph_get(), 16 / 9)
        return projection.reparameterisation.map(np.array(x), np.array(y), 16 / 9)

    return found


def add(kind, **values):
    assert bpy.ops.scfpf.mapping_add(kind=kind) == {"FINISHED"}
    camera = bpy.context.scene.camera
    mapping = camera.scfpf.mappings[-1]
    for name, value in values.items():
        setattr(mapping, name, value)
    return mapping


def places(image):
    return np.stack([image.u, image.v])


def test_a_stack_is_what_its_mappings_are_one_after_the_other(addon, camera, look):
    radial = addon("projection.mappings.radial")
    add("LENS", centre=(0.35, 0.25), radius=0.4, magnification=3.0, falloff=0.6)
    add("DISTORTION", numerator=(0.05, 0.01, 0.0), denominator=(0.02, 0.0, 0.0), radius=1.25)
    add("DISPLAY", arc=1.2, distance=1.5)
    x, y = np.array([0.3, 0.6, 0.8]), np.array([0.2, 0.55, 0.7])
    stack = [
        radial.MagicLens(0.4, 3.0, 0.6, (0.35, 0.25)),
        radial.Distortion((0.05, 0.01, 0.0), (0.02, 0.0, 0.0), 1.25),
        radial.CurvedDisplay(1.2, 1.5),
    ]

    def through(order):
        a, b = x, y
        for number in order:
            a, b, _ = stack[number].points(a, b, 16 / 9)
        return np.stack([a, b])

    np.testing.assert_allclose(places(look(camera)), through([0, 1, 2]), atol=1e-7)
    camera.scfpf.active_mapping = 0
    assert bpy.ops.scfpf.mapping_move(direction="DOWN") == {"FINISHED"}
    np.testing.assert_allclose(places(look(camera)), through([1, 0, 2]), atol=1e-7)
    camera.scfpf.mappings[2].enabled = False
    np.testing.assert_allclose(places(look(camera)), through([1, 0]), atol=1e-7)
    camera.scfpf.mappings[0].backwards = True
    a, b = stack[1].image_positions(x, y, 16 / 9)
    np.testing.assert_allclose(places(look(camera)), stack[0].points(a, b, 16 / 9)[:2], atol=1e-7)
    for _ in range(3):
        assert bpy.ops.scfpf.mapping_remove() == {"FINISHED"}
    np.testing.assert_array_equal(places(look(camera)), [x, y])
    assert not bpy.ops.scfpf.mapping_remove.poll()


def test_keyframes_act_and_go_along_when_the_order_changes(camera, look):
    add("DISPLAY")
    lens = add("LENS", radius=1.0, falloff=0.0)
    for frame, value in ((1, 2.0), (11, 4.0)):
        lens.magnification = value
        camera.keyframe_insert("scfpf.mappings[1].magnification", frame=frame)
    camera.scfpf.active_mapping = 1
    bpy.ops.scfpf.mapping_move(direction="UP")
    camera.scfpf.mappings[1].enabled = False
    slopes = []
    for frame in (1, 11):
        bpy.context.scene.frame_set(frame)
        slopes.append(look(camera, (0.5,), (0.5,)).jacobian[0, 0, 0])
    np.testing.assert_allclose(slopes, [0.5, 0.25], rtol=1e-6)
    bpy.ops.scfpf.mapping_remove()
    assert not [c for layer in camera.animation_data.action.layers for s in layer.strips
                for bag in s.channelbags for c in bag.fcurves]  # fmt: skip


def test_the_curve_widget_is_the_radial_curve(camera, look):
    mapping = add("RADIAL_CURVE")
    np.testing.assert_allclose(places(look(camera)), [(0.3, 0.6, 0.8), (0.2, 0.55, 0.7)], atol=1e-6)
    widget = mapping.curve.nodes["Curve"].mapping
    widget.curves[0].points.new(0.5, 0.7)
    widget.update()
    # Places at radii 0.1, 0.5 and 0.9 to the right of the centre of a 16:9 image.
    radii = np.array([0.1, 0.5, 0.9])
    image = look(camera, 0.5 + radii * 9 / 32, np.full(3, 0.5))
    shown = (image.u - 0.5) * 32 / 9
    np.testing.assert_allclose(shown, [widget.evaluate(widget.curves[0], r) for r in radii], atol=2e-5)


def test_a_grid_is_deformed_by_its_modifiers_hidden_or_not(camera, look):
    mapping = add("GRID")
    np.testing.assert_allclose(places(look(camera)), [(0.3, 0.6, 0.8), (0.2, 0.55, 0.7)], atol=1e-6)
    grid = mapping.grid
    assert grid.parent == camera and grid.hide_render
    displace = grid.modifiers.new("Shift", "DISPLACE")
    displace.direction, displace.strength, displace.mid_level = "X", 0.1, 0.0
    for hidden in (False, True):
        grid.hide_viewport = hidden
        np.testing.assert_allclose(look(camera).u, [0.4, 0.7, 0.9], atol=1e-6)
    bpy.ops.scfpf.mapping_remove()
    assert not [obj for obj in bpy.data.objects if "Picture Grid" in obj.name]


def test_an_st_map_that_was_written_is_read_as_the_stack(addon, camera, look, monkeypatch):
    add("LENS", centre=(0.4, 0.4), radius=0.8, magnification=1.5, falloff=1.0)
    add("DISTORTION", numerator=(0.05, 0.0, 0.0))
    inside = ((0.3, 0.6, 0.75), (0.3, 0.55, 0.7))
    before = look(camera, *inside)
    assert bpy.ops.scfpf.st_map_write() == {"FINISHED"}
    assert bpy.ops.scfpf.st_map_write(inverse=True) == {"FINISHED"}
    written, inverse = (image for image in bpy.data.images if image.name.startswith("SCFPF ST Map"))
    for mapping in camera.scfpf.mappings:
        mapping.enabled = False
    read = add("ST_MAP", image=written)
    after = look(camera, *inside)
    # A hundredth of a pixel of 160 × 90.
    np.testing.assert_allclose(places(after), places(before), atol=1e-4)
    np.testing.assert_allclose(after.jacobian, before.jacobian, atol=0.02)
    add("ST_MAP", image=inverse)
    np.testing.assert_allclose(places(look(camera, *inside)), inside, atol=3e-4)
    camera.scfpf.mappings[-1].enabled = False
    read.image.pixels.foreach_set(np.full(160 * 90 * 4, 0.75, np.float32))
    read.image.update()
    monkeypatch.setattr(addon("bridge.mappings.st_map_image"), "READ_AFTER", 0.0)
    np.testing.assert_allclose(look(camera).u, 0.75)
    read.image = None
    errors = addon("projection.user_error").UserError
    with pytest.raises(errors, match="has no image"):
        look(camera)


def test_an_st_map_that_no_file_can_hold_is_written_with_a_warning(addon, camera, monkeypatch, capfd):
    packing = addon("bridge.blender.packing")
    monkeypatch.setattr(packing, "LARGEST_FILE", packing.BESIDES_PIXELS)
    assert bpy.ops.scfpf.st_map_write() == {"FINISHED"}
    image = bpy.data.images["SCFPF ST Map"]
    assert not image.packed_file and max(image.pixels[:]) == 1.0
    assert "'SCFPF ST Map' has more than the 2 GB" in capfd.readouterr().out


def test_u_and_v_are_written_with_the_ranges_and_holes(camera):
    assert bpy.ops.scfpf.preset_apply(preset="angular_fisheye") == {"FINISHED"}
    camera.scfpf.v_range = 0.0, 0.5
    assert bpy.ops.scfpf.st_map_write(content="PARAMETERS") == {"FINISHED"}
    image = bpy.data.images["SCFPF ST Map"]
    pixels = np.array(image.pixels[:]).reshape(90, 160, 4)
    x, y = np.meshgrid((np.arange(160) + 0.5) / 160, (np.arange(90) + 0.5) / 90)
    radius = np.hypot((x - 0.5) * 32 / 9, (y - 0.5) * 2)
    np.testing.assert_array_equal(pixels[..., 3] > 0.5, radius <= 1)
    np.testing.assert_allclose(pixels[..., 1], np.where(radius <= 1, radius / 2, 0), atol=1e-6)


def test_everything_survives_a_file_and_a_duplicate(camera, look, tmp_path):
    add("LENS", magnification=3.0)
    widget = add("RADIAL_CURVE").curve.nodes["Curve"].mapping
    widget.curves[0].points.new(0.4, 0.6)
    widget.update()
    add("GRID").grid.data.vertices[8].co.x += 0.05
    bpy.ops.scfpf.st_map_write()
    add("ST_MAP", image=bpy.data.images["SCFPF ST Map"])
    before = places(look(camera))
    bpy.ops.wm.save_as_mainfile(filepath=str(tmp_path / "stack.blend"))
    bpy.ops.wm.open_mainfile(filepath=str(tmp_path / "stack.blend"))
    camera = bpy.context.scene.camera
    np.testing.assert_allclose(places(look(camera)), before, atol=1e-7)
    bpy.context.view_layer.objects.active = camera
    assert bpy.ops.scfpf.camera_duplicate() == {"FINISHED"}
    copy = bpy.context.object
    assert copy != camera and copy.scfpf.mappings[1].curve != camera.scfpf.mappings[1].curve
    assert copy.scfpf.mappings[2].grid not in (None, camera.scfpf.mappings[2].grid)
    np.testing.assert_allclose(places(look(copy)), before, atol=1e-7)
    camera.scfpf.mappings[2].grid.data.vertices[8].co.x += 0.2
    np.testing.assert_allclose(places(look(copy)), before, atol=1e-7)


def test_bad_stacks_say_what_to_do(addon, camera, look):
    errors = addon("projection.user_error").UserError
    add("DISPLAY", arc=2.9, distance=0.3)
    with pytest.raises(errors, match="move away"):
        look(camera)
    bpy.ops.scfpf.mapping_remove()
    grid = add("GRID").grid
    bpy.data.objects.remove(grid)
    with pytest.raises(errors, match="'Deformed Grid' has no grid"):
        look(camera)


def test_presets_replace_the_stack(camera):
    add("GRID")
    assert bpy.ops.scfpf.preset_apply(preset="perspective") == {"FINISHED"}
    assert not camera.scfpf.mappings
    assert not [obj for obj in bpy.data.objects if "Grid" in obj.name]


@pytest.mark.usefixtures("built_groups")
def test_the_live_preview_s_table_follows_edits_frames_and_the_resolution(addon, camera):
    """Its mesh has u and v of the table's corners as the stack is; without a stack it is empty."""
    table_data = addon("scanline.preview.preview_data")
    bpy.ops.mesh.primitive_cube_add()
    bpy.context.view_layer.objects.active = camera
    assert bpy.ops.scfpf.preview_toggle() == {"FINISHED"}
    source = table_data.preview_of(camera, bpy.context.scene)

    def corners():
        bpy.context.view_layer.update()
        mesh = source.scfpf_preview.table.data
        found = np.empty(3 * len(mesh.vertices), np.float32)
        mesh.vertices.foreach_get("co", found)
        return found.reshape(-1, 3)

    assert len(corners()) == 0
    lens = add("LENS", radius=1.0, falloff=1.0)
    seen = [corners()]
    lens.magnification = 3.0
    seen.append(corners())
    bpy.context.scene.render.resolution_x = 90
    seen.append(corners())
    for frame, value in ((1, 1.5), (11, 4.0)):
        lens.magnification = value
        camera.keyframe_insert("scfpf.mappings[0].magnification", frame=frame)
    for frame in (1, 11):
        bpy.context.scene.frame_set(frame)
        seen.append(corners())
    middle = [rows[len(rows) // 2 + 1, 0] - rows[len(rows) // 2, 0] for rows in seen]
    assert all(abs(a - b) > 1e-6 for a, b in pairwise(middle)), middle
    lens.enabled = False
    assert len(corners()) == 0
