# SPDX-License-Identifier: GPL-3.0-or-later
"""Pick a projector in the image, and show its hit."""

import bpy
from bpy.props import StringProperty

from ...scfpf_addon.bridge.blender.all_or_nothing import keep
from ...scfpf_addon.bridge.blender.scene_objects import object_by_uid
from ...scfpf_addon.bridge.render.result_image import result_image
from ...scfpf_addon.shading.picking.pick import pick
from ..common.target import editable_camera
from ..common.tool import Action
from ..common.words import report_text
from .image_click import ImageClick
from .preparation import poll_no_render, prepared_inputs, redraw_interface


def pick_readout(settings) -> list[str]:
    """The hit of a camera's picked projector, in a few short lines."""
    lines = [report_text("At x {0:.4f}, y {1:.4f} of the picture", settings.pick[0], settings.pick[1])]
    if settings.pick_t < 0:
        return [*lines, "It meets nothing"]
    return [
        *lines,
        report_text("Meets {0}", settings.pick_object),
        report_text("At t {0:.5f}, distance {1:.5g}", settings.pick_t, settings.pick_distance),
    ]


def store_pick(settings, x: float, y: float, found) -> None:
    """Store a ``Pick`` at a position of the image in a camera's settings, and show it."""
    keep(settings)
    settings.pick = x, y
    settings.pick_t = -1.0 if found.t is None else found.t
    settings.pick_object, settings.pick_distance = found.object_name, found.distance
    settings.show_pick = True


class SCFPF_OT_pick(ImageClick, Action, bpy.types.Operator):
    """Click in the picture: the 3D viewport shows the projector through that pixel and what it meets"""

    bl_idname = "scfpf.pick"
    bl_label = "Pick Projector"
    hint = "Click in the picture to pick a projector"

    camera: StringProperty(
        name="Camera",
        description="Name of the flexible camera; empty for the scene's camera, or else the active one",
        options={"SKIP_SAVE"},
    )

    poll = classmethod(poll_no_render)

    def act(self, context):
        camera = editable_camera(context, self.camera)
        uid = camera.session_uid
        inputs = prepared_inputs(context, camera)
        size = 1 / inputs.settings.width, 1 / inputs.settings.height
        found = pick(inputs.projection, inputs.scene, self.x, self.y, size)
        if found is None:
            self.report({"WARNING"}, "No projector goes through that place of the picture: click elsewhere")
            return {"CANCELLED"}
        settings = object_by_uid(uid).scfpf
        store_pick(settings, self.x, self.y, found)
        redraw_interface(context.window_manager)
        return " · ".join(pick_readout(settings))


def _image_header(header, context):
    """Draw the button in the header of an Image Editor that shows the last render."""
    image = context.space_data.image
    if image is not None and image == result_image():
        header.layout.operator("scfpf.pick", text="", icon="EYEDROPPER")


_register_classes, _unregister_classes = bpy.utils.register_classes_factory((SCFPF_OT_pick,))


def register():
    _register_classes()
    bpy.types.IMAGE_HT_header.append(_image_header)


def unregister():
    bpy.types.IMAGE_HT_header.remove(_image_header)
    _unregister_classes()
