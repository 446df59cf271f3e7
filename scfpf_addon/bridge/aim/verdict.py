# SPDX-License-Identifier: GPL-3.0-or-later
"""The judgement of a solution in words and as properties of targets."""

from __future__ import annotations

import math
from itertools import permutations

import numpy as np

from ...casting.aim.judge import Judgement
from ...casting.aim.sight import free_turn, sees
from ...projection.template_error import Message
from ..render.render_errors import told
from .read_problem import AimInputs
from .target_views import AimError, title_of

# Pixels within which a target is met, and those that a user is not told of.
MET, UNSEEN = 1.5, 0.5
# Two views contradict each other if the second sees more than this share of the first one's points, farther
# from their places than this, as shares of the image.
TWICE, APART = 0.25, 0.05
# A residual in a property is this at most.
LARGEST = 1e9
WORSE = {
    "PINS": Message("the targets would be farther from their places than before"),
    "MIRRORED": Message("parts of the picture would be mirrored"),
    "FOLDED": Message("the volume would fold before what is seen"),
    "BACKGROUND": Message("the background would move too far"),
}
REMEDY = Message(
    "bring the targets nearer to where the picture shows them, widen their halos, or switch one of them off"
)


def require_better(camera, inputs: AimInputs, found: Judgement, old: Judgement) -> None:
    """Raise AimError if a solution makes the image worse."""
    reason = found.worse_than(old)
    if reason:
        raise AimError("Not taken, because {0}: {1}", WORSE[reason], _contradiction(camera, inputs) or REMEDY)


def _contradiction(camera, inputs: AimInputs) -> str:
    """Two views that show the same points in two places, in words; empty if there are none."""
    targets, listed = inputs.targets, camera.scfpf.aim_targets
    for one, other in permutations(targets.views, 2):
        view, thing = targets.views[other], targets.views[other].own & targets.views[one].own
        pins = np.flatnonzero(targets.owners == one)
        points = targets.pins.points[:, pins]
        if not thing.any():
            continue
        apart = np.hypot(*(view.map.positions(points) - targets.pins.positions[:, pins]))
        twice = (apart > APART) & sees(inputs.arrays.scene, thing, view.map, points)
        if twice.mean() > TWICE:
            names = [title_of(listed[number]) for number in sorted((one, other))]
            return Message(
                "the views '{0}' and '{1}' show the same part in two places, which one volume cannot: "
                "switch one off, or give it a camera of its own and layer both pictures in the compositor",
                *names,
            )
    return ""


def store_verdict(camera, inputs: AimInputs, found: Judgement) -> str:
    """Store a judgement in the properties of a camera and its targets; return the line to report."""
    aim, targets = camera.scfpf.aim, inputs.targets
    for number, target in enumerate(camera.scfpf.aim_targets):
        own = np.flatnonzero(targets.owners == number)
        if len(own):
            _store_target(target, number, inputs, found, own)
        else:
            target.residual_median = target.residual_max = -1.0
            target.hidden, target.hidden_by, target.message = 0.0, "", ""
            target.free_turn = 0.0, 0.0
    aim.mirrored, aim.folds = found.mirrored, found.folded
    judged = len(found.moved) > 0
    aim.background_median = min(found.background_median, LARGEST) if judged else -1.0
    aim.background_95 = min(found.background_most, LARGEST) if judged else -1.0
    aim.message = _summary(camera, inputs, found)
    return aim.message


def _store_target(target, number: int, inputs: AimInputs, found: Judgement, own) -> None:
    pixels = np.minimum(found.pixels[own], LARGEST)
    target.residual_median, target.residual_max = float(np.median(pixels)), float(pixels.max())
    by = found.hidden_by[own]
    target.hidden = float((by >= 0).mean())
    target.hidden_by = inputs.arrays.name(int(np.bincount(by[by >= 0]).argmax())) if target.hidden else ""
    view, target.free_turn = inputs.targets.views.get(number), (0.0, 0.0)
    if view is not None and target.hidden:
        points = inputs.targets.pins.points[:, own]
        target.free_turn = free_turn(inputs.arrays.scene, ~view.own, view.map, points) or (0.0, 0.0)
    target.message = _target_text(target)


def _target_text(target) -> str:
    """Report in a sentence or two whether a target is met and seen."""
    worst = target.residual_max
    met = (
        Message("Met within {0:.2g} px", worst)
        if worst <= MET
        else Message("Up to {0} from its place", _pixels(worst))
    )
    if not target.hidden_by:
        return told(met)
    part = Message("hidden by {0}", target.hidden_by)
    if target.hidden < 1.0:
        part = Message("hidden to {0:.0f} % by {1}", 100.0 * target.hidden, target.hidden_by)
    left, up = target.free_turn
    text = f"{told(met)}, {told(part)}"
    if left or up:
        return told(Message("{0}: nearest free direction {1}", text, _direction(left, up)))
    return text


def _pixels(value: float) -> str:
    return f"{value:.3g} px" if value < 1e5 else Message("very far")


def _direction(left: float, up: float) -> str:
    """A turn in words."""
    parts = []
    for angle, way in (
        (left, Message("{0}° to the right") if left < 0 else Message("{0}° to the left")),
        (up, Message("{0}° down") if up < 0 else Message("{0}° up")),
    ):
        degrees = round(math.degrees(abs(angle)))
        if degrees:
            parts.append(Message(way, degrees))
    return Message("{0} and {1}", *parts) if len(parts) == 2 else "".join(map(told, parts))


def _summary(camera, inputs: AimInputs, found: Judgement) -> str:
    """The result in one line: the points that are met, the background, and what is wrong."""
    met, count = int((found.pixels <= MET).sum()), len(found.pixels)
    parts = [Message("{0} of {1} points within {2} px", met, count, MET)]
    hidden = [title_of(target) for target in camera.scfpf.aim_targets if target.hidden_by]
    if hidden:
        parts.append(Message("partly hidden: {0}", ", ".join(hidden)))
    if len(found.moved):
        parts.append(Message("background moved {0:.1f} px", found.background_median))
    if found.mirrored > 0.0:
        parts.append(Message("{0:.2g} % mirrored", 100 * found.mirrored))
    if found.folded > 0.0:
        parts.append(Message("{0:.2g} % folded", 100 * found.folded))
    if met < count and (contradiction := _contradiction(camera, inputs)):
        parts.append(contradiction)
    if inputs.error > UNSEEN:
        parts.append(
            Message("the start differs by up to {0}: use more control points", _pixels(inputs.error))
        )
    return " · ".join(map(told, parts))
