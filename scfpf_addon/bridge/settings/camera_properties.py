# SPDX-License-Identifier: GPL-3.0-or-later
"""The properties of a flexible camera (``Object.scfpf``) and of a control surface.

They are on the object, not on its data: there duplicates remap the pointers and
library overrides survive a reload.
"""

from __future__ import annotations

import bpy
from bpy.props import (
    BoolProperty,
    CollectionProperty,
    EnumProperty,
    FloatProperty,
    FloatVectorProperty,
    IntProperty,
    PointerProperty,
    StringProperty,
)

from ...projection.volume.basis import LARGEST_WEIGHT, SMALLEST_WEIGHT
from ..camera import flexible_camera
from ..camera.camera_blend import LARGEST_BLEND, SMALLEST_BLEND
from ..surfaces import surface_object
from ..surfaces.kinds import KINDS_OR_NONE
from ..volume import edit_mode
from .mapping_properties import SCFPF_ImageMapping
from .property_options import ANIMATABLE, MARK, OVERRIDABLE, STATIC

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
)
REPARAMETERISATIONS = (
    ("RECTANGLE", "Rectangle", "The picture's width runs along u and its height along v"),
    ("POLAR", "Polar", "The angle about the picture's center runs along u, the distance from it along v"),
)


def _volume_changed(owner, context):
    """The volume object follows an edit of a surface pointer."""
    flexible_camera.surfaces_edited(owner.id_data)


def _enabled_changed(settings, context):
    """The volume object follows, and Blender's own frame of the camera."""
    flexible_camera.flexibility_edited(settings.id_data)


def _edit_volume_changed(settings, context):
    """The surfaces come to the front and can be clicked, or get out of the way."""
    if not settings.id_data.is_evaluated:
        edit_mode.show_by_mode(settings.id_data)


def _kind_changed(settings, context):
    """The object gets the node group or the mesh that its new kind needs."""
    surface = settings.id_data
    if surface.type == "MESH" and surface.is_editable and not surface.is_evaluated:
        surface_object.take_kind(surface)


def _may_be_surface(slot, candidate) -> bool:
    return flexible_camera.may_be_surface(candidate)


def _may_be_volume(settings, candidate) -> bool:
    return candidate.type == "MESH" and candidate.parent == settings.id_data


def _may_be_end(ends, candidate) -> bool:
    return candidate.type == "CAMERA" and candidate.scfpf.enabled and candidate != ends.id_data


class SCFPF_SurfaceSlot(bpy.types.PropertyGroup):
    """One place in a flexible camera's ordered list of control surfaces.

    Change the order through ``slot_animation``, which takes the slots' animation along.
    """

    object: PointerProperty(
        name="Control Surface",
        description="The object whose shape is this control surface",
        type=bpy.types.Object,
        poll=_may_be_surface,
        update=_volume_changed,
        override=OVERRIDABLE,
    )
    weight: FloatProperty(
        name="Weight",
        description="Pull of this surface on NURBS projectors, compared with the others",
        default=1.0,
        min=SMALLEST_WEIGHT,
        soft_min=0.01,
        soft_max=100.0,
        max=LARGEST_WEIGHT,
        precision=3,
        step=10,
        **ANIMATABLE,
    )


class SCFPF_SurfaceSettings(bpy.types.PropertyGroup):
    """``Object.scfpf_surface``: what kind of control surface an object is."""

    kind: EnumProperty(
        name="Kind",
        description="How the object's shape is read as a control surface",
        items=KINDS_OR_NONE,
        default="NONE",
        options=set(),
        update=_kind_changed,
        override=OVERRIDABLE,
    )
    is_volume: BoolProperty(
        name="Volume Object",
        description="This object keeps the control surfaces of its parent camera evaluated",
        **MARK,
    )
    is_made: BoolProperty(
        name="Made for a Camera",
        description="This control surface was made for a flexible camera and is deleted with it",
        **MARK,
    )
    hidden_in: StringProperty(
        name="Hidden With Camera In",
        description="The view layers, one a line, in which this control surface is hidden with its camera",
        **MARK,
    )


