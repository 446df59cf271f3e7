# SPDX-License-Identifier: GPL-3.0-or-later
"""F12 beside Cycles through the same camera: depth, Freestyle and Grease Pencil, which Blender draws."""

import pathlib

import bpy
import numpy as np
import pytest
from engine_images import f12

FARTHEST = 1e10
COMBINED = "ViewLayer.Combined"


@pytest.fixture
def by_cycles(engine_scene):
    """Render the scene's camera by Cycles, without bounces, one sharp sample a pixel."""
    scene = engine_scene
    scene.cycles.max_bounces, scene.cycles.samples = 0, 1
    scene.cycles.use_denoising = scene.cycles.use_adaptive_sampling = False
    scene.cycles.pixel_filter_type, scene.cycles.filter_width = "BLACKMAN_HARRIS", 0.01

    def render():
        scene.render.engine = "CYCLES"
        try:
            return f12(scene)
        finally:
            scene.render.engine = "SCFPF"

    return render


def warnings(addon, monkeypatch):
    """The warnings of the following renders by the engine, a list that grows."""
    said = []
    module = addon("bridge.render.render_engine")
    engine, translated = module.SCFPF_RenderEngine, module.translated_report
    monkeypatch.setattr(
        module, "translated_report", lambda text: said.append(translated(text)) or translated(text)
    )
    assert engine.is_registered
    return said


def depth_of(images):
    return next(values for name, values in images.items() if name.endswith(".Depth"))[..., 0]


LENSES = {
    "perspective": {"type": "PERSP", "lens": 28.0, "clip_end": 50.0},
    "shifted": {"type": "PERSP", "lens": 40.0, "shift_x": 0.2, "shift_y": -0.1, "clip_start": 1.0},
    "orthographic": {"type": "ORTHO", "ortho_scale": 9.0, "shift_x": 0.1},
}


@pytest.mark.parametrize("name", LENSES)
def test_depth_of_a_cameras_own_view_is_cycles(engine_scene, by_cycles, name):
    """Also if the near surface is not where the camera's clipping begins."""
    camera, layer = engine_scene.camera, engine_scene.view_layers[0]
    layer.use_pass_z = True
    bpy.ops.mesh.primitive_plane_add(size=40, location=(0, 4, 0), rotation=(1.2, 0.3, 0.2))
    camera.location, camera.rotation_euler, camera.scale = (1, -7, 2), (1.3, 0.1, 0.1), (2, 2, 2)
    for setting, value in LENSES[name].items():
        setattr(camera.data, setting, value)
    bpy.context.view_layer.objects.active = camera
    assert bpy.ops.scfpf.camera_from_camera() == {"FINISHED"}
    expected = depth_of(by_cycles())
    camera.data.clip_start /= 2
    depth = depth_of(f12(engine_scene))
    both = (depth < FARTHEST) & (expected < FARTHEST)
    assert both.mean() > 0.9
    # Cycles' sample may be 0.005 pixels off the centre, where a slope of the plane moves it.
    assert np.quantile(np.abs(depth / expected - 1)[both], 0.98) < 1e-3
    assert np.median(np.abs(depth / expected - 1)[both]) < 1e-4


def test_a_wall_before_the_camera_has_one_depth(engine_scene):
    engine_scene.view_layers[0].use_pass_z = True
    bpy.ops.mesh.primitive_plane_add(size=100)
    camera = engine_scene.camera
    camera.location, camera.rotation_euler = (0, 0, 5), (0, 0, 0)
    bpy.data.objects["Cube"].hide_render = True
    bpy.context.view_layer.objects.active = camera
    assert bpy.ops.scfpf.camera_from_camera() == {"FINISHED"}
    file = pathlib.Path(f"{engine_scene.render.filepath}.exr")
    np.testing.assert_allclose(depth_of(f12(engine_scene)), 5.0, rtol=1e-5)
    assert b"Distance from the camera along its axis" in file.read_bytes()
    # No longer the camera's own view: the length of projectors, which differs.
    camera.data.lens *= 1.1
    assert np.ptp(depth_of(f12(engine_scene))) > 0.1
    assert b"Length of the projector from the near surface" in file.read_bytes()


@pytest.mark.parametrize("drawing", ["Freestyle", "Grease Pencil"])
def test_blenders_drawing_is_shown_where_it_fits_the_view(
    addon, engine_scene, by_cycles, monkeypatch, drawing
):
    """As by Cycles in a camera's own view, without a warning. In a bent picture not at all, with one."""
    said, camera = warnings(addon, monkeypatch), engine_scene.camera
    engine_scene.view_layers[0].use_pass_z = True
    if drawing == "Freestyle":
        engine_scene.render.use_freestyle = engine_scene.view_layers[0].use_freestyle = True
        lines = engine_scene.view_layers[0].freestyle_settings.linesets
        (lines[0] if len(lines) else lines.new("Lines")).linestyle = style = bpy.data.linestyles.new("Style")
        style.thickness, style.color = 3.0, (1.0, 0.0, 0.0)
    else:
        bpy.ops.object.grease_pencil_add(type="MONKEY", location=(1, -1.5, 0.5))
        bpy.context.object.scale = (2, 2, 2)
        strokes = bpy.context.object
    bpy.context.view_layer.objects.active = camera
    assert bpy.ops.scfpf.camera_from_camera() == {"FINISHED"}

    def switch(on):
        if drawing == "Freestyle":
            engine_scene.render.use_freestyle = on
        else:
            strokes.hide_render = not on

    def drawn(render):
        """The pixels of an image that the drawing covers, (H, W) bool."""
        images = []
        for on in (False, True):
            switch(on)
            images.append(render())
        before, after = images
        assert (depth_of(before) == depth_of(after)).all() or render is not bent
        return np.abs(after[COMBINED] - before[COMBINED])[..., :3].max(axis=2) > 0.05

    def bent():
        return f12(engine_scene)

    expected = drawn(by_cycles)
    assert expected.sum() > 40
    found = drawn(lambda: f12(engine_scene))
    assert (expected & ~found).sum() < 0.01 * expected.sum()
    # Edges are as wide as the filter of pixels.
    near = [np.roll(expected, (j, i), (0, 1)) for j in (-1, 0, 1) for i in (-1, 0, 1)]
    assert not (found & ~np.any(near, axis=0)).any()
    assert not any("Freestyle" in text or "faces" in text or "stroke" in text for text in said)
    assert bpy.ops.scfpf.preset_apply(preset="nonlinear_twist", fit=False) == {"FINISHED"}
    assert not drawn(bent).any()
    name = "Freestyle" if drawing == "Freestyle" else strokes.name
    assert any(name in text for text in said)
