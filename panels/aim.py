# SPDX-License-Identifier: GPL-3.0-or-later
"""The panel Aim: the list of what the picture shall show, the active target, and how well it is met."""

import math

import bpy

from ..operators.common.target import flexible_camera_of
from ..operators.common.words import label_text, translated_label
from ..scfpf_addon.bridge.settings.aim_properties import LINE, PIN, STAY, VIEW
from .base import Subsection, draw_fixed, draw_lines, section_panels

ICONS = {VIEW: "VIEW_CAMERA", PIN: "PINNED", LINE: "IPO_LINEAR", STAY: "LOCKED"}
# What each kind of target shows below the list: what it is about, and how it is shown.
THINGS = {
    VIEW: ("collection", "object", "eye"),
    PIN: ("handle",),
    LINE: ("first", "second"),
    STAY: ("collection", "object", "mask"),
}
NUMBERS = {
    VIEW: ("position", "width", "turn", "halo", "alone", "weight"),
    PIN: ("position", "use_direction", "weight"),
    LINE: ("weight",),
    STAY: ("weight",),
}
# The angle of a press of the buttons that turn a view, and what each does: to the left, and up.
STEP = math.radians(10)
TURNS = (("Left", STEP, 0.0), ("Right", -STEP, 0.0), ("Up", 0.0, STEP), ("Down", 0.0, -STEP))
# What comes next, by the kind of the active target, before the first solve.
NEXT = {
    VIEW: "Move its frame or turn the view, then press Solve",
    PIN: "Drag the pin to its place, then press Solve",
    LINE: "Press Solve: the line becomes straight",
    STAY: "Add a view or a pin, then press Solve",
}
# Lines below the buttons for what is wrong with a target and for the outcome of a solve.
OUTCOME_LINES = 3
# A target is met well whose points are all within so many pixels.
WELL_MET = 1.5
# A view shows its thing well if 95 % of it are within so many pixels.
WELL_SHOWN = 10.0


class SCFPF_UL_aim(bpy.types.UIList):
    """The targets that the picture is aimed at"""

    def draw_item(self, _context, layout, _data, item, _icon, _active_data, _active_property, _index):
        row = layout.row(align=True)
        row.active = item.is_on
        # A row has no room for the panel's split into name and value.
        row.use_property_split = row.use_property_decorate = False
        row.prop(item, "name", text="", emboss=False, icon=ICONS[item.kind])
        if item.is_on and (text := residual_text(item)):
            right = row.row()
            right.alignment = "RIGHT"
            right.alert = item.hidden > 0.0 or item.residual_max > WELL_MET or item.whole_95 > WELL_SHOWN
            right.label(text=text, icon="HIDE_ON" if item.hidden > 0.0 else "NONE")
        icon = "CHECKBOX_HLT" if item.is_on else "CHECKBOX_DEHLT"
        row.prop(item, "is_on", text="", emboss=False, icon=icon)


def residual_text(target) -> str:
    """The distance in pixels to its place of 95 % of a view's thing, or of a pin; empty before Solve."""
    distance = target.residual_max if target.whole_95 < 0.0 else target.whole_95
    return label_text("{0:.1f} px", distance) if distance >= 0.0 else ""


class SCFPF_MT_aim_add(bpy.types.Menu):
    """Add a target: a thing, a point, a line or what stays"""

    bl_label = "Add Target"

    def draw(self, _context):
        layout = self.layout
        layout.operator("scfpf.aim_view_add", icon=ICONS[VIEW])
        layout.operator(
            "scfpf.aim_view_add", text="Add View from Viewport", icon="RESTRICT_VIEW_OFF"
        ).from_viewport = True
        layout.separator()
        layout.operator("scfpf.aim_pin_click", icon="EYEDROPPER")
        layout.operator("scfpf.aim_pin_add", text="Add Pin at 3D Cursor", icon="PIVOT_CURSOR")
        layout.operator("scfpf.aim_line_add", icon=ICONS[LINE])
        layout.separator()
        layout.operator("scfpf.aim_stay_add", icon=ICONS[STAY])


