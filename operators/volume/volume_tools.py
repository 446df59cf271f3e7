# SPDX-License-Identifier: GPL-3.0-or-later
"""Tools for a whole volume and the order, place and users of its control surfaces."""

import bpy
from bpy.props import BoolProperty, EnumProperty, IntProperty

from ...scfpf_addon.bridge.camera import volume_edits
from ...scfpf_addon.bridge.camera.surface_mirror import mirror_surfaces
from ...scfpf_addon.bridge.camera.volume_fit import fit_to_image, fit_volume
from ...scfpf_addon.bridge.render.image_size import image_aspect
from ...scfpf_addon.projection.user_error import UserError
from ..common.scene_box import is_thing, scene_boxes
from ..common.target import (
    active_object,
    active_slot,
    flexible_camera_of,
    poll_slot,
    poll_volume,
    selected_objects,
)
from ..common.tool import Tool
from ..common.words import report_text


class SCFPF_OT_surface_insert(Tool, bpy.types.Operator):
    """Insert a control surface without changing the volume at this frame; unless projectors are polylines,
    the inner ones are replaced and lose their animation"""

    bl_idname = "scfpf.surface_insert"
    bl_label = "Insert Control Surface"

    resolution: IntProperty(
        name="Resolution",
        description="Faces along u and v of the new grid, if its neighbors are of different kinds",
        default=64,
        min=1,
        max=512,
    )

    poll = classmethod(poll_volume)

    def edit(self, context, camera):
        exact = volume_edits.insert_surface(
            camera,
            context.evaluated_depsgraph_get(),
            image_aspect(context.scene),
            camera.scfpf.active_surface,
            self.resolution,
        )
        if exact:
            return None
        return report_text(
            "Its neighbors are of different kinds: the new surface is a grid of {0} × {0}", self.resolution
        )


class SCFPF_OT_surface_duplicate(Tool, bpy.types.Operator):
    """Put a copy of the active control surface after it, at the same place"""

    bl_idname = "scfpf.surface_duplicate"
    bl_label = "Duplicate Control Surface"

    poll = classmethod(poll_slot)

    def edit(self, context, camera):
        volume_edits.duplicate_surface(camera, camera.scfpf.active_surface)


class SCFPF_OT_volume_swap(Tool, bpy.types.Operator):
    """Reverse the order of the control surfaces: the near one becomes the far one"""

    bl_idname = "scfpf.volume_swap"
    bl_label = "Swap Near and Far"

    poll = classmethod(poll_volume)

    def edit(self, context, camera):
        volume_edits.swap_ends(camera)


class SCFPF_OT_volume_mirror(Tool, bpy.types.Operator):
    """Mirror the picture by mirroring the control surfaces' parameter u or v; their shape stays"""

    bl_idname = "scfpf.volume_mirror"
    bl_label = "Mirror"

    axis: EnumProperty(
        name="Axis",
        description="The parameter to mirror",
        items=(("U", "U", "Exchange left and right"), ("V", "V", "Exchange top and bottom")),
        default="U",
    )
    only_active: BoolProperty(
        name="Active Surface Only",
        description="Mirror the active control surface alone; the projectors then cross over",
        default=False,
    )

    poll = classmethod(poll_slot)

    def edit(self, context, camera):
        indices = [camera.scfpf.active_surface] if self.only_active else None
        mirror_surfaces(camera, context.evaluated_depsgraph_get(), self.axis, indices)


class SCFPF_OT_surface_snap_to_view(Tool, bpy.types.Operator):
    """Move the near surface into the 3D viewport's view with its size: a plane fills the view, a round
    surface surrounds the viewpoint"""

    bl_idname = "scfpf.surface_snap_to_view"
    bl_label = "Near Surface to View"

    @classmethod
    def poll(cls, context):
        if not poll_slot(cls, context):
            return False
        if context.area is None or context.area.type != "VIEW_3D" or context.region_data is None:
            cls.poll_message_set("This works in a 3D viewport only: press it in the sidebar")
            return False
        return True

    def edit(self, context, camera):
        view = context.region_data
        window = view.window_matrix
        context.evaluated_depsgraph_get()  # updates the matrices of surfaces that were moved
        half_width = min(1 / window[0][0], image_aspect(context.scene) / window[1][1])
        # The last row of a perspective window matrix divides by depth.
        parallel = window[3][3] != 0
        seen = volume_edits.ViewportView(view.view_matrix.inverted(), half_width, parallel)
        volume_edits.snap_near_to_view(camera, seen)


class SCFPF_OT_surface_align(Tool, bpy.types.Operator):
    """Move and turn the active control surface of the list to match the active object"""

    bl_idname = "scfpf.surface_align"
    bl_label = "Align to Active Object"

    location: BoolProperty(name="Location", description="Copy the object's location", default=True)
    rotation: BoolProperty(name="Rotation", description="Copy the object's rotation", default=True)

    @classmethod
    def poll(cls, context):
        if not poll_slot(cls, context):
            return False
        camera = flexible_camera_of(context)
        if active_object(context) in (None, active_slot(camera).object, camera):
            cls.poll_message_set("Select the object to align to: it must be the active one")
            return False
        return True

    def edit(self, context, camera):
        index = camera.scfpf.active_surface
        context.evaluated_depsgraph_get()  # updates the matrices of objects that were moved
        volume_edits.align_surface(camera, index, active_object(context), self.location, self.rotation)


class SCFPF_OT_volume_single_user(Tool, bpy.types.Operator):
    """Give this camera control surfaces and meshes of its own, which no other camera or object uses"""

    bl_idname = "scfpf.volume_single_user"
    bl_label = "Make Surfaces Single-User"

    poll = classmethod(poll_slot)

    def edit(self, context, camera):
        copied = volume_edits.make_single_user(camera)
        return report_text("{0} copied", copied) if copied else "No control surface was shared"


class SCFPF_OT_volume_fit(Tool, bpy.types.Operator):
    """Scale the volume and move the camera so that the volume just encloses the selection"""

    bl_idname = "scfpf.volume_fit"
    bl_label = "Fit Volume Around Selection"

    @classmethod
    def poll(cls, context):
        if not poll_volume(cls, context):
            return False
        if not any(is_thing(obj) and obj.scfpf_surface.kind == "NONE" for obj in selected_objects(context)):
            cls.poll_message_set("Select the objects to fit the volume around")
            return False
        return True

    def edit(self, context, camera):
        boxes = scene_boxes(context, selected_only=True)
        if boxes is None:
            raise UserError("The selected objects are disabled in renders: select others")
        aspect = image_aspect(context.scene)
        fit_volume(camera, context.evaluated_depsgraph_get(), aspect, boxes.whole.corners)


class SCFPF_OT_volume_fit_picture(Tool, bpy.types.Operator):
    """Fit the volume to the aspect of the resolution, so that nothing in the picture looks stretched"""

    bl_idname = "scfpf.volume_fit_picture"
    bl_label = "Fit to Resolution"

    def edit(self, context, camera):
        fit_to_image(camera, context.evaluated_depsgraph_get(), image_aspect(context.scene))


register, unregister = bpy.utils.register_classes_factory(
    (
        SCFPF_OT_surface_insert,
        SCFPF_OT_surface_duplicate,
        SCFPF_OT_volume_swap,
        SCFPF_OT_volume_mirror,
        SCFPF_OT_surface_snap_to_view,
        SCFPF_OT_surface_align,
        SCFPF_OT_volume_single_user,
        SCFPF_OT_volume_fit,
        SCFPF_OT_volume_fit_picture,
    )
)
