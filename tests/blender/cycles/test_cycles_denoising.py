# SPDX-License-Identifier: GPL-3.0-or-later
"""The denoiser's albedo and normals through the rig, compared with those of Cycles' ordinary camera."""

import bpy
import numpy as np
import pytest
from rig_scenes import (
    exact_passes,
    fill_volume,
    reference,
    render_passes,
    show_whole_sheets,
    start_anew,
    switch,
    volume_scene,
)

# Values at outlines are means over other places in a pixel: this share of the pixels may differ by more.
OFF, EDGES = 0.02, 0.04


def paint():
    """Give each object a colour."""
    generator = np.random.default_rng(2)
    for obj in bpy.context.scene.objects:
        if obj.pass_index:
            material = bpy.data.materials.new("Colour")
            if material.node_tree is None:
                material.use_nodes = True
            shader = next(n for n in material.node_tree.nodes if n.type == "BSDF_PRINCIPLED")
            shader.inputs["Base Color"].default_value = (*generator.uniform(0.1, 0.9, 3), 1.0)
            obj.data.materials.append(material)


@pytest.fixture
def both(addon, tmp_path):
    """The passes through the rig of a camera's own view, and without it."""
    start_anew()
    camera = reference.add_camera(72, 48)
    bpy.context.view_layer.objects.active = camera
    assert bpy.ops.scfpf.camera_from_camera() == {"FINISHED"}
    bpy.context.view_layer.update()
    fill_volume(addon, camera)
    paint()
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


@pytest.mark.parametrize("name", ["around_the_car", "nonlinear_twist"])
def test_the_denoiser_is_told_the_same_through_empty_chords(addon, tmp_path, monkeypatch, name):
    """Along bent projectors, compared with rays that travel all chords, and with the caster's normals."""
    start_anew()
    camera = volume_scene(addon, name, 144, 96)
    scene, layer = bpy.context.scene, bpy.context.view_layer
    paint()
    ours = exact_passes(addon, camera)
    layer.cycles.denoising_store_passes = True
    assert switch(camera) == {"FINISHED"}
    rig = addon("cycles.rig_data").rig_of(scene)
    some = render_passes(tmp_path / "some", 4)
    assert rig.scfpf_rig.passed
    monkeypatch.setattr(addon("cycles.rig"), "renew", lambda *_: None)
    show_whole_sheets(addon, rig)
    every = render_passes(tmp_path / "every", 4)
    assert not rig.scfpf_rig.passed
    for kind in ("Albedo", "Normal"):
        one, other = (passes[f"Denoising {kind}"][..., :3] for passes in (some, every))
        off = np.abs(one - other).max(axis=2) > OFF
        print(name, kind, off.mean(), other.std())
        assert other.std() > 0.05 and off.mean() < 1e-3
    index = ours["OBJECT_INDEX"][..., 0]
    inside = ~reference.near_edges(index) & (index > 0)
    # Up to 4.5 Cycles' cameras look along +z.
    flips = [np.abs(some["Denoising Normal"][..., :3] * (1, 1, sign) - ours["NORMAL"]) for sign in (1, -1)]
    off = min((flip.max(axis=2)[inside] for flip in flips), key=np.mean)
    print(name, "normals", np.quantile(off, [0.5, 0.9, 0.99]), inside.mean())
    assert inside.sum() > 200 and (off > OFF).mean() < EDGES
