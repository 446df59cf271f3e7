# SPDX-License-Identifier: GPL-3.0-or-later
"""Picking in the image by script: stored values, reports, bad input, undo, files."""

import bpy
import pytest


@pytest.fixture
def camera():
    """A flexible camera 10 above a plate at z = 0, looking down; a cube of size 2 at its right."""
    bpy.ops.mesh.primitive_plane_add(size=200)
    bpy.context.object.name = "Plate"
    bpy.ops.mesh.primitive_cube_add(size=2, location=(2, 0, 0))
    bpy.context.object.name = "Box"
    render = bpy.context.scene.render
    render.resolution_x = render.resolution_y = 64
    bpy.ops.object.camera_add(location=(0, 0, 10), rotation=(0, 0, 0))
    camera = bpy.context.object
    bpy.context.scene.camera = camera
    bpy.ops.scfpf.preset_apply(preset="orthographic")
    slots = camera.scfpf.surfaces
    for slot, z in zip(slots, (-1, -21), strict=True):
        slot.object.location = (0, 0, z)
        slot.object.scale = (1, 1, 1)
    bpy.context.view_layer.update()
    return camera


def width_of(camera, addon):
    read = addon("bridge.camera.read_projection").read_projection
    projection = read(camera, bpy.context.evaluated_depsgraph_get(), 1.0)
    near = projection.volume.surfaces[0]
    return near.width


def readout(addon, camera):
    return " ".join(addon("operators.image.pick").pick_readout(camera.scfpf))


def test_pick_stores_position_t_distance_and_object(addon, camera):
    width = width_of(camera, addon)
    assert bpy.ops.scfpf.pick(x=0.5, y=0.4) == {"FINISHED"}
    settings = camera.scfpf
    assert settings.show_pick and tuple(settings.pick) == pytest.approx((0.5, 0.4))
    assert (settings.pick_object, settings.pick_t) == ("Plate", pytest.approx(9 / 20))
    assert settings.pick_distance == pytest.approx(9)
    bpy.ops.scfpf.pick(x=0.5 + 2 / width, y=0.5)
    assert (settings.pick_object, settings.pick_t) == ("Box", pytest.approx(8 / 20))
    assert "Box" in readout(addon, camera) and "0.40000" in readout(addon, camera)


def test_pick_agrees_with_the_image(addon, camera):
    """Objects that are hidden in renders are not hit, and those hidden in the viewport are."""
    width = width_of(camera, addon)
    where = {"x": 0.5 + 2 / width, "y": 0.5}
    bpy.data.objects["Box"].hide_set(True)
    bpy.ops.scfpf.pick(**where)
    assert camera.scfpf.pick_object == "Box"
    bpy.data.objects["Box"].hide_render = True
    bpy.ops.scfpf.pick(**where)
    assert camera.scfpf.pick_object == "Plate"


def test_a_miss_is_stored_and_reported(addon, camera):
    bpy.data.objects["Plate"].location.z = 500
    assert bpy.ops.scfpf.pick(x=0.01, y=0.01) == {"FINISHED"}
    settings = camera.scfpf
    assert (settings.pick_t, settings.pick_object, settings.pick_distance) == (-1, "", 0)
    assert settings.show_pick and "nothing" in readout(addon, camera)


def test_bad_input_is_one_message_and_changes_nothing(camera):
    bpy.ops.scfpf.pick(x=0.25, y=0.75)
    before = tuple(camera.scfpf.pick)
    for options, message in (
        ({"camera": "Nobody"}, "no object"),
        ({"camera": "Box"}, "not a flexible camera"),
    ):
        with pytest.raises(RuntimeError, match=message):
            bpy.ops.scfpf.pick(x=0.1, y=0.1, **options)
    camera.scfpf.u_range = (0.5, 0.5)
    with pytest.raises(RuntimeError, match="range"):
        bpy.ops.scfpf.pick(x=0.1, y=0.1)
    assert tuple(camera.scfpf.pick) == before
    bpy.context.scene.camera = None
    camera.scfpf.enabled = False
    with pytest.raises(RuntimeError, match="no flexible camera"):
        bpy.ops.scfpf.pick(x=0.1, y=0.1)


def test_outside_a_round_image_nothing_is_picked(camera):
    bpy.ops.scfpf.preset_apply(preset="angular_fisheye")
    bpy.ops.scfpf.pick(x=0.5, y=0.5)
    assert bpy.ops.scfpf.pick(x=0.02, y=0.02) == {"CANCELLED"}
    assert tuple(camera.scfpf.pick) == (0.5, 0.5)


@pytest.fixture
def image_editor():
    """An Image Editor in the place of the 3D viewport."""
    area = next(a for a in bpy.context.window_manager.windows[0].screen.areas if a.type == "VIEW_3D")
    area.ui_type = "IMAGE_EDITOR"
    yield area
    area.ui_type = "VIEW_3D"


def test_the_place_under_the_mouse_is_found_in_the_image_only(addon, camera, image_editor):
    click, area = addon("operators.image.image_click"), image_editor
    window = bpy.context.window_manager.windows[0]
    bpy.context.scene.render.resolution_x = bpy.context.scene.render.resolution_y = 32
    bpy.ops.scfpf.render()
    assert area.spaces.active.image.name == "SCFPF Render"
    (region,) = click.image_regions(window)
    for u, v in ((0.25, 0.25), (0.5, 0.75)):
        x, y = region.view2d.view_to_region(u, v, clip=False)
        found = click.image_position(window, region.x + x, region.y + y)
        inside = 0 <= x < region.width and 0 <= y < region.height
        assert (found is not None) == inside
        if inside:
            assert found == pytest.approx((u, v), abs=0.05)
    assert click.image_position(window, -5, -5) is None
    area.spaces.active.image = None
    assert click.image_regions(window) == []


def test_pick_survives_save_and_reload(camera, tmp_path):
    bpy.ops.scfpf.pick(x=0.3, y=0.6)
    before = tuple(camera.scfpf.pick), camera.scfpf.pick_t, camera.scfpf.pick_object
    name = camera.name
    bpy.ops.wm.save_as_mainfile(filepath=str(tmp_path / "pick.blend"))
    bpy.ops.wm.open_mainfile(filepath=str(tmp_path / "pick.blend"))
    settings = bpy.data.objects[name].scfpf
    assert settings.show_pick and (tuple(settings.pick), settings.pick_t, settings.pick_object) == before


def test_pick_in_edit_mode_sees_the_mesh_as_it_is(addon, camera):
    width = width_of(camera, addon)
    bpy.context.view_layer.objects.active = bpy.data.objects["Box"]
    bpy.ops.object.mode_set(mode="EDIT")
    try:
        assert bpy.ops.scfpf.pick(x=0.5 + 2 / width, y=0.5) == {"FINISHED"}
        assert bpy.context.mode == "EDIT_MESH"
    finally:
        bpy.ops.object.mode_set(mode="OBJECT")
    assert camera.scfpf.pick_object == "Box"
