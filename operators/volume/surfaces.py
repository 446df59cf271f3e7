# SPDX-License-Identifier: GPL-3.0-or-later
"""The control surfaces of a flexible camera: add, attach, remove, reorder, select."""

import bpy
from bpy.props import EnumProperty, IntProperty

from ...scfpf_addon.bridge.camera.flexible_camera import (
    add_surface,
    attach_surface,
    move_surface,
    remove_surface,
)
from ...scfpf_addon.bridge.surfaces.kinds import BLENDER_KINDS, KIND_ITEMS
from ...scfpf_addon.bridge.volume.edit_mode import set_edit_volume
from ..common.errors import BAD_INPUT, refused
from ..common.local_view import show_in_local_view
from ..common.placement import surface_place
from ..common.target import flexible_camera_of, poll_flexible_camera
from ..common.tool import Tool


def poll_slot(cls, context):
    if not poll_flexible_camera(cls, context):
        return False
    settings = flexible_camera_of(context).scfpf
    if settings.active_surface >= len(settings.surfaces):
        cls.poll_message_set("Choose a control surface in the camera's list first")
        return False
    return True


class SCFPF_OT_surface_add(bpy.types.Operator):
    """Add a control surface after the active one, halfway to the next"""

    bl_idname = "scfpf.surface_add"
    bl_label = "Add Control Surface"
    bl_options = {"REGISTER", "UNDO"}

    kind: EnumProperty(
        name="Kind", description="The shape of the new control surface", items=KIND_ITEMS, default="PLANE"
    )

    poll = classmethod(poll_flexible_camera)

    @classmethod
    def description(cls, _context, properties):
        return f"{BLENDER_KINDS[properties.kind].record.text}. {cls.__doc__}"

    def execute(self, context):
        camera = flexible_camera_of(context)
        settings = camera.scfpf
        index = min(settings.active_surface + 1, len(settings.surfaces))
        try:
            matrix, parameters, points = surface_place(
                camera, context.evaluated_depsgraph_get(), self.kind, index
            )
            surface = add_surface(
                camera, self.kind, matrix=matrix, parameters=parameters, points=points, index=index
            )
        except BAD_INPUT as error:
            return refused(self, error)
        settings.active_surface = index
        show_in_local_view(context, [surface])
        return {"FINISHED"}


class SCFPF_OT_surface_attach(bpy.types.Operator):
    """Append the selected mesh and surface objects to the camera's control surfaces.

    They stay selected: the camera enters the Edit Volume mode"""

    bl_idname = "scfpf.surface_attach"
    bl_label = "Use Selected as Control Surface"
    bl_options = {"REGISTER", "UNDO"}

    @classmethod
    def poll(cls, context):
        if not poll_flexible_camera(cls, context):
            return False
        if not _candidates(context):
            cls.poll_message_set("Select an object to use as a control surface too")
            return False
        return True

    def execute(self, context):
        camera = flexible_camera_of(context)
        before = camera.scfpf.edit_volume
        camera.scfpf.edit_volume = True
        attached = 0
        for obj in _candidates(context):
            try:
                attach_surface(camera, obj)
            except BAD_INPUT as error:
                refused(self, error)
            else:
                attached += 1
        if attached == 0:
            camera.scfpf.edit_volume = before
            return {"CANCELLED"}
        camera.scfpf.active_surface = len(camera.scfpf.surfaces) - 1
        return {"FINISHED"}


def _candidates(context):
    camera = flexible_camera_of(context)
    return [obj for obj in context.selected_objects if obj != camera]


class SCFPF_OT_surface_remove(Tool, bpy.types.Operator):
    """Remove the active control surface from the camera"""

    bl_idname = "scfpf.surface_remove"
    bl_label = "Remove Control Surface"

    poll = classmethod(poll_slot)

    def edit(self, _context, camera):
        remove_surface(camera, camera.scfpf.active_surface)


class SCFPF_OT_surface_move(Tool, bpy.types.Operator):
    """Move the active control surface nearer to the eye, or farther"""

    bl_idname = "scfpf.surface_move"
    bl_label = "Move Control Surface"

    direction: EnumProperty(
        name="Direction",
        description="Direction in the list",
        items=(
            ("UP", "Up", "Towards the near end of the volume"),
            ("DOWN", "Down", "Towards the far end of the volume"),
        ),
        default="UP",
    )

    poll = classmethod(poll_slot)

    def edit(self, _context, camera):
        move_surface(camera, camera.scfpf.active_surface, -1 if self.direction == "UP" else 1)


class SCFPF_OT_surface_select(bpy.types.Operator):
    """Select the control surface's object and make it active; enters the Edit Volume mode"""

    bl_idname = "scfpf.surface_select"
    bl_label = "Select Control Surface"
    bl_options = {"REGISTER", "UNDO"}

    index: IntProperty(
        name="Index",
        description="Place in the list; -1 is the active one",
        default=-1,
        min=-1,
        options={"SKIP_SAVE"},
    )

    poll = classmethod(poll_slot)

    def execute(self, context):
        camera = flexible_camera_of(context)
        settings = camera.scfpf
        index = settings.active_surface if self.index < 0 else self.index
        surface = settings.surfaces[index].object if index < len(settings.surfaces) else None
        if surface is None or surface.name not in context.view_layer.objects:
            self.report(
                {"ERROR"}, "This control surface has no object in the view layer: remove it from the list"
            )
            return {"CANCELLED"}
        if not surface.visible_get():
            self.report({"ERROR"}, f"{surface.name} is hidden: show it in the Outliner to select it")
            return {"CANCELLED"}
        try:
            if surface.hide_select:
                set_edit_volume(camera, True)
        except BAD_INPUT as error:
            return refused(self, error)
        context.view_layer.update()
        settings.active_surface = index
        for obj in context.selected_objects:
            obj.select_set(False)
        surface.select_set(True)
        context.view_layer.objects.active = surface
        return {"FINISHED"}


register, unregister = bpy.utils.register_classes_factory(
    (
        SCFPF_OT_surface_add,
        SCFPF_OT_surface_attach,
        SCFPF_OT_surface_remove,
        SCFPF_OT_surface_move,
        SCFPF_OT_surface_select,
    )
)
