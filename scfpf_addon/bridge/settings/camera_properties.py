# SPDX-License-Identifier: GPL-3.0-or-later
"""The properties of a flexible camera, ``Object.scfpf``, and of a control surface, ``Object.scfpf_surface``.

They belong to the object, not to its data: duplicates of objects remap pointers, and library overrides of
objects survive a reload.
"""

from __future__ import annotations

import math

import bpy
from bpy.props import (
    CollectionProperty,
    FloatProperty,
    PointerProperty,
)

from ...projection.volume.basis import LARGEST_WEIGHT, SMALLEST_WEIGHT
from ..blends.camera_blend import LARGEST_BLEND, SMALLEST_BLEND
from ..camera import by_distance, flexible_camera
from ..surfaces import surface_object
from ..surfaces.kinds import KINDS_OR_NONE
from ..volume import edit_mode
from .aim_properties import SCFPF_Aim, SCFPF_AimTarget
from .blend_properties import SCFPF_BlendMap
from .hidden_properties import SCFPF_HiddenThing
from .layer_properties import SCFPF_ImageLayer
from .mapping_properties import SCFPF_ImageMapping
from .property_options import (
    MARK,
    OVERRIDABLE,
    STATIC,
    choice,
    integer,
    list_index,
    number,
    pointer,
    switch,
    text,
    vector,
)

BASES = (
    (
        "BEZIER",
        "Bézier",
        "One curve that the surfaces between near and far bend; with two surfaces it is straight",
    ),
    ("POLYLINE", "Polyline", "Straight pieces from each surface to the next"),
    (
        "B_SPLINE",
        "B-Spline",
        "A smooth curve on which each surface acts near by only; up to four surfaces it is the Bézier curve",
    ),
    (
        "NURBS",
        "NURBS",
        "The B-spline with a weight for each surface; with three surfaces an arc of a circle, for example",
    ),
    ("SMOOTH", "Smooth", "A curve that runs through all surfaces, without a corner at any of them"),
)
REPARAMETERISATIONS = (
    ("RECTANGLE", "Rectangle", "The picture's width runs along u and its height along v"),
    ("POLAR", "Polar", "The angle about the picture's center runs along u, the distance from it along v"),
)


def _volume_changed(owner, context):
    """Update the volume object."""
    flexible_camera.surfaces_edited(owner.id_data)


def _enabled_changed(settings, context):
    """Update the volume object and the size of Blender's own frame of the camera."""
    flexible_camera.flexibility_edited(settings.id_data)


def _edit_volume_changed(settings, context):
    """Show the surfaces in front and selectable, or not."""
    if not settings.id_data.is_evaluated:
        edit_mode.show_by_mode(settings.id_data)


def _kind_changed(settings, context):
    """Give the object the node group or the mesh of its new kind."""
    surface = settings.id_data
    if surface.type == "MESH" and surface.is_editable and not surface.is_evaluated:
        surface_object.take_kind(surface)


def _distance_changed(own, context):
    """Keep the planes of a camera in the order of distance."""
    surface = own.id_data
    if surface.is_editable and not surface.is_evaluated:
        by_distance.distance_edited(surface)


def _may_be_surface(slot, candidate) -> bool:
    return flexible_camera.may_be_surface(candidate)


def _may_be_volume(settings, candidate) -> bool:
    return candidate.type == "MESH" and candidate.parent == settings.id_data


def _may_be_end(ends, candidate) -> bool:
    return candidate.type == "CAMERA" and candidate.scfpf.enabled and candidate != ends.id_data


class SCFPF_SurfaceSlot(bpy.types.PropertyGroup):
    """One place in a flexible camera's ordered list of control surfaces.

    Only ``slot_animation`` may change the order, together with the slots' animation.
    """

    object: pointer(
        "Control Surface",
        "The object whose shape is this control surface",
        bpy.types.Object,
        poll=_may_be_surface,
        update=_volume_changed,
    )
    weight: number(
        "Weight",
        "Pull of this surface on NURBS projectors, compared with the others; on smooth projectors its place, "
        "which rises from each surface to the next as distances do",
        1.0,
        SMALLEST_WEIGHT,
        LARGEST_WEIGHT,
        soft_min=0.01,
        soft_max=100.0,
        precision=3,
        step=10,
    )


