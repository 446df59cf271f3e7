# SPDX-License-Identifier: GPL-3.0-or-later
"""Rendered shading: the flexible camera's image in the camera's frame, or the viewport's own view."""

from __future__ import annotations

import math
import weakref
from collections.abc import Mapping
from dataclasses import replace

import bpy
import gpu
import numpy as np
from bpy_extras.view3d_utils import location_3d_to_region_2d
from gpu_extras.presets import draw_texture_2d
from mathutils import Matrix

from ...projection.surfaces.surface import BilinearPatch
from ...projection.volume.viewing_volume import Projection, ViewingVolume
from ...shading.scene.shading_scene import Scene
from ...shading.settings.frame_settings import Border
from ..blender.user_errors import failure_message
from ..camera.stereo_views import EYES, Eye, eye_of, frame_matrix
from ..layers.read_image_layers import read_image_layers
from ..scene.instances import has_type
from ..scene.read_images import KnownImages, with_images
from ..scene.read_scene import read_scene
from .render_inputs import RenderInputs, frame_settings, read_inputs
from .view_painter import Commission, Painting, Rectangle, ViewPainter

# Seconds between two checks for new paintings.
TICK = 0.06
# A larger frame, as when the view is zoomed in far, is painted in larger pixels.
MOST_PIXELS = 2**23
# Smallest side of a camera's frame that is painted, in pixels.
SMALLEST_FRAME = 2.0
# Samples of a pixel of a view without a camera.
FREE_SAMPLES = 4

_painters: weakref.WeakSet[ViewPainter] = weakref.WeakSet()
# The paintings' numbers at the last _tick.
_seen: list[int] = []


class ViewportRender:
    """The image of one viewport in Rendered shading. It lives as long as its engine."""

    def __init__(self) -> None:
        self._painter = ViewPainter()
        _painters.add(self._painter)
        # Blender drops this object with its engine, which has no method for its end.
        weakref.finalize(self, self._painter.stop)
        self._scene: Scene | None = None
        self._members: Mapping[int, int] = {}
        self._images: KnownImages = {}
        self._view: tuple | None = None
        self._drawn = -1
        self._texture = None
        self._rectangle = Rectangle(0.0, 0.0, 0.0, 0.0)
        self._message = ""
        self._strokes = ""  # what the viewport says of Grease Pencil in it

    def update(self) -> None:
        """Note that the scene has changed: the next drawing reads it again."""
        self._scene = self._view = None

    def draw(self, context, depsgraph, engine) -> None:
        """Draw the newest painting, after requesting another if the view or the scene has changed."""
        try:
            view = view_key(context, depsgraph)
            if view != self._view:
                self._view, self._message = view, ""
                self._ask(context, depsgraph)
            if self._painter.number != self._drawn:
                self._drawn = self._painter.number
                self._take(self._painter.image)
        except Exception as error:  # Blender would print it, and the next drawing show the old image as done.
            self._message = failure_message(error)
        message = self._message or self._painter.message
        status = "Rendering" if self._painter.busy else "Rendering Done"
        engine.update_stats("Flexible Projection", message or f"{status}{self._strokes}")
        if self._texture is None or message:
            return
        left, bottom, width, height = self._rectangle
        gpu.state.blend_set("ALPHA_PREMULT")
        engine.bind_display_space_shader(depsgraph.scene)
        draw_texture_2d(self._texture, (left, bottom), width, height)
        engine.unbind_display_space_shader()
        gpu.state.blend_set("NONE")

    def _ask(self, context, depsgraph) -> None:
        members = viewport_members(context, depsgraph)
        if self._scene is None or members != self._members:
            scene = read_scene(depsgraph, may_be_empty=True, image_layers=members)
            self._scene, self._members = with_images(scene, known=self._images), members
        commission = read_commission(context, depsgraph, self._scene)
        self._strokes = ""
        if commission is None:
            self._texture = None
            return
        if not commission.inputs.is_ordinary and shows_strokes(context.space_data, depsgraph):
            self._strokes = " · Blender draws Grease Pencil where an ordinary camera sees it"
        self._painter.ask(commission)
        if not bpy.app.timers.is_registered(_tick):
            bpy.app.timers.register(_tick, first_interval=TICK)

    def _take(self, painting: Painting | None) -> None:
        if painting is None:
            self._texture = None
            return
        height, width = painting.pixels.shape[:2]
        pixels = gpu.types.Buffer("FLOAT", width * height * 4, np.ravel(painting.pixels))
        self._texture = gpu.types.GPUTexture((width, height), format="RGBA16F", data=pixels)
        self._rectangle = painting.rectangle


def view_key(context, depsgraph) -> tuple:
    """The key of a view: it differs whenever the same scene looks different."""
    region, view = context.region, context.region_data
    return (
        viewport_eye(context.space_data, depsgraph),
        depsgraph.scene.frame_current,
        region.width,
        region.height,
        view.view_perspective,
        tuple(value for row in view.perspective_matrix for value in row),
    )


def shows_strokes(space, depsgraph) -> bool:
    """Return whether Blender draws Grease Pencil over a viewport, which no engine can change."""
    return space.show_object_viewport_grease_pencil and has_type(depsgraph, "GREASEPENCIL")


def viewport_eye(space, depsgraph) -> Eye:
    """The eye through which a viewport shows a camera, "" for both or none."""
    chosen = space.stereo_3d_camera.lower()
    return eye_of(depsgraph.scene_eval.render, chosen) if chosen in EYES else ""


