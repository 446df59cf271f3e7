# SPDX-License-Identifier: GPL-3.0-or-later
"""The judgement of a solution in words and as properties of targets."""

from __future__ import annotations

import math

import numpy as np

from ...aim import contradictions
from ...aim.contradictions import Contradiction, find_contradiction, shown_twice
from ...aim.judge import Judgement
from ...aim.rounds import BUDGET
from ...aim.sight import free_turn
from ...aim.survey import Spread
from ...projection.user_error import Message, UserError
from ..blender.user_errors import translated_report
from ..settings.aim_properties import LARGEST, VIEW
from .read_problem import AimInputs
from .solution import Solution
from .target_views import title_of

# Pixels within which a target is met, those that a user is not told of, and those within which 95 % of the
# background shall stay.
MET, UNSEEN, STILL = 1.5, 0.5, 25.0
# A solution is not taken if a target of at least this weight is farther from its place, in pixels. Whoever
# gives a target less than the usual weight lets it yield.
MISSED, FULL_WEIGHT = 10.0, 1.0
WORSE = {
    "PINS": Message("the targets would be farther from their places than before"),
    "MIRRORED": Message("parts of the picture would be mirrored"),
    "FOLDED": Message("the volume would fold before what is seen"),
    "BACKGROUND": Message("the background would move too far"),
}
REMEDY = Message(
    "bring the targets nearer to where the picture shows them, widen their halos, or switch one of them off"
)


CONTRADICTIONS = {
    contradictions.POINT: Message(
        "'{0}' and '{1}' hold the same point at two places of the picture: remove one of them, or bring "
        "their places together"
    ),
    contradictions.DIRECTION: Message(
        "'{0}' and '{1}' show the same point from two directions: switch off Direction for one of them"
    ),
    contradictions.PLACE: Message(
        "'{0}' and '{1}' hold two points at the same place of the picture, where the first hides the second: "
        "move one of them"
    ),
    contradictions.VIEW: Message(
        "'{0}' holds a point of what '{1}' shows elsewhere in the picture: remove the pin, or move it to "
        "where the view has that point"
    ),
    contradictions.VIEWS: Message(
        "the views '{0}' and '{1}' show the same part in two places, which one volume cannot: "
        "switch one off, or give it a camera of its own and layer both pictures in the compositor"
    ),
}


def require_possible(camera, inputs: AimInputs) -> None:
    """Raise UserError if targets contradict each other."""
    targets = inputs.targets
    scene = inputs.arrays.scene
    found = find_contradiction(scene, inputs.before, targets.pins, targets.views, inputs.width)
    if found is not None:
        raise UserError("Not solved, because {0}", _contradiction_text(camera, inputs, found))


def _contradiction_text(camera, inputs: AimInputs, found: Contradiction) -> Message:
    listed, owners = camera.scfpf.aim_targets, inputs.targets.owners
    names = (title_of(listed[int(owners[pin])]) for pin in (found.first, found.second))
    return Message(CONTRADICTIONS[found.kind], *names)


def _remedy(camera, inputs: AimInputs) -> Message:
    """The remedies for a solution that is not good."""
    found = shown_twice(inputs.arrays.scene, inputs.targets.pins, inputs.targets.views)
    return REMEDY if found is None else _contradiction_text(camera, inputs, found)


def require_better(camera, solution: Solution) -> None:
    """Raise UserError if a solution makes the image worse, or misses a target."""
    inputs, found = solution.inputs, solution.judgement
    worse = found.worse_than(solution.old)
    reason = WORSE[worse] if worse else _missed(camera, inputs, found)
    if not reason:
        return
    if solution.is_late:
        reason = Message("{0}, and nothing better was found in {1:g} s", reason, BUDGET)
    raise UserError("Not taken, because {0}: {1}", reason, _remedy(camera, inputs))


def _missed(camera, inputs: AimInputs, found: Judgement) -> Message | None:
    """The target that is missed most, in words; None if none is missed."""
    listed, owners = camera.scfpf.aim_targets, inputs.targets.owners
    full = np.array([listed[int(number)].weight >= FULL_WEIGHT for number in owners], bool)
    pixels = np.where(full, found.pixels, 0.0)
    worst = int(pixels.argmax())
    if pixels[worst] <= MISSED:
        return None
    title = title_of(listed[int(owners[worst])])
    return Message("'{0}' would be {1} from its place", title, _pixels(float(pixels[worst])))


