# SPDX-License-Identifier: GPL-3.0-or-later
"""A step of undo for operators that scripts call without one, as Python does by default.

Undo keeps a datablock in memory if two stored steps agree on it, whatever has been done to it since. It may
then point to an object that neither step has, and Blender follows the pointer into freed memory: its own
operators that add objects end so as well. An edit of ours that no step holds is therefore stored right before
undo, which then takes back this edit.
"""

from __future__ import annotations

import sys

import bpy
from bpy.props import IntProperty

# The extension's own modules, of which one is the outermost caller where Blender itself calls an operator.
_OURS = __name__.partition("scfpf_addon")[0]


class _Edit:
    """The last edit by a script, until an operator that stores a step is seen to have ended.

    is_open: there is such an edit. last: the address of Blender's newest listed operator at the edit, or 0.
    scene: ``session_uid`` of the scene that counts the edit, and the count, which are compared after undo.
    """

    def __init__(self) -> None:
        self.is_open = False
        self.last = 0
        self.scene: tuple[int, int] | None = None


_edit = _Edit()


def note_edit() -> None:
    """Note that an operator edits the file. Every operator of ours with the option UNDO calls this first."""
    if not _is_called_by_script():
        return
    _edit.is_open, _edit.last = True, _newest()
    scene = bpy.context.scene
    _edit.scene = None
    if scene.is_editable:
        scene.scfpf_edits += 1
        _edit.scene = scene.session_uid, scene.scfpf_edits
    if not bpy.app.timers.is_registered(_look_later):
        bpy.app.timers.register(_look_later, first_interval=0.0, persistent=True)


def _is_called_by_script() -> bool:
    """Return whether Python code of others has called the operator. Blender itself stores a step."""
    frame = sys._getframe(1)
    while frame.f_back is not None:
        frame = frame.f_back
    return not frame.f_globals.get("__name__", "").startswith(_OURS)


def _newest() -> int:
    done = bpy.context.window_manager.operators
    return done[-1].as_pointer() if len(done) else 0


def _look_for_step() -> None:
    """Forget the edit if an operator that stores a step has ended since: Blender lists such operators."""
    for done in reversed(bpy.context.window_manager.operators if _edit.is_open else ()):
        if done.as_pointer() == _edit.last:
            return
        if "UNDO" in done.bl_options:
            _edit.is_open = False
            return


def _look_later() -> None:
    # An operator is listed after it has ended, and nothing need be evaluated then.
    _look_for_step()


def scene_updated(_scene, _depsgraph) -> None:
    """Forget the edit if an operator that stores a step has ended since."""
    _look_for_step()


def store_before_undo() -> None:
    """Store the edit before Blender undoes.

    Called before what releases pointers: a step holds the file as the artist sees it.
    """
    if not _edit.is_open:
        return
    _store()
    # A step that no listed operator has stored may hold the edit already. One step back tells. It is made
    # here: an undo within undo_post frees what Blender goes on with.
    bpy.ops.ed.undo()
    if _edit.scene not in {(scene.session_uid, scene.scfpf_edits) for scene in bpy.data.scenes}:
        bpy.ops.ed.redo()


def store_before_redo() -> None:
    """Store the edit before Blender redoes, which then finds nothing to redo."""
    if _edit.is_open:
        _store()


def _store() -> None:
    _edit.is_open = False
    bpy.ops.ed.undo_push(message="Script")


def forget() -> None:
    """Forget the edit."""
    _edit.is_open = False


def register():
    bpy.types.Scene.scfpf_edits = IntProperty(
        name="Edits by Scripts",
        description="Counts edits by scripts, so that undo knows whether a step holds the last one",
        options={"HIDDEN"},
    )
    forget()


def unregister():
    if _edit.is_open and bpy.ops.ed.undo_push.poll():
        _store()  # undo without the extension has no handler that does it
    if bpy.app.timers.is_registered(_look_later):
        bpy.app.timers.unregister(_look_later)
    del bpy.types.Scene.scfpf_edits
