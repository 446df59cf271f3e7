# SPDX-License-Identifier: GPL-3.0-or-later
"""Every type of object and data that Blender has, in every way to a picture: no fault, no lost handler.

All of them are in one scene: as they are, as members of an instanced collection, instanced by Geometry Nodes,
as parents, animated, and hidden in viewports.
"""

import bpy
import pytest

TYPES = [item.identifier for item in bpy.types.Object.bl_rna.properties["type"].enum_items]
DISPLAYS = [item.identifier for item in bpy.types.Object.bl_rna.properties["empty_display_type"].enum_items]
LAMPS = [item.identifier for item in bpy.types.Light.bl_rna.properties["type"].enum_items]
PROBES = [item.identifier for item in bpy.types.LightProbe.bl_rna.properties["type"].enum_items]


def grease_pencils():
    # Before 5.0 annotations have the other name.
    return bpy.data.grease_pencils_v3 if hasattr(bpy.data, "grease_pencils_v3") else bpy.data.grease_pencils


def filled_mesh():
    mesh = bpy.data.meshes.new("Mesh")
    mesh.from_pydata([(0, 0, 0), (1, 0, 0), (0, 1, 0), (0, 0, 1)], [], [(0, 1, 2), (0, 2, 3), (0, 1, 3)])
    return mesh


def curve_of(kind):
    curve = bpy.data.curves.new(kind.title(), kind)
    if kind == "CURVE":
        curve.bevel_depth = 0.1
        curve.splines.new("BEZIER").bezier_points.add(2)
    elif kind == "SURFACE":
        spline = curve.splines.new("NURBS")
        spline.points.add(3)
    return curve


def ball():
    data = bpy.data.metaballs.new("Meta")
    data.elements.new()
    return data


def image(kind):
    made = bpy.data.images.new(kind.title(), 8, 8)
    if kind != "GENERATED":
        made.source = kind
    return made


# The data of the objects of each type, by a label.
DATA = {
    "MESH": {"mesh": filled_mesh, "empty mesh": lambda: bpy.data.meshes.new("Nothing")},
    "CURVE": {"curve": lambda: curve_of("CURVE")},
    "SURFACE": {"surface": lambda: curve_of("SURFACE")},
    "META": {"meta": ball},
    "FONT": {"font": lambda: curve_of("FONT")},
    "CURVES": {"curves": lambda: bpy.data.hair_curves.new("Hair")},
    "POINTCLOUD": {"points": lambda: bpy.data.pointclouds.new("Points")},
    "VOLUME": {"volume": lambda: bpy.data.volumes.new("Volume")},
    "GREASEPENCIL": {"grease pencil": lambda: grease_pencils().new("Strokes")},
    "GPENCIL": {"grease pencil": lambda: grease_pencils().new("Strokes")},
    "ARMATURE": {"armature": lambda: bpy.data.armatures.new("Armature")},
    "LATTICE": {"lattice": lambda: bpy.data.lattices.new("Lattice")},
    "EMPTY": {display: lambda: None for display in DISPLAYS}
    | {f"IMAGE {kind}": (lambda kind=kind: image(kind)) for kind in ("GENERATED", "SEQUENCE", "MOVIE")},
    "LIGHT": {kind: (lambda kind=kind: bpy.data.lights.new(kind, kind)) for kind in LAMPS},
    "LIGHT_PROBE": {kind: (lambda kind=kind: bpy.data.lightprobes.new(kind, kind)) for kind in PROBES},
    "CAMERA": {"camera": lambda: bpy.data.cameras.new("Other")},
    "SPEAKER": {"speaker": lambda: bpy.data.speakers.new("Speaker")},
}


def test_the_table_has_every_type():
    assert set(TYPES) <= DATA.keys()


def add(kind, label, location):
    """An object of a type, in the scene."""
    data = DATA[kind][label]()
    made = bpy.data.objects.new(f"{kind} {label}", None if kind == "EMPTY" else data)
    assert made.type == kind
    if kind == "EMPTY":
        made.empty_display_type = "IMAGE" if label.startswith("IMAGE") else label
        made.data = data  # only now can it be an image
    made.location = location
    bpy.context.scene.collection.objects.link(made)
    return made


def animate(owner):
    """Give an object or its data an action of its own, with a key of a property or of the add-on's."""
    if owner is None or not hasattr(owner, "animation_data"):
        return
    if isinstance(owner, bpy.types.Object):
        owner.keyframe_insert("location", frame=1)
        owner.location.z += 0.1
        owner.keyframe_insert("location", frame=9)
        return
    owner["key"] = 0.0
    owner.keyframe_insert('["key"]', frame=1)


def instancing_nodes(objects, collection):
    """A group for Geometry Nodes that joins its geometry with instances of objects and of a collection."""
    tree = bpy.data.node_groups.new("Instances", "GeometryNodeTree")
    for way in ("INPUT", "OUTPUT"):
        tree.interface.new_socket("Geometry", in_out=way, socket_type="NodeSocketGeometry")
    given, joined, end = (
        tree.nodes.new(kind) for kind in ("NodeGroupInput", "GeometryNodeJoinGeometry", "NodeGroupOutput")
    )
    tree.links.new(given.outputs[0], joined.inputs[0])
    for one in objects:
        info = tree.nodes.new("GeometryNodeObjectInfo")
        info.inputs["Object"].default_value, info.inputs["As Instance"].default_value = one, True
        tree.links.new(info.outputs["Geometry"], joined.inputs[0])
    info = tree.nodes.new("GeometryNodeCollectionInfo")
    info.inputs["Collection"].default_value = collection
    tree.links.new(info.outputs[0], joined.inputs[0])
    tree.links.new(joined.outputs[0], end.inputs[0])
    return tree


