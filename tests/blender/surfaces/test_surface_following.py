# SPDX-License-Identifier: GPL-3.0-or-later
"""Control surfaces that are hidden and deleted with their camera, and come back with it."""

import bpy
import pytest
from stored_edit import dangling, stored_edit

CAMERA = "Flexible Camera"


def windowed():
    return bpy.context.temp_override(window=bpy.context.window_manager.windows[0])


def run(operator, **options):
    """As in a window: the step is stored before anything is evaluated."""
    assert operator("EXEC_DEFAULT", True, **options) == {"FINISHED"}
    bpy.context.view_layer.update()


def push(message):
    bpy.ops.ed.undo_push(message=message)
    bpy.context.view_layer.update()


def select(*names):
    for obj in bpy.context.view_layer.objects:
        obj.select_set(obj.name in names)
    bpy.context.view_layer.objects.active = bpy.data.objects[names[-1]]


def undo(count=1):
    for _ in range(count):
        bpy.ops.ed.undo()
        bpy.context.view_layer.update()


def redo(count=1):
    for _ in range(count):
        bpy.ops.ed.redo()
        bpy.context.view_layer.update()


def hide_selected():
    """As H does, which needs a viewport."""

    def hide():
        for obj in bpy.context.selected_objects:
            obj.hide_set(True)

    stored_edit(hide)


def show_everything():
    """As Alt-H does."""

    def show():
        for obj in bpy.context.view_layer.objects:
            if obj.hide_get():
                obj.hide_set(False)
                obj.select_set(True)

    stored_edit(show)


def seen():
    """The names of the objects that the view layer shows; volume objects have nothing to show."""
    there = bpy.context.view_layer.objects
    return sorted(obj.name for obj in there if obj.visible_get() and not obj.scfpf_surface.is_volume)


def linked():
    return sorted(obj.name for obj in bpy.context.scene.objects if not obj.scfpf_surface.is_volume)


def volumes():
    return [obj for obj in bpy.data.objects if obj.scfpf_surface.is_volume]


@pytest.fixture
def camera():
    """A cube, and a flexible camera whose surfaces are in a collection that nothing else is in."""
    bpy.ops.mesh.primitive_cube_add()
    apart = bpy.data.collections.new("Apart")
    bpy.context.scene.collection.children.link(apart)
    bpy.ops.scfpf.camera_add()
    made = bpy.context.object
    for slot in made.scfpf.surfaces:
        for collection in slot.object.users_collection:
            collection.objects.unlink(slot.object)
        apart.objects.link(slot.object)
    bpy.context.view_layer.update()
    with windowed():
        push("start")
        yield made


def test_surfaces_are_hidden_and_shown_with_their_camera(camera, tmp_path):
    everything = seen()
    select(CAMERA)
    hide_selected()
    assert seen() == ["Cube"]
    undo()
    assert seen() == everything
    redo()
    assert seen() == ["Cube"]
    path = str(tmp_path / "hidden.blend")
    bpy.ops.wm.save_as_mainfile(filepath=path)
    bpy.ops.wm.open_mainfile(filepath=path)
    bpy.context.view_layer.update()
    assert seen() == ["Cube"]
    bpy.data.objects[CAMERA].hide_set(False)
    bpy.context.view_layer.update()
    assert seen() == everything


def test_alt_h_shows_the_surfaces_and_selects_none_that_cannot_be(camera):
    everything = seen()
    select(CAMERA)
    hide_selected()
    show_everything()
    assert seen() == everything
    assert not any(slot.object.select_get() for slot in bpy.data.objects[CAMERA].scfpf.surfaces)


