# SPDX-License-Identifier: GPL-3.0-or-later
"""Scenes as cartoons for EEVEE: a material's colour in steps of light, and outlines of inverted hulls."""

from __future__ import annotations

from collections.abc import Mapping

# Light from which on a tone begins, and the tone, by which a material's colour is multiplied.
TONES = ((0.0, (0.3, 0.3, 0.45)), (0.05, (0.6, 0.58, 0.68)), (0.18, (1.0, 1.0, 0.95)))
# The same in black and white, with one grey.
MANGA = ((0.0, (0.03,) * 3), (0.05, (0.36,) * 3), (0.4, (1.0,) * 3))
INK, THICKNESS, THINNEST = (0.002, 0.002, 0.002, 1.0), 0.035, 0.02


def draw_tones(tones=TONES) -> None:
    """Give all materials steps of light. tones: three of them, see TONES."""
    import bpy

    for material in bpy.data.materials:
        if material.node_tree is not None:
            _draw_tones(material, tones)


def draw_outlines(thicknesses: Mapping[str, float] | None = None) -> None:
    """Give all meshes that are not too thin an outline.

    thicknesses: in metres by the name of a collection, whose meshes get it; None for THICKNESS of all meshes.
    """
    import bpy

    hull, scene = _ink(), bpy.context.scene
    if thicknesses is None:
        groups = [(scene.objects, THICKNESS, THINNEST)]
    else:
        own = {name: bpy.data.collections[name].all_objects for name in thicknesses}
        groups = [(own[name], thickness, 2.0 * thickness) for name, thickness in thicknesses.items()]
    for objects, thickness, thinnest in groups:
        for obj in objects:
            if obj.type == "MESH" and min(obj.dimensions) >= thinnest:
                _outline(obj, hull, thickness)


def _draw_tones(material, tones) -> None:
    """Let a material have its colour in three tones, by Shader to RGB."""
    tree = material.node_tree
    plain = next((node for node in tree.nodes if node.type == "BSDF_PRINCIPLED"), None)
    if plain is None:
        return
    kinds = ("BsdfDiffuse", "ShaderToRGB", "ValToRGB", "Mix", "Emission")
    light, seen, ramp, mix, glow = (tree.nodes.new(f"ShaderNode{kind}") for kind in kinds)
    ramp.color_ramp.interpolation = "CONSTANT"
    elements = ramp.color_ramp.elements
    elements.new(tones[1][0])
    for element, (position, tone) in zip(elements, tones, strict=True):
        element.position, element.color = position, (*tone, 1.0)
    mix.data_type, mix.blend_type, mix.inputs[0].default_value = "RGBA", "MULTIPLY", 1.0
    first, second = [socket for socket in mix.inputs if socket.type == "RGBA"][:2]
    product = next(socket for socket in mix.outputs if socket.type == "RGBA")
    color = plain.inputs["Base Color"]
    second.default_value = color.default_value
    output = next(node for node in tree.nodes if node.type == "OUTPUT_MATERIAL")
    pairs = [(light.outputs[0], seen.inputs[0]), (seen.outputs[0], ramp.inputs[0])]
    pairs += [(ramp.outputs[0], first), (product, glow.inputs[0]), (glow.outputs[0], output.inputs[0])]
    for begin, end in pairs + [(link.from_socket, second) for link in color.links]:
        tree.links.new(begin, end)


def _ink():
    """A black material seen from the front only: of an inverted hull that is the far side, the outline."""
    import bpy

    material = bpy.data.materials.new("Ink")
    material.use_nodes = True
    tree = material.node_tree
    tree.nodes.clear()
    glow, output = (tree.nodes.new(f"ShaderNode{kind}") for kind in ("Emission", "OutputMaterial"))
    glow.inputs[0].default_value = INK
    tree.links.new(glow.outputs[0], output.inputs["Surface"])
    material.use_backface_culling = material.use_backface_culling_shadow = True
    return material


def _outline(obj, material, thickness: float) -> None:
    """Give an object an inverted hull."""
    # Trees share their meshes.
    if material.name not in obj.data.materials:
        obj.data.materials.append(material)
    hull = obj.modifiers.new("Ink", "SOLIDIFY")
    hull.thickness, hull.offset, hull.use_flip_normals, hull.use_rim = thickness, 1.0, True, False
    hull.material_offset = len(obj.data.materials)
