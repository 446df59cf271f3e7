# SPDX-License-Identifier: GPL-3.0-or-later
"""The price of a rig before it is made: asked for by a panel that is drawn, worked out between two events.

A timer does it when nothing has changed for a moment, for the present frame; it takes a fraction of a second.
"""

from __future__ import annotations

import bpy

from ..bridge.camera.read_projection import ProjectionError
from ..bridge.render.render_errors import RenderError
from .chord_planning import Price, chords_of, look, price_of_plan
from .rig_data import RigError

# Seconds without a change, after which a price is worked out.
PATIENCE = 0.4


class _Asked:
    """Names, numbers and bytes only.

    changes: counted. asked: names of camera and scene. seen: changes when the timer last looked. answers: by
    session ids of camera and scene: changes then, what tells the volume from another, and the answer.
    """

    def __init__(self) -> None:
        self.changes, self.seen = 0, -1
        self.asked: tuple[str, str] | None = None
        self.answers: dict[tuple[int, int], tuple[int, tuple, Price | str]] = {}


_asked = _Asked()


def changed() -> None:
    """Something in the file has changed: call it from handlers."""
    _asked.changes += 1


def forget() -> None:
    """Another file is open."""
    _asked.answers.clear()
    changed()


def price(camera, scene) -> Price | str | None:
    """The price of a camera's rig in a scene, why there can be none, or None until it is worked out.

    Quick, for panels. An older price is returned while a newer one is worked out.
    """
    changes, _, answer = _asked.answers.get((camera.session_uid, scene.session_uid), (-1, (), None))
    if changes != _asked.changes:
        _asked.asked = camera.name, scene.name
        if not bpy.app.background and not bpy.app.timers.is_registered(_answer):
            bpy.app.timers.register(_answer, first_interval=PATIENCE)
    return answer


def work_out(camera, scene, depsgraph) -> Price | str:
    """As ``price``, at once; depsgraph: evaluated, of the scene."""
    key = camera.session_uid, scene.session_uid
    _, known, answer = _asked.answers.get(key, (-1, (), ""))
    signature: tuple = ()
    try:
        projection, signature = look(camera, scene, depsgraph)
        if signature != known:
            answer = price_of_plan(chords_of(camera, scene, [projection]))
    except (ProjectionError, RenderError, RigError) as error:
        answer = str(error)
    _asked.answers[key] = _asked.changes, signature, answer
    return answer


def _answer() -> float | None:
    """The timer: waits while things change, then works out what was asked for and has the panels drawn."""
    if _asked.changes != _asked.seen or bpy.app.is_job_running("RENDER"):
        _asked.seen = _asked.changes
        return PATIENCE
    camera_name, scene_name = _asked.asked or ("", "")
    for window in bpy.context.window_manager.windows:
        camera = window.scene.objects.get(camera_name)
        if window.scene.name == scene_name and camera is not None and camera.type == "CAMERA":
            work_out(camera, window.scene, window.view_layer.depsgraph)
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