def test_surfaces_are_shown_in_a_new_scene_without_collections():
    """Blender does not mark the scene collection of a new scene as visible."""
    with windowed():
        bpy.context.window.scene = bpy.data.scenes.new("New")
        run(bpy.ops.scfpf.camera_add)
        run(bpy.ops.scfpf.surface_add, kind="PLANE")
        surfaces = [slot.object for slot in bpy.context.scene.camera.scfpf.surfaces]
        assert [surface.hide_get() for surface in surfaces] == [False] * 3
        child = bpy.data.collections.new("Child")
        bpy.context.scene.collection.children.link(child)
        camera = bpy.context.scene.camera
        child.objects.link(camera)
        bpy.context.scene.collection.objects.unlink(camera)
        bpy.context.view_layer.update()
        bpy.context.view_layer.layer_collection.children["Child"].hide_viewport = True
        bpy.context.view_layer.update()
        assert [surface.hide_get() for surface in surfaces] == [True] * 3


def test_what_the_artist_has_hidden_stays_hidden(camera):
    near, far = (slot.object for slot in camera.scfpf.surfaces)
    near.hide_set(True)
    push("hidden by the artist")
    before = seen()
    for switch in ("hide_set", "hide_viewport"):
        for hidden in (True, False):
            if switch == "hide_set":
                camera.hide_set(hidden)
            else:
                camera.hide_viewport = hidden
            bpy.context.view_layer.update()
            assert seen() == (["Cube"] if hidden else before)
    camera.hide_set(True)
    bpy.context.view_layer.update()
    # The artist wants to see one without its camera.
    far.hide_set(False)
    bpy.context.view_layer.update()
    assert seen() == ["Cube", far.name]


def test_a_hidden_collection_and_a_local_view(camera):
    """The collection hides the surfaces of its camera; one viewport's local view hides none of the others."""
    held = bpy.data.collections.new("Held")
    bpy.context.scene.collection.children.link(held)
    for collection in camera.users_collection:
        collection.objects.unlink(camera)
    held.objects.link(camera)
    bpy.context.view_layer.update()
    before = seen()
    layer = bpy.context.view_layer.layer_collection.children["Held"]
    for hidden in (True, False):
        layer.hide_viewport = hidden
        bpy.context.view_layer.update()
        assert seen() == (["Cube"] if hidden else before)
    window = bpy.context.window_manager.windows[0]
    area = next(area for area in window.screen.areas if area.type == "VIEW_3D")
    region = next(region for region in area.regions if region.type == "WINDOW")
    select("Cube")
    with bpy.context.temp_override(window=window, area=area, region=region):
        bpy.ops.view3d.localview(frame_selected=False)
        bpy.data.objects["Cube"].hide_set(True)
        bpy.data.objects["Cube"].hide_set(False)
        bpy.context.view_layer.update()
    assert not any(slot.object.hide_get() for slot in camera.scfpf.surfaces)


def test_a_surface_of_two_cameras_is_hidden_with_both(camera):
    select(CAMERA)
    run(bpy.ops.object.duplicate)
    copy = bpy.context.object
    both = [slot.object.name for slot in copy.scfpf.surfaces]
    copy.hide_set(True)
    bpy.context.view_layer.update()
    assert set(both) <= set(seen())
    bpy.data.objects[CAMERA].hide_set(True)
    bpy.context.view_layer.update()
    assert set(both).isdisjoint(seen())


def test_the_volume_of_a_hidden_camera_is_still_read(camera, addon):
    camera.hide_set(True)
    bpy.context.view_layer.update()
    camera.scfpf.surfaces[1].object.location.z -= 1.0
    bpy.context.view_layer.update()
    read = addon("bridge.camera.read_projection")
    volume = read.read_projection(camera, bpy.context.evaluated_depsgraph_get(), 1.0).volume
    world = camera.scfpf.surfaces[1].object.matrix_world.translation
    assert volume.evaluate([0.5], [0.5], [1.0]).position[:, 0] == pytest.approx(world, abs=1e-5)


