# SPDX-License-Identifier: GPL-3.0-or-later
"""What scenarios do to a Blender with a window: events, areas, screenshots; something to look at."""

import pathlib
import subprocess
import time

import bpy
import numpy as np

IMAGE = "SCFPF Render"
# Seconds after which a render is taken to hang.
PATIENCE = 120.0
# Long enough for a panel to be laid out and drawn by a software renderer.
DRAW = 1.0


class Driver:
    """What scenarios do to Blender: events, areas, screenshots."""

    def __init__(self, folder: pathlib.Path):
        self.folder = folder
        self.scenario = ""  # the name of the one that runs

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
        subprocess.run(
            ["import", "-window", "root", str(self.folder / f"{self.scenario}-{name}.png")], check=True
        )

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
