# SPDX-License-Identifier: GPL-3.0-or-later
"""The render engine SCFPF: F12, animations and ``blender -b -E SCFPF``, by what the Render button uses."""

from __future__ import annotations

import atexit
import contextlib
import threading
import time
import traceback

import bpy
import numpy as np

from ...shading.frame import render_frame
from ...shading.settings.frame_settings import Border
from ..camera.stereo_views import eye_of, view_camera
from .render_delivery import Delivery
from .render_job import (
    RENDER_ERRORS,
    RenderError,
    RenderInputs,
    read_inputs,
    reason,
    require_size,
    with_motion,
)
from .render_passes import list_render_passes
from .render_viewport import ViewportRender, stop_all
from .scene_preparation import BUILDING, build, coarse_picture

ENGINE = "SCFPF"
# Seconds from the beginning of a job in a window until a failure is sure to end it.
SETTLE_SECONDS = 0.5
GIVEN_UP = "SCFPF was disabled during the render: enable it and render again"

# Set while the add-on is disabled and a job of this engine ends.
_given_up = threading.Event()


class SCFPF_RenderEngine(bpy.types.RenderEngine):
    """Pictures through flexible cameras, and through ordinary ones too."""

    bl_idname = ENGINE
    bl_label = "SCFPF"
    bl_use_postprocess = True
    bl_use_eevee_viewport = True
    # Materials and worlds are made of the nodes that Cycles and EEVEE have.
    bl_use_shading_nodes_custom = False

    def update_render_passes(self, scene=None, renderlayer=None):
        """Tell the compositor which passes there are."""
        for each in list_render_passes(renderlayer):
            self.register_pass(scene, renderlayer, each.name, len(each.channels), each.channels, each.type)

    def render(self, depsgraph):
        """Make the pictures of one view layer at one frame, one for each view.

        However this ends, Blender has pixels (without, it crashes when it saves them) and
        an error is a report, which stops animations and keeps it from writing files.
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
                said: set[str] = set()
                for delivery in deliveries:
                    # Blender then answers for this view: with its camera, if it has one of its own.
                    self.active_view_set(delivery.view)
                    # Held by no name here: what the volume cannot meet is freed once the rest is built.
                    self._make(self._read(depsgraph, delivery, said), delivery)
            if _given_up.is_set():
                self._fail(GIVEN_UP)
        except RENDER_ERRORS as error:
            self._fail(reason(error))
        except Exception as error:  # What leaves here Blender prints and takes for success.
            traceback.print_exc()
            self._fail(
                f"SCFPF failed: look at the system console for the place ({type(error).__name__}: {error})"
            )

    def view_update(self, context, depsgraph):
        """A viewport in Rendered shading: the scene has changed."""
        self._viewport().update()
        self.tag_redraw()

    def view_draw(self, context, depsgraph):
        """A viewport in Rendered shading is drawn."""
        self._viewport().draw(context, depsgraph, self)

    def _viewport(self) -> ViewportRender:
        # Not made in __init__: renders have no viewport.
        if not hasattr(self, "viewport"):
            self.viewport = ViewportRender()
        return self.viewport

    def _read(self, depsgraph, delivery: Delivery, said: set[str]) -> RenderInputs:
        """Read what a view shows. said: the warnings that other views have given; its own are added."""
        size = self.resolution_x, self.resolution_y
        require_size(*size)
        camera = self.camera_override or depsgraph.scene.camera
        if camera is None:
            raise RenderError("The scene has no camera: add one with Add > Camera > Flexible Camera")
        self.update_stats("", "Reading the scene")
        camera = view_camera(camera.original, self.render)
        eye = eye_of(self.render, delivery.view)
        inputs = read_inputs(
            depsgraph,
            camera,
            size,
            border=render_border(self.render, *size),
            passes=delivery.sources,
            may_be_empty=True,
            stopped=lambda: _is_over(self),
            eye=eye,
        )
        # Of a scene that was read in part they would be wrong.
        for warning in () if _is_over(self) else inputs.scene.warnings:
            if warning not in said:
                self.report({"WARNING"}, warning)
        said.update(inputs.scene.warnings)
        return with_motion(depsgraph, camera, inputs, self.frame_set, lambda: _is_over(self), eye)

    def _make(self, inputs: RenderInputs, delivery: Delivery) -> None:
        if _is_over(self):
            return
        delivery.begin(inputs)
        self.update_stats("", BUILDING)
        # Blender keeps the engine with persistent data, and makes one for each picture without.
        kept = getattr(self, "kept_scenes", {})
        keep = self.render.use_persistent_data
        built = build(inputs, kept.get(delivery.layer), keep)
        self.kept_scenes = {**kept, delivery.layer: built.kept} if keep else {}
        inputs, cast_scene = built.inputs, built.cast_scene
        if not bpy.app.background:
            coarse = coarse_picture(inputs, cast_scene, lambda: _is_over(self))
            if coarse is not None:
                delivery.show(coarse)
        frame = render_frame(
            inputs.projection,
            inputs.scene,
            inputs.settings,
            cast_scene,
            progress=delivery.progress,
            cancelled=lambda: _is_over(self),
            on_tile=delivery.add,
            moments=inputs.moments,
            keep=False,
        )
        if frame is not None:
            delivery.flush()
            self.update_stats("", built.reported(frame).report.summary())

    def _fail(self, message: str) -> None:
        if not bpy.app.background:
            # Reports that come while the operator still begins are taken away before Blender looks
            # for errors; so this is also the last thing that is done.
            time.sleep(SETTLE_SECONDS)
        self.report({"ERROR"}, message)
        if not bpy.app.background:
            # Image Editors show this one over the picture.
            self.error_set(message)


def render_border(render, width: int, height: int) -> Border | None:
    """The pixels of a scene's render region, just as Blender counts them; None without one.

    render: bpy.types.RenderSettings.
    """
    if not render.use_border:
        return None
    # Blender multiplies in float32 and cuts off.
    size = {"x": np.float32(width), "y": np.float32(height)}
    left, bottom, right, top = (
        int(np.float32(getattr(render, f"border_{end}_{axis}")) * size[axis])
        for end in ("min", "max")
        for axis in ("x", "y")
    )
    return Border(left, bottom, right, top)


def give_up() -> None:
    """Have the job that renders with this engine end; it reports an error, so that no file is written."""
    _given_up.set()


def go_on() -> None:
    """Let renders go on after ``give_up``."""
    _given_up.clear()


def _is_over(engine) -> bool:
    """Whether a render is to end before its time."""
    return _given_up.is_set() or engine.test_break()


def _leave():
    """As a module Blender 4.5 hangs when Python ends while an engine that has rendered is registered."""
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
