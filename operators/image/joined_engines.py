# SPDX-License-Identifier: GPL-3.0-or-later
"""The engines whose ordinary renders are joined into the picture of a flexible camera."""

from __future__ import annotations

from bpy.props import EnumProperty

from ...scfpf_addon.bridge.blender import versions

ENGINES = (
    ("EEVEE", "EEVEE", "Blender's real-time engine"),
    ("WORKBENCH", "Workbench", "The engine of solid viewports"),
    ("SCENE", "Scene's Engine", "The render engine that the scene has"),
)
RENDERERS = {"EEVEE": versions.EEVEE, "WORKBENCH": "BLENDER_WORKBENCH", "SCENE": ""}


class OfEngine:
    """Operators that take the engine whose renders are joined."""

    engine: EnumProperty(
        name="Engine",
        description="The engine whose renders are joined; the scene keeps its own",
        items=ENGINES,
        default="SCENE",
        options={"SKIP_SAVE"},
    )
