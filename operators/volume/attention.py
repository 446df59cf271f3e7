# SPDX-License-Identifier: GPL-3.0-or-later
"""Attention: the selected things larger in the picture, and the rest fitted around them."""

import bpy
import numpy as np
from bpy.props import FloatProperty

from ...scfpf_addon.bridge.blender.slot_animation import MAPPINGS, move_slot
from ...scfpf_addon.bridge.camera.read_projection import read_projection
from ...scfpf_addon.bridge.mappings.mapping_edits import add_mapping
from ...scfpf_addon.bridge.render.image_size import image_aspect
from ...scfpf_addon.bridge.scene.instances import NO_THINGS, instances
from ...scfpf_addon.bridge.scene.mesh_arrays import foreach
from ...scfpf_addon.bridge.scene.read_visibility import ShownInRenders
from ...scfpf_addon.projection.user_error import UserError
from ...scfpf_addon.projection.volume.inverse import find_in_image
from ..common.scene_box import corners_of, is_thing, transformed
from ..common.target import flexible_camera_of, poll_flexible_camera, selected_objects
from ..common.tool import Tool
from ..common.words import report_text

# Points of each selected thing that are looked for in the picture, at most.
MOST_POINTS = 4096
# The least share of the lens that fades, and the share of the way to the picture's border that it may reach.
LEAST_FALLOFF, REACH = 0.2, 0.98
NAME = "Attention"


class SCFPF_OT_attention(Tool, bpy.types.Operator):
    """Show the selected things larger, as we see what we attend to, with all the rest fitted around them"""

    bl_idname = "scfpf.attention"
    bl_label = "Attention"

    size: FloatProperty(
        name="Size",
        description="How many times as large the selected things become in the picture",
        default=1.5,
        min=1.01,
        max=10.0,
        soft_max=3.0,
    )

    @classmethod
    def poll(cls, context):
        if not poll_flexible_camera(cls, context):
            return False
        camera = flexible_camera_of(context)
        if not any(is_thing(obj) and obj.scfpf_surface.kind == "NONE" for obj in selected_objects(context)):
            cls.poll_message_set("Select the things to attend to, besides the camera")
            return False
        return camera is not None

    def edit(self, context, camera):
        depsgraph = context.evaluated_depsgraph_get()
        aspect = image_aspect(context.scene)
        found = find_in_image(read_projection(camera, depsgraph, aspect), _selected_points(depsgraph))
        if not found.found.any():
            raise UserError(
                "The picture does not show the selected things: select others, or turn the camera"
            )
        # In halves of the picture's shorter side, as a lens's radius.
        unit = np.array([aspect, 1.0]) * 2.0 / min(aspect, 1.0)
        place = np.array([found.x, found.y])[:, found.found] * unit[:, None]
        middle = (place.min(axis=1) + place.max(axis=1)) / 2.0
        inner = float(np.linalg.norm(place - middle[:, None], axis=0).max()) * self.size
        border = float(np.minimum(middle, unit - middle).min())
        radius = max(inner / (1.0 - LEAST_FALLOFF), REACH * border)
        add_mapping(camera, "LENS", NAME)
        settings = camera.scfpf
        lens = settings.mappings[move_slot(settings, len(settings.mappings) - 1, 0, MAPPINGS)]
        lens.centre = middle / unit
        lens.radius, lens.magnification = radius, self.size
        lens.falloff = 1.0 - inner / radius
        return report_text("Influence of the mapping {0} fades it in and out", lens.name)


def _selected_points(depsgraph):
    """Points of the selected things in world space, (3, N)."""
    points = [np.empty((0, 3))]
    for instance in instances(depsgraph, renders=ShownInRenders(depsgraph)):
        if instance.obj.type in NO_THINGS or not instance.owner.select_get():
            continue
        if instance.obj.type == "MESH" and len(instance.obj.data.vertices):
            vertices = foreach(instance.obj.data.attributes["position"].data, "vector", 3)
            step = -(-len(vertices) // MOST_POINTS)
            points.append(transformed(instance.matrix, vertices[::step].astype(np.float64)))
        else:
            points.append(corners_of(instance.obj, instance.matrix))
    return np.concatenate(points).T


register, unregister = bpy.utils.register_classes_factory((SCFPF_OT_attention,))
