# SPDX-License-Identifier: GPL-3.0-or-later
"""Cautions about what Cycles measures in pixels: bump, levels of textures, wires."""

from __future__ import annotations

from ..projection.user_error import Message
from .rig_data import LAYOUT

# Pixels whose sizes in space differ by a larger factor from those that Cycles takes them for differ visibly.
# Textures of a fisheye of 120° have 1.44 and are off by 0.026 beside Cycles' own one; of 90° 1.23 and 0.006.
MOST_SPREAD = 1.3
FLAT = Message("Bump comes out flat, since another version of the add-on made the rig: press Update Chords")


def cautions(settings) -> list[str]:
    """The cautions about a rig's settings, for the panel."""
    if is_flat(settings):
        return [FLAT]
    if settings.spread <= MOST_SPREAD:
        return []
    found = []
    if settings.wires:
        found.append(
            Message(
                "The wires of '{0}' have wrong widths, as pixels differ much in size: switch off Pixel Size",
                settings.wires,
            )
        )
    # Blender has it from 5.2 on.
    if settings.levels and getattr(settings.scene.render, "use_texture_cache", False):
        found.append(
            Message(
                "Images as of '{0}' are too soft or too sharp, as pixels differ much in size: switch off "
                "Texture Cache in Performance",
                settings.levels,
            )
        )
    return found


def is_flat(settings) -> bool:
    """Return whether rays of a rig have footprints that are far too wide: another version has made it."""
    return bool(settings.layout != LAYOUT)
