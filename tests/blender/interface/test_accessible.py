# SPDX-License-Identifier: GPL-3.0-or-later
"""The interface by the keyboard alone, and tooltips of one sentence."""

import pathlib
import re
import types

import bpy

GUIDE = pathlib.Path(__file__).resolve().parents[3] / "docs" / "guide.md"
# They wait for no input: for the end of a render, for a click that Blender handles, for a warning's turn.
NOT_TOOLS = {"engine_warn", "live_select", "render_escape"}
SENTENCE = re.compile(r"[.!?]\s+(?=[A-Z])")


def test_every_modal_tool_is_in_the_table_of_keys():
    text = GUIDE.read_text(encoding="utf-8")
    table = text[text.index("| tool | keys |") : text.index("## Command line")]
    modal = [name for name in dir(bpy.types) if name.startswith("SCFPF_OT_")]
    modal = [cls for cls in (getattr(bpy.types, name) for name in modal) if hasattr(cls, "modal")]
    tools = [cls for cls in modal if cls.__name__.removeprefix("SCFPF_OT_") not in NOT_TOOLS]
    assert len(tools) >= 10
    assert not [cls.bl_label for cls in tools if cls.bl_label not in table]


def test_properties_of_operators_are_told_in_one_sentence():
    """Those of two numbers that depend on each other take a second one."""
    long = {
        f"{name}.{prop.identifier}"
        for name in dir(bpy.ops.scfpf)
        for prop in getattr(bpy.ops.scfpf, name).get_rna_type().properties
        if SENTENCE.search(prop.description)
    }
    assert long <= {"surface_to_patch.columns", "surface_to_patch.rows"}


def test_settings_are_told_in_one_sentence():
    groups = [cls for cls in bpy.types.PropertyGroup.__subclasses__() if cls.__name__.startswith("SCFPF_")]
    told = {
        f"{cls.__name__}.{prop.identifier}": prop.description
        for cls in groups
        for prop in cls.bl_rna.properties
        if prop.identifier not in {"rna_type", "name"}
    }
    assert len(told) > 200
    assert not {name: text for name, text in told.items() if not text or SENTENCE.search(text)}


def test_operators_are_told_in_one_sentence():
    operators = [getattr(bpy.ops.scfpf, name) for name in dir(bpy.ops.scfpf)]
    told = {one.idname_py(): one.get_rna_type().description for one in operators}
    assert len(told) > 60 and all(told.values())
    assert not {name: text for name, text in told.items() if SENTENCE.search(text)}


def test_arrow_keys_move_the_pointer_to_where_enter_clicks(addon):
    """Finely with Shift, as everywhere in Blender."""
    click, moved = addon("operators.image.image_click").ImageClick, []
    window = types.SimpleNamespace(cursor_warp=lambda x, y: moved.append((x, y)))
    context = types.SimpleNamespace(window=window)
    tool = types.SimpleNamespace()
    at = {"value": "PRESS", "mouse_x": 200, "mouse_y": 100}
    for key, shift in (
        ("LEFT_ARROW", False),
        ("RIGHT_ARROW", True),
        ("UP_ARROW", False),
        ("DOWN_ARROW", True),
    ):
        event = types.SimpleNamespace(type=key, shift=shift, **at)
        assert click.respond(tool, context, event) == {"RUNNING_MODAL"}
    assert moved == [(190, 100), (201, 100), (200, 110), (200, 99)]


def test_enter_picks_the_middle_where_the_mouse_is_beside_the_picture(addon):
    """A click there waits for another one."""
    click = addon("operators.image.image_click").ImageClick
    tool = types.SimpleNamespace(
        without_mouse=click.without_mouse,
        position_at=lambda *_place: None,
        leave=lambda: None,
        poll=lambda _context: True,
        execute=lambda _context: {"FINISHED"},
    )
    beside = {"value": "PRESS", "mouse_x": 0, "mouse_y": 0}
    assert click.respond(tool, None, types.SimpleNamespace(type="LEFTMOUSE", **beside)) == {"RUNNING_MODAL"}
    assert click.respond(tool, None, types.SimpleNamespace(type="RET", **beside)) == {"FINISHED"}
    assert (tool.x, tool.y) == (0.5, 0.5)
