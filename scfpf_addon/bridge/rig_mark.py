# SPDX-License-Identifier: GPL-3.0-or-later
"""What marks the objects of a Cycles rig: no picture of ours shows them, and they stand for their camera."""

from __future__ import annotations

import bpy

# The custom property of each of a rig's objects that names the flexible camera; a pointer.
RIG_KEY = "scfpf_rig_of"


def is_rig_part(obj) -> bool:
    """Whether an object is part of a Cycles rig."""
    return RIG_KEY in obj


def camera_behind(obj):
    """The flexible camera that a rig's camera stands for; any other object, or None, itself."""
    camera = None if obj is None else obj.get(RIG_KEY)
    return camera if isinstance(camera, bpy.types.Object) else obj
