# SPDX-License-Identifier: GPL-3.0-or-later
"""Pixel filters, depth of field and motion blur of the engine, against Cycles' own images."""

import math

import bpy
import numpy as np
import pytest
from engine_images import button, f12

# Both engines' noise at these samples, and their chords' and places' differences.
NOISE = 0.012
SAMPLES = 64


def shining(name, color):
    """A material that emits its colour."""
    material = bpy.data.materials.new(name)
    if bpy.app.version < (5, 0, 0):
        material.use_nodes = True
    nodes = material.node_tree.nodes
    nodes.clear()
    emission, output = nodes.new("ShaderNodeEmission"), nodes.new("ShaderNodeOutputMaterial")
    emission.inputs["Color"].default_value = (*color, 1)
    material.node_tree.links.new(emission.outputs[0], output.inputs[0])
    return material


@pytest.fixture
def view(engine_scene):
    """Four glowing cubes in a row, and an ordinary camera; the same for both engines."""
    bpy.data.objects.remove(bpy.data.objects["Cube"])
    for number, (x, y, color) in enumerate(
        (
            (-1, 0, (1, 0.3, 0.2)),
            (0.6, 2.5, (0.2, 1, 0.3)),
            (1.6, 6, (0.9, 0.9, 0.2)),
            (0.5, -1.6, (0.3, 0.4, 1)),
        )
    ):
        bpy.ops.mesh.primitive_cube_add(size=0.9, location=(x, y, -0.3 * number))
        bpy.context.object.data.materials.append(shining(str(number), color))
        bpy.context.object.name = f"Cube {number}"
    bpy.ops.object.camera_add(location=(0, -5, 0.3), rotation=(math.pi / 2, 0, 0))
    camera = engine_scene.camera = bpy.context.object
    camera.data.clip_end = 50
    camera.scfpf.samples = SAMPLES
    engine_scene.scfpf_sampling.pattern = "SCRAMBLED"
    engine_scene.scfpf_sampling.motion_steps = 16
    cycles = engine_scene.cycles
    cycles.samples, cycles.use_denoising, cycles.use_adaptive_sampling = SAMPLES, False, False
    cycles.max_bounces = 0
    return engine_scene


def rms(a, b):
    return float(np.sqrt(np.mean((a.astype(np.float64) - b) ** 2)))


def both(scene):
    """The images of SCFPF and of Cycles."""
    made = []
    for engine in ("SCFPF", "CYCLES"):
        scene.render.engine = engine
        made.append(f12(scene)["ViewLayer.Combined"][..., :3])
    return made


@pytest.mark.parametrize(("kind", "width"), [("GAUSSIAN", 2.0), ("BLACKMAN_HARRIS", 1.5)])
def test_filters_are_those_of_cycles(view, kind, width):
    view.scfpf_sampling.pixel_filter = view.cycles.pixel_filter_type = kind
    view.render.filter_size = view.cycles.filter_width = width
    ours, theirs = both(view)
    # The outermost pixels' filters reach over the edge, where we stay inside.
    inner = slice(3, -3)
    error = rms(ours[inner, inner], theirs[inner, inner])
    assert error < NOISE / 3
    # Another filter is told from it.
    view.scfpf_sampling.pixel_filter = "BLACKMAN_HARRIS" if kind == "BOX" else "BOX"
    view.render.engine = "SCFPF"
    other = f12(view)["ViewLayer.Combined"][..., :3]
    assert rms(other[inner, inner], theirs[inner, inner]) > 1.5 * error


def test_depth_of_field_is_that_of_cycles(view):
    sharp = f12(view)["ViewLayer.Combined"][..., :3]
    dof = view.camera.data.dof
    dof.use_dof, dof.focus_object, dof.aperture_fstop = True, bpy.data.objects["Cube 1"], 0.05
    dof.aperture_blades, dof.aperture_ratio, dof.aperture_rotation = 5, 2.0, 0.4
    ours, theirs = both(view)
    assert rms(ours, theirs) < NOISE < rms(sharp, theirs) / 4


