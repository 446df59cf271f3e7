# SPDX-License-Identifier: GPL-3.0-or-later
"""Cautions of the rig: every place that a disturbed node may be in, beside ordinary Cycles renders."""

import bpy
import numpy as np
import pytest
from mathutils import Matrix

# A straight volume's picture through the rig differs by less where nothing is disturbed, by more elsewhere.
ALIKE, DISTURBED = 1e-5, 0.01
NODES = {
    "View Vector": ("ShaderNodeCameraData", True),
    "View Z Depth": ("ShaderNodeCameraData", True),
    "View Distance": ("ShaderNodeCameraData", True),
    "Camera": ("ShaderNodeTexCoord", True),
    "Window": ("ShaderNodeTexCoord", True),
    "Reflection": ("ShaderNodeTexCoord", False),
    "Ray Length": ("ShaderNodeLightPath", False),
    "Ray Depth": ("ShaderNodeLightPath", False),
    "Transparent Depth": ("ShaderNodeLightPath", True),
    "Portal Depth": ("ShaderNodeLightPath", True),
    "Incoming": ("ShaderNodeNewGeometry", False),
    "Vector": ("ShaderNodeVectorTransform", True),
}


def shining(name, output="Window", owner=None):
    """A material, or a world or lamp that is given, which shines in the colour of a node's output."""
    made = owner or bpy.data.materials.new(name)
    if made.node_tree is None or not made.use_nodes:
        made.use_nodes = True
    nodes, links = made.node_tree.nodes, made.node_tree.links
    nodes.clear()
    kind = {"MATERIAL": "Material", "WORLD": "World", "LIGHT": "Light"}[made.id_type]
    end = nodes.new(f"ShaderNodeOutput{kind}")
    shader = nodes.new("ShaderNodeBackground" if kind == "World" else "ShaderNodeEmission")
    links.new(shader.outputs[0], end.inputs["Surface"])
    source = nodes.new(NODES[output][0])
    if output == "Vector":
        source.vector_type, source.convert_from, source.convert_to = "POINT", "WORLD", "CAMERA"
        place = nodes.new("ShaderNodeNewGeometry")
        links.new(place.outputs["Position"], source.inputs[0])
    links.new(source.outputs[output], shader.inputs["Color"])
    return made


@pytest.fixture
def rig_of(addon):
    return lambda: addon("cycles.rig_data").rig_of(bpy.context.scene)


@pytest.fixture
def straight(addon, built_groups):
    """A small scene of a cube before a flexible camera with its own lens' volume."""
    scene = bpy.context.scene
    scene.render.resolution_x, scene.render.resolution_y, scene.render.resolution_percentage = 32, 18, 100
    scene.cycles.samples, scene.cycles.max_bounces = 1, 0
    scene.cycles.use_denoising = scene.cycles.use_adaptive_sampling = False
    scene.cycles.pixel_filter_type, scene.cycles.filter_width = "BLACKMAN_HARRIS", 0.01
    bpy.ops.mesh.primitive_cube_add(rotation=(0.4, 0.5, 0.2))
    camera = scene.camera = bpy.data.objects.new("Camera", bpy.data.cameras.new("Camera"))
    camera.matrix_world = Matrix.Translation((0, 0, 5))
    scene.collection.objects.link(camera)
    scene.world = bpy.data.worlds.new("World")
    return scene


def set_up(camera, scene):
    bpy.context.view_layer.objects.active = camera
    if not camera.scfpf.enabled:
        assert bpy.ops.scfpf.camera_from_camera() == {"FINISHED"}
    assert bpy.ops.scfpf.cycles_rig() == {"FINISHED"}


def rendered(path):
    """The image by Cycles, (H, W, 4)."""
    scene = bpy.context.scene
    settings = scene.render.image_settings
    if hasattr(settings, "media_type"):
        settings.media_type = "IMAGE"
    settings.file_format, settings.color_mode, settings.color_depth = "OPEN_EXR", "RGBA", "32"
    scene.render.engine, scene.render.filepath = "CYCLES", str(path)
    bpy.ops.render.render(write_still=True)
    image = bpy.data.images.load(f"{path}.exr")
    values = np.empty(len(image.pixels), np.float32)
    image.pixels.foreach_get(values)
    values = values.reshape(image.size[1], image.size[0], 4)
    bpy.data.images.remove(image)
    return values


