# SPDX-License-Identifier: GPL-3.0-or-later
"""The live preview of a flexible camera: switched on, kept in step with the scene, switched off.

Nodes do all computation. Python only keeps the source's membership, notices a camera's new list of
surfaces and strokes of brushes, lets a preview sleep that no viewport shows, and removes one whose
camera is gone.
"""

from __future__ import annotations

import bpy
from bpy.app.handlers import persistent

from ...bridge.blender import versions
from ...bridge.blender.mesh_grid import uv_layer
from ...bridge.sync.handlers import sync as sync_volumes
from ..table.mapping_table import picture_signature
from . import preview_viewports
from .preview_data import (
    PreviewError,
    add_parts,
    copied_shelves,
    is_asleep,
    is_whole,
    make_preview,
    previews,
    release_pointers,
    remove_copy,
    remove_preview,
    set_asleep,
    settle_in_layers,
    update_pictures,
)
from .preview_members import places_of, shown_objects, take_members, visibility_signature
from .preview_parts import OVERFULL, SHARED_FACES, face_count, share_out

# What decides, of a surface patch, which points of it Blender draws.
NET = ("point_count_u", "point_count_v", "resolution_u", "resolution_v", "use_cyclic_u", "use_cyclic_v")

# What was seen at the last look, by session_uid of the preview's collection: numbers and bytes only.
_seen_objects: dict[int, bytes] = {}
_seen_cameras: dict[int, tuple] = {}
# Faces by session_uid of the object, of what each preview shows.
_faces: dict[int, dict[int, int]] = {}
# The names of those objects, by which Blender's updates are told apart.
_names: dict[int, dict[str, int]] = {}
# Previews that were on at the last look. Undo and redo make others appear.
_known: set[int] = set()
# Blender's handle of the function that is told of redraws while a preview sleeps.
_watch: list = []


def switch_on(context, camera):
    """Preview a camera, in a viewport of its own unless Blender has no window; returns its source collection.

    Raises PreviewError or ViewportError; nothing is left behind.
    """
    scene, view_layer = context.scene, context.view_layer
    source = make_preview(scene, view_layer, camera)
    try:
        view_layer.update()
        _follow_members(source, view_layer, view_layer.depsgraph)
        _seen_cameras[source.session_uid] = _camera_signature(camera, source.scfpf_preview.scene)
        _known.add(source.session_uid)
        if context.window is not None and not bpy.app.background:
            preview_viewports.hide_from_others(source)
            show(context, source)
    except Exception:
        _remove(source)
        raise
    return source


def show(context, source) -> None:
    """Open a viewport of a preview; raises ViewportError."""
    preview_viewports.open_viewport(context, source)
    _settle_sleep()


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
    _faces.pop(uid, None)
    _names.pop(uid, None)
    _known.discard(uid)
    # The viewport's camera may have been made flexible.
    sync_volumes()


def _camera_signature(camera, scene) -> tuple:
    """What the table and the node group depend on, beyond what nodes follow by themselves."""
    settings = camera.scfpf
    surfaces = (_surface_signature(slot, settings.basis == "NURBS") for slot in settings.surfaces)
    # Nodes follow the ranges; only whether they are whole says how fine the table must be.
    whole = tuple(settings.u_range) == tuple(settings.v_range) == (0.0, 1.0)
    picture = picture_signature(camera, scene)
    return (*surfaces, settings.basis, settings.reparameterisation, whole, settings.pixel_error, picture)


def _surface_signature(slot, weighted: bool) -> tuple | None:
    surface = slot.object
    if surface is None:
        return None
    drawn: tuple = ()
    if surface.type == "MESH":
        layer = uv_layer(surface.data)
        drawn = (len(surface.data.vertices), len(surface.data.polygons), layer.name if layer else "")
    elif surface.type == "SURFACE":
        drawn = tuple(tuple(getattr(spline, name) for name in NET) for spline in surface.data.splines)
    weight = slot.weight if weighted else 1.0
    return surface.session_uid, surface.scfpf_surface.kind, weight, len(surface.modifiers), drawn


def sync(scene, structure_changed: bool, depsgraph=None, may_remove: bool = True) -> None:
    """Bring the previews of a scene in step with it; remove any that has lost its camera or a part.

    structure_changed: the depsgraph has told of an edit of the scene or a collection. depsgraph:
    None or evaluated, with its updates. may_remove: not while Blender goes from frame to frame or to
    another scene, where it would crash.
    Costs next to nothing while there is no preview. Not to be called from a render's thread.
    """
    for source in previews():
        if not is_whole(source):
            if may_remove:
                _remove(source)
                _settle_viewports_soon()
        elif source.scfpf_preview.scene == scene:
            _follow(source, structure_changed, depsgraph)
    if structure_changed:
        for shelf in copied_shelves():
            remove_copy(shelf)


def _follow(source, structure_changed: bool, depsgraph) -> None:
    settings = source.scfpf_preview
    view_layer = settings.scene.view_layers.get(settings.view_layer)
    if view_layer is None:
        view_layer = settings.scene.view_layers[0]
        settings.view_layer = view_layer.name
    if structure_changed:
        settle_in_layers(source)
    uid, camera = source.session_uid, _camera_signature(settings.camera, settings.scene)
    camera_changed = _seen_cameras.get(uid) != camera
    if (
        structure_changed
        or camera_changed
        or _seen_objects.get(uid) != visibility_signature(view_layer)
        or _has_grown(uid, depsgraph)
    ):
        _follow_members(source, view_layer, depsgraph)
    if camera_changed:
        _seen_cameras[uid] = camera
        try:
            update_pictures(source)
            settings.problem = ""
        except PreviewError as error:
            settings.problem = str(error)
    if not bpy.app.background:
        _settle_sleep()


