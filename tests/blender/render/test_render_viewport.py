# SPDX-License-Identifier: GPL-3.0-or-later
"""Rendered shading without a window: the commissions of a viewport, and the paintings of its thread."""

import threading
import time
from types import SimpleNamespace

import bpy
import numpy as np
import pytest
from engine_images import button, f12
from mathutils import Matrix, Vector

COMBINED = "ViewLayer.Combined"
WIDTH, HEIGHT = 64, 36


@pytest.fixture
def module(addon):
    return addon("bridge.render.render_viewport")


@pytest.fixture
def painter(addon):
    made = addon("bridge.render.view_painter").ViewPainter()
    yield made
    made.stop()


def viewport(scene, width=WIDTH, height=HEIGHT, perspective="CAMERA", zoom=1.0, shift=(0.0, 0.0)):
    """The context of a 3D viewport that looks through the scene's camera, and its depsgraph."""
    camera = scene.camera
    depsgraph = bpy.context.evaluated_depsgraph_get()
    window = camera.calc_matrix_camera(depsgraph, x=WIDTH, y=HEIGHT)
    window = Matrix.Translation((*shift, 0)) @ Matrix.Diagonal((zoom, zoom, 1, 1)) @ window
    view = SimpleNamespace(
        view_perspective=perspective, perspective_matrix=window @ camera.matrix_world.normalized().inverted()
    )
    region = SimpleNamespace(width=width, height=height)
    space = SimpleNamespace(use_local_camera=False, camera=camera, stereo_3d_camera="S3D")
    return SimpleNamespace(region=region, region_data=view, space_data=space), depsgraph


def paint(addon, module, painter, context, depsgraph):
    scene = addon("bridge.scene.read_scene").read_scene(depsgraph)
    painter.ask(module.read_commission(context, depsgraph, scene))
    while painter.busy:
        time.sleep(0.01)
    assert not painter.message
    return painter.image


@pytest.mark.parametrize("preset", ["perspective", "nonlinear_twist"])
def test_a_camera_view_shows_the_flexible_cameras_image(addon, module, painter, engine_scene, preset):
    bpy.context.view_layer.objects.active = engine_scene.camera
    assert bpy.ops.scfpf.preset_apply(preset=preset) == {"FINISHED"}
    painting = paint(addon, module, painter, *viewport(engine_scene))
    assert painting.is_final and np.allclose(painting.rectangle, (0, 0, WIDTH, HEIGHT), atol=1e-3)
    # The frame of a float32 camera is not quite the region.
    assert np.abs(painting.pixels - button()).max() < 1e-3


def test_a_zoomed_view_shows_a_part_of_the_image(addon, module, painter, engine_scene):
    engine_scene.render.resolution_x, engine_scene.render.resolution_y = 2 * WIDTH, 2 * HEIGHT
    whole = button()
    # Twice as large, its middle moved by half a region: the frame's left lower quarter.
    painting = paint(addon, module, painter, *viewport(engine_scene, zoom=2.0, shift=(1.0, 1.0)))
    assert np.allclose(painting.rectangle, (0, 0, WIDTH, HEIGHT), atol=1.01)
    rows, columns = (min(painting.pixels.shape[k], (HEIGHT, WIDTH)[k]) for k in (0, 1))
    assert rows >= HEIGHT - 1 and columns >= WIDTH - 1
    assert (np.abs(painting.pixels[:rows, :columns] - whole[:rows, :columns]) > 1e-3).mean() < 0.01


@pytest.mark.parametrize("lens", ["PERSP", "ORTHO"])
def test_a_free_view_gives_the_image_of_an_ordinary_camera_there(addon, module, painter, engine_scene, lens):
    bpy.ops.object.camera_add(location=(4, -4, 3), rotation=(1.05, 0.1, 0.8))
    engine_scene.camera = bpy.context.object
    engine_scene.camera.data.type, engine_scene.camera.data.clip_end = lens, 20
    engine_scene.camera.scfpf.samples = module.FREE_SAMPLES
    expected = f12(engine_scene)[COMBINED]
    painting = paint(addon, module, painter, *viewport(engine_scene, perspective="PERSP"))
    assert np.ptp(expected[..., :3]) > 0.01
    assert (np.abs(painting.pixels - expected) > 2e-3).any(axis=2).mean() < 0.01


