# SPDX-License-Identifier: GPL-3.0-or-later
"""Perspective by Distance: a field of view for each of several distances."""

import bpy
import numpy as np
from bpy.app.translations import pgettext_iface
from bpy.props import EnumProperty, FloatProperty, StringProperty
from bpy_extras.view3d_utils import region_2d_to_origin_3d, region_2d_to_vector_3d
from mathutils import Vector
from mathutils.geometry import intersect_line_line

from ...scfpf_addon.bridge.aim.kept_volume import volume_kept
from ...scfpf_addon.bridge.blender.scene_objects import object_by_uid
from ...scfpf_addon.bridge.camera import by_distance
from ...scfpf_addon.bridge.render.image_size import image_aspect
from ...scfpf_addon.bridge.volume.camera_members import surfaces_of
from ...scfpf_addon.projection.user_error import UserError
from ..common.modal_job import ModalJob
from ..common.scene_box import scene_boxes, transformed
from ..common.target import camera_of, flexible_camera_of, poll_camera, poll_flexible_camera
from ..common.tool import Action, Tool
from ..common.words import report_text

# What can be dragged of a distance, and which way, in the camera's space.
PARTS = (
    ("distance", "Distance", "The distance itself"),
    ("half_width", "Width", "Half the width that the picture has at this distance"),
)
TITLES = {part: title for part, title, _ in PARTS}
WAYS = {"distance": (0.0, 0.0, -1.0), "half_width": (1.0, 0.0, 0.0)}
# The least that a drag leaves of a distance or a width, as a share.
LEAST = 0.01
# What a new volume reaches beyond its things, at least, as a multiple of their distance.
BEYOND = 1.25


class SCFPF_OT_by_distance(Action, bpy.types.Operator):
    """Give the camera a field of view for each of several distances, to begin with that of its lens: large
    hands at a calm background, a face as through a long lens in a wide street"""

    bl_idname = "scfpf.by_distance"
    bl_label = "Perspective by Distance"

    poll = classmethod(poll_camera)

    def act(self, context):
        camera, scene = camera_of(context), context.scene
        lens = by_distance.view_of_lens(camera, scene)
        near, far = camera.data.clip_start, camera.data.clip_end
        boxes = scene_boxes(context, selected_only=True) or scene_boxes(context)
        middle = (near * far) ** 0.5
        if boxes is not None:
            centre = transformed(camera.matrix_world.inverted_safe(), boxes.things.centre[None])[0]
            if near < -centre[2] < far / BEYOND:
                middle = -centre[2]
        with volume_kept(camera):
            by_distance.make(camera, [lens._replace(distance=float(d)) for d in (near, middle, far)])
            camera.scfpf.active_surface = 1
        return report_text("Change the Field of View at {0}, or add a distance with +", f"{middle:.4g}")


class SCFPF_OT_distance_add(Tool, bpy.types.Operator):
    """Add a distance with a field of view of its own, which is at first the one that it has"""

    bl_idname = "scfpf.distance_add"
    bl_label = "Add Distance"

    distance: FloatProperty(
        name="Distance",
        description="Distance from the camera, 0 for one between the active distance and the next",
        default=0.0,
        min=0.0,
        subtype="DISTANCE",
    )

    @classmethod
    def poll(cls, context):
        if not poll_flexible_camera(cls, context):
            return False
        if not by_distance.is_by_distance(flexible_camera_of(context)):
            cls.poll_message_set("Choose Perspective by Distance first")
            return False
        return True

    def edit(self, context, camera):
        distances = [surface.scfpf_surface.distance for surface in surfaces_of(camera)]
        wanted = self.distance
        if wanted == 0.0:
            first = min(camera.scfpf.active_surface, len(distances) - 2)
            wanted = float(np.sqrt(distances[first] * distances[first + 1]))
        if wanted in distances:
            raise UserError("There is a field of view at {0} already: choose another distance", wanted)
        by_distance.insert(camera, context.evaluated_depsgraph_get(), image_aspect(context.scene), wanted)


class SCFPF_OT_distance_drag(ModalJob, bpy.types.Operator):
    """Drag a distance, or the width that the picture has there"""

    bl_idname = "scfpf.distance_drag"
    bl_label = "Drag Distance"
    bl_options = {"UNDO", "INTERNAL", "BLOCKING"}

    surface: StringProperty(name="Surface", description="Name of the plane at the distance")
    part: EnumProperty(name="Part", description="What is dragged", items=PARTS)

    escapes = frozenset({"ESC", "RIGHTMOUSE"})

    poll = SCFPF_OT_distance_add.poll

    def invoke(self, context, event):
        camera = flexible_camera_of(context)
        surface = next((s for s in surfaces_of(camera) if s.name == self.surface), None)
        if surface is None:
            return {"CANCELLED"}
        self._dragged = surface.session_uid
        place = camera.matrix_world.normalized()
        middle = Vector(surface.location) if self.part == "half_width" else Vector()
        self._start = place @ middle
        self._way = place.to_3x3() @ Vector(WAYS[self.part])
        self._before = self._begun = self._value(surface)
        self._distance, self._angle = surface.scfpf_surface.distance, surface.scfpf_surface.angle
        self._from = self._along(context, event)
        outcome = self.begin(context)
        self._tell(context)
        return outcome

    def _value(self, surface) -> float:
        is_width = self.part == "half_width"
        return by_distance.half_width(surface) if is_width else surface.scfpf_surface.distance

    def is_lost(self):
        return object_by_uid(self._dragged) is None

    def respond(self, context, event):
        surface = object_by_uid(self._dragged)
        if event.type == "LEFTMOUSE" and event.value == "RELEASE":
            return {"FINISHED"}
        if event.type == "MOUSEMOVE":
            here = self._along(context, event)
            if None not in (here, self._from):
                # A plane stays before the camera, and no picture has no width.
                self._begun = max(self._before + here - self._from, LEAST * self._before)
                if self.part == "half_width":
                    by_distance.set_half_width(surface, self._begun)
                else:
                    surface.scfpf_surface.distance = self._begun
            self._tell(context)
        return {"RUNNING_MODAL"}

    def _tell(self, context) -> None:
        title = pgettext_iface(TITLES[self.part])
        self.show(context, report_text("{0}: {1}    Esc: cancel", title, f"{self._begun:.4g}"))

    def give_up(self, _context):
        surface = object_by_uid(self._dragged)
        if surface is not None:
            surface.scfpf_surface.distance, surface.scfpf_surface.angle = self._distance, self._angle

    def _along(self, context, event) -> float | None:
        """The mouse's place along the way of the drag; None if the way is seen from its end."""
        mouse = event.mouse_region_x, event.mouse_region_y
        view = context.region, context.region_data
        origin, direction = (see(*view, mouse) for see in (region_2d_to_origin_3d, region_2d_to_vector_3d))
        found = intersect_line_line(origin, origin + direction, self._start, self._start + self._way)
        return None if found is None else (found[1] - self._start).dot(self._way)


class SCFPF_OT_distance_release(Tool, bpy.types.Operator):
    """Leave the control surfaces as they are now, to be moved and scaled by hand"""

    bl_idname = "scfpf.distance_release"
    bl_label = "Edit Surfaces by Hand"

    poll = SCFPF_OT_distance_add.poll

    def edit(self, _context, camera):
        by_distance.release(camera)


register, unregister = bpy.utils.register_classes_factory(
    (SCFPF_OT_by_distance, SCFPF_OT_distance_add, SCFPF_OT_distance_drag, SCFPF_OT_distance_release)
)
