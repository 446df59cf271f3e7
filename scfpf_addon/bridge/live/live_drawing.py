# SPDX-License-Identifier: GPL-3.0-or-later
"""Live View in 3D viewports: edits noticed, and live images drawn over the frame of a flexible camera."""

from __future__ import annotations

import math
from contextlib import suppress
from time import perf_counter

import bpy
import gpu

from ...projection.user_error import Message
from ..blender.draw_handler import DrawHandler
from ..blender.user_errors import USER_ERRORS, failure_message, translated_report
from ..camera.live_camera import chosen_camera, live_camera, steps_aside
from ..overlays.image_marks import draw_cross
from ..render.render_viewport import camera_rectangle, viewport_eye
from ..render.view_painter import Rectangle
from ..scene.instances import NO_THINGS
from .live_painter import LiveImage
from .live_view import LiveView, shown_window, sources
from .region_drawing import draw_image, draw_text, image_texture, pixel_space
from .surface_wires import draw_wires

# Seconds for which drawing waits for the first image after a change.
PATIENCE = 0.09
# Seconds between two checks for finer images.
TICK = 0.03
# The text while there is no image yet.
BUILDING = "Building the scene of Live View"
# An image that is older than so many seconds is marked, and the text that marks it.
OLD, BEHIND = 0.5, Message("Live View is behind: the picture is {0:.0f} s old")
# The text while the viewport shows the camera's ordinary view instead.
ASIDE = Message("Live View is off while you edit: it comes back in Object Mode")


class _Viewport:
    """The live view of one region, with the texture that is drawn."""

    def __init__(self) -> None:
        self.view = LiveView()
        self.message = ""
        # The last exception, as its type and text, and what is said of it.
        self._fault: tuple[type, str] | None = None
        self._failure = ""
        self._drawn = -1
        # Whole seconds of age that are marked in the viewport, 0 for none.
        self._marked = 0
        # When a drawing of the window began, until its end is noted.
        self._begun: float | None = None
        self._texture: gpu.types.GPUTexture | None = None
        self._rectangle = self._frame = Rectangle(0.0, 0.0, 0.0, 0.0)

    @property
    def is_late(self) -> bool:
        """Return whether there is an image that has not been drawn."""
        return self._drawn != self.view.painter.number

    @property
    def is_waiting(self) -> bool:
        """Return whether images of the look are still to be read, a few each time it is drawn."""
        source = self.view.source
        return source is not None and not source.looks.is_complete

    @property
    def _age(self) -> int:
        """The seconds by which the image is old, rounded up; 0 for an image that is not."""
        behind = self.view.seconds_behind
        return math.ceil(behind) if behind > OLD else 0

    @property
    def has_aged(self) -> bool:
        """Return whether the image's age is another than the viewport tells."""
        return self._age != self._marked

    def note_drawing(self) -> None:
        """Tell the painter how long the window's drawing took; called when Blender is at rest after it.

        A drag's next move comes then. A finer image before it would have the window drawn twice.
        """
        if self._begun is not None:
            self.view.painter.drawing, self._begun = perf_counter() - self._begun, None

    def update(self, context, camera, depsgraph) -> None:
        """Ask for an image if anything has changed, and take the newest one."""
        self._begun = perf_counter()
        region, view, space = context.region, context.region_data, context.space_data
        painter, frame = self.view.painter, None
        try:
            eye = viewport_eye(space, depsgraph)
            frame = camera_rectangle(camera, depsgraph, region, view, eye)
            shown = None if frame is None else shown_window(frame, region)
            if frame is None or shown is None:
                self._texture = None
                return
            self._frame = frame
            if self.view.request(depsgraph, camera, frame, *shown, space, eye):
                painter.wait(PATIENCE)
            self.message = painter.message
        except Exception as error:  # Blender would print a traceback at each drawing.
            self.message = self._failure_of(error)
            self._rectangle = self._rectangle if frame is None else frame
        if self.is_late:
            self._drawn = painter.number
            self._take(painter.image)

    def _take(self, image: LiveImage | None) -> None:
        self._texture = None if image is None else image_texture(image.pixels)
        self._rectangle = self._rectangle if image is None else image.rectangle

    def draw(self, context, camera) -> None:
        """Draw the image and the cross of the picked projector, or the message."""
        message = self.message
        if self._texture is None and self.view.painter.busy:
            message = message or BUILDING
        with pixel_space(context.region):
            if message:
                draw_text(message, self._rectangle, context.preferences.system.ui_scale)
            elif self._texture is not None:
                draw_image(self._texture, self._rectangle)
                self._marked = self._age
                if self._marked:
                    text = translated_report(Message(BEHIND, self._marked))
                    draw_text(text, self._rectangle, context.preferences.system.ui_scale)
                if camera.scfpf.show_pick and context.space_data.overlay.show_overlays:
                    self._draw_pick(context, camera.scfpf.pick)

    def _draw_pick(self, context, pick) -> None:
        """Draw the cross where the picked projector is seen from its beginning, as a point."""
        left, bottom, width, height = self._frame
        region, scale = context.region, context.preferences.system.ui_scale
        draw_cross(left + pick[0] * width, bottom + pick[1] * height, (region.width, region.height), scale)

    def draw_wires(self, context, camera, depsgraph) -> None:
        """Draw the wires of the surfaces that are selected or edited, with the matrices that are set."""
        preferences = context.preferences
        try:
            draw_wires(
                camera, depsgraph, context.space_data, preferences.themes[0], preferences.system.pixel_size
            )
        except Exception as error:  # as in ``update``
            with pixel_space(context.region):
                draw_text(self._failure_of(error), self._rectangle, preferences.system.ui_scale)

    def _failure_of(self, error: Exception) -> str:
        """The message of an exception; one that comes again at each drawing prints its traceback once."""
        fault = type(error), str(error)
        if fault != self._fault:
            self._fault, self._failure = fault, failure_message(error)
        return self._failure


