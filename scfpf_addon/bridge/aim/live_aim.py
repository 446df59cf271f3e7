# SPDX-License-Identifier: GPL-3.0-or-later
"""Live Aim: the volume takes a warm step whenever an eye, a handle or a target of its camera has moved.

When nothing has moved for a while, a thread solves anew from the start and judges; the next move cancels it.
The handler writes control points of volumes that are solutions already: it links and removes nothing. Undo
restores points with everything else, so the handler forgets its drags then and waits for the next move.
"""

from __future__ import annotations

from contextlib import contextmanager
from time import monotonic

import bpy
import numpy as np

from ...projection.user_error import Message
from ..blender.scene_objects import object_by_uid
from ..blender.user_errors import USER_ERRORS, translated_report
from ..camera.flexible_camera import control_objects
from ..sync.camera_sync import camera_objects
from .aimed_volume import start_of
from .drag import AimDrag
from .solve_targets import solving
from .solve_work import WatchedSolve

# Drags by the session id of their camera, and what its targets were at the last call.
_drags: dict[int, AimDrag] = {}
_seen: dict[int, bytes] = {}
# Seconds of rest before the solve, and between two looks at it.
REST, TICK = 0.6, 0.1
# The time at which each camera has rested, and the solves under way.
_resting: dict[int, float] = {}
_solves: dict[int, WatchedSolve] = {}


def is_live(camera) -> bool:
    """Return whether the volume of a camera follows its targets."""
    settings = camera.scfpf
    return settings.enabled and settings.aim.live and len(settings.aim_targets) > 0 and camera.is_editable


def _facts(camera, depsgraph) -> bytes:
    """Everything that a drag follows, as bytes by which changes are noticed."""
    values: list[float] = []
    for target in camera.scfpf.aim_targets:
        values += [*target.position, target.width, target.turn, target.is_on]
        for obj in (target.eye, target.handle):
            if obj is not None:
                values += [v for row in obj.evaluated_get(depsgraph).matrix_world for v in row]
    return np.array(values, np.float64).tobytes()


def follow(camera, depsgraph) -> None:
    """Take a step if a target of a camera has moved since the last call."""
    uid, facts = camera.session_uid, _facts(camera, depsgraph)
    before = _seen.get(uid)
    _seen[uid] = facts
    if before is None or before == facts:
        return
    if len(before) != len(facts):
        _drags.pop(uid, None)
    if start_of(camera) is None:
        camera.scfpf.aim.message = "Press Solve once: the volume follows from then on"
        return
    try:
        if uid not in _drags:
            _drags[uid] = AimDrag(camera, depsgraph)
        residual = _drags[uid].step(depsgraph)
    except USER_ERRORS as error:
        _drags.pop(uid, None)
        camera.scfpf.aim.message = translated_report(error)
    else:
        message = Message("Follows within {0} px, and is solved when nothing moves", f"{residual:.3g}")
        camera.scfpf.aim.message = translated_report(message)
        _await_rest(uid)


def _await_rest(uid: int) -> None:
    """Solve after a rest from now on."""
    if uid in _solves:
        _solves.pop(uid).cancel()
    _resting[uid] = monotonic() + REST
    if not bpy.app.background and not bpy.app.timers.is_registered(_tick):
        bpy.app.timers.register(_tick, first_interval=REST)


def _tick() -> float | None:
    settle()
    return TICK if _resting or _solves else None


def settle() -> None:
    """Start the solves of cameras that have rested, and finish those that are done."""
    depsgraph = bpy.context.evaluated_depsgraph_get()
    for uid in [uid for uid, time in _resting.items() if monotonic() >= time]:
        del _resting[uid]
        camera = object_by_uid(uid)
        if camera is not None and is_live(camera) and camera.name in depsgraph.scene.objects:
            with _told(camera):
                _solves[uid] = WatchedSolve(solving(camera, depsgraph))
    for uid, solve in list(_solves.items()):
        camera = object_by_uid(uid)
        if camera is None or not is_live(camera):
            _solves.pop(uid).cancel()
            continue
        is_done = True
        with _told(camera):
            is_done = solve.is_done()
            if is_done and uid in _drags:
                _drags[uid].resume(camera)
        if is_done:
            del _solves[uid]


@contextmanager
def _told(camera):
    """Write the messages of errors where the panel shows them."""
    try:
        yield
    except USER_ERRORS as error:
        camera.scfpf.aim.message = translated_report(error)


def scene_updated(_scene, depsgraph) -> None:
    """Let the volumes of live cameras follow their targets."""
    if depsgraph.mode != "VIEWPORT" or bpy.app.is_job_running("RENDER"):
        return
    live = [camera for camera in camera_objects() if is_live(camera)]
    if not live:
        forget()
        return
    if _drags and _scene_has_changed(depsgraph):
        _drags.clear()
        for uid in list(_solves):
            _await_rest(uid)
    for camera in live:
        if camera.name in depsgraph.scene.objects:
            follow(camera, depsgraph)


def _scene_has_changed(depsgraph) -> bool:
    """Return whether anything that images show has changed, so that the arrays of drags are stale."""
    own = control_objects()
    return any(
        isinstance(update.id, bpy.types.Object)
        and update.id.type not in {"CAMERA", "EMPTY", "LIGHT"}
        and update.id.name_full not in own
        and (update.is_updated_geometry or update.is_updated_transform)
        for update in depsgraph.updates
    )


def forget() -> None:
    """Drop all drags and solves, and what targets were."""
    for solve in _solves.values():
        solve.cancel()
    for kept in (_drags, _seen, _resting, _solves):
        kept.clear()


def stop() -> None:
    """End all drags and solves, and the timer."""
    forget()
    if bpy.app.timers.is_registered(_tick):
        bpy.app.timers.unregister(_tick)
