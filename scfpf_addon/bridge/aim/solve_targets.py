# SPDX-License-Identifier: GPL-3.0-or-later
"""Solve a camera's volume for its targets, judge the image, and write its control surfaces."""

from __future__ import annotations

from dataclasses import replace
from functools import partial
from typing import Any

import numpy as np

from ...aim.detours import free_pins
from ...aim.judge import COLUMNS, Judge, Judgement
from ...aim.released import Released
from ...aim.rounds import BUDGET, Budget, JudgeResult, Round, solve_in_rounds
from ...aim.solver.problem import AimProblem, AimResult
from ...aim.solver.start import projection_of
from ...aim.survey import background_spread, spread_of
from ...casting.common.cancellation import raise_if_cancelled
from ...projection.user_error import UserError
from ...projection.volume.viewing_volume import Projection
from ..blender.scene_objects import object_by_uid
from ..tasks.task import Task
from .aimed_volume import moved, write_volume
from .kept_volume import volume_kept
from .read_problem import AimInputs, read_inputs
from .solution import Solution
from .solve_work import Steps, Work
from .verdict import require_better, require_possible, store_verdict

# The share of the time of a solve that the judgement of the old image takes.
JUDGED_OLD = 0.1


def solution_of(inputs: AimInputs, task: Task[Any]) -> Solution:
    """Solve and judge; arrays only. Raises UserError, Cancelled or CastError."""
    judge, budget = judge_of(inputs), Budget(BUDGET)
    old = judged(inputs, judge, inputs.before)
    task.progress = JUDGED_OLD

    def report(share: float) -> bool:
        task.progress = JUDGED_OLD + (1.0 - JUDGED_OLD) * share
        return task.cancelled

    def look(result: AimResult, released: Released | None = None) -> Judgement:
        after = projection_of(result.patches, inputs.present.aspect)
        return judged(inputs, judge, after, released)

    problem = inputs.problem()

    def free(found: Round) -> tuple[AimProblem, JudgeResult] | None:
        scene, wanted = inputs.arrays.scene, inputs.targets.wanted
        freed = free_pins(scene, problem, wanted, found.result, found.judgement)
        return freed and (freed[0], partial(look, released=freed[1]))

    found = solve_in_rounds(problem, look, old, report, free, budget)
    raise_if_cancelled()
    if found is None:
        raise UserError("Not taken, because no volume was found: bring the targets nearer to their places")
    return _surveyed(inputs, judge, found, old, budget.is_set())


def _surveyed(inputs: AimInputs, judge: Judge, found: Round, old: Judgement, is_late: bool) -> Solution:
    """The solution of a round."""
    after = projection_of(found.result.patches, inputs.present.aspect)
    spreads = {}
    for number, view in inputs.targets.views.items():
        points = view.seen.points
        spread = spread_of(judge, after, points, view.map.positions(points))
        if spread is not None:
            spreads[number] = spread
    for number, stay in inputs.locked.items():
        held = stay.weights > 0.0
        positions = np.stack(np.meshgrid(stay.x, stay.y, indexing="ij"))[:, held]
        spread = spread_of(judge, after, stay.points[:, held], positions)
        if spread is not None:
            spreads[number] = spread
    alone = inputs.targets.alone
    background = None if alone else background_spread(judge, after, found.judgement.released)
    return Solution(inputs, found.result, found.judgement, old, spreads, background, is_late)


def judge_of(inputs: AimInputs, columns: int | None = None) -> Judge:
    """The judge of a camera's solutions. columns: of the image that is judged, if not COLUMNS."""
    scene, targets = inputs.arrays.scene, inputs.targets
    size = inputs.width, columns or COLUMNS
    return Judge(scene, inputs.before, targets.pins, targets.halos, targets.wanted, *size)


def judged(inputs: AimInputs, judge: Judge, after: Projection, released: Released | None = None) -> Judgement:
    """The judgement of a projection whose parameters are those of the image."""
    found = judge.judgement_of(after, released)
    # With a view alone the background may go anywhere.
    return replace(found, moved=found.moved[:0]) if inputs.targets.alone else found


def camera_again(uid: int):
    """The camera of a solve, after work that Blender did not wait for. Raises UserError."""
    camera = object_by_uid(uid)
    if camera is None or not camera.users_collection:
        raise UserError("The camera is gone: undo its deletion, and press Solve again")
    return camera


def solving(camera, depsgraph) -> Steps:
    """Solve, and make the solution the camera's volume.

    Raises USER_ERRORS; then the volume is as before.
    """
    uid, inputs = camera.session_uid, read_inputs(camera, depsgraph)
    require_possible(camera, inputs)
    del camera, depsgraph
    found = yield Work(partial(solution_of, inputs))
    camera = camera_again(uid)
    require_better(camera, found)
    with volume_kept(camera):
        take_solution(camera, found)
        return store_verdict(camera, found)


def take_solution(camera, found: Solution) -> None:
    """Write a solution to the control surfaces."""
    inward = found.inputs.inward
    write_volume(camera, moved(found.inputs.start, inward), moved(found.result.patches, inward))
    camera.scfpf.aim.is_solved, camera.scfpf.aim.between = True, -1.0
