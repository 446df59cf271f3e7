# SPDX-License-Identifier: GPL-3.0-or-later
"""Links to a material's output, and flattened objects, against Cycles: a table in one picture each.

A material that is only a volume is met by no ray, in every way to see a volume.
"""

from math import pi

import bpy
import numpy as np
import pytest
from shown_materials import add, both, new_material, picture, scene_with_camera, show
from small_scenes import link, shown

ORANGE = (1.0, 0.2, 0.05)
# Cells of a table across, their width, and pixels across a cell.
COLUMNS, CELL, PIXELS = 9, 3.0, 6
# Cycles draws transparency at random.
NOISE = 0.06


def node(tree, kind, **inputs):
    return add(tree, f"ShaderNode{kind}", **inputs).outputs[0]


def rgb(tree, *color):
    made = tree.nodes.new("ShaderNodeRGB")
    made.outputs[0].default_value = (*(color or ORANGE), 1.0)
    return made.outputs[0]


def value(tree, number):
    made = tree.nodes.new("ShaderNodeValue")
    made.outputs[0].default_value = number
    return made.outputs[0]


def vector(tree):
    return node(tree, "CombineXYZ", X=0.1, Y=0.2, Z=0.3)


def fog(tree):
    """A volume without density, which Cycles shows as nothing at all."""
    return node(tree, "VolumePrincipled", Density=0.0)


def glow(tree, strength=1.0):
    return node(tree, "Emission", Color=ORANGE, Strength=strength)


def mixed(kind, first, second, share=0.25):
    def link(tree):
        made = add(tree, f"ShaderNode{kind}Shader")
        sockets = [each for each in made.inputs if each.type == "SHADER"]
        if kind == "Mix":
            made.inputs["Fac"].default_value = share
        for socket, source in zip(sockets, (first, second), strict=True):
            if source:
                tree.links.new(source(tree), socket)
        return made.outputs[0]

    return link


def group(inside, kind="Shader", has_output=True):
    """The output of a group, which ``inside`` gives; None for no link."""

    def link(tree):
        made = bpy.data.node_groups.new("Group", "ShaderNodeTree")
        made.interface.new_socket("Out", in_out="OUTPUT", socket_type=f"NodeSocket{kind}")
        if has_output:
            end = made.nodes.new("NodeGroupOutput")
            if inside:
                made.links.new(inside(made), end.inputs[0])
        around = tree.nodes.new("ShaderNodeGroup")
        around.node_tree = made
        return around.outputs[0]

    return link


def passed_on(kind, given):
    """The shader output of a group that passes on the value of an input without a link."""

    def link(tree):
        made = bpy.data.node_groups.new("Group", "ShaderNodeTree")
        made.interface.new_socket("Out", in_out="OUTPUT", socket_type="NodeSocketShader")
        made.interface.new_socket("In", in_out="INPUT", socket_type=f"NodeSocket{kind}")
        begin, end = made.nodes.new("NodeGroupInput"), made.nodes.new("NodeGroupOutput")
        made.links.new(begin.outputs[0], end.inputs[0])
        around = tree.nodes.new("ShaderNodeGroup")
        around.node_tree = made
        if given is not None:
            around.inputs[0].default_value = given
        return around.outputs[0]

    return link


def rerouted(source):
    def link(tree):
        made = tree.nodes.new("NodeReroute")
        if source:
            tree.links.new(source(tree), made.inputs[0])
        return made.outputs[0]

    return link


def muted(source):
    def link(tree):
        socket = source(tree)
        socket.node.mute = True
        return socket

    return link


