# SPDX-License-Identifier: GPL-3.0-or-later
"""Pictures beside the presets in menus, loaded when a menu is opened first."""

import bpy.utils.previews

from ..operators.presets import FOLDER

# How much larger than an icon they are drawn.
SCALE = 2.4

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
        # Asking for its size reads the file at once; else the first menu would show that it waits.
        pictures.load(preset, str(path), "IMAGE").image_size[:]
    return pictures[preset].icon_id


def draw_entries(layout, operator: str, items) -> None:
    """Presets (identifier, name, description): each its picture, and an operator that takes the identifier.

    One column: in menus rows and grids do not stand below one another.
    """
    for preset, name, _description in items:
        icon = thumbnail(preset)
        if icon:
            layout.template_icon(icon_value=icon, scale=SCALE)
        layout.operator(operator, text=name).preset = preset


def register():
    _loaded.append(bpy.utils.previews.new())


def unregister():
    bpy.utils.previews.remove(_loaded.pop())
