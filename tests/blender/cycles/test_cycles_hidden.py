# SPDX-License-Identifier: GPL-3.0-or-later
"""Control surfaces hidden from the rays of Cycles rigs, and materials that the rig disturbs."""

import bpy
import pytest
from rig_scenes import bent_camera, keep_groups, render, start_anew, switch


@pytest.fixture(autouse=True)
def empty_file(extension):
    """In place of an empty file."""
    start_anew()
    yield
    keep_groups()


@pytest.fixture
def camera(addon):
    return bent_camera(addon)


@pytest.fixture
def rig_of(addon):
    return lambda: addon("cycles.rig_data").rig_of(bpy.context.scene)


RAYS = ("camera", "diffuse", "glossy", "transmission", "volume_scatter", "shadow")


def rays_of(obj):
    return [getattr(obj, f"visible_{ray}") for ray in RAYS]


def attach(camera, *objects):
    """Use Selected as Control Surface."""
    bpy.ops.object.select_all(action="DESELECT")
    for obj in (*objects, camera):
        obj.select_set(True)
    bpy.context.view_layer.objects.active = camera
    assert bpy.ops.scfpf.surface_attach() == {"FINISHED"}


@pytest.fixture
def wall(addon, camera):
    """A bright wall before the camera, an instance of it, and another flexible camera."""
    scene = bpy.context.scene
    other = bpy.data.objects.new("Other", bpy.data.cameras.new("Other"))
    scene.collection.objects.link(other)
    other.location = 40, 0, 0
    addon("bridge.camera.flexible_camera").volume_from_camera(other, scene)
    bpy.ops.mesh.primitive_plane_add(size=3, location=(0.3, 0, -3))
    wall = bpy.context.object
    wall.name, wall.visible_glossy = "Wall", False
    wall.data.materials.append(bpy.data.materials["Red"])
    group = bpy.data.collections.new("Group")
    group.objects.link(wall)
    instance = bpy.data.objects.new("Instance", None)
    instance.instance_type, instance.instance_collection = "COLLECTION", group
    instance.location.y = -1
    scene.collection.objects.link(instance)
    bpy.context.view_layer.update()
    return wall


def test_control_surfaces_are_hidden_from_cycles(camera, wall, rig_of, tmp_path):
    """From the rig's rays alone, made before or after it, and their instances, while they are on a list."""
    scene = bpy.context.scene
    before, plain = rays_of(wall), render(tmp_path / "plain.exr")
    switch(camera)
    seen = render(tmp_path / "seen.exr")
    other = bpy.data.objects["Other"]
    attach(other, wall)
    # A script need not let anything be evaluated before it renders.
    hidden = render(tmp_path / "hidden.exr")
    assert (hidden != seen).any(axis=2).mean() > 0.2
    rig_camera, scene.camera = scene.camera, camera
    assert (render(tmp_path / "ordinary.exr") == plain).all(), "other cameras see it as before"
    scene.camera = rig_camera
    # Its own surfaces, too, which may be shown in renders; and with another rig anew.
    camera.scfpf.surfaces[1].object.hide_render = False
    assert (render(tmp_path / "own.exr") == hidden).all()
    switch(camera)
    assert rays_of(wall) == before and wall.animation_data is None
    switch(camera)
    assert (render(tmp_path / "again.exr") == hidden).all()
    # Without the surface's drivers nothing but the wall would differ.
    other.scfpf.active_surface = len(other.scfpf.surfaces) - 1
    bpy.context.view_layer.objects.active = other
    assert bpy.ops.scfpf.surface_remove() == {"FINISHED"}
    bpy.context.view_layer.update()
    assert rays_of(wall) == before and wall.animation_data is None
    assert (render(tmp_path / "shown.exr") == seen).all()