# What goes into a surface, by name.
LINKED = {
    "nothing": None,
    "glow": glow,
    "color": rgb,
    "black": lambda tree: rgb(tree, 0.0, 0.0, 0.0),
    "number": lambda tree: value(tree, 0.7),
    "zero": lambda tree: value(tree, 0.0),
    "vector": vector,
    "normal": lambda tree: add(tree, "ShaderNodeNewGeometry").outputs["Normal"],
    "layer weight": lambda tree: add(tree, "ShaderNodeLayerWeight").outputs["Facing"],
    "rerouted color": rerouted(rgb),
    "reroute of nothing": rerouted(None),
    "muted": muted(glow),
    "group of a shader": group(glow),
    "group of a color": group(rgb, "Color"),
    "group of a color as a shader": group(rgb),
    "group of nothing": group(None),
    "group of no color": group(None, "Color"),
    "group without output": group(None, has_output=False),
    "group without a color's output": group(None, "Color", has_output=False),
    "passed on color": passed_on("Color", (*ORANGE, 1.0)),
    "passed on number": passed_on("Float", 0.7),
    "passed on vector": passed_on("Vector", (0.1, 0.2, 0.3)),
    "passed on integer": passed_on("Int", 2),
    "passed on boolean": passed_on("Bool", True),
    "passed on shader": passed_on("Shader", None),
    "mix of nothing": mixed("Mix", None, None),
    "mix with nothing": mixed("Mix", None, glow),
    "mix of a color": mixed("Mix", rgb, None),
    "mix of a color and a glow": mixed("Mix", lambda tree: rgb(tree, 0.0, 0.4, 0.8), glow),
    "mix of which the second is seen": mixed("Mix", rgb, vector, 1.0),
    "mix of painted ones of which the second is seen": mixed(
        "Mix",
        lambda tree: node(tree, "BsdfPrincipled", Base_Color=ORANGE, Roughness=1.0),
        lambda tree: node(tree, "BsdfPrincipled", Base_Color=(0.0, 1.0, 0.0), Roughness=1.0),
        1.0,
    ),
    "sum of nothing": mixed("Add", None, None),
    "sum of a color and a vector": mixed("Add", rgb, vector),
    "sum of dark glows": mixed("Add", lambda tree: glow(tree, 0.0), lambda tree: glow(tree, 0.0)),
    "dark glow": lambda tree: glow(tree, 0.0),
    "volume": fog,
    "transparent": lambda tree: node(tree, "BsdfTransparent"),
    "transparent and a color": mixed("Mix", rgb, lambda tree: node(tree, "BsdfTransparent")),
}


def output(tree, surface=None, volume=None, displacement=None, target="ALL"):
    made = tree.nodes.new("ShaderNodeOutputMaterial")
    made.target, made.is_active_output = target, True
    sources = {"Surface": surface, "Volume": volume, "Displacement": displacement}
    for name, source in sources.items():
        if source:
            tree.links.new(source(tree), made.inputs[name])


def no_bump(tree):
    return node(tree, "CombineXYZ")


MATERIALS = {name: lambda tree, source=source: output(tree, source) for name, source in LINKED.items()}
MATERIALS |= {
    f"{name}, with a volume": lambda tree, source=source: output(tree, source, fog)
    for name, source in LINKED.items()
}
MATERIALS |= {
    "empty tree": lambda tree: None,
    "no output": glow,
    "displacement": lambda tree: output(tree, displacement=no_bump),
    "displacement and a volume": lambda tree: output(tree, volume=fog, displacement=no_bump),
    "volume by a reroute": lambda tree: output(tree, volume=rerouted(fog)),
    "volume of nothing": lambda tree: output(tree, volume=group(None)),
    "volume that is muted": lambda tree: output(tree, volume=muted(fog)),
    "for Cycles, beside another": lambda tree: [
        output(tree, glow, target="CYCLES"),
        output(tree, target="EEVEE"),
    ],
    "volume for Cycles, beside another": lambda tree: [
        output(tree, volume=fog, target="CYCLES"),
        output(tree, glow, target="EEVEE"),
    ],
}
# Their shadows are opaque here, which is named.
CLEAR = {name for name in MATERIALS if "transparent" in name}


