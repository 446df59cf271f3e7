# SPDX-License-Identifier: GPL-3.0-or-later
"""The render engine SCFPF: F12, animations and ``blender -b -E SCFPF``."""

from __future__ import annotations

import atexit
import contextlib
import threading
import time

import bpy
from bpy.app.handlers import persistent

from ..blender.app_handlers import add_handlers, remove_handlers
from ..camera.stereo_views import eye_of, view_camera
from .image_size import render_region, require_size
from .render_delivery import Delivery
from .render_errors import RenderError, failure_message, told
from .render_inputs import RenderInputs, read_inputs, with_light_warnings, with_motion
from .render_passes import layer_warnings, list_render_passes
from .render_viewport import ViewportRender, stop_all
from .scene_preparation import BUILDING, prepare_scene

ENGINE = "SCFPF"
# Seconds after the start of a job in a window until a reported error is sure to end it.
SETTLE_SECONDS = 0.5
GIVEN_UP = "SCFPF was disabled during the render: enable it and render again"

# Set while the add-on is disabled until a running job of this engine has ended.
_given_up = threading.Event()
# The warnings that the running job has reported: an animation makes an engine for each of its frames.
_said: set[str] = set()


class SCFPF_RenderEngine(bpy.types.RenderEngine):
    """Renders images through flexible cameras, and through ordinary ones too."""

    bl_idname = ENGINE
    bl_label = "SCFPF"
    bl_use_postprocess = True
    bl_use_eevee_viewport = True
    # Materials and worlds use the nodes of Cycles and EEVEE.
    bl_use_shading_nodes_custom = False

    def update_render_passes(self, scene=None, renderlayer=None):
        """Register the passes with the compositor."""
        for each in list_render_passes(renderlayer):
            self.register_pass(scene, renderlayer, each.name, len(each.channels), each.channels, each.type)

    def render(self, depsgraph):
        """Render the images of one view layer at one frame, one for each view.

        However this ends, Blender gets pixels: without them it crashes when it saves. An error becomes a
        report, which stops animations and prevents the writing of files.
        """
        try:
            with contextlib.ExitStack() as ends:
                views = [view.name for view in self.get_result().views]
                deliveries = [
                    Delivery(self, depsgraph.view_layer_eval, view, (number, len(views)))
                    for number, view in enumerate(views)
                ]
                for delivery in deliveries:
                    ends.callback(delivery.close)
                for delivery in deliveries:
                    # From here on Blender returns the camera of this view, if it has one of its own.
                    self.active_view_set(delivery.view)
                    # No local name holds the inputs: see prepare_scene.
                    self._make(self._read(depsgraph, delivery), delivery)
            if _given_up.is_set():
                self._fail(GIVEN_UP)
        except Exception as error:  # Blender would print it and report success.
            self._fail(failure_message(error))

    def view_update(self, context, depsgraph):
        """Note that the scene of a viewport in Rendered shading has changed."""
        self._viewport().update()
        self.tag_redraw()

    def view_draw(self, context, depsgraph):
        """Draw a viewport in Rendered shading."""
        self._viewport().draw(context, depsgraph, self)

    def _viewport(self) -> ViewportRender:
        # Not made in __init__, because renders have no viewport.
        if not hasattr(self, "viewport"):
            self.viewport = ViewportRender()
        return self.viewport

    def _read(self, depsgraph, delivery: Delivery) -> RenderInputs:
        """Read the inputs of a view, and report the warnings that the job has not reported yet."""
        size = self.resolution_x, self.resolution_y
        require_size(*size)
        camera = self.camera_override or depsgraph.scene.camera
        if camera is None:
            raise RenderError("The scene has no camera: add one with Add > Camera > Flexible Camera")
        self.update_stats("", "Reading the scene")
        camera = view_camera(camera.original, self.render)
        eye = eye_of(self.render, delivery.view)

        def cancelled() -> bool:
            return _is_cancelled(self)

        inputs = read_inputs(
            depsgraph,
            camera,
            size,
            border=render_region(self.render, *size),
            passes=delivery.sources,
            may_be_empty=True,
            cancelled=cancelled,
            eye=eye,
        )
        if not cancelled():
            inputs = with_light_warnings(inputs, depsgraph)
        layer = depsgraph.view_layer_eval
        warnings = (*inputs.scene.warnings, *layer_warnings(self.render, layer, camera.scfpf.enabled))
        # Warnings about a scene that was read in part would be wrong.
        for warning in () if cancelled() else warnings:
            if warning not in _said:
                self.report({"WARNING"}, told(warning))
                _said.add(warning)
        return with_motion(inputs, depsgraph, camera, self.frame_set, cancelled, eye)

    def _make(self, inputs: RenderInputs, delivery: Delivery) -> None:
        """Render one view and deliver its tiles."""
        if _is_cancelled(self):
            return
        delivery.begin(inputs)
        self.update_stats("", BUILDING)
        # Blender keeps the engine with persistent data, and makes one for each render without.
        caches = getattr(self, "scene_caches", {})
        keep = self.render.use_persistent_data
        prepared = prepare_scene(inputs, caches.get(delivery.layer), keep)
        # Frees the part of the scene that the volume cannot meet.
        del inputs
        self.scene_caches = {**caches, delivery.layer: prepared.cache} if keep else {}
        frame = prepared.render(
            lambda: _is_cancelled(self),
            None if bpy.app.background else delivery.show,
            progress=delivery.progress,
            on_tile=delivery.add,
            keep=False,
        )
        if frame is not None:
            delivery.flush()
            self.update_stats("", frame.report.summary())

    def _fail(self, message: str) -> None:
        if not bpy.app.background:
            # Blender drops reports that come while the operator still begins. So the error comes last.
            time.sleep(SETTLE_SECONDS)
        self.report({"ERROR"}, message)
        if not bpy.app.background:
            # Image Editors show this message over the image.
            self.error_set(message)


@persistent
def _job_begins(*_):
    _said.clear()


HANDLERS = {"render_init": _job_begins}


def give_up() -> None:
    """Cancel the job that renders with this engine; it reports an error, so that no file is written."""
    _given_up.set()


def go_on() -> None:
    """Allow renders again after ``give_up``."""
    _given_up.clear()


def _is_cancelled(engine) -> bool:
    """Return whether the user or the disabling of the add-on has cancelled a render."""
    return _given_up.is_set() or engine.test_break()


def _leave():
    """Unregister the engine when Python ends: otherwise Blender 4.5 as a module hangs after a render."""
    bpy.utils.unregister_class(SCFPF_RenderEngine)


def register():
    bpy.utils.register_class(SCFPF_RenderEngine)
    add_handlers(HANDLERS)
    if bpy.app.module:
        atexit.register(_leave)


def unregister():
    stop_all()
    remove_handlers(HANDLERS)
    atexit.unregister(_leave)
    # Blender switches add-ons off after Python's exit functions have run.
    if SCFPF_RenderEngine.is_registered:
        bpy.utils.unregister_class(SCFPF_RenderEngine)
