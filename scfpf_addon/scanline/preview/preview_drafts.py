# SPDX-License-Identifier: GPL-3.0-or-later
"""Drafts of nodes previews: quick and rough while things move, whole when they have been still for a moment.

A handler before the evaluation switches the parts to drafts that show an edited object. A timer switches
them back. Blender tells beforehand which datablocks an edit has tagged, and afterwards which pictures it has
changed. What reaches a picture through drivers or constraints is learnt at its first edit. Node groups draw
no draft in renders, and files are saved without drafts.
"""

from __future__ import annotations

from collections.abc import Iterable, Iterator
from dataclasses import dataclass, field
from time import monotonic

import bpy

from ...bridge.volume.camera_members import surfaces_of
from .preview_data import is_asleep, pictures_of, previews, set_draft

# Seconds without a change until pictures become whole.
WAIT = 0.3
# The number that stands for all parts of a preview.
EVERY = -1
# An edit that tags more datablocks tells nothing about any of them.
MOST_LEARNT = 8
# Kinds of datablocks whose edits are no moves.
NO_MOVES = {"Scene", "Collection", "Material", "World", "Image", "Texture"}

# A datablock: its kind and its name. Evaluated copies have no session id.
_Key = tuple[str, str]


@dataclass
class _Watched:
    """The datablocks on which a preview depends; no Blender data.

    shown: the part of each, or EVERY. learnt: the same of those that an evaluation has told of. tagged: those
    of the present edit. animated: the parts that the last change of frame has altered.
    """

    shown: dict[_Key, int] | None = None
    learnt: dict[_Key, int] = field(default_factory=dict)
    tagged: set[_Key] = field(default_factory=set)
    animated: set[int] = field(default_factory=set)


class _Clock:
    """The time of the last change, in seconds."""

    last = 0.0


# By session id of the preview's source.
_watched: dict[int, _Watched] = {}


def is_live() -> bool:
    """Return whether somebody can watch drafts: not in the background, and not while a render reads."""
    return not bpy.app.background and not bpy.app.is_job_running("RENDER")


def forget(source=None) -> None:
    """Forget what a preview depends on, or all previews, after edits of the scene's structure."""
    if source is None:
        _watched.clear()
    elif source.session_uid in _watched:
        _watched[source.session_uid].shown = None


def begin(source, parts: Iterable[int] = (EVERY,)) -> None:
    """Switch parts of a preview to drafts until nothing has changed for a moment."""
    if not is_live():
        return
    set_draft(source, _numbers(source, parts), True)
    _Clock.last = monotonic()
    if not bpy.app.timers.is_registered(_tick):
        bpy.app.timers.register(_tick, first_interval=WAIT)


def finish() -> None:
    """Make all pictures whole."""
    for source in previews():
        set_draft(source, range(len(source.scfpf_preview.parts)), False)


def stop() -> None:
    """Forget everything, when the add-on is switched off."""
    _watched.clear()
    if bpy.app.timers.is_registered(_tick):
        bpy.app.timers.unregister(_tick)


def before_evaluation(scene) -> None:
    """Switch the parts to drafts that show what is about to be evaluated."""
    if not is_live():
        return
    generated = _generated()
    for source, view_layer in _awake(scene):
        watched = _watched.setdefault(source.session_uid, _Watched())
        depsgraph = view_layer.depsgraph
        moved = set(_moved(depsgraph.updates)) if depsgraph is not None else set()
        watched.tagged = moved - generated
        if not watched.tagged:
            continue
        if watched.shown is None:
            watched.shown = _shown(source)
        known = watched.learnt | watched.shown
        if parts := {known[key] for key in watched.tagged if key in known}:
            begin(source, parts)


def after_evaluation(scene, depsgraph) -> None:
    """Learn which edits reach the pictures; count the time of an evaluation as a part of the move."""
    if not is_live():
        return
    for source, _ in _awake(scene):
        watched = _watched.setdefault(source.session_uid, _Watched())
        tagged, watched.tagged = watched.tagged, set()
        if not tagged:
            continue
        changed = _changed_parts(source, depsgraph)
        known = watched.learnt | (watched.shown or {})
        if tagged.isdisjoint(known):
            if changed and len(tagged) <= MOST_LEARNT:
                part = next(iter(changed)) if len(changed) == 1 else EVERY
                watched.learnt |= dict.fromkeys(tagged, part)
        elif changed:
            _Clock.last = monotonic()


