# SPDX-License-Identifier: GPL-3.0-or-later
"""Every reader of a scene's instances finds those that are placed by hand, and leaves out the same ones."""

import types

import bpy
import numpy as np
import pytest
from mathutils import Matrix
from small_scenes import cube_mesh, link

# Where instances stand that the camera sees, and where only the rig and layers reckon with them.
SEEN = {(0, 0, 0), (3, 0, 0), (5, 0, 0), (5, 2, 0), (0, 6, 0), (2, 6, 0), (0, 8, 0)}
HIDDEN_BY_INSTANCER = {(9, 0, 0)}
FLAT = (0, -6, 0)
# Corners of a cube's triangles.
CORNERS = 12 * 3


def instance_of(collection, location, name="Empty"):
    empty = link(name, None)
    empty.instance_type, empty.instance_collection, empty.location = "COLLECTION", collection, location
    return empty


def on_points(name, points, *geometries):
    """An object whose nodes instance on some vertices. geometries: functions that make nodes' sockets."""
    mesh = bpy.data.meshes.new(name)
    mesh.from_pydata(points, [], [])
    tree = bpy.data.node_groups.new(name, "GeometryNodeTree")
    for way in ("INPUT", "OUTPUT"):
        tree.interface.new_socket("Geometry", in_out=way, socket_type="NodeSocketGeometry")
    given, joined, end = (
        tree.nodes.new(kind) for kind in ("NodeGroupInput", "GeometryNodeJoinGeometry", "NodeGroupOutput")
    )
    for geometry in geometries:
        placed = tree.nodes.new("GeometryNodeInstanceOnPoints")
        tree.links.new(given.outputs[0], placed.inputs["Points"])
        tree.links.new(geometry(tree), placed.inputs["Instance"])
        tree.links.new(placed.outputs[0], joined.inputs[0])
    tree.links.new(joined.outputs[0], end.inputs[0])
    made = link(name, mesh)
    made.modifiers.new(name, "NODES").node_group = tree
    return made


def as_instance(obj):
    def geometry(tree):
        info = tree.nodes.new("GeometryNodeObjectInfo")
        info.inputs["Object"].default_value, info.inputs["As Instance"].default_value = obj, True
        return info.outputs["Geometry"]

    return geometry


def own_cube(material=None, size=1.0):
    def geometry(tree):
        cube, painted = (tree.nodes.new(kind) for kind in ("GeometryNodeMeshCube", "GeometryNodeSetMaterial"))
        cube.inputs["Size"].default_value = (size,) * 3
        painted.inputs["Material"].default_value = material
        tree.links.new(cube.outputs["Mesh"], painted.inputs["Geometry"])
        return painted.outputs["Geometry"]

    return geometry


def fog():
    made = bpy.data.materials.new("Fog")
    if made.node_tree is None:
        made.use_nodes = True
    tree = made.node_tree
    tree.nodes.clear()
    end, volume = tree.nodes.new("ShaderNodeOutputMaterial"), tree.nodes.new("ShaderNodeVolumeScatter")
    tree.links.new(volume.outputs[0], end.inputs["Volume"])
    return made


@pytest.fixture
def many():
    """Cubes placed in every way; some of them no camera sees."""
    mesh = cube_mesh()
    link("Plain", mesh)
    part = link("Part", mesh, bpy.data.collections.new("Parts"))
    parts = bpy.data.collections["Parts"]
    instance_of(parts, (3, 0, 0))
    nested = bpy.data.collections.new("Nested")
    link("Inner", None, nested).instance_type = "COLLECTION"
    bpy.data.objects["Inner"].instance_collection = parts
    for y in (0, 2):
        instance_of(nested, (5, y, 0))
    instance_of(parts, (9, 0, 0), "Unseen by Camera").visible_camera = False
    instance_of(parts, (11, 0, 0), "Not in Renders").hide_render = True
    hidden = link("Hidden Part", mesh, parts)
    hidden.location.z, hidden.hide_render = 4, True
    on_points("Nodes", [(0, 6, 0), (2, 6, 0)], as_instance(part))
    on_points("Own", [(0, 8, 0)], own_cube())
    link("Not in Camera", cube_mesh("Other")).visible_camera = False
    bpy.data.objects["Not in Camera"].location = (0, -4, 0)
    flat = link("Flat", bpy.data.meshes["Other"])
    flat.location, flat.scale = FLAT, (1, 1, 0)
    link("Lost", mesh).matrix_world = Matrix.Scale(1e30, 4)
    link("Not in Renders Either", mesh).hide_render = True
    bpy.context.view_layer.update()
    return bpy.context.evaluated_depsgraph_get()


