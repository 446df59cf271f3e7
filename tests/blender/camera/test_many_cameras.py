# SPDX-License-Identifier: GPL-3.0-or-later
"""Files of many flexible cameras: an edit costs what it changes, by counts and not by the clock."""

import bpy
import numpy as np
import pytest

CAMERAS = 12


@pytest.fixture
def handlers(addon):
    return addon("bridge.sync.camera_sync")


@pytest.fixture
def cameras(addon):
    """Flexible cameras of two planes each, and a cube that belongs to none."""
    flexible = addon("bridge.camera.flexible_camera")
    made = []
    for number in range(CAMERAS):
        camera = bpy.data.objects.new(f"Eye {number}", bpy.data.cameras.new("Eye"))
        bpy.context.scene.collection.objects.link(camera)
        for depth in (1.0, 2.0):
            matrix = np.eye(4)
            matrix[2, 3] = -depth
            flexible.add_surface(camera, "PLANE", f"At {depth} of {number}", matrix)
        flexible.make_flexible(camera)
        made.append(camera)
    bpy.ops.mesh.primitive_cube_add()
    bpy.context.object.name = "Cube"
    evaluate()
    return made


@pytest.fixture
def checked(handlers, monkeypatch):
    """Names of the cameras that the handler has checked since the list was cleared."""
    names, look = [], handlers.volume_facts
    monkeypatch.setattr(handlers, "volume_facts", lambda camera: (names.append(camera.name), look(camera))[1])
    return names


def evaluate():
    """Evaluate the changes, and then those of the handlers."""
    bpy.context.view_layer.update()
    bpy.context.view_layer.update()


def cube():
    return bpy.data.objects["Cube"]


def surface(camera, index=0):
    return camera.scfpf.surfaces[index].object


def assert_consistent(handlers):
    """The handler knows all cameras as they are, and each has a volume object of its own."""
    next(obj for obj in bpy.context.scene.objects if obj.name.startswith("Cube")).update_tag()
    evaluate()
    objects = [obj for obj in bpy.data.objects if obj.type == "CAMERA"]
    assert handlers._state.facts == {obj.session_uid: handlers.volume_facts(obj) for obj in objects}
    for camera in objects:
        if not camera.scfpf.enabled or not camera.users_scene:
            continue
        assert camera.scfpf.volume_object.parent == camera
        members = [slot.object for slot in camera.scfpf.surfaces if slot.object is not None]
        assert all(camera.session_uid in handlers._state.index.having(obj) for obj in (camera, *members))


def move_cube():
    cube().location.x += 1.0


def select_cube():
    cube().select_set(not cube().select_get())


def other_resolution():
    bpy.context.scene.render.resolution_x += 1


@pytest.mark.parametrize("edit", [move_cube, select_cube, other_resolution])
def test_an_unrelated_edit_looks_at_the_camera_whose_turn_it_is(cameras, checked, edit):
    checked.clear()
    edit()
    bpy.context.view_layer.update()
    assert len(checked) == 1


def test_every_camera_has_its_turn(cameras, checked):
    checked.clear()
    for _ in cameras:
        move_cube()
        bpy.context.view_layer.update()
    assert sorted(checked) == sorted(camera.name for camera in cameras)


def test_the_edit_of_a_surface_looks_at_its_camera(cameras, checked):
    for camera in cameras[2:5]:
        checked.clear()
        surface(camera).location.x += 0.1
        bpy.context.view_layer.update()
        assert camera.name in checked and len(checked) <= 2


def test_edits_of_a_list_by_scripts_are_found_in_turn(cameras, handlers, addon):
    taken = addon("bridge.volume.volume_object")
    camera = cameras[7]
    lost = surface(camera)
    assert lost.hide_select
    camera.scfpf.surfaces.remove(0)
    for _ in range(CAMERAS):
        move_cube()
        bpy.context.view_layer.update()
    modifier = camera.scfpf.volume_object.modifiers[0]
    assert taken._evaluated_members(modifier) == [surface(camera)]
    assert not lost.hide_select, "it is an ordinary object again"
    assert_consistent(handlers)


def exchange_names(cameras):
    one, other = cameras[1], cameras[2]
    first, second = one.name, other.name
    one.name = "Between"
    other.name, one.name = first, second


def rename(cameras):
    cameras[3].name, surface(cameras[4]).name = "Hawk", "Iris"


def duplicate(cameras):
    bpy.ops.object.select_all(action="DESELECT")
    cameras[5].select_set(True)
    bpy.context.view_layer.objects.active = cameras[5]
    bpy.ops.object.duplicate()


def lose_a_volume_object(cameras):
    bpy.data.objects.remove(cameras[6].scfpf.volume_object)


def delete_a_camera(cameras):
    bpy.data.objects.remove(cameras[8])


def copy_the_scene(_cameras):
    bpy.ops.scene.new(type="FULL_COPY")


@pytest.mark.parametrize(
    "act",
    [exchange_names, rename, duplicate, lose_a_volume_object, delete_a_camera, copy_the_scene],
    ids=lambda act: act.__name__,
)
def test_the_table_stays_right(cameras, handlers, act):
    act(cameras)
    assert_consistent(handlers)
    # By the table alone: nothing but the volume objects is edited.
    volumes = [o.scfpf.volume_object for o in bpy.context.scene.objects if o.type == "CAMERA"]
    for volume in volumes:
        volume.modifiers[0].show_viewport = False
    evaluate()
    assert all(volume.modifiers[0].show_viewport for volume in volumes)
    assert_consistent(handlers)