class _AimSection(Subsection):
    bl_label = "Aim"
    bl_order = 1
    # Its button makes an ordinary camera flexible.
    takes_ordinary = True

    def draw_settings(self, _context, camera, settings):
        layout = self.layout
        if not (settings.enabled and len(settings.aim_targets)):
            column = layout.column(align=True)
            column.operator("scfpf.aim_view_add", icon=ICONS[VIEW])
            column.operator("scfpf.aim_pin_click", icon="EYEDROPPER")
            return
        row = layout.row()
        row.template_list(
            "SCFPF_UL_aim", "", settings, "aim_targets", settings, "active_aim", rows=4, sort_lock=True
        )
        column = row.column(align=True)
        column.menu("SCFPF_MT_aim_add", text="", icon="ADD")
        column.operator("scfpf.aim_remove", text="", icon="REMOVE")
        column.separator()
        column.operator("scfpf.aim_move", text="", icon="TRIA_UP").direction = "UP"
        column.operator("scfpf.aim_move", text="", icon="TRIA_DOWN").direction = "DOWN"
        row = layout.row(align=True)
        row.scale_y = 1.3
        row.operator("scfpf.aim_solve", icon="CON_TRACKTO")
        row.operator("scfpf.aim_live", text="", icon="PLAY", depress=settings.aim.live)
        if settings.active_aim < len(settings.aim_targets):
            draw_target(layout, settings.aim_targets[settings.active_aim])
        draw_outcome(layout, settings)


def draw_target(layout, target) -> None:
    """Draw the settings of a target, and the buttons that move it."""
    if target.kind in (VIEW, PIN):
        layout.operator("scfpf.aim_drag", icon="VIEW_PAN")
    if target.kind == VIEW:
        draw_turns(layout.column(align=True), target)
    header, body = layout.panel("scfpf_aim_target", default_closed=True)
    header.label(text="Target")
    if body is not None:
        draw_numbers(body, target)


def draw_numbers(layout, target) -> None:
    """Draw what a target is about, and how it is shown."""
    column = layout.column()
    column.active = target.is_on
    if target.kind in (VIEW, STAY):
        # One of them is the thing: an object is not asked for beside a collection.
        column.prop(target, "collection")
        if target.collection is None:
            column.prop(target, "object")
    for name in THINGS[target.kind]:
        if name not in ("collection", "object"):
            column.prop(target, name)
    for name in NUMBERS[target.kind]:
        column.prop(target, name)


def draw_outcome(layout, settings) -> None:
    """Draw what the active target lacks and what the last solve has reached, in always the same height.

    The popover of all messages has the whole texts.
    """
    targets = settings.aim_targets
    own = targets[settings.active_aim].message if settings.active_aim < len(targets) else ""
    is_flawed = settings.aim.flaws or (own and targets[settings.active_aim].hidden > 0.0)
    # The line of the whole solve has that of its only view.
    own = "" if own in settings.aim.message else own
    texts = [translated_label(text) for text in (own, *settings.aim.message.split(" · ")) if text]
    if not texts and settings.active_aim < len(targets):
        texts = [translated_label(NEXT[targets[settings.active_aim].kind])]
    draw_fixed(layout, texts, "ERROR" if is_flawed else "INFO", OUTCOME_LINES)


def draw_turns(column, target) -> None:
    """Draw the buttons that move a view's camera round what it shows."""
    column.label(text="Turn View")
    row = column.row(align=True)
    for text, left, up in TURNS:
        turn = row.operator("scfpf.aim_turn", text=text)
        turn.left, turn.up = left, up
    free = row.row(align=True)
    free.enabled = target.hidden > 0.0 and any(target.free_turn)
    free.operator("scfpf.aim_turn", text="", icon="ORIENTATION_GIMBAL").to_free = True


class _AimSettingsSection(Subsection):
    bl_label = "Aim Settings"
    bl_order = 1
    bl_options = {"DEFAULT_CLOSED"}

    @classmethod
    def poll(cls, context):
        return super().poll(context) and len(flexible_camera_of(context).scfpf.aim_targets) > 0

    def draw_settings(self, _context, _camera, settings):
        layout, aim = self.layout, settings.aim
        column = layout.column(align=True)
        column.prop(aim, "columns")
        column.prop(aim, "rows", text="Up")
        layout.prop(aim, "degree")
        draw_lines(layout, outcome_lines(aim), height=1.0)


def outcome_lines(aim) -> list[str]:
    """The effect of the last solve on the rest of the picture; empty before Solve."""
    lines = []
    if aim.background_95 >= 0.0:
        lines.append(
            label_text(
                "Rest moved {0:.1f} px, 95 % at most {1:.0f} px", aim.background_median, aim.background_95
            )
        )
    if aim.is_solved:
        lines.append(
            label_text("Mirrored {0:.2%}, folded {1:.2%}", aim.mirrored, aim.folds).replace("%", " %")
        )
    if aim.between >= 0.0:
        lines.append(label_text("Between keyframes at most {0:.1f} px off", aim.between))
    return lines


register, unregister = bpy.utils.register_classes_factory(
    (
        SCFPF_UL_aim,
        SCFPF_MT_aim_add,
        *section_panels(_AimSection, "aim"),
        *section_panels(_AimSettingsSection, "aim_settings"),
    )
)
