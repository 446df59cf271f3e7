# SPDX-License-Identifier: GPL-3.0-or-later
"""Drives a Blender with a window through the interface, checks it, and takes pictures of it.

    xvfb-run -s "-screen 0 1600x1000x24" blender --factory-startup --enable-event-simulate \\
        --window-geometry 0 0 1600 1000 --python tests/window/drive_blender.py -- [FOLDER [SCENARIO ...]]

FOLDER (default shots beside this file) gets the screenshots, taken with ImageMagick's ``import``.
embreex must be importable: install the extension's zip, or pass --python-use-system-env and PYTHONPATH.
Each scenario is a generator that starts in a fresh file and yields the seconds to leave
Blender to itself. Exit code 1 if one fails; the last line says how many passed.
"""

import os
import pathlib
import subprocess
import sys
import tempfile
import time
import traceback

import bpy
import numpy as np

sys.path.insert(0, str(pathlib.Path(__file__).parent))

import habit_scenarios

ROOT = pathlib.Path(__file__).resolve().parents[2]
REPOSITORY = "checkout"
IMAGE = "SCFPF Render"
# Seconds after which a render is taken to hang.
PATIENCE = 120.0
# Long enough for a panel to be laid out and drawn by a software renderer.
DRAW = 1.0


def enable_extension() -> str:
    """Enable the installed extension, or this checkout as one; returns its module's name."""
    installed = [name for name in bpy.context.preferences.addons.keys() if name.endswith(".scfpf")]
    if installed:
        return installed[0]
    folder = pathlib.Path(tempfile.mkdtemp(prefix="scfpf-repo-"))
    (folder / "scfpf").symlink_to(ROOT, target_is_directory=True)
    bpy.context.preferences.extensions.repos.new(
        name=REPOSITORY, module=REPOSITORY, custom_directory=str(folder), remote_url=""
    )
    module = f"bl_ext.{REPOSITORY}.scfpf"
    assert bpy.ops.preferences.addon_enable(module=module) == {"FINISHED"}
    return module


