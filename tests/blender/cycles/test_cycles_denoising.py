# SPDX-License-Identifier: GPL-3.0-or-later
"""The denoiser's albedo and normals through the rig, compared with those of Cycles' ordinary camera."""

import bpy
import numpy as np
import pytest
from rig_scenes import fill_volume, reference, render_passes, start_anew, switch

# Values at outlines are means over other places in a pixel: this share of the pixels may differ by more.
OFF, EDGES = 0.02, 0.04


@pytest.fixture
def both(addon, tmp_path):
    """The passes through the rig of a camera's own view, and without it."""
    start_anew()
    camera = reference.add_camera(72, 48)
    bpy.context.view_layer.objects.active = camera
    assert bpy.ops.scfpf.camera_from_camera() == {"FINISHED"}
    bpy.context.view_layer.update()
    fill_volume(addon, camera)
    generator = np.random.default_rng(2)
    for obj in bpy.context.scene.objects:
        if obj.pass_index:
            material = bpy.data.materials.new("Colour")
            if material.node_tree is None:
                material.use_nodes = True
            shader = next(n for n in material.node_tree.nodes if n.type == "BSDF_PRINCIPLED")
            shader.inputs["Base Color"].default_value = (*generator.uniform(0.1, 0.9, 3), 1.0)
            obj.data.materials.append(material)
    bpy.context.view_layer.cycles.denoising_store_passes = True
    assert switch(camera) == {"FINISHED"}
    rigged = render_passes(tmp_path / "rig", 4)
    assert switch(camera) == {"FINISHED"}
    return rigged, render_passes(tmp_path / "plain", 4)


@pytest.mark.parametrize("name", ["Denoising Albedo", "Denoising Normal"])
def test_the_denoiser_is_told_the_same(both, name):
    rigged, plain = (passes[name][..., :3] for passes in both)
    off = np.abs(rigged - plain).max(axis=2) > OFF
    print(name, off.mean(), np.abs(plain).mean())
    assert plain.std() > 0.05
    assert off.mean() < EDGES