def difference(scene, path):
    """RMSE of colour between an ordinary camera's render and that through the rig of its own view."""
    flexible = scene.camera
    ordinary = rendered(path)
    set_up(flexible, scene)
    return float(np.sqrt(np.mean((rendered(path) - ordinary)[..., :3] ** 2)))


@pytest.mark.parametrize("output", NODES)
def test_a_node_is_named_if_its_picture_differs(straight, rig_of, tmp_path, output):
    bpy.context.object.data.materials.append(shining("Asks", output))
    off = difference(straight, tmp_path / "image")
    assert off > DISTURBED if NODES[output][1] else off < ALIKE
    assert rig_of().scfpf_rig.asks_camera == ("Asks" if NODES[output][1] else "")


@pytest.mark.parametrize("output", ["Window", "View Distance", "Ray Length", "Transparent Depth"])
@pytest.mark.parametrize("owner", ["world", "override"])
def test_a_node_of_the_world_is_named_if_its_picture_differs(straight, rig_of, tmp_path, owner, output):
    bpy.context.object.location.x = 2
    world = shining("Sky", output, straight.world)
    if owner == "override":
        straight.world = bpy.data.worlds.new("Other")
        bpy.context.view_layer.world_override = world
    off = difference(straight, tmp_path / "image")
    assert off > DISTURBED if NODES[output][1] else off < ALIKE
    assert rig_of().scfpf_rig.asks_camera == (world.name if NODES[output][1] else "")


def test_a_node_of_a_lamp_is_named(straight, rig_of, tmp_path):
    bpy.context.object.data.materials.append(bpy.data.materials.new("Plain"))
    lamp = bpy.data.objects.new("Lamp", bpy.data.lights.new("Lamp", "SUN"))
    straight.collection.objects.link(lamp)
    shining("Lamp", "View Distance", lamp.data)
    assert difference(straight, tmp_path / "image") > DISTURBED
    assert rig_of().scfpf_rig.asks_camera == "Lamp"


def nodes_group(name="Sets"):
    """A group of Geometry Nodes that passes its geometry on; its nodes: (the tree, input, output)."""
    tree = bpy.data.node_groups.new(name, "GeometryNodeTree")
    for way in ("INPUT", "OUTPUT"):
        tree.interface.new_socket("Geometry", in_out=way, socket_type="NodeSocketGeometry")
    return tree, tree.nodes.new("NodeGroupInput"), tree.nodes.new("NodeGroupOutput")


def with_node(kind, name="Sets"):
    """A group with one node between its input and its output; the tree, the node and the input."""
    tree, given, end = nodes_group(name)
    node = tree.nodes.new(kind)
    if node.outputs:
        tree.links.new(node.outputs[0], end.inputs[0])
    if node.inputs and node.inputs[0].type == "GEOMETRY":
        tree.links.new(given.outputs[0], node.inputs[0])
    return tree, node, given


def modify(obj, tree):
    modifier = obj.modifiers.new("Nodes", "NODES")
    modifier.node_group = tree
    return modifier


def slot_of_data(obj, material):
    obj.data.materials.append(material)


def slot_of_object(obj, material):
    obj.data.materials.append(None)
    obj.material_slots[0].link, obj.material_slots[0].material = "OBJECT", material


def set_material(obj, material):
    tree, node, _ = with_node("GeometryNodeSetMaterial")
    node.inputs["Material"].default_value = material
    modify(obj, tree)


def set_material_in_a_group(obj, material):
    inner, node, _ = with_node("GeometryNodeSetMaterial", "Inner")
    node.inputs["Material"].default_value = material
    tree, group, given = with_node("GeometryNodeGroup", "Outer")
    group.node_tree = inner
    tree.links.new(given.outputs[0], group.inputs[0])
    tree.links.new(group.outputs[0], tree.nodes[1].inputs[0])
    modify(obj, tree)


