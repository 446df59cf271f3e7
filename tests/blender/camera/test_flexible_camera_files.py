# SPDX-License-Identifier: GPL-3.0-or-later
"""A flexible camera survives undo, files, libraries, duplicates, several scenes, new names."""

import bpy
import numpy as np
import pytest
from made_cameras import names, new_camera, read, taken, three_surfaces
from mathutils import Matrix


@pytest.fixture
def camera():
    return new_camera()


def ed(operator, **options):
    with bpy.context.temp_override(window=bpy.context.window_manager.windows[0]):
        assert operator(**options) == {"FINISHED"}


def test_undo_and_redo(bridge, reading, camera):
    ed(bpy.ops.ed.undo_push, message="camera")
    three_surfaces(bridge, camera)
    ed(bpy.ops.ed.undo_push, message="three")
    bridge.remove_surface(camera, 1)
    camera.scfpf.surfaces[0].object.modifiers[0].show_viewport = True
    ed(bpy.ops.ed.undo_push, message="two")
    ed(bpy.ops.ed.undo)
    camera = bpy.data.objects["Camera"]
    assert names(camera) == taken(camera) == ["A", "B", "C"]
    assert len(read(reading, camera).volume.surfaces) == 3
    ed(bpy.ops.ed.redo)
    camera = bpy.data.objects["Camera"]
    assert names(camera) == taken(camera) == ["A", "C"] and "B" not in bpy.data.objects
    assert len(read(reading, camera).volume.surfaces) == 2
    ed(bpy.ops.ed.undo)
    ed(bpy.ops.ed.undo)
    camera = bpy.data.objects["Camera"]
    assert not camera.scfpf.enabled and camera.scfpf.volume_object is None and names(camera) == []
    assert [o.name for o in bpy.data.objects] == ["Camera"]


def test_save_and_reload(bridge, reading, camera, tmp_path):
    three_surfaces(bridge, camera)
    settings = camera.scfpf
    settings.basis, settings.u_range, settings.pixel_error = "POLYLINE", (0.25, 0.5), 0.5
    u, v, t = np.random.default_rng(2).random((3, 20))
    before = read(reading, camera).volume.evaluate(u, v, t).position
    path = str(tmp_path / "file.blend")
    bpy.ops.wm.save_as_mainfile(filepath=path)
    bpy.ops.wm.open_mainfile(filepath=path)
    camera = bpy.data.objects["Camera"]
    assert names(camera) == taken(camera) == ["A", "B", "C"]
    assert camera.scfpf.enabled and camera.scfpf.volume_object.parent == camera
    projection = read(reading, camera)
    assert np.array_equal(projection.volume.evaluate(u, v, t).position, before)
    assert projection.u_range == (0.25, 0.5) and camera.scfpf.pixel_error == 0.5


def test_a_deleted_surface_may_be_gone_after_a_reload(bridge, reading, camera, tmp_path):
    three_surfaces(bridge, camera)
    with bpy.context.temp_override(selected_objects=[bpy.data.objects["B"]]):
        bpy.ops.object.delete()
    path = str(tmp_path / "file.blend")
    bpy.ops.wm.save_as_mainfile(filepath=path)
    bpy.ops.wm.open_mainfile(filepath=path)
    camera = bpy.data.objects["Camera"]
    with pytest.raises(reading.UserError, match=r"'B' was deleted|surface 2 of 'Camera' is empty"):
        read(reading, camera)
    bridge.remove_surface(camera, 1)
    assert names(camera) == taken(camera) == ["A", "C"]
    assert len(read(reading, camera).volume.surfaces) == 2


@pytest.mark.parametrize("linked", [False, True], ids=["Shift-D", "Alt-D"])
def test_a_duplicate_with_its_surfaces_is_a_camera_of_its_own(bridge, reading, camera, linked):
    three_surfaces(bridge, camera)
    camera.scfpf.edit_volume = True
    bpy.context.view_layer.update()
    for obj in bpy.context.view_layer.objects:
        obj.select_set(True)
    bpy.context.view_layer.objects.active = camera
    bpy.ops.object.duplicate(linked=linked)
    twin = bpy.data.objects["Camera.001"]
    assert names(twin) == ["A.001", "B.001", "C.001"] and names(camera) == ["A", "B", "C"]
    assert all(slot.object.parent == twin for slot in twin.scfpf.surfaces)
    bridge.sync_volume_object(twin)
    bridge.sync_volume_object(camera)
    assert twin.scfpf.volume_object != camera.scfpf.volume_object
    assert taken(twin) == ["A.001", "B.001", "C.001"] and taken(camera) == ["A", "B", "C"]
    twin.location.x = 100
    for slot in twin.scfpf.surfaces:
        slot.object.hide_viewport = True
    assert read(reading, twin).volume.surfaces[0].matrix[0, 3] == 100
    assert read(reading, camera).volume.surfaces[0].matrix[0, 3] == 0
    bridge.remove_surface(twin, 0)
    assert names(camera) == taken(camera) == ["A", "B", "C"]