def test_undo_and_redo_leave_the_table_right(cameras, handlers, addon):
    flexible = addon("bridge.camera.flexible_camera")
    with bpy.context.temp_override(window=bpy.context.window_manager.windows[0]):
        bpy.ops.ed.undo_push(message="whole")
        flexible.remove_surface(cameras[4], 1)
        exchange_names(cameras)
        evaluate()
        bpy.ops.ed.undo_push(message="less")
        for act, count in ((bpy.ops.ed.undo, 2), (bpy.ops.ed.redo, 1)):
            act()
            assert_consistent(handlers)
            assert len(bpy.data.objects["Eye 4"].scfpf.surfaces) == count
            assert handlers.sharers(bpy.data.objects["Eye 1"]) == []


def test_who_shares_surfaces_is_known_after_renaming(cameras, handlers):
    duplicate(cameras)
    evaluate()
    copy = bpy.context.object
    assert handlers.sharers(copy) == [cameras[5].name]
    cameras[5].name = "Owl"
    evaluate()
    assert handlers.sharers(copy) == ["Owl"] and handlers.sharers(cameras[5]) == [copy.name]


def test_a_drawing_is_read_again_when_its_own_camera_is_edited(cameras, addon, monkeypatch):
    """The volumes of the others are not read for it, nor any of them for an unrelated edit."""
    drawing = addon("bridge.overlays.viewport_overlay")
    read, names = drawing.read_projection, []
    monkeypatch.setattr(
        drawing, "read_projection", lambda camera, *rest: (names.append(camera.name), read(camera, *rest))[1]
    )
    monkeypatch.setattr(drawing, "diagram", lambda *_: {})  # no GPU is needed

    def reads():
        bpy.context.view_layer.update()
        names.clear()
        scene, layer = bpy.context.scene, bpy.context.view_layer
        for camera in drawing.drawings.cameras(scene, layer):
            drawing.drawings.drawing(camera, bpy.context.evaluated_depsgraph_get(), 1.0)
        return names

    monkeypatch.setattr(drawing.gpu.shader, "from_builtin", lambda _name: None)
    drawing.drawings.clear()
    assert len(reads()) == CAMERAS
    move_cube()
    assert reads() == []
    select_cube()
    assert reads() == []
    surface(cameras[3], 1).location.z -= 0.5
    assert reads() == [cameras[3].name]
    cameras[2].name = "Hawk"
    reads()
    cameras[2].location.x += 1.0
    assert reads() == ["Hawk"]
    # A surface takes the name of another object, which has none of its own any more.
    name, cube().name = cube().name, "Ordinary"
    surface(cameras[6], 1).name = name
    reads()
    surface(cameras[6], 1).location.z -= 0.25
    assert reads() == [cameras[6].name]
    bpy.data.objects["Ordinary"].location.x += 1.0
    assert reads() == []
    surface(cameras[6], 1).name, bpy.data.objects["Ordinary"].name = "Surface", name
    reads()
    cameras[4].scfpf.basis = "POLYLINE"
    assert reads() == [cameras[4].name]
    far = surface(cameras[9], 1)
    far.location.x = 0.0
    far.keyframe_insert("location", frame=1)
    far.location.x = 9.0
    far.keyframe_insert("location", frame=10)
    reads()
    bpy.context.scene.frame_set(5)
    assert reads() == [cameras[9].name]
    bpy.context.scene.collection.objects.unlink(far)
    assert cameras[9].name in reads(), "a deleted surface makes the volume unreadable"
    cameras[7].scfpf.show_projectors = False
    assert cameras[7].name not in reads()
    assert cameras[7] not in drawing.drawings.cameras(bpy.context.scene, bpy.context.view_layer)


def test_a_scene_that_is_not_shown_is_evaluated_after_its_volume_has_changed():
    """Its depsgraph evaluates the node group of before until then: Blender crashed without that group."""
    bpy.ops.scfpf.camera_add()
    camera, shown = bpy.context.object, bpy.context.scene
    other = bpy.data.scenes.new("Other")
    for obj in shown.objects:
        other.collection.objects.link(obj)
    other.view_layers[0].update()
    for count in (3, 4, 3):
        while len(camera.scfpf.surfaces) < count:
            bpy.ops.scfpf.surface_add()
        while len(camera.scfpf.surfaces) > count:
            bpy.ops.scfpf.surface_remove()
        shown.view_layers[0].update()
        other.view_layers[0].update()
        for scene in (shown, other):
            volume = camera.scfpf.volume_object.evaluated_get(scene.view_layers[0].depsgraph)
            assert volume.modifiers[0].node_group.name == f"SCFPF Volume {count}"


def test_cameras_of_another_scene_get_their_volumes_again_at_once(cameras):
    """The evaluation of the scene that is shown does not concern them."""
    window, home = bpy.context.window, bpy.context.scene
    window.scene = bpy.data.scenes.new("Other")
    try:
        for _ in range(2):
            bpy.ops.mesh.primitive_cube_add()
            bpy.context.view_layer.update()
        lost = cameras[2::3]
        for camera in lost:
            bpy.data.objects.remove(camera.scfpf.volume_object)
        bpy.context.object.location.x += 1.0
        bpy.context.view_layer.update()
        assert [camera.name for camera in lost if camera.scfpf.volume_object is None] == []
    finally:
        window.scene = home