def input_of_a_modifier(obj, material):
    tree, node, given = with_node("GeometryNodeSetMaterial")
    socket = tree.interface.new_socket("Paint", in_out="INPUT", socket_type="NodeSocketMaterial")
    tree.links.new(given.outputs["Paint"], node.inputs["Material"])
    modifier = modify(obj, tree)
    MODIFIER_INPUTS[0](modifier, socket.identifier, material)


MODIFIER_INPUTS = [None]


def hidden_part(obj, material):
    """Another object that shows the material, in a collection that no view layer has."""
    part = bpy.data.objects.new("Part", obj.data.copy())
    part.data.materials.append(material)
    parts = bpy.data.collections.new("Parts")
    parts.objects.link(part)
    return part, parts


def collection_instance(obj, material):
    _, parts = hidden_part(obj, material)
    empty = bpy.data.objects.new("Instance", None)
    empty.instance_type, empty.instance_collection = "COLLECTION", parts
    bpy.context.scene.collection.objects.link(empty)
    return empty


def nested_collection_instance(obj, material):
    empty = collection_instance(obj, material)
    bpy.context.scene.collection.objects.unlink(empty)
    outer = bpy.data.collections.new("Outer")
    outer.objects.link(empty)
    top = bpy.data.objects.new("Top", None)
    top.instance_type, top.instance_collection = "COLLECTION", outer
    bpy.context.scene.collection.objects.link(top)


def instances_of_nodes(obj, material):
    part, _ = hidden_part(obj, material)
    tree, node, _ = with_node("GeometryNodeObjectInfo")
    node.inputs["Object"].default_value = part
    node.inputs["As Instance"].default_value = True
    tree.links.new(node.outputs["Geometry"], tree.nodes[1].inputs[0])
    modify(obj, tree)


def particles(obj, material):
    part, _ = hidden_part(obj, material)
    obj.modifiers.new("Particles", "PARTICLE_SYSTEM")
    settings = obj.particle_systems[0].settings
    settings.type, settings.count = "HAIR", 5
    settings.render_type, settings.instance_object = "OBJECT", part


def curves(obj, material):
    made = bpy.data.objects.new("Curve", bpy.data.curves.new("Curve", "CURVE"))
    made.data.materials.append(material)
    made.data.bevel_depth = 0.1
    spline = made.data.splines.new("POLY")
    spline.points.add(1)
    spline.points[1].co = (1, 0, 0, 1)
    bpy.context.scene.collection.objects.link(made)


def volume(obj, material):
    made = bpy.data.objects.new("Fog", bpy.data.volumes.new("Fog"))
    made.data.materials.append(material)
    bpy.context.scene.collection.objects.link(made)


def group_in_a_material(obj, material):
    """The material's node is in a group of nodes, in a group."""
    inner = bpy.data.node_groups.new("Inner", "ShaderNodeTree")
    inner.interface.new_socket("Color", in_out="OUTPUT", socket_type="NodeSocketColor")
    source, end = inner.nodes.new("ShaderNodeTexCoord"), inner.nodes.new("NodeGroupOutput")
    inner.links.new(source.outputs["Window"], end.inputs[0])
    outer = bpy.data.node_groups.new("Outer", "ShaderNodeTree")
    outer.interface.new_socket("Color", in_out="OUTPUT", socket_type="NodeSocketColor")
    group, end = outer.nodes.new("ShaderNodeGroup"), outer.nodes.new("NodeGroupOutput")
    group.node_tree = inner
    outer.links.new(group.outputs[0], end.inputs[0])
    nodes = material.node_tree.nodes
    nodes.remove(next(node for node in nodes if node.bl_idname == "ShaderNodeTexCoord"))
    group = nodes.new("ShaderNodeGroup")
    group.node_tree = outer
    shader = next(node for node in nodes if node.bl_idname == "ShaderNodeEmission")
    material.node_tree.links.new(group.outputs[0], shader.inputs["Color"])
    obj.data.materials.append(material)


def override(_obj, material):
    bpy.context.view_layer.material_override = material


PLACES = (
    slot_of_data,
    slot_of_object,
    set_material,
    set_material_in_a_group,
    input_of_a_modifier,
    collection_instance,
    nested_collection_instance,
    instances_of_nodes,
    particles,
    curves,
    volume,
    group_in_a_material,
    override,
)


