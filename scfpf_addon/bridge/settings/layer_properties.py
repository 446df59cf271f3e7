# SPDX-License-Identifier: GPL-3.0-or-later
"""The properties of image layers, the list ``Object.scfpf.layers``.

Switches and numbers are keyframable; the order of the list is not.
"""

from __future__ import annotations

import bpy

from .property_options import STATIC, choice, number, pointer, switch, text, vector

FRONTS = (
    ("DEPTH", "Depth", "Whatever is nearer to this camera is in front, point by point"),
    (
        "ANCHOR",
        "Anchor",
        "The layer counts as one thing as far away from this camera as the middle of its collection",
    ),
    ("ORDER", "Order", "The layer is in front of the rest and of the layers below it in the list"),
)


def _may_see(layer, candidate) -> bool:
    return candidate.type == "CAMERA" and candidate != layer.id_data


class SCFPF_ImageLayer(bpy.types.PropertyGroup):
    """Things that the image shows as another camera sees them.

    Only ``slot_animation`` may reorder and remove layers.
    """

    name: text("Name", "Name of the layer in the list")
    is_on: switch(
        "Use Layer", "Show the layer's collection as its camera sees it, instead of as this one does", True
    )
    collection: pointer("Collection", "The things that the layer shows", bpy.types.Collection)
    camera: pointer(
        "Seen By",
        "The camera, flexible or not, that sees the layer's collection",
        bpy.types.Object,
        poll=_may_see,
    )
    front: choice(
        "In Front", "What decides which of two things hides the other", items=FRONTS, default="DEPTH"
    )
    position: vector(
        "Position",
        "Place of the middle of the layer's picture, as shares of this one from its lower left",
        (0.5, 0.5),
        -2.0,
        3.0,
        soft_min=0.0,
        soft_max=1.0,
        precision=3,
        step=1,
    )
    size: vector(
        "Size",
        "Width and height of the layer's picture, as shares of this one's",
        (1.0, 1.0),
        0.01,
        20.0,
        soft_max=2.0,
        precision=3,
        step=1,
    )
    mask: pointer(
        "Mask",
        "An image over the whole picture: the layer is shown where it is white, hidden where it is black",
        bpy.types.Image,
    )
    halo: number(
        "Halo",
        "Distance around the collection within which the layer shows the rest of the scene, too: the ground "
        "on which a thing stands",
        0.0,
        0.0,
        1e6,
        soft_max=10.0,
        subtype="DISTANCE",
    )
    feather: number(
        "Feather",
        "Outer part of the halo in which it fades into the rest of the picture",
        0.0,
        0.0,
        1.0,
        subtype="FACTOR",
    )
    color: vector(
        "Color",
        "Color of the layer in the picture of Check Layers",
        (0.0, 0.0, 0.0),
        0.0,
        1.0,
        subtype="COLOR_GAMMA",
        **STATIC,
    )
    share: number(
        "Share",
        "Share of the picture in which the layer is seen; -1 before Check Layers",
        -1.0,
        -1.0,
        1.0,
        **STATIC,
    )
    message: text("Message", "What Check Layers has found", **STATIC)


CLASSES = (SCFPF_ImageLayer,)


def register():
    for cls in CLASSES:
        bpy.utils.register_class(cls)


def unregister():
    for cls in reversed(CLASSES):
        bpy.utils.unregister_class(cls)
