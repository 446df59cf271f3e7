# SPDX-License-Identifier: GPL-3.0-or-later
"""The screens that cameras are made for, found by the modifiers of their surfaces."""

from __future__ import annotations

from ..blender import versions
from ..blender.modifier_inputs import input_identifiers
from .camera_members import surfaces_of

# The name of the node group of a screen's surfaces, and its inputs by name.
GROUP_NAME = "SCFPF Screen Surface"
SCREEN, EYE, SCALE = "Screen", "Eye", "Scale"


def screens_of(camera) -> list:
    """The screens that a camera's projectors come through from before them: no image shows these."""
    found = []
    for surface in surfaces_of(camera)[:1]:
        for modifier in surface.modifiers:
            group = modifier.node_group if modifier.type == "NODES" else None
            if group is None or not group.name.startswith(GROUP_NAME):
                continue
            names = input_identifiers(group)
            if {SCREEN, SCALE} <= names.keys():
                screen, scale = (versions.modifier_input(modifier, names[name]) for name in (SCREEN, SCALE))
                if screen is not None and scale < 1.0:
                    found.append(screen)
    return found
