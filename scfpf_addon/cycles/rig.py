# SPDX-License-Identifier: GPL-3.0-or-later
"""The Cycles rig of a flexible camera: switched on, kept in step with the volume, switched off.

Nodes place the sheets, so that they follow surfaces and frames by themselves. Python only says
where chords end and how many there are, and looks again when the volume has changed.
"""

from __future__ import annotations

import bpy
import numpy as np
from bpy.app.handlers import persistent

from ..bridge.blender import versions
from ..bridge.blender.slot_animation import curve_collections
from ..bridge.camera.read_projection import ProjectionError
from ..bridge.render.image_size import image_size
from ..bridge.render.render_errors import RenderError
from ..bridge.sync.handlers import sync as sync_volumes
from ..projection.volume.viewing_volume import Projection
from ..scanline.table.table_object import is_made
from . import aov_passes, disturbed_materials, hidden_surfaces, prices
from .chord_planning import chords_of, look, planned
from .chords.chord_plan import MOST_CHORDS, SMALLEST_ERROR, ChordPlan, PlanError, chord_error
from .engine_choice import ALIKE
from .portals import portal_nodes
from .portals.sheets import crosses_itself, has_no_area, picture_places
from .rig_data import (
    CYCLES,
    NO_CYCLES,
    RigError,
    adopt,
    check_surfaces,
    has_cycles,
    has_old_nodes,
    is_whole,
    make_rig,
    present_chords,
    release_pointers,
    remove_rig,
    renew_materials,
    require_cycles,
    restore_pointers,
    rig_of,
    rigs,
    update_nodes,
    write_sheets,
)
from .smoke import smoke_around

# Places at which a volume is looked at for crossing itself.
CROSSING = 9
# The rig of a volume that stands still is made smaller again when this share of its chords is enough.
ENOUGH = 0.7
# Where F-curves and drivers of image mappings lead.
MAPPINGS_PATH = "scfpf.mappings["
CROSSES = "The volume crosses itself: use Blender 5.0 or later, or render with SCFPF"
NO_AREA = "Projectors meet in a line, and what is behind it shows too: widen that control surface"
STALE = "The animated volume has changed: press Update Chords"

# What was seen at the last look, by session_uid of the rig: numbers and bytes only.
_seen: dict[int, tuple] = {}
# The tables that rigs were relieved of, while Blender goes to another step of undo: session ids by rig.
_released: dict[int, int] = {}


def switch_on(context, camera, plan: tuple[ChordPlan, bool] | None = None):
    """Make the rig of a camera in the context's scene; returns its collection.

    A rig that the scene has of another camera goes. plan: of ``Planning``, made here if not given.
    Raises RigError, or what the projection's reader raises; nothing is left behind then.
    """
    scene = context.scene
    chords, animated = planned(context, camera) if plan is None else plan
    present = rig_of(scene)
    if present is not None:
        switch_off(present)
    rig = make_rig(scene, camera, chords)
    rig.scfpf_rig.animated = animated
    _hide_surfaces()
    _look_through(scene, camera, True)
    _note(rig, context.evaluated_depsgraph_get(), chords)
    return rig


def update(context, rig, plan: tuple[ChordPlan, bool] | None = None) -> None:
    """Plan a rig anew, for all frames. Takes and raises as switch_on; the rig stays then."""
    chords, animated = planned(context, rig.scfpf_rig.camera) if plan is None else plan
    update_nodes(rig)
    renew_materials(rig)
    rig.scfpf_rig.animated = animated
    rig.scfpf_rig.problem = ""
    write_sheets(rig, chords)
    _note(rig, context.evaluated_depsgraph_get(), chords)


def set_passes(rig, on: bool) -> None:
    """Let a rig's scene have passes of t, depth, u and v, or no longer. Raises RigError."""
    if on and rig.scfpf_rig.scene.render.engine != CYCLES:
        raise RigError("Choose Cycles as the render engine: only it has these passes")
    check_surfaces(rig.scfpf_rig.camera)
    rig.scfpf_rig.passes = on
    (aov_passes.add if on else aov_passes.remove)(rig.scfpf_rig.scene)
    update_nodes(rig)


def switch_off(rig) -> None:
    """Remove a rig and all that was made for it."""
    settings = rig.scfpf_rig
    if settings.scene is not None and settings.camera is not None:
        _look_through(settings.scene, settings.camera, False)
    _seen.pop(rig.session_uid, None)
    remove_rig(rig)
    # The rig's camera may have been made flexible.
    sync_volumes()
    _hide_surfaces()


def _hide_surfaces() -> None:
    """Hide all control surfaces from rays if there is a rig, whatever the last look at the file found."""
    hidden_surfaces.forget()
    hidden_surfaces.hide_surfaces(bool(rigs()))


