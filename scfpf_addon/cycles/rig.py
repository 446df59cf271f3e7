# SPDX-License-Identifier: GPL-3.0-or-later
"""The Cycles rig of a flexible camera: switched on, kept in step with the volume, switched off.

Nodes place the sheets, which follow surfaces and frames by themselves. Python only sets the number and the
ends of the chords, and checks them when the volume has changed.
"""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import contextmanager, suppress

import bpy
import numpy as np

from ..bridge.blender import versions
from ..bridge.blender.all_or_nothing import Kept, all_or_nothing, at_end
from ..bridge.blender.scene_objects import has_removed
from ..bridge.blender.user_errors import translated_report
from ..bridge.render.image_size import image_size
from ..bridge.sync.camera_sync import sync as sync_volumes
from ..projection.user_error import Message, UserError
from ..projection.volume.viewing_volume import Projection
from ..scanline.table.table_object import is_made
from . import aov_passes, disturbed_materials, hidden_surfaces, prices, seen_data
from .chord_planning import Planned, chords_of, planned
from .chords.chord_plan import MOST_CHORDS, SMALLEST_ERROR, ChordPlan, chord_error
from .portals.sheets import has_no_area, image_places
from .rig_data import (
    BOUNCES,
    CYCLES,
    SAME_SCREEN,
    adopt,
    check_surfaces,
    fit_screen,
    follow_view,
    give_back,
    has_cycles,
    has_old_nodes,
    is_whole,
    make_rig,
    mark_camera,
    present_chords,
    release_pointers,
    remove_rig,
    renew_materials,
    require_cycles,
    restore_pointers,
    rig_of,
    rigs,
    sheets_kept,
    update_nodes,
    write_passes,
    write_sheets,
)
from .skipping.refresh import forget_all, renew, stop_skipping, watch, write_skipping
from .smoke import changing_smoke, may_change_smoke, may_move_smoke, smoke_around
from .watched_volume import look

# Sampled image positions across and up for sheets without area.
SAMPLED = 9
# The rig of a volume without animation is made smaller again if this share of its chords is enough.
ENOUGH = 0.7
# Between the names of objects in a text, none of which has it.
NAMES_END = "\n"
STALE = Message("The animated volume has changed: press Update Chords")

# Signature of the volume that each rig was last brought in step with, by session id of the rig.
_seen: dict[int, tuple] = {}
# Session ids of the tables that ``release_pointers`` returned during undo and redo, by that of the rig.
_released: dict[int, int] = {}
# Session ids of rigs whose materials are to be noted after the next update.
_unnoted: set[int] = set()
# Blocks that write rigs. An evaluation meanwhile may show probes, which handlers must not take for sheets.
_writing: list[object] = []


@contextmanager
def _being_written() -> Iterator[None]:
    """Keep handlers from following rigs while a rig is written; they follow after the next update."""
    mark = object()
    _writing.append(mark)
    try:
        yield
    finally:
        _writing.remove(mark)


@contextmanager
def _rewritten(rig) -> Iterator[None]:
    """Keep handlers from following while a rig is rewritten; after an error it skips no chord."""
    with _being_written():
        try:
            with sheets_kept(rig):
                yield
        except BaseException:
            stop_skipping(rig)
            raise


def switch_on(context, camera, plan: Planned | None = None):
    """Make the rig of a camera in the context's scene; return its collection.

    It replaces the scene's rig of another camera, and updates that of the same one. plan: of ``Planning``,
    None to make it. Raises UserError, or an error of ``read_projection``; after any error all is as before.
    """
    with switched_on(context, camera, plan) as rig:
        return rig


@contextmanager
def switched_on(context, camera, plan: Planned | None = None) -> Iterator:
    """Make a rig like ``switch_on``, for a block. If the block raises, all is as before the rig was made."""
    scene = context.scene
    present = rig_of(scene)
    if present is not None and present.scfpf_rig.camera == camera:
        update(context, present, plan)
        yield present
        return
    try:
        with all_or_nothing() as kept, _being_written():
            require_cycles(scene)
            plan = planned(context, camera) if plan is None else plan
            chords = plan.chords
            _keep_settings(kept, scene, camera)
            if present is not None:
                _look_through(scene, present.scfpf_rig.camera, False)
                give_back(present)
            rig = make_rig(scene, camera, chords)
            _note_plan(rig, plan)
            _hide_surfaces()
            _look_through(scene, camera, True)
            write_skipping(rig, chords)
            _note(rig, context.evaluated_depsgraph_get(), chords)
            yield rig
    except BaseException:
        _hide_surfaces()
        raise
    if present is not None:
        _remove(present)


