# SPDX-License-Identifier: GPL-3.0-or-later
"""Finding the selection in the image: its box against closed forms, its hiders, its part outside."""

import bpy
import numpy as np
import pytest


@pytest.fixture
def camera(addon):
    """A flexible camera 10 above, looking down over 10 × 10; a plate at z = -3, a cube at (2, 1, 0)."""
    bpy.ops.mesh.primitive_plane_add(size=200, location=(0, 0, -3))
    bpy.context.object.name = "Plate"
    bpy.ops.mesh.primitive_cube_add(size=2, location=(2, 1, 0))
    bpy.context.object.name = "Box"
    render = bpy.context.scene.render
    render.resolution_x = render.resolution_y = 64
    bpy.ops.object.camera_add(location=(0, 0, 10), rotation=(0, 0, 0))
    camera = bpy.context.object
    bpy.context.scene.camera = camera
    bpy.ops.scfpf.preset_apply(preset="orthographic")
    change = addon("bridge.surfaces.surface_object").set_surface_parameters
    for slot, z in zip(camera.scfpf.surfaces, (-1, -21), strict=True):
        change(slot.object, {"width": 10.0, "height": 10.0})
        slot.object.location = (0, 0, z)
        slot.object.scale = (1, 1, 1)
    bpy.context.view_layer.update()
    return camera


def select(*names):
    for obj in bpy.context.view_layer.objects:
        obj.select_set(obj.name in names)


def test_the_box_is_that_of_the_vertices_and_the_projector_that_of_the_middle(camera):
    select("Box")
    assert bpy.ops.scfpf.find_in_image() == {"FINISHED"}
    settings = camera.scfpf
    assert settings.show_found and tuple(settings.found_box) == pytest.approx((0.6, 0.5, 0.8, 0.7), abs=1e-6)
    assert settings.found_object.split(" · ") == ["Box", "20.0 % × 20.0 % of the picture"]
    assert settings.show_pick and tuple(settings.pick) == pytest.approx((0.7, 0.6), abs=1e-6)
    assert (settings.pick_object, settings.pick_t) == ("Box", pytest.approx(8 / 20))


def test_modifiers_count(camera):
    bpy.data.objects["Box"].modifiers.new("Array", "ARRAY").count = 2
    select("Box")
    bpy.ops.scfpf.find_in_image()
    assert tuple(camera.scfpf.found_box) == pytest.approx((0.6, 0.5, 1.0, 0.7), abs=1e-6)


def test_a_larger_thing_before_it_hides_it_and_a_smaller_one_partly(camera):
    bpy.ops.mesh.primitive_plane_add(size=6, location=(2, 1, 4))
    bpy.context.object.name = "Lid"
    select("Box")
    bpy.ops.scfpf.find_in_image()
    assert camera.scfpf.found_object.endswith("Hidden from the camera behind Lid")
    assert camera.scfpf.pick_object == "Lid"
    bpy.data.objects["Lid"].location.x = 5.0
    bpy.ops.scfpf.find_in_image()
    assert camera.scfpf.found_object.endswith("Partly hidden behind Lid")
    # What lies behind hides nothing.
    select("Lid")
    bpy.ops.scfpf.find_in_image()
    assert "idden" not in camera.scfpf.found_object
    # Several things selected do not hide one another.
    select("Lid", "Box")
    bpy.ops.scfpf.find_in_image()
    assert camera.scfpf.found_object.startswith("2 objects") and "idden" not in camera.scfpf.found_object


def test_outside_and_partly_outside(camera):
    box = bpy.data.objects["Box"]
    select("Box")
    bpy.ops.scfpf.find_in_image()
    before = tuple(camera.scfpf.pick)
    box.location.x = 50
    assert bpy.ops.scfpf.find_in_image() == {"FINISHED"}
    assert not camera.scfpf.show_found and tuple(camera.scfpf.pick) == before
    box.location.x = 5.0
    bpy.ops.scfpf.find_in_image()
    assert "Partly outside" in camera.scfpf.found_object
    assert camera.scfpf.found_box[0] == pytest.approx(0.9, abs=1e-6)


def test_a_lamp_is_found_at_its_place(camera):
    bpy.ops.object.light_add(location=(-2, -4, -1))
    assert bpy.ops.scfpf.find_in_image() == {"FINISHED"}
    box = camera.scfpf.found_box
    assert tuple(box) == pytest.approx((0.3, 0.1, 0.3, 0.1), abs=1e-6)
    bpy.context.object.location.z = -4
    bpy.ops.scfpf.find_in_image()
    assert "behind Plate" in camera.scfpf.found_object


def test_a_thing_with_many_points_is_found_by_its_outermost(camera):
    bpy.ops.mesh.primitive_uv_sphere_add(segments=64, ring_count=32, radius=1.5, location=(-1, 0.5, 1))
    bpy.ops.scfpf.find_in_image()
    expected = np.array([-2.5, -1, 0.5, 2]) / 10 + 0.5
    assert np.allclose(camera.scfpf.found_box, expected, atol=1.5 * (1 - np.cos(np.pi / 8)) / 10)


def test_nothing_selected_no_camera_and_undo(camera):
    select(camera.name)
    with pytest.raises(RuntimeError, match="Select the object"):
        bpy.ops.scfpf.find_in_image()
    select("Box")
    bpy.context.view_layer.objects.active = bpy.data.objects["Box"]
    bpy.ops.ed.undo_push(message="start")
    bpy.ops.scfpf.find_in_image()
    bpy.ops.ed.undo_push(message="found")
    bpy.ops.ed.undo()
    camera = bpy.context.scene.camera
    assert not camera.scfpf.show_found and not camera.scfpf.show_pick
    bpy.context.scene.camera = None
    select("Box")
    with pytest.raises(RuntimeError):
        bpy.ops.scfpf.find_in_image()


def test_marks_are_drawn_where_they_belong(addon, camera):
    marks = addon("bridge.overlays.image_marks")

    def to_region(x, y):
        return 100 * x, 200 * y

    assert marks.mark_lines(camera.scfpf, to_region, 1.0) == []
    select("Box")
    bpy.ops.scfpf.find_in_image()
    lines = np.array(marks.mark_lines(camera.scfpf, to_region, 2.0))
    box, cross = lines[:8], lines[8:]
    margin = 2 * marks.MARGIN
    assert np.allclose(box.min(0), [60 - margin, 100 - margin], atol=1e-3)
    assert np.allclose(box.max(0), [80 + margin, 140 + margin], atol=1e-3)
    assert np.allclose(cross.mean(0), [70, 120], atol=1e-3) and np.ptp(cross, axis=0).max() < 50
    camera.scfpf.show_found = False
    assert len(marks.mark_lines(camera.scfpf, to_region, 1.0)) == 8
