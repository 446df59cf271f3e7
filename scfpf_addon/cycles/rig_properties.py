# SPDX-License-Identifier: GPL-3.0-or-later
"""``Collection.scfpf_rig``: what makes a collection the Cycles rig of a flexible camera."""

from __future__ import annotations

import bpy
from bpy.props import (
    BoolProperty,
    FloatProperty,
    IntProperty,
    IntVectorProperty,
    PointerProperty,
    StringProperty,
)


def _changed(owner, context):
    """Nothing to do: having a callback at all makes edits from Python reach the depsgraph."""


def _is_camera(_settings, candidate) -> bool:
    return candidate.type == "CAMERA"


class SCFPF_Rig(bpy.types.PropertyGroup):
    """The parts of a Cycles rig, what it promises, and what the scene was like before."""

    is_rig: BoolProperty(
        name="Is Rig",
        description="The objects in this collection let Cycles follow the projectors of a flexible camera",
        default=False,
        update=_changed,
    )
    camera: PointerProperty(
        name="Flexible Camera",
        description="The flexible camera whose projectors Cycles follows",
        type=bpy.types.Object,
        poll=_is_camera,
        update=_changed,
    )
    scene: PointerProperty(
        name="Scene",
        description="The scene that Cycles renders this way",
        type=bpy.types.Scene,
        update=_changed,
    )
    view_camera: PointerProperty(
        name="Rig Camera",
        description="The camera that looks at the rig's screen",
        type=bpy.types.Object,
        poll=_is_camera,
        update=_changed,
    )
    portals: PointerProperty(
        name="Portals",
        description="The object with the screen and the sheets that turn the rays",
        type=bpy.types.Object,
        update=_changed,
    )
    table: PointerProperty(
        name="Table",
        description="The object with the table of projectors that places the sheets",
        type=bpy.types.Object,
        update=_changed,
    )
    chords: IntProperty(
        name="Chords",
        description="Straight pieces that Cycles' rays follow a projector with",
        default=1,
        min=1,
        update=_changed,
    )
    cells: IntVectorProperty(
        name="Cells",
        description="Cells of each sheet across and up the picture",
        size=2,
        default=(1, 1),
        min=1,
        update=_changed,
    )
    error: FloatProperty(
        name="Error",
        description="How far the chords are off the projectors, in pixels",
        default=0.0,
        min=0.0,
        update=_changed,
    )
    cost: FloatProperty(
        name="Cost",
        description="Rendering time in a simple scene, as a multiple of an ordinary camera's",
        default=1.0,
        min=1.0,
        update=_changed,
    )
    missing: FloatProperty(
        name="Missing",
        description="The share of the picture where a control surface has a hole",
        default=0.0,
        min=0.0,
        max=1.0,
        update=_changed,
    )
    animated: BoolProperty(
        name="Animated",
        description="The volume changes with the frame: the chords are enough for all frames looked at",
        default=False,
        update=_changed,
    )
    crosses: BoolProperty(
        name="Crosses Itself",
        description="Rays meet sheets elsewhere than where they are due: the volume folds or crosses itself",
        default=False,
        update=_changed,
    )
    flat: BoolProperty(
        name="No Area",
        description="A sheet is a line or a point: rays pass it by, and see what is behind",
        default=False,
        update=_changed,
    )
    smoke: StringProperty(
        name="Smoke",
        description="An object with a volume that the near surface is inside of: rays do not know of it",
        default="",
        update=_changed,
    )
    raycast: StringProperty(
        name="Raycast",
        description="A material whose Raycast node meets the rig's sheets",
        default="",
        update=_changed,
    )
    asks_camera: StringProperty(
        name="Asks the Camera",
        description="A material that depends on the camera or the ray, and gets those of the rig",
        default="",
        update=_changed,
    )
    problem: StringProperty(
        name="Problem",
        description="Why the rig does not follow the camera at present; empty when it does",
        default="",
        update=_changed,
    )
    passes: BoolProperty(
        name="t, Depth, (u, v)",
        description="The sheets write what the compositor makes passes of t, depth, u and v from",
        default=False,
        update=_changed,
    )
    engine_before: StringProperty(
        name="Engine Before",
        description="The scene's render engine before the rig was made",
        default="",
        update=_changed,
    )
    camera_before: PointerProperty(
        name="Camera Before",
        description="The scene's camera before the rig was made",
        type=bpy.types.Object,
        poll=_is_camera,
        update=_changed,
    )
    bounces_before: IntProperty(
        name="Transparent Bounces Before",
        description="Cycles' limit of transparent bounces before the rig was made",
        default=8,
        min=0,
        update=_changed,
    )
    bounces: IntProperty(
        name="Transparent Bounces",
        description="Cycles' limit of transparent bounces as the rig has set it",
        default=8,
        min=0,
        update=_changed,
    )


def register():
    bpy.utils.register_class(SCFPF_Rig)
    bpy.types.Collection.scfpf_rig = PointerProperty(name="Cycles Rig", type=SCFPF_Rig)


def unregister():
    del bpy.types.Collection.scfpf_rig
    bpy.utils.unregister_class(SCFPF_Rig)
