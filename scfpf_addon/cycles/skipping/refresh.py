# SPDX-License-Identifier: GPL-3.0-or-later
"""Skipping kept true, by a rule of two sentences.

Rays skip the chords that were empty when the rig was made or last rendered, at the frames that were looked
at. An update that changes what a ray may meet makes whole sheets, until the next render.

The first sentence holds in every Blender: the sheets have a setting of their nodes, with a driver if anything
moves. The second one holds with the add-on: ``scene_state`` compares only what an update names, and the next
render through its operator, or in the background, looks for empty chords again.
"""

from __future__ import annotations

import bpy

from ...bridge.blender.drivers import add_scene_property, new_driver
from ...bridge.blender.modifier_inputs import input_property, set_inputs
from ...projection.mappings.stack import is_disc
from ..chords.chord_plan import ChordPlan
from ..rig_data import MODIFIER, has_new_materials, present_chords, write_sheets
from ..watched_volume import look
from .reasons import movers_of, moves, obstacle
from .scene_state import SceneState, has_unwatched, is_as, shape_edits, state_of
from .skip_chords import EmptySpaceQuery, NotSkipping, faces_that_skip
from .swept_bodies import shutter_of

CHANGED = "The scene or the frame has changed since empty chords were found"
# The custom property of the rig's sheets that says what they were made for.
TEXT_KEY = "scfpf_skips"
MADE_FOR = (
    "Rays skip the chords of '{camera}' in which '{scene}' with its {objects} objects shows nothing at "
    "{when}, found by Blender {version}. {others}After a change of the scene or the volume "
    "render with the add-on Flexible Projection, or switch off Skip in the modifier"
)
OTHER_FRAMES = "At other frames, and with other motion blur, they travel all chords. "
# Seconds that a rig that is made may take for the frames of a scene, and a render of an animation.
PATIENCE, PATIENCE_OF_ANIMATION = 5.0, 60.0
# Frames that differ by less are one.
ONE_FRAME = 1e-3
# Edits of these may change what rays meet.
WATCHED = (
    "OBJECT",
    "COLLECTION",
    "SCENE",
    "WORLD",
    "LIGHT",
    "MATERIAL",
    "NODETREE",
    "ACTION",
    "MESH",
    "CURVE",
)

# The states of the scene that each rig skips for by frame, None for all, by session id of the rig.
_made_for: dict[int, dict[float | None, SceneState]] = {}
# Whether renders show objects that no update tells of, by session id of the rig.
_unwatched: dict[int, bool] = {}


def forget_all() -> None:
    """Forget what rigs were made for, so that the next look switches skipping off."""
    _made_for.clear()
    _unwatched.clear()


def write_skipping(rig, chords: ChordPlan, animation: bool = False) -> None:
    """Write a plan's sheets, whose rays skip what is certainly empty.

    In a scene that moves, chords are skipped that are empty at all of its frames. If looking at all frames
    takes too long, or for a rig of one render, those count that are empty at the present frame. If the volume
    moves, all frames are looked at only for an animation that is to be rendered. Passes need a look at one
    frame, because the mesh adds the lengths of chords to them. Raises UserError
    without Cycles.
    """
    settings, frames = rig.scfpf_rig, present_frames(rig)
    if frames and not settings.passing and (not moves(rig) or (animation and not settings.passes)):
        ends = settings.scene.frame_start, settings.scene.frame_end
        every = tuple(float(frame) for frame in range(ends[0], ends[1] + 1))
        if _write(rig, chords, EmptySpaceQuery(every, PATIENCE_OF_ANIMATION if animation else PATIENCE)):
            return
    _write(rig, chords, EmptySpaceQuery(frames))


def present_frames(rig) -> tuple[float, ...]:
    """The present frame of a rig's scene, or nothing if neither the scene nor the volume moves."""
    return (rig.scfpf_rig.scene.frame_current_final,) if moves(rig) or movers_of(rig) else ()


def _write(rig, chords: ChordPlan, look: EmptySpaceQuery) -> bool:
    """Write sheets for the frames of a look; return whether their rays skip chords."""
    settings = rig.scfpf_rig
    faces, reason = None, ""
    _unguard(rig)
    try:
        if not has_new_materials(rig):
            raise NotSkipping("Another version of the add-on has made the rig: press Update Chords")
        found = faces_that_skip(rig, chords, look)
        faces = found.faces
    except NotSkipping as error:
        reason = str(error)
    write_sheets(rig, chords, faces)
    _note_reason(settings, reason)
    if faces is None:
        _made_for.pop(rig.session_uid, None)
        settings.portals.pop(TEXT_KEY, None)
        return False
    present = state_of(rig)
    states: dict[float | None, SceneState] = {look.frames[0] if look.frames else None: present}
    states |= {frame: present._replace(objects=objects) for frame, objects in found.objects.items()}
    _made_for[rig.session_uid] = states
    if look.frames:
        _guard(rig, look.frames)
    scene, frames = settings.scene, look.frames
    when = "any frame"
    if frames:
        when = f"frame {frames[0]:g}" if len(frames) == 1 else f"frames {frames[0]:g} to {frames[-1]:g}"
    settings.portals[TEXT_KEY] = MADE_FOR.format(
        camera=settings.camera.name,
        scene=scene.name,
        objects=len(scene.objects),
        when=when,
        version=bpy.app.version_string,
        others=OTHER_FRAMES if frames else "",
    )
    return True


