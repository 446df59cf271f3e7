# SPDX-License-Identifier: GPL-3.0-or-later
"""The settings of scenes in which a first flexible camera is made, and those of scenes that have some."""

import bpy
import pytest
from shown_materials import scene_with_camera


@pytest.fixture
def scene():
    """A scene with an ordinary, active camera and a cube."""
    made = scene_with_camera()
    bpy.ops.mesh.primitive_cube_add()
    bpy.context.view_layer.objects.active = made.camera
    return made


def has_shadows(scene):
    """Return whether the world casts shadows, and whether that is set."""
    return scene.scfpf_sampling.world_shadows, scene.scfpf_sampling.is_property_set("world_shadows")


def from_screen():
    bpy.ops.mesh.primitive_plane_add(size=2)
    return bpy.ops.scfpf.camera_from_screen()


WAYS = {
    "add": lambda: bpy.ops.scfpf.camera_add(),
    "from a camera": lambda: bpy.ops.scfpf.camera_from_camera(),
    "toggle": lambda: bpy.ops.scfpf.camera_toggle(),
    "preset": lambda: bpy.ops.scfpf.preset_apply(preset="panini"),
    "screen": from_screen,
    "view": lambda: bpy.ops.scfpf.aim_view_add(camera="Camera", object="Cube"),
}


@pytest.mark.parametrize("way", WAYS)
def test_a_first_flexible_camera_lets_the_world_cast_shadows(way, scene):
    assert has_shadows(scene) == (False, False)
    other = bpy.data.scenes.new("Other")
    assert WAYS[way]() == {"FINISHED"}
    assert has_shadows(scene) == (True, True)
    assert has_shadows(other) == (False, False)


@pytest.mark.parametrize("way", WAYS)
def test_what_is_switched_off_stays_so(way, scene):
    scene.scfpf_sampling.world_shadows = False
    assert WAYS[way]() == {"FINISHED"}
    assert has_shadows(scene) == (False, True)


@pytest.mark.parametrize("way", WAYS)
def test_a_scene_that_has_a_flexible_camera_keeps_its_settings(way, scene, tmp_path):
    """As in a file that was saved while the switch was off, which stores nothing."""
    assert bpy.ops.scfpf.camera_from_camera() == {"FINISHED"}
    scene.scfpf_sampling.property_unset("world_shadows")
    name = scene.camera.name
    path = str(tmp_path / "kept.blend")
    bpy.ops.wm.save_as_mainfile(filepath=path)
    bpy.ops.wm.open_mainfile(filepath=path)
    scene = bpy.context.scene
    # The camera itself, switched off and on again.
    for _ in range(2):
        bpy.context.view_layer.objects.active = bpy.data.objects[name]
        assert bpy.ops.scfpf.camera_toggle() == {"FINISHED"}
        assert has_shadows(scene) == (False, False)
    second = bpy.data.objects.new("Second", bpy.data.cameras.new("Second"))
    scene.collection.objects.link(second)
    bpy.context.view_layer.objects.active = second
    assert WAYS[way]() == {"FINISHED"}
    assert has_shadows(scene) == (False, False)


def test_a_refused_camera_changes_no_setting(scene):
    scene.camera.data.type = "PANO"
    with pytest.raises(RuntimeError):
        bpy.ops.scfpf.camera_from_camera()
    assert has_shadows(scene) == (False, False)
    scene.camera.data.type = "PERSP"
    with pytest.raises(RuntimeError):
        bpy.ops.scfpf.aim_view_add(camera="Camera", collection="Nothing")
    assert has_shadows(scene) == (False, False) and not scene.camera.scfpf.enabled