class SCFPF_SurfaceSettings(bpy.types.PropertyGroup):
    """``Object.scfpf_surface``: an object as a control surface."""

    kind: choice(
        "Kind",
        "How the object's shape is read as a control surface",
        items=KINDS_OR_NONE,
        default="NONE",
        options=set(),
        update=_kind_changed,
    )
    is_volume: switch(
        "Volume Object", "This object keeps the control surfaces of its parent camera evaluated", **MARK
    )
    is_made: switch(
        "Made for a Camera",
        "This control surface was made for a flexible camera and is deleted with it",
        **MARK,
    )
    is_by_distance: switch(
        "By Distance", "Drivers place this plane by its distance and its field of view", **MARK
    )
    distance: FloatProperty(
        name="Distance",
        description="Distance from the camera at which the picture has this field of view",
        default=1.0,
        min=1e-6,
        max=1e12,
        soft_min=0.01,
        subtype="DISTANCE",
        override=OVERRIDABLE,
        update=_distance_changed,
    )
    angle: number(
        "Field of View",
        "Angle between the left and the right border of the picture, for things at this distance: what has a "
        "wide one looks small",
        math.radians(40.0),
        math.radians(0.01),
        math.radians(175.0),
        subtype="ANGLE",
    )
    shift: vector(
        "Shift",
        "How far things at this distance move left and down, in widths of the picture",
        (0.0, 0.0),
        -10.0,
        10.0,
        soft_min=-1.0,
        soft_max=1.0,
        precision=3,
        step=1,
    )
    hidden_in: text(
        "Hidden With Camera In",
        "The view layers, one a line, in which this control surface is hidden with its camera",
        **MARK,
    )


class SCFPF_BlendEnds(bpy.types.PropertyGroup):
    """The two ends of a camera made by Blend Cameras, from which Update Blend makes it anew."""

    first: pointer(
        "From",
        "The flexible camera at Blend 0: press Update Blend after choosing another one",
        bpy.types.Object,
        poll=_may_be_end,
    )
    second: pointer(
        "To",
        "The flexible camera at Blend 1, instead of a preset: press Update Blend after choosing another one",
        bpy.types.Object,
        poll=_may_be_end,
    )
    preset: text("Preset", "File name of the preset at Blend 1, if no camera is chosen")


class SCFPF_BlendFurther(bpy.types.PropertyGroup):
    """A further camera of a blend. Only ``slot_animation`` may remove one."""

    camera: pointer(
        "Further Camera",
        "A further flexible camera of the blend: press Update Blend after choosing another one",
        bpy.types.Object,
        poll=_may_be_end,
    )
    field: pointer("Map", "Where in the picture the further camera counts", SCFPF_BlendMap)


