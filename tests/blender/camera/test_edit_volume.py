# SPDX-License-Identifier: GPL-3.0-or-later
"""The Edit Volume mode: surfaces come to the front and can be selected, or are out of the way."""

import bpy
import pytest


def add_camera():
    bpy.ops.scfpf.camera_add()
    return bpy.context.object


def surfaces(camera):
    return [slot.object for slot in camera.scfpf.surfaces]


def is_free(surface):
    return (surface.hide_select, surface.show_in_front) == (False, True) and surface.display_type != "BOUNDS"


def is_away(surface):
    return (surface.hide_select, surface.show_in_front) == (True, False) and surface.display_type == "BOUNDS"


def activate(*objects):
    for obj in bpy.context.selected_objects:
        obj.select_set(False)
    for obj in objects:
        obj.select_set(True)
    bpy.context.view_layer.objects.active = objects[0]


def test_new_surfaces_obey_the_mode_and_a_removed_one_is_an_ordinary_object_again():
    camera = add_camera()
    assert all(map(is_away, surfaces(camera)))
    bpy.ops.scfpf.surface_add(kind="SPHERE")
    bpy.ops.scfpf.surface_add(kind="NURBS")
    assert len(surfaces(camera)) == 4 and all(map(is_away, surfaces(camera)))
    bpy.ops.scfpf.edit_volume()
    assert camera.scfpf.edit_volume and all(map(is_free, surfaces(camera)))
    bpy.ops.scfpf.surface_add(kind="GRID")
    bpy.ops.scfpf.surface_duplicate()
    bpy.ops.scfpf.surface_insert(resolution=16)
    assert all(map(is_free, surfaces(camera)))
    bpy.ops.scfpf.preset_apply(preset="angular_fisheye")
    assert all(map(is_free, surfaces(camera)))
    bpy.ops.scfpf.edit_volume()
    assert all(map(is_away, surfaces(camera)))


def test_an_artists_own_mesh_is_free_while_it_is_attached_and_after_that():
    camera = add_camera()
    bpy.ops.mesh.primitive_grid_add()
    grid = bpy.context.object
    activate(camera, grid)
    bpy.ops.scfpf.surface_attach()
    assert camera.scfpf.edit_volume and is_free(grid) and grid.select_get()
    bpy.ops.scfpf.edit_volume()
    assert is_away_from_clicks(grid)
    bpy.ops.scfpf.surface_remove()
    assert (grid.hide_select, grid.show_in_front) == (False, False)


def is_away_from_clicks(obj):
    return (obj.hide_select, obj.show_in_front) == (True, False)


def test_attaching_what_cannot_be_a_surface_leaves_the_mode_as_it_was():
    camera = add_camera()
    bpy.ops.object.light_add()
    activate(camera, bpy.context.object)
    with pytest.raises(RuntimeError, match="cannot be a control surface"):
        bpy.ops.scfpf.surface_attach()
    assert not camera.scfpf.edit_volume and all(map(is_away, surfaces(camera)))


def test_two_cameras_have_each_their_own_mode_and_a_shared_surface_is_free_in_either(addon):
    first, second = add_camera(), add_camera()
    shared = surfaces(first)[0]
    addon("bridge.camera.flexible_camera").attach_surface(second, shared)
    activate(second)
    bpy.ops.scfpf.edit_volume()
    assert not first.scfpf.edit_volume and is_away(surfaces(first)[1])
    assert all(map(is_free, surfaces(second))) and is_free(shared)
    activate(first)
    bpy.ops.scfpf.edit_volume()
    bpy.ops.scfpf.edit_volume()
    assert all(map(is_free, surfaces(second))) and is_away(surfaces(first)[1])
    activate(second)
    bpy.ops.scfpf.edit_volume()
    assert all(map(is_away, surfaces(first) + surfaces(second)))