def test_a_duplicate_alone_shares_the_surfaces(bridge, reading, camera):
    three_surfaces(bridge, camera)
    camera.select_set(True)
    bpy.context.view_layer.objects.active = camera
    bpy.ops.object.duplicate()
    twin = bpy.data.objects["Camera.001"]
    bridge.sync_volume_object(twin)
    assert names(twin) == taken(twin) == ["A", "B", "C"]
    assert twin.scfpf.volume_object.name == "Camera.001 Volume"
    bridge.clear_surfaces(twin)
    assert (
        names(camera) == taken(camera) == ["A", "B", "C"] and len(read(reading, camera).volume.surfaces) == 3
    )


def test_names_do_not_matter(bridge, reading, camera):
    for surface in three_surfaces(bridge, camera):
        surface.name = "Same"
    camera.name = "Renamed"
    camera.scfpf.volume_object.name = "Other"
    for group in bpy.data.node_groups:
        group.name = "Group"
    assert bridge.sync_volume_object(camera).name == "Other"
    assert len(read(reading, camera).volume.surfaces) == 3
    bridge.add_surface(camera, "PLANE", "Fourth")
    assert taken(camera)[3] == "Fourth" and len(read(reading, camera).volume.surfaces) == 4


def test_two_cameras_in_two_scenes(bridge, reading, camera):
    three_surfaces(bridge, camera)
    other_scene = bpy.data.scenes.new("Other")
    other = new_camera("Second", other_scene)
    bridge.make_flexible(other)
    for depth in (1, 2):
        bridge.add_surface(other, "PLANE", matrix=Matrix.Translation((0, 0, -depth)))
    volume = other.scfpf.volume_object
    assert list(volume.users_collection) == [other_scene.collection]
    assert set(other_scene.objects) == {other, volume} | {slot.object for slot in other.scfpf.surfaces}
    assert len(read(reading, other, other_scene).volume.surfaces) == 2
    assert len(read(reading, camera).volume.surfaces) == 3
    with pytest.raises(
        reading.UserError, match="'A' and its camera 'Camera' are in the scene 'Scene', not in 'Other'"
    ):
        read(reading, camera, other_scene)


def test_a_camera_in_two_scenes(bridge, reading, camera):
    three_surfaces(bridge, camera)
    other_scene = bpy.data.scenes.new("Other")
    for obj in [camera, *(slot.object for slot in camera.scfpf.surfaces)]:
        other_scene.collection.objects.link(obj)
        obj.hide_viewport = True
    volume = bridge.sync_volume_object(camera)
    assert set(volume.users_scene) == {bpy.context.scene, other_scene}
    for scene in (bpy.context.scene, other_scene):
        assert len(read(reading, camera, scene).volume.surfaces) == 3
    for collection in camera.users_collection:
        if collection == other_scene.collection:
            collection.objects.unlink(camera)
    bridge.sync_volume_object(camera)
    assert list(volume.users_scene) == [bpy.context.scene]


def library_with_camera(bridge, path):
    """Saves a file with a flexible camera in the collection "Rig" and starts an empty one."""
    rig = bpy.data.collections.new("Rig")
    bpy.context.scene.collection.children.link(rig)
    camera = bpy.data.objects.new("Camera", bpy.data.cameras.new("Camera"))
    rig.objects.link(camera)
    three_surfaces(bridge, camera)
    bpy.ops.wm.save_as_mainfile(filepath=path)
    bpy.ops.wm.read_homefile(use_empty=True, use_factory_startup=True)
    with bpy.data.libraries.load(path, link=True) as (_, wanted):
        wanted.collections = ["Rig"]
    rig = bpy.data.collections["Rig"]
    bpy.context.scene.collection.children.link(rig)
    return rig


def test_a_linked_camera_works_and_is_not_edited(bridge, reading, tmp_path):
    library_with_camera(bridge, str(tmp_path / "library.blend"))
    camera = bpy.data.objects["Camera"]
    for call in (lambda: bridge.add_surface(camera, "PLANE"), lambda: bridge.clear_surfaces(camera)):
        with pytest.raises(bridge.UserError, match="library override"):
            call()
    volume = bridge.sync_volume_object(camera)
    assert bpy.context.scene.collection in volume.users_collection
    bpy.context.view_layer.layer_collection.children["Rig"].exclude = True
    bpy.context.scene.camera = camera
    assert len(read(reading, camera).volume.surfaces) == 3


def test_a_library_override_is_edited_and_survives(bridge, reading, tmp_path):
    rig = library_with_camera(bridge, str(tmp_path / "library.blend"))
    rig.override_hierarchy_create(bpy.context.scene, bpy.context.view_layer, do_fully_editable=True)
    camera = next(o for o in bpy.context.scene.objects if o.type == "CAMERA" and o.override_library)
    camera.scfpf.pixel_error = 0.7
    camera.scfpf.surfaces[0].object.location.x = 4
    bridge.sync_volume_object(camera)
    assert len(read(reading, camera).volume.surfaces) == 3
    path = str(tmp_path / "shot.blend")
    bpy.ops.wm.save_as_mainfile(filepath=path)
    bpy.ops.wm.open_mainfile(filepath=path)
    camera = next(o for o in bpy.context.scene.objects if o.type == "CAMERA" and o.override_library)
    assert camera.scfpf.pixel_error == pytest.approx(0.7)
    bridge.sync_volume_object(camera)
    assert all(slot.object.override_library for slot in camera.scfpf.surfaces)
    assert read(reading, camera).volume.surfaces[0].matrix[0, 3] == 4