class _Display:
    """The part of ``Object.scfpf`` that viewports and Image Editors draw: lines, marks and Live View."""

    show_live: switch(
        "Live View",
        "Show in 3D viewports that look through this camera what its projectors see, in Solid and Material "
        "Preview shading",
        True,
        **STATIC,
    )
    show_projectors: switch(
        "Show Projectors", "Draw the control surfaces and some projectors in the 3D viewport", True, **STATIC
    )
    projector_count: integer(
        "Projectors Drawn",
        "Number of projectors drawn across and up the picture",
        5,
        2,
        101,
        soft_max=21,
        **STATIC,
    )
    show_folds: switch(
        "Show Folds",
        "Draw projectors red where the volume is turned inside out and the picture mirrored",
        True,
        **STATIC,
    )
    iso_surfaces: integer(
        "Iso-Surfaces",
        "Number of surfaces of equal t drawn between the near and the far surface",
        0,
        0,
        64,
        soft_max=9,
        **STATIC,
    )
    iso_t: number(
        "Iso-Surface at", "The t of a single iso-surface: 0 is the near surface, 1 the far one", 0.5, 0.0, 1.0
    )
    show_pick: switch(
        "Show Picked Projector",
        "Draw the projector through the position in the picture that was picked last",
        **STATIC,
    )
    pick: vector(
        "Picked Position",
        "Picked position, as shares of the picture's width and height from its lower left",
        (0.5, 0.5),
        0.0,
        1.0,
        **STATIC,
    )
    pick_t: number(
        "Picked t",
        "t at which the picked projector meets the scene: 0 near surface, 1 far one, -1 for nothing",
        -1.0,
        -1.0,
        1.0,
        **STATIC,
    )
    pick_distance: FloatProperty(
        name="Picked Distance",
        description="Length of the picked projector from the near surface to the object that it meets",
        default=0.0,
        min=0.0,
        subtype="DISTANCE",
        **STATIC,
    )
    pick_object: text("Picked Object", "Name of the object that the picked projector met", **STATIC)
    show_found: switch("Show Found Object", "Mark the object that was found last in the picture", **STATIC)
    found_box: vector(
        "Found Object's Box",
        "Left, lower, right and upper border of the found object, as shares of the picture",
        (0.0, 0.0, 1.0, 1.0),
        0.0,
        1.0,
        **STATIC,
    )
    found_object: text(
        "Found Object", "Name of the object that was searched for, and how much of it is visible", **STATIC
    )


