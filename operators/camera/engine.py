# SPDX-License-Identifier: GPL-3.0-or-later
"""Choose Flexible Projection as the render engine, and warn when F12 ignores a flexible camera."""

import bpy

from ...scfpf_addon.bridge.blender.all_or_nothing import keep
from ...scfpf_addon.bridge.blender.rig_mark import camera_behind
from ...scfpf_addon.bridge.render.render_engine import ENGINE
from ...scfpf_addon.cycles.engine_choice import warnings
from ...scfpf_addon.cycles.rig import switch_off
from ...scfpf_addon.cycles.rig_data import rig_of
from ..common.modal_job import ModalJob
from ..common.target import flexible_camera_of, poll_scene
from ..common.tool import Action

# Seconds between two checks of the queue.
LOOK = 0.5


class SCFPF_OT_engine_use(Action, bpy.types.Operator):
    """Choose Flexible Projection as the scene's render engine and this camera as the scene's, so that F12 and
    animations show the flexible camera; a setup for Cycles is removed"""

    bl_idname = "scfpf.engine_use"
    bl_label = "Use Flexible Projection for F12"

    poll = classmethod(poll_scene)

    def act(self, context):
        scene, camera = context.scene, flexible_camera_of(context)
        if (rig := rig_of(scene)) is not None:
            switch_off(rig)
        keep(scene, "camera")
        keep(scene.render, "engine")
        scene.render.engine = ENGINE
        if camera is not None and camera_behind(scene.camera) != camera and camera.name in scene.objects:
            scene.camera = camera
        return "F12 renders the flexible camera's picture with Flexible Projection"


class SCFPF_OT_engine_warn(ModalJob, bpy.types.Operator):
    """Report that the render that has begun ignores the flexible camera"""

    bl_idname = "scfpf.engine_warn"
    bl_label = "Flexible Camera Ignored"
    bl_options = {"INTERNAL"}

    # Until the warning is reported.
    seconds = 0.1
    escapes = frozenset()

    message: bpy.props.StringProperty(
        name="Message", description="The warning to report", options={"SKIP_SAVE"}
    )

    def execute(self, _context):
        self.report({"WARNING"}, self.message)
        return {"FINISHED"}

    def invoke(self, context, _event):
        # Blender shows the report of an operator called by a script only if the operator ends later.
        return self.begin(context)

    def respond(self, _context, _event):
        return {"PASS_THROUGH"}

    def tick(self, context):
        return self.execute(context)


def _look() -> float:
    """Report the queued warnings; a timer of the main thread."""
    windows = bpy.context.window_manager.windows
    while warnings and windows:
        with bpy.context.temp_override(window=windows[0]):
            bpy.ops.scfpf.engine_warn("INVOKE_DEFAULT", message=warnings.popleft())
    return LOOK


_register_classes, _unregister_classes = bpy.utils.register_classes_factory(
    (SCFPF_OT_engine_use, SCFPF_OT_engine_warn)
)


def register():
    _register_classes()
    if not bpy.app.background:
        bpy.app.timers.register(_look, persistent=True)


def unregister():
    if bpy.app.timers.is_registered(_look):
        bpy.app.timers.unregister(_look)
    _unregister_classes()
