# SPDX-License-Identifier: GPL-3.0-or-later
"""Undo and redo as artists use them: all operators of the extension, and fifty steps mixed with Blender's."""

import bpy
import numpy as np
import pytest

U, V, T = np.random.default_rng(11).random((3, 40))
# Two pictures of a volume are the same within float32; its coordinates are about 10.
FLOAT32 = 1e-4


def viewport():
    window = bpy.context.window_manager.windows[0]
    area = next(area for area in window.screen.areas if area.type == "VIEW_3D")
    region = next(region for region in area.regions if region.type == "WINDOW")
    return bpy.context.temp_override(window=window, area=area, region=region)


def windowed():
    return bpy.context.temp_override(window=bpy.context.window_manager.windows[0])


@pytest.fixture
def volumes(addon):
    """Return 40 points of the volume of each flexible camera by name, or the error of reading it."""
    read = addon("bridge.camera.read_projection")

    def all_volumes():
        depsgraph = bpy.context.evaluated_depsgraph_get()
        found = {}
        for camera in bpy.context.scene.objects:
            if camera.type != "CAMERA" or not camera.scfpf.enabled:
                continue
            try:
                volume = read.read_projection(camera, depsgraph, 16 / 9).volume
                found[camera.name] = volume.evaluate(U, V, T).position
            except read.UserError as error:
                found[camera.name] = str(error)
        return found

    return all_volumes


@pytest.fixture
def state(volumes):
    """All that an undo must bring back: the objects, the cameras' lists and what they show."""

    def look():
        bpy.context.view_layer.update()
        cameras = [o for o in bpy.context.scene.objects if o.type == "CAMERA"]
        lists = {c.name: [s.object and s.object.name for s in c.scfpf.surfaces] for c in cameras}
        settings = {c.name: (c.scfpf.enabled, tuple(c.scfpf.pick), c.scfpf.report) for c in cameras}
        # Volume objects come and go by themselves, after the step that was stored.
        names = sorted(o.name for o in bpy.context.scene.objects if not o.scfpf_surface.is_volume)
        return (names, lists, settings), volumes()

    return look


def same(one, other):
    if one[0] != other[0] or one[1].keys() != other[1].keys():
        return False
    for name, shown in one[1].items():
        if isinstance(shown, str) or isinstance(other[1][name], str):
            if not (isinstance(shown, str) and shown == other[1][name]):
                return False
        elif np.abs(shown - other[1][name]).max() > FLOAT32:
            return False
    return True


def select(*names):
    for obj in bpy.context.view_layer.objects:
        obj.select_set(obj.name in names)
    bpy.context.view_layer.objects.active = bpy.data.objects[names[-1]]


def run(operator, **options):
    assert operator("EXEC_DEFAULT", True, **options) == {"FINISHED"}


def replay(steps, state):
    """Do all steps, undo them all, redo them all; every state on the way is the one seen before."""
    bpy.ops.ed.undo_push(message="start")
    states = [state()]
    for step in steps:
        step()
        states.append(state())
    for number, before in reversed(list(enumerate(states[:-1]))):
        bpy.ops.ed.undo()
        assert same(state(), before), f"undo of step {number}"
    for number, after in enumerate(states[1:]):
        bpy.ops.ed.redo()
        assert same(state(), after), f"redo of step {number}"
    return states


def near_surface():
    return bpy.context.scene.camera.scfpf.surfaces[0].object.name


def attach_the_sheet():
    select("Sheet", "Flexible Camera")
    run(bpy.ops.scfpf.surface_attach)


def move_active(x):
    """As G does: change, then store the step."""
    bpy.context.object.location.x += x
    bpy.ops.ed.undo_push(message="Move")


def snap():
    camera = bpy.context.scene.camera
    select(camera.name)
    with viewport():
        camera.scfpf.surfaces[0].object.location.z -= 0.125
        # Storing the step as operators do would open their panel in the viewport, which needs a window.
        assert bpy.ops.scfpf.surface_snap_to_view() == {"FINISHED"}
        bpy.ops.ed.undo_push(message="Snap")


def single_user():
    """Edits of a second camera that shares the surfaces of the first."""
    select("Flexible Camera")
    run(bpy.ops.object.duplicate)
    copy = bpy.context.object
    bpy.context.scene.camera = copy
    bpy.context.view_layer.update()
    run(bpy.ops.scfpf.volume_single_user)
    assert {slot.object.parent for slot in copy.scfpf.surfaces} == {copy}
    assert not {s.object for s in copy.scfpf.surfaces} & {
        s.object for s in bpy.data.objects["Flexible Camera"].scfpf.surfaces
    }


