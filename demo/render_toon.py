# SPDX-License-Identifier: GPL-3.0-or-later
"""The street as a cartoon: EEVEE's ramps of light and inked hulls, through a Panini panorama.

    python demo/render_toon.py [WIDTH]

It writes docs/pictures/toon-street.jpg, in some minutes by software OpenGL, under a Python that has bpy.
"""

from __future__ import annotations

import importlib
import sys
from pathlib import Path

ROOT = Path(__file__).resolve().parents[1]
sys.path.insert(0, str(ROOT))

from demo import render_demo  # noqa: E402
from demo.render_gallery import save_jpeg  # noqa: E402
from demo.render_thumbnails import OWN  # noqa: E402

PRESET, WIDTH, SAMPLES = "panini", 800, 9
# Light from which on a tone begins, and the tone, by which a material's colour is multiplied.
TONES = ((0.0, (0.3, 0.3, 0.45)), (0.05, (0.6, 0.58, 0.68)), (0.18, (1.0, 1.0, 0.95)))
INK, THICKNESS, THINNEST = (0.01, 0.01, 0.03, 1.0), 0.035, 0.02


def draw_tones(material) -> None:
    """Let a material have its colour in TONES, by Shader to RGB."""
    tree = material.node_tree
    plain = next((node for node in tree.nodes if node.type == "BSDF_PRINCIPLED"), None)
    if plain is None:
        return
    kinds = ("BsdfDiffuse", "ShaderToRGB", "ValToRGB", "Mix", "Emission")
    light, seen, ramp, mix, glow = (tree.nodes.new(f"ShaderNode{kind}") for kind in kinds)
    ramp.color_ramp.interpolation = "CONSTANT"
    elements = ramp.color_ramp.elements
    elements.new(TONES[1][0])
    for element, (position, tone) in zip(elements, TONES, strict=True):
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


def ink():
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


def outline(obj, material) -> None:
    """Give an object an inverted hull."""
    obj.data.materials.append(material)
    hull = obj.modifiers.new("Ink", "SOLIDIFY")
    hull.thickness, hull.offset, hull.use_flip_normals, hull.use_rim = THICKNESS, 1.0, True, False
    hull.material_offset = len(obj.data.materials)


def main(width: int) -> None:
    """Build the street, and render it by EEVEE."""
    with render_demo.scratch_profile() as scratch:
        import bpy

        render_demo.enable_add_on(scratch)
        street = render_demo.build_street()
        for material in bpy.data.materials:
            if material.node_tree is not None:
                draw_tones(material)
        hull = ink()
        for obj in street.objects:
            if obj.type == "MESH" and min(obj.dimensions) >= THINNEST:
                outline(obj, hull)
        shot = OWN[PRESET]
        scene = render_demo.another_scene(street)
        for obj in street.collection.objects:
            scene.collection.objects.link(obj)
        path = ROOT / "presets" / f"{PRESET}.json"
        camera = render_demo.add_shot(scene, path.read_text(encoding="utf-8"), shot)
        camera.scfpf.samples = SAMPLES
        render = scene.render
        render.resolution_x, render.resolution_y = width, round(width * shot.size[1] / shot.size[0])
        versions = importlib.import_module(f"{render_demo.MODULE}.scfpf_addon.bridge.blender.versions")
        render.engine, scene.eevee.taa_render_samples = versions.EEVEE, 1
        scene.view_settings.view_transform = "Standard"
        bpy.context.window.scene = scene
        bpy.context.view_layer.update()
        with bpy.context.temp_override(scene=scene, view_layer=scene.view_layers[0]):
            if bpy.ops.scfpf.joined_render(camera=camera.name) != {"FINISHED"}:
                sys.exit("The street was not rendered; the lines above say why.")
        raw = Path(scratch) / "toon.png"
        bpy.data.images["SCFPF Render"].save_render(str(raw), scene=scene)
        save_jpeg(raw, ROOT / "docs" / "pictures" / "toon-street.jpg")


if __name__ == "__main__":
    main(int(sys.argv[1]) if len(sys.argv) > 1 else WIDTH)
