# SPDX-License-Identifier: GPL-3.0-or-later
"""Drag the picture of a layer, or scale it, over the image."""

import bpy
import numpy as np
from bpy.props import FloatProperty, FloatVectorProperty

from ...scfpf_addon.bridge.blender.scene_objects import object_by_uid
from ...scfpf_addon.bridge.blender.unstored_edits import note_edit
from ...scfpf_addon.bridge.blender.user_errors import USER_ERRORS
from ...scfpf_addon.bridge.frames.layer_frames import layer_frame
from ...scfpf_addon.bridge.frames.shown_image import shown_image
from ..common.errors import refused
from ..common.frame_drag_job import FrameDragging, pressed_part, whole_image
from ..common.modal_job import ModalJob
from ..common.target import flexible_camera_of, poll_flexible_camera
from .layer_list import layer_index, layer_place

# The limits of the property Size.
SMALLEST, LARGEST = 0.01, 20.0
KEYS = (
    "G: move    S: size    X, Y: along an axis    Arrows or a number: exactly    Shift: fine    Ctrl: steps"
    "    Release or Enter: accept    Esc, right click: restore"
)


class SCFPF_OT_layer_drag(FrameDragging, ModalJob, bpy.types.Operator):
    """Move or scale the active layer in the picture, by mouse, keys or numbers"""

    bl_idname = "scfpf.layer_drag"
    bl_label = "Drag Layer"
    bl_options = {"REGISTER", "UNDO"}

    shift: FloatVectorProperty(
        name="Move", description="Movement, as shares of the picture's width and height", size=2
    )
    factor: FloatProperty(name="Size", description="Factor by which the size changes", default=1.0, min=0.01)
    index: layer_index()

    @classmethod
    def poll(cls, context):
        if not poll_flexible_camera(cls, context):
            return False
        if not len(flexible_camera_of(context).scfpf.layers):
            cls.poll_message_set("Add a layer to the list first")
            return False
        return True

    def execute(self, context):
        note_edit()
        try:
            self._choose(flexible_camera_of(context))
        except USER_ERRORS as error:
            return refused(self, error)
        self._place()
        return {"FINISHED"}

    def invoke(self, context, event):
        image = shown_image(context)
        camera = flexible_camera_of(context) if image is None else image.camera
        self.shift, self.factor = (0.0, 0.0), 1.0
        try:
            self._choose(camera)
            image = image or whole_image(context, camera)
            shown = layer_frame(self.index, self._layer(), image)
            self.begin_drag(context, event, image, shown, pressed_part(context, event, [shown])[1])
        except USER_ERRORS as error:
            return refused(self, error)
        outcome = self.begin(context)
        self._say(context)
        return outcome

    def is_lost(self):
        return object_by_uid(self._camera) is None

    def escape(self, context):
        return {"CANCELLED"}

    def respond(self, context, event):
        if self.ends_drag(event):
            return {"CANCELLED"} if self.is_click else {"FINISHED"}
        if self.take_event(event):
            self.shift, self.factor, *_ = self.dragged
            self._place()
            self._say(context)
        return {"RUNNING_MODAL"}

    def _choose(self, camera) -> None:
        """Make the layer active, and keep where it is. Raises UserError."""
        self.index, self._camera = layer_place(camera, self.index), camera.session_uid
        camera.scfpf.active_layer = self.index
        layer = self._layer()
        self._before = tuple(layer.position), tuple(layer.size)

    def _layer(self):
        return object_by_uid(self._camera).scfpf.layers[self.index]

    def _place(self) -> None:
        """Put the layer where the properties say, from where it was. Its proportions stay."""
        layer, (position, size) = self._layer(), self._before
        factor = float(np.clip(self.factor, SMALLEST / min(size), LARGEST / max(size)))
        layer.position = position[0] + self.shift[0], position[1] + self.shift[1]
        layer.size = size[0] * factor, size[1] * factor

    def _say(self, context) -> None:
        """Tell the keys and the numbers, and redraw the frame."""
        layer = self._layer()
        (x, y), (width, height) = layer.position, layer.size
        text = f"{layer.name}: x {x:.1%}  y {y:.1%}  size {width:.1%} × {height:.1%}"
        self.show_drag(context, text, KEYS)

    def give_up(self, context):
        """Restore the layer."""
        camera = object_by_uid(self._camera)
        if camera is not None and self.index < len(camera.scfpf.layers):
            layer = self._layer()
            layer.position, layer.size = self._before


register, unregister = bpy.utils.register_classes_factory((SCFPF_OT_layer_drag,))
