# SPDX-License-Identifier: GPL-3.0-or-later
"""The objects that the nodes preview shows."""

import bpy
import pytest


@pytest.fixture
def shown(addon):
    """Call it for the names of the objects that a preview of the view layer shows."""
    shown_objects = addon("scanline.preview.preview_members").shown_objects
    return lambda: {obj.name for obj in shown_objects(bpy.context.view_layer).values()}


@pytest.fixture
def data(addon):
    return addon("scanline.preview.preview_data")


def add(name, collection=None, kind="MESH"):
    """A new object of a type, without anything in it."""
    made = {
        "MESH": bpy.data.meshes.new,
        "LIGHT": lambda name: bpy.data.lights.new(name, "POINT"),
        "FONT": lambda name: bpy.data.curves.new(name, "FONT"),
        "EMPTY": lambda name: None,
    }[kind](name)
    obj = bpy.data.objects.new(name, made)
    (collection or bpy.context.scene.collection).objects.link(obj)
    return obj


def test_types(shown):
    for kind in ("MESH", "LIGHT", "FONT", "EMPTY"):
        add(kind.title(), kind=kind)
    assert shown() == {"Mesh", "Font"}


def test_collections(shown, data):
    scene = bpy.context.scene
    outer, inner = bpy.data.collections.new("Outer"), bpy.data.collections.new("Inner")
    scene.collection.children.link(outer)
    outer.children.link(inner)
    add("Cube", inner)
    assert shown() == {"Cube"}
    for collection in (outer, inner):
        collection.hide_render = True
        assert shown() == set()
        collection.hide_render = False
        collection.hide_viewport = True
        assert shown() == {"Cube"}
        collection.hide_viewport = False
        layer = data.layer_of(bpy.context.view_layer, collection)
        layer.hide_viewport = True
        assert shown() == {"Cube"}
    layer.exclude = True
    assert shown() == set()
    layer.exclude = False
    layer.indirect_only = True
    assert shown() == set()


def test_in_two_collections_one_of_which_is_hidden(shown):
    hidden = bpy.data.collections.new("Hidden")
    bpy.context.scene.collection.children.link(hidden)
    hidden.hide_render = True
    hidden.objects.link(add("Cube"))
    assert shown() == {"Cube"}


def test_instancers(shown):
    held = bpy.data.collections.new("Held")
    add("Inside", held)
    instance = add("Instance", kind="EMPTY")
    instance.instance_type, instance.instance_collection = "COLLECTION", held
    parent, child = add("Parent"), add("Child")
    child.parent = parent
    assert shown() == {"Instance", "Parent", "Child"}
    parent.instance_type = "VERTS"
    assert shown() == {"Instance", "Parent"}
    parent.show_instancer_for_render = False
    assert shown() == {"Instance"}


def test_as_a_render_has_it(shown, addon):
    """The same objects as the reader of the scene takes for a picture."""
    scene = bpy.context.scene
    for number, switch in enumerate((None, "hide_render", "hide_viewport", "visible_camera", "is_holdout")):
        obj = add(f"Cube {number}")
        obj.data.from_pydata([(0, 0, 0), (1, 0, 0), (0, 1, 0)], [], [(0, 1, 2)])
        if switch is not None:
            setattr(obj, switch, not getattr(obj, switch))
    bpy.data.objects["Cube 0"].hide_set(True)
    camera = bpy.data.objects.new("Camera", bpy.data.cameras.new("Camera"))
    scene.collection.objects.link(camera)
    addon("bridge.camera.flexible_camera").volume_from_camera(camera, scene)
    geometry = (
        addon("bridge.render.render_inputs").prepare(scene, bpy.context.view_layer, camera).scene.geometry
    )
    # What only casts shadows is in no preview.
    seen = geometry.object_index[geometry.visibility & addon("casting.common.ray_visibility").CAMERA != 0]
    assert shown() == {geometry.object_names[number] for number in seen}
