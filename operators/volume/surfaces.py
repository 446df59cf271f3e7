# SPDX-License-Identifier: GPL-3.0-or-later
"""The list of control surfaces: add, attach, remove, reorder and select them, and the mode Edit Volume."""

import bpy
from bpy.props import BoolProperty, EnumProperty, IntProperty

from ...scfpf_addon.bridge.blender.scene_objects import holds
from ...scfpf_addon.bridge.camera.flexible_camera import (
    add_surface,
    attach_surface,
    move_surface,
    remove_surface,
)
from ...scfpf_addon.bridge.surfaces.kinds import BLENDER_KINDS, KIND_ITEMS
from ...scfpf_addon.bridge.volume.edit_mode import set_edit_volume
from ...scfpf_addon.projection.user_error import UserError
from ..common.errors import refused
from ..common.target import (
    active_object,
    flexible_camera_of,
    poll_flexible_camera,
    poll_slot,
    selected_objects,
)
from ..common.tool import STEPS, Tool, select_only
from .surface_placement import surface_place


class SCFPF_OT_surface_add(Tool, bpy.types.Operator):
    """Add a control surface after the active one: between two where the things in the picture are, else
    halfway to the next"""

    bl_idname = "scfpf.surface_add"
    bl_label = "Add Control Surface"

    kind: EnumProperty(
        name="Kind", description="The shape of the new control surface", items=KIND_ITEMS, default="PLANE"
    )
    select: BoolProperty(
        name="Select",
        description="Enter the Edit Volume mode and select the new surface, ready to be moved",
        default=False,
    )

    @classmethod
    def description(cls, _context, properties):
        return f"{BLENDER_KINDS[properties.kind].record.text}. {cls.__doc__}"

    def edit(self, context, camera):
        settings = camera.scfpf
        index = min(settings.active_surface + 1, len(settings.surfaces))
        matrix, parameters, points = surface_place(
            camera, context.evaluated_depsgraph_get(), self.kind, index
        )
        surface = add_surface(
            camera, self.kind, matrix=matrix, parameters=parameters, points=points, index=index
        )
        settings.active_surface = index
        if self.select:
            set_edit_volume(camera, True)
            context.view_layer.update()
            if surface.name in context.view_layer.objects:
                select_only(context, surface)
                is_shown = context.area is not None and context.area.type == "PROPERTIES"
                if is_shown and holds(context.view_layer.objects, camera):
                    # The Data tab goes on showing the camera's panel, and G moves what is selected.
                    context.view_layer.objects.active = camera


class SCFPF_OT_surface_attach(Tool, bpy.types.Operator):
    """Append the selected mesh and surface objects to the camera's control surfaces, and enter the Edit
    Volume mode"""

    bl_idname = "scfpf.surface_attach"
    bl_label = "Use Selected as Control Surface"

    @classmethod
    def poll(cls, context):
        if not poll_flexible_camera(cls, context):
            return False
        if not _candidates(context):
            cls.poll_message_set("Select an object to use as a control surface too")
            return False
        return True

    def edit(self, context, camera):
        # Surfaces that are hidden with their camera are no longer selected once they are attached.
        candidates = _candidates(context)
        camera.scfpf.edit_volume = True
        errors = []
        for obj in candidates:
            try:
                attach_surface(camera, obj)
            except UserError as error:
                errors.append(error)
        if len(errors) == len(candidates):
            raise errors[-1]
        for error in errors:
            refused(self, error)
        camera.scfpf.active_surface = len(camera.scfpf.surfaces) - 1


def _candidates(context):
    camera = flexible_camera_of(context)
    return [obj for obj in selected_objects(context) if obj != camera]


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
        move_surface(camera, camera.scfpf.active_surface, STEPS[self.direction])


class SCFPF_OT_surface_select(Tool, bpy.types.Operator):
    """Select the control surface's object and make it active; enters the Edit Volume mode"""

    bl_idname = "scfpf.surface_select"
    bl_label = "Select Control Surface"

    index: IntProperty(
        name="Index",
        description="Place in the list; -1 is the active one",
        default=-1,
        min=-1,
        options={"SKIP_SAVE"},
    )

    poll = classmethod(poll_slot)

    def edit(self, context, camera):
        settings = camera.scfpf
        index = settings.active_surface if self.index < 0 else self.index
        surface = settings.surfaces[index].object if index < len(settings.surfaces) else None
        if surface is None or surface.name not in context.view_layer.objects:
            raise UserError("This control surface has no object in the view layer: remove it from the list")
        if not surface.visible_get():
            raise UserError("{0} is hidden: show it in the Outliner to select it", surface.name)
        if surface.hide_select:
            set_edit_volume(camera, True)
        context.view_layer.update()
        settings.active_surface = index
        select_only(context, surface)


class SCFPF_OT_edit_volume(Tool, bpy.types.Operator):
    """Show this camera's control surfaces in front of the scene and make them selectable, until you press
    again"""

    bl_idname = "scfpf.edit_volume"
    bl_label = "Edit Volume"

    poll = classmethod(poll_slot)

    def edit(self, context, camera):
        settings = camera.scfpf
        set_edit_volume(camera, not settings.edit_volume)
        surfaces = {slot.object for slot in settings.surfaces} - {None}
        if not settings.edit_volume and active_object(context) in surfaces:
            # A surface that cannot be clicked is deselected; the active camera keeps its panels visible.
            active_object(context).select_set(False)
            if holds(context.view_layer.objects, camera):
                context.view_layer.objects.active = camera
                camera.select_set(True)


register, unregister = bpy.utils.register_classes_factory(
    (
        SCFPF_OT_surface_add,
        SCFPF_OT_surface_attach,
        SCFPF_OT_surface_remove,
        SCFPF_OT_surface_move,
        SCFPF_OT_surface_select,
        SCFPF_OT_edit_volume,
    )
)