def _keep_settings(kept: Kept, scene, camera) -> None:
    """Keep the settings that rigs take over, of a scene and of others that render through its rig."""
    kept.keep_keys(camera)
    for user in bpy.data.scenes:
        kept.keep(user, "camera")
    kept.keep(scene.render, "engine")
    if has_cycles(scene):
        kept.keep(scene.cycles, *BOUNCES, "dicing_camera", "offscreen_dicing_scale")
    for marker in scene.timeline_markers:
        kept.keep(marker, "camera")
    for space in _viewports(scene):
        kept.keep(space, "camera", "use_local_camera")


def update(context, rig, plan: Planned | None = None) -> None:
    """Plan a rig again, for all frames. plan, errors: see ``switch_on``; the rig stays after an error."""
    plan = planned(context, rig.scfpf_rig.camera) if plan is None else plan
    chords = plan.chords
    with all_or_nothing(), _rewritten(rig):
        rig.scfpf_rig.is_own_view = chords.is_own_view
        update_nodes(rig)
        before = renew_materials(rig)
        aov_passes.renew(rig.scfpf_rig.scene)
        _note_plan(rig, plan)
        rig.scfpf_rig.problem = ""
        write_skipping(rig, chords)
        _note(rig, context.evaluated_depsgraph_get(), chords)
    bpy.data.batch_remove([material for material in before if material.users == 0])


def _note_plan(rig, plan: Planned) -> None:
    """Note what the frames of a plan have shown."""
    settings = rig.scfpf_rig
    settings.animated = plan.animated
    settings.smoke_later, settings.smoke_frame = plan.smoke
    settings.smoke_known, settings.smoke_unknown = NAMES_END.join(plan.looked_at), ""


def prepare_render(context, rig, animation: bool = False, apart: bool = False) -> None:
    """Let the rays of a rig skip what is empty at present, before its scene is rendered.

    animation, apart: see ``renew``.
    """
    context.view_layer.update()
    if is_whole(rig) and not rig.scfpf_rig.problem:
        with suppress(UserError), _rewritten(rig):
            renew(rig, context.view_layer, animation, apart)


def set_passes(rig, on: bool) -> None:
    """Switch the passes of t, depth, u and v of a rig's scene on or off. Raises UserError."""
    if on and rig.scfpf_rig.scene.render.engine != CYCLES:
        raise UserError("Choose Cycles as the render engine: only it has these passes")
    settings = rig.scfpf_rig
    check_surfaces(settings.camera)
    change, take_back = (aov_passes.add, aov_passes.remove)[:: 1 if on else -1]
    with all_or_nothing() as kept:
        kept.callback(write_passes, rig, settings.passes)
        kept.callback(take_back, settings.scene)
        kept.keep(settings, "passes")
        settings.passes = on
        change(settings.scene)
        update_nodes(rig)


def switch_off(rig) -> None:
    """Remove a rig and all that was made for it; after any error all is as before."""
    settings = rig.scfpf_rig
    with all_or_nothing() as kept:
        if settings.scene is not None and settings.camera is not None:
            _keep_settings(kept, settings.scene, settings.camera)
            _look_through(settings.scene, settings.camera, False)
        give_back(rig)
        _remove(rig)


def _remove(rig) -> None:
    """Remove a rig and all that was made for it, but leave the settings of the scene."""
    with all_or_nothing() as kept:
        kept.callback(_hide_surfaces)
        kept.keep(rig.scfpf_rig, "is_rig")
        rig.scfpf_rig.is_rig = False
        _hide_surfaces()
        at_end(_delete, rig)


def _delete(rig) -> None:
    _seen.pop(rig.session_uid, None)
    remove_rig(rig, gives_back=False)
    # The rig's camera may have been made flexible.
    sync_volumes()


def _hide_surfaces() -> None:
    """Hide all control surfaces from rays if the file has a rig, regardless of the last look at it."""
    hidden_surfaces.forget()
    hidden_surfaces.hide_surfaces(bool(rigs()))


def _look_through(scene, camera, on: bool) -> None:
    """Keep viewports looking through the flexible camera, not at the rig's screen; or undo that."""
    for space in _viewports(scene):
        if on and not space.use_local_camera:
            space.use_local_camera = True
            space.camera = camera
        elif not on and space.use_local_camera and space.camera == camera:
            space.use_local_camera = False


def _viewports(scene) -> Iterator:
    """The spaces of the 3D viewports that show a scene."""
    for window in bpy.context.window_manager.windows if bpy.context.window_manager else ():
        if window.scene == scene:
            yield from (area.spaces.active for area in window.screen.areas if area.type == "VIEW_3D")