def table_scene(count):
    """A scene of ``count`` cells that a camera looks straight down on, lit by a sun from the side."""
    scene = scene_with_camera()
    rows = -(-count // COLUMNS)
    camera = scene.camera
    camera.data.type, camera.data.ortho_scale = "ORTHO", max(COLUMNS, rows) * CELL
    camera.location, camera.rotation_euler = (COLUMNS * CELL / 2, rows * CELL / 2, 9), (0, 0, 0)
    scene.render.resolution_x, scene.render.resolution_y = COLUMNS * PIXELS, rows * PIXELS
    background = next(each for each in scene.world.node_tree.nodes if each.type == "BACKGROUND")
    background.inputs["Color"].default_value = (0, 0, 0, 1)
    scene.cycles.max_bounces = 0
    sun = bpy.data.objects.new("Sun", bpy.data.lights.new("Sun", "SUN"))
    sun.data.energy, sun.data.angle, sun.rotation_euler = 3.0, 0.0, (0, pi / 4, 0)
    scene.collection.objects.link(sun)
    return scene


def middle(number):
    """The middle of a cell in the world."""
    row, column = divmod(number, COLUMNS)
    return (column + 0.5) * CELL, (row + 0.5) * CELL


def cells(image):
    """The pixels of the cells in order, (cells, PIXELS, PIXELS, channels)."""
    rows = len(image) // PIXELS
    parts = image.reshape(rows, PIXELS, COLUMNS, PIXELS, -1).swapaxes(1, 2)
    return parts.reshape(rows * COLUMNS, PIXELS, PIXELS, -1)


def test_surfaces_are_those_of_cycles(tmp_path):
    """A card above the floor for each material: its colour, and its shadow beside it."""
    scene = table_scene(len(MATERIALS))
    scene.cycles.samples = 64
    floor = new_material("Floor")
    show(floor.node_tree, node(floor.node_tree, "BsdfDiffuse", Color=(0.5, 0.5, 0.5)))
    bpy.ops.mesh.primitive_plane_add(size=100)
    bpy.context.object.data.materials.append(floor)
    for number, (name, make) in enumerate(MATERIALS.items()):
        material = new_material(name)
        make(material.node_tree)
        x, y = middle(number)
        bpy.ops.mesh.primitive_plane_add(size=1, location=(x + 0.5, y, 1.0))
        bpy.context.object.data.materials.append(material)
        # Glowing cards light the floor in Cycles alone.
        bpy.context.object.visible_diffuse = False
    ours, cycles = (cells(image)[: len(MATERIALS)] for image in both(scene, tmp_path))
    row, card, shade = PIXELS // 2, PIXELS * 2 // 3, PIXELS // 3 - 1
    off = np.abs(ours - cycles)[..., :3].max(axis=3)
    names = list(MATERIALS)
    assert {names[n] for n in np.flatnonzero(off[:, row, card] > NOISE)} == set()
    assert {names[n] for n in np.flatnonzero(off[:, row, shade] > NOISE)} <= CLEAR
    seen, floor_color = cycles[:, row, card], cycles[0, 0, 0]
    invisible = np.abs(seen - floor_color).max(axis=1) < 0.01
    assert {"nothing, with a volume", "displacement and a volume"} <= {
        names[n] for n in np.flatnonzero(invisible)
    }


def test_a_material_for_eevee_alone_is_shown(tmp_path):
    """Cycles has none, and shows black."""
    scene = table_scene(1)
    material = new_material("For EEVEE")
    output(material.node_tree, glow, target="EEVEE")
    bpy.ops.mesh.primitive_plane_add(size=9, location=(*middle(0), 0))
    bpy.context.object.data.materials.append(material)
    assert cells(picture(scene, "SCFPF", tmp_path))[0, 3, 3, :3] == pytest.approx(ORANGE)


WORLDS = ("nothing", "color", "number", "passed on boolean", "mix of a color and a glow")


@pytest.mark.parametrize("kind", ["World", "SUN", "AREA"])
def test_colors_in_the_place_of_a_shader_shine_as_in_cycles(kind, tmp_path):
    """Of the world and of lamps: a white card, and what is beside it."""
    scene = table_scene(1)
    scene.cycles.samples = 64
    bpy.data.objects.remove(bpy.data.objects["Sun"])
    card = new_material("Card")
    show(card.node_tree, node(card.node_tree, "BsdfDiffuse", Color=(1, 1, 1)))
    bpy.ops.mesh.primitive_plane_add(size=9, location=(*middle(0), 0))
    bpy.context.object.data.materials.append(card)
    owner = scene.world
    if kind != "World":
        owner = bpy.data.lights.new("Lamp", kind)
        owner.energy = 3.0 if kind == "SUN" else 300.0
        owner.use_nodes = True
        lamp = bpy.data.objects.new("Lamp", owner)
        lamp.location = (*middle(0), 4.0)
        scene.collection.objects.link(lamp)
    tree = owner.node_tree
    for name in WORLDS:
        tree.nodes.clear()
        end = tree.nodes.new(f"ShaderNodeOutput{'World' if kind == 'World' else 'Light'}")
        if LINKED[name]:
            tree.links.new(LINKED[name](tree), end.inputs["Surface"])
        ours, cycles = (image[2:4, [3, -3]] for image in both(scene, tmp_path))
        assert cycles[..., :3].any() == (name != "nothing")
        assert ours == pytest.approx(cycles, abs=0.02, rel=0.02), name


# Scales in units, of a cube of size 1 that is turned, and ways in which it gets them.
SCALES = (
    *((1, 1, 1), (-1, 1, 1), (1, 1, 0), (0, 1, 1), (1, -1, 0), (1, 0, 0), (0, 0, -1), (0, 0, 0)),
    *((1, 1, 1e-8), (1, 1, 1e-38)),
)
WAYS = ("own", "shared", "own and modified", "collection", "collections", "nodes")


def scatter(obj, place, scale):
    """An object whose nodes place two copies of another one, the second far off."""
    tree = bpy.data.node_groups.new("Scatter", "GeometryNodeTree")
    tree.interface.new_socket("Geometry", in_out="OUTPUT", socket_type="NodeSocketGeometry")
    info, points, copies, end = (
        tree.nodes.new(kind)
        for kind in (
            *("GeometryNodeObjectInfo", "GeometryNodePoints"),
            *("GeometryNodeInstanceOnPoints", "NodeGroupOutput"),
        )
    )
    info.inputs["Object"].default_value, info.inputs["As Instance"].default_value = obj, True
    copies.inputs["Scale"].default_value, copies.inputs["Rotation"].default_value = scale, (0.3, 0.4, 0.5)
    tree.links.new(info.outputs["Geometry"], copies.inputs["Instance"])
    tree.links.new(points.outputs[0], copies.inputs["Points"])
    tree.links.new(copies.outputs[0], end.inputs[0])
    made = link("Scatter", bpy.data.meshes.new("Scatter"))
    made.modifiers.new("Scatter", "NODES").node_group = tree
    made.location = place
    obj.location = (500.0, 0.0, 0.0)


def placed(way, scale, place, material):
    """A cube at a place, scaled in a way."""
    bpy.ops.mesh.primitive_cube_add(size=1.5, rotation=(0.3, 0.4, 0.5))
    cube = bpy.context.object
    cube.data.materials.append(material)
    if way == "nodes":
        scatter(cube, place, scale)
        return
    if way.startswith("collection"):
        inside = bpy.data.collections.new("Inside")
        bpy.context.scene.collection.objects.unlink(cube)
        inside.objects.link(cube)
        for number in range(1 + (way == "collections")):
            empty = link("Empty", None)
            empty.instance_type, empty.instance_collection = "COLLECTION", inside
            empty.location, empty.scale, empty.rotation_euler = place, scale, (0.5, -0.3, 0.2)
            empty.location.z -= 500.0 * number
        return
    cube.location, cube.scale = place, scale
    if way == "shared":
        link("Other", cube.data).location = (500.0, 0.0, 0.0)
    elif way == "own and modified":
        cube.modifiers.new("Smooth", "SUBSURF")
        other = link("Other", cube.data)
        other.location = (500.0, 0.0, 0.0)


def test_flat_objects_are_those_of_cycles(tmp_path, addon):
    """By the engine and by Live View: shared meshes vanish, others are shown flat."""
    table = [(way, scale) for way in WAYS for scale in SCALES]
    scene = table_scene(len(table))
    scene.render.film_transparent = True
    material = new_material("Glow")
    show(material.node_tree, glow(material.node_tree))
    for number, (way, scale) in enumerate(table):
        placed(way, scale, (*middle(number), 0.0), material)
    ours, cycles = (cells(image)[: len(table), ..., 3] > 0.5 for image in both(scene, tmp_path))
    count, right = ours.sum(axis=(1, 2)), cycles.sum(axis=(1, 2))
    assert {table[n]: (count[n], right[n]) for n in np.flatnonzero(count != right)} == {}
    assert {way for (way, scale), n in zip(table, right, strict=True) if scale == (1, 1, 0) and n} == {
        *("own", "collection", "own and modified")
    }
    live = addon("bridge.live.live_view").LiveView()
    size = scene.render.resolution_x, scene.render.resolution_y
    image = live.refresh(bpy.context.evaluated_depsgraph_get(), scene.camera, size)
    image = cells(np.abs(image - image[0, 0]))[: len(table), ..., :3].max(axis=3) > 0.02
    shown_live = image.any(axis=(1, 2))
    assert {table[n] for n in np.flatnonzero(shown_live != (right > 0))} == set()


@pytest.fixture
def foggy():
    """Cubes in a row: painted, of fog alone, with both on different faces; and what makes fog painted."""
    material = new_material("Fog")
    output(material.node_tree, volume=fog)
    objects = {}
    for number, name in enumerate(("Painted", "Foggy", "Both")):
        bpy.ops.mesh.primitive_cube_add(size=1, location=(3 * number, 0, 0))
        objects[name] = bpy.context.object
        objects[name].name = name
        if name != "Foggy":
            objects[name].data.materials.append(new_material("Paint"))
        if name != "Painted":
            objects[name].data.materials.append(material)
    for face in list(objects["Both"].data.polygons)[:2]:
        face.material_index = 1
    bpy.context.view_layer.update()
    tree = material.node_tree

    def paint():
        tree.links.new(glow(tree), tree.nodes["Material Output"].inputs["Surface"])
        bpy.context.view_layer.update()

    return paint


def test_no_way_to_a_picture_meets_a_volumes_faces(foggy, addon, read):
    scene = read()
    assert shown(scene) == {"Painted", "Both"}
    assert len(scene.geometry.triangles) == 12 + 8
    named = "Not shown as it is: Material Output: Volume (in Fog)"
    assert [str(line) for line in scene.warnings].count(named) == 1
    depsgraph = bpy.context.evaluated_depsgraph_get()
    source = addon("bridge.live.live_view").source_of(depsgraph)
    members = addon("scanline.preview.preview_members").shown_objects

    def triangles():
        """Of Live View, by object."""
        places = source.objects.read(bpy.context.evaluated_depsgraph_get()).values()
        return {source.objects.table.objects[each.number].name: len(each.mesh.triangles) for each in places}

    assert triangles() == {"Painted": 12, "Both": 8}
    arrays = addon("bridge.aim.read_problem").read_arrays(depsgraph)
    assert [name for name, _ in arrays.names] == ["Painted", "Foggy", "Both"]
    assert np.bincount(arrays.scene.objects, minlength=3).tolist() == [12, 0, 8]
    assert {each.name for each in members(bpy.context.view_layer).values()} == {"Painted", "Both"}
    foggy()
    assert triangles() == {"Painted": 12, "Foggy": 12, "Both": 12}
    assert {each.name for each in members(bpy.context.view_layer).values()} == {"Painted", "Foggy", "Both"}
