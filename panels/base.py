# SPDX-License-Identifier: GPL-3.0-or-later
"""The two places of a flexible camera's panels, and lines of text in them."""

import textwrap

import bpy

from ..operators.common.target import active_object, camera_of, flexible_camera_of
from ..operators.common.words import translated_label

# Characters that fit a line of the sidebar, roughly.
LINE = 36


class DataTab:
    """A panel in the Data tab of a camera."""

    bl_space_type = "PROPERTIES"
    bl_region_type = "WINDOW"
    bl_context = "data"

    @classmethod
    def poll(cls, context):
        # A pinned camera's data may be shown while another object is active.
        obj = active_object(context)
        return obj is not None and obj.type == "CAMERA" and obj.data == getattr(context, "camera", None)


class Sidebar:
    """A panel in the sidebar of the 3D viewport."""

    bl_space_type = "VIEW_3D"
    bl_region_type = "UI"
    bl_category = "Flexible Projection"
    names_camera = True

    @classmethod
    def poll(cls, _context):
        return True


class Subsection:
    """A part of the panel of a flexible camera. ``bl_order`` puts first what is edited most.

    takes_ordinary: whether it is shown for ordinary cameras, too.
    """

    takes_ordinary = False

    @classmethod
    def poll(cls, context):
        return _camera_for(cls, context) is not None and super().poll(context)

    def draw(self, context):
        self.layout.use_property_split = True
        camera = _camera_for(self, context)
        self.draw_settings(context, camera, camera.scfpf)


def shows_internals(context) -> bool:
    """Return whether the user wants figures about the insides: Developer Extras in Blender's Preferences."""
    return context.preferences.view.show_developer_ui


def _camera_for(section, context):
    """The camera that a section is about, or None."""
    return camera_of(context) if section.takes_ordinary else flexible_camera_of(context)


def section_panels(section: type, name: str) -> tuple[type[bpy.types.Panel], ...]:
    """The panels SCFPF_PT_data_NAME and SCFPF_PT_view_NAME of a section, for the two places."""
    return tuple(
        type(
            f"SCFPF_PT_{place}_{name}",
            (section, base, bpy.types.Panel),
            {"bl_parent_id": f"SCFPF_PT_{place}"},
        )
        for place, base in (("data", DataTab), ("view", Sidebar))
    )


def draw_text(layout, text: str | BaseException, icon: str) -> None:
    """Draw a text or an error in as many lines of the sidebar as it needs, with an icon before the first."""
    column = layout.column(align=True)
    for number, line in enumerate(textwrap.wrap(translated_label(text), LINE)):
        column.label(text=line, icon="BLANK1" if number else icon, translate=False)


def draw_fixed(layout, texts, icon: str, count: int) -> bool:
    """Draw texts in a fixed number of lines, so that nothing below them moves; return whether all fit.

    texts: each begins a line, all translated. icon: before the first line.
    """
    lines = [line for text in texts for line in textwrap.wrap(text, LINE)]
    shown = [*lines, *[""] * count][:count]
    if len(lines) > count:
        shown[-1] = f"{shown[-1]} …"
    column = layout.column(align=True)
    for number, line in enumerate(shown):
        column.label(text=line, icon="BLANK1" if number or not line else icon, translate=False)
    return len(lines) <= count


def draw_lines(layout, lines, height: float = 0.8) -> None:
    """Draw gray lines of information, of a height in units of ordinary ones."""
    column = layout.column(align=True)
    column.scale_y = height
    column.active = False
    for line in lines:
        column.label(text=line)


def split_properties(panel, decorate: bool = True):
    """The layout of a panel with names beside values, and with or without the dots of keyframes."""
    panel.layout.use_property_split = True
    panel.layout.use_property_decorate = decorate
    return panel.layout
