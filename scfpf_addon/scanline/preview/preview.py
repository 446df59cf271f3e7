# SPDX-License-Identifier: GPL-3.0-or-later
"""The nodes preview of a flexible camera: switched on, kept in step with the scene, switched off.

Nodes do all computation. Python only keeps the members of the source's collections, and notices a camera's
new list of surfaces and strokes of brushes. A preview that no viewport shows sleeps; one that has lost its
camera is removed.
"""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import dataclass, field

import bpy

from ...bridge.blender import versions
from ...bridge.blender.all_or_nothing import all_or_nothing, at_end
from ...bridge.blender.draw_handler import DrawHandler
from ...bridge.blender.mesh_grid import uv_layer
from ...bridge.blender.scene_objects import has_removed
from ...bridge.scene.read_materials import volume_only_materials
from ...bridge.sync.camera_sync import sync as sync_volumes
from ...projection.user_error import UserError
from ...projection.volume.basis import WEIGHTED
from ..table.mapping_table import image_signature
from . import preview_drafts, preview_viewports
from .preview_data import (
    add_parts,
    copied_shelves,
    hide_in_layers,
    is_asleep,
    is_whole,
    make_preview,
    previews,
    release_pointers,
    remove_copy,
    remove_preview,
    set_asleep,
    update_pictures,
)
from .preview_members import places_of, shown_objects, take_members, visibility_signature
from .preview_parts import OVERFULL, SHARED_FACES, face_count, share_out

# Properties of a surface patch that decide which of its points Blender draws.
NET = ("point_count_u", "point_count_v", "resolution_u", "resolution_v", "use_cyclic_u", "use_cyclic_v")


@dataclass
class _State:
    """The state of the scene that a preview was last brought in step with; no Blender data.

    objects, camera: signatures. volume_only: see ``volume_only_materials``. faces: of each object that is
    shown, by session id. ids: session ids by name, by which Blender's updates are told apart.
    """

    objects: bytes | None = None
    volume_only: frozenset[int] = frozenset()
    camera: tuple | None = None
    faces: dict[int, int] = field(default_factory=dict)
    ids: dict[str, int] = field(default_factory=dict)


# By session id of the preview's source.
_states: dict[int, _State] = {}
# Sources of the previews that were on at the last look. Undo and redo make others appear.
_known: set[int] = set()


def _state(source) -> _State:
    return _states.setdefault(source.session_uid, _State())


def switch_on(context, camera):
    """Preview a camera, in a viewport of its own unless Blender has no window; return the source collection.

    Raises UserError; after any error all is as before.
    """
    with switched_on(context, camera) as source:
        return source


@contextmanager
def switched_on(context, camera) -> Iterator:
    """Make the preview for a block that gets its source; after any error in it all is as before."""
    scene, view_layer = context.scene, context.view_layer
    with all_or_nothing() as kept:
        kept.keep_keys(camera)
        source = make_preview(scene, view_layer, camera)
        kept.callback(_forget, source.session_uid)
        preview_drafts.begin(source)
        view_layer.update()
        _follow_members(source, view_layer, view_layer.depsgraph)
        _state(source).camera = _camera_signature(camera, source.scfpf_preview.scene)
        _known.add(source.session_uid)
        if context.window is not None and not bpy.app.background:
            preview_viewports.hide_from_others(source)
            kept.callback(_close_viewports, source)
            show(context, source)
        yield source


@contextmanager
def moved(context, source) -> Iterator:
    """Move a preview to the context's view layer, and its viewports to windows with it.

    As ``switched_on``, with a block that gets the source; after any error in it, too, all is as before.
    """
    settings = source.scfpf_preview
    with all_or_nothing() as kept:
        kept.callback(_put_into, source, settings.view_layer)
        kept.keep(settings)
        _put_into(source, context.view_layer.name)
        others = preview_viewports.viewports_of(source)
        here = [pair for pair in others if pair[0].view_layer == context.view_layer]
        if context.window is not None and not bpy.app.background and not here:
            show(context, source)
        yield source
    for window, area in others:
        if (window, area) not in here:
            preview_viewports.close_viewport(window, area)


def _put_into(source, name: str) -> None:
    """Let a preview show what a view layer of its scene, by its name, shows."""
    settings = source.scfpf_preview
    settings.view_layer = name
    hide_in_layers(source)
    view_layer = settings.scene.view_layers[name]
    view_layer.update()
    _follow_members(source, view_layer, view_layer.depsgraph)


