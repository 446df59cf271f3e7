# SPDX-License-Identifier: GPL-3.0-or-later
"""Live images of a viewport: coarse ones at once, the final one later, errors as messages; wires on top."""

import contextlib
import threading
import time
from types import SimpleNamespace

import bpy
import numpy as np
import pytest
from made_cameras import new_camera, three_surfaces
from mathutils import Matrix

SIZE = (60, 40)
PATIENCE = 30.0


@pytest.fixture
def camera(addon):
    """A flexible camera of three surfaces above a cube."""
    bpy.ops.mesh.primitive_cube_add(size=1.0)
    camera = new_camera()
    camera.location.z = 2.6
    three_surfaces(addon("bridge.camera.flexible_camera"), camera)
    camera.scfpf.surfaces[2].object.scale = (2.0, 2.0, 1.0)
    bpy.context.scene.camera = camera
    bpy.context.view_layer.update()
    return camera


class Viewport:
    """A live view without a window."""

    def __init__(self, addon, camera):
        self.camera = camera
        self._views, self._rectangle = addon("bridge.live.live_view"), addon("bridge.render.view_painter")
        self._window = addon("shading.live.cast_live").LiveWindow(0.0, 0.0, 1.0, 1.0, *SIZE)
        self.view = self._views.LiveView()
        self.painter = self.view.painter

    def request(self, size=SIZE):
        frame = self._rectangle.Rectangle(0.0, 0.0, *map(float, size))
        window = self._window._replace(width=size[0], height=size[1])
        bpy.context.view_layer.update()
        depsgraph = bpy.context.evaluated_depsgraph_get()
        return self.view.request(depsgraph, self.camera, frame, window, frame)

    def final(self):
        """Wait for the final image."""
        end = time.monotonic() + PATIENCE
        while self.painter.image is None or self.painter.image.step > 1.0:
            assert time.monotonic() < end and not self.painter.message, self.painter.message
            time.sleep(0.01)
        return self.painter.image.pixels

    def alone(self):
        """The image of a view that has kept nothing."""
        view = self._views.LiveView()
        return view.refresh(bpy.context.evaluated_depsgraph_get(), self.camera, SIZE)


@pytest.fixture
def viewport(addon, camera):
    made = Viewport(addon, camera)
    yield made
    made.painter.stop()
    assert not [thread for thread in threading.enumerate() if "live" in thread.name]


def test_first_and_final_images(viewport):
    assert viewport.request()
    assert viewport.painter.wait(PATIENCE)
    height, width = viewport.painter.image.pixels.shape[:2]
    assert (width, height) == (10, 7)
    np.testing.assert_allclose(viewport.final(), viewport.alone(), atol=1e-3)
    assert not viewport.request(), "nothing has changed"


def test_an_edit_makes_another_image(viewport):
    viewport.request()
    before = viewport.final().copy()
    viewport.camera.scfpf.surfaces[1].object.location.x = 0.3
    assert viewport.request()
    viewport.painter.wait(PATIENCE)
    after = viewport.final()
    assert np.abs(after - before).max() > 0.1
    np.testing.assert_allclose(after, viewport.alone(), atol=1e-3)


def test_the_last_of_many_requests_counts(viewport):
    for number in range(20):
        viewport.camera.scfpf.surfaces[1].object.location.x = 0.02 * number
        assert viewport.request()
    assert viewport.painter.wait(PATIENCE)
    np.testing.assert_allclose(viewport.final(), viewport.alone(), atol=1e-3)


def test_what_is_seen_already_is_not_cast_again(viewport, addon, monkeypatch):
    viewport.request()
    viewport.final()
    painter = addon("bridge.live.live_painter")
    monkeypatch.setattr(painter, "cast_live", None)
    number = viewport.painter.number
    # A lamp changes no hits.
    bpy.ops.object.light_add(type="SUN")
    assert viewport.request() and viewport.painter.wait(PATIENCE)
    assert viewport.painter.number == number + 1 and not viewport.painter.message
    assert viewport.painter.image.step == 1.0


def test_errors_are_messages_and_pass(viewport, addon, monkeypatch):
    kept, error = addon("bridge.live.kept_scene"), addon("casting.common.hits").CastError

    def fails(*_):
        raise error("the memory does not suffice")

    monkeypatch.setattr(kept.KeptScene, "updated", fails)
    viewport.request()
    assert viewport.painter.wait(PATIENCE)
    assert viewport.painter.message == "the memory does not suffice" and viewport.painter.image is None
    monkeypatch.undo()
    viewport.camera.location.z += 0.01
    viewport.request()
    viewport.painter.wait(PATIENCE)
    viewport.final()
    assert viewport.painter.message == ""


def test_a_broken_volume_raises_and_mends(viewport, addon):
    errors = addon("bridge.blender.user_errors").USER_ERRORS
    surface = viewport.camera.scfpf.surfaces[1].object
    viewport.camera.scfpf.surfaces[1].object = None
    with pytest.raises(errors, match="empty"):
        viewport.request()
    viewport.camera.scfpf.surfaces[1].object = surface
    assert viewport.request() and viewport.painter.wait(PATIENCE)
    viewport.final()