def _look_through(scene, camera, on: bool) -> None:
    """Viewports keep looking through the flexible camera, not at the rig's screen."""
    for window in bpy.context.window_manager.windows if bpy.context.window_manager else ():
        if window.scene != scene:
            continue
        for area in window.screen.areas:
            if area.type != "VIEW_3D":
                continue
            space = area.spaces.active
            if on and not space.use_local_camera:
                space.use_local_camera = True
                space.camera = camera
            elif not on and space.use_local_camera and space.camera == camera:
                space.use_local_camera = False


def cautions(scene, view_layer, rig) -> list[str]:
    """What keeps the rig's picture from being right, in a few words each."""
    if not has_cycles(scene):
        return [NO_CYCLES]
    settings, cycles = rig.scfpf_rig, scene.cycles
    found = []
    if settings.problem:
        found.append(settings.problem)
    if scene.render.engine != CYCLES:
        found.append("The rig works only in Cycles: choose it as the Render Engine")
    if scene.camera != settings.view_camera:
        found.append("The scene has another camera: make the rig's the scene camera again")
    if scene.render.use_multiview:
        found.append(ALIKE)
    if view_layer.material_override is not None:
        found.append("The material override stops the rays: clear it in View Layer Properties")
    if cycles.transparent_max_bounces < settings.chords + 2:
        found.append(f"Too few transparent bounces: raise Light Paths > Transparent to {settings.chords + 2}")
    if scene.render.use_simplify and (cycles.use_camera_cull or cycles.use_distance_cull):
        found.append("Culling would leave all objects out: switch it off in Simplify > Culling")
    if settings.camera.data.dof.use_dof and settings.chords > 1:
        found.append("No depth of field, as the projectors are bent: switch it off, or make them straight")
    if settings.smoke:
        found.append(
            f"The near surface is in the smoke of '{settings.smoke}', which Cycles misses: move it out"
        )
    if settings.raycast:
        found.append(f"The Raycast node of '{settings.raycast}' meets the rig's sheets: switch on Only Local")
    if settings.asks_camera:
        found.append(
            f"The material '{settings.asks_camera}' uses the camera or the ray, and gets the rig's: "
            "replace those nodes"
        )
    if settings.crosses:
        gated = portal_nodes.can_gate()
        found.append(
            "The volume folds, and rays turn too early there: pull the control surfaces apart"
            if gated
            else CROSSES
        )
    if settings.flat:
        found.append(NO_AREA)
    if settings.error > max(settings.camera.scfpf.pixel_error, SMALLEST_ERROR):
        found.append(f"Off by up to {settings.error:.2g} px, the best possible: bend the volume less")
    if settings.missing > 0.0:
        found.append("Empty parts of the image are filled in: render with SCFPF to keep them empty")
    found += [
        f"Cycles shows the control surface '{name}': make it local, or remove its Ray Visibility drivers"
        for name in hidden_surfaces.seen_surfaces(scene)
    ]
    if _mappings_move(settings.camera):
        found.append("Image mappings stand still in an animation by Cycles: render it with SCFPF")
    return found


def _mappings_move(camera) -> bool:
    """Whether an F-curve or a driver acts on an image mapping: their places are worked out beforehand."""
    if not any(mapping.enabled for mapping in camera.scfpf.mappings):
        return False
    return any(curve.data_path.startswith(MAPPINGS_PATH) for c in curve_collections(camera) for curve in c)


def sync(scene, depsgraph, may_remove: bool = True) -> None:
    """Bring a scene's rig in step with its volume; remove rigs that have lost their camera or a part.

    may_remove: not while Blender goes from frame to frame or to another scene, where it would crash.
    """
    for rig in rigs():
        if may_remove:
            adopt(rig)
        if not is_whole(rig):
            # Undo brings both back.
            if may_remove:
                switch_off(rig)
        elif rig.scfpf_rig.scene == scene:
            _follow(rig, depsgraph)
            if depsgraph.id_type_updated("MATERIAL") or depsgraph.id_type_updated("NODETREE"):
                _note_materials(rig)
    if may_remove:
        hidden_surfaces.hide_surfaces(bool(rigs()))


def _follow(rig, depsgraph) -> None:
    settings = rig.scfpf_rig
    seen = _seen.get(rig.session_uid)
    try:
        require_cycles(settings.scene)
        if not is_made(settings.table):  # the camera had too few surfaces after a step of undo
            update_nodes(rig)
        projection, now = look(settings.camera, settings.scene, depsgraph)
        if seen == now and not settings.problem:
            return
        structure_changed = (seen is not None and seen[0] != now[0]) or has_old_nodes(rig)
        if structure_changed:
            update_nodes(rig)
        problem = _settle(rig, projection, structure_changed)
        _note_smoke(rig, depsgraph, projection)
        _note_materials(rig)
        _seen[rig.session_uid] = now
    except (ProjectionError, PlanError, RenderError, RigError) as error:
        problem = str(error)
    if settings.problem != problem:
        settings.problem = problem


