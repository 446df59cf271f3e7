# SPDX-License-Identifier: GPL-3.0-or-later
"""Materials as constants, folded through links, groups and mixes; and as Material Preview shows them."""

from typing import NamedTuple

import bpy
import numpy as np
import pytest

VIEWPORT = (0.11, 0.22, 0.33)
RED = (0.9, 0.1, 0.05)


class Constants(NamedTuple):
    """Constants of a material."""

    base_color: np.ndarray
    metallic: float
    roughness: float
    specular_f0: float
    emission: np.ndarray


@pytest.fixture
def read_material(addon):
    """Read a material as evaluated on an object: (constants, whether the material is no more)."""
    module = addon("bridge.scene.read_materials")

    def read(material):
        bpy.ops.mesh.primitive_plane_add()
        obj = bpy.context.object
        obj.data.materials.append(material)
        evaluated = obj.evaluated_get(bpy.context.evaluated_depsgraph_get())
        table = module.MaterialTable()
        number = table.number(evaluated.material_slots[0].material)
        made = table.materials()
        return Constants(*(getattr(made, name)[number] for name in Constants._fields)), not table.graphs

    return read


@pytest.fixture
def preview(addon):
    """The colour, metallic and roughness with which Material Preview shows a material."""
    module = addon("bridge.live.read_surfaces")

    def read(material):
        uid = material.session_uid
        values = np.float32(module.read_material_looks({uid}, "NODES")[uid].values)
        return values[:3], values[4], values[5]

    return read


def new_material(nodes=True):
    material = bpy.data.materials.new("Material")
    material.diffuse_color = (*VIEWPORT, 1)
    material.metallic, material.roughness = 0.7, 0.3
    if nodes and material.node_tree is None:
        material.use_nodes = True
    if material.node_tree:
        material.node_tree.nodes.clear()
    return material


def add(tree, kind, **inputs):
    """A node with the given inputs ('Base_Color' is 'Base Color')."""
    node = tree.nodes.new(kind)
    for name, value in inputs.items():
        socket = node.inputs[name.replace("_", " ")]
        socket.default_value = (*value, 1) if isinstance(value, tuple) else value
    return node


def show(tree, node, socket=0):
    output = tree.nodes.new("ShaderNodeOutputMaterial")
    tree.links.new(node.outputs[socket], output.inputs["Surface"])


def principled(tree, **inputs):
    return add(tree, "ShaderNodeBsdfPrincipled", **inputs)


def test_principled_constants(read_material):
    material = new_material()
    tree = material.node_tree
    show(
        tree,
        principled(
            tree,
            Base_Color=RED,
            Metallic=0.25,
            Roughness=0.95,
            Emission_Color=(1.0, 0.5, 0.0),
            Emission_Strength=3.0,
        ),
    )
    constants, whole = read_material(material)
    assert whole
    assert constants.base_color == pytest.approx(RED)
    assert (constants.metallic, constants.roughness) == pytest.approx((0.25, 0.95))
    assert constants.emission == pytest.approx((3.0, 1.5, 0.0))


@pytest.mark.parametrize(
    "ior, level, f0", [(1.5, 0.5, 0.04), (1.5, 1.0, 0.08), (1.0, 0.5, 0.0), (3.0, 0.5, 0.25)]
)
def test_reflectance_is_fresnels_times_twice_the_specular_level(read_material, ior, level, f0):
    material = new_material()
    node = principled(material.node_tree, IOR=ior)
    node.inputs["Specular IOR Level"].default_value = level
    show(material.node_tree, node)
    assert read_material(material)[0].specular_f0 == pytest.approx(f0, abs=1e-7)


def test_linked_constants_count_through_reroutes(read_material):
    material = new_material()
    tree = material.node_tree
    shader = principled(tree)
    color, value, reroute = tree.nodes.new("ShaderNodeRGB"), tree.nodes.new("ShaderNodeValue"), None
    color.outputs[0].default_value = (*RED, 1)
    value.outputs[0].default_value = 0.9375
    source = color.outputs[0]
    for _ in range(2):
        reroute = tree.nodes.new("NodeReroute")
        tree.links.new(source, reroute.inputs[0])
        source = reroute.outputs[0]
    tree.links.new(source, shader.inputs["Base Color"])
    tree.links.new(value.outputs[0], shader.inputs["Roughness"])
    # A number feeds a colour as grey, a colour feeds a number as its luminance.
    tree.links.new(value.outputs[0], shader.inputs["Emission Color"])
    shader.inputs["Emission Strength"].default_value = 2
    tree.links.new(color.outputs[0], shader.inputs["Metallic"])
    show(tree, shader)
    constants, whole = read_material(material)
    assert whole
    assert constants.base_color == pytest.approx(RED)
    assert constants.roughness == 0.9375
    assert constants.emission == pytest.approx((1.875, 1.875, 1.875))
    assert constants.metallic == pytest.approx(0.2126 * RED[0] + 0.7152 * RED[1] + 0.0722 * RED[2])


