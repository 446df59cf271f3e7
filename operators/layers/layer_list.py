# SPDX-License-Identifier: GPL-3.0-or-later
"""The list of layers: add, remove and move them."""

from __future__ import annotations

import bpy
from bpy.props import EnumProperty, IntProperty

from ...scfpf_addon.bridge.blender.slot_animation import LAYERS, move_slot, remove_slot
from ...scfpf_addon.bridge.layers.layer_edits import add_layer
from ...scfpf_addon.bridge.render.image_size import image_aspect
from ...scfpf_addon.bridge.settings.layer_properties import FRONTS
from ...scfpf_addon.projection.user_error import UserError
from ..aim.aim_camera import AimAction, camera_name, chosen, thing_name
from ..aim.targets import collection_of, selected_things
from ..common.target import selected_objects
from ..common.tool import STEPS
from ..common.words import report_text


def layer_index():
    """The property by which operators take a layer."""
    return IntProperty(
        name="Index",
        description="Place in the list of layers; -1 is the active one",
        default=-1,
        min=-1,
        options={"SKIP_SAVE"},
    )


def layer_place(camera, index: int) -> int:
    """The place of a camera's layer. index: -1 for the active one. Raises UserError."""
    index = camera.scfpf.active_layer if index < 0 else index
    if index >= len(camera.scfpf.layers):
        raise UserError("'{0}' has no layer at place {1}: add one with Add Layer", camera.name, index + 1)
    return index


class SCFPF_OT_layer_add(AimAction, bpy.types.Operator):
    """Add a layer: the picture shows the selected objects as another camera sees them, which is a selected
    one or a new one in the place of this one, and the rest as before"""

    bl_idname = "scfpf.layer_add"
    bl_label = "Add Layer"
    makes_flexible = True

    camera: camera_name()
    collection: thing_name("Collection", "Name of the collection to show; empty for the selection")
    seen_by: thing_name(
        "Seen By", "Name of the camera that sees the collection; empty for a selected or a new one"
    )
    front: EnumProperty(
        name="In Front",
        description="What decides which of two things hides the other",
        items=FRONTS,
        default="DEPTH",
        options={"SKIP_SAVE"},
    )

    def edit(self, context, camera):
        collection = chosen(bpy.data.collections, self.collection, "collection")
        eye = chosen(bpy.data.objects, self.seen_by, "object")
        if eye is None:
            cameras = [obj for obj in selected_objects(context) if obj.type == "CAMERA" and obj != camera]
            eye = cameras[0] if len(cameras) == 1 else None
        elif eye.type != "CAMERA" or eye == camera:
            raise UserError("'{0}' cannot see a layer: choose another camera", eye.name)
        objects = selected_things(context)
        if collection is None and not objects:
            raise UserError("Select the objects that the layer is to show")
        shown = collection or collection_of(context, objects)
        layer = add_layer(camera, shown, image_aspect(context.scene), eye)
        layer.front = self.front
        return report_text("Move '{0}' to where the layer is to be seen from", layer.camera.name)


class SCFPF_OT_layer_remove(AimAction, bpy.types.Operator):
    """Remove the layer, but not its objects and its camera"""

    bl_idname = "scfpf.layer_remove"
    bl_label = "Remove Layer"

    camera: camera_name()
    index: layer_index()

    def edit(self, context, camera):
        remove_slot(camera.scfpf, layer_place(camera, self.index), LAYERS)


class SCFPF_OT_layer_move(AimAction, bpy.types.Operator):
    """Move the layer in the list, where by Order layers are in front of those below them"""

    bl_idname = "scfpf.layer_move"
    bl_label = "Move Layer"

    camera: camera_name()
    index: layer_index()
    direction: EnumProperty(
        name="Direction",
        description="Direction in the list",
        items=(("UP", "Up", "Towards the top"), ("DOWN", "Down", "Towards the bottom")),
        default="UP",
    )

    def edit(self, context, camera):
        index = layer_place(camera, self.index)
        move_slot(camera.scfpf, index, index + STEPS[self.direction], LAYERS)


register, unregister = bpy.utils.register_classes_factory(
    (SCFPF_OT_layer_add, SCFPF_OT_layer_remove, SCFPF_OT_layer_move)
)
