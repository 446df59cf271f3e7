# SPDX-License-Identifier: GPL-3.0-or-later
"""Two flexible cameras for 360° stereo: the eyes of a head that turns all round (omnidirectional stereo)."""

import math

import bpy
import numpy as np
from bpy.props import FloatProperty
from mathutils import Matrix

from ...scfpf_addon.bridge.blender.all_or_nothing import keep
from ...scfpf_addon.bridge.camera.flexible_camera import NewSurface, make_flexible, replace_surfaces
from ...scfpf_addon.projection.user_error import UserError
from ...scfpf_addon.projection.volume.spherical_stereo import COLUMNS, ROWS, SphericalStereo
from ..common.scene_box import scene_boxes
from ..common.target import poll_object_mode, poll_scene
from ..common.tool import Action, select_only, show_in_local_view, wholly_made

# Names as Blender's Multi-View looks for them, with the side on which each eye is.
EYES = {"VR_L": -1.0, "VR_R": 1.0}
# The far surface is at least this far off, and this many times as far as the end of the scene.
LEAST_REACH, FAR_MARGIN = 100.0, 1.25


class SCFPF_OT_vr_pair(Action, bpy.types.Operator):
    """Add two cameras for 360° stereo pictures at the 3D cursor: F12 with Flexible Projection renders a
    spherical panorama for each eye"""

    bl_idname = "scfpf.vr_pair"
    bl_label = "Flexible Cameras for 360° Stereo"

    interocular: FloatProperty(
        name="Interocular Distance",
        description="Distance between the eyes",
        default=0.065,
        min=0.0,
        soft_max=1.0,
        subtype="DISTANCE",
        precision=4,
    )
    convergence: FloatProperty(
        name="Convergence",
        description="Distance of what is at the same place for both eyes; 0 for none, as if it were infinite",
        default=1.95,
        min=0.0,
        subtype="DISTANCE",
        precision=3,
    )
    merge_from: FloatProperty(
        name="Pole Merge From",
        description="Elevation at which the eyes begin to come together",
        default=math.radians(60.0),
        min=0.0,
        max=math.radians(90.0),
        subtype="ANGLE",
    )
    merge_to: FloatProperty(
        name="Pole Merge To",
        description="Elevation from which both eyes see the same",
        default=math.radians(75.0),
        min=0.0,
        max=math.radians(90.0),
        subtype="ANGLE",
    )

    @classmethod
    def poll(cls, context):
        return poll_scene(cls, context) and poll_object_mode(cls, context)

    def act(self, context):
        scene, render = context.scene, context.scene.render
        if self.convergence and self.convergence <= self.interocular:
            raise UserError("The eyes cannot converge between themselves: enter a larger Convergence")
        boxes = scene_boxes(context)
        reach = LEAST_REACH if boxes is None else float(np.linalg.norm(boxes.whole.size)) * FAR_MARGIN
        upright = Matrix.Translation(scene.cursor.location) @ Matrix.Rotation(math.radians(90), 4, "X")
        cameras = []
        with wholly_made(context):
            keep(render, "use_multiview", "views_format")
            holder = context.collection if context.collection.is_editable else scene.collection
            for name, side in EYES.items():
                if name in bpy.data.objects:
                    raise UserError("'{0}' exists: rename or delete it first", name)
                camera = bpy.data.objects.new(name, bpy.data.cameras.new(name))
                holder.objects.link(camera)
                if cameras:
                    camera.parent = cameras[0]
                else:
                    camera.matrix_world = upright
                near, far = self._surfaces(side, max(reach, LEAST_REACH))
                flat = np.eye(4)
                replace_surfaces(
                    camera,
                    [
                        NewSurface(f"{name} Eye", "GRID", flat, None, near),
                        NewSurface(f"{name} Far", "GRID", flat, None, far),
                    ],
                )
                make_flexible(camera)
                cameras.append(camera)
            render.use_multiview, render.views_format = True, "MULTIVIEW"
            scene.camera = cameras[0]
            select_only(context, cameras[0])
            show_in_local_view(context, cameras)
        return (
            "Both eyes move with VR_L: set a resolution twice as wide as high, and press F12 with Flexible "
            "Projection"
        )

    def _surfaces(self, side: float, reach: float):
        """The points (rows, columns, 3) of an eye's places, and those at which its projectors end."""
        azimuth, elevation = np.meshgrid(
            np.linspace(-math.pi, math.pi, COLUMNS), np.linspace(-math.pi / 2, math.pi / 2, ROWS)
        )
        direction = np.stack(
            [np.sin(azimuth) * np.cos(elevation), np.sin(elevation), -np.cos(azimuth) * np.cos(elevation)]
        )
        rightwards = np.stack([np.cos(azimuth), np.zeros_like(azimuth), np.sin(azimuth)])
        merge = self.merge_from, self.merge_to
        stereo = SphericalStereo(self.interocular, self.convergence or math.inf, merge)
        eye, towards = stereo.eye(side, direction, rightwards)
        return np.moveaxis(eye, 0, -1), np.moveaxis(eye + reach * towards, 0, -1)


register, unregister = bpy.utils.register_classes_factory((SCFPF_OT_vr_pair,))
