# SPDX-License-Identifier: GPL-3.0-or-later
"""A camera between two others in the panel: its factor, what it goes between, the button that updates it."""

from ..operators.camera.presets import preset_items
from ..scfpf_addon.bridge.camera.camera_blend import is_blend, knows_its_ends


def draw_blend(layout, camera) -> None:
    """Nothing for other cameras."""
    settings = camera.scfpf
    if not is_blend(camera) and not knows_its_ends(camera):
        return
    column = layout.column(align=True)
    column.prop(settings, "blend_factor", slider=True)
    if not knows_its_ends(camera):
        return
    ends = settings.blend_ends
    column.prop(ends, "first", text="", icon="CAMERA_DATA")
    if ends.second is None:
        names = {stem: name for stem, name, _text in preset_items()}
        column.label(text=f"To the preset {names.get(ends.preset, ends.preset)}, or to:")
    column.prop(ends, "second", text="", icon="CAMERA_DATA")
    column.operator("scfpf.blend_update", icon="FILE_REFRESH")
