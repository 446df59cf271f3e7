# SPDX-License-Identifier: GPL-3.0-or-later
"""The stack of image mappings: add, remove, move and place them, and write them as an ST map."""

import bpy
from bpy.props import BoolProperty, EnumProperty

from ...scfpf_addon.bridge.blender.slot_animation import MAPPINGS, move_slot
from ...scfpf_addon.bridge.blender.unstored_edits import note_edit
from ...scfpf_addon.bridge.camera.read_projection import read_projection
from ...scfpf_addon.bridge.mappings import mapping_edits
from ...scfpf_addon.bridge.mappings.st_map_image import CONTENTS, write_st_map
from ...scfpf_addon.bridge.render.image_size import image_aspect, image_size
from ...scfpf_addon.bridge.settings.mapping_properties import MAPPING_KINDS
from ...scfpf_addon.projection.user_error import UserError
from ..common.target import flexible_camera_of, poll_flexible_camera, poll_flexible_camera_in_any_mode
from ..common.tool import STEPS, Tool, select_only, tooltip_of
from ..common.words import report_text, translated_report
from ..image.image_click import ImageClick

MAPPING_NAMES = {kind: name for kind, name, _ in MAPPING_KINDS}


def active_mapping(camera):
    """The mapping selected in a camera's list, or None."""
    settings = camera.scfpf
    chosen = settings.active_mapping
    return settings.mappings[chosen] if chosen < len(settings.mappings) else None


def _poll_mapping(cls, context) -> bool:
    if not poll_flexible_camera(cls, context):
        return False
    if active_mapping(flexible_camera_of(context)) is None:
        cls.poll_message_set("The stack has no mapping: add one")
        return False
    return True


class SCFPF_OT_mapping_add(Tool, bpy.types.Operator):
    """Add a mapping of the picture at the end of the stack"""

    bl_idname = "scfpf.mapping_add"
    bl_label = "Add Image Mapping"

    kind: EnumProperty(
        name="Kind", description="How the mapping moves positions in the picture", items=MAPPING_KINDS
    )

    @classmethod
    def description(cls, _context, properties):
        return tooltip_of(cls, MAPPING_KINDS, properties.kind)

    def edit(self, _context, camera):
        mapping_edits.add_mapping(camera, self.kind, MAPPING_NAMES[self.kind])


class SCFPF_OT_mapping_remove(Tool, bpy.types.Operator):
    """Remove the selected mapping from the stack"""

    bl_idname = "scfpf.mapping_remove"
    bl_label = "Remove Image Mapping"

    poll = classmethod(_poll_mapping)

    def edit(self, _context, camera):
        mapping_edits.remove_mapping(camera, camera.scfpf.active_mapping)


class SCFPF_OT_mapping_move(Tool, bpy.types.Operator):
    """Move the selected mapping towards the picture or away from it"""

    bl_idname = "scfpf.mapping_move"
    bl_label = "Move Image Mapping"

    direction: EnumProperty(
        name="Direction",
        description="Direction in the stack",
        items=(("UP", "Up", "Nearer to the picture"), ("DOWN", "Down", "Nearer to the volume")),
    )

    poll = classmethod(_poll_mapping)

    def edit(self, _context, camera):
        settings = camera.scfpf
        place = settings.active_mapping + STEPS[self.direction]
        move_slot(settings, settings.active_mapping, place, MAPPINGS)


class SCFPF_OT_mapping_grid_select(Tool, bpy.types.Operator):
    """Select the mesh of this grid, to be edited with Tab or deformed with modifiers"""

    bl_idname = "scfpf.mapping_grid_select"
    bl_label = "Select Grid"

    poll = classmethod(_poll_mapping)

    def edit(self, context, camera):
        grid = active_mapping(camera).grid
        if grid is None or grid.name not in context.view_layer.objects:
            raise UserError("The grid is not in this view layer: choose another mesh, or add a new mapping")
        grid.hide_set(False)
        select_only(context, grid)


class SCFPF_OT_mapping_place(ImageClick, bpy.types.Operator):
    """Click in the picture: the selected mapping gets its center there"""

    bl_idname = "scfpf.mapping_place"
    bl_label = "Place on Picture"
    bl_options = {"REGISTER", "UNDO"}
    cursor, hint = "CROSSHAIR", "Click to place the mapping's center"

    poll = classmethod(_poll_mapping)

    def execute(self, context):
        note_edit()
        active_mapping(flexible_camera_of(context)).centre = self.x, self.y
        return {"FINISHED"}


class SCFPF_OT_st_map_write(Tool, bpy.types.Operator):
    """Write the mappings into an image: an ST map of the render's resolution for compositing programs, to
    be saved as OpenEXR"""

    bl_idname = "scfpf.st_map_write"
    bl_label = "Write ST Map"

    content: EnumProperty(
        name="Content", description="Content of each pixel of the map", items=CONTENTS, default="MAPPINGS"
    )
    inverse: BoolProperty(
        name="Inverse",
        description="Write the inverse map, which removes the mappings from a picture",
        default=False,
    )

    poll = classmethod(poll_flexible_camera_in_any_mode)

    def edit(self, context, camera):
        scene = context.scene
        projection = read_projection(camera, context.evaluated_depsgraph_get(), image_aspect(scene))
        image, warning = write_st_map(projection, image_size(scene), self.content, self.inverse)
        for area in context.screen.areas if context.screen else ():
            if area.ui_type == "IMAGE_EDITOR":
                area.spaces.active.image = image
                break
        if warning:
            self.report({"WARNING"}, translated_report(warning))
        return report_text(
            "The ST map is the image '{0}': save it with Image > Save As, or read it with a mapping",
            image.name,
        )


register, unregister = bpy.utils.register_classes_factory(
    (
        SCFPF_OT_mapping_add,
        SCFPF_OT_mapping_remove,
        SCFPF_OT_mapping_move,
        SCFPF_OT_mapping_grid_select,
        SCFPF_OT_mapping_place,
        SCFPF_OT_st_map_write,
    )
)