def show(context, source) -> None:
    """Open a viewport of a preview; raises UserError."""
    preview_viewports.open_viewport(context, source)
    _sync_sleep()


def switch_off(source) -> None:
    """Close a preview's viewports, and remove all that was made for it."""
    at_end(_close_viewports, source)
    at_end(_remove, source)


def _close_viewports(source) -> None:
    for window, area in preview_viewports.viewports_of(source):
        preview_viewports.close_viewport(window, area)


def _remove(source) -> None:
    uid = source.session_uid
    remove_preview(source)
    _forget(uid)
    # The viewport's camera may have been made flexible.
    sync_volumes()


def _forget(uid: int) -> None:
    """Forget the state of a preview by its session id."""
    _states.pop(uid, None)
    _known.discard(uid)


def _camera_signature(camera, scene) -> tuple:
    """The settings on which the table and the node groups depend, and which nodes cannot follow."""
    settings = camera.scfpf
    surfaces = (_surface_signature(slot, settings.basis in WEIGHTED) for slot in settings.surfaces)
    # Nodes follow the ranges. The table's size depends on whether they are whole.
    whole = tuple(settings.u_range) == tuple(settings.v_range) == (0.0, 1.0)
    mappings = image_signature(camera, scene)
    return (*surfaces, settings.basis, settings.reparameterisation, whole, settings.pixel_error, mappings)


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
    """Bring the previews of a scene in step with it; remove previews that have lost their camera or a part.

    structure_changed: whether the scene or a collection was edited. depsgraph: None, or evaluated, with its
    updates. may_remove: False while Blender goes to another frame or another scene, where removal would
    crash. Takes next to no time without a preview. Not to be called from a render's thread.
    """
    for source in previews():
        if not is_whole(source):
            if may_remove:
                _remove(source)
                _sync_viewports_soon()
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
        hide_in_layers(source)
        preview_drafts.forget(source)
    state, camera = _state(source), _camera_signature(settings.camera, settings.scene)
    camera_changed = state.camera != camera
    if (
        structure_changed
        or camera_changed
        or state.objects != visibility_signature(view_layer)
        or _has_other_surfaces(state, depsgraph)
        or _has_grown(state, depsgraph)
    ):
        _follow_members(source, view_layer, depsgraph)
    if camera_changed:
        state.camera = camera
        preview_drafts.forget(source)
        try:
            update_pictures(source)
            settings.problem = ""
        except UserError as error:
            settings.problem = str(error)
    if not bpy.app.background:
        _sync_sleep()


def _follow_strokes(depsgraph) -> None:
    """Have sculpted objects evaluated while strokes go on.

    If a viewport draws the mesh straight from the brush, Blender's updates only tell of new shading. The
    evaluated mesh, which everything else sees, does not change until the mode is left.
    """
    if not _states:
        return  # no preview: where anything is linked, Blender's updates name every object
    for update in depsgraph.updates:
        if not isinstance(update.id, bpy.types.Object) or update.id.mode != "SCULPT":
            continue
        if update.is_updated_shading and not update.is_updated_geometry:
            sculpted = bpy.data.objects.get(update.id.name)
            shown = [source for source in previews() if sculpted.session_uid in _state(source).faces]
            if any(not is_asleep(source) for source in shown):
                sculpted.update_tag(refresh={"DATA"})


def _has_other_surfaces(state: _State, depsgraph) -> bool:
    """Return whether a material has lost or gained its surface."""
    kinds = ("MATERIAL", "NODETREE")
    updated = depsgraph is not None and any(depsgraph.id_type_updated(kind) for kind in kinds)
    return updated and state.volume_only != volume_only_materials()


def _may_read(depsgraph) -> bool:
    """Return whether a depsgraph's geometry can be read: there is one, and it has no removed objects."""
    return depsgraph is not None and not has_removed()


def _has_grown(state: _State, depsgraph) -> bool:
    """Return whether a shown object has become so heavy that it may need a picture object of its own."""
    for update in depsgraph.updates if _may_read(depsgraph) else ():
        if update.is_updated_geometry and isinstance(update.id, bpy.types.Object):
            # By name: `.original` of an object that is not shown may be freed memory after an undo (5.2).
            before = state.faces.get(state.ids.get(update.id.name))
            if before is not None and face_count(update.id, depsgraph) > OVERFULL * max(before, SHARED_FACES):
                return True
    return False