def store_verdict(camera, solution: Solution) -> str:
    """Store the judgement of a solution in the properties of a camera and its targets; return the line to
    report."""
    inputs, found = solution.inputs, solution.judgement
    aim, targets = camera.scfpf.aim, inputs.targets
    for number, target in enumerate(camera.scfpf.aim_targets):
        own = np.flatnonzero(targets.owners == number)
        _store_spread(target, "whole", solution.spreads.get(number))
        if len(own):
            _store_target(target, number, inputs, found, own)
        else:
            target.residual_median = target.residual_max = -1.0
            target.hidden, target.hidden_by, target.message = 0.0, "", ""
            target.free_turn = 0.0, 0.0
            if target.whole_95 >= 0.0:
                target.message = translated_report(_spread_text(target.whole_95, target.whole_max))
    aim.mirrored, aim.folds = found.mirrored, found.folded
    aim.background_median = min(found.background_median, LARGEST) if len(found.moved) else -1.0
    _store_spread(aim, "background", solution.background)
    aim.flaws = translated_report(flaws) if (flaws := _flaws(camera, solution)) else ""
    aim.message = _summary(camera, solution)
    return aim.message


def _store_spread(owner, name: str, spread: Spread | None) -> None:
    """Store a spread in three properties of a target or of Aim."""
    nearly_all, most = (-1.0, -1.0) if spread is None else spread[:2]
    setattr(owner, f"{name}_95", min(nearly_all, LARGEST))
    setattr(owner, f"{name}_max", min(most, LARGEST))
    if spread is not None:
        setattr(owner, f"{name}_worst", np.clip(spread.place, 0.0, 1.0))


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
    if target.whole_95 >= 0.0:
        met = _spread_text(target.whole_95, target.whole_max)
    elif worst <= MET:
        met = Message("Met within {0:.2g} px", worst)
    else:
        met = Message("Up to {0} from its place", _pixels(worst))
    if not target.hidden_by:
        return translated_report(met)
    part = Message("hidden by {0}", target.hidden_by)
    if target.hidden < 1.0:
        part = Message("hidden to {0:.0f} % by {1}", 100.0 * target.hidden, target.hidden_by)
    left, up = target.free_turn
    text = f"{translated_report(met)}, {translated_report(part)}"
    if left or up:
        return translated_report(Message("{0}: nearest free direction {1}", text, _direction(left, up)))
    return text


def _spread_text(nearly_all: float, most: float) -> Message:
    return Message("95 % within {0}, the worst place {1} off", _pixels(nearly_all), _pixels(most))


def _pixels(value: float) -> str:
    if value >= 1e5:
        return Message("very far")
    return f"{value:.1f} px" if value < 10.0 else f"{value:.0f} px"


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
    return Message("{0} and {1}", *parts) if len(parts) == 2 else "".join(map(translated_report, parts))


def _flaws(camera, solution: Solution) -> Message | None:
    """The fault of a solution and its remedy; None if it has none."""
    found, old = solution.judgement, solution.old
    missed = [target for target in camera.scfpf.aim_targets if target.residual_max > MET]
    parts = []
    if missed:
        worst = max(missed, key=lambda target: target.residual_max)
        parts.append(Message("'{0}' is {1} from its place", title_of(worst), _pixels(worst.residual_max)))
    for now, before, text in (
        (found.mirrored, old.mirrored, Message("{0:.2g} % of the picture is mirrored")),
        (found.folded, old.folded, Message("{0:.2g} % of the picture is behind a fold")),
    ):
        if now > before:
            parts.append(Message(text, 100.0 * now))
    if solution.background is not None and solution.background.nearly_all > STILL:
        parts.append(Message("a part of the background moves by more than {0}", _pixels(STILL)))
    if parts:
        return Message("{0}: {1}", ", ".join(map(translated_report, parts)), _remedy(camera, solution.inputs))
    return _start_text(solution.inputs, MISSED)


def _start_text(inputs: AimInputs, least: float) -> Message | None:
    """The difference of the start from the volume that it replaces, None if at most ``least`` pixels."""
    if inputs.error <= least:
        return None
    return Message("the start differs by up to {0}: use more control points", _pixels(inputs.error))


def _summary(camera, solution: Solution) -> str:
    """The result in one line: what is wrong, whole things and the background, points that are met."""
    inputs, found, aim = solution.inputs, solution.judgement, camera.scfpf.aim
    met, count = int((found.pixels <= MET).sum()), len(found.pixels)
    parts = [aim.flaws] if aim.flaws else []
    for target in camera.scfpf.aim_targets:
        if target.kind == VIEW and target.whole_95 >= 0.0:
            spread = _spread_text(target.whole_95, target.whole_max)
            parts.append(Message("{0}: {1}", title_of(target), spread))
    if aim.background_95 >= 0.0:
        spread = _spread_text(aim.background_95, aim.background_max)
        parts.append(Message("background: {0}", spread))
    parts.append(Message("{0} of {1} points within {2} px", met, count, MET))
    hidden = [title_of(target) for target in camera.scfpf.aim_targets if target.hidden_by]
    if hidden:
        parts.append(Message("partly hidden: {0}", ", ".join(hidden)))
    if (start := _start_text(inputs, UNSEEN)) and translated_report(start) != aim.flaws:
        parts.append(start)
    return " · ".join(map(translated_report, parts))