class Driver:
    """What scenarios do to Blender: events, areas, screenshots."""

    def __init__(self, folder: pathlib.Path):
        self.folder = folder
        folder.mkdir(parents=True, exist_ok=True)

    @property
    def window(self):
        return bpy.context.window_manager.windows[0]

    def area(self, kind: str):
        return next(area for area in self.window.screen.areas if area.type == kind)

    def override(self, kind: str = "VIEW_3D"):
        area = self.area(kind)
        region = next(region for region in area.regions if region.type == "WINDOW")
        return bpy.context.temp_override(window=self.window, area=area, region=region)

    def key(self, kind: str, kind_of_area: str = "VIEW_3D", **modifiers) -> None:
        """Press and release a key with the mouse over an area."""
        area = self.area(kind_of_area)
        where = {"x": area.x + area.width // 3, "y": area.y + area.height // 2}
        self.window.event_simulate("MOUSEMOVE", "NOTHING", **where)
        self.window.event_simulate(kind, "PRESS", **where, **modifiers)
        self.window.event_simulate(kind, "RELEASE", **where, **modifiers)

    def shot(self, name: str) -> None:
        """Save what the screen shows. Blender's own screenshot is black in a timer under Xvfb."""
        subprocess.run(["import", "-window", "root", str(self.folder / f"{name}.png")], check=True)

    def show_sidebar(self):
        """Generator: open the sidebar; its tab can be chosen once it has been drawn."""
        area = self.area("VIEW_3D")
        area.spaces.active.show_region_ui = True
        region = next(region for region in area.regions if region.type == "UI")
        end = time.monotonic() + PATIENCE
        while region.is_property_readonly("active_panel_category"):
            assert time.monotonic() < end, "the sidebar is not drawn"
            yield 0.2
        region.active_panel_category = "SCFPF"
        yield DRAW

    def open_image_editor(self) -> None:
        """Tiles are shown in an Image Editor while a render runs."""
        self.area("DOPESHEET_EDITOR").ui_type = "IMAGE_EDITOR"

    def menu(self, name: str):
        """Generator: take a picture of a menu."""
        with self.override():
            bpy.ops.wm.call_menu(name=name)
        yield DRAW
        self.shot(f"menu-{name}")
        self.key("ESC")
        yield 0.3

    def show_data_tab(self) -> None:
        self.area("PROPERTIES").spaces.active.context = "DATA"

    def add_camera(self, preset: str = "VIEW") -> None:
        """Add a flexible camera, as the menu does, and make it the scene's."""
        bpy.context.scene.camera = None
        with self.override():
            bpy.ops.scfpf.camera_add("INVOKE_DEFAULT", True, preset=preset)

    def start_render(self) -> None:
        with self.override():
            assert bpy.ops.scfpf.render("INVOKE_DEFAULT") == {"RUNNING_MODAL"}

    def finished(self):
        """Generator: wait until no render runs."""
        end = time.monotonic() + PATIENCE
        while bpy.ops.scfpf.render_cancel.poll():
            assert time.monotonic() < end, "the render hangs"
            yield 0.1
        # The operator sees it at its next tick, and then everything is drawn.
        yield 3 * DRAW

    def tiles_shown(self):
        """Generator: wait until the image has the size of ``set_slow``."""
        end = time.monotonic() + PATIENCE
        while IMAGE not in bpy.data.images or bpy.data.images[IMAGE].size[0] != 3840:
            assert time.monotonic() < end, "no tiles are shown"
            yield 0.2

    def pixels(self):
        image = bpy.data.images[IMAGE]
        values = np.empty(len(image.pixels), np.float32)
        image.pixels.foreach_get(values)
        return values


def build_scene(samples: int = 1, percentage: int = 50) -> None:
    """Something to look at beside the factory cube, camera and light."""
    for number in range(5):
        bpy.ops.mesh.primitive_monkey_add(location=(3 * number - 6, 3, 1))
        bpy.ops.object.shade_smooth()
        material = bpy.data.materials.new(f"Colour {number}")
        material.diffuse_color = (number / 4, 0.4, 1 - number / 4, 1)
        bpy.context.object.data.materials.append(material)
    bpy.ops.mesh.primitive_plane_add(size=40, location=(0, 0, -1))
    bpy.context.scene.render.resolution_percentage = percentage


def set_slow() -> None:
    """Settings that take a render some seconds at least."""
    bpy.context.scene.render.resolution_percentage = 200
    bpy.context.scene.camera.scfpf.samples = 64


def panels(driver):
    """The panels before there is a flexible camera, with one, and with one of each kind of surface."""
    build_scene()
    driver.show_data_tab()
    bpy.context.view_layer.objects.active = bpy.data.objects["Camera"]
    yield from driver.show_sidebar()
    driver.shot("panel-ordinary-camera")
    driver.add_camera()
    yield DRAW
    driver.shot("panel-new-camera")
    for kind in ("PLANE", "CYLINDER", "SPHERE", "GRID", "NURBS", "LATTICE"):
        with driver.override():
            bpy.ops.scfpf.surface_add("INVOKE_DEFAULT", kind=kind)
    bpy.context.object.scfpf.active_surface = 2
    yield DRAW
    driver.shot("panel-many-surfaces")
    bpy.data.objects.remove(bpy.data.objects["Near"])
    yield DRAW
    driver.shot("panel-deleted-surface")
    for menu in ("VIEW3D_MT_add", "VIEW3D_MT_camera_add", "SCFPF_MT_surface_add", "SCFPF_MT_presets"):
        yield from driver.menu(menu)


def presets(driver):
    """Each preset's volume, drawn in the viewport from outside."""
    for identifier in ("cylindrical_panorama", "angular_fisheye", "nonlinear_twist", "around_the_car"):
        driver.add_camera(identifier)
        with driver.override():
            bpy.ops.view3d.view_selected("EXEC_DEFAULT")
            bpy.context.region_data.view_distance = 30.0
        yield 2 * DRAW
        driver.shot(f"preset-{identifier}")
        with driver.override():
            bpy.ops.ed.undo()
        yield DRAW


def renders(driver):
    """A render through the operator: progress, result in an Image Editor, report in the panel."""
    build_scene()
    driver.add_camera()
    driver.show_data_tab()
    driver.open_image_editor()
    yield from driver.show_sidebar()
    driver.start_render()
    yield 0.4
    driver.shot("render-progress")
    yield from driver.finished()
    driver.shot("render-done")
    image = bpy.data.images[IMAGE]
    assert tuple(image.size) == (960, 540), tuple(image.size)
    assert driver.pixels().max() > 0
    assert driver.area("IMAGE_EDITOR").spaces.active.image == image
    assert bpy.context.scene.camera.scfpf.report


def picks(driver):
    """A click in the picture draws the projector through that pixel and its hit; undo takes it back."""
    build_scene()
    driver.add_camera("nonlinear_twist")
    camera = bpy.context.scene.camera
    yield from driver.show_sidebar()
    with driver.override():
        try:
            bpy.ops.scfpf.pick("INVOKE_DEFAULT")
        except RuntimeError as error:
            assert "Image Editor" in str(error)
        else:
            raise AssertionError("picking without a picture says nothing")
    driver.open_image_editor()
    driver.start_render()
    yield from driver.finished()
    area = driver.area("IMAGE_EDITOR")
    region = next(region for region in area.regions if region.type == "WINDOW")
    with driver.override():
        bpy.ops.view3d.view_axis(type="FRONT")
        bpy.ops.view3d.view_all("EXEC_DEFAULT")
        assert bpy.ops.scfpf.pick("INVOKE_DEFAULT") == {"RUNNING_MODAL"}
    yield DRAW
    driver.key("LEFTMOUSE")
    yield DRAW
    assert not camera.scfpf.show_pick, "a click beside the picture picks"
    u, v = region.view2d.region_to_view(region.width // 2, region.height // 2)
    where = {"x": region.x + region.width // 2, "y": region.y + region.height // 2}
    driver.window.event_simulate("MOUSEMOVE", "NOTHING", **where)
    driver.window.event_simulate("LEFTMOUSE", "PRESS", **where)
    driver.window.event_simulate("LEFTMOUSE", "RELEASE", **where)
    yield 2 * DRAW
    camera = bpy.context.scene.camera
    assert camera.scfpf.show_pick and abs(camera.scfpf.pick[0] - u) + abs(camera.scfpf.pick[1] - v) < 0.02
    driver.shot("pick")
    with driver.override():
        bpy.ops.wm.call_panel(name="SCFPF_PT_view_display")
    yield DRAW
    driver.shot("pick-panel")
    driver.key("ESC")
    yield DRAW
    with driver.override():
        bpy.ops.ed.undo()
    yield DRAW
    assert not bpy.context.scene.camera.scfpf.show_pick, "undo does not take the pick back"
    with driver.override():
        assert bpy.ops.scfpf.pick("INVOKE_DEFAULT") == {"RUNNING_MODAL"}
    yield DRAW
    driver.key("ESC")
    yield DRAW
    assert not bpy.context.scene.camera.scfpf.show_pick


def cancels(driver):
    """Esc in mid-render leaves the old picture as it was, and Blender answers meanwhile."""
    build_scene()
    driver.open_image_editor()
    driver.add_camera()
    driver.start_render()
    yield from driver.finished()
    before = driver.pixels()
    set_slow()
    driver.start_render()
    yield from driver.tiles_shown()
    driver.shot("render-tiles")
    assert bpy.ops.scfpf.render_cancel.poll(), "the slow render has ended before it could be cancelled"
    frame = bpy.context.scene.frame_current
    driver.key("RIGHT_ARROW")
    yield 0.5
    assert bpy.context.scene.frame_current == frame + 1, "Blender does not answer during a render"
    driver.key("ESC")
    yield from driver.finished()
    driver.shot("render-cancelled")
    assert np.array_equal(driver.pixels(), before)


def edits_during_render(driver):
    """Undo, a renamed camera and a deleted one while a render runs."""
    build_scene()
    for edit in (
        lambda: bpy.ops.ed.undo(),
        lambda: setattr(bpy.context.scene.camera, "name", "Renamed"),
        lambda: bpy.data.objects.remove(bpy.context.scene.camera),
    ):
        driver.add_camera()
        set_slow()
        driver.start_render()
        yield 0.5
        with driver.override():
            edit()
        yield 0.5
        assert bpy.ops.scfpf.render_cancel.poll(), "the edit has ended the render"
        driver.key("ESC")
        yield from driver.finished()
        assert IMAGE not in bpy.data.images
    for edit in (
        lambda: setattr(bpy.context.scene.camera, "name", "Renamed Again"),
        lambda: bpy.data.objects.remove(bpy.context.scene.camera),
    ):
        driver.add_camera()
        bpy.context.scene.render.resolution_percentage = 25
        driver.start_render()
        with driver.override():
            edit()
        yield from driver.finished()
        assert bpy.data.images[IMAGE].size[0] == 480
        bpy.data.images.remove(bpy.data.images[IMAGE])
        camera = bpy.context.scene.camera
        assert camera is None or camera.scfpf.report, "the report did not find the renamed camera"


def window_closed_during_render(driver):
    """Closing the window that a render was started in ends it; the old picture stays."""
    build_scene()
    driver.open_image_editor()
    driver.add_camera()
    driver.start_render()
    yield from driver.finished()
    before = driver.pixels()
    set_slow()
    with driver.override():
        bpy.ops.wm.window_new_main()
    yield DRAW
    window = bpy.context.window_manager.windows[-1]
    with bpy.context.temp_override(window=window):
        assert bpy.ops.scfpf.render("INVOKE_DEFAULT") == {"RUNNING_MODAL"}
    yield from driver.tiles_shown()
    with bpy.context.temp_override(window=window):
        bpy.ops.wm.window_close()
    yield 0.5
    assert not bpy.ops.scfpf.render_cancel.poll(), "the render goes on without its window"
    assert np.array_equal(driver.pixels(), before)


def file_opened_during_render(driver):
    """Opening another file ends the render; nothing of it reaches the new file."""
    build_scene()
    driver.open_image_editor()
    driver.add_camera()
    set_slow()
    driver.start_render()
    yield from driver.tiles_shown()
    with driver.override():
        bpy.ops.wm.read_homefile()
    yield 1.0
    assert not bpy.ops.scfpf.render_cancel.poll(), "the render goes on in another file"
    assert IMAGE not in bpy.data.images


def picture_in_a_window(driver):
    """Show Picture opens a window when no Image Editor is open."""
    build_scene()
    driver.add_camera()
    driver.start_render()
    yield from driver.finished()
    with driver.override():
        bpy.ops.scfpf.result_show("INVOKE_DEFAULT")
    yield DRAW
    window = bpy.context.window_manager.windows[-1]
    assert window.screen.areas[0].spaces.active.image.name == IMAGE
    driver.shot("picture-window")
    with bpy.context.temp_override(window=window):
        bpy.ops.wm.window_close()
    yield 0.5


def undo(driver):
    """Undo and redo over adding a camera, a surface, and a render."""
    bpy.ops.ed.undo_push(message="start")
    driver.add_camera()
    yield 0.2
    with driver.override():
        bpy.ops.scfpf.surface_add("INVOKE_DEFAULT", True, kind="PLANE")
    yield 0.2
    driver.start_render()
    yield from driver.finished()
    before = driver.pixels()

    def state():
        cameras = [obj for obj in bpy.data.objects if obj.type == "CAMERA" and obj.scfpf.enabled]
        return len(cameras), sum(len(camera.scfpf.surfaces) for camera in cameras), IMAGE in bpy.data.images

    states = [state()]
    for _ in range(3):
        with driver.override():
            bpy.ops.ed.undo()
        yield 0.3
        states.append(state())
    for _ in range(3):
        with driver.override():
            bpy.ops.ed.redo()
        yield 0.3
    assert states == [(1, 3, True), (1, 3, False), (1, 2, False), (0, 0, False)], states
    assert state() == (1, 3, True)
    assert np.array_equal(driver.pixels(), before)


SCENARIOS = (
    panels,
    presets,
    renders,
    picks,
    cancels,
    edits_during_render,
    window_closed_during_render,
    file_opened_during_render,
    picture_in_a_window,
    undo,
    *habit_scenarios.SCENARIOS,
)


def run(driver, scenarios):
    """Generator over all scenarios; prints how each went and quits Blender."""
    failed = []
    for scenario in scenarios:
        bpy.ops.wm.read_homefile(use_factory_startup=False, use_splash=False)
        yield DRAW
        try:
            yield from scenario(driver)
        except Exception:
            traceback.print_exc()
            driver.shot(f"failed-{scenario.__name__}")
            failed.append(scenario.__name__)
            if bpy.ops.scfpf.render_cancel.poll():
                bpy.ops.scfpf.render_cancel()
        print(f"{'FAILED' if scenario.__name__ in failed else 'ok'}: {scenario.__name__}", flush=True)
    print(f"{len(scenarios) - len(failed)} of {len(scenarios)} scenarios passed", flush=True)
    if failed:
        os._exit(1)
    # Quitting is the last check: a render that runs must not keep Blender alive, nor make it crash.
    build_scene()
    driver.add_camera()
    set_slow()
    driver.start_render()
    yield DRAW
    bpy.ops.wm.quit_blender()


def main() -> None:
    arguments = sys.argv[sys.argv.index("--") + 1 :] if "--" in sys.argv else []
    folder = pathlib.Path(arguments[0] if arguments else pathlib.Path(__file__).parent / "shots").absolute()
    chosen = [scenario for scenario in SCENARIOS if not arguments[1:] or scenario.__name__ in arguments[1:]]
    enable_extension()
    bpy.context.preferences.view.show_splash = False
    steps = run(Driver(folder), chosen)
    bpy.app.timers.register(lambda: next(steps, None), first_interval=DRAW, persistent=True)


main()
