# SPDX-License-Identifier: GPL-3.0-or-later
"""The events of Blender: which rooms are told, and in which order.

Before undo and redo, an edit that no step holds is stored; then every pointer that a handler has set is
released. After undo and redo, the same rooms restore their pointers, cameras before what is made from them.
After an evaluation, cameras and their surfaces are put in order first; Aim, Live View, the drawn lines, the
nodes preview and the rig follow. ``docs/decisions/handlers-and-undo.md`` says why pointers are released.
"""

from __future__ import annotations

import traceback
from collections.abc import Callable

import bpy
from bpy.app.handlers import persistent

from .bridge.aim import live_aim
from .bridge.blender import scene_objects, unstored_edits
from .bridge.live import live_drawing
from .bridge.mappings import st_map_image
from .bridge.overlays import viewport_overlay
from .bridge.render import render_engine, render_job, result_image
from .bridge.settings import validation
from .bridge.sync import camera_sync
from .cycles import engine_choice, rig
from .cycles.layers import pass_files
from .scanline.preview import preview, preview_drafts

# Called with a scene and its evaluated depsgraph.
UPDATES: dict[str, tuple[Callable, ...]] = {
    "depsgraph_update_post": (
        unstored_edits.scene_updated,
        st_map_image.scene_updated,  # others ask whether a mapping has changed
        camera_sync.scene_updated,
        live_aim.scene_updated,
        live_drawing.scene_updated,
        viewport_overlay.scene_updated,
        preview.scene_updated,
        rig.scene_updated,
    ),
    "frame_change_post": (
        live_drawing.scene_updated,
        viewport_overlay.scene_updated,
        preview.frame_changed,
        rig.frame_changed,
    ),
}

# Called with a scene.
SCENES: dict[str, tuple[Callable, ...]] = {
    "depsgraph_update_pre": (preview_drafts.before_evaluation,),
    "frame_change_pre": (preview_drafts.before_frame,),
    "render_init": (
        render_engine.render_begins,
        camera_sync.render_begins,
        rig.render_begins,
        engine_choice.render_begins,
    ),
    "render_pre": (rig.frame_begins,),
}

_RELEASE = (
    camera_sync.release_for_history,
    live_aim.forget,
    preview.release_for_history,
    rig.release_for_history,
)
_FOLLOW = (
    live_aim.forget,
    live_drawing.file_changed,
    viewport_overlay.file_changed,
    result_image.history_changed,
    preview.restore_after_history,
    rig.restore_after_history,
    pass_files.history_changed,
)

# Called without arguments.
FILES: dict[str, tuple[Callable, ...]] = {
    "undo_pre": (unstored_edits.store_before_undo, *_RELEASE),
    "redo_pre": (unstored_edits.store_before_redo, *_RELEASE),
    "undo_post": (st_map_image.file_changed, camera_sync.restore_undone, *_FOLLOW),
    "redo_post": (st_map_image.file_changed, camera_sync.restore_redone, *_FOLLOW),
    "load_pre": (live_drawing.stop_all,),
    "load_post": (
        validation.file_loaded,  # the others rely on valid values
        st_map_image.file_changed,
        camera_sync.file_loaded,
        live_aim.forget,
        viewport_overlay.file_loaded,
        preview.file_loaded,
        rig.file_loaded,
        render_job.forget,  # its cache may hold hundreds of MB of the file before
        unstored_edits.forget,
    ),
    "save_pre": (camera_sync.file_saves, preview.file_saves),
    "save_post": (preview.file_saved,),
    "save_post_fail": (preview.file_saved,),
}

# Other add-ons' handlers of these come later: what we store and release is then as the artist left it.
FIRST = {"undo_pre", "redo_pre"}

_registered: dict[str, Callable] = {}


def _handler(functions: tuple[Callable, ...], count: int) -> Callable:
    """The handler that calls functions in turn with the first ``count`` of its arguments."""

    @persistent
    def handler(*arguments) -> None:
        with scene_objects.event():
            for function in functions:
                try:
                    function(*arguments[:count])
                except Exception:
                    # As Blender does with handlers of their own: one that fails keeps no other from its work.
                    traceback.print_exc()

    return handler


def register() -> None:
    camera_sync.forget()
    for group, count in ((UPDATES, 2), (SCENES, 1), (FILES, 0)):
        for event, functions in group.items():
            _registered[event] = _handler(functions, count)
            handlers = getattr(bpy.app.handlers, event)
            handlers.insert(0 if event in FIRST else len(handlers), _registered[event])


def unregister() -> None:
    for event, handler in _registered.items():
        getattr(bpy.app.handlers, event).remove(handler)
    _registered.clear()