def test_a_frame_out_of_sight_asks_for_nothing(addon, module, engine_scene):
    context, depsgraph = viewport(engine_scene, shift=(5.0, 0.0))
    scene = addon("bridge.scene.read_scene").read_scene(depsgraph)
    assert module.read_commission(context, depsgraph, scene) is None


def test_a_frame_beyond_reason_is_painted_coarsely(addon, module, engine_scene):
    context, depsgraph = viewport(engine_scene, zoom=1e4)
    scene = addon("bridge.scene.read_scene").read_scene(depsgraph)
    settings = module.read_commission(context, depsgraph, scene).inputs.settings
    assert settings.width * settings.height < 1.1 * module.MOST_PIXELS


def test_the_last_one_asked_for_is_painted_and_the_scene_is_built_once(addon, module, painter, engine_scene):
    preparation = addon("bridge.render.scene_preparation")
    scene = addon("bridge.scene.read_scene").read_scene(bpy.context.evaluated_depsgraph_get())
    for zoom in (1.0, 1.5, 2.0):
        context, depsgraph = viewport(engine_scene, zoom=zoom)
        last = module.read_commission(context, depsgraph, scene)
        painter.ask(last)
    while painter.busy:
        time.sleep(0.01)
    assert painter.image.is_final and painter.image.rectangle == last.rectangle
    cache = painter._cache
    # The same triangles read again are the same scene; a moved vertex is another.
    again = addon("bridge.scene.read_scene").read_scene(bpy.context.evaluated_depsgraph_get())
    assert preparation.SceneCache.of(again.geometry, cache) is cache
    again.geometry.vertices[0, 0] += 1e-9
    assert preparation.SceneCache.of(again.geometry, cache) is not cache


def test_the_ends_of_a_view_are_its_frustum(module, engine_scene):
    context, depsgraph = viewport(engine_scene, perspective="PERSP")
    inputs = module.free_view(depsgraph, context.region_data, None, (WIDTH, HEIGHT))
    near, far = (surface.corners for surface in inputs.projection.volume.surfaces)
    camera = engine_scene.camera
    for corners, depth in ((near, camera.data.clip_start), (far, camera.data.clip_end)):
        for corner in corners:
            local = camera.matrix_world.normalized().inverted() @ Vector(corner)
            assert -local.z == pytest.approx(depth, rel=2e-2)


@pytest.mark.parametrize(
    ("preset", "perspective", "shown", "named"),
    [
        ("nonlinear_twist", "CAMERA", True, True),
        ("nonlinear_twist", "CAMERA", False, False),
        ("nonlinear_twist", "PERSP", True, False),
        ("perspective", "CAMERA", True, False),
    ],
)
def test_grease_pencil_over_a_bent_image_is_named(module, engine_scene, preset, perspective, shown, named):
    """Blender draws it over viewports as an ordinary camera sees it: wrong where the volume is bent."""
    bpy.ops.object.grease_pencil_add(type="MONKEY")
    bpy.context.view_layer.objects.active = engine_scene.camera
    assert bpy.ops.scfpf.preset_apply(preset=preset) == {"FINISHED"}
    context, depsgraph = viewport(engine_scene, perspective=perspective)
    context.space_data.show_object_viewport_grease_pencil = shown
    stats = []
    engine = SimpleNamespace(update_stats=lambda *texts: stats.append(texts))
    module.ViewportRender().draw(context, depsgraph, engine)
    assert ("Grease Pencil" in stats[-1][1]) == named, stats


def test_a_closed_viewport_ends_its_thread(addon, module, engine_scene):
    context, depsgraph = viewport(engine_scene)
    scene = addon("bridge.scene.read_scene").read_scene(depsgraph)
    engine_scene.camera.scfpf.samples = 256
    shown = module.ViewportRender()
    painter = shown._painter
    painter.ask(module.read_commission(context, depsgraph, scene))
    assert module.is_painting()
    del shown
    assert not painter.busy
    painter.ask(module.read_commission(context, depsgraph, scene))
    assert not painter.busy


def test_an_image_without_threads_of_its_own_is_the_same(engine_scene, monkeypatch):
    """F12 in a system that starts no more threads."""
    before = f12(engine_scene)[COMBINED]

    def refused(_thread):
        raise RuntimeError("can't start new thread")

    monkeypatch.setattr(threading.Thread, "start", refused)
    assert np.array_equal(f12(engine_scene)[COMBINED], before)