class SCFPF_CameraSettings(_Display, bpy.types.PropertyGroup):
    """``Object.scfpf`` of a camera object: its viewing volume and how it is rendered."""

    enabled: switch(
        "Flexible Projection",
        "Render through a viewing volume modeled with control surfaces",
        options=set(),
        update=_enabled_changed,
    )
    frame_sizes: vector(
        "Frame Sizes",
        "Display size of the camera before it was flexible, and the one it got then; 0 if absent",
        (0.0, 0.0),
        0.0,
        1000.0,
        **MARK,
    )
    surfaces: CollectionProperty(
        name="Control Surfaces",
        description="The control surfaces from near to far",
        type=SCFPF_SurfaceSlot,
        override={"LIBRARY_OVERRIDABLE", "USE_INSERTION"},
    )
    active_surface: list_index("Active Control Surface", "The control surface that is selected in the list")
    edit_volume: switch(
        "Edit Volume",
        "Show the control surfaces in front of the scene and make them selectable",
        options=set(),
        update=_edit_volume_changed,
    )
    basis: choice(
        "Projectors",
        "How a projector runs from the near surface through the others to the far one",
        items=BASES,
        default="BEZIER",
    )
    reparameterisation: choice(
        "Reparameterization",
        "How positions in the picture become the surfaces' parameters u and v",
        items=REPARAMETERISATIONS,
        default="RECTANGLE",
    )
    mappings: CollectionProperty(
        name="Image Mappings",
        description="Mappings of the picture, the first one nearest to it",
        type=SCFPF_ImageMapping,
        override={"LIBRARY_OVERRIDABLE", "USE_INSERTION"},
    )
    active_mapping: list_index("Active Image Mapping", "The mapping that is selected in the list")
    u_range: vector(
        "U Range",
        "The parameter u at the picture's left and right border (ends of the turn if polar)",
        (0.0, 1.0),
        0.0,
        1.0,
    )
    v_range: vector(
        "V Range",
        "The parameter v at the picture's lower and upper border (center and rim if polar)",
        (0.0, 1.0),
        0.0,
        1.0,
    )
    blend_factor: number(
        "Blend",
        "Blend between two cameras: 0 is the first one's picture, 1 the second's; other "
        "values go beyond them",
        0.0,
        SMALLEST_BLEND,
        LARGEST_BLEND,
        soft_min=0.0,
        soft_max=1.0,
        precision=3,
        step=1,
    )
    blend_ends: pointer("Blend Ends", "The two ends of a blend", SCFPF_BlendEnds)
    blend_field: pointer(
        "Blend Map", "Where in the picture the second camera of a blend counts", SCFPF_BlendMap
    )
    blend_more: CollectionProperty(
        name="Further Cameras",
        description="Cameras of a blend besides the first two, each with a map",
        type=SCFPF_BlendFurther,
        override={"LIBRARY_OVERRIDABLE", "USE_INSERTION"},
    )
    active_blend: list_index("Active Further Camera", "The further camera that is selected in the list")
    aim_targets: CollectionProperty(
        name="Aim Targets",
        description="The views, pins, lines and stays that Solve aims the picture at",
        type=SCFPF_AimTarget,
        override={"LIBRARY_OVERRIDABLE", "USE_INSERTION"},
    )
    active_aim: list_index("Active Aim Target", "The target that is selected in the list")
    aim: pointer("Aim", "Settings and results of Aim", SCFPF_Aim)
    layers: CollectionProperty(
        name="Layers",
        description="Collections that other cameras see in this camera's picture, the first one on top",
        type=SCFPF_ImageLayer,
        override={"LIBRARY_OVERRIDABLE", "USE_INSERTION"},
    )
    active_layer: list_index("Active Layer", "The layer that is selected in the list")
    layer_image: pointer(
        "Picture of Layers",
        "The image by Check Layers that shows in colors which layer each pixel belongs to",
        bpy.types.Image,
        options=set(),
    )
    hidden_things: CollectionProperty(
        name="Hidden Things",
        description="What Look Behind has found the picture to hide",
        type=SCFPF_HiddenThing,
        override={"LIBRARY_OVERRIDABLE", "USE_INSERTION"},
    )
    active_hidden: list_index("Active Hidden Thing", "The hidden thing that is selected in the list")
    hidden_message: text("Hidden", "What Look Behind has found last", **STATIC)
    pixel_error: number(
        "Pixel Error",
        "Largest error of a curved projector, in pixels: smaller is slower, 1 is for drafts, "
        "0 is exact and needs more memory",
        0.1,
        0.0,
        100.0,
        soft_max=1.0,
        precision=3,
        step=1,
    )
    samples: integer("Samples", "Projectors per pixel: more give smoother edges", 4, 1, 1024, soft_max=16)
    fit: choice(
        "Fit",
        "Side of the volume that changes when it is fitted to another resolution",
        items=(
            ("NONE", "None", "The volume does not depend on the picture's shape"),
            ("WIDTH", "Width", "The width along the camera's X axis; the height stays"),
            ("HEIGHT", "Height", "The height along the camera's Y axis; the width stays"),
            (
                "CROP",
                "Crop",
                "The U or V Range: it shows the largest part of the surfaces of the picture's shape",
            ),
        ),
        default="NONE",
        **STATIC,
    )
    fitted_aspect: number(
        "Fitted Aspect",
        "Width by height of the picture that the volume is made for",
        1.0,
        1e-6,
        1e6,
        **STATIC,
    )
    volume_object: pointer(
        "Volume Object",
        "The object that keeps every control surface evaluated, hidden ones too",
        bpy.types.Object,
        poll=_may_be_volume,
    )
    report: text("Last Render", "Size and time of the last render through this camera", **STATIC)
    statistics: text(
        "Statistics", "Rays, chords, triangles and memory of the last render through this camera", **STATIC
    )
    anchor_plan: text(
        "Plan", "The renders by another engine that Plan Renders has found this camera to need", **MARK
    )
    anchor_times: text(
        "Times", "How long renders by other engines took, from which the time of a plan is estimated", **MARK
    )


CLASSES = (
    SCFPF_SurfaceSlot,
    SCFPF_SurfaceSettings,
    SCFPF_BlendEnds,
    SCFPF_BlendFurther,
    SCFPF_CameraSettings,
)


def register():
    for cls in CLASSES:
        bpy.utils.register_class(cls)
    bpy.types.Object.scfpf = PointerProperty(
        name="Flexible Camera", type=SCFPF_CameraSettings, override=OVERRIDABLE
    )
    bpy.types.Object.scfpf_surface = PointerProperty(
        name="Control Surface", type=SCFPF_SurfaceSettings, override=OVERRIDABLE
    )


def unregister():
    del bpy.types.Object.scfpf_surface
    del bpy.types.Object.scfpf
    for cls in reversed(CLASSES):
        bpy.utils.unregister_class(cls)
