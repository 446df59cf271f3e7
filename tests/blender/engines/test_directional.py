# SPDX-License-Identifier: GPL-3.0-or-later
"""Which materials look different from different directions, whose renders stand near to the projectors."""

import bpy
import numpy as np
import pytest

DULL, DIRECTIONAL = False, True


def principled(tree, **values):
    node = tree.nodes["Principled BSDF"]
    for name, value in values.items():
        node.inputs[name.replace("_", " ")].default_value = value


def surface(tree, kind, **attributes):
    """Make a shader of a kind the surface."""
    node = tree.nodes.new(kind)
    for name, value in attributes.items():
        setattr(node, name, value)
    tree.links.new(node.outputs[0], tree.nodes["Material Output"].inputs["Surface"])
    return node


def color_by(tree, kind, output, **attributes):
    """Make an output of a node the colour of the surface, which itself is dull."""
    node = tree.nodes.new(kind)
    for name, value in attributes.items():
        setattr(node, name, value)
    tree.links.new(node.outputs[output], tree.nodes["Principled BSDF"].inputs["Base Color"])
    return node


def turned(tree, space):
    return color_by(tree, "ShaderNodeVectorTransform", 0, convert_from="OBJECT", convert_to=space)


def rough_by_image(tree):
    image = tree.nodes.new("ShaderNodeTexNoise")
    tree.links.new(image.outputs[0], tree.nodes["Principled BSDF"].inputs["Roughness"])


def unused_rim(tree):
    tree.nodes.new("ShaderNodeFresnel")


def toon(component):
    return lambda tree: surface(tree, "ShaderNodeBsdfToon", component=component)


MATERIALS = {
    "as Blender makes it": (DULL, lambda tree: None),
    "smooth": (DIRECTIONAL, lambda tree: principled(tree, Roughness=0.2)),
    "smooth without a layer": (DULL, lambda tree: principled(tree, Roughness=0.2, Specular_IOR_Level=0.0)),
    "smooth of air": (DULL, lambda tree: principled(tree, Roughness=0.2, IOR=1.0)),
    "metal": (DIRECTIONAL, lambda tree: principled(tree, Metallic=1.0)),
    "dull metal": (DULL, lambda tree: principled(tree, Metallic=1.0, Roughness=1.0)),
    "coat": (DIRECTIONAL, lambda tree: principled(tree, Coat_Weight=0.5)),
    "clear": (DIRECTIONAL, lambda tree: principled(tree, Transmission_Weight=1.0)),
    "rough by a texture": (DIRECTIONAL, rough_by_image),
    "diffuse": (DULL, lambda tree: surface(tree, "ShaderNodeBsdfDiffuse")),
    "glossy": (DIRECTIONAL, lambda tree: surface(tree, "ShaderNodeBsdfGlossy")),
    "glass": (DIRECTIONAL, lambda tree: surface(tree, "ShaderNodeBsdfGlass")),
    "emission": (DULL, lambda tree: surface(tree, "ShaderNodeEmission")),
    "toon": (DULL, toon("DIFFUSE")),
    "toon highlights": (DIRECTIONAL, toon("GLOSSY")),
    "rim": (DIRECTIONAL, lambda tree: color_by(tree, "ShaderNodeLayerWeight", "Facing")),
    "rim that nothing uses": (DULL, unused_rim),
    "matcap": (
        DIRECTIONAL,
        lambda tree: color_by(
            tree, "ShaderNodeVectorTransform", 0, convert_from="OBJECT", convert_to="CAMERA"
        ),
    ),
    "turned to the world": (
        DULL,
        lambda tree: color_by(
            tree, "ShaderNodeVectorTransform", 0, convert_from="OBJECT", convert_to="WORLD"
        ),
    ),
    "by the window": (DIRECTIONAL, lambda tree: color_by(tree, "ShaderNodeTexCoord", "Window")),
    "by its own place": (DULL, lambda tree: color_by(tree, "ShaderNodeTexCoord", "Generated")),
    "by the view": (DIRECTIONAL, lambda tree: color_by(tree, "ShaderNodeCameraData", "View Vector")),
    "by the ray": (DIRECTIONAL, lambda tree: color_by(tree, "ShaderNodeNewGeometry", "Incoming")),
}


