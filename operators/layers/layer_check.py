# SPDX-License-Identifier: GPL-3.0-or-later
"""Check the layers of a camera: which part of the picture shows each, and why one shows nothing."""

from __future__ import annotations

import bpy

from ...scfpf_addon.bridge.blender.scene_objects import object_by_uid
from ...scfpf_addon.bridge.layers.layer_edits import color_layers, write_picture
from ...scfpf_addon.bridge.layers.read_image_layers import lacking
from ...scfpf_addon.shading.picking.layer_shares import layer_shares
from ..aim.aim_camera import AimAction, camera_name
from ..common.target import camera_of, poll_flexible, poll_flexible_camera
from ..common.words import report_text, translated_report
from ..image.image_editors import reference_editor
from ..image.preparation import poll_no_render, prepared_inputs, redraw_interface

UNSEEN = "Its camera sees none of it: point the camera at the collection"
HIDDEN = "All of it is hidden by other things: choose Order under In Front, or move it up in the list"
TAKEN = "Layers before it show all its things: take them out of one of the collections"
MASKED = "Renders show none of its objects, or its mask hides all: look at both"


class SCFPF_OT_layer_check(AimAction, bpy.types.Operator):
    """Find out which part of the picture shows each layer, and why a layer shows nothing"""

    bl_idname = "scfpf.layer_check"
    bl_label = "Check Layers"

    camera: camera_name()

    @classmethod
    def poll(cls, context):
        return poll_flexible_camera(cls, context) and poll_no_render(cls, context)

    def edit(self, context, camera):
        uid = camera.session_uid
        inputs = prepared_inputs(context, camera)
        shares = layer_shares(inputs.projection, inputs.scene)
        number, parts, colors = 0, [], []
        camera = object_by_uid(uid)
        color_layers(camera.scfpf.layers)
        for layer in camera.scfpf.layers:
            lack = lacking(layer)
            layer.share, layer.message = -1.0, ""
            if not layer.is_on or lack:
                layer.message = report_text("Left out: {0}", lack) if lack else ""
                continue
            number += 1
            colors.append(tuple(layer.color))
            layer.share = float(shares.seen[number])
            parts.append(f"{layer.name} {layer.share:.1%}".replace("%", " %"))
            if layer.share == 0.0:
                layer.message = _why(inputs, number, float(shares.alone[number]))
        if number:
            write_picture(camera, shares.picture(colors))
        redraw_interface(context.window_manager)
        for warning in inputs.image_layers.warnings:
            self.report({"WARNING"}, translated_report(warning))
        return " · ".join(parts) or "No layer is complete and switched on"


def _why(inputs, number: int, alone: float) -> str:
    """The reason why a layer is not seen. alone: the share of the image that it would have alone."""
    if number in inputs.image_layers.taken:
        return TAKEN
    if alone > 0.0:
        return HIDDEN
    numbers = inputs.scene.geometry.image_layer
    is_shown = numbers is not None and bool((numbers == number).any())
    return UNSEEN if is_shown and inputs.projection.layers[number - 1].mask is None else MASKED


class SCFPF_OT_layer_image_show(bpy.types.Operator):
    """Show in an Image Editor which layer each pixel belongs to"""

    bl_idname = "scfpf.layer_image_show"
    bl_label = "Show Picture of Layers"
    bl_options = {"REGISTER"}

    @classmethod
    def poll(cls, context):
        if not poll_flexible(cls, context):
            return False
        if camera_of(context).scfpf.layer_image is None:
            cls.poll_message_set("Press Check Layers first")
            return False
        return True

    def execute(self, context):
        space = reference_editor(context)
        if space is None:
            self.report({"ERROR"}, "Open an Image Editor to see the picture")
            return {"CANCELLED"}
        space.image = camera_of(context).scfpf.layer_image
        return {"FINISHED"}


register, unregister = bpy.utils.register_classes_factory((SCFPF_OT_layer_check, SCFPF_OT_layer_image_show))
