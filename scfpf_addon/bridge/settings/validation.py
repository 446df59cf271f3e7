# SPDX-License-Identifier: GPL-3.0-or-later
"""Settings of ours that no interface lets in, set back when a file is loaded.

A file may hold them all the same: of a newer version, by scripts that write past the limits, or damaged.
Whoever reads settings afterwards can rely on their types and limits.
"""

from __future__ import annotations

import bpy
import numpy as np
from bpy.app.handlers import persistent

from ..surfaces.surface_limits import limit_older_groups


def settle_file() -> None:
    """Set back what is out of its limits in all that the file itself has; cameras' reports name it."""
    for obj in bpy.data.objects:
        if not obj.is_editable:
            continue
        names = settle(obj.scfpf_surface)
        if obj.type == "CAMERA" and obj.scfpf.enabled:
            names += settle(obj.scfpf)
            if names:
                listed = ", ".join(dict.fromkeys(names))
                obj.scfpf.report = f"Reset on loading, as the values in the file were invalid: {listed}"
    for scene in bpy.data.scenes:
        if scene.is_editable:
            for group in (scene.scfpf_sampling, scene.scfpf_drawn):
                settle(group)
    for collection in bpy.data.collections:
        if collection.is_editable:
            for group in (collection.scfpf_rig, collection.scfpf_preview):
                settle(group)


def settle(group) -> list[str]:
    """Set a property group's unsound values back to their defaults, those in it too; returns their names."""
    names = []
    for prop in group.bl_rna.properties:
        if prop.identifier == "rna_type":
            continue
        value = getattr(group, prop.identifier)
        if prop.type == "COLLECTION":
            for item in value:
                names += settle(item)
        elif prop.type == "POINTER" and isinstance(value, bpy.types.PropertyGroup):
            names += settle(value)
        elif not prop.is_readonly and not _is_sound(prop, value):
            group.property_unset(prop.identifier)
            names.append(prop.name)
    return names


def _is_sound(prop, value) -> bool:
    if prop.type == "POINTER":
        return value is None or isinstance(value, getattr(bpy.types, prop.fixed_type.identifier))
    if prop.type == "ENUM":
        return prop.is_enum_flag or value in prop.enum_items
    if prop.type in {"INT", "FLOAT"}:
        # In Blender's own precision: a limit of 0.001 is stored above that.
        kind = np.float32 if prop.type == "FLOAT" else np.int64
        values = np.atleast_1d(np.array(value[:] if prop.is_array else value, kind))
        low, high = kind(prop.hard_min), kind(prop.hard_max)
        return bool((np.isfinite(values) & (values >= low) & (values <= high)).all())
    return True


@persistent
def _loaded(*_):
    settle_file()
    limit_older_groups()


def register():
    bpy.app.handlers.load_post.append(_loaded)


def unregister():
    bpy.app.handlers.load_post.remove(_loaded)
