# SPDX-License-Identifier: GPL-3.0-or-later
"""Reset properties whose values are outside the limits of the user interface.

A damaged or hand-edited file, a script or a newer version may have stored such values. Code that reads
settings relies on their types and limits.
"""

from __future__ import annotations

import bpy
import numpy as np

from ..surfaces.surface_limits import limit_older_groups


def validate_file() -> None:
    """Reset invalid values in all local datablocks; a flexible camera's report lists the reset properties."""
    for obj in _local(bpy.data.objects):
        names = reset_invalid(obj.scfpf_surface)
        if obj.type == "CAMERA" and obj.scfpf.enabled:
            names += reset_invalid(obj.scfpf)
            if names:
                listed = ", ".join(dict.fromkeys(names))
                obj.scfpf.report = f"Reset on loading, as the values in the file were invalid: {listed}"
    for scene in _local(bpy.data.scenes):
        reset_invalid(scene.scfpf_sampling)
        reset_invalid(scene.scfpf_drawn)
    for collection in _local(bpy.data.collections):
        reset_invalid(collection.scfpf_rig)
        reset_invalid(collection.scfpf_preview)


def _local(datablocks) -> list:
    return [datablock for datablock in datablocks if datablock.is_editable]


def reset_invalid(group) -> list[str]:
    """Give invalid values of a property group, nested ones included, their defaults; return their names."""
    names = []
    for prop in group.bl_rna.properties:
        if prop.identifier == "rna_type":
            continue
        value = getattr(group, prop.identifier)
        if prop.type == "COLLECTION":
            for item in value:
                names += reset_invalid(item)
        elif prop.type == "POINTER" and isinstance(value, bpy.types.PropertyGroup):
            names += reset_invalid(value)
        elif not prop.is_readonly and not _is_valid(prop, value):
            group.property_unset(prop.identifier)
            names.append(prop.name)
    return names


def _is_valid(prop, value) -> bool:
    if prop.type == "POINTER":
        return value is None or isinstance(value, getattr(bpy.types, prop.fixed_type.identifier))
    if prop.type == "ENUM":
        return prop.is_enum_flag or value in prop.enum_items
    if prop.type in {"INT", "FLOAT"}:
        # Blender stores limits as float32, in which 0.001 is slightly more.
        kind = np.float32 if prop.type == "FLOAT" else np.int64
        values = np.atleast_1d(np.array(value[:] if prop.is_array else value, kind))
        low, high = kind(prop.hard_min), kind(prop.hard_max)
        return bool((np.isfinite(values) & (values >= low) & (values <= high)).all())
    return True


def file_loaded() -> None:
    """Reset what is invalid in a file that Blender has loaded."""
    validate_file()
    limit_older_groups()
