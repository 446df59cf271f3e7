# SPDX-License-Identifier: GPL-3.0-or-later
"""The properties ``Object.scfpf.blend_field`` of a blend's map: where the second camera counts.

Further cameras have such a map each.
"""

from __future__ import annotations

import bpy

from ..blends.camera_blend import write_map
from .property_options import OVERRIDABLE, choice, number, pointer, switch, vector

MAP_KINDS = (
    ("NONE", "Whole Picture", "The camera counts everywhere"),
    ("LINEAR", "Gradient", "The camera counts on one side of a line"),
    ("RADIAL", "Circle", "The camera counts in a circle"),
    ("RECTANGLE", "Rectangle", "The camera counts in a rectangle, which may be turned"),
    ("IMAGE", "Image", "The camera counts where an image is white"),
    ("VIEWS", "Around Views", "The camera counts around its views of Aim, and less with the distance"),
)


def _changed(blend_map, _context) -> None:
    write_map(blend_map.id_data)


# Keyframes of these would change nothing: the surfaces hold the map.
_STATIC = {"options": set(), "override": OVERRIDABLE, "update": _changed}
# Keyframes of these are baked.
_BAKED = _STATIC | {"options": {"ANIMATABLE"}}


class SCFPF_BlendMap(bpy.types.PropertyGroup):
    """A blend map: where in the image one camera of a blend counts."""

    kind: choice("Blend Map", "Where in the picture the camera counts", MAP_KINDS, "NONE", **_STATIC)
    center: vector(
        "Center",
        "Place of the map's middle, as shares of the picture's width and height from its lower left",
        (0.5, 0.5),
        -2.0,
        3.0,
        soft_min=0.0,
        soft_max=1.0,
        precision=3,
        step=1,
        **_BAKED,
    )
    size: vector(
        "Size",
        "Width and height of the rectangle, as shares of the picture's; the width is the circle's diameter",
        (0.5, 0.5),
        0.0,
        4.0,
        soft_max=1.0,
        precision=3,
        step=1,
        **_BAKED,
    )
    angle: number(
        "Angle",
        "Direction in which the gradient grows, or the turn of the rectangle, counterclockwise",
        0.0,
        -6.283185307179586,
        6.283185307179586,
        subtype="ANGLE",
        **_BAKED,
    )
    border: number(
        "Border",
        "Width of the transition, as a share of the picture's width; 0 gives a sharp seam, and around "
        "views it lies outside",
        0.2,
        0.0,
        4.0,
        soft_max=1.0,
        precision=3,
        step=1,
        **_BAKED,
    )
    image: pointer(
        "Image",
        "An image over the whole picture, whose first channel is the map; press Update Blend after painting",
        bpy.types.Image,
        **(_STATIC | {"options": {"ANIMATABLE"}}),
    )
    is_sharp: switch(
        "Sharp",
        "Cut the surfaces along the edges of what is painted, where it is half white: press Update Blend "
        "after painting",
        False,
        **_STATIC,
    )
    is_inverted: switch("Invert", "Let the camera count where it did not, and the reverse", False, **_STATIC)
    weight: number(
        "Weight",
        "Strength of the camera in its map; where the strengths of cameras add up to more than 1, they share",
        1.0,
        0.0,
        100.0,
        soft_max=1.0,
        precision=3,
        step=1,
        **_BAKED,
    )


CLASSES = (SCFPF_BlendMap,)


def register():
    for cls in CLASSES:
        bpy.utils.register_class(cls)


def unregister():
    for cls in reversed(CLASSES):
        bpy.utils.unregister_class(cls)
