# SPDX-License-Identifier: GPL-3.0-or-later
"""Control of a Blender with a window: events, areas, screenshots, and a scene to look at."""

import pathlib
import subprocess
import time

import bpy
import numpy as np
from bpy_extras.view3d_utils import location_3d_to_region_2d

IMAGE = "SCFPF Render"
# Seconds after which a render is taken to hang.
PATIENCE = 120.0
# Long enough for a panel to be laid out and drawn by a software renderer.
DRAW = 1.0
# Pixels between two places at which a button is searched, seconds for it to notice the mouse, and pages of a
# sidebar at most.
SEARCH, HOVER, PAGES = 10, 0.04, 6


class Driver:
    """Events, areas and screenshots of a Blender with a window."""

    def __init__(self, folder: pathlib.Path):
        self.folder = folder
        self.scenario = ""  # the name of the one that runs
        self.rest = 0.015  # seconds that Blender rests between two looks for events

    @property
    def window(self):
        return bpy.context.window_manager.windows[0]

    def area(self, kind: str):
        return next(area for area in self.window.screen.areas if area.type == kind)

    def region(self, area: str, kind: str = "WINDOW"):
        return next(region for region in self.area(area).regions if region.type == kind)

    def override(self, kind: str = "VIEW_3D"):
        return bpy.context.temp_override(
            window=self.window, area=self.area(kind), region=self.region(kind, "WINDOW")
        )

    def key(self, kind: str, kind_of_area: str = "VIEW_3D", **modifiers) -> None:
        """Press and release a key with the mouse over an area."""
        area = self.area(kind_of_area)
        where = {"x": area.x + area.width // 3, "y": area.y + area.height // 2}
        self.window.event_simulate("MOUSEMOVE", "NOTHING", **where)
        self.window.event_simulate(kind, "PRESS", **where, **modifiers)
        self.window.event_simulate(kind, "RELEASE", **where, **modifiers)

    def shot(self, name: str) -> None:
        """Save the screen. Blender's own screenshot is black in a timer under Xvfb."""
        path = self.folder / f"{self.scenario}-{name}.png"
        # Hardly compressed: that takes a third of the time.
        subprocess.run(["import", "-window", "root", "-quality", "10", str(path)], check=True)

    def region_pixels(self, area: str = "VIEW_3D", kind: str = "WINDOW"):
        """The pixels of a region on the screen, (H, W, 3) from 0 to 255, row 0 at the bottom."""
        region = self.region(area, kind)
        width, height = self.window.width, self.window.height
        command = ["import", "-window", "root", "-crop", f"{width}x{height}+0+0", "-depth", "8", "rgb:-"]
        done = subprocess.run(command, check=True, stdout=subprocess.PIPE)
        screen = np.frombuffer(done.stdout, np.uint8).reshape(height, width, 3)[::-1].astype(np.int16)
        return screen[region.y : region.y + region.height, region.x : region.x + region.width]

    def surface_lines(self):
        """The mask of the 3D viewport's pixels in the green of control surfaces, (H, W) bool."""
        red, green, blue = np.moveaxis(self.region_pixels(), 2, 0)
        return (green > 110) & (green > 1.4 * red) & (green > 1.4 * blue)

    def near(self, obj, reach: int = 4):
        """The box around an object's evaluated vertices in the 3D viewport, as slices of its pixels."""
        region = self.region("VIEW_3D")
        view = self.area("VIEW_3D").spaces.active.region_3d
        places = [location_3d_to_region_2d(region, view, corner) for corner in world_vertices(obj)]
        low, high = np.min(places, axis=0) - reach, np.max(places, axis=0) + reach
        return tuple(slice(max(int(low[axis]), 0), max(int(high[axis]) + 1, 0)) for axis in (1, 0))

    def look(self, axis: str = "", room: float = 1.2) -> None:
        """Look at the whole volume from outside, along an axis or as the view is turned, without gizmos."""
        space = self.area("VIEW_3D").spaces.active
        space.show_gizmo = False
        space.overlay.show_floor = space.overlay.show_axis_x = space.overlay.show_axis_y = False
        found = np.array([c for obj in surfaces(bpy.context.scene.camera) for c in world_vertices(obj)])
        with self.override():
            if axis:
                bpy.ops.view3d.view_axis(type=axis)
            bpy.context.region_data.view_location = (found.min(axis=0) + found.max(axis=0)) / 2
            bpy.context.region_data.view_distance = room * np.linalg.norm(np.ptp(found, axis=0))

    def show_sidebar(self):
        """Generator: open the sidebar, wait until it is drawn, and choose its tab."""
        area = self.area("VIEW_3D")
        area.spaces.active.show_region_ui = True
        region = next(region for region in area.regions if region.type == "UI")
        end = time.monotonic() + PATIENCE
        while region.is_property_readonly("active_panel_category"):
            assert time.monotonic() < end, "the sidebar is not drawn"
            yield 0.2
        region.active_panel_category = "Flexible Projection"
        yield DRAW

    def button(self, call: str, area: str = "VIEW_3D", kind: str = "UI", across: float = 0.5):
        """Generator: return the place (x, y) of a button on the window, None if it is not to be seen.

        call: a part of what Blender copies of it for scripts. across: where it is searched, as a share of the
        region's width.
        """
        region, manager = self.region(area, kind), bpy.context.window_manager
        x = region.x + round(across * region.width)
        for y in range(region.y + region.height - 12, region.y + 4, -SEARCH):
            self.window.event_simulate("MOUSEMOVE", "NOTHING", x=x, y=y)
            yield HOVER
            manager.clipboard = ""
            self.window.event_simulate("C", "PRESS", x=x, y=y, ctrl=True)
            self.window.event_simulate("C", "RELEASE", x=x, y=y, ctrl=True)
            yield HOVER
            if call in manager.clipboard:
                return x, y
        return None

    def press(self, call: str, area: str = "VIEW_3D", kind: str = "UI", across: float = 0.5):
        """Generator: press a button, see ``button``, which scrolling brings to sight if there is need."""
        region = self.region(area, kind)
        place = yield from self.button(call, area, kind, across)
        for page in range(PAGES if place is None else 0):
            with bpy.context.temp_override(window=self.window, area=self.area(area), region=region):
                for _ in range(1 if page else PAGES):
                    getattr(bpy.ops.view2d, "scroll_down" if page else "scroll_up")(page=True)
            yield DRAW
            place = yield from self.button(call, area, kind, across)
            if place is not None:
                break
        assert place is not None, f"there is no button {call}"
        for value in ("PRESS", "RELEASE"):
            self.window.event_simulate("LEFTMOUSE", value, x=place[0], y=place[1])
        yield DRAW

    def open_image_editor(self) -> None:
        """Show an Image Editor, in which tiles appear while a render runs."""
        self.area("DOPESHEET_EDITOR").ui_type = "IMAGE_EDITOR"

    def menu(self, name: str):
        """Generator: take a picture of a menu."""
        # It opens where the pointer is, which an earlier scenario may have left anywhere.
        region = self.region("VIEW_3D")
        where = {"x": region.x + region.width // 2, "y": region.y + region.height // 2}
        self.window.event_simulate("MOUSEMOVE", "NOTHING", **where)
        yield 0.3
        before = self.region_pixels()
        with self.override():
            bpy.ops.wm.call_menu(name=name)
        yield DRAW
        self.shot(f"menu-{name}")
        assert differing(before, self.region_pixels()) > 5000, f"{name} is not shown"
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


def world_vertices(obj) -> list:
    """The vertices of an object as evaluated, or a lattice's points, in the world."""
    evaluated = obj.evaluated_get(bpy.context.evaluated_depsgraph_get())
    if obj.type == "LATTICE":
        return [evaluated.matrix_world @ point.co_deform for point in evaluated.data.points]
    found = [evaluated.matrix_world @ vertex.co for vertex in evaluated.to_mesh().vertices]
    evaluated.to_mesh_clear()
    return found


def differing(first, second) -> int:
    """The number of pixels in which two images differ visibly."""
    return int((np.abs(first - second).max(axis=2) > 12).sum())


def surfaces(camera) -> list:
    """The control surfaces of a camera, in order."""
    return [slot.object for slot in camera.scfpf.surfaces]


def volume(camera) -> tuple:
    """The settings and surfaces of a camera's volume, to compare."""
    settings = camera.scfpf
    parts = tuple(
        (obj.name, obj.scfpf_surface.kind, tuple(round(x, 4) for row in obj.matrix_world for x in row))
        if obj
        else None
        for obj in surfaces(camera)
    )
    return camera.name, settings.basis, settings.reparameterisation, tuple(settings.u_range), parts


def build_scene(samples: int = 1, percentage: int = 50) -> None:
    """Add objects to look at beside the factory cube, camera and light."""
    for number in range(5):
        bpy.ops.mesh.primitive_monkey_add(location=(3 * number - 6, 3, 1))
        bpy.ops.object.shade_smooth()
        material = bpy.data.materials.new(f"Colour {number}")
        material.diffuse_color = (number / 4, 0.4, 1 - number / 4, 1)
        bpy.context.object.data.materials.append(material)
    bpy.ops.mesh.primitive_plane_add(size=40, location=(0, 0, -1))
    bpy.context.scene.render.resolution_percentage = percentage


def set_slow() -> None:
    """Choose settings with which a render takes at least some seconds."""
    bpy.context.scene.render.resolution_percentage = 200
    bpy.context.scene.camera.scfpf.samples = 64
