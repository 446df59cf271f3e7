# SPDX-License-Identifier: GPL-3.0-or-later
"""The live preview of a flexible camera: switched on, kept in step with the scene, switched off.

Nodes do all computation. Python only keeps the source collection's membership, notices a
camera's new list of surfaces, and removes a preview whose camera is gone.
"""

from __future__ import annotations

import bpy
from bpy.app.handlers import persistent

from . import preview_viewports
from .preview_data import (
    PreviewError,
    copied_shelves,
    is_whole,
    make_preview,
    previews,
    remove_copy,
    remove_preview,
    settle_in_layers,
    update_picture,
)
from .preview_members import shown_objects, take_members, visibility_signature

# What was seen at the last look, by session_uid of the preview's collection: numbers and bytes only.
_seen_objects: dict[int, bytes] = {}
_seen_cameras: dict[int, tuple] = {}
# Previews that were on at the last look. Undo and redo make others appear.
_known: set[int] = set()


def switch_on(context, camera):
    """Preview a camera, in a viewport of its own unless Blender has no window; returns its source collection.

    Raises PreviewError or ViewportError; nothing is left behind.
    """
    scene, view_layer = context.scene, context.view_layer
    source = make_preview(scene, view_layer, camera)
    _follow_members(source, view_layer)
    _seen_cameras[source.session_uid] = _camera_signature(camera)
    _known.add(source.session_uid)
    if context.window is not None and not bpy.app.background:
        try:
            preview_viewports.hide_from_others(source)
            preview_viewports.open_viewport(context, source)
        except preview_viewports.ViewportError:
            _remove(source)
            raise
    return source


def switch_off(source) -> None:
    """Close a preview's viewports and remove all that was made for it."""
    for window, area in preview_viewports.viewports_of(source):
        preview_viewports.close_viewport(window, area)
    _remove(source)


def _remove(source) -> None:
    uid = source.session_uid
    remove_preview(source)
    _seen_objects.pop(uid, None)
    _seen_cameras.pop(uid, None)
    _known.discard(uid)


def _camera_signature(camera) -> tuple:
    """What the table and the node group depend on, beyond what nodes follow by themselves."""
    settings = camera.scfpf
    surfaces = (
        (slot.object.session_uid, slot.object.scfpf_surface.kind) if slot.object is not None else None
        for slot in settings.surfaces
    )
    # Nodes follow the ranges; only whether they are whole says how fine the table must be.
    whole = tuple(settings.u_range) == tuple(settings.v_range) == (0.0, 1.0)
    return (*surfaces, settings.basis, settings.reparameterisation, whole, settings.pixel_error)


def tend(scene, structure_changed: bool) -> None:
    """Bring the previews of a scene in step with it; remove any that has lost its camera or a part.

    structure_changed: the depsgraph has told of an edit of the scene or a collection.
    Costs next to nothing while there is no preview. Not to be called from a render's thread.
    """
    for source in previews():
        if not is_whole(source):
            _remove(source)
            _settle_viewports_soon()
        elif source.scfpf_preview.scene == scene:
            _follow(source, structure_changed)
    if structure_changed:
        for shelf in copied_shelves():
            remove_copy(shelf)


def _follow(source, structure_changed: bool) -> None:
    settings = source.scfpf_preview
    view_layer = settings.scene.view_layers.get(settings.view_layer)
    if view_layer is None:
        view_layer = settings.scene.view_layers[0]
        settings.view_layer = view_layer.name
    if structure_changed:
        settle_in_layers(source)
    camera = _camera_signature(settings.camera)
    uid = source.session_uid
    camera_changed = _seen_cameras.get(uid) != camera
    if structure_changed or camera_changed or _seen_objects.get(uid) != visibility_signature(view_layer):
        _follow_members(source, view_layer)
    if camera_changed:
        _seen_cameras[uid] = camera
        try:
            update_picture(source)
            settings.problem = ""
        except PreviewError as error:
            settings.problem = str(error)


def _follow_members(source, view_layer) -> None:
    _seen_objects[source.session_uid] = visibility_signature(view_layer)
    new = take_members(source, shown_objects(view_layer))
    if new and not bpy.app.background:
        preview_viewports.keep_out(new, source)


def _settle_viewports_soon() -> None:
    """Areas cannot be closed or opened while Blender goes through them to call a handler."""
    if not bpy.app.background and not bpy.app.timers.is_registered(_settle_viewports):
        bpy.app.timers.register(_settle_viewports, first_interval=0.0)


def _settle_viewports() -> None:
    """Close the viewports whose preview is gone; show the previews that undo or redo brought back."""
    preview_viewports.close_orphans()
    _known.intersection_update(source.session_uid for source in previews())
    for window in bpy.context.window_manager.windows:
        for source in previews():
            if source.session_uid in _known or source.scfpf_preview.scene != window.scene:
                continue
            _known.add(source.session_uid)
            if not preview_viewports.viewports_of(source):
                try:
                    with bpy.context.temp_override(window=window):
                        preview_viewports.open_viewport(bpy.context, source)
                except preview_viewports.ViewportError as error:
                    source.scfpf_preview.problem = str(error)


@persistent
def _scene_updated(scene, depsgraph) -> None:
    if depsgraph.mode == "VIEWPORT":
        tend(scene, depsgraph.id_type_updated("SCENE") or depsgraph.id_type_updated("COLLECTION"))


@persistent
def _frame_changed(scene, depsgraph) -> None:
    if depsgraph.mode == "VIEWPORT":
        tend(scene, False)


@persistent
def _history_changed(*_) -> None:
    """After undo and redo."""
    _tend_all()
    _settle_viewports_soon()


@persistent
def _file_loaded(*_) -> None:
    _seen_objects.clear()
    _seen_cameras.clear()
    _known.clear()
    _known.update(source.session_uid for source in previews())
    preview_viewports.note_viewports()
    _tend_all()


def _tend_all() -> None:
    for scene in bpy.data.scenes:
        if scene.is_editable:
            tend(scene, True)


HANDLERS = {
    "depsgraph_update_post": _scene_updated,
    "frame_change_post": _frame_changed,
    "undo_post": _history_changed,
    "redo_post": _history_changed,
    "load_post": _file_loaded,
}


def register():
    for name, function in HANDLERS.items():
        getattr(bpy.app.handlers, name).append(function)


def unregister():
    for name, function in HANDLERS.items():
        getattr(bpy.app.handlers, name).remove(function)
    if bpy.app.timers.is_registered(_settle_viewports):
        bpy.app.timers.unregister(_settle_viewports)