def _follow_strokes(depsgraph) -> None:
    """Have what is sculpted evaluated, as strokes go on.

    Where a viewport draws the mesh straight from the brush, Blender tells only that it shades anew, and the
    evaluated mesh, which all else sees, stays as it was until the mode is left.
    """
    if not _faces:
        return  # no preview: where anything is linked, Blender's updates name every object
    for update in depsgraph.updates:
        if not isinstance(update.id, bpy.types.Object) or update.id.mode != "SCULPT":
            continue
        if update.is_updated_shading and not update.is_updated_geometry:
            sculpted = bpy.data.objects.get(update.id.name)
            shown = [
                source for source in previews() if sculpted.session_uid in _faces.get(source.session_uid, ())
            ]
            if any(not is_asleep(source) for source in shown):
                sculpted.update_tag(refresh={"DATA"})


def _has_grown(uid: int, depsgraph) -> bool:
    """Whether something that a preview shows has become so heavy that it may need a picture of its own."""
    faces, names = _faces.get(uid, {}), _names.get(uid, {})
    for update in depsgraph.updates if depsgraph is not None else ():
        if update.is_updated_geometry and isinstance(update.id, bpy.types.Object):
            # By name: `.original` of what is not shown may be freed memory after an undo (5.2).
            before = faces.get(names.get(update.id.name))
            if before is not None and face_count(update.id, depsgraph) > OVERFULL * max(before, SHARED_FACES):
                return True
    return False


def _follow_members(source, view_layer, depsgraph) -> None:
    uid = source.session_uid
    _seen_objects[uid] = visibility_signature(view_layer)
    wanted = shown_objects(view_layer)
    before = _faces.get(uid, {}) if depsgraph is None else {}
    faces = {key: before.get(key) or face_count(member, depsgraph) for key, member in wanted.items()}
    _faces[uid] = faces
    _names[uid] = {member.name: key for key, member in wanted.items()}
    parts = source.scfpf_preview.parts
    places = share_out(faces, places_of([part.members for part in parts]))
    pictures = add_parts(source, max(places.values(), default=0) + 1)
    new = take_members([part.members for part in parts], wanted, places)
    if not bpy.app.background:
        preview_viewports.keep_out(new, source)
        preview_viewports.show_more(pictures, source)


def _settle_sleep() -> None:
    """Let the previews sleep that no viewport shows, and the others not."""
    asleep = False
    for source in previews():
        shown = bool(preview_viewports.viewports_of(source))
        set_asleep(source, not shown)
        asleep = asleep or not shown
    if asleep and not _watch:
        # No handler tells of another workspace, but what it shows is drawn.
        space = bpy.types.SpaceView3D
        _watch.append(space.draw_handler_add(_drawn, (), "WINDOW", "POST_PIXEL"))
    elif not asleep:
        _stop_watch()


def _stop_watch() -> None:
    while _watch:
        bpy.types.SpaceView3D.draw_handler_remove(_watch.pop(), "WINDOW")


def _drawn() -> None:
    shown = bpy.context.space_data.camera
    if any(source.scfpf_preview.view_camera == shown and is_asleep(source) for source in previews()):
        _settle_viewports_soon()


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
    _settle_sleep()


@persistent
def _scene_updated(scene, depsgraph) -> None:
    if depsgraph.mode == "VIEWPORT":
        changed = depsgraph.id_type_updated("SCENE") or depsgraph.id_type_updated("COLLECTION")
        sync(scene, changed, depsgraph)
        _follow_strokes(depsgraph)
        versions.settle_view_layers()


@persistent
def _frame_changed(scene, depsgraph) -> None:
    if depsgraph.mode == "VIEWPORT":
        sync(scene, False, may_remove=False)
        versions.settle_view_layers()


@persistent
def _history_changes(*_) -> None:
    """Before undo and redo."""
    for source in previews():
        release_pointers(source)


@persistent
def _history_changed(*_) -> None:
    """After undo and redo."""
    _seen_cameras.clear()
    _tend_all()
    _settle_viewports_soon()


@persistent
def _file_loaded(*_) -> None:
    _seen_objects.clear()
    _seen_cameras.clear()
    _faces.clear()
    _names.clear()
    _known.clear()
    _known.update(source.session_uid for source in previews())
    preview_viewports.note_viewports()
    _tend_all()


@persistent
def _saving(*_) -> None:
    """Files are to work without the add-on, which would not wake the preview there."""
    for source in previews():
        set_asleep(source, False)


@persistent
def _saved(*_) -> None:
    if not bpy.app.background:
        _settle_sleep()


def _tend_all() -> None:
    for scene in bpy.data.scenes:
        if scene.is_editable:
            sync(scene, True)


HANDLERS = {
    "depsgraph_update_post": _scene_updated,
    "frame_change_post": _frame_changed,
    "undo_pre": _history_changes,
    "redo_pre": _history_changes,
    "undo_post": _history_changed,
    "redo_post": _history_changed,
    "load_post": _file_loaded,
    "save_pre": _saving,
    "save_post": _saved,
    "save_post_fail": _saved,
}


def register():
    for name, function in HANDLERS.items():
        getattr(bpy.app.handlers, name).append(function)


def unregister():
    for name, function in HANDLERS.items():
        getattr(bpy.app.handlers, name).remove(function)
    _stop_watch()
    if bpy.app.timers.is_registered(_settle_viewports):
        bpy.app.timers.unregister(_settle_viewports)