@pytest.mark.parametrize("hidden", [False, True], ids=["shown", "hidden in viewports"])
@pytest.mark.parametrize("place", PLACES, ids=lambda place: place.__name__)
def test_a_material_is_named_wherever_it_comes_from(addon, straight, rig_of, place, hidden):
    MODIFIER_INPUTS[0] = addon("bridge.blender.versions").set_modifier_input
    obj = bpy.context.object
    set_up(straight.camera, straight)
    place(obj, shining("Asks"))
    if hidden:
        for each in straight.collection.objects:
            each.hide_viewport = each.type != "CAMERA"
    bpy.context.view_layer.update()
    assert rig_of().scfpf_rig.asks_camera == "Asks"


def unused_slot(obj, material):
    obj.data.materials.append(bpy.data.materials.new("Plain"))
    obj.data.materials.append(material)


def replaced_by_nodes(obj, material):
    obj.data.materials.append(material)
    set_material(obj, bpy.data.materials.new("Plain"))


def not_rendered(obj, material):
    obj.data.materials.append(material)
    obj.hide_render = True


def excluded(obj, material):
    _, parts = hidden_part(obj, material)
    bpy.context.scene.collection.children.link(parts)
    bpy.context.view_layer.layer_collection.children["Parts"].exclude = True


def unlinked_node(obj, material):
    material.node_tree.links.clear()
    obj.data.materials.append(material)


def of_nobody(_obj, material):
    material.use_fake_user = True


@pytest.mark.parametrize(
    "place", [unused_slot, replaced_by_nodes, not_rendered, excluded, unlinked_node, of_nobody]
)
def test_a_material_that_no_ray_meets_is_not_named(straight, rig_of, place):
    obj = bpy.context.object
    set_up(straight.camera, straight)
    place(obj, shining("Asks"))
    bpy.context.view_layer.update()
    assert rig_of().scfpf_rig.asks_camera == ""


def test_ray_length_is_named_in_bent_volumes(straight, rig_of):
    bpy.context.object.data.materials.append(shining("Asks", "Ray Length"))
    set_up(straight.camera, straight)
    assert rig_of().scfpf_rig.asks_camera == ""
    bpy.context.view_layer.objects.active = rig_of().scfpf_rig.camera
    assert bpy.ops.scfpf.preset_apply(preset="nonlinear_twist", fit=False) == {"FINISHED"}
    bpy.context.view_layer.update()
    assert rig_of().scfpf_rig.chords > 1 and rig_of().scfpf_rig.asks_camera == "Asks"


@pytest.mark.parametrize("as_instance", [False, True])
def test_grease_pencil_and_freestyle_are_named(addon, straight, rig_of, as_instance):
    set_up(straight.camera, straight)

    def said():
        bpy.context.view_layer.update()
        texts = addon("cycles.cautions").cautions(straight, bpy.context.view_layer, rig_of())
        return [text for text in texts if "ordinary camera" in text]

    assert said() == []
    bpy.ops.object.grease_pencil_add(type="MONKEY")
    drawing = bpy.context.object
    if as_instance:
        parts = bpy.data.collections.new("Parts")
        for holder in list(drawing.users_collection):
            holder.objects.unlink(drawing)
        parts.objects.link(drawing)
        empty = bpy.data.objects.new("Instance", None)
        empty.instance_type, empty.instance_collection = "COLLECTION", parts
        straight.collection.objects.link(empty)
    assert len(said()) == 1 and drawing.name in said()[0]
    bpy.context.view_layer.use_grease_pencil = False
    straight.render.use_freestyle = bpy.context.view_layer.use_freestyle = True
    straight.collection.objects.link(bpy.data.objects.new("Another", None))
    assert len(said()) == 1 and "Freestyle" in said()[0]


def smoking(obj, name="Smoke"):
    """A material of smoke alone, and an object that is large enough to hold the camera."""
    material = bpy.data.materials.new(name)
    if material.node_tree is None:
        material.use_nodes = True
    nodes = material.node_tree.nodes
    nodes.clear()
    scatter, end = nodes.new("ShaderNodeVolumeScatter"), nodes.new("ShaderNodeOutputMaterial")
    material.node_tree.links.new(scatter.outputs[0], end.inputs["Volume"])
    obj.data.transform(Matrix.Scale(20, 4))
    obj.name = "Cloud"
    return material


