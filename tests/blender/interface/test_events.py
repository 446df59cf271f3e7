# SPDX-License-Identifier: GPL-3.0-or-later
"""Blender's events: one handler of ours for each, in an order that can be read."""

import bpy
import pytest


@pytest.fixture
def events(addon):
    return addon("events")


def ours(events):
    """Our handlers by the list of Blender's that they are in, with their places."""
    lists = {name: getattr(bpy.app.handlers, name) for name in dir(bpy.app.handlers)}
    return {
        (name, place)
        for name, found in lists.items()
        if isinstance(found, list)
        for place, function in enumerate(found)
        if function.__module__.startswith(events.__name__.partition(".scfpf_addon")[0])
    }


def test_every_event_has_one_handler_and_keeps_it_in_another_file(events):
    before = ours(events)
    assert sorted(name for name, _ in before) == sorted([*events.UPDATES, *events.SCENES, *events.FILES])
    bpy.ops.wm.read_homefile(use_empty=True, use_factory_startup=True)
    assert ours(events) == before


def test_unregister_removes_them_and_register_brings_them_back(events):
    before = ours(events)
    events.unregister()
    assert ours(events) == set()
    events.register()
    assert {name for name, _ in ours(events)} == {name for name, _ in before}


def test_undo_is_told_before_the_handlers_of_others(events):
    events.unregister()
    bpy.app.handlers.undo_pre.append(lambda *_: None)
    try:
        events.register()
        assert ("undo_pre", 0) in ours(events)
    finally:
        bpy.app.handlers.undo_pre.pop()


def test_a_room_that_fails_keeps_no_other_from_its_work(events, capsys):
    def fails(*arguments):
        raise ZeroDivisionError("of the test")

    told = []
    handler = events._handler((fails, lambda *arguments: told.append(arguments)), 2)
    handler("scene", "depsgraph", "more")
    assert told == [("scene", "depsgraph")]
    assert "ZeroDivisionError: of the test" in capsys.readouterr().err


@pytest.mark.parametrize("event", ["undo", "redo"])
def test_what_is_released_is_restored_and_only_after_the_edit_is_stored(events, event):
    """The rooms that release pointers before history are those that restore them after it, in this order."""
    before, after = events.FILES[f"{event}_pre"], events.FILES[f"{event}_post"]
    released = [f.__module__ for f in before if f.__name__.startswith("release")]
    restored = [f.__module__ for f in after if f.__name__.startswith("restore")]
    assert released == restored
    assert len(released) == 3
    assert before[0].__name__ == f"store_before_{event}"