def test_hidden_surfaces_in_histories_and_files(addon, camera, wall, rig_of, tmp_path):
    """Undo, redo, a copy of the surface, a reload, and what cannot be hidden is named."""
    before = rays_of(wall)
    bpy.ops.ed.undo_push(message="Before")
    switch(camera)
    bpy.ops.ed.undo_push(message="Rig")
    attach(bpy.data.objects["Other"], wall)
    bpy.context.view_layer.update()
    bpy.ops.ed.undo_push(message="Surface")

    def look():
        bpy.context.view_layer.update()
        return bpy.data.objects["Wall"]

    assert not any(rays_of(look()))
    bpy.ops.ed.undo()
    assert rays_of(look()) == before
    bpy.ops.ed.redo()
    assert not any(rays_of(look()))
    bpy.ops.ed.undo()
    bpy.ops.ed.undo()
    assert rays_of(look()) == before and rig_of() is None
    bpy.ops.ed.redo()
    bpy.ops.ed.redo()
    assert not any(rays_of(look()))
    copy = bpy.data.objects["Wall"].copy()
    bpy.context.scene.collection.objects.link(copy)
    look()
    assert rays_of(copy) == before, "it is on no list"
    own = copy.driver_add("visible_camera").driver
    own.expression = "1"
    attach(bpy.data.objects["Other"], copy)
    look()
    cautions = addon("cycles.cautions").cautions
    found = cautions(bpy.context.scene, bpy.context.view_layer, rig_of())
    assert [
        caution for caution in found if f"'{copy.name}'" in caution and "Ray Visibility drivers" in caution
    ]
    name, path = copy.name, str(tmp_path / "surface.blend")
    bpy.ops.wm.save_as_mainfile(filepath=path)
    bpy.ops.wm.open_mainfile(filepath=path)
    assert not any(rays_of(look()))
    switch(bpy.data.objects["Camera"])
    assert rays_of(bpy.data.objects["Wall"]) == before
    assert bpy.data.objects[name].animation_data.drivers[0].driver.expression == "1"


def test_linked_surfaces_are_named_and_overrides_of_them_are_hidden(addon, camera, wall, rig_of, tmp_path):
    """Data that is linked from another file stays as it is."""
    path, scene = str(tmp_path / "library.blend"), bpy.context.scene
    bpy.data.libraries.write(path, {wall})
    with bpy.data.libraries.load(path, link=True) as (there, here):
        here.objects = there.objects
    linked = here.objects[0]
    scene.collection.objects.link(linked)
    override = linked.override_create()
    scene.collection.objects.link(override)
    override.name = "Override"
    before = rays_of(override)
    switch(camera)
    other = bpy.data.objects["Other"]
    for surface in (linked, override):
        other.scfpf.surfaces.add().object = surface
    bpy.context.view_layer.update()
    assert linked.animation_data is None and not any(rays_of(override))
    found = addon("cycles.cautions").cautions(scene, bpy.context.view_layer, rig_of())
    assert [text for text in found if f"'{linked.name}'" in text] and not any(
        "'Override'" in t for t in found
    )
    switch(camera)
    assert rays_of(override) == before


def test_materials_that_the_rig_disturbs_are_named(addon, camera, rig_of):
    """Raycast nodes meet the sheets, in a group as well; camera coordinates are those of the rig's camera."""
    switch(camera)
    scene, layer = bpy.context.scene, bpy.context.view_layer

    def named():
        layer.update()
        return [text for text in addon("cycles.cautions").cautions(scene, layer, rig_of()) if "Red" in text]

    assert named() == []
    tree = bpy.data.materials["Red"].node_tree
    emission = next(node for node in tree.nodes if node.bl_idname == "ShaderNodeEmission")
    asks = tree.nodes.new("ShaderNodeCameraData")
    assert named() == []
    tree.links.new(asks.outputs["View Z Depth"], emission.inputs["Strength"])
    assert [text for text in named() if "use the camera" in text]
    tree.nodes.remove(asks)
    assert named() == []
    if bpy.app.version >= (5, 2, 0):
        group = bpy.data.node_groups.new("Rays", "ShaderNodeTree")
        tree.nodes.new("ShaderNodeGroup").node_tree = group
        node = group.nodes.new("ShaderNodeRaycast")
        assert [text for text in named() if "Only Local" in text]
        node.only_local = True
        assert named() == []
