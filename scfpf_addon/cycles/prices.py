# SPDX-License-Identifier: GPL-3.0-or-later
"""The price of a rig before it is made: requested by a panel while it is drawn, computed by a timer.

The timer computes it for the present frame, in a fraction of a second, when nothing has changed for a moment.
"""

from __future__ import annotations

import bpy

from ..projection.user_error import UserError
from .chord_planning import Price, chords_of, price_of_plan
from .watched_volume import look

# Seconds without a change before a price is computed.
PATIENCE = 0.4


class _Requests:
    """Prices that panels have requested: names, numbers and bytes only.

    changes: counted. asked: names of camera and scene. seen: changes when the timer last looked. answers: by
    session ids of camera and scene: changes then, a signature of the volume, and the answer.
    """

    def __init__(self) -> None:
        self.changes, self.seen = 0, -1
        self.asked: tuple[str, str] | None = None
        self.answers: dict[tuple[int, int], tuple[int, tuple, Price | str]] = {}


_requests = _Requests()


def changed() -> None:
    """Count a change of the file; called by handlers."""
    _requests.changes += 1


def forget() -> None:
    """Forget all prices, when another file is opened."""
    _requests.answers.clear()
    changed()


def price(camera, scene) -> Price | str | None:
    """The price of a camera's rig in a scene, or why it can have none; None until it is computed.

    Quick, for panels. It is the previous price while a new one is computed.
    """
    changes, _, answer = _requests.answers.get((camera.session_uid, scene.session_uid), (-1, (), None))
    if changes != _requests.changes:
        _requests.asked = camera.name, scene.name
        if not bpy.app.background and not bpy.app.timers.is_registered(_answer):
            bpy.app.timers.register(_answer, first_interval=PATIENCE)
    return answer


def compute(camera, scene, depsgraph) -> Price | str:
    """Compute a ``price`` at once. depsgraph: evaluated, of the scene."""
    key = camera.session_uid, scene.session_uid
    _, known, answer = _requests.answers.get(key, (-1, (), ""))
    signature: tuple = ()
    try:
        projection, signature = look(camera, scene, depsgraph)
        if signature != known:
            answer = price_of_plan(chords_of(camera, scene, [projection]))
    except UserError as error:
        answer = str(error)
    _requests.answers[key] = _requests.changes, signature, answer
    return answer


def _answer() -> float | None:
    """Compute the requested price and redraw the panels, once nothing changes; a timer's function."""
    if _requests.changes != _requests.seen or bpy.app.is_job_running("RENDER"):
        _requests.seen = _requests.changes
        return PATIENCE
    camera_name, scene_name = _requests.asked or ("", "")
    for window in bpy.context.window_manager.windows:
        camera = window.scene.objects.get(camera_name)
        if window.scene.name == scene_name and camera is not None and camera.type == "CAMERA":
            compute(camera, window.scene, window.view_layer.depsgraph)
            break
    for window in bpy.context.window_manager.windows:
        for area in window.screen.areas:
            if area.type in {"VIEW_3D", "PROPERTIES"}:
                area.tag_redraw()
    return None


def unregister() -> None:
    """Stop the timer."""
    if bpy.app.timers.is_registered(_answer):
        bpy.app.timers.unregister(_answer)
