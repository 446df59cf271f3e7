# SPDX-License-Identifier: GPL-3.0-or-later
"""Edits whose step of undo is stored before anything is evaluated, as in a window; dangling pointers.

``bpy.ops.ed.undo_push`` evaluates first, so that handlers have acted when the step is stored.
"""

import bpy

_pending = []


class SCFPF_OT_stored_edit(bpy.types.Operator):
    """Call a function and store a step."""

    bl_idname = "wm.scfpf_stored_edit"  # not among the extension's own, which random sessions call
    bl_label = "Edit"
    bl_options = {"UNDO"}  # noqa: RUF012

    def execute(self, _context):
        _pending.pop()()
        return {"FINISHED"}


def stored_edit(function) -> None:
    """Call a function, have Blender store a step, then evaluate."""
    if not hasattr(bpy.types, "WM_OT_scfpf_stored_edit"):
        bpy.utils.register_class(SCFPF_OT_stored_edit)
    _pending.append(function)
    assert bpy.ops.wm.scfpf_stored_edit("EXEC_DEFAULT", True) == {"FINISHED"}
    bpy.context.view_layer.update()


def dangling() -> list[list[str]]:
    """The names of the datablocks that point to one which is not in the file, once for each of these.

    Blender ends itself when it follows such a pointer. Call it at the beginning of undo_post or redo_post.
    """
    lists = [getattr(bpy.data, name) for name in dir(bpy.data)]
    alive = {
        one.as_pointer()
        for held in lists
        if isinstance(held, bpy.types.bpy_prop_collection)
        for one in held
        if isinstance(one, bpy.types.ID)
    }
    return [
        sorted(user.name for user in users)
        for used, users in bpy.data.user_map().items()
        if used.as_pointer() not in alive and not used.is_embedded_data
    ]
