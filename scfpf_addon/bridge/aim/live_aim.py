# SPDX-License-Identifier: GPL-3.0-or-later
"""Live Aim: the volume takes a warm step whenever an eye, a handle or a target of its camera has moved.

When nothing has moved for a while, a thread solves anew from the start and judges; the next move cancels it.
The handler writes control points of volumes that are solutions already: it links and removes nothing. Undo
restores points with everything else, so the handler forgets its followers then and waits for the next move.
"""

from __future__ import annotations

from contextlib import contextmanager
from dataclasses import dataclass
from time import monotonic

import bpy
import numpy as np

from ...projection.user_error import Message
from ..blender.scene_objects import has_removed, object_by_uid
from ..blender.user_errors import USER_ERRORS, translated_report
from ..camera.flexible_camera import control_objects
from ..sync.camera_sync import camera_objects
from .aimed_volume import start_of
from .follower import Follower
from .solve_targets import solving
from .solve_work import WatchedSolve

# Seconds of rest before the solve, and between two looks at it.
REST, TICK = 0.6, 0.1


@dataclass
class LiveCamera:
    """The state of a live camera whose volume follows its targets.

    facts: of the targets at the last call. follower: None until they move, or if the scene has changed.
    rests_at: the time at which the camera has rested, None if no solve is awaited. solve: None if none is
    under way.
    """

    facts: bytes
    follower: Follower | None = None
    rests_at: float | None = None
    solve: WatchedSolve | None = None

    def await_rest(self) -> None:
        """Solve after a rest from now on."""
        self.cancel()
        self.rests_at = monotonic() + REST
        if not bpy.app.background and not bpy.app.timers.is_registered(_tick):
            bpy.app.timers.register(_tick, first_interval=REST)

    def cancel(self) -> None:
        """Cancel the solve under way."""
        solve, self.solve = self.solve, None
        if solve is not None:
            solve.cancel()


# By session id.
_cameras: dict[int, LiveCamera] = {}


def is_live(camera) -> bool:
    """Return whether the volume of a camera follows its targets."""
    settings = camera.scfpf
    return settings.enabled and settings.aim.live and len(settings.aim_targets) > 0 and camera.is_editable


def _facts(camera, depsgraph) -> bytes:
    """The targets' numbers, as bytes by which changes are noticed."""
    values: list[float] = []
    for target in camera.scfpf.aim_targets:
        values += [*target.position, target.width, target.turn, target.is_on]
        for obj in (target.eye, target.handle):
            if obj is not None:
                values += [v for row in obj.evaluated_get(depsgraph).matrix_world for v in row]
    return np.array(values, np.float64).tobytes()


def follow(camera, depsgraph) -> None:
    """Take a step if a target of a camera has moved since the last call."""
    facts = _facts(camera, depsgraph)
    own = _cameras.setdefault(camera.session_uid, LiveCamera(facts))
    before, own.facts = own.facts, facts
    if before == facts:
        return
    if len(before) != len(facts):
        own.follower = None
    if start_of(camera) is None:
        camera.scfpf.aim.message = "Press Solve once: the volume follows from then on"
        return
    try:
        if own.follower is None:
            own.follower = Follower(camera, depsgraph)
        residual = own.follower.step(depsgraph)
    except USER_ERRORS as error:
        own.follower = None
        camera.scfpf.aim.message = translated_report(error)
    else:
        message = Message("Follows within {0} px, and is solved when nothing moves", f"{residual:.3g}")
        camera.scfpf.aim.message = translated_report(message)
        own.await_rest()


def _tick() -> float | None:
    settle()
    return TICK if is_busy() else None


def is_busy() -> bool:
    """Return whether a solve is awaited or under way."""
    return any(own.rests_at is not None or own.solve is not None for own in _cameras.values())


def settle() -> None:
    """Start the solves of cameras that have rested, and finish those that are done."""
    depsgraph = bpy.context.evaluated_depsgraph_get()
    for uid, own in [*_cameras.items()]:
        if own.rests_at is None or monotonic() < own.rests_at:
            continue
        own.rests_at, camera = None, object_by_uid(uid)
        if camera is not None and is_live(camera) and camera.name in depsgraph.scene.objects:
            with _told(camera):
                own.solve = WatchedSolve(solving(camera, depsgraph))
    for uid, own in [*_cameras.items()]:
        if own.solve is None:
            continue
        camera, is_done = object_by_uid(uid), True
        if camera is None or not is_live(camera):
            own.cancel()
            continue
        with _told(camera):
            is_done = own.solve.is_done()
            if is_done and own.follower is not None:
                own.follower.resume(camera)
        if is_done:
            own.solve = None


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
    if any(own.follower for own in _cameras.values()) and _scene_has_changed(depsgraph):
        for own in _cameras.values():
            own.follower = None
            if own.solve is not None:
                own.await_rest()
    if has_removed():
        return  # a follower reads the scene's instances; the removal brings another update
    for camera in live:
        if camera.name in depsgraph.scene.objects:
            follow(camera, depsgraph)


def _scene_has_changed(depsgraph) -> bool:
    """Return whether anything that images show has changed, so that the arrays of followers are stale."""
    own = control_objects()
    return any(
        isinstance(update.id, bpy.types.Object)
        and update.id.type not in {"CAMERA", "EMPTY", "LIGHT"}
        and update.id.name_full not in own
        and (update.is_updated_geometry or update.is_updated_transform)
        for update in depsgraph.updates
    )


def forget() -> None:
    """Cancel all solves and drop all followers."""
    for own in _cameras.values():
        own.cancel()
    _cameras.clear()


def stop() -> None:
    """Cancel all solves, drop all followers and end the timer."""
    forget()
    if bpy.app.timers.is_registered(_tick):
        bpy.app.timers.unregister(_tick)
