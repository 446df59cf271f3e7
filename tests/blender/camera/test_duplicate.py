# SPDX-License-Identifier: GPL-3.0-or-later
"""A flexible camera duplicated: alone it shares its surfaces, and the panel says so; or with them."""

import bpy
import numpy as np
import pytest

U, V, T = np.random.default_rng(5).random((3, 40))


@pytest.fixture
def shown(addon):
    read_projection = addon("bridge.camera.read_projection").read_projection

    def positions(camera):
        bpy.context.view_layer.update()
        depsgraph = bpy.context.evaluated_depsgraph_get()
        return read_projection(camera, depsgraph, 16 / 9).volume.evaluate(U, V, T).position

    return positions


@pytest.fixture
def sharers(addon):
    return addon("bridge.sync.camera_sync").sharers


def add_camera(preset="around_the_car"):
    bpy.ops.scfpf.camera_add(preset=preset)
    bpy.context.view_layer.update()
    return bpy.context.object


def surfaces(camera):
    return [slot.object for slot in camera.scfpf.surfaces]


def test_a_camera_duplicated_alone_names_the_one_that_it_shares_surfaces_with(sharers):
    camera = add_camera()
    assert sharers(camera) == []
    bpy.ops.object.duplicate()
    copy = bpy.context.object
    bpy.context.view_layer.update()
    assert surfaces(copy) == surfaces(camera)
    assert sharers(camera) == [copy.name] and sharers(copy) == [camera.name]
    bpy.ops.scfpf.volume_single_user()
    bpy.context.view_layer.update()
    assert sharers(camera) == sharers(copy) == []
    assert not set(surfaces(copy)) & set(surfaces(camera))


@pytest.mark.parametrize("preset", ["around_the_car", "angular_fisheye", "VIEW"])
@pytest.mark.parametrize("hidden", ["", "hide_viewport", "hide_set"])
def test_a_camera_is_duplicated_with_its_surfaces(shown, preset, hidden):
    camera = add_camera(preset)
    if hidden:
        for surface in surfaces(camera):
            surface.hide_set(True) if hidden == "hide_set" else setattr(surface, hidden, True)
    before, old = shown(camera), surfaces(camera)
    switches = [surface.hide_select for surface in old]
    assert bpy.ops.scfpf.camera_duplicate() == {"FINISHED"}
    copy = bpy.context.object
    assert copy != camera and copy.data != camera.data and bpy.context.selected_objects == [copy]
    assert np.allclose(shown(copy), before, atol=1e-5)
    assert surfaces(camera) == old and not set(surfaces(copy)) & set(old)
    assert all(new.data != surface.data for new, surface in zip(surfaces(copy), old, strict=True))
    assert all(new.parent == copy for new in surfaces(copy))
    assert [s.hide_select for s in surfaces(copy)] == switches == [s.hide_select for s in old]
    assert copy.scfpf.volume_object not in (None, camera.scfpf.volume_object)
    copy.location.x += 3
    surfaces(copy)[-1].location.z -= 1
    assert np.allclose(shown(camera), before, atol=1e-5)
    assert not np.allclose(shown(copy), before, atol=0.5)


def test_the_copy_is_animated_by_itself(shown):
    camera = add_camera("VIEW")
    far = surfaces(camera)[-1]
    for frame in (1, 10):
        far.location.x = frame
        far.keyframe_insert("location", frame=frame)
    far.hide_viewport = True
    bpy.ops.scfpf.camera_duplicate()
    own = surfaces(bpy.context.object)[-1]
    assert own.animation_data.action not in (None, far.animation_data.action)
    bpy.context.scene.frame_set(10)
    assert own.location.x == far.location.x == 10


def test_a_hidden_camera_is_refused_and_duplicating_is_undone():
    camera = add_camera()
    bpy.ops.ed.undo_push(message="Before")
    count = len(bpy.data.objects)
    bpy.ops.scfpf.camera_duplicate()
    bpy.ops.ed.undo_push(message="Duplicate")
    assert len(bpy.data.objects) > count
    bpy.ops.ed.undo()
    assert len(bpy.data.objects) == count
    camera = bpy.data.objects["Flexible Camera"]
    bpy.context.view_layer.objects.active = camera
    camera.hide_set(True)
    with pytest.raises(RuntimeError, match="show it in the Outliner first"):
        bpy.ops.scfpf.camera_duplicate()
    assert len(bpy.data.objects) == count