def test_constants_are_folded(read_material):
    """Sums of constants and mixes by 0 or 1 are constants."""
    material = new_material()
    tree = material.node_tree
    half, sixth = tree.nodes.new("ShaderNodeMath"), tree.nodes.new("ShaderNodeMath")
    half.operation, sixth.operation = "ADD", "MULTIPLY"
    for node, values in ((half, (0.125, 0.375)), (sixth, (0.5, 1 / 3))):
        for socket, value in zip(node.inputs, values, strict=False):
            socket.default_value = value
    tree.links.new(half.outputs[0], sixth.inputs[0])
    first, second = principled(tree), principled(tree, Base_Color=RED, Emission_Color=(1.0, 1.0, 1.0))
    tree.links.new(sixth.outputs[0], second.inputs["Emission Strength"])
    mix = add(tree, "ShaderNodeMixShader")
    mix.inputs[0].default_value = 1.0
    for socket, node in zip(mix.inputs[1:], (first, second), strict=True):
        tree.links.new(node.outputs[0], socket)
    show(tree, mix)
    constants, whole = read_material(material)
    assert whole and constants.base_color == pytest.approx(RED)
    assert constants.emission == pytest.approx((1 / 6,) * 3)


def test_a_texture_is_previewed_in_viewport_colour(read_material, preview):
    material = new_material()
    tree = material.node_tree
    shader, noise = principled(tree, Emission_Strength=0.0), tree.nodes.new("ShaderNodeTexNoise")
    for name in ("Base Color", "Metallic", "Roughness", "Emission Color"):
        tree.links.new(noise.outputs[0], shader.inputs[name])
    show(tree, shader)
    assert not read_material(material)[1]
    color, metallic, roughness = preview(material)
    assert color == pytest.approx(VIEWPORT) and (metallic, roughness) == pytest.approx((0.7, 0.3))


def test_muted_links_do_not_count(read_material):
    material = new_material()
    tree = material.node_tree
    shader, noise = principled(tree, Base_Color=RED), tree.nodes.new("ShaderNodeTexNoise")
    tree.links.new(noise.outputs[0], shader.inputs["Base Color"]).is_muted = True
    show(tree, shader)
    constants, whole = read_material(material)
    assert whole and constants.base_color == pytest.approx(RED)


@pytest.mark.parametrize("mixer", ["ShaderNodeMixShader", "ShaderNodeAddShader"])
def test_the_first_principled_behind_mixes_is_previewed(preview, mixer):
    material = new_material()
    tree = material.node_tree
    inner, outer = tree.nodes.new(mixer), tree.nodes.new(mixer)
    first, second = [one for one in inner.inputs if one.type == "SHADER"]
    tree.links.new(add(tree, "ShaderNodeEmission").outputs[0], first)
    tree.links.new(principled(tree, Base_Color=RED).outputs[0], second)
    first, second = [one for one in outer.inputs if one.type == "SHADER"]
    tree.links.new(inner.outputs[0], first)
    tree.links.new(principled(tree).outputs[0], second)
    show(tree, outer)
    assert preview(material)[0] == pytest.approx(RED)


def test_diffuse_glossy_and_emission(read_material, preview):
    expected = {
        "ShaderNodeBsdfDiffuse": (RED, 0.0, (0, 0, 0)),
        "ShaderNodeBsdfGlossy": (RED, 1.0, (0, 0, 0)),
        "ShaderNodeEmission": ((0, 0, 0), 0.0, RED),
    }
    for kind, (base, metallic, emission) in expected.items():
        material = new_material()
        rough = {"Roughness": 0.95} if "Glossy" in kind else {}
        show(material.node_tree, add(material.node_tree, kind, Color=RED, **rough))
        constants, whole = read_material(material)
        assert whole
        assert constants.base_color == pytest.approx(base) and constants.emission == pytest.approx(emission)
        assert (constants.metallic, constants.specular_f0) == (metallic, 0.0)
        assert preview(material)[0] == pytest.approx(RED) and preview(material)[1] == metallic


def group_with_principled():
    """A node group with a colour input that feeds a Principled BSDF two groups deep."""
    trees = []
    for depth in range(2):
        tree = bpy.data.node_groups.new("Group", "ShaderNodeTree")
        tree.interface.new_socket("Unused", in_out="INPUT", socket_type="NodeSocketFloat")
        tree.interface.new_socket("Paint", in_out="INPUT", socket_type="NodeSocketColor")
        tree.interface.new_socket("Shader", in_out="OUTPUT", socket_type="NodeSocketShader")
        source, output = tree.nodes.new("NodeGroupInput"), tree.nodes.new("NodeGroupOutput")
        if depth == 0:
            inside = tree.nodes.new("ShaderNodeBsdfPrincipled")
            tree.links.new(source.outputs["Paint"], inside.inputs["Base Color"])
        else:
            inside = tree.nodes.new("ShaderNodeGroup")
            inside.node_tree = trees[0]
            tree.links.new(source.outputs["Paint"], inside.inputs["Paint"])
        tree.links.new(inside.outputs[0], output.inputs["Shader"])
        trees.append(tree)
    return trees[1]


