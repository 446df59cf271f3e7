# SPDX-License-Identifier: GPL-3.0-or-later
"""Reflections off rough surfaces: as bright and as blurred as Cycles', and the same whatever is rendered."""

import bpy
import numpy as np
import pytest
from shown_materials import add, both, new_material, scene_with_camera, show

SIZE = 32


def shader(kind, settings=(), **inputs):
    material = new_material(kind)
    node = add(material.node_tree, f"ShaderNode{kind}", settings, **inputs)
    show(material.node_tree, node.outputs[0])
    return material


def plane(material, location=(0, 0, 0), size=4.0, turn=(0, 0, 0)):
    bpy.ops.mesh.primitive_plane_add(size=size, location=location, rotation=turn)
    bpy.context.object.data.materials.append(material)


def glossy_scene(material):
    """A floor of the material before a glowing wall, seen askew."""
    scene = scene_with_camera(SIZE)
    plane(material)
    glow = shader("Emission", Color=(1.0, 0.6, 0.3), Strength=3.0)
    plane(glow, (0.2, 0.8, 0.5), 0.8, (np.pi / 2, 0, 0))
    scene.camera.scfpf.samples = 64
    scene.camera.location, scene.camera.rotation_euler = (0.3, -2.5, 1.2), (1.2, 0, 0)
    cycles = scene.cycles
    cycles.samples, cycles.use_denoising, cycles.use_adaptive_sampling = 256, False, False
    cycles.max_bounces = 4
    cycles.sample_clamp_indirect = 0.0
    cycles.pixel_filter_type, cycles.filter_width = "BOX", 1.0
    return scene


MATERIALS = {
    "metal 0.2": ("BsdfPrincipled", {}, {"Base_Color": (0.9, 0.7, 0.5), "Metallic": 1.0, "Roughness": 0.2}),
    "metal 0.4": ("BsdfPrincipled", {}, {"Base_Color": (0.9, 0.7, 0.5), "Metallic": 1.0, "Roughness": 0.4}),
    "metal 0.65": ("BsdfPrincipled", {}, {"Base_Color": (0.9, 0.7, 0.5), "Metallic": 1.0, "Roughness": 0.65}),
    "single": ("BsdfGlossy", {"distribution": "GGX"}, {"Color": (0.8, 0.8, 0.8), "Roughness": 0.5}),
    "multiple": ("BsdfGlossy", {"distribution": "MULTI_GGX"}, {"Color": (0.8, 0.8, 0.8), "Roughness": 0.5}),
    "coat": ("BsdfPrincipled", {}, {"Base_Color": (0.0, 0.0, 0.0), "Roughness": 0.25}),
}


@pytest.mark.parametrize("name", MATERIALS)
def test_a_glow_is_reflected_as_by_cycles(name, tmp_path):
    kind, settings, inputs = MATERIALS[name]
    scene = glossy_scene(shader(kind, settings, **inputs))
    ours, cycles = both(scene, tmp_path)
    floor = cycles[:, :, 0] < 2.9
    ratio = ours[floor][:, :3].mean(0) / cycles[floor][:, :3].mean(0)
    near = np.abs(ours - cycles)[floor].mean() / cycles[floor].mean()
    print(name, ratio, near)
    np.save(f"/tmp/lab/skytest/gloss {name}.npy", np.stack([ours, cycles]))
