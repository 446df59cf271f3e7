# SPDX-License-Identifier: GPL-3.0-or-later
"""What artists do that nobody expects: each is done or refused in words, and nothing is left behind."""

import bpy
import numpy as np
import pytest


@pytest.fixture
def camera():
    bpy.ops.scfpf.camera_add()
    return bpy.context.object


def select(*objects):
    for obj in bpy.context.selected_objects:
        obj.select_set(False)
    for obj in objects:
        obj.select_set(True)
    bpy.context.view_layer.objects.active = objects[-1]


def child_collection(name, linked_from=None):
    """A collection of the scene, active; linked_from: a file to link it from."""
    made = bpy.data.collections.new(name)
    if linked_from is not None:
        bpy.data.libraries.write(str(linked_from), {made})
        bpy.data.collections.remove(made)
        with bpy.data.libraries.load(str(linked_from), link=True) as (_, wanted):
            wanted.collections = [name]
        (made,) = wanted.collections
    bpy.context.scene.collection.children.link(made)
    layer = bpy.context.view_layer.layer_collection.children[name]
    bpy.context.view_layer.active_layer_collection = layer
    return layer


def test_a_surface_that_blender_has_made_a_curve_of_is_taken_off_the_list(camera):
    camera.scfpf.edit_volume = True
    surface = camera.scfpf.surfaces[0].object
    select(surface)
    assert bpy.ops.object.convert(target="CURVE") == {"FINISHED"} and surface.type == "CURVE"
    select(camera)
    camera.scfpf.active_surface = 0
    count = len(bpy.data.objects)
    with pytest.raises(RuntimeError, match="cannot be a control surface"):
        bpy.ops.scfpf.surface_duplicate()
    assert len(bpy.data.objects) == count  # no half of a copy
    assert bpy.ops.scfpf.surface_remove() == {"FINISHED"}
    assert len(camera.scfpf.surfaces) == 1 and len(bpy.data.objects) == count - 1 and not bpy.data.curves


def test_a_grid_mapping_whose_mesh_is_a_curve_now_is_removed(camera):
    bpy.ops.scfpf.mapping_add(kind="GRID")
    grid = camera.scfpf.mappings[0].grid
    select(grid)
    bpy.ops.object.convert(target="CURVE")
    select(camera)
    assert bpy.ops.scfpf.mapping_remove() == {"FINISHED"}
    assert not camera.scfpf.mappings and not bpy.data.curves


def test_linked_duplicates_become_grids_of_their_own(camera):
    near, far = (slot.object for slot in camera.scfpf.surfaces)
    width = [surface.dimensions.x for surface in (near, far)]
    far.data = near.data  # as Alt-D leaves them: the empty mesh is shared, the modifiers are not
    for surface in (near, far):
        surface.scfpf_surface.kind = "GRID"
    bpy.context.view_layer.update()
    assert near.data != far.data
    np.testing.assert_allclose([surface.dimensions.x for surface in (near, far)], width, rtol=1e-5)


def test_a_full_list_leaves_no_copy_behind(addon, camera):
    most = addon("scfpf_addon.projection.preset").MAXIMUM_SURFACES
    surfaces = camera.scfpf.surfaces
    for _ in range(most - len(surfaces)):
        surfaces.add().object = surfaces[1].object
    count = len(bpy.data.objects)
    with pytest.raises(RuntimeError, match="the most that a volume may have"):
        bpy.ops.scfpf.surface_duplicate()
    assert len(bpy.data.objects) == count


def test_a_duplicated_surface_has_its_own_keyframes(camera):
    surface = camera.scfpf.surfaces[0].object
    for frame, place in ((1, 0.0), (11, 5.0)):
        surface.location.x = place
        surface.keyframe_insert("location", index=0, frame=frame)
    camera.scfpf.active_surface = 0
    bpy.ops.scfpf.surface_duplicate()
    copy = camera.scfpf.surfaces[1].object
    assert copy.animation_data.action != surface.animation_data.action
    surface.keyframe_delete("location", index=0, frame=11)
    bpy.context.scene.frame_set(11)
    assert (surface.location.x, copy.location.x) == (0.0, 5.0)


def test_a_camera_is_added_while_another_files_collection_is_active(tmp_path):
    child_collection("Theirs", tmp_path / "theirs.blend")
    assert bpy.ops.scfpf.camera_add() == {"FINISHED"}
    assert bpy.context.object.users_collection[0] == bpy.context.scene.collection


def test_a_blend_of_a_camera_in_an_excluded_collection_is_seen():
    layer = child_collection("Away")
    bpy.ops.scfpf.camera_add()
    layer.exclude = True
    assert bpy.context.object is None and bpy.context.scene.camera is not None
    assert bpy.ops.scfpf.camera_blend_preset(preset="perspective") == {"FINISHED"}
    assert bpy.context.object == bpy.context.scene.camera and bpy.context.object.visible_get()