def _follow_members(source, view_layer, depsgraph) -> None:
    state = _state(source)
    state.objects, state.volume_only = visibility_signature(view_layer), volume_only_materials()
    wanted = shown_objects(view_layer)
    if not _may_read(depsgraph):
        depsgraph = None
    before = state.faces if depsgraph is None else {}
    state.faces = {key: before.get(key) or face_count(member, depsgraph) for key, member in wanted.items()}
    state.ids = {member.name: key for key, member in wanted.items()}
    parts = source.scfpf_preview.parts
    places = share_out(state.faces, places_of([part.members for part in parts]))
    pictures = add_parts(source, max(places.values(), default=0) + 1)
    preview_drafts.forget(source)
    if pictures:
        preview_drafts.begin(source)
    new = take_members([part.members for part in parts], wanted, places)
    if not bpy.app.background:
        preview_viewports.keep_out(new, source)
        preview_viewports.show_more(pictures, source)


def _sync_sleep() -> None:
    """Let the previews sleep that no viewport shows, and wake the others."""
    asleep = False
    for source in previews():
        shown = bool(preview_viewports.viewports_of(source))
        set_asleep(source, not shown)
        asleep = asleep or not shown
    # No handler tells of another workspace, but Blender draws its viewports.
    if asleep and not _watch.is_registered:
        _watch.register()
    elif not asleep:
        _stop_watch()


def _stop_watch() -> None:
    if _watch.is_registered:
        _watch.unregister()


def _viewport_drawn() -> None:
    shown = bpy.context.space_data.camera
    if any(source.scfpf_preview.view_camera == shown and is_asleep(source) for source in previews()):
        _sync_viewports_soon()


# Told of redraws while a preview sleeps.
_watch = DrawHandler(bpy.types.SpaceView3D, _viewport_drawn, "POST_PIXEL")


def _sync_viewports_soon() -> None:
    """Update viewports as soon as areas can be opened and closed: not while Blender calls their handlers."""
    if not bpy.app.background and not bpy.app.timers.is_registered(_sync_viewports):
        bpy.app.timers.register(_sync_viewports, first_interval=0.0)


def _sync_viewports() -> None:
    """Close viewports of previews that are gone; show previews that undo or redo brought back."""
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
                except preview_viewports.UserError as error:
                    source.scfpf_preview.problem = str(error)
    _sync_sleep()


def scene_updated(scene, depsgraph) -> None:
    """Keep the scene's previews consistent after an evaluation."""
    if depsgraph.mode == "VIEWPORT":
        preview_drafts.after_evaluation(scene, depsgraph)
        changed = depsgraph.id_type_updated("SCENE") or depsgraph.id_type_updated("COLLECTION")
        sync(scene, changed, depsgraph)
        _follow_strokes(depsgraph)
        versions.settle_view_layers()


def frame_changed(scene, depsgraph) -> None:
    """Keep the scene's previews consistent at another frame."""
    if depsgraph.mode == "VIEWPORT":
        sync(scene, False, may_remove=False)
        preview_drafts.after_frame(scene, depsgraph)
        versions.settle_view_layers()


def release_for_history() -> None:
    """Clear the pointers that handlers have set, before undo and redo."""
    for source in previews():
        release_pointers(source)


def restore_after_history() -> None:
    """Set the pointers again after undo and redo."""
    for state in _states.values():
        state.camera = None
    _sync_all()
    for source in previews():
        preview_drafts.begin(source)
    _sync_viewports_soon()


def file_loaded() -> None:
    """Prepare the previews of a file that Blender has loaded."""
    _states.clear()
    _known.clear()
    preview_drafts.forget()
    preview_drafts.finish()
    _known.update(source.session_uid for source in previews())
    preview_viewports.note_viewports()
    _sync_all()


def file_saves() -> None:
    """Wake all previews, and make them whole: files must work where the add-on is not, which could do it."""
    preview_drafts.finish()
    for source in previews():
        set_asleep(source, False)


def file_saved() -> None:
    """Let previews that nobody sees sleep again."""
    if not bpy.app.background:
        _sync_sleep()


def _sync_all() -> None:
    for scene in bpy.data.scenes:
        if scene.is_editable:
            sync(scene, True)


def unregister():
    _stop_watch()
    preview_drafts.stop()
    if bpy.app.timers.is_registered(_sync_viewports):
        bpy.app.timers.unregister(_sync_viewports)
