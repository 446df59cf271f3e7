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
# Cycles, whose rays follow the projectors.
RIG = "RIG"
ALL_ENGINES = (*ENGINES, (RIG, "Cycles by Its Rig", "Cycles, whose rays follow the projectors of each view"))
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


class OfAnyEngine:
    """Operators that render views one after the other, by any engine."""

    engine: EnumProperty(
        name="Engine",
        description="The engine that renders the views; the scene keeps its own",
        items=ALL_ENGINES,
        default="SCENE",
        options={"SKIP_SAVE"},
    )
