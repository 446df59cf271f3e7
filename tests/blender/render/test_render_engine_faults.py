# SPDX-License-Identifier: GPL-3.0-or-later
"""Errors while the engine renders are messages: no crash, no file, the button's image intact."""

import os
from dataclasses import replace

import bpy
import numpy as np
import pytest
from engine_images import button, f12

COMBINED = "ViewLayer.Combined"


def image():
    pixels = bpy.data.images["SCFPF Render"].pixels
    values = np.empty(len(pixels), np.float32)
    pixels.foreach_get(values)
    return values


def no_surfaces(scene):
    scene.camera.scfpf.surfaces.clear()


def deleted_surface(scene):
    bpy.data.objects.remove(scene.camera.scfpf.surfaces[0].object)


def zero_size_surface(scene):
    scene.camera.scfpf.surfaces[1].object.scale = (0, 0, 0)


def not_a_number(scene):
    scene.camera.rotation_euler.x = float("nan")


def vertex_not_a_number(scene):
    """A driver that divides by 0, a damaged file."""
    surface = scene.camera.scfpf.surfaces[0].object
    surface.modifiers.clear()
    surface.scfpf_surface.kind = "GRID"
    mesh = bpy.data.meshes.new("Grid")
    corners = [(-1, -1, 0), (1, -1, 0), (1, 1, 0), (-1, float("nan"), 0)]
    mesh.from_pydata(corners, [], [(0, 1, 2, 3)])
    uv = mesh.uv_layers.new(name="UVMap").uv
    for corner, place in zip(uv, ((0, 0), (1, 0), (1, 1), (0, 1)), strict=True):
        corner.vector = place
    surface.data = mesh


def near_is_far(scene):
    surfaces = scene.camera.scfpf.surfaces
    for slot in surfaces[1:]:
        slot.object = surfaces[0].object


def no_camera(scene):
    scene.camera = None


def panoramic_camera(scene):
    scene.camera.scfpf.enabled = False
    scene.camera.data.type = "PANO"


def ordinary_without_size(scene):
    scene.camera.scfpf.enabled = False
    scene.camera.scale = (0, 0, 0)


FAULTS = {
    no_surfaces: "needs at least two",
    deleted_surface: "empty",
    zero_size_surface: "no size",
    not_a_number: "not finite",
    vertex_not_a_number: "vertices that are not finite",
    near_is_far: "lie in one place",
    no_camera: "camera",
    panoramic_camera: "neither a perspective nor an orthographic",
    ordinary_without_size: "scale of 0",
}


def refused(scene, message):
    """Press F12, assert one error with the message, and that nothing was written."""
    path = f"{scene.render.filepath}.exr"
    if os.path.exists(path):
        os.remove(path)
    with pytest.raises(RuntimeError, match=message) as caught:
        bpy.ops.render.render(write_still=True)
    assert not os.path.exists(path), "a picture of a failure was written"
    return str(caught.value).strip()


@pytest.mark.parametrize("spoil", FAULTS, ids=lambda spoil: spoil.__name__)
def test_bad_input_is_a_message_and_nothing_is_lost(engine_scene, spoil, capfd):
    button()
    before = image()
    spoil(engine_scene)
    assert refused(engine_scene, FAULTS[spoil]).count("\n") == 0
    assert "Traceback" not in "".join(capfd.readouterr())
    assert np.array_equal(image(), before)


def test_the_next_render_after_a_failure_is_whole(engine_scene):
    expected = f12(engine_scene)[COMBINED]
    surface = engine_scene.camera.scfpf.surfaces[1].object
    scale = surface.scale.copy()  # not all of it is 1, by a rounding
    surface.scale = (0, 0, 0)
    refused(engine_scene, "no size")
    surface.scale = scale
    assert np.array_equal(f12(engine_scene)[COMBINED], expected)


def test_empty_scene_is_its_background_and_a_warning(engine_scene, capfd):
    bpy.data.objects.remove(bpy.data.objects["Cube"])
    engine_scene.view_layers[0].use_pass_z = engine_scene.view_layers[0].use_pass_position = True
    made = f12(engine_scene)
    assert np.ptp(made[COMBINED][..., :3]) == 0 and (made[COMBINED][..., 3] == 1).all()
    assert (made["ViewLayer.Depth"] == 1e10).all() and (made["ViewLayer.Position"] == 0).all()
    assert "nothing to render" in "".join(capfd.readouterr())


def test_missing_embreex_says_so(addon, engine_scene, monkeypatch):
    def missing():
        raise addon("casting.common.hits").CastError("embreex is missing")

    monkeypatch.setattr(addon("casting.scene.cast_scene"), "load_embreex", missing)
    refused(engine_scene, "embreex is missing")


