# SPDX-License-Identifier: GPL-3.0-or-later
"""Handles in the 3D viewport of a camera with Perspective by Distance: each plane's distance and width."""

from __future__ import annotations

import math

import bpy
from mathutils import Matrix, Vector

from ..camera.by_distance import half_width, is_by_distance
from ..volume.camera_members import cameras_with, surfaces_of

ARROW, DRAG = "GIZMO_GT_arrow_3d", "scfpf.distance_drag"
# Length of an arrow, in Blender's unit of gizmos: hardly more than its head.
LENGTH = 0.15
# What a plane's two arrows drag, with the arrows' colours.
DRAGGED = {"distance": (0.2, 0.55, 1.0), "half_width": (1.0, 0.75, 0.2)}
# From an arrow's own axis, Z, to the way of a drag: away from the camera, and to the right.
TURNED = {
    "distance": Matrix.Rotation(math.pi, 4, "X"),
    "half_width": Matrix.Rotation(math.pi / 2, 4, "Y"),
}
HOVERED = (1.0, 1.0, 1.0)


def _camera(context):
    """The active camera, or the one that the active plane belongs to, if it has handles; else None."""
    obj = context.object
    if obj is None:
        return None
    found = obj
    if obj.type != "CAMERA":
        owners = cameras_with(obj) if obj.scfpf_surface.is_by_distance else []
        found = owners[0] if owners else None
    if found is None or not (found.scfpf.enabled and found.scfpf.show_projectors and found.is_editable):
        return None
    return found if is_by_distance(found) else None


class SCFPF_GGT_distances(bpy.types.GizmoGroup):
    bl_idname = "SCFPF_GGT_distances"
    bl_label = "Perspective by Distance"
    bl_space_type = "VIEW_3D"
    bl_region_type = "WINDOW"
    bl_options = {"3D", "PERSISTENT", "SHOW_MODAL_ALL"}

    @classmethod
    def poll(cls, context):
        return context.mode == "OBJECT" and _camera(context) is not None

    def setup(self, context):
        self.refresh(context)

    def refresh(self, context):
        surfaces = surfaces_of(_camera(context))
        wanted = len(surfaces) * len(DRAGGED)
        while len(self.gizmos) > wanted:
            self.gizmos.remove(self.gizmos[len(self.gizmos) - 1])
        for number in range(wanted):
            name = list(DRAGGED)[number % len(DRAGGED)]
            arrow = self.gizmos[number] if number < len(self.gizmos) else self._new_arrow(name)
            drag = arrow.target_set_operator(DRAG)
            drag.surface, drag.part = surfaces[number // len(DRAGGED)].name, name
        self._place(context)

    def draw_prepare(self, context):
        self._place(context)

    def _new_arrow(self, name: str):
        arrow = self.gizmos.new(ARROW)
        arrow.draw_style = "BOX" if name == "half_width" else "NORMAL"
        arrow.color, arrow.color_highlight = DRAGGED[name], HOVERED
        arrow.alpha, arrow.alpha_highlight = 0.8, 1.0
        arrow.length = LENGTH
        arrow.use_draw_modal = True
        return arrow

    def _place(self, context) -> None:
        """Put the arrows where their planes are."""
        camera = _camera(context)
        surfaces = [] if camera is None else surfaces_of(camera)
        if len(surfaces) * len(DRAGGED) != len(self.gizmos):
            return
        place = camera.matrix_world.normalized()
        for number, arrow in enumerate(self.gizmos):
            name = list(DRAGGED)[number % len(DRAGGED)]
            surface = surfaces[number // len(DRAGGED)]
            beside = half_width(surface) if name == "half_width" else 0.0
            end = Vector(surface.location) + Vector((beside, 0.0, 0.0))
            arrow.matrix_basis = place @ Matrix.Translation(end) @ TURNED[name]


register, unregister = bpy.utils.register_classes_factory((SCFPF_GGT_distances,))
