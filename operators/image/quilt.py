# SPDX-License-Identifier: GPL-3.0-or-later
"""Render a quilt: a grid of views of one volume, for light-field and lenticular displays."""

import math

import bpy
import numpy as np
from bpy.props import EnumProperty, FloatProperty, IntProperty

from ...scfpf_addon.bridge.render.image_size import image_aspect
from ...scfpf_addon.bridge.render.quilt import Quilt, read_quilt
from ..common.scene_box import scene_boxes, transformed
from ..common.target import flexible_camera_of
from ..common.words import report_text
from .joined_engines import ALL_ENGINES
from .render_series import RenderSeries

# The engine of flexible cameras, beside those whose renders are joined.
OWN = "OWN"
# The least share of the distance to the middle of the things at which views meet.
NEAREST = 0.05


class OfQuilt:
    """Operators that render a quilt."""

    columns: IntProperty(name="Columns", description="Views side by side", default=8, min=1, max=64)
    rows: IntProperty(name="Rows", description="Rows of views, from the bottom up", default=6, min=1, max=64)
    cone: FloatProperty(
        name="View Cone",
        description="Angle between the first and the last view",
        default=math.radians(35.0),
        min=0.0,
        max=math.radians(120.0),
        subtype="ANGLE",
    )
    focus: FloatProperty(
        name="Focus",
        description="Distance from the camera of what seems to lie in the display; 0 for the scene's middle",
        default=0.0,
        min=0.0,
        subtype="DISTANCE",
    )

    def quilt(self, context, camera) -> Quilt:
        """The layout of the quilt of a camera."""
        return Quilt(self.columns, self.rows, self.cone, self.focus or _middle(context, camera))


class SCFPF_OT_quilt(OfQuilt, RenderSeries, bpy.types.Operator):
    """Render a quilt of views from left to right into one picture, for light-field displays and lenticular
    prints; each view has the scene's resolution"""

    bl_idname = "scfpf.quilt"
    bl_label = "Render Quilt"
    bl_options = {"REGISTER"}

    engine: EnumProperty(
        name="Engine",
        description="The render engine; the scene keeps its own",
        items=((OWN, "Flexible Projection", "The engine of flexible cameras"), *ALL_ENGINES),
        default=OWN,
        options={"SKIP_SAVE"},
    )

    keeps_scene = True

    def execute(self, context):
        if self.engine == OWN:
            return super().execute(context)
        how = "INVOKE_DEFAULT" if getattr(self, "_is_asked", False) else "EXEC_DEFAULT"
        given = {name: getattr(self, name) for name in ("columns", "rows", "cone", "focus", "engine")}
        camera = flexible_camera_of(context)
        try:
            done = bpy.ops.scfpf.quilt_joined(how, camera=camera.name, **given)
        except RuntimeError as error:
            self.report({"ERROR"}, str(error).removeprefix("Error: ").strip())
            return {"CANCELLED"}
        # The other operator goes on by itself.
        return {"FINISHED"} if "RUNNING_MODAL" in done else done

    def plan(self, context):
        camera = flexible_camera_of(context)
        self._quilt = self.quilt(context, camera)
        self._views = read_quilt(context.scene, context.view_layer, camera, self._quilt)
        if context.scene.render.use_motion_blur:
            self.report({"WARNING"}, "Motion blur is left out of quilts")
        self.told = name_told(context.scene, self._quilt)
        settings = self._views[0].settings
        self._size = settings.width, settings.height
        return self._quilt.count, (self._size[0] * self.columns, self._size[1] * self.rows)

    def parts(self, _context):
        while self._views:
            yield self._views.pop(0)

    def paste(self, number, pixels):
        self.picture[self._quilt.place(number, self._size)] = pixels


def name_told(scene, quilt: Quilt) -> str:
    """The line about the name of a quilt's file."""
    ending = f"_qs{quilt.columns}x{quilt.rows}a{image_aspect(scene):.2f}"
    return report_text("Save it with {0} at the end of its name, for players of quilts", ending)


def _middle(context, camera) -> float:
    """The depth of the middle of the scene's things, or of the volume's own middle."""
    boxes = scene_boxes(context)
    inverse = camera.matrix_world.inverted_safe()
    if boxes is not None:
        depth = -float(transformed(inverse, boxes.things.centre[None])[0, 2])
        reach = float(np.linalg.norm(transformed(inverse, boxes.things.centre[None])[0]))
        if depth > NEAREST * reach:
            return depth
    return max(math.sqrt(camera.data.clip_start * camera.data.clip_end), 1e-6)


register, unregister = bpy.utils.register_classes_factory((SCFPF_OT_quilt,))
