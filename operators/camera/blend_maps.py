# SPDX-License-Identifier: GPL-3.0-or-later
"""The maps of a blend: where in the image each of its cameras counts, and keyframes of that."""

import bpy
import numpy as np
from bpy.props import EnumProperty, IntProperty

from ...scfpf_addon.bridge.aim.kept_volume import volume_kept
from ...scfpf_addon.bridge.blender.scene_objects import object_by_uid
from ...scfpf_addon.bridge.blends.blend_bake import bake_map
from ...scfpf_addon.bridge.blends.blend_ends import ends_of, is_map_animated
from ...scfpf_addon.bridge.render.image_size import image_aspect
from ...scfpf_addon.bridge.settings.blend_properties import MAP_KINDS
from ...scfpf_addon.projection.user_error import UserError
from ...scfpf_addon.shading.picking.find import find, points_of
from ..common.target import flexible_camera_of
from ..common.tool import Tool
from ..common.words import report_text
from ..image.find import wanted_objects
from ..image.preparation import poll_no_render, prepared_inputs
from .blend import SCFPF_OT_blend_update, flexible_end, updated


def end_number():
    """The property by which operators take a camera of a blend."""
    return IntProperty(
        name="Camera Number",
        description="Number of the camera in the blend whose map it is; 2 is the second one",
        default=2,
        min=2,
        options={"SKIP_SAVE"},
    )


def _map_of(camera, number: int):
    """The settings of the map of a blend's camera. Raises UserError."""
    for end in ends_of(camera):
        if end.number == number:
            return end.settings
    raise UserError("The blend '{0}' has no camera {1}: choose another one", camera.name, number)


class SCFPF_OT_blend_map(Tool, bpy.types.Operator):
    """Choose where in the picture a camera of the blend counts, and update the blend"""

    bl_idname = "scfpf.blend_map"
    bl_label = "Blend Map"

    kind: EnumProperty(
        name="Blend Map", description="Where in the picture the camera counts", items=MAP_KINDS
    )
    number: end_number()

    poll = SCFPF_OT_blend_update.poll

    def edit(self, context, camera):
        settings, blend_map = camera.scfpf, _map_of(camera, self.number)
        with volume_kept(camera):
            if blend_map.kind == "NONE" and settings.blend_factor == 0.0:
                settings.blend_factor = 1.0  # else the map would show nothing
            blend_map.kind = self.kind
            return updated(context, camera)


class SCFPF_OT_blend_map_bake(Tool, bpy.types.Operator):
    """Write the keyframes of the map into shapes that drivers mix, so that pictures follow them"""

    bl_idname = "scfpf.blend_map_bake"
    bl_label = "Bake Map"

    start: IntProperty(name="Start", description="First frame; 0 is the scene's", default=0, min=0)
    end: IntProperty(name="End", description="Last frame; 0 is the scene's", default=0, min=0)

    @classmethod
    def poll(cls, context):
        if not SCFPF_OT_blend_update.poll.__func__(cls, context) or not poll_no_render(cls, context):
            return False
        if not is_map_animated(flexible_camera_of(context)):
            cls.poll_message_set("The map has no keyframes: insert some on its center, size, angle or border")
            return False
        return True

    def edit(self, context, camera):
        scene = context.scene
        with volume_kept(camera):
            updated(context, camera)
            kept = bake_map(camera, scene, self.start or scene.frame_start, self.end or scene.frame_end)
            return report_text("The map is baked into {0} shapes of each surface", kept)


class SCFPF_OT_blend_map_around(Tool, bpy.types.Operator):
    """Put the map's circle or rectangle around the selected objects, as the first camera sees them"""

    bl_idname = "scfpf.blend_map_around"
    bl_label = "Map around Selection"

    number: end_number()

    @classmethod
    def poll(cls, context):
        if not SCFPF_OT_blend_update.poll.__func__(cls, context) or not poll_no_render(cls, context):
            return False
        if not wanted_objects(context):
            cls.poll_message_set("Select the objects as well, the camera last")
            return False
        return True

    def edit(self, context, camera):
        uid, _ = camera.session_uid, _map_of(camera, self.number)
        first = flexible_end(context, camera, camera.scfpf.blend_ends.first)
        name = first.name
        left, low, right, high = _seen_box(context, first)
        camera = object_by_uid(uid)
        blend_map = _map_of(camera, self.number)
        with volume_kept(camera):
            if blend_map.kind not in ("RADIAL", "RECTANGLE"):
                blend_map.kind = "RADIAL"
            blend_map.center, blend_map.angle = ((left + right) / 2, (low + high) / 2), 0.0
            aspect, border = image_aspect(context.scene), blend_map.border
            # Half of the border is inside.
            if blend_map.kind == "RECTANGLE":
                blend_map.size = right - left + border, high - low + border * aspect
            else:
                blend_map.size[0] = float(np.hypot(right - left, (high - low) / aspect)) + border
            updated(context, camera)
            return report_text("The map is around the selection as '{0}' sees it", name)


def _seen_box(context, camera) -> tuple[float, float, float, float]:
    """The borders of the selected objects in a camera's image. Raises USER_ERRORS."""
    names = {obj.name for obj in wanted_objects(context)}
    title = camera.name
    inputs = prepared_inputs(context, camera)
    points = points_of(inputs.scene, names)
    if not points.size:
        raise UserError("Renders show no faces of the selected objects: select others")
    pixel = 1 / inputs.settings.width, 1 / inputs.settings.height
    found = find(inputs.projection, inputs.scene, points, names, pixel)
    if found is None:
        raise UserError("'{0}' does not see the selected objects: select others, or turn it", title)
    return found.box


register, unregister = bpy.utils.register_classes_factory(
    (SCFPF_OT_blend_map, SCFPF_OT_blend_map_around, SCFPF_OT_blend_map_bake)
)