def test_an_empty_scene(viewport):
    bpy.data.objects.remove(bpy.data.objects["Cube"])
    viewport.request()
    assert viewport.painter.wait(PATIENCE)
    assert viewport.final().shape == (*SIZE[::-1], 4)


def test_which_viewports_are_live(addon, camera):
    live_camera = addon("bridge.camera.live_camera").live_camera

    def area(perspective):
        view = SimpleNamespace(region_3d=SimpleNamespace(view_perspective=perspective))
        return SimpleNamespace(type="VIEW_3D", spaces=SimpleNamespace(active=view))

    def context(**changed):
        given = {"view_perspective": "CAMERA", "type": "SOLID", "use_local_camera": False, "camera": None}
        given |= {"mode": "OBJECT", "edited": "Cube", "beside": ()} | changed
        return SimpleNamespace(
            region_data=SimpleNamespace(view_perspective=given["view_perspective"]),
            space_data=SimpleNamespace(
                shading=SimpleNamespace(type=given["type"]),
                use_local_camera=given["use_local_camera"],
                camera=given["camera"],
            ),
            scene=bpy.context.scene,
            mode=given["mode"],
            objects_in_mode=[bpy.data.objects[given["edited"]]],
            screen=SimpleNamespace(areas=[area(one) for one in ("CAMERA", *given["beside"])]),
        )

    assert live_camera(context()) == camera
    for mode in ("EDIT_MESH", "EDIT_CURVE", "SCULPT", "PAINT_TEXTURE"):
        assert live_camera(context(mode=mode)) is None
        assert live_camera(context(mode=mode, beside=("CAMERA",))) is None
        # The thing can be edited in another viewport.
        assert live_camera(context(mode=mode, beside=("PERSP",))) == camera
    # Their points are drawn over the image.
    assert live_camera(context(mode="EDIT_MESH", edited=camera.scfpf.surfaces[0].object.name)) == camera
    assert live_camera(context(mode="POSE")) == camera
    assert live_camera(context(type="MATERIAL")) == camera
    assert live_camera(context(use_local_camera=True, camera=camera)) == camera
    for changed in (
        {"view_perspective": "PERSP"},
        {"type": "RENDERED"},
        {"type": "WIREFRAME"},
        {"use_local_camera": True, "camera": new_camera("Plain")},
        {"use_local_camera": True, "camera": bpy.data.objects["Cube"]},
        {"use_local_camera": True},
    ):
        assert live_camera(context(**changed)) is None, changed
    for name in ("show_live", "enabled"):
        setattr(camera.scfpf, name, False)
        assert live_camera(context()) is None
        setattr(camera.scfpf, name, True)


def test_the_part_of_a_frame_that_is_shown(addon):
    shown_window = addon("bridge.live.live_view").shown_window
    rectangle = addon("bridge.render.view_painter").Rectangle
    region = SimpleNamespace(width=400, height=300)
    window, place = shown_window(rectangle(50.0, 60.0, 300.0, 200.0), region)
    assert tuple(window) == (0.0, 0.0, 1.0, 1.0, 300, 200) and place == (50.0, 60.0, 300.0, 200.0)
    # Zoomed in: the region shows pixels 100 to 500 and 50 to 350 of 800 × 600.
    window, place = shown_window(rectangle(-100.0, -50.0, 800.0, 600.0), region)
    assert tuple(window) == pytest.approx((100 / 800, 50 / 600, 500 / 800, 350 / 600, 400, 300))
    assert place == (0.0, 0.0, 400.0, 300.0)
    assert shown_window(rectangle(500.0, 0.0, 100.0, 100.0), region) is None
    assert shown_window(rectangle(10.0, 10.0, 100.0, 1.0), region) is None
    # Between pixels: the middles of pixels 11 to 30 are in the frame, half a pixel and more.
    window, place = shown_window(rectangle(10.7, 20.2, 20.0, 10.0), region)
    assert place == (11, 20, 20, 10)
    x, y = window.centres(slice(0, window.height))
    np.testing.assert_allclose(x[:20] * 20.0 + 10.7, np.arange(11, 31) + 0.5)
    np.testing.assert_allclose(y[::20] * 10.0 + 20.2, np.arange(20, 30) + 0.5)
    assert ((x > 0) & (x < 1) & (y > 0) & (y < 1)).all()