SMOKE_PLACES = [
    place for place in PLACES if place not in (particles, curves, volume, group_in_a_material, override)
]


@pytest.fixture
def around(addon, straight):
    """The name of the smoke that the near surface of the camera's own view is in at present."""
    bpy.context.view_layer.objects.active = straight.camera
    assert bpy.ops.scfpf.camera_from_camera() == {"FINISHED"}

    def find():
        bpy.context.view_layer.update()
        depsgraph = bpy.context.evaluated_depsgraph_get()
        projection = addon("bridge.camera.read_projection").read_projection(straight.camera, depsgraph, 1.5)
        return addon("cycles.smoke").smoke_around(straight, projection)

    return find


@pytest.mark.parametrize("place", SMOKE_PLACES, ids=lambda place: place.__name__)
def test_smoke_around_the_camera_is_named_wherever_it_comes_from(addon, straight, around, place):
    """Not once everything is moved away; what viewports do not show, too."""
    MODIFIER_INPUTS[0] = addon("bridge.blender.versions").set_modifier_input
    obj, before = bpy.data.objects["Cube"], {*bpy.data.objects}
    place(obj, smoking(obj))
    made = {*straight.collection.objects} - before | {obj}
    for hidden in (False, True):
        for each in made:
            each.hide_viewport = hidden
        assert around() in {each.name for each in made}
        for each in made:
            each.location.x += 100
        assert around() == ""
        for each in made:
            each.location.x -= 100


@pytest.mark.parametrize("place", [unused_slot, replaced_by_nodes, not_rendered, excluded, of_nobody])
def test_smoke_that_no_ray_meets_is_not_named(straight, around, place):
    obj = bpy.data.objects["Cube"]
    place(obj, smoking(obj))
    assert around() == ""


def test_a_hollow_mesh_of_smoke_and_one_in_edit_mode(straight, around):
    """The camera is in the hole of a torus: in its box, but not in the smoke."""
    material = smoking(bpy.data.objects["Cube"])
    bpy.ops.mesh.primitive_torus_add(location=(0, 0, 5), major_radius=6, minor_radius=2)
    torus = bpy.context.object
    torus.data.materials.append(material)
    for mode in ("OBJECT", "EDIT"):
        for x, said in ((0, ""), (6, torus.name)):
            torus.location.x = x
            bpy.ops.object.mode_set(mode=mode)
            assert around() == said
            bpy.ops.object.mode_set(mode="OBJECT")


def keyed(owner, path, values):
    """Insert keyframes of a property. values: by frame."""
    for frame, value in values.items():
        setattr(owner, path, value)
        owner.keyframe_insert(path, frame=frame)


def moved_in(cloud):
    keyed(cloud, "location", {1: (100, 0, 0), 20: (0, 0, 0)})


def passing_by(cloud):
    """It passes between the frames that are looked at in any case."""
    keyed(cloud, "location", {3: (100, 0, 0), 5: (0, 0, 0), 7: (100, 0, 0)})


def appearing(cloud):
    cloud.location.x = 0
    keyed(cloud, "hide_render", {1: True, 15: False})


def driven(cloud):
    driver = cloud.driver_add("location", 0).driver
    driver.expression = "100 - 5 * frame"


def parented(cloud):
    parent = bpy.data.objects.new("Parent", None)
    bpy.context.scene.collection.objects.link(parent)
    cloud.parent, cloud.location.x = parent, 0
    moved_in(parent)


def constrained(cloud):
    target = bpy.data.objects.new("Target", None)
    bpy.context.scene.collection.objects.link(target)
    moved_in(target)
    cloud.constraints.new("COPY_LOCATION").target = target


def by_scene_time(cloud):
    cloud.location.x = 0
    tree, node, _ = with_node("GeometryNodeTransform", "Moves")
    time, offset = tree.nodes.new("GeometryNodeInputSceneTime"), tree.nodes.new("ShaderNodeVectorMath")
    offset.operation, offset.inputs[1].default_value = "MULTIPLY_ADD", (-5, 0, 0)
    offset.inputs[2].default_value = (100, 0, 0)
    tree.links.new(time.outputs["Frame"], offset.inputs[0])
    tree.links.new(offset.outputs[0], node.inputs["Translation"])
    modify(cloud, tree)