@pytest.mark.parametrize("error", [MemoryError(), ZeroDivisionError("in the core"), KeyError("x")])
@pytest.mark.parametrize("where", [("render_engine", "read_inputs"), ("scene_preparation", "render_frame")])
def test_exception_in_the_core_is_a_message(addon, engine_scene, monkeypatch, error, where):
    expected = f12(engine_scene)[COMBINED]

    def fail(*_arguments, **_options):
        raise error

    with monkeypatch.context() as patch:
        patch.setattr(addon(f"bridge.render.{where[0]}"), where[1], fail)
        refused(engine_scene, "not enough memory" if isinstance(error, MemoryError) else type(error).__name__)
    assert np.array_equal(f12(engine_scene)[COMBINED], expected)


STAGES = {
    "reading": ("bridge.scene.read_scene", "read_mesh"),
    "projection": ("bridge.render.render_inputs", "read_projection"),
    "building": ("bridge.render.scene_preparation", "cull_scene"),
    "casting": ("shading.tracing.scene_view", "cast"),
    "passes": ("shading.tile_rendering", "fill_passes"),
    "announcing": ("bridge.render.render_delivery", "list_render_passes"),
    "beginning": ("bridge.render.render_delivery", "stamp_manifests"),
    "reporting": ("shading.frame", "report_of"),
}


@pytest.mark.parametrize("stage", STAGES)
def test_exception_at_any_stage_is_a_message(addon, engine_scene, monkeypatch, stage):
    engine_scene.view_layers[0].use_pass_position = True
    expected = button()
    module, name = STAGES[stage]

    def fail(*_given, **_options):
        raise FloatingPointError("in the core")

    with monkeypatch.context() as patch:
        patch.setattr(addon(module), name, fail)
        refused(engine_scene, "FloatingPointError: in the core")
    assert np.array_equal(image(), expected.ravel())
    assert np.array_equal(f12(engine_scene)[COMBINED], expected)


def test_blender_refusing_pixels_is_a_message(addon, engine_scene, monkeypatch):
    """The remaining tiles are delivered at the end of a render, whatever happened before."""
    expected = f12(engine_scene)[COMBINED]
    delivery = addon("bridge.render.render_delivery")

    def fail(_array):
        raise MemoryError

    with monkeypatch.context() as patch:
        patch.setattr(delivery.np, "ravel", fail)
        refused(engine_scene, "not enough memory")
    assert np.array_equal(f12(engine_scene)[COMBINED], expected)


def test_failure_in_the_middle_of_an_animation_ends_it(engine_scene, tmp_path):
    surface = engine_scene.camera.scfpf.surfaces[1].object
    for frame, size in ((1, 1.0), (2, 0.0), (3, 1.0)):
        surface.scale = (size,) * 3
        surface.keyframe_insert("scale", frame=frame)
    engine_scene.frame_start, engine_scene.frame_end = 1, 3
    engine_scene.render.filepath = str(tmp_path / "frame_")
    with pytest.raises(RuntimeError, match="no size"):
        bpy.ops.render.render(animation=True)
    assert [path.name for path in tmp_path.glob("frame_*")] == ["frame_0001.exr"]


def test_faces_without_area_for_a_frame_do_not_end_an_animation(engine_scene, tmp_path):
    cube = bpy.data.objects["Cube"]
    for frame, size in ((1, 1.0), (2, 0.0)):
        cube.scale = (size,) * 3
        cube.keyframe_insert("scale", frame=frame)
    engine_scene.frame_start, engine_scene.frame_end = 1, 2
    engine_scene.render.filepath = str(tmp_path / "frame_")
    for engine_scene.render.use_persistent_data in (False, True):
        assert bpy.ops.render.render(animation=True) == {"FINISHED"}
    assert len(list(tmp_path.glob("frame_*"))) == 2


def test_exception_in_a_tile_after_others_are_delivered(addon, engine_scene, monkeypatch):
    """Blender has half of the image when a tile fails."""
    frame = addon("shading.frame")
    whole = frame.render_tile

    def fail(pipeline, job, *arguments):
        if job.rows.start > 20:
            raise FloatingPointError("in a tile")
        return whole(pipeline, job, *arguments)

    monkeypatch.setattr(frame, "render_tile", fail)
    monkeypatch.setattr(addon("bridge.render.render_delivery"), "TICK", 0.0)
    refused(engine_scene, "FloatingPointError: in a tile")


def test_absurd_size_is_refused(addon, engine_scene):
    """Without allocating it: Blender has its own result by then, so only the engine's check is called."""
    with pytest.raises(addon("projection.user_error").UserError, match="GB of memory"):
        addon("bridge.render.image_size").require_size(65536, 65536)


