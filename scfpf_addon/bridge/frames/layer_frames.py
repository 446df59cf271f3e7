# SPDX-License-Identifier: GPL-3.0-or-later
"""The frame of the active layer over the image: corners scale the layer's picture, its middle moves it."""

from __future__ import annotations

import bpy
import numpy as np

from ...shading.picking.frame_handles import HandledFrame
from ..layers.read_image_layers import lacking
from .frame_widgets import FrameGizmo, FrameGroup
from .shown_frame import ShownFrame
from .shown_image import ShownImage

DRAG = "scfpf.layer_drag"


def layer_frame(index: int, layer, image: ShownImage) -> ShownFrame:
    """The frame of a layer's picture in a region."""
    place = np.array(layer.position, np.float64)
    corners = place[:, None] + np.array(layer.size, np.float64)[:, None] / 2 * np.array([[-1, 1], [-1, 1]])
    origin = image.pixels(place[:, None])[:, 0]
    frame = HandledFrame.around(image.pixels(corners), origin, 0.0, has_grip=True)
    return ShownFrame(index, origin, frame, True, layer.name)


def _shown_layer(settings):
    """The active layer and its place in the list if the image shows it, else None and its place."""
    index = settings.active_layer
    layer = settings.layers[index] if index < len(settings.layers) else None
    is_shown = settings.enabled and layer is not None and layer.is_on and not lacking(layer)
    return index, layer if is_shown else None


class SCFPF_GT_layer(FrameGizmo, bpy.types.Gizmo):
    """The frame of the active layer in a region"""

    bl_idname = "SCFPF_GT_layer"
    __slots__ = ("_hovered",)

    def frames(self, _context, image):
        index, layer = _shown_layer(image.camera.scfpf)
        return [] if layer is None else [layer_frame(index, layer, image)]


class _LayerGroup(FrameGroup):
    bl_label = "Layers"
    gizmo, drag = SCFPF_GT_layer.bl_idname, DRAG

    @classmethod
    def has_frames(cls, settings):
        return _shown_layer(settings)[1] is not None


class SCFPF_GGT_layer_viewport(_LayerGroup, bpy.types.GizmoGroup):
    bl_idname = "SCFPF_GGT_layer_viewport"
    bl_space_type = "VIEW_3D"


class SCFPF_GGT_layer_image(_LayerGroup, bpy.types.GizmoGroup):
    bl_idname = "SCFPF_GGT_layer_image"
    bl_space_type = "IMAGE_EDITOR"


register, unregister = bpy.utils.register_classes_factory(
    (SCFPF_GT_layer, SCFPF_GGT_layer_viewport, SCFPF_GGT_layer_image)
)
