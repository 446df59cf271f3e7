# SPDX-License-Identifier: GPL-3.0-or-later
"""Aim over the image: gizmos of the frames and marks of its targets, its worst places and its lines."""

from __future__ import annotations

import bpy
import numpy as np

from ...projection.user_error import Message
from ..blender.user_errors import translated_report
from ..frames.frame_widgets import QUIET, FrameGizmo, FrameGroup
from ..frames.shown_image import ShownImage
from ..overlays.image_marks import ARM, TEXT_GAP, draw_cross, draw_lines, write
from ..settings.aim_properties import LARGEST
from .shown_targets import WELL_MET, shown_targets, straight_lines

DRAG = "scfpf.aim_drag"
# Labels of the worst places.
OFF, LOST = Message("{0}: {1:.0f} px off"), Message("{0}: is lost here")


def worst_places(settings, image: ShownImage) -> list[tuple[float, float, str]]:
    """The pixels of the worst places of the active view's thing and of the background, and their labels.

    Those that a user would not notice are left out.
    """
    aim = settings.aim
    found = [(aim.background_max, aim.background_worst, Message("background"))]
    if settings.active_aim < len(settings.aim_targets):
        target = settings.aim_targets[settings.active_aim]
        if target.is_on:
            found.append((target.whole_max, target.whole_worst, target.name))
    marks = []
    for pixels, place, name in found if aim.is_solved else ():
        if pixels > WELL_MET:
            x, y = image.pixels(np.array(place, np.float64)[:, None])[:, 0]
            marks.append(
                (
                    float(x),
                    float(y),
                    translated_report(Message(LOST if pixels >= LARGEST else OFF, name, pixels)),
                )
            )
    return marks


class SCFPF_GT_aim(FrameGizmo, bpy.types.Gizmo):
    """The frames and marks of all targets in a region"""

    bl_idname = "SCFPF_GT_aim"
    __slots__ = ("_hovered",)

    def frames(self, context, image):
        return shown_targets(context, image)

    def draw_below(self, context, image):
        region, scale = context.region, context.preferences.system.ui_scale
        size, settings = (region.width, region.height), image.camera.scfpf
        for x, y, label in worst_places(settings, image):
            draw_cross(x, y, size, scale)
            write(label, x + ARM * scale, y + TEXT_GAP * scale, size, scale)
        for ends in straight_lines(settings, image):
            draw_lines([tuple(end) for end in ends], size, scale, QUIET)


class _AimGroup(FrameGroup):
    bl_label = "Aim"
    gizmo, drag = SCFPF_GT_aim.bl_idname, DRAG

    @classmethod
    def has_frames(cls, settings):
        return len(settings.aim_targets) > 0


class SCFPF_GGT_aim_viewport(_AimGroup, bpy.types.GizmoGroup):
    bl_idname = "SCFPF_GGT_aim_viewport"
    bl_space_type = "VIEW_3D"


class SCFPF_GGT_aim_image(_AimGroup, bpy.types.GizmoGroup):
    bl_idname = "SCFPF_GGT_aim_image"
    bl_space_type = "IMAGE_EDITOR"


register, unregister = bpy.utils.register_classes_factory(
    (SCFPF_GT_aim, SCFPF_GGT_aim_viewport, SCFPF_GGT_aim_image)
)
