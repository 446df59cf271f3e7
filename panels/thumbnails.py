# SPDX-License-Identifier: GPL-3.0-or-later
"""Images beside the presets in menus, loaded when a menu first opens."""

import bpy.utils.previews

from ..operators.camera.presets import FOLDER
from ..scfpf_addon.bridge.camera.preset_folder import thumbnail_file

# The size of an image in icons.
SCALE = 3.6

_loaded = []


def thumbnail(preset: str) -> int:
    """The icon number of a shipped preset's image, 0 if it has none."""
    path = FOLDER / "thumbnails" / f"{preset}.png"
    return _icon(preset, path) if path.is_file() else 0


def own_thumbnail(preset: str) -> int:
    """The icon number of an own preset's image, 0 if it has none. A replaced image has another number."""
    found = thumbnail_file(preset)
    return _icon(f"{found[1]} {preset}", found[0]) if found else 0


def _icon(name: str, path) -> int:
    if not _loaded:
        return 0
    previews = _loaded[0]
    if name not in previews:
        # Accessing the size loads the file at once: the first menu would show a placeholder otherwise.
        previews.load(name, str(path), "IMAGE").image_size[:]
    return previews[name].icon_id


def draw_entries(layout, operator: str, items, icon_of=thumbnail, translate: bool = True) -> None:
    """Draw presets (identifier, name, description), each as an image and a button of an operator.

    icon_of: a function from an identifier to its icon number. translate: whether names are shown in the
    language of the interface. Images form one column, names another, of the same heights: a menu starts a
    new column at an item that begins farther right than the one before it.
    """
    icons = [icon_of(preset) for preset, _name, _description in items]
    row = layout.row()
    images = row.column()
    for icon in icons if any(icons) else ():
        if icon:
            images.template_icon(icon_value=icon, scale=SCALE)
        else:
            images.label()
    names = row.column()
    for icon, (preset, name, _description) in zip(icons, items, strict=True):
        entry = names.column()
        entry.scale_y = SCALE if icon else 1.0
        entry.operator(operator, text=name, translate=translate).preset = preset


def register():
    _loaded.append(bpy.utils.previews.new())


def unregister():
    bpy.utils.previews.remove(_loaded.pop())