def instanced(cloud):
    """An instance of a collection moves in; the object itself is in no view layer."""
    scene, parts = bpy.context.scene, bpy.data.collections.new("Parts")
    cloud.location.x = 0
    scene.collection.objects.unlink(cloud)
    parts.objects.link(cloud)
    empty = bpy.data.objects.new("Instance", None)
    empty.instance_type, empty.instance_collection = "COLLECTION", parts
    scene.collection.objects.link(empty)
    moved_in(empty)


def driven_into(cloud):
    """The camera moves into still smoke."""
    cloud.location.x = 100
    keyed(bpy.context.scene.camera, "location", {1: (0, 0, 5), 20: (100, 0, 5)})


TIMES = (
    moved_in,
    passing_by,
    appearing,
    driven,
    parented,
    constrained,
    by_scene_time,
    instanced,
    driven_into,
)


@pytest.mark.parametrize("time", TIMES, ids=lambda time: time.__name__)
def test_smoke_at_other_frames_is_found(addon, straight, around, time):
    """By what may change, without evaluating frames; then by a few frames. Each finds it by itself."""
    obj = bpy.data.objects["Cube"]
    obj.data.materials.append(smoking(obj))
    straight.frame_end, obj.location.x = 20, 100
    smoke, name = addon("cycles.smoke"), "Instance" if time is instanced else "Cloud"
    assert smoke.changing_smoke(straight) == [] and around() == ""
    time(obj)
    straight.frame_set(1)
    assert smoke.changing_smoke(straight, time is driven_into) == [name] and around() == ""
    plan = addon("cycles.chord_planning").planned(bpy.context, straight.camera)
    assert plan.smoke[0] == name and 1 < plan.smoke[1] <= 20 and plan.looked_at == (name,)
    assert straight.frame_current == 1
    straight.frame_set(plan.smoke[1])
    assert around() == name
    straight.frame_end = straight.frame_start
    assert smoke.changing_smoke(straight, True) == []


def test_the_panel_names_smoke_at_other_frames(addon, straight, rig_of):
    """Smoke that changes is named until *Update Chords* has looked; then where it meets the near surface."""
    obj, layer = bpy.context.object, bpy.context.view_layer
    straight.frame_end, obj.location.x = 20, 100
    obj.data.materials.append(smoking(obj))
    set_up(straight.camera, straight)
    settings = rig_of().scfpf_rig

    def said():
        texts = addon("cycles.cautions").cautions(straight, layer, rig_of())
        return [text for text in texts if "Cloud" in text]

    assert said() == []
    keyed(obj, "location", {1: (100, 0, 0), 20: (100, 50, 0)})
    layer.update()
    assert len(said()) == 1 and "Update Chords" in said()[0]
    assert bpy.ops.scfpf.cycles_rig_update() == {"FINISHED"}
    assert said() == []
    # What was followed may be elsewhere after an edit of its animation, or of the volume.
    keyed(obj, "location", {20: (0, 0, 0)})
    layer.update()
    straight.frame_set(1)
    assert len(said()) == 1 and settings.smoke == ""
    assert bpy.ops.scfpf.cycles_rig_update() == {"FINISHED"}
    assert len(said()) == 1 and f"frame {settings.smoke_frame}" in said()[0]
    settings.camera.scfpf.surfaces[0].object.location.x += 0.01
    layer.update()
    assert settings.smoke_unknown == "Cloud"


@pytest.mark.parametrize("place", [slot_of_data, set_material], ids=lambda place: place.__name__)
def test_the_inside_of_smoke_is_not_skipped(addon, straight, place):
    """Besides its faces it counts as its box, wherever the material comes from."""
    obj = bpy.context.object
    place(obj, smoking(obj))
    bpy.context.view_layer.update()
    found = addon("cycles.skipping.bodies").seen_parts(bpy.context.evaluated_depsgraph_get())
    assert [len(parts) for _key, _matrix, parts in found] == [2]