# By the address of their regions, which are numbers here.
_viewports: dict[int, _Viewport] = {}


def draw_viewport() -> None:
    """The draw handler: the live image of the viewport that is being drawn."""
    context = bpy.context
    if context.region is None or context.space_data is None:
        return
    camera, address = live_camera(context), context.region.as_pointer()
    if camera is None:
        if address in _viewports:
            _viewports.pop(address).view.painter.retire()
        _draw_aside(context)
        return
    depsgraph = context.evaluated_depsgraph_get()
    viewport = _viewports.get(address)
    if viewport is None:
        _remove_closed()
        viewport = _viewports[address] = _Viewport()
    viewport.update(context, camera, depsgraph)
    gpu.state.depth_test_set("NONE")
    gpu.state.depth_mask_set(False)
    viewport.draw(context, camera)
    viewport.draw_wires(context, camera, depsgraph)
    gpu.state.depth_mask_set(True)
    if (viewport.view.painter.busy or viewport.is_waiting) and not bpy.app.timers.is_registered(_tick):
        bpy.app.timers.register(_tick, first_interval=TICK)


def _draw_aside(context) -> None:
    """Say in the camera's frame why a viewport that is live at other times shows an ordinary view."""
    camera = chosen_camera(context)
    if camera is None or not steps_aside(context):
        return
    region, depsgraph, frame = context.region, context.evaluated_depsgraph_get(), None
    with suppress(*USER_ERRORS):
        eye = viewport_eye(context.space_data, depsgraph)
        frame = camera_rectangle(camera, depsgraph, region, context.region_data, eye)
    if frame is not None:
        with pixel_space(region):
            draw_text(translated_report(ASIDE), frame, context.preferences.system.ui_scale)


def _regions() -> dict[int, bpy.types.Area]:
    """The areas of the windows' 3D viewports by the addresses of their main regions."""
    return {
        region.as_pointer(): area
        for window in bpy.context.window_manager.windows
        for area in window.screen.areas
        if area.type == "VIEW_3D"
        for region in area.regions
        if region.type == "WINDOW"
    }


def _remove_closed() -> None:
    """Drop the live views of regions that are not shown any more."""
    open_ones = _regions() if _viewports else {}
    for address in _viewports.keys() - open_ones.keys():
        _viewports.pop(address).view.painter.retire()


def _tick() -> float | None:
    """Redraw viewports that have a finer image; threads must not do so themselves."""
    _remove_closed()
    areas = _regions()
    for address, viewport in _viewports.items():
        viewport.note_drawing()
        if viewport.is_late or viewport.is_waiting or viewport.has_aged:
            areas[address].tag_redraw()
    return TICK if any(one.view.painter.busy or one.is_waiting for one in _viewports.values()) else None


def stop_all() -> None:
    """End all live views and their threads."""
    for viewport in _viewports.values():
        viewport.view.painter.stop()
    _viewports.clear()
    if bpy.app.timers.is_registered(_tick):
        bpy.app.timers.unregister(_tick)


def _may_be_shown(obj) -> bool:
    """Return whether images may show an evaluated object or what it instances."""
    return obj.type not in NO_THINGS or obj.is_instancer


def scene_updated(_scene, depsgraph) -> None:
    """Note for every live view what an evaluation has changed."""
    found = sources()
    if not found or depsgraph.mode != "VIEWPORT":
        return
    objects = [update for update in depsgraph.updates if isinstance(update.id, bpy.types.Object)]
    lists = depsgraph.id_type_updated("SCENE") or depsgraph.id_type_updated("COLLECTION")
    materials = any(depsgraph.id_type_updated(kind) for kind in ("MATERIAL", "NODETREE"))
    for source in found:
        source.looks.mark_edited(depsgraph)
        left_out = source.objects.left_out
        shown = [u for u in objects if _may_be_shown(u.id) and u.id.name_full not in left_out]
        names = {update.id.name for update in shown if update.is_updated_geometry}
        moved = lists or shown or (materials and source.objects.has_other_surfaces)
        source.mark_edited(names, bool(moved))


def file_changed() -> None:
    """Note for every live view that anything may have changed."""
    for source in sources():
        source.mark_edited()
        source.looks.mark_edited()


_draw_handler = DrawHandler(bpy.types.SpaceView3D, draw_viewport, "POST_VIEW")


def register():
    _draw_handler.register()


def unregister():
    _draw_handler.unregister()
    stop_all()