def test_a_flexible_perspective_has_the_same_depth_of_field(view):
    camera = view.camera
    camera.data.dof.use_dof, camera.data.dof.focus_distance = True, 5.0
    camera.data.dof.aperture_fstop = 0.1
    expected = f12(view)["ViewLayer.Combined"]
    bpy.context.view_layer.objects.active = camera
    camera.select_set(True)
    assert bpy.ops.scfpf.camera_from_camera() == {"FINISHED"}
    assert camera.scfpf.enabled
    assert rms(f12(view)["ViewLayer.Combined"], expected) < 1e-4


def test_bent_projectors_have_none_and_say_so(addon, view):
    bpy.ops.scfpf.camera_add(preset="nonlinear_twist")
    camera = view.camera = bpy.context.object
    sharp = f12(view)["ViewLayer.Combined"]
    camera.data.dof.use_dof = True
    assert np.array_equal(f12(view)["ViewLayer.Combined"], sharp)
    inputs = addon("bridge.render.render_inputs").prepare(view, view.view_layers[0], camera)
    assert inputs.settings.depth_of_field is None
    assert any("Depth of field is not defined" in warning for warning in inputs.scene.warnings)


def key(thing, values):
    for frame, x in values:
        thing.location.x = x
        thing.keyframe_insert("location", frame=frame)


def moving(view, objects, camera):
    if objects:
        key(bpy.data.objects["Cube 0"], ((0, -2), (2, 0)))
        key(bpy.data.objects["Cube 1"], ((0, 0.9), (2, 0.3)))
    if camera:
        key(view.camera, ((0, -0.5), (2, 0.5)))
    view.frame_set(1)


@pytest.mark.parametrize(("objects", "camera", "position"), [(True, False, "START"), (False, True, "END")])
def test_motion_blur_is_that_of_cycles(view, objects, camera, position):
    moving(view, objects, camera)
    sharp = f12(view)["ViewLayer.Combined"][..., :3]
    view.render.use_motion_blur, view.render.motion_blur_shutter = True, 0.8
    view.render.motion_blur_position = position
    ours, theirs = both(view)
    assert rms(ours, theirs) < 1.5 * NOISE
    assert rms(sharp, theirs) > 3 * NOISE
    assert view.frame_current == 1 and view.frame_subframe == 0


def test_render_button_blurs_as_f12_does(view):
    bpy.ops.scfpf.camera_add(preset="nonlinear_twist")
    view.camera = bpy.context.object
    view.camera.scfpf.samples = 4
    surface = view.camera.scfpf.surfaces[1].object
    moving(view, True, False)
    for frame, angle in ((0, -1.0), (2, 1.0)):
        surface.rotation_euler.z = angle
        surface.keyframe_insert("rotation_euler", frame=frame)
    view.frame_set(1)
    sharp = f12(view)["ViewLayer.Combined"]
    view.render.use_motion_blur = True
    blurred = f12(view)["ViewLayer.Combined"]
    assert rms(blurred, sharp) > NOISE
    assert np.array_equal(button(), blurred)
    assert view.frame_current == 1 and view.frame_subframe == 0
    # Control surfaces alone: each sample has its own moment.
    for name in ("Cube 0", "Cube 1"):
        bpy.data.objects[name].animation_data_clear()
    assert np.array_equal(button(), f12(view)["ViewLayer.Combined"])


def test_settings_survive_a_file(view, tmp_path):
    sampling = view.scfpf_sampling
    sampling.use_adaptive, sampling.adaptive_threshold, sampling.adaptive_least = True, 0.05, 3
    path = str(tmp_path / "kept.blend")
    bpy.ops.wm.save_as_mainfile(filepath=path)
    expected = f12(view)["ViewLayer.Combined"]
    bpy.ops.wm.open_mainfile(filepath=path)
    kept = bpy.context.scene
    assert kept.scfpf_sampling.pattern == "SCRAMBLED" and kept.scfpf_sampling.adaptive_least == 3
    assert np.array_equal(f12(kept)["ViewLayer.Combined"], expected)


def test_adaptive_sampling_takes_fewer(addon, view):
    frame = addon("shading.frame")

    def projectors():
        inputs = addon("bridge.render.render_inputs").prepare(view, view.view_layers[0], view.camera)
        return frame.render_frame(inputs.projection, inputs.scene, inputs.settings).report.projectors

    everywhere = projectors()
    view.scfpf_sampling.use_adaptive = True
    assert projectors() < 0.5 * everywhere