def test_groups_are_entered_and_their_inputs_followed(read_material):
    material = new_material()
    tree = material.node_tree
    group = tree.nodes.new("ShaderNodeGroup")
    group.node_tree = group_with_principled()
    group.inputs["Paint"].default_value = (*RED, 1)
    show(tree, group)
    constants, whole = read_material(material)
    assert whole and constants.base_color == pytest.approx(RED)
    color = tree.nodes.new("ShaderNodeRGB")
    color.outputs[0].default_value = (0, 0, 1, 1)
    tree.links.new(color.outputs[0], group.inputs["Paint"])
    assert read_material(material)[0].base_color == pytest.approx((0, 0, 1))


def test_other_shaders_and_no_output_are_previewed_in_the_viewport_colour(preview):
    for link in (True, False):
        material = new_material()
        glass = add(material.node_tree, "ShaderNodeBsdfGlass")
        if link:
            show(material.node_tree, glass)
        assert preview(material)[0] == pytest.approx(VIEWPORT)


def test_without_nodes_the_viewport_colour_is_all_there_is(read_material, addon, monkeypatch):
    material = new_material(nodes=False)
    monkeypatch.setattr(addon("bridge.blender.versions"), "uses_nodes", lambda _: False)
    constants, whole = read_material(material)
    assert whole
    assert constants.base_color == pytest.approx(VIEWPORT)
    assert (constants.metallic, constants.roughness, constants.specular_f0) == (0.0, 1.0, 0.0), "Diffuse"


def test_uses_nodes_follows_the_switch_where_there_is_one(addon):
    uses_nodes = addon("bridge.blender.versions").uses_nodes
    material = bpy.data.materials.new("Material")
    assert uses_nodes(material) is (bpy.app.version >= (5, 0, 0))
    if material.node_tree is None:
        material.use_nodes = True
    assert uses_nodes(material) is True


def test_animated_inputs_are_read_as_evaluated(read_material):
    material = new_material()
    shader = add(material.node_tree, "ShaderNodeEmission", Color=(1.0, 1.0, 1.0))
    show(material.node_tree, shader)
    for frame, value in ((1, 0.0), (11, 1.0)):
        shader.inputs["Strength"].default_value = value
        shader.inputs["Strength"].keyframe_insert("default_value", frame=frame)
    seen = []
    # Not from the current frame: Blender keeps unkeyed edits until the frame changes.
    bpy.context.scene.frame_set(20)
    read_material(material)
    for frame in (1, 6, 11):
        bpy.context.scene.frame_set(frame)
        seen.append(read_material(material)[0].emission[0])
    assert seen == pytest.approx([0.0, 0.5, 1.0], abs=1e-6)


def test_the_table_numbers_each_material_once_and_starts_with_grey(addon):
    module = addon("bridge.scene.read_materials")
    table = module.MaterialTable()
    first, second = new_material(), new_material()
    for material, color in ((first, (-1.0, 2.0, 0.5)), (second, RED)):
        show(material.node_tree, principled(material.node_tree, Base_Color=color))
    assert [table.number(one) for one in (None, first, second, first, None)] == [0, 1, 2, 1, 0]
    materials = table.materials()
    assert materials.base_color == pytest.approx(np.array([[0.8] * 3, [0, 2, 0.5], RED]))
    assert materials.emission.shape == (3, 3) and materials.roughness.shape == (3,)
    assert table.warnings() == ()


def test_the_table_names_a_few_of_the_materials_that_are_not_shown_as_they_are(addon):
    table = addon("bridge.scene.read_materials").MaterialTable()
    for name in "ABCDE":
        material = new_material()
        material.name = name
        show(material.node_tree, add(material.node_tree, "ShaderNodeBsdfToon"))
        table.number(material)
    (line,) = table.warnings()
    assert line.endswith("(in A, B, C and 2 more)")


def test_constants_are_no_graph_and_everything_else_is(addon):
    """Opaque constants take the fast path; textures, alpha, mirrors and several shaders do not."""
    table = addon("bridge.scene.read_materials").MaterialTable()
    plain = (
        {},
        {"Base_Color": RED, "Metallic": 0.5, "Roughness": 0.95},
        {"Roughness": 0.1, "Specular_IOR_Level": 0.0},
        {"Emission_Color": RED, "Emission_Strength": 2.0},
    )
    graphs = ({"Alpha": 0.5}, {"Transmission_Weight": 1.0, "Roughness": 0.0}, {"Roughness": 0.2})
    for inputs in (*plain, *graphs):
        material = new_material()
        show(material.node_tree, principled(material.node_tree, **inputs))
        table.number(material)
    assert sorted(table.graphs) == [5, 6, 7]
    material = new_material()
    shader, checker = principled(material.node_tree), material.node_tree.nodes.new("ShaderNodeTexChecker")
    show(material.node_tree, shader)
    material.node_tree.links.new(checker.outputs[0], shader.inputs["Base Color"])
    number = table.number(material)
    assert number in table.graphs and not table.graphs[number].reflects
    (line,) = table.warnings()
    assert "Alpha" in line
