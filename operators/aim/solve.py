# SPDX-License-Identifier: GPL-3.0-or-later
"""Turn a view, and let the volume follow what its targets ask of the image."""

from __future__ import annotations

import math

import bpy
from bpy.props import BoolProperty, FloatProperty

from ...scfpf_addon.bridge.aim import new_targets
from ...scfpf_addon.bridge.aim.keyed_targets import solve_animation
from ...scfpf_addon.bridge.aim.target_views import AimError
from .aim_camera import AimAction, camera_name, target_at, target_index


class SCFPF_OT_aim_turn(AimAction, bpy.types.Operator):
    """Move the view's camera round what it shows, by angles"""

    bl_idname = "scfpf.aim_turn"
    bl_label = "Turn View"

    camera: camera_name()
    index: target_index()
    left: FloatProperty(
        name="Left", description="Angle by which the camera moves to its left", subtype="ANGLE"
    )
    up: FloatProperty(
        name="Up",
        description="Angle by which the camera moves up",
        subtype="ANGLE",
        min=-math.pi,
        max=math.pi,
    )
    to_free: BoolProperty(
        name="To Nearest Free Direction",
        description="Turn to where nothing hides the target, as the last Solve has found",
        options={"SKIP_SAVE"},
    )

    def edit(self, context, camera):
        target, _ = target_at(camera, self.index)
        if target.kind != "VIEW":
            raise AimError(f"'{target.name}' is not a view: choose one")
        left, up = target.free_turn if self.to_free else (self.left, self.up)
        new_targets.turn_eye(target, context.evaluated_depsgraph_get(), left, up)


class SCFPF_OT_aim_solve(AimAction, bpy.types.Operator):
    """Change the control surfaces until the picture shows the targets as they ask, at each of their keys.
    If that would make the picture worse, the volume stays as it is"""

    bl_idname = "scfpf.aim_solve"
    bl_label = "Solve"
    makes_flexible = True

    camera: camera_name()

    def edit(self, context, camera):
        return solve_animation(camera, context)


register, unregister = bpy.utils.register_classes_factory((SCFPF_OT_aim_turn, SCFPF_OT_aim_solve))
