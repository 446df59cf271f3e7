# SPDX-License-Identifier: GPL-3.0-or-later
"""Skipping kept true: found when a rig is made or rendered, off as soon as the scene or the volume changes.

Switching it off is a setting of the rig's nodes, which then make whole sheets. The next render through the
add-on's operator, or in the background, looks for empty chords again.
"""

from __future__ import annotations

from ...bridge.blender import versions
from ...bridge.blender.modifier_inputs import input_identifiers, set_inputs
from ...projection.mappings.stack import is_disc
from ..chord_planning import look
from ..chords.chord_plan import ChordPlan
from ..rig_data import MODIFIER, has_new_materials, present_chords, write_sheets
from .reasons import obstacle
from .scene_state import has_unwatched, shape_edits, state_of
from .skip_chords import NotSkipping, faces_that_skip

CHANGED = "The scene has changed since empty chords were found"
# The custom property of the rig's sheets that says what they were made for.
TEXT_KEY = "scfpf_skips"
MADE_FOR = (
    "Rays skip the chords of '{camera}' in which '{scene}' showed nothing at frame {frame}. After a change "
    "of the scene or the volume render with the add-on SCFPF, or switch off Skip in the modifier"
)
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

# The state of the scene that each rig skips for, by session id of the rig.
_made_for: dict[int, tuple] = {}


def forget_all() -> None:
    """Forget what rigs were made for, so that the next look switches skipping off."""
    _made_for.clear()


def write_skipping(rig, chords: ChordPlan) -> None:
    """Write a plan's sheets, whose rays skip what is certainly empty. Raises RigError without Cycles."""
    settings = rig.scfpf_rig
    faces, reason = None, ""
    try:
        if not has_new_materials(rig):
            raise NotSkipping("Another version of the add-on has made the rig: press Update Chords")
        faces = faces_that_skip(rig, chords)
    except NotSkipping as error:
        reason = str(error)
    write_sheets(rig, chords, faces)
    _note_reason(settings, reason)
    if faces is None:
        _made_for.pop(rig.session_uid, None)
        settings.portals.pop(TEXT_KEY, None)
        return
    _made_for[rig.session_uid] = state_of(rig)
    scene = settings.scene
    settings.portals[TEXT_KEY] = MADE_FOR.format(
        camera=settings.camera.name, scene=scene.name, frame=scene.frame_current
    )


def skips(rig) -> bool:
    """Whether rays of a rig skip chords."""
    modifier = rig.scfpf_rig.portals.modifiers[MODIFIER]
    if modifier.node_group is None:
        return False
    identifier = input_identifiers(modifier.node_group).get("Skip")
    return identifier is not None and bool(versions.modifier_input(modifier, identifier))


def stop_skipping(rig, reason: str = CHANGED) -> None:
    """Let rays travel all chords."""
    _made_for.pop(rig.session_uid, None)
    if skips(rig):
        set_inputs(rig.scfpf_rig.portals.modifiers[MODIFIER], {"Skip": False})
        rig.scfpf_rig.passed = 0.0
        rig.scfpf_rig.portals.update_tag()
        _note_reason(rig.scfpf_rig, reason)


def watch(rig, depsgraph) -> None:
    """Stop skipping if the scene has changed."""
    if not skips(rig):
        return
    made_for = _made_for.get(rig.session_uid)
    if made_for is None or shape_edits(depsgraph):
        stop_skipping(rig)
        return
    has_edits = any(depsgraph.id_type_updated(kind) for kind in WATCHED)
    if has_edits and state_of(rig) != made_for:
        stop_skipping(rig)


def renew(rig, view_layer) -> None:
    """Find empty chords again if the scene has changed, or may have. The view layer is evaluated."""
    settings = rig.scfpf_rig
    if reason := obstacle(rig):
        stop_skipping(rig)
        _note_reason(settings, reason)
        return
    known = _made_for.get(rig.session_uid)
    if known is not None and known == state_of(rig) and not has_unwatched(settings.scene, view_layer):
        return
    projection, _ = look(settings.camera, settings.scene, view_layer.depsgraph)
    plan = ChordPlan(
        *present_chords(rig),
        cells=(settings.cells[0], settings.cells[1]),
        error=settings.error,
        missing=settings.missing,
        disc=is_disc(projection.reparameterisation, projection.aspect),
    )
    write_skipping(rig, plan)


def _note_reason(settings, reason: str) -> None:
    if settings.travels_all != reason:
        settings.travels_all = reason