def test_undo_and_redo_of_the_operators_that_place_share_and_look(state):
    """Operators that the tests of edits and tools leave out."""
    bpy.context.scene.render.resolution_x = bpy.context.scene.render.resolution_y = 16
    bpy.ops.mesh.primitive_grid_add(x_subdivisions=3, y_subdivisions=3)
    bpy.context.object.name = "Sheet"
    bpy.ops.mesh.primitive_cube_add(location=(1, 2, 0))
    bpy.ops.scfpf.camera_add()
    bpy.context.object.scfpf.samples = 1
    steps = [
        snap,
        attach_the_sheet,
        lambda: run(bpy.ops.scfpf.surface_select, index=1),
        lambda: run(bpy.ops.scfpf.surface_remove),
        lambda: run(bpy.ops.scfpf.pick, x=0.25, y=0.75),
    ]
    with windowed():
        replay(steps, state)
        select("Flexible Camera")
        # Two steps: the duplicate and the single-user copy.
        bpy.ops.ed.undo_push(message="again")
        before = state()
        single_user()
        after = state()
        bpy.ops.ed.undo()
        bpy.ops.ed.undo()
        assert same(state(), before)
        bpy.ops.ed.redo()
        bpy.ops.ed.redo()
        assert same(state(), after)
        run(bpy.ops.scfpf.render)
        assert "SCFPF Render" in bpy.data.images
        rendered = state()
        bpy.ops.ed.undo()
        assert same(state(), after)
        bpy.ops.ed.redo()
        assert same(state(), rendered)


def duplicate_everything():
    """Shift-D of the camera and its surfaces."""
    camera = bpy.context.scene.camera
    select(*(slot.object.name for slot in camera.scfpf.surfaces), camera.name)
    run(bpy.ops.object.duplicate)
    # The handler gives the copy a volume object only after the step has been stored.
    bpy.context.view_layer.update()


def delete_the_copy():
    copy = bpy.context.object
    assert copy.type == "CAMERA" and copy != bpy.context.scene.camera
    select(*(slot.object.name for slot in copy.scfpf.surfaces), copy.name)
    run(bpy.ops.object.delete)
    bpy.context.view_layer.update()
    select("Flexible Camera")


def hide_far(value):
    camera = bpy.context.scene.camera
    camera.scfpf.surfaces[-1].object.hide_viewport = value
    bpy.ops.ed.undo_push(message="Hide")


def test_fifty_undos_in_a_row(state):
    bpy.ops.mesh.primitive_cube_add(location=(1, 2, 0))
    bpy.ops.scfpf.camera_add()
    group = [
        lambda: run(bpy.ops.scfpf.surface_add, kind="CYLINDER"),
        lambda: hide_far(True),
        duplicate_everything,
        lambda: move_active(1.0),
        delete_the_copy,
        lambda: run(bpy.ops.scfpf.surface_move, direction="UP"),
        lambda: run(bpy.ops.scfpf.surface_remove),
        lambda: hide_far(False),
        lambda: run(bpy.ops.scfpf.volume_frame, pan=0.1, zoom=1.25),
        lambda: move_active(-0.5),
    ]
    # As many as Blender keeps when it comes from the box would be 32.
    limit = bpy.context.preferences.edit.undo_steps
    bpy.context.preferences.edit.undo_steps = 128
    try:
        with windowed():
            states = replay(group * 5, state)
    finally:
        bpy.context.preferences.edit.undo_steps = limit
    assert len(states) == 51
    volumes = [o for o in bpy.data.objects if o.scfpf_surface.is_volume]
    assert len(volumes) == 1, "no volume object is left over"


def test_a_deleted_camera_s_volume_object_does_not_come_back():
    """It goes after the step was stored: undo finds it in there again, without its camera."""
    bpy.ops.ed.undo_push(message="start")
    bpy.ops.scfpf.camera_add("EXEC_DEFAULT", True)
    bpy.ops.scfpf.camera_add("EXEC_DEFAULT", True)
    bpy.ops.object.delete("EXEC_DEFAULT", True)
    for _ in range(2):
        bpy.ops.mesh.primitive_cube_add("EXEC_DEFAULT", True)
    bpy.context.view_layer.update()
    for step in (bpy.ops.ed.undo, bpy.ops.ed.undo, bpy.ops.ed.redo):
        assert step() == {"FINISHED"}
        bpy.context.view_layer.update()
        owned = {obj.scfpf.volume_object for obj in bpy.data.objects if obj.type == "CAMERA"}
        assert {obj for obj in bpy.data.objects if obj.scfpf_surface.is_volume} == owned - {None}


def test_a_camera_has_its_volume_object_when_undo_brings_its_scene_back():
    """It goes after the step was stored; what two steps agree on, like the pointer, Blender leaves alone."""
    bpy.ops.scene.new(type="EMPTY")
    bpy.ops.scfpf.camera_add()
    camera = bpy.context.object.name
    bpy.ops.ed.undo_push(message="camera")
    bpy.ops.ed.undo_push(message="once more")
    bpy.ops.scene.delete("EXEC_DEFAULT", True)
    bpy.context.view_layer.update()
    assert bpy.data.objects[camera].scfpf.volume_object is None
    assert bpy.ops.ed.undo() == {"FINISHED"}
    volume = bpy.context.scene.objects[camera].scfpf.volume_object
    assert volume.parent.name == camera
    assert [obj for obj in bpy.context.scene.objects if obj.scfpf_surface.is_volume] == [volume]
