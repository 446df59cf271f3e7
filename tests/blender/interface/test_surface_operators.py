# SPDX-License-Identifier: GPL-3.0-or-later
"""Operators on the list of control surfaces: add, attach, move, select and remove."""

import bpy
import numpy as np
import pytest
from mathutils import Vector
from operator_steps import add_camera, add_cube, poll_message, projection_of, surface_names
from recorded_layout import drawn

KINDS = (
    "POINT",
    "PLANE",
    "PATCH",
    "DISC",
    "CYLINDER",
    "CONE",
    "SPHERE",
    "PARABOLOID",
    "GRID",
    "UV_MESH",
    "NURBS",
)


@pytest.mark.parametrize("kind", KINDS)
def test_surface_of_every_kind_goes_between_its_neighbours(addon, kind):
    add_cube()
    camera = add_camera()
    near, far = (slot.object for slot in camera.scfpf.surfaces)
    assert bpy.ops.scfpf.surface_add(kind=kind) == {"FINISHED"}
    slots = camera.scfpf.surfaces
    assert [slots[0].object, slots[2].object] == [near, far]
    assert camera.scfpf.active_surface == 1
    assert slots[1].object.scfpf_surface.kind == kind
    assert bpy.context.object == camera, "the panel in the Data tab would be gone"
    middle = projection_of(addon, camera).transformed(np.linalg.inv(camera.matrix_world)).volume.surfaces[1]
    ends = np.array([0.0, 0.5, 1.0])
    u, v = (axis.ravel() for axis in np.meshgrid(ends, ends))
    depth = -middle.evaluate(u, v).position[2]
    assert depth.min() >= -near.location.z - 1e-4
    assert depth.max() <= -far.location.z + 1e-4


@pytest.mark.parametrize("kind", ["PLANE", "CYLINDER", "GRID"])
def test_a_surface_lands_where_the_things_in_the_picture_are(kind):
    """A wall that fills the picture 8 before the camera, and a far surface 1000 before it."""
    bpy.ops.mesh.primitive_cube_add(size=1, location=(0, 8.5, 0))
    bpy.context.object.scale = (40, 1, 40)
    bpy.ops.object.camera_add(rotation=(np.pi / 2, 0, 0))
    bpy.context.scene.camera = camera = bpy.context.object
    camera.data.clip_end = 1000.0
    assert bpy.ops.scfpf.camera_from_camera() == {"FINISHED"}
    bpy.context.view_layer.update()
    assert camera.scfpf.surfaces[1].object.location.z == pytest.approx(-1000)
    assert bpy.ops.scfpf.surface_add(kind=kind) == {"FINISHED"}
    bpy.context.view_layer.update()
    middle = camera.scfpf.surfaces[1].object
    low, high = (
        f(c[1] for c in (middle.matrix_world @ Vector(b) for b in middle.bound_box)) for f in (min, max)
    )
    assert low <= 8.01 and high >= 7.99 and (low + high) / 2 == pytest.approx(8, rel=0.3)


def test_surface_that_a_menu_adds_is_selected_as_blenders_add_does(addon):
    add_cube()
    camera = add_camera()
    record = drawn(bpy.types.SCFPF_MT_surface_add) + drawn(bpy.types.SCFPF_MT_surface_add_more)
    assert len([entry for entry in record if entry == ("operator", "scfpf.surface_add")]) > 10
    assert bpy.ops.scfpf.surface_add(kind="PLANE", select=True) == {"FINISHED"}
    added = camera.scfpf.surfaces[1].object
    assert bpy.context.object == added and bpy.context.selected_objects == [added]
    assert camera.scfpf.edit_volume and not added.hide_select
    assert addon("operators.common.target").camera_of(bpy.context) == camera


def test_plane_between_two_planes_of_a_frustum_leaves_the_projectors_straight(addon):
    add_cube()
    camera = add_camera()
    before = projection_of(addon, camera).volume
    bpy.ops.scfpf.surface_add(kind="PLANE")
    after = projection_of(addon, camera).volume
    u, v, t = np.random.default_rng(1).random((3, 20))
    near, far = (before.evaluate(u, v, np.full(20, end)).position for end in (0.0, 1.0))
    way = (far - near) / np.linalg.norm(far - near, axis=0)
    from_near = after.evaluate(u, v, t).position - near
    assert np.abs(from_near - (from_near * way).sum(axis=0) * way).max() < 1e-4
    assert np.allclose(after.evaluate(u, v, np.ones(20)).position, far, atol=1e-4)