def sync(scene, depsgraph, may_remove: bool = True) -> None:
    """Bring a scene's rig in step with its volume; remove rigs that have lost their camera or a part.

    may_remove: False while Blender goes to another frame or another scene, where removal would crash.
    """
    if _writing:
        return
    for rig in rigs():
        if rig.scfpf_rig.passing:
            continue
        if may_remove:
            adopt(rig)
        if not is_whole(rig):
            # Undo brings both back.
            if may_remove:
                switch_off(rig)
        elif rig.scfpf_rig.scene == scene:
            shows_others = _may_show_others(depsgraph) or rig.session_uid in _unnoted
            _follow(rig, depsgraph, shows_others or may_move_smoke(depsgraph), may_remove)
            watch(rig, depsgraph, has_new_frame=not may_remove)
            if shows_others:
                _note_materials(rig)
            if may_remove and may_change_smoke(depsgraph, shows_others) and not has_removed():
                _note_changing_smoke(rig, depsgraph)
    if may_remove:
        hidden_surfaces.hide_surfaces(bool(rigs()))


def _may_show_others(depsgraph) -> bool:
    """Return whether an update may bring other materials into sight: objects that only move do not."""
    if any(depsgraph.id_type_updated(kind) for kind in ("MATERIAL", "NODETREE", "LIGHT", "WORLD")):
        return True
    if depsgraph.id_type_updated("COLLECTION"):
        return True
    return any(each.is_updated_geometry and each.id.id_type == "OBJECT" for each in depsgraph.updates)


def _follow(rig, depsgraph, smoke_may_differ: bool, is_edited: bool) -> None:
    """Bring a rig in step with an update.

    smoke_may_differ: whether the update may have changed the smoke. is_edited: False for another frame.
    """
    settings = rig.scfpf_rig
    seen = _seen.get(rig.session_uid)
    try:
        require_cycles(settings.scene)
        if not is_made(settings.table):  # the camera had too few surfaces after undo
            update_nodes(rig)
        projection, now = look(settings.camera, settings.scene, depsgraph)
        if seen == now and not settings.problem:
            if smoke_may_differ:
                _note_smoke(rig, projection)
            return
        stop_skipping(rig)
        structure_changed = (seen is not None and seen[0] != now[0]) or has_old_nodes(rig)
        if structure_changed:
            update_nodes(rig)
        # An animated volume is the camera's own view if it is at all frames.
        follow_view(rig, now[-1] and (settings.is_own_view or not settings.animated))
        problem = _fit_chords(rig, projection, structure_changed)
        _note_smoke(rig, projection)
        _note_materials(rig)
        if is_edited and settings.smoke_known:
            # The plan has followed it from another volume.
            _note_values(settings, smoke_unknown=settings.smoke_known.split(NAMES_END)[0])
        _seen[rig.session_uid] = now
    except UserError as error:
        problem = translated_report(error)
    _note_values(settings, problem=problem)


def _fit_chords(rig, projection: Projection, structure_changed: bool) -> str:
    """Give a rig enough chords for a volume, and not far too many; return the problem if that fails."""
    settings = rig.scfpf_rig
    chords = chords_of(settings.camera, settings.scene, [projection])
    _note_flat(rig, projection, chords)
    breaks, shifts = present_chords(rig)
    size = image_size(settings.scene)
    error = chord_error(projection, size, breaks, shifts)
    fine = error <= max(settings.camera.scfpf.pixel_error, SMALLEST_ERROR)
    fine = fine and all(has >= wants for has, wants in zip(settings.cells, chords.cells, strict=True))
    if settings.animated and not structure_changed:
        # Its screen is for all frames, as its chords are.
        return "" if fine or chords.count >= MOST_CHORDS else STALE
    if structure_changed or not fine or chords.count < ENOUGH * settings.chords:
        settings.animated = False
        write_sheets(rig, chords)
    else:
        fit_screen(rig, chords, SAME_SCREEN)
    return ""


def _note(rig, depsgraph, chords: ChordPlan) -> None:
    projection, now = look(rig.scfpf_rig.camera, rig.scfpf_rig.scene, depsgraph)
    _seen[rig.session_uid] = now
    _note_flat(rig, projection, chords)
    _note_smoke(rig, projection)
    _note_materials(rig)


def _note_smoke(rig, projection: Projection) -> None:
    """Note whether rays begin inside the volume of an object, if that is safe."""
    if has_removed():
        _unnoted.add(rig.session_uid)
        return
    _note_values(rig.scfpf_rig, smoke=smoke_around(rig.scfpf_rig.scene, projection))


