# SPDX-License-Identifier: GPL-3.0-or-later
"""Find the selected objects in the image, the inverse of ``pick``."""

import bpy
import numpy as np

from ...scfpf_addon.bridge.blender.all_or_nothing import keep
from ...scfpf_addon.bridge.blender.scene_objects import object_by_uid
from ...scfpf_addon.bridge.camera.flexible_camera import control_objects
from ...scfpf_addon.shading.picking.find import find, points_of
from ...scfpf_addon.shading.picking.pick import pick
from ..common.target import editable_camera, selected_objects
from ..common.tool import Action
from ..common.words import report_text
from .pick import store_pick
from .preparation import poll_no_render, prepared_inputs, redraw_interface


def wanted_objects(context) -> list:
    """The selected objects, without cameras, control surfaces and volume objects."""
    own = control_objects()
    return [o for o in selected_objects(context) if o.type != "CAMERA" and o.name_full not in own]


def _origins(objects):
    """The origins of objects (3, N), which stand for those without faces, such as lamps."""
    return np.array([obj.matrix_world.translation for obj in objects], np.float64).reshape(-1, 3).T


def _description(title: str, found) -> str:
    """The found object and its visibility, in a few short parts."""
    left, low, right, high = found.box
    parts = [
        title,
        report_text("{0:.1%} × {1:.1%} of the picture", right - left, high - low).replace("%", " %"),
    ]
    if found.shown < 1:
        parts.append("Partly outside the picture")
    if found.hidden == 1:
        parts.append(report_text("Hidden from the camera behind {0}", found.hider))
    elif found.hidden > 0:
        parts.append(report_text("Partly hidden behind {0}", found.hider))
    return " · ".join(parts)


class SCFPF_OT_find_in_image(Action, bpy.types.Operator):
    """Find the selected objects in the picture: mark them there, and draw the projector through their
    middle"""

    bl_idname = "scfpf.find_in_image"
    bl_label = "Find in Picture"

    @classmethod
    def poll(cls, context):
        if not poll_no_render(cls, context):
            return False
        if not wanted_objects(context):
            cls.poll_message_set("Select the objects to find in the picture")
            return False
        return True

    def act(self, context):
        wanted = wanted_objects(context)
        names = {obj.name for obj in wanted}
        title = wanted[0].name if len(wanted) == 1 else report_text("{0} objects", len(wanted))
        origins = _origins(wanted)
        camera = editable_camera(context, "")
        uid = camera.session_uid
        inputs = prepared_inputs(context, camera)
        pixel = 1 / inputs.settings.width, 1 / inputs.settings.height
        points = points_of(inputs.scene, names)
        points = points if points.size else origins
        found = find(inputs.projection, inputs.scene, points, names, pixel)
        centre = None if found is None else pick(inputs.projection, inputs.scene, *found.centre, pixel)
        settings = object_by_uid(uid).scfpf
        keep(settings)
        settings.show_found = found is not None
        if found is None:
            self.report({"WARNING"}, report_text("{0} is outside the picture", title))
        else:
            settings.found_box, settings.found_object = found.box, _description(title, found)
            if centre is not None:
                store_pick(settings, *found.centre, centre)
        redraw_interface(context.window_manager)
        return None if found is None else settings.found_object


def _object_menu(menu, _context):
    menu.layout.separator()
    menu.layout.operator("scfpf.find_in_image", icon="VIEWZOOM")


_register_classes, _unregister_classes = bpy.utils.register_classes_factory((SCFPF_OT_find_in_image,))


def register():
    _register_classes()
    bpy.types.VIEW3D_MT_object.append(_object_menu)


def unregister():
    bpy.types.VIEW3D_MT_object.remove(_object_menu)
    _unregister_classes()
