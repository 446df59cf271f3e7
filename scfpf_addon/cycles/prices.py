# SPDX-License-Identifier: GPL-3.0-or-later
"""The price of a rig before it is made, computed when a tooltip asks for it, in a fraction of a second."""

from __future__ import annotations

from ..projection.user_error import UserError
from .chord_planning import Price, chords_of, price_of_plan
from .watched_volume import look

# By session ids of camera and scene: a signature of the volume, and the answer. Numbers and bytes only.
_answers: dict[tuple[int, int], tuple[tuple, Price | str]] = {}


def forget() -> None:
    """Forget all prices, when another file is opened."""
    _answers.clear()


def compute(camera, scene, depsgraph) -> Price | str:
    """The price of a camera's rig in a scene at the present frame, or why it can have none.

    depsgraph: evaluated, of the scene.
    """
    key = camera.session_uid, scene.session_uid
    known, answer = _answers.get(key, ((), ""))
    signature: tuple = ()
    try:
        projection, signature = look(camera, scene, depsgraph)
        if signature != known:
            answer = price_of_plan(chords_of(camera, scene, [projection]))
    except UserError as error:
        answer = str(error)
    _answers[key] = signature, answer
    return answer
