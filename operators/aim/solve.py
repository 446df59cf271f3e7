# SPDX-License-Identifier: GPL-3.0-or-later
"""Turn a view, and let the volume follow what its targets ask of the image."""

from __future__ import annotations

import math

import bpy
from bpy.props import BoolProperty, FloatProperty

from ...scfpf_addon.bridge.aim import new_targets
from ...scfpf_addon.bridge.aim.follower import make_followable
from ...scfpf_addon.bridge.aim.keyed_targets import solving_animation
from ...scfpf_addon.bridge.aim.solve_work import run_through
from ...scfpf_addon.bridge.blender.all_or_nothing import all_or_nothing
from ...scfpf_addon.bridge.blender.scene_objects import object_by_uid
from ...scfpf_addon.bridge.blender.user_errors import USER_ERRORS
from ...scfpf_addon.projection.user_error import UserError
from ..common.errors import refused
from ..common.modal_job import in_window
from ..common.words import report_text
from .aim_camera import AimAction, camera_name, target_at, target_index
from .solve_job import SolveJob


class SCFPF_OT_aim_turn(AimAction, bpy.types.Operator):
    """Move the view's camera round what it shows, by angles, so that the picture shows another side of it"""

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
            raise UserError("'{0}' is not a view: choose one", target.name)
        left, up = target.free_turn if self.to_free else (self.left, self.up)
        new_targets.turn_eye(target, context.evaluated_depsgraph_get(), left, up)
        if camera.scfpf.aim.live:
            return None
        return report_text("Press Solve, or switch Live Aim on: the picture then follows the view")


class SCFPF_OT_aim_solve(SolveJob, AimAction, bpy.types.Operator):
    """Change the control surfaces until the picture shows the targets as they ask, at each of their keys,
    unless that makes the picture worse"""

    bl_idname = "scfpf.aim_solve"
    bl_label = "Solve"

    camera: camera_name()

    def prepared(self, context, kept=None):
        camera = super().prepared(context, kept)
        if not camera.scfpf.enabled:
            raise UserError(
                report_text("Switch on Flexible Projection for '{0}' first", camera.name)
                if len(camera.scfpf.aim_targets)
                else report_text(
                    "'{0}' has no view and no pin to aim at: add one with Add View or Add Pin", camera.name
                )
            )
        return camera

    def act(self, context):
        with all_or_nothing() as kept:
            camera = self.prepared(context, kept)
            uid = camera.session_uid
            message = run_through(solving_animation(camera, context))
        # The surfaces that the volume had are gone by now: nothing may fail that would remove its new ones.
        self.tell(object_by_uid(uid), message)

    def invoke(self, context, _event):
        if not in_window(context):
            return self.execute(context)
        try:
            camera = self.prepared(context)
            self.begin_solve(solving_animation(camera, context), camera)
        except USER_ERRORS as error:
            return refused(self, error)
        outcome = self.begin(context)
        self.show_solve(context)
        return outcome


class SCFPF_OT_aim_live(AimAction, bpy.types.Operator):
    """Let the volume follow while the camera or the empty of a target is moved, and solve when it rests"""

    bl_idname = "scfpf.aim_live"
    bl_label = "Live Aim"

    camera: camera_name()

    def edit(self, context, camera):
        if not camera.scfpf.aim.live:
            make_followable(camera, context.evaluated_depsgraph_get())
        camera.scfpf.aim.live = not camera.scfpf.aim.live


register, unregister = bpy.utils.register_classes_factory(
    (SCFPF_OT_aim_turn, SCFPF_OT_aim_solve, SCFPF_OT_aim_live)
)