@pytest.mark.parametrize("mode", ["OBJECT", "EDIT"])
@pytest.mark.parametrize("kind", ["PATCH", "GRID", "NURBS", "LATTICE", "PLANE"])
def test_wires_of_surfaces(addon, camera, kind, mode):
    """Their points lie where those of the evaluated or edited object do."""
    wires = addon("bridge.live.surface_wires")
    bridge = addon("bridge.camera.flexible_camera")
    surface = bridge.add_surface(camera, kind, "New", Matrix.Translation((0.2, 0, -2.5)))
    surface.hide_set(False)
    surface.scale.x = 1.5
    bpy.context.view_layer.update()
    bpy.context.view_layer.objects.active = surface
    camera.scfpf.edit_volume = True
    bpy.ops.object.mode_set(mode=mode)
    depsgraph = bpy.context.evaluated_depsgraph_get()
    read = wires.read_wires(surface, depsgraph)
    bpy.ops.object.mode_set(mode="OBJECT")
    assert read.is_edited == (mode == "EDIT")
    data = surface.data
    if kind == "LATTICE":
        points = [point.co_deform for point in data.points]
    elif kind == "NURBS" and mode == "EDIT":
        points = [point.co.xyz for point in data.splines[0].points]
    else:
        source = surface if mode == "EDIT" else surface.evaluated_get(bpy.context.evaluated_depsgraph_get())
        points = [vertex.co.copy() for vertex in source.to_mesh().vertices]
    expected = np.array([surface.matrix_world @ point for point in points]).reshape(-1, 3)
    assert len(expected) == len(read.points)
    np.testing.assert_allclose(read.points, expected, atol=1e-5)
    if len(expected) > 1:
        ends = read.lines.reshape(-1, 3)
        distances = np.linalg.norm(ends[:, None] - expected, axis=2).min(axis=1)
        assert len(ends) and distances.max() < 1e-5


def test_an_image_that_is_not_the_scenes_tells_its_age(viewport, addon, monkeypatch):
    """While the painter is held up, the picture of before is shown, and how old it is."""
    assert viewport.view.seconds_behind == 0.0
    viewport.request()
    viewport.final()
    assert viewport.view.seconds_behind == 0.0
    module, held = addon("bridge.live.live_painter"), threading.Event()
    cast_live = module.cast_live
    monkeypatch.setattr(module, "cast_live", lambda *given: (held.wait(PATIENCE), cast_live(*given))[1])
    surface = bpy.context.scene.camera.scfpf.surfaces[1].object
    begun = time.monotonic()
    for _ in range(2):
        surface.location.x += 0.1
        assert viewport.request()
        time.sleep(0.3)
    behind, age = viewport.view.seconds_behind, time.monotonic() - begun
    assert 0.6 <= behind <= age
    drawn = addon("bridge.live.live_drawing")._Viewport()
    drawn.view = viewport.view
    assert drawn.has_aged and drawn._age == 1
    held.set()
    end = time.monotonic() + PATIENCE
    while viewport.view.seconds_behind > 0.0:
        assert time.monotonic() < end
        time.sleep(0.01)
    assert not drawn.has_aged


def test_finer_images_wait_until_a_slow_window_is_drawn(viewport, addon, monkeypatch):
    waits = []
    monkeypatch.setattr(viewport.painter, "_is_idle", lambda seconds: waits.append(seconds))
    for drawing in (0.0, 0.25, 1e9):
        viewport.painter.drawing = drawing
        bpy.context.scene.camera.scfpf.surfaces[1].object.location.x += 0.01
        bpy.context.view_layer.update()
        viewport.request()
        assert viewport.painter.wait(PATIENCE)
        while viewport.painter.busy:
            time.sleep(0.01)
    constants = addon("bridge.live.live_painter")
    assert waits[1] - waits[0] == pytest.approx(0.25)
    assert waits[2] == constants.IDLE_SECONDS + constants.LONGEST_DRAWING


def test_the_time_of_a_drawing_is_noted_when_it_is_over(addon, monkeypatch):
    drawing = addon("bridge.live.live_drawing")
    clock = iter((10.0, 10.5, 11.0))
    monkeypatch.setattr(drawing, "perf_counter", lambda: next(clock))
    viewport = drawing._Viewport()
    viewport.note_drawing()
    assert viewport.view.painter.drawing == 0.0
    monkeypatch.setattr(drawing, "viewport_eye", lambda *_: 1 / 0)
    viewport.update(bpy.context, None, None)
    viewport.note_drawing()
    viewport.note_drawing()
    assert viewport.view.painter.drawing == 0.5


def test_a_fault_of_the_wires_is_shown_and_printed_once(addon, monkeypatch, capsys):
    """Its message stands in the image at each drawing; its traceback comes with the first one only."""
    drawing, texts = addon("bridge.live.live_drawing"), []

    def fail(*_):
        raise ZeroDivisionError("no wires")

    monkeypatch.setattr(drawing, "draw_wires", fail)
    monkeypatch.setattr(drawing, "draw_text", lambda text, *_: texts.append(text))
    monkeypatch.setattr(drawing, "pixel_space", lambda _: contextlib.nullcontext())
    viewport = drawing._Viewport()
    context = SimpleNamespace(preferences=bpy.context.preferences, space_data=None, region=None)
    for _ in range(3):
        viewport.draw_wires(context, None, None)
    assert len(texts) == 3 and all("no wires" in text for text in texts)
    assert capsys.readouterr().err.count("Traceback") == 1
