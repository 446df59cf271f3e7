# SPDX-License-Identifier: GPL-3.0-or-later
"""Pictures beside the presets in menus, loaded when a menu is opened first."""

import bpy.utils.previews

from ..operators.camera.presets import FOLDER
from ..scfpf_addon.bridge.camera.camera_preset import own_picture

# How much larger than an icon they are drawn.
SCALE = 3.6

_loaded = []


def thumbnail(preset: str) -> int:
    """The number of a shipped preset's picture as an icon, 0 if it has none."""
    path = FOLDER / "thumbnails" / f"{preset}.png"
    return _icon(preset, path) if path.is_file() else 0


def own_thumbnail(preset: str) -> int:
    """The number of an own preset's picture as an icon, 0 if it has none. Replaced ones are read anew."""
    found = own_picture(preset)
    return _icon(f"{found[1]} {preset}", found[0]) if found else 0


def _icon(name: str, path) -> int:
    if not _loaded:
        return 0
    pictures = _loaded[0]
    if name not in pictures:
        # Asking for its size reads the file at once; else the first menu would show that it waits.
        pictures.load(name, str(path), "IMAGE").image_size[:]
    return pictures[name].icon_id


def draw_entries(layout, operator: str, items, picture=thumbnail) -> None:
    """Presets (identifier, name, description): each its picture, and an operator that takes the identifier.

    picture: the icon's number by identifier. All pictures come first, then all names, of the same heights:
    a menu makes a new column of whatever begins farther right than the item before it.
    """
    icons = [picture(preset) for preset, _name, _description in items]
    row = layout.row()
    pictures = row.column()
    for icon in icons if any(icons) else ():
        if icon:
            pictures.template_icon(icon_value=icon, scale=SCALE)
        else:
            pictures.label()
    names = row.column()
    for icon, (preset, name, _description) in zip(icons, items, strict=True):
        entry = names.column()
        entry.scale_y = SCALE if icon else 1.0
        entry.operator(operator, text=name).preset = preset


def register():
    _loaded.append(bpy.utils.previews.new())


def unregister():
    bpy.utils.previews.remove(_loaded.pop())
