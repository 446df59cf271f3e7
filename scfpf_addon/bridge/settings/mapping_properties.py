# SPDX-License-Identifier: GPL-3.0-or-later
"""The properties of one mapping of the image, in the stack ``Object.scfpf.mappings``."""

from __future__ import annotations

import math

import bpy

from ...projection.mappings.kinds import COEFFICIENT, INFLUENCE, KINDS, PLACE, RADIUS
from ..camera import flexible_camera
from ..mappings import mapping_edits
from .property_options import choice, number, pointer, switch, text, vector

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
    ("CALIBRATION", "Calibrated Lens", "A measured lens, as Flexible Camera from Calibration reads it"),
)


def _kind_changed(mapping, context):
    """Give the mapping the curve or the mesh of its new kind."""
    camera = mapping.id_data
    if not camera.is_evaluated and camera.is_editable:
        mapping_edits.take_kind(camera, mapping)
        flexible_camera.surfaces_edited(camera)


def _grid_changed(mapping, context):
    """Let the volume object evaluate the mesh."""
    flexible_camera.surfaces_edited(mapping.id_data)


def _may_be_grid(_mapping, candidate) -> bool:
    return candidate.type == "MESH" and not candidate.scfpf_surface.is_volume


def _may_be_curve(_mapping, candidate) -> bool:
    return mapping_edits.curve_node(candidate) is not None


class SCFPF_ImageMapping(bpy.types.PropertyGroup):
    """One mapping of the image. Only ``slot_animation`` may change the order, together with the animation."""

    name: text("Name", "Name of the mapping in the list")
    enabled: switch("Enabled", "Let the mapping act on the picture", True)
    kind: choice(
        "Kind",
        "How the mapping moves positions in the picture",
        items=MAPPING_KINDS,
        default="LENS",
        options=set(),
        update=_kind_changed,
    )
    influence: number(
        "Influence",
        "Strength of the mapping: 0 has no effect, 1 is the full effect, more exaggerates it, "
        "less than 0 reverses it",
        1.0,
        INFLUENCE.low,
        INFLUENCE.high,
        soft_min=0.0,
        soft_max=1.0,
    )
    backwards: switch("Backwards", "Use the inverse mapping: remove a distortion instead of adding it")
    centre: vector(
        "Center",
        "Center of the mapping, as shares of the picture from its lower left",
        (0.5, 0.5),
        PLACE.low,
        PLACE.high,
        soft_min=0.0,
        soft_max=1.0,
        step=1,
        precision=4,
    )
    radius: number(
        "Radius",
        "Radius of the lens, or unit of distance of the polynomials, in halves of the picture's shorter side",
        0.5,
        RADIUS.low,
        RADIUS.high,
        soft_max=3.0,
        step=1,
        precision=3,
    )
    magnification: number(
        "Magnification",
        "Magnification in the middle of the lens: below 1 it shrinks",
        2.0,
        KINDS["LENS"]["magnification"].low,
        KINDS["LENS"]["magnification"].high,
        soft_min=0.25,
        soft_max=8.0,
    )
    falloff: number(
        "Falloff",
        "Outer share of the lens, in which the magnification fades out",
        0.5,
        0.0,
        1.0,
        subtype="FACTOR",
    )
    numerator: vector(
        "K1 to K3",
        "Coefficients of the distance's 2nd, 4th and 6th power in the polynomial by which "
        "distances are multiplied",
        (0.0, 0.0, 0.0),
        COEFFICIENT.low,
        COEFFICIENT.high,
        soft_min=-1.0,
        soft_max=1.0,
        step=1,
        precision=4,
    )
    denominator: vector(
        "K4 to K6",
        "Coefficients of the distance's 2nd, 4th and 6th power in the polynomial by which "
        "distances are divided; K4 alone is the division model",
        (0.0, 0.0, 0.0),
        COEFFICIENT.low,
        COEFFICIENT.high,
        soft_min=-1.0,
        soft_max=1.0,
        step=1,
        precision=4,
    )
    arc: number(
        "Arc",
        "The angle that the curved screen spans about its upright axis",
        math.radians(90.0),
        math.radians(KINDS["DISPLAY"]["arc_degrees"].low),
        math.radians(KINDS["DISPLAY"]["arc_degrees"].high),
        subtype="ANGLE",
    )
    distance: number(
        "Viewer Distance",
        "From the viewer to the middle of the screen, in radii of its curve: 1 is its axis",
        1.0,
        KINDS["DISPLAY"]["distance"].low,
        KINDS["DISPLAY"]["distance"].high,
        soft_min=0.5,
        soft_max=4.0,
    )
    calibration: text("Calibration", "The numbers of the measured lens, with all digits")
    curve: pointer(
        "Curve", "The node group that holds the radial curve", bpy.types.NodeTree, poll=_may_be_curve
    )
    image: pointer(
        "Image",
        "The ST map: red and green are the horizontal and vertical position to look up, from 0 to 1, and "
        "where alpha is 0 the picture is empty",
        bpy.types.Image,
    )
    grid: pointer(
        "Grid",
        "A mesh whose UV map is a regular grid over the picture, and whose vertices have the positions to "
        "look up there as X and Y, from 0 to 1",
        bpy.types.Object,
        poll=_may_be_grid,
        update=_grid_changed,
    )


register, unregister = bpy.utils.register_classes_factory((SCFPF_ImageMapping,))