def _settle(rig, projection: Projection, structure_changed: bool) -> str:
    """Make the chords of a rig enough for a volume, and not far too many; returns what cannot be done."""
    settings = rig.scfpf_rig
    chords = chords_of(settings.camera, settings.scene, [projection])
    _note_crossing(rig, projection, chords)
    breaks, shifts = present_chords(rig)
    size = image_size(settings.scene)
    error = chord_error(projection, size, breaks, shifts)
    fine = error <= max(settings.camera.scfpf.pixel_error, SMALLEST_ERROR)
    fine = fine and all(has >= wants for has, wants in zip(settings.cells, chords.cells, strict=True))
    if settings.animated and not structure_changed:
        return "" if fine or chords.count >= MOST_CHORDS else STALE
    if structure_changed or not fine or chords.count < ENOUGH * settings.chords:
        settings.animated = False
        write_sheets(rig, chords)
    return ""


def _note(rig, depsgraph, chords: ChordPlan) -> None:
    projection, now = look(rig.scfpf_rig.camera, rig.scfpf_rig.scene, depsgraph)
    _seen[rig.session_uid] = now
    _note_crossing(rig, projection, chords)
    _note_smoke(rig, depsgraph, projection)
    _note_materials(rig)


def _note_smoke(rig, depsgraph, projection: Projection) -> None:
    """Note whether rays begin inside of something that is a volume."""
    smoke = smoke_around(depsgraph, projection)
    if rig.scfpf_rig.smoke != smoke:
        rig.scfpf_rig.smoke = smoke


def _note_materials(rig) -> None:
    """Note the materials that look otherwise through the rig."""
    settings = rig.scfpf_rig
    for name, find in (
        ("raycast", disturbed_materials.raycasting),
        ("asks_camera", disturbed_materials.asking_camera),
    ):
        found = find(rig)
        if getattr(settings, name) != found:
            setattr(settings, name, found)


def _note_crossing(rig, projection: Projection, chords: ChordPlan) -> None:
    """Note whether rays would be turned by sheets that are not theirs."""
    x, y = (a.ravel() for a in np.meshgrid(*(np.linspace(0.0, 1.0, CROSSING),) * 2))
    x, y = picture_places(x, y, chords.disc, projection.aspect)
    points = projection.projectors(x, y).points
    weights, _ = projection.volume.spans.weights(chords.breaks)
    layers = np.einsum("kn,kcs->ncs", weights, points)
    layers = layers.reshape(*layers.shape[:2], CROSSING, CROSSING)
    flat = has_no_area(layers)
    crosses = not flat and crosses_itself(layers, portal_nodes.can_gate())
    if rig.scfpf_rig.flat != flat:
        rig.scfpf_rig.flat = flat
    if rig.scfpf_rig.crosses != crosses:
        rig.scfpf_rig.crosses = crosses


@persistent
def _scene_updated(scene, depsgraph) -> None:
    prices.changed()
    if depsgraph.mode == "VIEWPORT" and not bpy.app.is_job_running("RENDER"):
        sync(scene, depsgraph)
        versions.settle_view_layers()


@persistent
def _frame_changed(scene, depsgraph) -> None:
    prices.changed()
    if depsgraph.mode == "VIEWPORT" and not bpy.app.is_job_running("RENDER"):
        sync(scene, depsgraph, may_remove=False)
        versions.settle_view_layers()


@persistent
def _history_changes(*_) -> None:
    _released.clear()
    for rig in rigs():
        _released[rig.session_uid] = release_pointers(rig)


@persistent
def _history_changed(*_) -> None:
    _seen.clear()
    for rig in rigs():
        restore_pointers(rig, _released.get(rig.session_uid, 0))
        _renew_table(rig)
    _released.clear()
    hidden_surfaces.forget()
    prices.changed()


def _renew_table(rig) -> None:
    """Make again what ``release_pointers`` took from a rig's table, in scenes that nothing evaluates too."""
    if is_whole(rig) and not is_made(rig.scfpf_rig.table):
        try:
            update_nodes(rig)
        except RigError as error:
            rig.scfpf_rig.problem = str(error)


@persistent
def _file_loaded(*_) -> None:
    _seen.clear()
    hidden_surfaces.forget()
    prices.forget()


@persistent
def _render_begins(*_) -> None:
    # A script may make a surface and render before anything was evaluated. In a window the render is a job,
    # and what precedes it was evaluated.
    if not bpy.app.is_job_running("RENDER"):
        _hide_surfaces()


HANDLERS = {
    "depsgraph_update_post": _scene_updated,
    "frame_change_post": _frame_changed,
    "undo_pre": _history_changes,
    "redo_pre": _history_changes,
    "undo_post": _history_changed,
    "redo_post": _history_changed,
    "load_post": _file_loaded,
    "render_init": _render_begins,
}


def register():
    hidden_surfaces.forget()
    for name, function in HANDLERS.items():
        getattr(bpy.app.handlers, name).append(function)


def unregister():
    prices.unregister()
    for name, function in HANDLERS.items():
        getattr(bpy.app.handlers, name).remove(function)
