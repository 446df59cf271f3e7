# SPDX-License-Identifier: GPL-3.0-or-later
"""Add a pin by a click: on a thing in the picture, or in the scene."""

import bpy

from ...scfpf_addon.bridge.blender.scene_objects import object_by_uid
from ...scfpf_addon.bridge.blender.unstored_edits import note_edit
from ...scfpf_addon.bridge.blender.user_errors import USER_ERRORS
from ...scfpf_addon.bridge.frames.shown_image import shown_image
from ...scfpf_addon.bridge.render.render_viewport import free_view
from ...scfpf_addon.shading.picking.pick import pick
from ..common.errors import refused
from ..common.target import flexible_camera_of, poll_flexible_camera
from ..image.image_click import ImageClick
from ..image.preparation import poll_no_render, prepared_inputs

NOTHING_THERE = "There is nothing at that place: click on an object that renders show"


class SCFPF_OT_aim_pin_click(ImageClick, bpy.types.Operator):
    """Click on a thing, in the picture or in the scene: a pin holds that point, and its mark can be dragged
    in the picture"""

    bl_idname = "scfpf.aim_pin_click"
    bl_label = "Add Pin by Click"
    bl_options = {"UNDO"}
    without_mouse = None
    hint = "Click on a thing in the picture, in Live View or in a 3D viewport"

    # The point that was clicked in the scene, None after a click in the picture.
    _point = None

    @classmethod
    def poll(cls, context):
        return poll_flexible_camera(cls, context) and poll_no_render(cls, context)

    def invoke(self, context, _event):
        self._camera = flexible_camera_of(context).session_uid
        return self.wait(context)

    def position_at(self, context, x: int, y: int) -> tuple[float, float] | None:
        self._point = None
        for area in context.window.screen.areas:
            region = next((r for r in area.regions if r.type == "WINDOW"), None)
            if area.type not in {"VIEW_3D", "IMAGE_EDITOR"} or region is None:
                continue
            across, up = x - region.x, y - region.y
            if not (0 <= across < region.width and 0 <= up < region.height):
                continue
            with context.temp_override(area=area, region=region):
                return self._in_region(context, area, region, across + 0.5, up + 0.5)
        return None

    def _in_region(self, context, area, region, across: float, up: float) -> tuple[float, float] | None:
        """The position in the image that a region shows; in another 3D viewport the point is kept."""
        image = shown_image(context)
        if image is not None:
            left, bottom, width, height = image.rectangle
            place = (across - left) / width, (up - bottom) / height
            return place if all(0.0 <= share <= 1.0 for share in place) else None
        if area.type != "VIEW_3D":
            return None
        size = region.width, region.height
        camera = object_by_uid(self._camera)
        try:
            scene = prepared_inputs(context, camera).scene
            view = free_view(context.evaluated_depsgraph_get(), area.spaces.active.region_3d, scene, size)
            found = pick(view.projection, scene, across / size[0], up / size[1], (1 / size[0], 1 / size[1]))
        except USER_ERRORS as error:
            refused(self, error)
            return None
        if found is None or found.t is None:
            self.report({"WARNING"}, NOTHING_THERE)
            return None
        self._point = tuple(found.position)
        return 0.5, 0.5

    def execute(self, context):
        note_edit()
        camera = object_by_uid(self._camera) if hasattr(self, "_camera") else flexible_camera_of(context)
        chosen = {"position": (self.x, self.y)} if self._point is None else {"point": self._point}
        try:
            return bpy.ops.scfpf.aim_pin_add(camera=camera.name, **chosen)
        except RuntimeError as error:
            self.report({"ERROR"}, str(error).removeprefix("Error: ").strip())
            return {"CANCELLED"}


register, unregister = bpy.utils.register_classes_factory((SCFPF_OT_aim_pin_click,))