@pytest.mark.parametrize("way", ["delete", "remove"])
def test_a_deleted_camera_takes_its_surfaces_along_and_brings_them_back(camera, way, tmp_path):
    before, shown = linked(), seen()
    run(bpy.ops.mesh.primitive_cone_add)
    with_cone = linked()
    select(CAMERA)
    if way == "delete":
        run(bpy.ops.object.delete)
    else:
        bpy.data.objects.remove(bpy.data.objects[CAMERA])
        push("removed")
    assert linked() == ["Cone", "Cube"]
    assert not volumes()
    run(bpy.ops.mesh.primitive_torus_add)
    undo()
    assert linked() == ["Cone", "Cube"]
    undo()
    assert linked() == with_cone
    undo()
    assert (linked(), seen()) == (before, shown)
    redo(2)
    assert linked() == ["Cone", "Cube"]
    undo()
    assert linked() == with_cone
    redo(2)
    assert linked() == ["Cone", "Cube", "Torus"]
    path = str(tmp_path / "deleted.blend")
    bpy.ops.wm.save_as_mainfile(filepath=path)
    bpy.ops.wm.open_mainfile(filepath=path)
    assert sorted(obj.name for obj in bpy.data.objects) == ["Cone", "Cube", "Torus"]


def test_a_camera_deleted_by_a_script_is_saved_without_its_surfaces(camera, tmp_path):
    bpy.data.objects.remove(camera)
    path = str(tmp_path / "deleted.blend")
    bpy.ops.wm.save_as_mainfile(filepath=path)
    bpy.ops.wm.open_mainfile(filepath=path)
    assert [obj.name for obj in bpy.data.objects] == ["Cube"]


def test_surfaces_that_are_not_the_camera_s_own_stay(camera):
    """One of the artist's, one that a modifier of the artist's refers to, one that another camera has."""
    bpy.ops.mesh.primitive_plane_add()
    own = bpy.context.object
    own.name = "Artist's"
    select("Artist's", CAMERA)
    run(bpy.ops.scfpf.surface_attach)
    select(CAMERA)
    run(bpy.ops.scfpf.surface_add)
    camera = bpy.data.objects[CAMERA]
    used, shared, third = (slot.object for slot in camera.scfpf.surfaces if slot.object.name != "Artist's")
    names = used.name, shared.name, third.name
    bpy.data.objects["Cube"].modifiers.new("On It", "SHRINKWRAP").target = used
    other = bpy.data.objects.new("Other", bpy.data.cameras.new("Other"))
    bpy.context.scene.collection.objects.link(other)
    other.scfpf.surfaces.add().object = shared
    push("prepared")
    select(CAMERA)
    run(bpy.ops.object.delete)
    assert linked() == sorted(["Artist's", "Cube", "Other", *names[:2]])
    assert not bpy.data.objects["Artist's"].hide_select
    undo()
    assert linked() == sorted(["Artist's", CAMERA, "Cube", "Other", *names])


def test_a_surface_that_was_taken_off_the_list_stays_when_its_camera_goes(camera):
    near = camera.scfpf.surfaces[0].object.name
    camera.scfpf.surfaces.remove(0)
    push("taken off")
    select(CAMERA)
    run(bpy.ops.object.delete)
    assert linked() == ["Cube", near]


def test_a_deleted_surface_does_not_come_back_with_its_camera(camera):
    near = camera.scfpf.surfaces[0].object.name
    select(CAMERA)
    run(bpy.ops.object.delete)
    undo()
    bpy.data.objects[near].hide_select = False
    select(near)
    run(bpy.ops.object.delete)
    after = linked()
    assert near not in after
    run(bpy.ops.mesh.primitive_cone_add)
    undo()
    assert linked() == after


def test_a_volume_object_made_between_two_steps_leaves_no_pointer_to_it():
    """Both steps lack the volume object, so that Blender keeps the scene, which the new one is linked to."""
    bpy.ops.scfpf.camera_add()
    bpy.ops.ed.undo_push(message="start")
    for _ in range(2):
        stored_edit(lambda: bpy.data.objects.remove(bpy.data.objects[CAMERA].scfpf.volume_object))
        assert bpy.data.objects[CAMERA].scfpf.volume_object is not None
    lost = []
    look = bpy.app.handlers.persistent(lambda *_: lost.extend(dangling()))
    bpy.app.handlers.undo_post.insert(0, look)
    try:
        bpy.ops.ed.undo()
    finally:
        bpy.app.handlers.undo_post.remove(look)
    assert not lost
    assert bpy.data.objects[CAMERA].scfpf.volume_object.users_collection
