# SPDX-License-Identifier: GPL-3.0-or-later
"""Undo after operators whose edits no step of undo holds: scripts call operators so by default.

Undo keeps a datablock in memory if two stored steps agree on it, whatever has been done to it since. It may
then point to an object that neither step has, and Blender follows the pointer into freed memory. Blender's
own operators that add objects end so as well. Its preference Undo Legacy lets it read every datablock from
the step instead. That takes longer in a large file, so that it is switched on for such an undo alone.
"""

from __future__ import annotations

import bpy
from bpy.app.handlers import persistent

from ..blender.app_handlers import add_handlers, remove_handlers


class _Edits:
    """The last edit that no step of undo holds, and preferences to be restored.

    last: the address of Blender's newest stored operator at the last edit, None without an edit.
    kept: the owner, the name and the value of each preference changed for an undo.
    """

    def __init__(self) -> None:
        self.last: int | None = None
        self.kept: list[tuple[object, str, bool]] = []


_edits = _Edits()


def note_edit() -> None:
    """Note that an operator edits the file. Every operator of ours with the option UNDO calls this."""
    done = bpy.context.window_manager.operators
    _edits.last = done[-1].as_pointer() if len(done) else 0


def _is_stored() -> bool:
    """Return whether an operator that stores a step has ended since the last edit.

    Blender lists operators that have stored a step. A step without an operator is not listed; undo then takes
    longer than necessary.
    """
    for done in reversed(bpy.context.window_manager.operators):
        if done.as_pointer() == _edits.last:
            return False
        if "UNDO" in done.bl_options:
            return True
    return False


@persistent
def _history_changes(*_):
    if _edits.last is None or _is_stored():
        return
    preferences = bpy.context.preferences
    is_dirty = preferences.is_dirty
    # Blender looks at experimental options only if developers' options are shown.
    for owner, name in (
        (preferences.view, "show_developer_ui"),
        (preferences.experimental, "use_undo_legacy"),
    ):
        _edits.kept.append((owner, name, getattr(owner, name)))
        setattr(owner, name, True)
    # Set last: each change of a preference marks them as edited.
    _edits.kept.append((preferences, "is_dirty", is_dirty))


@persistent
def _history_changed(*_):
    _edits.last = None
    for owner, name, value in _edits.kept:
        setattr(owner, name, value)
    _edits.kept.clear()


HANDLERS = {
    "undo_pre": _history_changes,
    "redo_pre": _history_changes,
    "undo_post": _history_changed,
    "redo_post": _history_changed,
    "load_post": _history_changed,
}


def register():
    _edits.last = None
    add_handlers(HANDLERS)


def unregister():
    remove_handlers(HANDLERS)
    _history_changed()