def before_frame(scene) -> None:
    """Switch animated parts to drafts while an animation plays or the artist looks for a frame."""
    if is_live() and _plays():
        for source, _ in _awake(scene):
            watched = _watched.get(source.session_uid)
            if watched is not None and watched.animated:
                begin(source, watched.animated)


def after_frame(scene, depsgraph) -> None:
    """Learn which parts are animated."""
    if is_live():
        for source, _ in _awake(scene):
            changed = _changed_parts(source, depsgraph)
            _watched.setdefault(source.session_uid, _Watched()).animated |= changed
            if changed:
                _Clock.last = monotonic()


def _tick() -> float | None:
    left = _Clock.last + WAIT - monotonic()
    if left > 0.0:
        return left
    if _plays() or not is_live():
        return WAIT
    finish()
    return None


def _plays() -> bool:
    screens = [window.screen for window in bpy.context.window_manager.windows]
    return any(screen.is_animation_playing or screen.is_scrubbing for screen in screens)


def _awake(scene) -> Iterator[tuple]:
    """The previews of a scene that a viewport shows, each with its view layer."""
    for source in previews():
        settings = source.scfpf_preview
        if settings.scene == scene and None not in pictures_of(source) and not is_asleep(source):
            view_layer = scene.view_layers.get(settings.view_layer)
            if view_layer is not None:
                yield source, view_layer


def _numbers(source, parts: Iterable[int]) -> list[int]:
    wanted, count = set(parts), len(source.scfpf_preview.parts)
    return [number for number in range(count) if EVERY in wanted or number in wanted]


def _generated() -> set[_Key]:
    """The datablocks that previews have made, which the timer tags itself."""
    found: list = []
    for source in previews():
        settings = source.scfpf_preview
        found += [*pictures_of(source), settings.table, settings.view_camera]
    return {_key(one) for thing in found if thing is not None for one in (thing, thing.data)}


def _moved(updates) -> Iterator[_Key]:
    """The datablocks that may have moved or changed their shape. A camera's settings raise no flag."""
    for update in updates:
        key = _key(update.id)
        is_camera = key[0] == "Object" and update.id.type == "CAMERA"
        moved = update.is_updated_geometry or update.is_updated_transform or is_camera
        if moved and key[0] not in NO_MOVES:
            yield key


def _changed_parts(source, depsgraph) -> set[int]:
    """The numbers of the parts whose pictures an evaluation has made anew."""
    names = {picture.name: number for number, picture in enumerate(pictures_of(source))}
    return {
        names[update.id.name]
        for update in depsgraph.updates
        if update.is_updated_geometry and isinstance(update.id, bpy.types.Object) and update.id.name in names
    }


def _key(datablock) -> _Key:
    return datablock.bl_rna.identifier, datablock.name


def _shown(source) -> dict[_Key, int]:
    """The part of each datablock that a preview shows; EVERY for those of the volume."""
    settings = source.scfpf_preview
    result: dict[_Key, int] = {}
    for number, part in enumerate(settings.parts):
        for member in part.members.objects:
            _take(member, number, result)
    camera = settings.camera
    for thing in (camera, camera.scfpf.volume_object, *surfaces_of(camera)):
        if thing is not None:
            _take(thing, EVERY, result)
    return result


def _take(thing, part: int, result: dict[_Key, int]) -> None:
    """Note an object, its data, its parents and the objects that it instances."""
    keys = [thing, thing.data, getattr(thing.data, "shape_keys", None)]
    if thing.instance_type == "COLLECTION" and thing.instance_collection is not None:
        keys += thing.instance_collection.all_objects
    parent = thing.parent
    while parent is not None:
        keys.append(parent)
        parent = parent.parent
    for key in (_key(one) for one in keys if one is not None):
        result[key] = part if result.get(key, part) == part else EVERY
