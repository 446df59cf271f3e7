# SPDX-License-Identifier: GPL-3.0-or-later
"""A dimetric view whose ground tiles have an exact size in pixels."""

import math

import bpy
import numpy as np
from bpy.props import FloatProperty, IntProperty
from mathutils import Matrix, Vector

from ...scfpf_addon.bridge.aim.kept_volume import volume_kept
from ...scfpf_addon.bridge.camera.flexible_camera import apply_preset
from ...scfpf_addon.bridge.render.image_size import image_aspect, image_size
from ..common.scene_box import scene_boxes
from ..common.target import camera_of, poll_camera
from ..common.tool import Action
from .presets import shipped_preset

PRESET = "dimetric"
# The volume is at least this many times as deep as the scene's things, of which none is cut off then.
ROOM = 1.5


class SCFPF_OT_dimetric(Action, bpy.types.Operator):
    """Give the camera the view of isometric games, level along the scene's axes: tiles of the ground have an
    exact size, twice as wide as high"""

    bl_idname = "scfpf.dimetric"
    bl_label = "Dimetric for Tiles"

    tile: IntProperty(
        name="Tile Width",
        description="Width of a tile of the ground in the picture, in pixels; its height is half of it",
        default=64,
        min=2,
        max=8192,
        subtype="PIXEL",
    )
    side: FloatProperty(
        name="Tile Side",
        description="Length of a tile's side in the scene",
        default=1.0,
        min=1e-4,
        soft_max=100.0,
        subtype="DISTANCE",
    )

    poll = classmethod(poll_camera)

    def act(self, context):
        camera, scene = camera_of(context), context.scene
        aspect = image_aspect(scene)
        preset = shipped_preset(PRESET)
        fitted = preset.fitted(aspect)
        near, far = fitted.volume().surfaces
        start, end = (
            surface.evaluate(np.array([0.5]), np.array([0.5])).position[:, 0] for surface in (near, far)
        )
        width = near.evaluate(np.array(fitted.u_range), np.array([0.5, 0.5])).position
        width = float(np.linalg.norm(width[:, 1] - width[:, 0]))
        # A square tile on its corner is the root of two times its side across.
        scale = math.sqrt(2.0) * self.side * image_size(scene)[0] / (self.tile * width)
        length, depth = float(np.linalg.norm(end - start)) * scale, 1.0
        with volume_kept(camera):
            boxes = scene_boxes(context)
            if boxes is not None:
                depth = max(1.0, ROOM * float(np.linalg.norm(boxes.things.size)) / length)
                rotation = Matrix.Rotation(math.radians(90), 4, "X")
                # The middle of the projectors comes to the middle of the things.
                middle = Vector((start + (end - start) * depth / 2) * scale)
                camera.matrix_world = (
                    Matrix.Translation(Vector(boxes.things.centre) - rotation @ middle) @ rotation
                )
            apply_preset(camera, preset, aspect, scale, depth)


register, unregister = bpy.utils.register_classes_factory((SCFPF_OT_dimetric,))