def viewport_camera(context, depsgraph):
    """The camera that a viewport looks through, or None."""
    space = context.space_data
    camera = space.camera if space.use_local_camera else depsgraph.scene.camera
    is_through = context.region_data.view_perspective == "CAMERA" and camera is not None
    return camera if is_through and camera.type == "CAMERA" else None


def viewport_members(context, depsgraph) -> Mapping[int, int]:
    """The members of the layers that a viewport shows, see ``ReadLayers``. Raises USER_ERRORS."""
    camera = viewport_camera(context, depsgraph)
    return {} if camera is None else read_image_layers(camera.original, depsgraph, 1.0).members


def read_commission(context, depsgraph, scene: Scene) -> Commission | None:
    """Read the commission of a viewport, None if the camera's frame is outside it.

    Raises USER_ERRORS.
    """
    region, view, space = context.region, context.region_data, context.space_data
    camera, eye = viewport_camera(context, depsgraph), viewport_eye(space, depsgraph)
    if camera is None:
        frame = Rectangle(0.0, 0.0, float(region.width), float(region.height))
    else:
        frame = camera_rectangle(camera, depsgraph, region, view, eye)
    if frame is None:
        return None
    scale = min(1.0, (MOST_PIXELS / (frame.width * frame.height)) ** 0.5)
    size = max(round(frame.width * scale), 1), max(round(frame.height * scale), 1)
    border = visible_border(frame, size, region)
    if border is None:
        return None
    if camera is None:
        inputs = free_view(depsgraph, view, scene, size)
    else:
        aspect = frame.width / frame.height
        inputs = read_inputs(depsgraph, camera.original, size, scene=scene, aspect=aspect, eye=eye)
    left, right = (frame.left + x * frame.width / size[0] for x in (border.left, border.right))
    bottom, top = (frame.bottom + y * frame.height / size[1] for y in (border.bottom, border.top))
    inputs = replace(inputs, settings=replace(inputs.settings, border=border))
    return Commission(inputs, Rectangle(left, bottom, right - left, top - bottom))


def camera_rectangle(camera, depsgraph, region, view, eye: Eye = "") -> Rectangle | None:
    """The frame of a camera in a viewport that looks through it, None if it is too small.

    eye: through which the viewport shows the camera.
    """
    evaluated = camera.evaluated_get(depsgraph)
    frame = evaluated.data.view_frame(scene=depsgraph.scene)
    where, turn, _scale = evaluated.matrix_world.decompose()
    matrix = Matrix.LocRotScale(where, turn, None) @ Matrix(frame_matrix(evaluated, eye))
    right_top, left_bottom = (
        location_3d_to_region_2d(region, view, matrix @ corner) for corner in (frame[0], frame[2])
    )
    if right_top is None or left_bottom is None:
        return None
    width, height = right_top - left_bottom
    if not (width >= SMALLEST_FRAME and height >= SMALLEST_FRAME):
        return None
    return Rectangle(left_bottom.x, left_bottom.y, width, height)


def visible_border(frame: Rectangle, size: tuple[int, int], region) -> Border | None:
    """The pixels of an image of ``size`` in ``frame`` that a region shows, None if it shows none."""
    across, up = size[0] / frame.width, size[1] / frame.height
    border = Border(
        max(math.floor(-frame.left * across), 0),
        max(math.floor(-frame.bottom * up), 0),
        min(math.ceil((region.width - frame.left) * across), size[0]),
        min(math.ceil((region.height - frame.bottom) * up), size[1]),
    )
    return border if border.left < border.right and border.bottom < border.top else None


def free_view(depsgraph, view, scene: Scene, size: tuple[int, int]) -> RenderInputs:
    """The inputs of a viewport without a camera: its own frustum. view: bpy.types.RegionView3D."""
    to_world = np.linalg.inv(np.array(view.perspective_matrix, np.float64))
    ends = []
    for depth in (-1.0, 1.0):
        corners = np.array([[-1, -1, depth, 1], [1, -1, depth, 1], [-1, 1, depth, 1], [1, 1, depth, 1]])
        corners = corners @ to_world.T
        ends.append(BilinearPatch(corners=corners[:, :3] / corners[:, 3:]))
    aspect = size[0] / size[1]
    settings = frame_settings(depsgraph.scene_eval, size, samples=FREE_SAMPLES)
    projection = Projection(ViewingVolume(tuple(ends)), aspect=aspect)
    return RenderInputs(projection, scene, settings, is_ordinary=True)


def stop_all() -> None:
    """Stop the threads of all viewports."""
    for painter in list(_painters):
        painter.stop()
    if bpy.app.timers.is_registered(_tick):
        bpy.app.timers.unregister(_tick)


def is_painting() -> bool:
    """Return whether a viewport's image is still being made."""
    return any(painter.busy for painter in list(_painters))


def _tick() -> float | None:
    """Redraw viewports when there is a new painting; threads must not do so themselves."""
    busy = is_painting()
    numbers = sorted(painter.number for painter in list(_painters))
    if numbers != _seen or not busy:
        _seen[:] = numbers
        for window in bpy.context.window_manager.windows:
            for area in window.screen.areas:
                if area.type == "VIEW_3D" and area.spaces.active.shading.type == "RENDERED":
                    area.tag_redraw()
    return TICK if busy else None
