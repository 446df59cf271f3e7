# SPDX-License-Identifier: GPL-3.0-or-later
"""The properties of one mapping of the image, in the stack ``Object.scfpf.mappings``."""

from __future__ import annotations

import math

import bpy
from bpy.props import (
    BoolProperty,
    EnumProperty,
    FloatProperty,
    FloatVectorProperty,
    PointerProperty,
    StringProperty,
)

from ...projection.mappings.kinds import COEFFICIENT, INFLUENCE, KINDS, PLACE, RADIUS
from ..camera import flexible_camera
from ..mappings import mapping_edits
from .property_options import ANIMATABLE, OVERRIDABLE

MAPPING_KINDS = (
    ("RADIAL_CURVE", "Radial Curve", "A curve from the distance in the picture to the distance to look up"),
    ("LENS", "Magic Lens", "Magnify a round part of the picture"),
    (
        "DISTORTION",
        "Lens Distortion",
        "Distort as a photographic lens: Brown's polynomial over a second one (the division model, OpenCV's)",
    ),
    ("ST_MAP", "ST Map", "An image whose red and green are the position to look up at each pixel"),
    (
        "GRID",
        "Deformed Grid",
        "A flat mesh over the picture whose moved vertices are the positions to look up",
    ),
    ("DISPLAY", "Curved Display", "Correct for a curved screen, so that its viewer sees a flat picture"),
)


def _kind_changed(mapping, context):
    """The mapping gets the curve or the mesh that its new kind needs."""
    camera = mapping.id_data
    if not camera.is_evaluated and camera.is_editable:
        mapping_edits.take_kind(camera, mapping)
        flexible_camera.surfaces_edited(camera)


def _grid_changed(mapping, context):
    """The volume object keeps the mesh evaluated."""
    flexible_camera.surfaces_edited(mapping.id_data)


def _may_be_grid(_mapping, candidate) -> bool:
    return candidate.type == "MESH" and not candidate.scfpf_surface.is_volume


def _may_be_curve(_mapping, candidate) -> bool:
    return mapping_edits.curve_node(candidate) is not None


class SCFPF_ImageMapping(bpy.types.PropertyGroup):
    """One mapping of the image. Change the order through ``mapping_edits``, which takes animation along."""

    name: StringProperty(name="Name", description="Name of the mapping in the list", **ANIMATABLE)
    enabled: BoolProperty(
        name="Enabled",
        description="Let the mapping act on the picture",
        default=True,
        **ANIMATABLE,
    )
    kind: EnumProperty(
        name="Kind",
        description="How the mapping moves positions in the picture",
        items=MAPPING_KINDS,
        default="LENS",
        options=set(),
        update=_kind_changed,
        override=OVERRIDABLE,
    )
    influence: FloatProperty(
        name="Influence",
        description="Strength of the mapping: 0 has no effect, 1 is the full effect, more exaggerates it, "
        "less than 0 reverses it",
        default=1.0,
        min=INFLUENCE.low,
        max=INFLUENCE.high,
        soft_min=0.0,
        soft_max=1.0,
        **ANIMATABLE,
    )
    backwards: BoolProperty(
        name="Backwards",
        description="Use the inverse mapping: remove a distortion instead of adding it",
        default=False,
        **ANIMATABLE,
    )
    centre: FloatVectorProperty(
        name="Center",
        description="Center of the mapping, as shares of the picture from its lower left",
        size=2,
        default=(0.5, 0.5),
        min=PLACE.low,
        max=PLACE.high,
        soft_min=0.0,
        soft_max=1.0,
        step=1,
        precision=4,
        **ANIMATABLE,
    )
    radius: FloatProperty(
        name="Radius",
        description="Radius of the lens, or unit of distance of the polynomials, in halves of the "
        "picture's shorter side",
        default=0.5,
        min=RADIUS.low,
        max=RADIUS.high,
        soft_max=3.0,
        step=1,
        precision=3,
        **ANIMATABLE,
    )
    magnification: FloatProperty(
        name="Magnification",
        description="Magnification in the middle of the lens: below 1 it shrinks",
        default=2.0,
        min=KINDS["LENS"]["magnification"].low,
        max=KINDS["LENS"]["magnification"].high,
        soft_min=0.25,
        soft_max=8.0,
        **ANIMATABLE,
    )
    falloff: FloatProperty(
        name="Falloff",
        description="Outer share of the lens, in which the magnification fades out",
        default=0.5,
        min=0.0,
        max=1.0,
        subtype="FACTOR",
        **ANIMATABLE,
    )
    numerator: FloatVectorProperty(
        name="K1 to K3",
        description="Coefficients of the distance's 2nd, 4th and 6th power in the polynomial by which "
        "distances are multiplied",
        size=3,
        default=(0.0, 0.0, 0.0),
        min=COEFFICIENT.low,
        max=COEFFICIENT.high,
        soft_min=-1.0,
        soft_max=1.0,
        step=1,
        precision=4,
        **ANIMATABLE,
    )
    denominator: FloatVectorProperty(
        name="K4 to K6",
        description="Coefficients of the distance's 2nd, 4th and 6th power in the polynomial by which "
        "distances are divided; K4 alone is the division model",
        size=3,
        default=(0.0, 0.0, 0.0),
        min=COEFFICIENT.low,
        max=COEFFICIENT.high,
        soft_min=-1.0,
        soft_max=1.0,
        step=1,
        precision=4,
        **ANIMATABLE,
    )
    arc: FloatProperty(
        name="Arc",
        description="The angle that the curved screen spans about its upright axis",
        default=math.radians(90.0),
        min=math.radians(KINDS["DISPLAY"]["arc_degrees"].low),
        max=math.radians(KINDS["DISPLAY"]["arc_degrees"].high),
        subtype="ANGLE",
        **ANIMATABLE,
    )
    distance: FloatProperty(
        name="Viewer Distance",
        description="From the viewer to the middle of the screen, in radii of its curve: 1 is its axis",
        default=1.0,
        min=KINDS["DISPLAY"]["distance"].low,
        max=KINDS["DISPLAY"]["distance"].high,
        soft_min=0.5,
        soft_max=4.0,
        **ANIMATABLE,
    )
    curve: PointerProperty(
        name="Curve",
        description="The node group that holds the radial curve",
        type=bpy.types.NodeTree,
        poll=_may_be_curve,
        **ANIMATABLE,
    )
    image: PointerProperty(
        name="Image",
        description="The ST map: red and green are the horizontal and vertical position to look up, from "
        "0 to 1. Where alpha is 0 the picture is empty",
        type=bpy.types.Image,
        **ANIMATABLE,
    )
    grid: PointerProperty(
        name="Grid",
        description="A mesh whose UV map is a regular grid over the picture. X and Y of its vertices, "
        "from 0 to 1, are the positions to look up there",
        type=bpy.types.Object,
        poll=_may_be_grid,
        update=_grid_changed,
        override=OVERRIDABLE,
    )


register, unregister = bpy.utils.register_classes_factory((SCFPF_ImageMapping,))
