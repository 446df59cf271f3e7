# SPDX-License-Identifier: GPL-3.0-or-later
"""Cycles' path tracing along the projectors of a flexible camera."""

import bpy

from ..scfpf_addon.cycles import rig as rigs
from ..scfpf_addon.cycles.rig_data import rig_of
from .errors import BAD_INPUT, refused
from .target import camera_of, poll_flexible_camera


class SCFPF_OT_cycles_rig(bpy.types.Operator):
    """Let F12 render what the flexible camera sees with Cycles; press again to restore the scene"""

    bl_idname = "scfpf.cycles_rig"
    bl_label = "Render with Cycles"
    bl_options = {"REGISTER", "UNDO"}

    poll = classmethod(poll_flexible_camera)

    def execute(self, context):
        camera = camera_of(context)
        rig = rig_of(context.scene)
        if rig is not None and rig.scfpf_rig.camera == camera:
            rigs.switch_off(rig)
            return {"FINISHED"}
        try:
            rig = rigs.switch_on(context, camera)
        except BAD_INPUT as error:
            return refused(self, error)
        for caution in rigs.cautions(context.scene, context.view_layer, rig):
            self.report({"WARNING"}, caution)
        self.report({"INFO"}, "Press F12: Cycles follows the projectors of " + camera.name)
        return {"FINISHED"}


class SCFPF_OT_cycles_rig_update(bpy.types.Operator):
    """Choose new chords, for all frames of an animated volume"""

    bl_idname = "scfpf.cycles_rig_update"
    bl_label = "Update Chords"
    bl_options = {"REGISTER", "UNDO"}

    @classmethod
    def poll(cls, context):
        if rig_of(context.scene) is None:
            cls.poll_message_set("Switch on Render with Cycles first")
            return False
        return True

    def execute(self, context):
        try:
            rigs.update(context, rig_of(context.scene))
        except BAD_INPUT as error:
            return refused(self, error)
        return {"FINISHED"}


class SCFPF_OT_cycles_passes(bpy.types.Operator):
    """Give the compositor passes of t, depth along the projectors, and (u, v, t); press again to remove
    them"""

    bl_idname = "scfpf.cycles_passes"
    bl_label = "t, Depth, (u, v, t) Passes"
    bl_options = {"REGISTER", "UNDO"}

    poll = SCFPF_OT_cycles_rig_update.poll

    def execute(self, context):
        rig = rig_of(context.scene)
        try:
            rigs.set_passes(rig, not rig.scfpf_rig.passes)
        except BAD_INPUT as error:
            return refused(self, error)
        if rig.scfpf_rig.passes:
            self.report({"INFO"}, "Link the outputs of the compositor's node SCFPF Passes")
        return {"FINISHED"}


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
            cls.poll_message_set("Switch on Render with Cycles first")
            return False
        return True

    def invoke(self, context, _event):
        bpy.ops.render.render("INVOKE_DEFAULT", animation=self.animation, use_viewport=False)
        return {"FINISHED"}


CLASSES = (
    SCFPF_OT_cycles_rig,
    SCFPF_OT_cycles_rig_update,
    SCFPF_OT_cycles_passes,
    SCFPF_OT_cycles_render,
)
# Blender's own F12 takes the local camera of a viewport that the mouse is over, which is the flexible one.
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
