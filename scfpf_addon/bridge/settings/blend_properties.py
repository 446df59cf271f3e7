# SPDX-License-Identifier: GPL-3.0-or-later
"""The two ends of a camera made by Blend Cameras, from which it can be updated."""

from __future__ import annotations

import bpy
from bpy.props import PointerProperty, StringProperty

OVERRIDABLE = {"LIBRARY_OVERRIDABLE"}


def _changed(owner, context):
    """Nothing to do: having a callback at all makes edits from Python reach the depsgraph."""


def _may_be_end(ends, candidate) -> bool:
    return candidate.type == "CAMERA" and candidate.scfpf.enabled and candidate != ends.id_data


class SCFPF_BlendEnds(bpy.types.PropertyGroup):
    """The two pictures of a blend, as Update Blend takes them up."""

    first: PointerProperty(
        name="From",
        description="The flexible camera at Blend 0. Press Update Blend after choosing another one",
        type=bpy.types.Object,
        poll=_may_be_end,
        update=_changed,
        override=OVERRIDABLE,
    )
    second: PointerProperty(
        name="To",
        description="The flexible camera at Blend 1, instead of a preset. Press Update Blend after "
        "choosing another "
        "one",
        type=bpy.types.Object,
        poll=_may_be_end,
        update=_changed,
        override=OVERRIDABLE,
    )
    preset: StringProperty(
        name="Preset",
        description="File name of the preset at Blend 1, if no camera is chosen",
        update=_changed,
        override=OVERRIDABLE,
    )


def register():
    bpy.utils.register_class(SCFPF_BlendEnds)


def unregister():
    bpy.utils.unregister_class(SCFPF_BlendEnds)
