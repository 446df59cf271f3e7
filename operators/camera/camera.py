# SPDX-License-Identifier: GPL-3.0-or-later
"""Add a flexible camera, or make an ordinary camera flexible."""

import bpy
import numpy as np
from bpy.props import EnumProperty

from ...scfpf_addon.bridge.aim.kept_volume import camera_kept, volume_kept
from ...scfpf_addon.bridge.camera.flexible_camera import make_flexible, volume_from_camera
from ...scfpf_addon.bridge.render.image_size import image_aspect
from ..common.scene_box import SceneBox, SceneBoxes, scene_boxes
from ..common.target import camera_of, poll_camera, poll_object_mode, poll_scene
from ..common.tool import Action, select_only, show_in_local_view, tooltip_of, wholly_made
from .camera_placement import camera_like_view, camera_seeing, fit_depth
from .presets import preset_items, shipped_preset, use_preset

# A new camera frames this in an empty scene: the size of Blender's default cube.
EMPTY_SCENE = SceneBoxes(*(SceneBox(np.full(3, -1.0), np.full(3, 1.0)),) * 2)

_VIEW = ("VIEW", "From View", "The frustum of what the 3D viewport shows, as an editable volume")
# Blender keeps only pointers to the strings of a dynamic enum.
_items_kept: list[tuple[str, str, str]] = []


def _items(_operator, _context):
    _items_kept[:] = [_VIEW, *preset_items()]
    return _items_kept


class SCFPF_OT_camera_add(Action, bpy.types.Operator):
    """Add a camera with the viewport's view, whose viewing volume is modeled with control surfaces"""

    bl_idname = "scfpf.camera_add"
    bl_label = "Add Flexible Camera"

    preset: EnumProperty(
        name="Projection", description="The viewing volume that the camera starts with", items=_items
    )

    @classmethod
    def description(cls, _context, properties):
        return tooltip_of(cls, preset_items(), properties.preset)

    @classmethod
    def poll(cls, context):
        return poll_scene(cls, context) and poll_object_mode(cls, context)

    def act(self, context):
        scene = context.scene
        aspect = image_aspect(scene)
        preset = None if self.preset == _VIEW[0] else shipped_preset(self.preset)
        boxes = scene_boxes(context) or EMPTY_SCENE
        with wholly_made(context):
            data, matrix = camera_like_view(context, aspect) or camera_seeing(boxes.things, aspect)
            camera = bpy.data.objects.new("Flexible Camera", data)
            camera.matrix_world = fit_depth(data, matrix, boxes)
            # The active collection may be another file's.
            holder = context.collection if context.collection.is_editable else scene.collection
            holder.objects.link(camera)
            context.view_layer.update()
            if preset is None:
                volume_from_camera(camera, scene)
            else:
                use_preset(context, camera, preset, fit=True)
            select_only(context, camera)
            show_in_local_view(context, [camera, *(slot.object for slot in camera.scfpf.surfaces)])
            if scene.camera is None:
                scene.camera = camera
        return "Press N for its panel, in the tab Flexible Projection. Turn the view to see its volume"


class SCFPF_OT_camera_from_camera(Action, bpy.types.Operator):
    """Make the camera's own frustum, from clip start to clip end, its viewing volume"""

    bl_idname = "scfpf.camera_from_camera"
    bl_label = "Flexible Camera from This Camera"

    poll = classmethod(poll_camera)

    def act(self, context):
        camera = camera_of(context)
        with volume_kept(camera):
            volume_from_camera(camera, context.scene)


class SCFPF_OT_camera_toggle(Action, bpy.types.Operator):
    """Switch between the ordinary camera and the flexible one, which keeps its control surfaces"""

    bl_idname = "scfpf.camera_toggle"
    bl_label = "Flexible Projection"

    poll = classmethod(poll_camera)

    def act(self, context):
        camera = camera_of(context)
        with camera_kept(camera):
            if camera.scfpf.enabled:
                camera.scfpf.enabled = False
            elif len(camera.scfpf.surfaces) > 0:
                make_flexible(camera, again=True)
            else:
                volume_from_camera(camera, context.scene)


register, unregister = bpy.utils.register_classes_factory(
    (SCFPF_OT_camera_add, SCFPF_OT_camera_from_camera, SCFPF_OT_camera_toggle)
)
