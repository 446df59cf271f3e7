# SPDX-License-Identifier: GPL-3.0-or-later
"""Shader nodes against Cycles: the same colours, pixel by pixel, on glowing surfaces."""

import math

import bpy
import numpy as np
import pytest
from material_cases import CASES, STEEP, half, image_node, new_image, spread
from shown_materials import (
    add,
    both,
    differing,
    emit,
    new_material,
    picture,
    scene_with_camera,
    show,
    wavy_sheet,
)

# A cell of the contact sheet in pixels, and of these, how many may differ by more than a step of 8 bits:
# steps and borders pass through pixel centres.
CELL, MOST_PIXELS = 14, 2
STEP = 1 / 255
# Where a colour is steep, float32 against float64 shows.
MOST_STEEP = 8


def contact_sheet(makers):
    """A scene of one sheet for each material, seen from above; return (row, column) of each."""
    scene = scene_with_camera()
    columns = int(np.ceil(np.sqrt(len(makers))))
    rows = -(-len(makers) // columns)
    first = wavy_sheet()
    bpy.context.scene.collection.objects.unlink(first)
    places = {}
    for number, (name, make) in enumerate(makers.items()):
        row, column = divmod(number, columns)
        places[name] = row, column
        sheet = bpy.data.objects.new(name, first.data)
        if not first.data.materials:
            first.data.materials.append(None)
        scene.collection.objects.link(sheet)
        sheet.location, sheet.rotation_euler = (2.4 * column, 2.4 * row, 0), (0.1, 0.2, 0.15)
        sheet.material_slots[0].link = "OBJECT"
        material = sheet.material_slots[0].material = new_material(name)
        make(material.node_tree)
    camera = scene.camera
    middle = 1.2 * (columns - 1), 1.2 * (rows - 1)
    # From so far that all sheets are seen under nearly the same angle.
    camera.location, camera.rotation_euler = (*middle, 300.0), (0, 0, 0)
    camera.data.lens, camera.data.clip_end = 36 * 300 / (2.4 * max(columns, rows)), 1000
    camera.data.clip_start = 100
    scene.render.resolution_x, scene.render.resolution_y = CELL * columns, CELL * rows
    return scene, places


def cell(picture, place):
    row, column = place
    return picture[CELL * row : CELL * (row + 1), CELL * column : CELL * (column + 1)]


def glowing(make):
    return lambda tree: emit(tree, make(tree))


def test_every_supported_node_is_as_in_cycles(tmp_path):
    scene, places = contact_sheet({name: glowing(make) for name, make in CASES.items()})
    ours, cycles = both(scene, tmp_path)
    wrong = []
    for name, place in places.items():
        a, b = cell(ours, place), cell(cycles, place)
        off = int((np.abs(a - b).max(axis=2) > STEP).sum())
        if off > (MOST_STEEP if name in STEEP else MOST_PIXELS):
            wrong.append((name, off, float(np.abs(a - b).max())))
        # A sheet without any colour at all would say nothing, but for what is 0 by definition.
        assert a.shape == (CELL, CELL, 4)
    assert not wrong
    assert len(places) > 150


KINDS = {"8 bits": ("PNG", "8"), "16 bits": ("PNG", "16"), "floats": ("OPEN_EXR", "32")}
ALPHAS = ("STRAIGHT", "PREMUL", "CHANNEL_PACKED", "NONE")


def save_image(path, kind, premultiplied):
    """Write random colours and alphas above 0 to a file; 8 bits unchanged."""
    image = bpy.data.images.new("Colors", 8, 6, alpha=True, float_buffer=kind != "8 bits")
    pixels = np.random.default_rng(1).uniform(0.1, 0.9, (6, 8, 4)).astype(np.float32)
    if premultiplied:
        pixels[..., :3] *= pixels[..., 3:]
    image.pixels.foreach_set(pixels.ravel())
    settings = bpy.context.scene.render.image_settings
    if hasattr(settings, "media_type"):
        settings.media_type = "IMAGE"
    settings.color_mode = "RGBA"
    settings.file_format, settings.color_depth = KINDS[kind]
    if kind == "8 bits":
        image.filepath_raw, image.file_format = str(path), "PNG"
        image.save()
    else:
        image.save_render(str(path))


@pytest.mark.parametrize("kind", KINDS)
def test_images_with_alpha_are_as_in_cycles(kind, tmp_path):
    """For every storage and setting of alpha, used or not."""
    paths = {mode: tmp_path / f"{mode}.{KINDS[kind][0]}" for mode in ("STRAIGHT", "PREMUL")}
    for mode, path in paths.items():
        save_image(path, kind, mode == "PREMUL" or kind == "floats")

    def maker(alpha, space, packed, used):
        def make(tree):
            path = paths["PREMUL" if alpha == "PREMUL" else "STRAIGHT"]
            image = bpy.data.images.load(str(path))
            image.alpha_mode, image.colorspace_settings.name = alpha, space
            if packed:
                image.pack()
            node = image_node(tree, image)
            if not used:
                return node.outputs[0]
            links = {"_0": node.outputs[1], "_6": (0, 0, 1), "_7": node.outputs[0]}
            return add(tree, "ShaderNodeMix", {"data_type": "RGBA"}, **links).outputs[2]

        return glowing(make)

    spaces = [(alpha, "sRGB") for alpha in ALPHAS]
    spaces += [(alpha, "Linear Rec.709") for alpha in ALPHAS[:2]] + [("STRAIGHT", "Non-Color")]
    makers = {
        f"{alpha} {space} {packed} {used}": maker(alpha, space, packed, used)
        for alpha, space in spaces
        for packed in (False, True)
        for used in (False, True)
    }
    scene, places = contact_sheet(makers)
    ours, cycles = both(scene, tmp_path)
    wrong = {}
    for name, place in places.items():
        off = np.abs(cell(ours, place) - cell(cycles, place)).max(axis=2)
        if (off > STEP).sum() > MOST_PIXELS:
            wrong[name] = int((off > STEP).sum()), float(off.max())
    assert not wrong


def test_colors_that_blender_cuts_off_are_named(addon, tmp_path):
    """Straight colours in a file that is set to premultiplied."""
    read = addon("bridge.scene.read_images").read_images
    for premultiplied in (True, False):
        path = tmp_path / f"{premultiplied}.png"
        save_image(path, "8 bits", premultiplied)
        image = bpy.data.images.load(str(path))
        image.alpha_mode = "PREMUL"
        warnings = read([image.name])[1]
        assert any("cut off" in line for line in warnings) != premultiplied


NORMALS = ["flat", "smooth", "sharp edges", "flat faces and sharp edges", "custom"]
if bpy.app.version >= (5, 2, 0):
    # Up to then Cycles, unlike EEVEE, shades smooth faces by the normals of flat ones beside them as well.
    NORMALS.append("some faces flat")


@pytest.mark.parametrize("kind", NORMALS)
def test_normals_are_those_that_cycles_shades_with(kind, tmp_path):
    """Faces with four corners that are not coplanar, one copy mirrored, beside a smooth object."""
    scene = scene_with_camera()
    mesh = wavy_sheet().data
    for number, vertex in enumerate(mesh.vertices):
        vertex.co.z += 0.1 * math.sin(7 * number)
    faces, edges = len(mesh.polygons), len(mesh.edges)
    flat = {"flat": np.ones(faces, bool), "smooth": np.zeros(faces, bool), "custom": np.zeros(faces, bool)}
    some = np.arange(faces) % 3 == 0
    if kind != "sharp edges":
        mesh.polygons.foreach_set("use_smooth", ~flat.get(kind, some))
    if "edges" in kind:
        mesh.edges.foreach_set("use_edge_sharp", np.arange(edges) % 5 == 0)
    if kind == "custom":
        mesh.normals_split_custom_set([(0.3, 0.1 * (k % 4), 0.9) for k in range(len(mesh.loops))])
    mesh.update()
    other = bpy.data.objects.new("Mirrored", mesh)
    other.location, other.scale = (0.9, 0.4, 0.4), (-0.6, 0.5, 0.5)
    scene.collection.objects.link(other)
    bpy.ops.mesh.primitive_uv_sphere_add(segments=8, ring_count=6, radius=0.4, location=(-0.7, 0.6, 0.5))
    ball = bpy.context.object.data
    ball.shade_smooth()
    for each in (mesh, ball):
        material = new_material()
        tree = material.node_tree
        emit(tree, half(tree, add(tree, "ShaderNodeNewGeometry").outputs["Normal"]))
        each.materials.append(material)
    assert differing(*both(scene, tmp_path), STEP) < 0.01


@pytest.mark.parametrize("kind", ["noise", "image", "inverted", "weak"])
def test_bump_is_as_in_cycles(kind, tmp_path):
    """Nearly: Cycles takes the slope over a tenth of a pixel, and this image has more pixels."""
    scene = scene_with_camera(96)
    material = new_material()
    tree = material.node_tree
    if kind == "image":
        height = image_node(tree, new_image(), interpolation="Cubic").outputs[0]
    else:
        height = add(tree, "ShaderNodeTexNoise", _0=spread(tree)[0], Scale=0.7, Detail=0.0).outputs[0]
    inputs = {"Strength": 0.3 if kind == "weak" else 1.0, "Distance": 0.3, "Height": height}
    node = add(tree, "ShaderNodeBump", {"invert": kind == "inverted"}, **inputs)
    emit(tree, half(tree, node.outputs[0]))
    wavy_sheet().data.materials.append(material)
    ours, cycles = both(scene, tmp_path)
    print(
        "DIFF",
        kind,
        differing(ours, cycles, STEP),
        differing(ours, cycles, 6 * STEP),
        abs(ours - cycles).max(),
    )
    assert differing(ours, cycles, STEP) < (0.2 if kind == "image" else 0.01)
    assert differing(ours, cycles, 6 * STEP) < 0.01


def color_group():
    """A group that multiplies its colour by its factor, through a reroute and an inner group."""
    inner = bpy.data.node_groups.new("Inner", "ShaderNodeTree")
    outer = bpy.data.node_groups.new("Outer", "ShaderNodeTree")
    for tree in (inner, outer):
        tree.interface.new_socket("Paint", in_out="INPUT", socket_type="NodeSocketColor")
        tree.interface.new_socket("Share", in_out="INPUT", socket_type="NodeSocketFloat")
        tree.interface.new_socket("Result", in_out="OUTPUT", socket_type="NodeSocketColor")
    source, result = inner.nodes.new("NodeGroupInput"), inner.nodes.new("NodeGroupOutput")
    settings = {"data_type": "RGBA", "blend_type": "MULTIPLY"}
    mixed = add(inner, "ShaderNodeMix", settings, _0=1.0, _6=source.outputs[0], _7=source.outputs[1])
    inner.links.new(mixed.outputs[2], result.inputs[0])
    source, result = outer.nodes.new("NodeGroupInput"), outer.nodes.new("NodeGroupOutput")
    group, reroute = outer.nodes.new("ShaderNodeGroup"), outer.nodes.new("NodeReroute")
    group.node_tree = inner
    outer.links.new(source.outputs[0], reroute.inputs[0])
    outer.links.new(reroute.outputs[0], group.inputs[0])
    outer.links.new(source.outputs[1], group.inputs[1])
    outer.links.new(group.outputs[0], result.inputs[0])
    return outer


def grouped(tree):
    node = tree.nodes.new("ShaderNodeGroup")
    node.node_tree = color_group()
    tree.links.new(add(tree, "ShaderNodeUVMap", {"uv_map": "First"}).outputs[0], node.inputs[0])
    node.inputs[1].default_value = 0.6
    return node.outputs[0]


def muted(tree):
    """A colour through a muted node."""
    node = add(tree, "ShaderNodeInvert", _1=add(tree, "ShaderNodeUVMap", {"uv_map": "First"}).outputs[0])
    node.mute = True
    return node.outputs[0]


def mixed_shaders(tree, kind="MixShader"):
    """Two glowing colours, mixed by position, or added."""
    first = add(tree, "ShaderNodeEmission", _0=(0.8, 0.1, 0.1), _1=0.7).outputs[0]
    second = add(tree, "ShaderNodeEmission", _0=(0.1, 0.2, 0.9)).outputs[0]
    if kind == "MixShader":
        share = add(tree, "ShaderNodeUVMap", {"uv_map": "First"}).outputs[0]
        node = add(tree, "ShaderNodeMixShader", _0=share, _1=first, _2=second)
    else:
        node = add(tree, "ShaderNodeAddShader", _0=first, _1=second)
    show(tree, node.outputs[0])


def glowing_principled(tree):
    uv = add(tree, "ShaderNodeUVMap", {"uv_map": "First"}).outputs[0]
    inputs = {"Base_Color": (0, 0, 0), "Roughness": 1.0, "Specular_IOR_Level": 0.0}
    shader = add(tree, "ShaderNodeBsdfPrincipled", **inputs, Emission_Color=uv, Emission_Strength=0.6)
    show(tree, shader.outputs[0])


def test_groups_muted_nodes_and_mixed_shaders_are_as_in_cycles(tmp_path):
    makers = {
        "group": glowing(grouped),
        "muted": glowing(muted),
        "mixed": mixed_shaders,
        "added": lambda tree: mixed_shaders(tree, "AddShader"),
        "principled": glowing_principled,
    }
    scene, places = contact_sheet(makers)
    ours, cycles = both(scene, tmp_path)
    for name, place in places.items():
        off = np.abs(cell(ours, place) - cell(cycles, place)).max(axis=2) > STEP
        assert off.sum() <= MOST_PIXELS, name


def test_unsupported_nodes_are_listed_once_and_never_black(read):
    makers = {
        "texture": lambda tree: emit(tree, add(tree, "ShaderNodeTexVoronoi").outputs["Color"]),
        "same": lambda tree: emit(tree, add(tree, "ShaderNodeTexVoronoi").outputs["Color"]),
        "passing": lambda tree: emit(
            tree, add(tree, "ShaderNodeTexVoronoi", _2=add(tree, "ShaderNodeValue").outputs[0]).outputs[0]
        ),
        "shader": lambda tree: show(tree, add(tree, "ShaderNodeBsdfToon", Color=(0.3, 0.2, 0.1)).outputs[0]),
        "bevel": lambda tree: show(
            tree,
            add(
                tree,
                "ShaderNodeBsdfDiffuse",
                Color=(0.4, 0.5, 0.6),
                Normal=add(tree, "ShaderNodeBevel").outputs[0],
            ).outputs[0],
        ),
    }
    contact_sheet(makers)
    scene = read()
    (voronoi,) = [line for line in scene.warnings if "Voronoi" in line]
    assert all(name in voronoi for name in ("texture", "same", "passing"))
    assert len([line for line in scene.warnings if "Toon" in line]) == 1
    assert len([line for line in scene.warnings if "Bevel" in line]) == 1
    assert len([line for line in scene.warnings if line.startswith("Not shown as it is")]) == 3


def test_unsupported_nodes_are_grey_in_the_image(tmp_path):
    makers = {"texture": lambda tree: emit(tree, add(tree, "ShaderNodeTexVoronoi").outputs["Color"])}
    scene, _ = contact_sheet(makers)
    seen = picture(scene, "SCFPF", tmp_path)
    assert seen[CELL // 2, CELL // 2, :3] == pytest.approx(0.5)


def test_a_tree_may_be_deeper_than_pythons_stack(tmp_path):
    scene = scene_with_camera(8)
    material = new_material()
    tree = material.node_tree
    value = add(tree, "ShaderNodeNewGeometry").outputs["Backfacing"]
    for _ in range(300):
        value = add(tree, "ShaderNodeMath", _0=value, _1=0.001).outputs[0]
    emit(tree, value)
    wavy_sheet().data.materials.append(material)
    assert picture(scene, "SCFPF", tmp_path)[4, 4, 0] == pytest.approx(0.3)


def test_layers_are_read_only_where_a_material_asks_for_one(read):
    contact_sheet({"plain": lambda tree: emit(tree, add(tree, "ShaderNodeRGB").outputs[0])})
    assert not read().geometry.layers
    bpy.ops.wm.read_homefile(use_empty=True, use_factory_startup=True)
    contact_sheet(
        {"mapped": lambda tree: emit(tree, add(tree, "ShaderNodeUVMap", {"uv_map": "Second"}).outputs[0])}
    )
    other = bpy.data.objects.new("Other", bpy.data.meshes.new("Other"))
    other.data.from_pydata([(0, 0, 9), (1, 0, 9), (0, 1, 9)], [], [(0, 1, 2)])
    bpy.context.scene.collection.objects.link(other)
    geometry = read().geometry
    assert set(geometry.layers) == {"UV:Second"}
    row = geometry.layers["UV:Second"].row
    number = geometry.object_names.index("Other")
    assert (row[geometry.object_index == number] == -1).all()
    assert (row[geometry.object_index != number] >= 0).all()


def test_copies_share_a_layer_and_mirrored_ones_have_it_turned_over(read):
    scene, _ = contact_sheet({"mapped": lambda tree: emit(tree, add(tree, "ShaderNodeUVMap").outputs[0])})
    sheet = scene.collection.objects["mapped"]
    for scale in (1, -1, 1):
        copy = sheet.copy()
        scene.collection.objects.link(copy)
        copy.scale.x = scale
    geometry = read().geometry
    layer, triangles = geometry.layers["UV:"], len(geometry.triangles)
    assert len(layer.values) == triangles // 2
    # Where each corner is in its object's plane, the coordinates say too.
    for number, name in enumerate(geometry.object_names):
        own = geometry.object_index == number
        corners = geometry.vertices[geometry.triangles[own]].reshape(-1, 3)
        matrix = np.array(scene.collection.objects[name].matrix_world)
        local = (np.c_[corners, np.ones(len(corners))] @ np.linalg.inv(matrix).T)[:, :2]
        uv = layer.values[layer.row[own]].reshape(-1, 2)
        assert np.abs(local * 0.5 + 0.5 - uv).max() < 1e-5


def image_material(image):
    material = new_material(image.name)
    emit(material.node_tree, add(material.node_tree, "ShaderNodeTexImage", {"image": image}).outputs[0])
    return material


def test_images_that_nothing_shows_are_not_loaded(addon):
    """One of six is visible: the others are on no face, hidden, unlinked, muted, or outside the volume."""
    scene = scene_with_camera()
    images = {
        name: bpy.data.images.new(name, 4, 4) for name in ("seen", "slot", "hidden", "loose", "muted", "far")
    }
    sheet = wavy_sheet()
    for name in ("seen", "slot"):
        sheet.data.materials.append(image_material(images[name]))
    tree = sheet.data.materials[0].node_tree
    add(tree, "ShaderNodeTexImage", {"image": images["loose"]})
    add(tree, "ShaderNodeTexImage", {"image": images["muted"]}).mute = True
    for name, location in (("hidden", (0, 0, -1)), ("far", (0, 0, 500))):
        other = bpy.data.objects.new(name, sheet.data.copy())
        other.data.materials.clear()
        other.data.materials.append(image_material(images[name]))
        other.location, other.hide_render = location, name == "hidden"
        scene.collection.objects.link(other)
    prepare = addon("bridge.render.render_inputs").prepare
    inputs = prepare(scene, bpy.context.view_layer, scene.camera)
    assert set(inputs.scene.images) == {"seen"}


def test_a_viewport_keeps_images_until_they_change(addon, tmp_path):
    read = addon("bridge.scene.read_images").read_images
    image = bpy.data.images.new("Painted", 4, 4)
    image.filepath_raw, image.file_format = str(tmp_path / "painted.png"), "PNG"
    image.save()
    image = bpy.data.images.load(image.filepath_raw)
    known = {}
    first = read([image.name], known)[0][image.name]
    assert read([image.name], known)[0][image.name] is first
    image.pixels.foreach_set(np.full(64, 0.5, np.float32))
    painted = read([image.name], known)[0][image.name]
    assert (painted.pixels[:, :, 3] == 128).all() and painted is not first
    image.save()
    assert read([image.name], known)[0][image.name] is not first
    image.colorspace_settings.name = "Non-Color"
    assert not read([image.name], known)[0][image.name].encoded
    bpy.data.images.remove(image)
    found, warnings = read(["painted.png"], known)
    assert not found and "painted.png" in warnings[0]


def test_many_material_slots_take_memory_once(read):
    """Slots are stored one after another: a table of all objects would be as wide as the widest."""
    sheet = wavy_sheet()
    material = new_material()
    emit(material.node_tree, add(material.node_tree, "ShaderNodeRGB").outputs[0])
    for _ in range(2000):
        sheet.data.materials.append(material)
    for number in range(30):
        bpy.context.scene.collection.objects.link(bpy.data.objects.new(f"{number}", sheet.data))
    sheet.data.polygons[3].material_index = 1999
    sheet.data.polygons[4].material_index = 32767
    scene = read()
    assert len(scene.materials.metallic) == 2
    assert set(scene.geometry.material.tolist()) == {1}


def test_coordinates_that_are_no_numbers_make_no_trouble(tmp_path, recwarn):
    scene = scene_with_camera()
    sheet = wavy_sheet()
    image = bpy.data.images.new("Grey", 4, 4)
    sheet.data.materials.append(image_material(image))
    layer = sheet.data.uv_layers[0]
    values = np.empty(2 * len(sheet.data.loops), np.float32)
    layer.uv.foreach_get("vector", values)
    values[::5], values[1::7] = np.nan, np.inf
    layer.uv.foreach_set("vector", values)
    assert np.isfinite(picture(scene, "SCFPF", tmp_path)).all()
    assert not [one for one in recwarn if issubclass(one.category, RuntimeWarning)]
