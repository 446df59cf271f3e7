# SPDX-License-Identifier: GPL-3.0-or-later
"""``Collection.scfpf_rig``: the properties that make a collection the Cycles rig of a flexible camera."""

from __future__ import annotations

import bpy
from bpy.props import BoolProperty, FloatProperty, IntProperty, IntVectorProperty, PointerProperty

from ..scanline.tracked_properties import camera_pointer, pointer, text, tracked


class SCFPF_Rig(bpy.types.PropertyGroup):
    """The parts of a Cycles rig, the figures of its plan, and the scene's previous state."""

    is_rig: tracked(
        BoolProperty,
        "Is Rig",
        "The objects in this collection let Cycles follow the projectors of a flexible camera",
        default=False,
    )
    passing: tracked(
        BoolProperty,
        "Passing",
        "The rig is made for one render, and does not follow the camera",
        default=False,
    )
    camera: camera_pointer("Flexible Camera", "The flexible camera whose projectors Cycles follows")
    scene: pointer("Scene", "The scene that Cycles renders this way", bpy.types.Scene)
    view_camera: camera_pointer("Rig Camera", "The camera that looks at the rig's screen")
    dicing_camera: camera_pointer("Dicing Camera", "The camera that adaptive subdivision is as fine for")
    portals: pointer("Portals", "The object with the screen and the sheets that turn the rays")
    table: pointer("Table", "The object with the table of projectors that places the sheets")
    chords: tracked(
        IntProperty, "Chords", "Straight pieces that Cycles' rays follow a projector with", default=1, min=1
    )
    cells: tracked(
        IntVectorProperty,
        "Cells",
        "Cells of each sheet across and up the picture",
        size=2,
        default=(1, 1),
        min=1,
    )
    error: tracked(
        FloatProperty, "Error", "How far the chords are off the projectors, in pixels", default=0.0, min=0.0
    )
    cost: tracked(
        FloatProperty,
        "Cost",
        "Rendering time in a simple scene, as a multiple of an ordinary camera's",
        default=1.0,
        min=1.0,
    )
    missing: tracked(
        FloatProperty,
        "Missing",
        "The share of the picture where a control surface has a hole",
        default=0.0,
        min=0.0,
        max=1.0,
    )
    animated: tracked(
        BoolProperty,
        "Animated",
        "The volume changes with the frame: the chords are enough for all frames looked at",
        default=False,
    )
    flat: tracked(
        BoolProperty,
        "No Area",
        "A sheet is a line or a point: rays pass it by, and see what is behind",
        default=False,
    )
    is_own_view: tracked(
        BoolProperty,
        "Own View",
        "The volume is the view of the camera's own lens: its Depth is measured along the camera's axis",
        default=False,
    )
    layout: tracked(
        IntProperty, "Layout", "How the screen is placed; 0 by other versions of the add-on", default=0, min=0
    )
    spread: tracked(
        FloatProperty,
        "Spread",
        "The factor by which the sizes of most pixels in space are off those that Cycles takes them for",
        default=1.0,
        min=1.0,
    )
    smoke: text("Smoke", "An object with a volume that the near surface is inside of: rays do not know of it")
    smoke_later: text("Smoke Later", "An object whose smoke the near surface is in at another frame")
    smoke_frame: tracked(IntProperty, "Smoke Frame", "The first frame looked at with smoke", default=0)
    smoke_known: text("Known Smoke", "The objects whose smoke was followed through the frames")
    smoke_unknown: text(
        "Unknown Smoke", "An object with smoke that may change with the frame, not yet followed"
    )
    raycast: text("Raycast", "A material, lamp or world whose Raycast node meets the rig's sheets")
    asks_camera: text(
        "Asks the Camera",
        "A material, lamp or world that depends on the camera or the ray, and gets those of the rig",
    )
    wires: text("Wires", "A material whose Wireframe node measures in pixels")
    levels: text("Levels", "A material, lamp or world with an image, of which a texture cache has levels")
    strokes: text("Strokes", "A Grease Pencil object, which renders through the rig do not show")
    sheet_vertices: tracked(
        IntProperty, "Vertices of a Sheet", "The vertices of a sheet that skips no chord", default=4, min=4
    )
    passed: tracked(
        FloatProperty,
        "Passed",
        "Portals that a ray passes that meets nothing, the mean over the picture; 0 if it passes all",
        default=0.0,
        min=0.0,
    )
    travels_all: text(
        "Travels All", "Why rays travel all chords, also the empty ones; empty when they skip those"
    )
    problem: text("Problem", "Why the rig does not follow the camera at present; empty when it does")
    passes: tracked(
        BoolProperty,
        "t, Depth, (u, v)",
        "The sheets write what the compositor makes passes of t, depth, u and v from",
        default=False,
    )
    engine_before: text("Engine Before", "The scene's render engine before the rig was made")
    camera_before: camera_pointer("Camera Before", "The scene's camera before the rig was made")
    offscreen_before: tracked(
        FloatProperty,
        "Offscreen Scale Before",
        "Cycles' scale of subdivision outside the camera's view before the rig was made; 0 if it is not set",
        default=0.0,
        min=0.0,
    )
    bounces_before: tracked(
        IntProperty,
        "Transparent Bounces Before",
        "Cycles' limit of transparent bounces before the rig was made",
        default=8,
        min=0,
    )
    bounces: tracked(
        IntProperty,
        "Transparent Bounces",
        "Cycles' limit of transparent bounces as the rig has set it",
        default=8,
        min=0,
    )
    least_before: tracked(
        IntProperty,
        "Least Transparent Bounces Before",
        "Cycles' least transparent bounces before the rig was made",
        default=0,
        min=0,
    )
    least_bounces: tracked(
        IntProperty,
        "Least Transparent Bounces",
        "Cycles' least transparent bounces as the rig has set them; -1 if it has not",
        default=-1,
        min=-1,
    )


def register():
    bpy.utils.register_class(SCFPF_Rig)
    bpy.types.Collection.scfpf_rig = PointerProperty(name="Cycles Rig", type=SCFPF_Rig)


def unregister():
    del bpy.types.Collection.scfpf_rig
    bpy.utils.unregister_class(SCFPF_Rig)