def _guard(rig, frames: tuple[float, ...]) -> None:
    """Let the rays of a rig skip chords at these frames only, with the scene's present motion blur.

    A driver does so, with or without the add-on.
    """
    render = rig.scfpf_rig.scene.render
    shutter, modifier = shutter_of(render), rig.scfpf_rig.portals.modifiers[MODIFIER]
    frame = f"(frame - {shutter.centre!r})"
    low, high = frames[0] - ONE_FRAME, frames[-1] + ONE_FRAME
    parts = [f"{frame} > {low!r}", f"{frame} < {high!r}", f"blur == {int(render.use_motion_blur)}"]
    if len(frames) > 1:
        parts.append(f"abs({frame} - round({frame})) < {ONE_FRAME}")
    if render.use_motion_blur:
        parts.append(f"abs(shutter - {render.motion_blur_shutter!r}) < {ONE_FRAME}")
        position = render.bl_rna.properties["motion_blur_position"].enum_items[render.motion_blur_position]
        parts.append(f"place == {position.value}")
    driver = new_driver(*input_property(modifier, "Skip"), " and ".join(parts))
    add_scene_property(driver, "render.use_motion_blur", "blur")
    add_scene_property(driver, "render.motion_blur_shutter", "shutter")
    add_scene_property(driver, "render.motion_blur_position", "place")


def _unguard(rig) -> None:
    """Remove the driver of ``_guard``."""
    owner, name = input_property(rig.scfpf_rig.portals.modifiers[MODIFIER], "Skip")
    owner.driver_remove(name)


def skips(rig) -> bool:
    """Return whether rays of a rig skip chords, if at some frames only."""
    return rig.scfpf_rig.passed > 0.0 and rig.scfpf_rig.portals.modifiers[MODIFIER].node_group is not None


def stop_skipping(rig, reason: str = CHANGED) -> None:
    """Let rays travel all chords."""
    _made_for.pop(rig.session_uid, None)
    if skips(rig):
        _unguard(rig)
        set_inputs(rig.scfpf_rig.portals.modifiers[MODIFIER], {"Skip": False})
        rig.scfpf_rig.passed = 0.0
        rig.scfpf_rig.portals.update_tag()
        _note_reason(rig.scfpf_rig, reason)


def watch(rig, depsgraph, has_new_frame: bool = False) -> None:
    """Stop skipping if the scene has changed, or is at a frame for which no empty chords were found.

    has_new_frame: whether the depsgraph was updated for another frame, at which moving shapes change.
    """
    if not skips(rig):
        return
    made_for = _state_made_for(rig)
    if made_for is None or shape_edits(depsgraph, made_for.movers if has_new_frame else frozenset()):
        stop_skipping(rig)
        return
    if has_new_frame or any(depsgraph.id_type_updated(kind) for kind in WATCHED):
        is_whole_look = _has_unwatched(rig, depsgraph)
        is_same = state_of(rig) == made_for if is_whole_look else is_as(rig, made_for, depsgraph)
        if not is_same:
            stop_skipping(rig)


def _has_unwatched(rig, depsgraph) -> bool:
    """Return ``has_unwatched``, found again once members of the scene or their visibility have changed."""
    uid = rig.session_uid
    if uid not in _unwatched or any(depsgraph.id_type_updated(kind) for kind in ("SCENE", "COLLECTION")):
        _unwatched[uid] = has_unwatched(rig.scfpf_rig.scene, depsgraph.view_layer)
    return _unwatched[uid]


def _state_made_for(rig) -> SceneState | None:
    """The state of the scene at the present frame that a rig skips for, None if it skips nothing there."""
    states = _made_for.get(rig.session_uid, {})
    return states.get(None, states.get(rig.scfpf_rig.scene.frame_current_final))


def renew(rig, view_layer, animation: bool = False, apart: bool = False) -> None:
    """Find empty chords again if the scene has changed, or may have. The view layer is evaluated.

    animation: all frames of the scene are to be rendered, without further notice. apart: Blender is already
    rendering the present one.
    """
    settings = rig.scfpf_rig
    if reason := obstacle(rig):
        stop_skipping(rig)
        _note_reason(settings, reason)
        return
    frames = present_frames(rig)
    known = _state_made_for(rig)
    is_known = known is not None and known == state_of(rig) and not has_unwatched(settings.scene, view_layer)
    is_one = animation and len(_made_for.get(rig.session_uid, {})) == 1
    # Scripts may set a frame and edit things before anything is evaluated.
    if is_known and not (frames and (apart or is_one)):
        return
    projection, _ = look(settings.camera, settings.scene, view_layer.depsgraph)
    plan = ChordPlan(
        *present_chords(rig),
        cells=(settings.cells[0], settings.cells[1]),
        error=settings.error,
        missing=settings.missing,
        disc=is_disc(projection.reparameterisation, projection.aspect),
    )
    if animation:
        write_skipping(rig, plan, animation=True)
    else:
        _write(rig, plan, EmptySpaceQuery(frames, apart=apart))


def _note_reason(settings, reason: str) -> None:
    if settings.travels_all != reason:
        settings.travels_all = reason