def fill_scene(kinds):
    """Objects of some types, in each of the ways."""
    scene = bpy.context.scene
    plain = [
        add(kind, label, (0.3 * number - 3.0, 0.5, 0.0))
        for number, (kind, label) in enumerate((kind, label) for kind in kinds for label in DATA[kind])
    ]
    collection = bpy.data.collections.new("Held")
    for one in plain:
        for data in (one, one.data):
            animate(data)
        copy = one.copy()
        collection.objects.link(copy)
        child = bpy.data.objects.new("Child", filled_mesh())
        child.parent = one
        scene.collection.objects.link(child)
        hidden = one.copy()
        hidden.hide_viewport = True
        scene.collection.objects.link(hidden)
    instance = bpy.data.objects.new("Collection Instance", None)
    instance.instance_type, instance.instance_collection = "COLLECTION", collection
    instance.location = (0.0, -1.0, 0.0)
    scene.collection.objects.link(instance)
    holder = bpy.data.objects.new("Nodes", filled_mesh())
    holder.location = (0.0, 1.0, 0.0)
    scene.collection.objects.link(holder)
    holder.modifiers.new("Instances", "NODES").node_group = instancing_nodes(plain, collection)
    for one in (instance, holder):
        animate(one)
    return plain


@pytest.fixture
def scene_of(addon, tmp_path):
    """Make a scene with objects of some types and a flexible camera; returns the camera."""

    def make(kinds):
        scene = bpy.context.scene
        scene.render.resolution_x, scene.render.resolution_y = 32, 18
        scene.render.filepath = str(tmp_path / "out")
        scene.world = bpy.data.worlds.new("World")
        bpy.ops.mesh.primitive_cube_add()
        bpy.context.object.name = "Thing"
        bpy.ops.object.light_add(type="SUN")
        fill_scene(kinds)
        bpy.ops.scfpf.camera_add()
        camera = bpy.context.object
        camera.scfpf.samples = 1
        scene.camera = camera
        return camera

    return make


def handlers():
    lists = ((name, getattr(bpy.app.handlers, name)) for name in dir(bpy.app.handlers))
    return {name: list(found) for name, found in lists if isinstance(found, list)}


def activate(obj):
    for one in bpy.context.selected_objects:
        one.select_set(False)
    obj.select_set(True)
    bpy.context.view_layer.objects.active = obj


def by_engine(addon, camera):
    bpy.context.scene.render.engine = "SCFPF"
    assert bpy.ops.render.render() == {"FINISHED"}


def by_live_view(addon, camera):
    views = addon("bridge.live.live_view")
    view = views.LiveView()
    for _ in range(2):
        view.source = views.source_of(bpy.context.evaluated_depsgraph_get())
        view.source.kept.updated(view.source.objects.read(bpy.context.evaluated_depsgraph_get()))
        bpy.data.objects["Thing"].location.x += 0.1
        bpy.context.scene.frame_set(5)
    view.painter.stop()


def by_nodes(addon, camera):
    activate(camera)
    assert bpy.ops.scfpf.preview_toggle() == {"FINISHED"}
    addon("scanline.preview.preview").sync(bpy.context.scene, True, bpy.context.evaluated_depsgraph_get())
    bpy.data.objects["Thing"].location.x += 0.1
    bpy.context.view_layer.update()
    assert bpy.ops.scfpf.preview_toggle() == {"FINISHED"}


def by_rig(addon, camera):
    activate(camera)
    assert bpy.ops.scfpf.cycles_rig() == {"FINISHED"}
    scene = bpy.context.scene
    scene.cycles.samples, scene.cycles.use_denoising = 1, False
    assert bpy.ops.render.render() == {"FINISHED"}
    scene.frame_set(5)
    bpy.context.view_layer.update()
    assert bpy.ops.scfpf.cycles_rig() == {"FINISHED"}


def by_layers(addon, camera):
    activate(bpy.data.objects["Thing"])
    for one in bpy.data.objects["Collection Instance"], bpy.data.objects["Nodes"]:
        one.select_set(True)
    assert bpy.ops.scfpf.layer_add(camera=camera.name) == {"FINISHED"}
    by_engine(addon, camera)
    assert bpy.ops.scfpf.layers_render(camera=camera.name) == {"FINISHED"}
    assert bpy.ops.scfpf.layer_remove(camera=camera.name) == {"FINISHED"}


def by_another_engine(addon, camera):
    activate(camera)
    scene = bpy.context.scene
    scene.render.engine, scene.cycles.samples, scene.cycles.use_denoising = "CYCLES", 1, False
    camera.location.x += 0.01  # not the camera's own frustum, if the volume is one
    assert bpy.ops.scfpf.joined_render(camera=camera.name, engine="SCENE") == {"FINISHED"}


def by_aim(addon, camera):
    activate(bpy.data.objects["Collection Instance"])
    assert bpy.ops.scfpf.aim_view_add(camera=camera.name) == {"FINISHED"}
    aim = camera.scfpf.aim
    aim.columns = aim.rows = 4  # a small problem, quickly solved
    aim.degree = 2
    try:
        bpy.ops.scfpf.aim_solve(camera=camera.name)
    except RuntimeError as error:
        assert "Traceback" not in str(error)  # a solution that is not taken


WAYS = (by_engine, by_live_view, by_nodes, by_rig, by_layers, by_another_engine, by_aim)


@pytest.mark.parametrize("way", WAYS, ids=lambda way: way.__name__)
def test_every_type_of_object(scene_of, addon, capfd, way):
    camera, before = scene_of(TYPES), handlers()
    bpy.context.view_layer.update()
    way(addon, camera)
    told = capfd.readouterr()
    assert "Traceback" not in told.out + told.err
    assert handlers() == before
