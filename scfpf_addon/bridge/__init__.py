# SPDX-License-Identifier: GPL-3.0-or-later
"""Blender's data as arrays and back. Only ``blender.versions`` knows differences between versions."""

from __future__ import annotations

from .aim import live_aim, scene_marks, widgets
from .blender import unstored_edits
from .frames import layer_frames
from .live import live_drawing
from .overlays import distance_handles, image_marks, viewport_overlay
from .render import command_line, render_engine, render_passes
from .settings import (
    aim_properties,
    blend_properties,
    camera_properties,
    hidden_properties,
    layer_properties,
    mapping_properties,
    sampling,
    stylised_properties,
)

# Modules whose types files and Blender's render job use: see ``render.type_registration``.
TYPES = (
    aim_properties,
    hidden_properties,
    layer_properties,
    mapping_properties,
    blend_properties,
    camera_properties,
    sampling,
    stylised_properties,
    render_passes,
    render_engine,
)
# Registered in this order after the types, unregistered in the reverse before them.
MODULES = (
    unstored_edits,
    live_drawing,  # under the volumes' lines
    viewport_overlay,
    image_marks,
    scene_marks,
    widgets,
    layer_frames,
    distance_handles,
    command_line,
)


def register():
    for module in MODULES:
        module.register()


def unregister():
    live_aim.stop()
    for module in reversed(MODULES):
        module.unregister()
