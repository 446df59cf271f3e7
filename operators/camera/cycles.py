# SPDX-License-Identifier: GPL-3.0-or-later
"""The Cycles rig of a flexible camera: set it up, update it, add its passes, render through it."""

import bpy

from ...scfpf_addon.bridge.blender.all_or_nothing import all_or_nothing
from ...scfpf_addon.bridge.blender.unstored_edits import note_edit
from ...scfpf_addon.bridge.blender.user_errors import USER_ERRORS
from ...scfpf_addon.cycles import rig as rigs
from ...scfpf_addon.cycles.cautions import cautions
from ...scfpf_addon.cycles.chord_planning import Planning, planned
from ...scfpf_addon.cycles.rig_data import rig_of
from ..common.errors import failed, refused
from ..common.modal_job import NOTHING_CHANGED, ModalJob, in_window
from ..common.target import camera_of, poll_flexible_camera
from ..common.tool import Action
from ..common.words import report_text, translated_report

SET_UP_FIRST = "Press Cycles in the panel of the camera first"


class _Planned(ModalJob):
    """An operator that plans chords, which takes seconds: step by step in a window, at once for scripts."""

    # Between two steps, in which Blender shows the progress and handles the Esc key.
    seconds = 0.01
    canceled = NOTHING_CHANGED

    def planned_camera(self, context):
        """The camera to plan for, or None to call ``finish`` without a plan."""
        raise NotImplementedError

    def finish(self, context, camera, plan):
        """Apply the plan, as ``Planning.plan`` returns it, or None without a camera."""
        raise NotImplementedError

    def execute(self, context):
        note_edit()
        try:
            camera = self.planned_camera(context)
            with all_or_nothing():
                return self.finish(context, camera, None if camera is None else planned(context, camera))
        except USER_ERRORS as error:
            return refused(self, error)
        except Exception as error:
            return failed(self, error)

    def invoke(self, context, _event):
        try:
            camera = self.planned_camera(context)
            if camera is None or not in_window(context):
                return self.execute(context)
            self._planning = Planning(context, camera)
        except USER_ERRORS as error:
            return refused(self, error)
        except Exception as error:
            return failed(self, error)
        outcome = self.begin(context)
        self._show_progress(context)
        return outcome

    def tick(self, context):
        more = self._planning.step(context)
        self._show_progress(context)
        if more:
            return {"RUNNING_MODAL"}
        # A modal operator's context lacks the camera of the button's panel.
        camera = self._planning.camera(context)
        return self.finish(context, camera, self._planning.plan(context))

    def give_up(self, _context):
        """End the planning; nothing was changed."""
        self._planning.give_up()

    def abandon(self, _context):
        """A timer restores the frame if the file stays open."""
        bpy.app.timers.register(self._planning.give_up, first_interval=0.0)

    def _show_progress(self, context) -> None:
        text = report_text("{0}: {1}    Esc: cancel", self.bl_label, self._planning.text)
        self.show(context, text, self._planning.progress)


class SCFPF_OT_cycles_rig(_Planned, bpy.types.Operator):
    """Set the scene up so that F12 renders the flexible camera's picture with Cycles, or remove this setup
    (the camera's own motion is not blurred; instead of Depth and Mist use the passes of t and depth)"""

    bl_idname = "scfpf.cycles_rig"
    bl_label = "Set Up Cycles"
    bl_options = {"REGISTER", "UNDO"}

    poll = classmethod(poll_flexible_camera)

    def planned_camera(self, context):
        camera, rig = camera_of(context), rig_of(context.scene)
        return None if rig is not None and rig.scfpf_rig.camera == camera else camera

    def finish(self, context, camera, plan):
        if plan is None:
            rigs.switch_off(rig_of(context.scene))
            return {"FINISHED"}
        with rigs.switched_on(context, camera, plan) as rig:
            texts = [
                translated_report(caution) for caution in cautions(context.scene, context.view_layer, rig)
            ]
        for text in texts:
            self.report({"WARNING"}, text)
        self.report({"INFO"}, "Press F12: Cycles follows the projectors of " + camera.name)
        return {"FINISHED"}


class SCFPF_OT_cycles_rig_update(_Planned, bpy.types.Operator):
    """Choose new chords, for all frames of an animated volume"""

    bl_idname = "scfpf.cycles_rig_update"
    bl_label = "Update Chords"
    bl_options = {"REGISTER", "UNDO"}

    @classmethod
    def poll(cls, context):
        if rig_of(context.scene) is None:
            cls.poll_message_set(SET_UP_FIRST)
            return False
        return True

    def planned_camera(self, context):
        return rig_of(context.scene).scfpf_rig.camera

    def finish(self, context, _camera, plan):
        rigs.update(context, rig_of(context.scene), plan)
        return {"FINISHED"}


class SCFPF_OT_cycles_passes(Action, bpy.types.Operator):
    """Add or remove the compositor's passes t, Depth, (u, v, t) and Mist; a line tells what Depth measures"""

    bl_idname = "scfpf.cycles_passes"
    bl_label = "t, Depth, (u, v, t) Passes"

    poll = SCFPF_OT_cycles_rig_update.poll

    def act(self, context):
        rig = rig_of(context.scene)
        rigs.set_passes(rig, not rig.scfpf_rig.passes)
        return "Link the outputs of the compositor's node SCFPF Passes" if rig.scfpf_rig.passes else None


class SCFPF_OT_cycles_render(bpy.types.Operator):
    """Render through the Cycles rig, also if the viewport under the mouse looks through another camera"""

    bl_idname = "scfpf.cycles_render"
    bl_label = "Render through the Rig"

    animation: bpy.props.BoolProperty(
        name="Animation",
        description="Render all frames of the scene's range",
        default=False,
        options={"SKIP_SAVE"},
    )

    @classmethod
    def poll(cls, context):
        rig = rig_of(context.scene)
        if rig is None or rig.scfpf_rig.view_camera != context.scene.camera:
            cls.poll_message_set(SET_UP_FIRST)
            return False
        return True

    def invoke(self, context, _event):
        rigs.prepare_render(context, rig_of(context.scene), self.animation)
        bpy.ops.render.render("INVOKE_DEFAULT", animation=self.animation, use_viewport=False)
        return {"FINISHED"}


CLASSES = (
    SCFPF_OT_cycles_rig,
    SCFPF_OT_cycles_rig_update,
    SCFPF_OT_cycles_passes,
    SCFPF_OT_cycles_render,
)
# Blender's own F12 uses the local camera of the viewport under the mouse, which is the flexible one.
KEYS = {False: {}, True: {"ctrl": True}}
KEYMAP = "Screen"


def register():
    for cls in CLASSES:
        bpy.utils.register_class(cls)
    configuration = bpy.context.window_manager.keyconfigs.addon
    if configuration is None:  # in the background there are no keys
        return
    items = configuration.keymaps.new(name=KEYMAP, space_type="EMPTY").keymap_items
    for animation, held in KEYS.items():
        item = items.new(SCFPF_OT_cycles_render.bl_idname, "F12", "PRESS", head=True, **held)
        item.properties.animation = animation


def unregister():
    configuration = bpy.context.window_manager.keyconfigs.addon
    keymap = configuration.keymaps.get(KEYMAP) if configuration is not None else None
    for item in list(keymap.keymap_items) if keymap is not None else ():
        if item.idname == SCFPF_OT_cycles_render.bl_idname:
            keymap.keymap_items.remove(item)
    for cls in reversed(CLASSES):
        bpy.utils.unregister_class(cls)