class SCFPF_BlendEnds(bpy.types.PropertyGroup):
    """The two ends of a camera made by Blend Cameras, from which Update Blend makes it anew."""

    first: PointerProperty(
        name="From",
        description="The flexible camera at Blend 0. Press Update Blend after choosing another one",
        type=bpy.types.Object,
        poll=_may_be_end,
        **ANIMATABLE,
    )
    second: PointerProperty(
        name="To",
        description="The flexible camera at Blend 1, instead of a preset. Press Update Blend after "
        "choosing another one",
        type=bpy.types.Object,
        poll=_may_be_end,
        **ANIMATABLE,
    )
    preset: StringProperty(
        name="Preset",
        description="File name of the preset at Blend 1, if no camera is chosen",
        **ANIMATABLE,
    )


class SCFPF_CameraSettings(bpy.types.PropertyGroup):
    """``Object.scfpf`` of a camera object: its viewing volume and how it is rendered."""

    enabled: BoolProperty(
        name="Flexible Projection",
        description="Render through a viewing volume modeled with control surfaces",
        default=False,
        options=set(),
        update=_enabled_changed,
        override=OVERRIDABLE,
    )
    frame_sizes: FloatVectorProperty(
        name="Frame Sizes",
        description="Display size of the camera before it was flexible, and the one it got then; 0 if absent",
        size=2,
        default=(0.0, 0.0),
        min=0.0,
        max=1000.0,
        **MARK,
    )
    surfaces: CollectionProperty(
        name="Control Surfaces",
        description="The control surfaces from near to far",
        type=SCFPF_SurfaceSlot,
        override={"LIBRARY_OVERRIDABLE", "USE_INSERTION"},
    )
    active_surface: IntProperty(
        name="Active Control Surface",
        description="The control surface that is selected in the list",
        default=0,
        min=0,
        **STATIC,
    )
    edit_volume: BoolProperty(
        name="Edit Volume",
        description="Show the control surfaces in front of the scene and make them selectable",
        default=False,
        options=set(),
        update=_edit_volume_changed,
        override=OVERRIDABLE,
    )
    basis: EnumProperty(
        name="Projectors",
        description="How a projector runs from the near surface through the others to the far one",
        items=BASES,
        default="BEZIER",
        **ANIMATABLE,
    )
    reparameterisation: EnumProperty(
        name="Reparameterization",
        description="How positions in the picture become the surfaces' parameters u and v",
        items=REPARAMETERISATIONS,
        default="RECTANGLE",
        **ANIMATABLE,
    )
    mappings: CollectionProperty(
        name="Image Mappings",
        description="Mappings of the picture, the first one nearest to it",
        type=SCFPF_ImageMapping,
        override={"LIBRARY_OVERRIDABLE", "USE_INSERTION"},
    )
    active_mapping: IntProperty(
        name="Active Image Mapping",
        description="The mapping that is selected in the list",
        default=0,
        min=0,
        **STATIC,
    )
    u_range: FloatVectorProperty(
        name="U Range",
        description="The parameter u at the picture's left and right border (ends of the turn if polar)",
        size=2,
        default=(0.0, 1.0),
        min=0.0,
        max=1.0,
        **ANIMATABLE,
    )
    v_range: FloatVectorProperty(
        name="V Range",
        description="The parameter v at the picture's lower and upper border (center and rim if polar)",
        size=2,
        default=(0.0, 1.0),
        min=0.0,
        max=1.0,
        **ANIMATABLE,
    )
    blend_factor: FloatProperty(
        name="Blend",
        description="Blend between two cameras: 0 is the first one's picture, 1 the second's; other "
        "values go beyond them",
        default=0.0,
        min=SMALLEST_BLEND,
        max=LARGEST_BLEND,
        soft_min=0.0,
        soft_max=1.0,
        precision=3,
        step=1,
        **ANIMATABLE,
    )
    blend_ends: PointerProperty(
        name="Blend Ends",
        description="The two ends of a blend",
        type=SCFPF_BlendEnds,
        override=OVERRIDABLE,
    )
    pixel_error: FloatProperty(
        name="Pixel Error",
        description="Largest error of a curved projector, in pixels: smaller is slower, 1 is for drafts, "
        "0 is exact and needs more memory",
        default=0.1,
        min=0.0,
        soft_max=1.0,
        max=100.0,
        precision=3,
        step=1,
        **ANIMATABLE,
    )
    samples: IntProperty(
        name="Samples",
        description="Projectors per pixel: more give smoother edges",
        default=4,
        min=1,
        soft_max=16,
        max=1024,
        **ANIMATABLE,
    )
    show_projectors: BoolProperty(
        name="Show Projectors",
        description="Draw the control surfaces and some projectors in the 3D viewport",
        default=True,
        **STATIC,
    )
    projector_count: IntProperty(
        name="Projectors Drawn",
        description="Number of projectors drawn across and up the picture",
        default=5,
        min=2,
        soft_max=21,
        max=101,
        **STATIC,
    )
    show_folds: BoolProperty(
        name="Show Folds",
        description="Draw projectors red where the volume is turned inside out and the picture mirrored",
        default=True,
        **STATIC,
    )
    iso_surfaces: IntProperty(
        name="Iso-Surfaces",
        description="Number of surfaces of equal t drawn between the near and the far surface",
        default=0,
        min=0,
        soft_max=9,
        max=64,
        **STATIC,
    )
    iso_t: FloatProperty(
        name="Iso-Surface at",
        description="The t of a single iso-surface: 0 is the near surface, 1 the far one",
        default=0.5,
        min=0.0,
        max=1.0,
        **ANIMATABLE,
    )
    show_pick: BoolProperty(
        name="Show Picked Projector",
        description="Draw the projector through the position in the picture that was picked last",
        default=False,
        **STATIC,
    )
    pick: FloatVectorProperty(
        name="Picked Position",
        description="Picked position, as shares of the picture's width and height from its lower left",
        size=2,
        default=(0.5, 0.5),
        min=0.0,
        max=1.0,
        **STATIC,
    )
    pick_t: FloatProperty(
        name="Picked t",
        description="t at which the picked projector meets the scene: 0 near surface, 1 far one, "
        "-1 for nothing",
        default=-1.0,
        min=-1.0,
        max=1.0,
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
    pick_object: StringProperty(
        name="Picked Object",
        description="Name of the object that the picked projector met",
        default="",
        **STATIC,
    )
    show_found: BoolProperty(
        name="Show Found Object",
        description="Mark the object that was found last in the picture",
        default=False,
        **STATIC,
    )
    found_box: FloatVectorProperty(
        name="Found Object's Box",
        description="Left, lower, right and upper border of the found object, as shares of the picture",
        size=4,
        default=(0.0, 0.0, 1.0, 1.0),
        min=0.0,
        max=1.0,
        **STATIC,
    )
    found_object: StringProperty(
        name="Found Object",
        description="Name of the object that was searched for, and how much of it is visible",
        default="",
        **STATIC,
    )
    fit: EnumProperty(
        name="Fit",
        description="Side of the volume that changes when it is fitted to another resolution",
        items=(
            ("NONE", "None", "The volume does not depend on the picture's shape"),
            ("WIDTH", "Width", "The width along the camera's X axis; the height stays"),
            ("HEIGHT", "Height", "The height along the camera's Y axis; the width stays"),
        ),
        default="NONE",
        **STATIC,
    )
    fitted_aspect: FloatProperty(
        name="Fitted Aspect",
        description="Width by height of the picture that the volume is made for",
        default=1.0,
        min=1e-6,
        max=1e6,
        **STATIC,
    )
    volume_object: PointerProperty(
        name="Volume Object",
        description="The object that keeps every control surface evaluated, hidden ones too",
        type=bpy.types.Object,
        poll=_may_be_volume,
        **ANIMATABLE,
    )
    report: StringProperty(
        name="Last Render",
        description="Size and time of the last render through this camera",
        default="",
        **STATIC,
    )
    statistics: StringProperty(
        name="Statistics",
        description="Rays, chords, triangles and memory of the last render through this camera",
        default="",
        **STATIC,
    )


CLASSES = (SCFPF_SurfaceSlot, SCFPF_SurfaceSettings, SCFPF_BlendEnds, SCFPF_CameraSettings)


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