@pytest.mark.parametrize("name", MATERIALS)
def test_materials_that_look_different_from_different_directions(name, addon):
    expected, make = MATERIALS[name]
    material = bpy.data.materials.new("Own")
    material.use_nodes = True
    make(material.node_tree)
    found = addon("engines.directional").directional(["none", "Own"], np.array([1, 0, 1]))
    assert (found is not None) == expected
    assert found is None or found.tolist() == [True, False, True]


def test_a_mirror_within_groups(addon):
    material = bpy.data.materials.new("Own")
    material.use_nodes = True
    inner, outer = (bpy.data.node_groups.new(name, "ShaderNodeTree") for name in ("Inner", "Outer"))
    for group, kind in ((inner, "ShaderNodeBsdfGlossy"), (outer, "ShaderNodeGroup")):
        group.interface.new_socket("Mirror", in_out="OUTPUT", socket_type="NodeSocketShader")
        node = group.nodes.new(kind)
        if group == outer:
            node.node_tree = inner
        group.links.new(node.outputs[0], group.nodes.new("NodeGroupOutput").inputs[0])
    surface(material.node_tree, "ShaderNodeGroup", node_tree=outer)
    assert addon("engines.directional").directional(["Own"], np.zeros(3, int)).all()


def test_a_material_without_nodes_is_read_by_its_own_roughness(addon, monkeypatch):
    """Newer versions have none: there it is the reading of one that is tested."""
    directional = addon("engines.directional")
    monkeypatch.setattr(directional.versions, "uses_nodes", lambda material: False)
    for roughness, expected in ((0.1, True), (0.9, False)):
        material = bpy.data.materials.new("Own")
        material.roughness = roughness
        found = directional.directional([material.name], np.zeros(3, int))
        assert (found is not None) == expected


def by_geometry_nodes(mirror):
    bpy.ops.mesh.primitive_cube_add()
    group = bpy.data.node_groups.new("Set", "GeometryNodeTree")
    for way in ("INPUT", "OUTPUT"):
        group.interface.new_socket("Geometry", in_out=way, socket_type="NodeSocketGeometry")
    start, end = group.nodes.new("NodeGroupInput"), group.nodes.new("NodeGroupOutput")
    node = group.nodes.new("GeometryNodeSetMaterial")
    node.inputs["Material"].default_value = mirror
    group.links.new(start.outputs[0], node.inputs["Geometry"])
    group.links.new(node.outputs[0], end.inputs[0])
    bpy.context.object.modifiers.new("Set", "NODES").node_group = group


def by_instance(mirror):
    bpy.ops.mesh.primitive_cube_add()
    cube = bpy.context.object
    cube.data.materials.append(mirror)
    hidden = bpy.data.collections.new("Hidden")
    bpy.context.scene.collection.objects.unlink(cube)
    hidden.objects.link(cube)
    bpy.ops.object.collection_instance_add(collection="Hidden")


def by_object(mirror):
    bpy.ops.mesh.primitive_cube_add()
    cube = bpy.context.object
    cube.data.materials.append(None)
    cube.material_slots[0].link = "OBJECT"
    cube.material_slots[0].material = mirror


def by_override(mirror):
    bpy.ops.mesh.primitive_cube_add()
    bpy.context.view_layer.material_override = mirror


@pytest.mark.parametrize("give", [by_geometry_nodes, by_instance, by_object, by_override])
def test_wherever_a_material_comes_from(give, addon):
    mirror = bpy.data.materials.new("Mirror")
    mirror.use_nodes = True
    principled(mirror.node_tree, Metallic=1.0)
    give(mirror)
    read = addon("bridge.scene.read_scene").read_scene(bpy.context.evaluated_depsgraph_get())
    found = addon("engines.directional").directional(read.material_names, read.geometry.material)
    assert found is not None and found.all() and len(found) == 12
