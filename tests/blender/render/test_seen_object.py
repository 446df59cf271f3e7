# SPDX-License-Identifier: GPL-3.0-or-later
"""The object that a viewport shows at a place: hidden, unselectable and instanced ones too."""

import types

import bpy
import pytest


@pytest.fixture
def camera():
    """A flexible camera 10 above a plate at z = 0, looking straight down on 4 × 4 units; a box above it."""
    bpy.ops.mesh.primitive_plane_add(size=200)
    bpy.context.object.name = "Plate"
    bpy.ops.mesh.primitive_cube_add(size=1, location=(1, 0, 1))
    bpy.context.object.name = "Box"
    bpy.ops.object.camera_add(location=(0, 0, 10), rotation=(0, 0, 0))
    camera = bpy.context.object
    bpy.context.scene.camera = camera
    bpy.ops.scfpf.preset_apply(preset="orthographic")
    for slot, z in zip(camera.scfpf.surfaces, (-1, -21), strict=True):
        slot.object.location, slot.object.scale = (0, 0, z), (1, 1, 1)
    bpy.context.view_layer.update()
    return camera


@pytest.fixture
def seen(addon, camera):
    """A function from (x, y) in the world to the name of the object seen there."""
    bridge = addon("bridge.live.seen_object")
    read = addon("bridge.camera.read_projection").read_projection

    def look(x, y):
        view_layer = bpy.context.view_layer
        view_layer.update()
        depsgraph = bpy.context.evaluated_depsgraph_get()
        near = read(camera, depsgraph, 1.0).volume.surfaces[0]
        frame = types.SimpleNamespace(left=0.0, bottom=0.0, width=100.0, height=100.0)
        place = bridge.Place(camera, 0.5 + x / near.width, 0.5 + y / near.height, frame)
        with bpy.context.temp_override():
            context = types.SimpleNamespace(
                evaluated_depsgraph_get=lambda: depsgraph,
                selectable_objects=[o for o in view_layer.objects if o.visible_get() and not o.hide_select],
            )
            found = bridge.seen_object(context, place)
        return found.name if found is not None else ""

    return look


def test_nearest_object_is_seen_and_control_surfaces_are_not(seen):
    assert seen(1.0, 0.0) == "Box" and seen(-1.0, 0.0) == "Plate"
    assert seen(1.49, 0.49) == "Box" and seen(1.51, 0.0) == "Plate"


def test_hidden_and_unselectable_objects_are_passed(seen):
    bpy.data.objects["Box"].hide_select = True
    assert seen(1.0, 0.0) == "Plate"
    bpy.data.objects["Box"].hide_select = False
    for name in ("hide_render", "visible_camera"):
        setattr(bpy.data.objects["Box"], name, name == "hide_render")
        assert seen(1.0, 0.0) == "Plate", f"{name}: the image does not show it"
        setattr(bpy.data.objects["Box"], name, name != "hide_render")
    assert seen(1.0, 0.0) == "Box"
    bpy.data.objects["Box"].hide_set(True)
    assert seen(1.0, 0.0) == "Plate"
    bpy.data.objects["Plate"].hide_viewport = True
    assert seen(1.0, 0.0) == ""


def test_modifiers_and_other_kinds_of_object_count_as_they_are_shown(seen):
    bpy.data.objects["Box"].modifiers.new("Aside", "ARRAY").relative_offset_displace = (-2, 0, 0)
    assert seen(-1.0, 0.0) == "Box"
    bpy.ops.mesh.primitive_uv_sphere_add(radius=0.4, location=(0, 1.5, 0))
    bpy.ops.object.text_add(location=(-0.5, -1.5, 0.5))
    text = bpy.context.object
    text.data.body, text.data.size = "I", 2.0
    text.name = "Text"
    bpy.context.view_layer.update()
    across = sum(corner[0] for corner in text.bound_box) / 8 - 0.5
    assert seen(across, -1.2) == "Text" and seen(across + 1.0, -1.2) == "Plate"


def test_an_instance_stands_for_the_object_that_makes_it(seen):
    parts = bpy.data.collections.new("Parts")
    bpy.context.scene.collection.children.link(parts)
    bpy.ops.mesh.primitive_cube_add(size=0.5, location=(0, 0, 0))
    part = bpy.context.object
    for collection in part.users_collection:
        collection.objects.unlink(part)
    parts.objects.link(part)
    bpy.context.view_layer.layer_collection.children["Parts"].exclude = True
    empty = bpy.data.objects.new("Instancer", None)
    bpy.context.collection.objects.link(empty)
    empty.instance_type, empty.instance_collection = "COLLECTION", parts
    empty.location = (-1.0, 1.0, 1.0)
    assert seen(-1.0, 1.0) == "Instancer" and seen(-1.0, 0.0) == "Plate"


def test_faces_of_a_volume_and_flattened_copies_are_passed(seen):
    """A volume without a surface has no faces to meet; a flattened object vanishes if it shares its mesh."""
    box = bpy.data.objects["Box"]
    fog = bpy.data.materials.new("Fog")
    if fog.node_tree is None:
        fog.use_nodes = True
    tree = fog.node_tree
    tree.nodes.clear()
    end, volume = tree.nodes.new("ShaderNodeOutputMaterial"), tree.nodes.new("ShaderNodeVolumeScatter")
    tree.links.new(volume.outputs[0], end.inputs["Volume"])
    box.data.materials.append(fog)
    assert seen(1.0, 0.0) == "Plate"
    box.data.materials.append(None)
    top = max(box.data.polygons, key=lambda face: face.center.z)
    top.material_index = 1
    assert seen(1.0, 0.0) == "Box"
    box.scale.z = 0.0
    assert seen(1.0, 0.0) == "Box"
    copy = box.copy()
    copy.location = (-1.0, 0.0, 1.0)
    bpy.context.scene.collection.objects.link(copy)
    assert seen(1.0, 0.0) == seen(-1.0, 0.0) == "Plate"


def test_nothing_is_seen_in_an_empty_scene_and_by_a_broken_volume_there_is_a_message(addon, camera, seen):
    for name in ("Plate", "Box"):
        bpy.data.objects.remove(bpy.data.objects[name])
    assert seen(0.0, 0.0) == ""
    camera.scfpf.u_range = 0.5, 0.5
    with pytest.raises(addon("projection.user_error").UserError, match="range"):
        seen(0.0, 0.0)
