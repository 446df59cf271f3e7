# SPDX-License-Identifier: GPL-3.0-or-later
"""Pictures beside the presets in menus, loaded when a menu is opened first."""

import bpy.utils.previews

from ..operators.presets import FOLDER

# How much larger than an icon they are drawn.
SCALE = 2.6

_loaded = []


def thumbnail(preset: str) -> int:
    """The number of a shipped preset's picture as an icon, 0 if it has none."""
    path = FOLDER / "thumbnails" / f"{preset}.png"
    if not _loaded:
        return 0
    pictures = _loaded[0]
    if preset not in pictures:
        if not path.is_file():
            return 0
        pictures.load(preset, str(path), "IMAGE")
    return pictures[preset].icon_id


def draw_entry(layout, operator: str, preset: str, name: str) -> None:
    """A preset's picture and the operator beside it that takes its name."""
    icon = thumbnail(preset)
    row = layout.row()
    if icon:
        row.template_icon(icon_value=icon, scale=SCALE)
    row.operator(operator, text=name).preset = preset


def register():
    _loaded.append(bpy.utils.previews.new())


def unregister():
    bpy.utils.previews.remove(_loaded.pop())