def test_surface_at_the_end_goes_on_outwards(addon):
    add_cube()
    camera = add_camera()
    camera.scfpf.active_surface = 1
    near, far = (slot.object for slot in camera.scfpf.surfaces)
    bpy.ops.scfpf.surface_add(kind="PLANE")
    assert surface_names(camera)[:2] == [near.name, far.name]
    assert camera.scfpf.surfaces[2].object.location.z == pytest.approx(
        2 * far.location.z - near.location.z, rel=1e-4
    )


def test_cylinder_after_a_cylinder_is_concentric(addon):
    add_cube()
    camera = add_camera(preset="cylindrical_panorama")
    bpy.ops.scfpf.surface_add(kind="CYLINDER")
    read = addon("bridge.surfaces.surface_object").surface_parameters
    near, middle, far = (read(slot.object) for slot in camera.scfpf.surfaces)
    # The cube is around the camera's place, or before it, by a few of its sizes.
    assert near["radius"] < middle["radius"] < 0.2 * far["radius"]
    assert middle["arc"] == pytest.approx(near["arc"])
    assert np.allclose(camera.scfpf.surfaces[1].object.location, 0, atol=1e-4)


def test_surface_list_move_select_remove():
    add_cube()
    camera = add_camera()
    bpy.ops.scfpf.surface_add(kind="DISC")
    assert surface_names(camera) == ["Near", "Disk", "Far"]
    bpy.ops.scfpf.surface_move(direction="UP")
    assert surface_names(camera) == ["Disk", "Near", "Far"] and camera.scfpf.active_surface == 0
    bpy.ops.scfpf.surface_move(direction="DOWN")
    assert surface_names(camera) == ["Near", "Disk", "Far"] and camera.scfpf.active_surface == 1
    bpy.ops.scfpf.surface_select(index=2)
    assert bpy.context.object.name == "Far" and bpy.context.selected_objects == [bpy.context.object]
    assert camera.scfpf.active_surface == 2
    # With a surface active, the operators are about the camera that has it.
    bpy.ops.scfpf.surface_remove()
    assert surface_names(camera) == ["Near", "Disk"] and camera.scfpf.active_surface == 1
    assert "Far" not in bpy.data.objects


def test_attach_takes_a_mesh_and_refuses_the_rest():
    camera = add_camera()
    bpy.ops.mesh.primitive_grid_add(x_subdivisions=3, y_subdivisions=4)
    grid = bpy.context.object
    camera.select_set(True)
    bpy.context.view_layer.objects.active = camera
    bpy.ops.scfpf.surface_attach()
    assert surface_names(camera) == ["Near", "Far", grid.name]
    assert grid.scfpf_surface.kind == "GRID" and camera.scfpf.active_surface == 2
    bpy.ops.scfpf.surface_remove()
    assert grid.name in bpy.data.objects, "an artist's own mesh was deleted"
    bpy.ops.object.light_add()
    camera.select_set(True)
    bpy.context.view_layer.objects.active = camera
    with pytest.raises(RuntimeError, match="cannot be a control surface"):
        bpy.ops.scfpf.surface_attach()
    assert len(camera.scfpf.surfaces) == 2
    bpy.context.selected_objects[0].select_set(False)
    for obj in bpy.context.selected_objects:
        obj.select_set(obj == camera)
    assert "Select an object" in poll_message(bpy.ops.scfpf.surface_attach)


def test_attach_to_a_hidden_camera_hides_the_mesh_with_it():
    camera = add_camera()
    bpy.ops.mesh.primitive_grid_add()
    grid = bpy.context.object
    bpy.context.scene.camera = camera
    camera.hide_set(True)
    assert bpy.ops.scfpf.surface_attach() == {"FINISHED"}
    assert surface_names(camera) == ["Near", "Far", grid.name]


def test_surface_operators_without_surfaces_or_with_a_deleted_one():
    camera = add_camera()
    bpy.data.objects.remove(bpy.data.objects["Near"])
    with pytest.raises(RuntimeError, match="remove it"):
        bpy.ops.scfpf.surface_select(index=0)
    bpy.ops.scfpf.surface_add(kind="PLANE")
    camera.scfpf.active_surface = 0
    while len(camera.scfpf.surfaces):
        assert bpy.ops.scfpf.surface_remove() == {"FINISHED"}
    for operator in (bpy.ops.scfpf.surface_remove, bpy.ops.scfpf.surface_move, bpy.ops.scfpf.surface_select):
        assert "Choose a control surface" in poll_message(operator)
    assert bpy.ops.scfpf.surface_add(kind="PLANE") == {"FINISHED"}
    assert len(camera.scfpf.surfaces) == 1


def test_hidden_surface_cannot_be_selected_and_says_so():
    camera = add_camera()
    camera.scfpf.surfaces[0].object.hide_set(True)
    with pytest.raises(RuntimeError, match="hidden"):
        bpy.ops.scfpf.surface_select(index=0)
    assert bpy.context.object == camera