def _note_changing_smoke(rig, depsgraph) -> None:
    """Note smoke that changes with the frame, unless the plan has followed it as it is."""
    settings = rig.scfpf_rig
    names = changing_smoke(settings.scene, settings.animated)
    known = [] if depsgraph.id_type_updated("ACTION") else settings.smoke_known.split(NAMES_END)
    unknown = next((name for name in names if name not in known), "")
    _note_values(settings, smoke_unknown=settings.smoke_unknown or unknown if names else "")


def _note_materials(rig) -> None:
    """Note the materials that the rig disturbs, and drawings that it does not show, if that is safe."""
    if has_removed():
        _unnoted.add(rig.session_uid)
        return
    _unnoted.discard(rig.session_uid)
    found = {
        "raycast": disturbed_materials.raycasting(rig),
        "asks_camera": disturbed_materials.asking_camera(rig),
        "wires": disturbed_materials.measuring_wires(rig),
        "levels": disturbed_materials.reading_images(rig),
        "strokes": seen_data.strokes(rig.scfpf_rig.scene),
    }
    _note_values(rig.scfpf_rig, **found)


def _note_values(settings, **values) -> None:
    """Set properties that differ: setting one tells the depsgraph, and handlers, of a change."""
    for name, value in values.items():
        if getattr(settings, name) != value:
            setattr(settings, name, value)


def _note_flat(rig, projection: Projection, chords: ChordPlan) -> None:
    """Note whether a sheet is a line or a point, which rays miss."""
    x, y = (a.ravel() for a in np.meshgrid(*(np.linspace(0.0, 1.0, SAMPLED),) * 2))
    x, y = image_places(x, y, chords.disc, projection.aspect)
    points = projection.projectors(x, y).points
    weights, _ = projection.volume.spans.weights(chords.breaks)
    layers = np.einsum("kn,kcs->ncs", weights, points)
    layers = layers.reshape(*layers.shape[:2], SAMPLED, SAMPLED)
    _note_values(rig.scfpf_rig, flat=has_no_area(layers))


def scene_updated(scene, depsgraph) -> None:
    """Keep the scene's rigs consistent after an evaluation."""
    if depsgraph.mode == "VIEWPORT" and not bpy.app.is_job_running("RENDER"):
        sync(scene, depsgraph)
        versions.settle_view_layers()


def frame_changed(scene, depsgraph) -> None:
    """Keep the scene's rigs consistent at another frame."""
    if depsgraph.mode == "VIEWPORT" and not bpy.app.is_job_running("RENDER"):
        sync(scene, depsgraph, may_remove=False)
        versions.settle_view_layers()


def release_for_history() -> None:
    """Clear the pointers that handlers have set, before undo and redo."""
    _released.clear()
    for rig in rigs():
        _released[rig.session_uid] = release_pointers(rig)


def restore_after_history() -> None:
    """Set the pointers again after undo and redo."""
    _seen.clear()
    forget_all()
    for rig in rigs():
        restore_pointers(rig, _released.get(rig.session_uid, 0))
        _renew_table(rig)
    _released.clear()
    hidden_surfaces.forget()


def _renew_table(rig) -> None:
    """Set the pointers of a rig's table again after undo or redo, even if its scene is not evaluated."""
    if is_whole(rig) and not is_made(rig.scfpf_rig.table):
        try:
            update_nodes(rig)
        except UserError as error:
            rig.scfpf_rig.problem = translated_report(error)


def file_loaded() -> None:
    """Prepare the rigs of a file that Blender has loaded."""
    _seen.clear()
    forget_all()
    for rig in rigs():
        mark_camera(rig)
        # The file, or one that it links, may have been changed without the add-on.
        if is_whole(rig):
            stop_skipping(rig)
    hidden_surfaces.forget()
    prices.forget()


def render_begins(_scene) -> None:
    """Hide the surfaces from a render in the background."""
    # A script may add a surface and render before anything was evaluated. In a window the render is a job;
    # the scene was evaluated before it.
    if not bpy.app.is_job_running("RENDER"):
        _hide_surfaces()


def frame_begins(scene) -> None:
    """Look for empty chords at each frame: in the background the scene is at it only when it is rendered."""
    if bpy.app.is_job_running("RENDER"):
        return
    for rig in rigs():
        is_seen = scene.render.engine == CYCLES and scene.camera == rig.scfpf_rig.view_camera
        if is_seen and rig.scfpf_rig.scene == scene == bpy.context.scene:
            prepare_render(bpy.context, rig, apart=True)
    versions.settle_view_layers()


def register():
    hidden_surfaces.forget()
