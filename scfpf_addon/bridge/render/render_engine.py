# SPDX-License-Identifier: GPL-3.0-or-later
"""The render engine Flexible Projection: F12, animations and ``blender -b -E SCFPF``."""

from __future__ import annotations

import atexit
import contextlib
import threading
import time
from dataclasses import replace

import bpy
import numpy as np

from ...projection.user_error import UserError
from ...shading.typing import Single
from ..blender.user_errors import failure_message, translated_report
from ..camera.stereo_views import eye_of, view_camera
from ..scene.instances import has_type
from .image_size import render_region, require_size
from .render_delivery import WHOLE, Delivery
from .render_inputs import RenderInputs, read_inputs, with_light_warnings, with_motion
from .render_passes import layer_warnings, list_render_passes
from .render_viewport import ViewportRender, stop_all
from .scene_preparation import BUILDING, prepare_scene

ENGINE = "SCFPF"
# Seconds after the start of a job in a window until a reported error is sure to end it.
SETTLE_SECONDS = 0.5
GIVEN_UP = "Flexible Projection was disabled during the render: enable it and render again"

# Passes that Blender draws Grease Pencil into.
DRAWN_INTO = ("Combined", "Depth", "GreasePencil")

# Set while the add-on is disabled until a running job of this engine has ended.
_given_up = threading.Event()
# The warnings that the running job has reported: an animation makes an engine for each of its frames.
_said: set[str] = set()
# Set if the image that was rendered last is one that Freestyle's lines fit.
_lines = threading.Event()


class SCFPF_RenderEngine(bpy.types.RenderEngine):
    """Renders images through flexible cameras, and through ordinary ones too."""

    bl_idname = ENGINE
    bl_label = "Flexible Projection"
    bl_use_postprocess = True
    bl_use_eevee_viewport = True
    # This engine renders Freestyle's lines. EEVEE, which Blender takes otherwise, has to build its shaders.
    bl_use_custom_freestyle = True
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
        self.kept, self.is_ordinary = {}, True
        is_of_lines = _is_of_freestyle(depsgraph.scene)
        try:
            with contextlib.ExitStack() as ends:
                views = [view.name for view in self.get_result().views]
                deliveries = [
                    Delivery(self, depsgraph.view_layer_eval, view, (number, len(views)))
                    for number, view in enumerate(views)
                ]
                for delivery in deliveries:
                    ends.callback(delivery.close)
                if is_of_lines and not _lines.is_set():
                    return
                for delivery in deliveries:
                    # From here on Blender returns the camera of this view, if it has one of its own.
                    self.active_view_set(delivery.view)
                    # No local name holds the inputs: see prepare_scene.
                    self._make(self._read(depsgraph, delivery), delivery)
            if not is_of_lines:
                (_lines.set if self.is_ordinary else _lines.clear)()
            if not self.is_ordinary:
                self._keep(depsgraph)
            if _given_up.is_set():
                self._fail(GIVEN_UP)
        except Exception as error:  # Blender would print it and report success.
            self._fail(failure_message(error))

    def render_frame_finish(self):
        """Put back the pixels over which Blender has drawn Grease Pencil as an ordinary camera sees it."""
        kept, self.kept = getattr(self, "kept", {}), {}
        for (layer, view), values in kept.items():
            result = self.begin_result(0, 0, WHOLE, WHOLE, layer=layer, view=view)
            try:
                for name, pixels in values.items():
                    result.layers[0].passes.find_by_name(name, view).rect.foreach_set(pixels)
            finally:
                self.end_result(result)

    def _keep(self, depsgraph) -> None:
        """Keep the passes of a view layer that Blender draws Grease Pencil into, if it has any."""
        if not has_type(depsgraph, "GREASEPENCIL"):
            return
        name, result = depsgraph.view_layer_eval.name, self.get_result()
        passes = result.layers[name].passes
        for view in result.views:
            found = {each: passes.find_by_name(each, view.name) for each in DRAWN_INTO}
            self.kept[name, view.name] = {each: _values(made) for each, made in found.items() if made}

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
            raise UserError("The scene has no camera: add one with Add > Camera > Flexible Camera")
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
            strokes_shown=True,
        )
        if _is_of_freestyle(depsgraph.scene):
            # Lines have a style of their own, and materials that no artist has made.
            return replace(inputs, settings=replace(inputs.settings, stylised=None))
        self.is_ordinary &= inputs.is_ordinary
        if not cancelled():
            inputs = with_light_warnings(inputs, depsgraph)
        layer = depsgraph.view_layer_eval
        warnings = (*inputs.scene.warnings, *layer_warnings(self.render, layer, inputs.is_ordinary))
        # Warnings about a scene that was read in part would be wrong.
        for warning in () if cancelled() else warnings:
            if warning not in _said:
                self.report({"WARNING"}, translated_report(warning))
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


def render_begins(_scene) -> None:
    """Forget which warnings were reported, when a job begins."""
    _said.clear()


def _is_of_freestyle(scene) -> bool:
    """Return whether a scene is one of lines that Freestyle has made, apart from the file's scenes."""
    return all(scene.original.session_uid != each.session_uid for each in bpy.data.scenes)


def _values(render_pass) -> Single:
    """A copy of the values of a bpy.types.RenderPass, flat."""
    values = np.empty(len(render_pass.rect) * render_pass.channels, np.float32)
    render_pass.rect.foreach_get(values)
    return values


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
    if bpy.app.module:
        atexit.register(_leave)


def unregister():
    stop_all()
    atexit.unregister(_leave)
    # Blender switches add-ons off after Python's exit functions have run.
    if SCFPF_RenderEngine.is_registered:
        bpy.utils.unregister_class(SCFPF_RenderEngine)
