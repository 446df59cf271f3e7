# SPDX-License-Identifier: GPL-3.0-or-later
"""Make the camera whose image, shown on a screen, looks right from an eye."""

from __future__ import annotations

import bpy
import numpy as np
from bpy.props import BoolProperty

from ...scfpf_addon.bridge.camera.read_projection import read_projection, world_to_camera
from ...scfpf_addon.bridge.camera.screen_camera import look_at, screen_points, volume_from_screen
from ...scfpf_addon.bridge.camera.shown_lens import approximate_lens
from ...scfpf_addon.bridge.render.image_size import image_aspect
from ..common.scene_box import scene_boxes
from ..common.target import active_object, poll_object_mode, poll_scene, selected_objects
from ..common.tool import Action, select_only, show_in_local_view, wholly_made
from ..common.words import report_text


class SCFPF_OT_camera_from_screen(Action, bpy.types.Operator):
    """Add a flexible camera for the active mesh as a screen, such as an LED wall, a dome or a billboard:
    its picture fills the screen's UV map, and looks right from the other selected object or the 3D
    cursor"""

    bl_idname = "scfpf.camera_from_screen"
    bl_label = "Flexible Camera from Screen"

    pop_out: BoolProperty(
        name="Pop Out",
        description="Show what stands between the eye and the screen, too, as if it came out of the screen",
        default=True,
    )

    @classmethod
    def poll(cls, context):
        if not (poll_scene(cls, context) and poll_object_mode(cls, context)):
            return False
        if active_object(context) is None or active_object(context).type != "MESH":
            cls.poll_message_set("Select the eye (a camera or an empty), then the mesh of the screen")
            return False
        return True

    def act(self, context):
        scene, screen = context.scene, active_object(context)
        depsgraph = context.evaluated_depsgraph_get()
        points = screen_points(screen, depsgraph)
        eye = next((o for o in selected_objects(context) if o != screen and o.type != "MESH"), None)
        place = scene.cursor.location if eye is None else eye.matrix_world.translation
        boxes = scene_boxes(context)
        with wholly_made(context):
            data = bpy.data.cameras.new(f"{screen.name} Camera")
            camera = bpy.data.objects.new(data.name, data)
            look_at(camera, np.array(place, np.float64), points)
            if eye is not None:
                follow = camera.constraints.new("COPY_LOCATION")
                follow.name, follow.target = "Eye", eye
            holder = context.collection if context.collection.is_editable else scene.collection
            holder.objects.link(camera)
            context.view_layer.update()
            volume_from_screen(
                camera, screen, points, boxes.whole.corners if boxes else points.T, self.pop_out
            )
            projection = read_projection(camera, context.evaluated_depsgraph_get(), image_aspect(scene))
            approximate_lens(camera, projection.transformed(world_to_camera(camera)))
            select_only(context, camera)
            show_in_local_view(context, [camera, *(slot.object for slot in camera.scfpf.surfaces)])
            if scene.camera is None:
                scene.camera = camera
        at = "the 3D cursor" if eye is None else f"'{eye.name}'"
        return report_text("'{0}' fills the UV map of '{1}', seen from {2}", camera.name, screen.name, at)


register, unregister = bpy.utils.register_classes_factory((SCFPF_OT_camera_from_screen,))