def test_a_shared_surface_taken_off_the_list_in_the_mode_obeys_the_other_camera(addon):
    bridge = addon("bridge.camera.flexible_camera")
    first, second = add_camera(), add_camera()
    shared = surfaces(first)[0]
    bridge.attach_surface(second, shared)
    second.scfpf.edit_volume = True
    assert is_free(shared)
    bridge.remove_surface(second, 2)
    assert is_away(shared) and shared in surfaces(first)


def test_selecting_from_the_list_enters_the_mode_and_handles_have_their_object():
    camera = add_camera()
    bpy.ops.scfpf.surface_select(index=1)
    far = surfaces(camera)[1]
    assert camera.scfpf.edit_volume and bpy.context.object == far and far.select_get()
    # A geometry node's handles show for the active object's active modifier.
    assert far.modifiers.active is not None and far.modifiers.active.show_viewport


def test_leaving_the_mode_hands_over_to_the_camera():
    camera = add_camera()
    bpy.ops.scfpf.surface_select(index=1)
    bpy.ops.scfpf.edit_volume()
    assert bpy.context.object == camera and bpy.context.selected_objects == [camera]
    bpy.ops.object.select_all(action="SELECT")
    assert not any(surface.select_get() for surface in surfaces(camera))


def test_leaving_the_mode_leaves_another_selection_alone():
    camera = add_camera()
    bpy.ops.scfpf.edit_volume()
    bpy.ops.mesh.primitive_cube_add()
    cube = bpy.context.object
    bpy.context.scene.camera = camera
    bpy.ops.scfpf.edit_volume()
    assert not camera.scfpf.edit_volume
    assert bpy.context.object == cube and bpy.context.selected_objects == [cube]


def test_undo_redo_save_and_reload(tmp_path):
    add_camera()
    bpy.ops.ed.undo_push(message="start")
    name = bpy.context.object.name
    bpy.ops.scfpf.edit_volume()
    bpy.ops.ed.undo_push(message="on")
    bpy.ops.ed.undo()
    camera = bpy.data.objects[name]
    assert not camera.scfpf.edit_volume and all(map(is_away, surfaces(camera)))
    bpy.ops.ed.redo()
    path = str(tmp_path / "mode.blend")
    bpy.ops.wm.save_as_mainfile(filepath=path)
    bpy.ops.wm.open_mainfile(filepath=path)
    camera = bpy.data.objects[name]
    assert camera.scfpf.edit_volume and all(map(is_free, surfaces(camera)))


def test_linked_cameras_and_surfaces_refuse_and_overrides_do_not(addon, tmp_path):
    camera = add_camera()
    path = str(tmp_path / "library.blend")
    bpy.data.libraries.write(path, {camera})
    bpy.ops.wm.read_homefile(use_empty=True, use_factory_startup=True)
    with bpy.data.libraries.load(path, link=True) as (source, target):
        target.objects = source.objects
    camera = next(obj for obj in target.objects if obj.type == "CAMERA")
    for obj in target.objects:
        bpy.context.scene.collection.objects.link(obj)
    bpy.context.scene.camera = camera
    mode = addon("bridge.volume.edit_mode")
    with pytest.raises(mode.UserError, match="library override"):
        mode.set_edit_volume(camera, True)
    with pytest.raises(RuntimeError, match="library override"):
        bpy.ops.scfpf.edit_volume()
    assert not camera.scfpf.edit_volume
    local = camera.override_create(remap_local_usages=True)
    with pytest.raises(mode.UserError, match=r"'(Near|Far)' is linked.*library override"):
        mode.set_edit_volume(local, True)
    assert not local.scfpf.edit_volume
    bpy.context.scene.camera = local
    local.scfpf.edit_volume = True  # by a script: what can be changed obeys, nothing raises
    assert all(surface.hide_select for surface in surfaces(local))


def add_camera_with_meshes_of_the_artist():
    """A camera whose surfaces are not deleted with it."""
    camera = add_camera()
    for surface in surfaces(camera):
        surface.scfpf_surface.kind = "GRID"
        surface.scfpf_surface.is_made = False
    return camera


def deleted(*objects):
    activate(*objects)
    bpy.ops.object.delete()
    bpy.context.view_layer.update()