def middles(blocks):
    """The middles of the boxes around blocks of points (N, 3), as whole numbers."""
    return {
        tuple(np.round((each.min(axis=0) + each.max(axis=0)) / 2).astype(int).tolist()) for each in blocks
    }


def test_scene_and_live_view_show_the_same_instances(many, addon):
    geometry = addon("bridge.scene.read_scene").read_scene(many).geometry
    corners = geometry.vertices[geometry.triangles].reshape(-1, CORNERS, 3)
    seen = (geometry.visibility.reshape(len(corners), -1) & 1 > 0).all(axis=1)
    assert middles(corners[seen]) == SEEN
    placements = addon("bridge.live.live_objects").LiveObjects().read(many).values()
    assert middles(place.matrix[None, :3, 3] for place in placements) == SEEN
    assert len(placements) == len(SEEN) == seen.sum()


def test_layers_and_the_rig_reckon_with_no_fewer(many, addon):
    owners = {obj.session_uid: 1 for obj in bpy.data.objects}
    found = addon("cycles.layers.layer_views").find_things(many, owners, False).by_layer[1].points
    assert middles(block.T for block in found) == SEEN | {FLAT}
    bodies = addon("cycles.skipping.bodies").Bodies()
    bpy.data.objects["Lost"].hide_viewport = True
    bodies.read(bpy.context.evaluated_depsgraph_get())
    corners = bodies.points()[0].transpose(2, 0, 1).reshape(-1, CORNERS, 3)
    assert middles(corners) >= SEEN | HIDDEN_BY_INSTANCER | {FLAT}


def test_meshes_of_one_objects_nodes_have_materials_of_their_own(addon):
    """The same object makes a cube that is shown and, within it, one of fog."""
    on_points("Own", [(0, 0, 0)], own_cube(fog(), 1.0), own_cube(None, 2.0))
    depsgraph = bpy.context.evaluated_depsgraph_get()
    (place,) = addon("bridge.live.live_objects").LiveObjects().read(depsgraph).values()
    assert np.abs(place.mesh.vertices).max() == 1.0
    assert np.abs(addon("bridge.scene.read_scene").read_scene(depsgraph).geometry.vertices).max() == 1.0


def test_a_click_finds_an_instance_in_the_layer_of_its_object(addon):
    """The layer's camera stands 1 to the left: what is 1 left of the middle is seen in the middle."""
    scene = bpy.context.scene
    bpy.ops.mesh.primitive_plane_add(size=200)
    bpy.context.object.name = "Plate"
    parts = bpy.data.collections.new("Parts")
    scene.collection.children.link(parts)
    link("Part", cube_mesh(), parts).hide_render = True
    bpy.context.view_layer.layer_collection.children["Parts"].exclude = True
    nodes = on_points("Instancer", [(-1, 0, 1)], as_instance(bpy.data.objects["Part"]))
    bpy.ops.object.camera_add(location=(0, 0, 10), rotation=(0, 0, 0))
    scene.camera = camera = bpy.context.object
    bpy.ops.scfpf.preset_apply(preset="orthographic")
    for slot, z in zip(camera.scfpf.surfaces, (-1, -21), strict=True):
        slot.object.location, slot.object.scale = (0, 0, z), (1, 1, 1)
    bpy.context.view_layer.update()
    depsgraph = bpy.context.evaluated_depsgraph_get()
    width = addon("bridge.camera.read_projection").read_projection(camera, depsgraph, 1.0).volume
    width = width.surfaces[0].width
    side = link("Side", bpy.data.cameras.new("Side"))
    side.location, side.data.type, side.data.ortho_scale = (-1, 0, 10), "ORTHO", width
    bpy.ops.scfpf.layer_add(camera=camera.name, collection="Parts", seen_by="Side", front="ORDER")
    bridge = addon("bridge.live.seen_object")
    frame = types.SimpleNamespace(left=0.0, bottom=0.0, width=100.0, height=100.0)

    def seen(x):
        context = types.SimpleNamespace(
            evaluated_depsgraph_get=bpy.context.evaluated_depsgraph_get,
            selectable_objects=[obj for obj in bpy.context.view_layer.objects if obj.visible_get()],
        )
        return bridge.seen_object(context, bridge.Place(camera, 0.5 + x / width, 0.5, frame)).name

    assert seen(0.5) == nodes.name and seen(-1.5) == "Plate"