def test_an_image_that_free_memory_does_not_hold_is_refused(addon, engine_scene, monkeypatch):
    button()
    before = image()
    monkeypatch.setattr(addon("casting.common.memory"), "available_memory", lambda: 10_000_000)
    engine_scene.render.resolution_x = engine_scene.render.resolution_y = 1500
    refused(engine_scene, "1500 × 1500 pixels would need about 0.1 GB of memory and 0.0 GB are free")
    with pytest.raises(RuntimeError, match=r"0\.0 GB are free; lower the resolution"):
        button()
    assert np.array_equal(image(), before)


def test_an_image_of_one_pixel(engine_scene):
    engine_scene.render.resolution_x = engine_scene.render.resolution_y = 4
    engine_scene.render.resolution_percentage = 25
    engine_scene.render.use_motion_blur = engine_scene.scfpf_sampling.use_adaptive = True
    engine_scene.camera.scfpf.samples = 8
    picture = f12(engine_scene)[COMBINED]
    assert picture.shape == (1, 1, 4) and picture[..., :3].any()
    assert np.array_equal(button(), picture)


def test_two_renders_at_once(addon, engine_scene):
    """While the button's thread is at work, F12 works, and another press of the button is an error."""
    job = addon("bridge.render.render_job")
    expected = f12(engine_scene)[COMBINED]
    inputs = addon("bridge.render.render_inputs").prepare(
        engine_scene, bpy.context.view_layer, engine_scene.camera
    )
    running = job.start(replace(inputs, settings=replace(inputs.settings, samples=100_000)))
    try:
        assert np.array_equal(f12(engine_scene)[COMBINED], expected)
        assert running.running, "the render is too quick for this test"
        with pytest.raises(RuntimeError, match=r"already running|poll\(\) failed"):
            button()
    finally:
        job.stop()


@pytest.fixture
def said(addon, monkeypatch):
    """The engine's calls that update the header, (method, arguments) each."""
    engine, heard = addon("bridge.render.render_engine"), []

    class Heard:
        """The engine, with its updates recorded."""

        def __init__(self, real):
            self._real = real

        def __getattr__(self, name):
            if name.startswith("update_"):
                return lambda *given, **named: heard.append((name, (*given, *named.values())))
            return getattr(self._real, name)

    for name in ("_read", "_make"):
        real = getattr(engine.SCFPF_RenderEngine, name)
        monkeypatch.setattr(
            engine.SCFPF_RenderEngine, name, lambda self, *rest, real=real: real(Heard(self), *rest)
        )
    whole = engine.Delivery
    monkeypatch.setattr(engine, "Delivery", lambda self, *rest: whole(Heard(self), *rest))
    return heard


def test_header_shows_stages_progress_time_and_memory(addon, engine_scene, monkeypatch, said):
    monkeypatch.setattr(addon("bridge.render.render_delivery"), "TICK", 0.0)
    prepare_scene = addon("bridge.render.render_engine").prepare_scene
    monkeypatch.setattr(
        addon("bridge.render.render_engine"),
        "prepare_scene",
        lambda *given: said.append(("built", ())) or prepare_scene(*given),
    )
    f12(engine_scene)
    stats = [given[1] for name, given in said if name == "update_stats"]
    assert "Reading" in stats[0]
    # While it is built the header says so.
    number = said.index(("built", ()))
    last = next(given for name, given in reversed(said[:number]) if name == "update_stats")
    assert "acceleration structure, which cannot be canceled" in last[1]
    assert any("Remaining 00:00 | Rendering" in text for text in stats)
    assert "64×36" in stats[-1]
    assert next(given for name, given in said if name == "update_memory_stats")[0] > 0
    shares = [given[0] for name, given in said if name == "update_progress"]
    assert shares == sorted(shares) and shares[-1] == 1.0


def test_cancelled_render_delivers_finished_tiles(addon, engine_scene, monkeypatch):
    """Blender asks an engine to stop through test_break(); the operator still ends in order."""
    engine = addon("bridge.render.render_engine")
    asked = []

    class Cancelled:
        """The engine, with a test_break that answers True from the third time on."""

        def __init__(self, real):
            self._real = real

        def __getattr__(self, name):
            return getattr(self._real, name)

        def test_break(self):
            asked.append(1)
            return len(asked) > 2

    real = engine.SCFPF_RenderEngine._make
    monkeypatch.setattr(engine.SCFPF_RenderEngine, "_make", lambda self, *rest: real(Cancelled(self), *rest))
    engine_scene.camera.scfpf.samples = 64
    engine_scene.render.resolution_x = engine_scene.render.resolution_y = 1024
    picture = f12(engine_scene)[COMBINED]
    assert 3 <= len(asked) < 20
    assert picture.shape == (1024, 1024, 4) and (picture[..., 3] == 0).any()