@pytest.mark.parametrize("in_mode", [False, True])
def test_surfaces_of_a_deleted_camera_are_ordinary_objects_again(in_mode):
    first = add_camera_with_meshes_of_the_artist()
    kept = surfaces(first)
    second = add_camera_with_meshes_of_the_artist()
    others = surfaces(second)
    second.scfpf.surfaces.add().object = kept[0]
    first.scfpf.edit_volume = in_mode
    bpy.context.view_layer.update()
    deleted(first)
    assert is_away(kept[0]) and all(map(is_away, others))
    assert (kept[1].hide_select, kept[1].show_in_front) == (False, False)
    kept[1].show_in_front = True
    deleted(second)
    assert not any(surface.hide_select or surface.show_in_front for surface in (kept[0], *others))
    assert kept[1].show_in_front, "what the artist chose afterwards stays"


def test_surfaces_of_a_deleted_camera_stay_free_when_later_steps_are_undone():
    camera = add_camera_with_meshes_of_the_artist()
    names = [surface.name for surface in surfaces(camera)]
    bpy.context.view_layer.update()
    bpy.ops.ed.undo_push(message="Before")
    deleted(camera)
    bpy.ops.ed.undo_push(message="Delete")
    bpy.ops.mesh.primitive_cube_add()
    bpy.ops.ed.undo_push(message="Cube")
    bpy.ops.ed.undo()
    bpy.context.view_layer.update()
    assert not any(bpy.data.objects[name].hide_select for name in names)
    bpy.ops.ed.undo()
    bpy.context.view_layer.update()
    assert all(bpy.data.objects[name].hide_select for name in names)
    bpy.ops.ed.redo()
    bpy.context.view_layer.update()
    assert not any(bpy.data.objects[name].hide_select for name in names)


def test_a_dense_mesh_stays_a_box_which_can_be_clicked():
    """A dense mesh stays a box in the mode, as its wires would cover the scene; released, it is a wire."""
    camera = add_camera()
    camera.scfpf.active_surface = 1
    assert bpy.ops.scfpf.surface_to_grid(columns=64, rows=64) == {"FINISHED"}
    coarse, dense = surfaces(camera)
    bpy.ops.scfpf.edit_volume()
    assert is_free(coarse) and not dense.hide_select and dense.show_in_front
    assert dense.display_type == "BOUNDS"
    bpy.ops.scfpf.edit_volume()
    assert is_away(coarse) and is_away(dense)
    dense.parent = None
    assert bpy.ops.scfpf.surface_remove() == {"FINISHED"}
    assert dense.display_type == "WIRE" and not dense.hide_select


def test_the_mode_ends_without_an_active_object_and_with_an_empty_slot():
    bpy.ops.scfpf.camera_add()
    camera = bpy.context.object
    bpy.context.scene.camera = camera
    assert bpy.ops.scfpf.edit_volume() == {"FINISHED"}
    camera.scfpf.surfaces[0].object = None
    bpy.context.view_layer.objects.active = None
    assert bpy.ops.scfpf.edit_volume() == {"FINISHED"}
    assert not camera.scfpf.edit_volume


def test_the_mode_ends_though_the_view_layer_leaves_the_camera_out():
    camera, scene = add_camera(), bpy.context.scene
    bpy.ops.scfpf.edit_volume()
    surface = surfaces(camera)[0]
    for obj in surfaces(camera):
        if obj.name not in scene.collection.objects:
            scene.collection.objects.link(obj)
    hidden = bpy.data.collections.new("Hidden")
    scene.collection.children.link(hidden)
    for users in camera.users_collection:
        users.objects.unlink(camera)
    hidden.objects.link(camera)
    bpy.context.view_layer.layer_collection.children["Hidden"].exclude = True
    activate(surface)
    assert bpy.ops.scfpf.edit_volume() == {"FINISHED"}
    assert not camera.scfpf.edit_volume and all(map(is_away, surfaces(camera)))
    assert not bpy.context.selected_objects
