# SPDX-License-Identifier: GPL-3.0-or-later
"""Solve a camera's volume for its targets, judge the image, and write its control surfaces."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from ...casting.aim.judge import COLUMNS, Judgement, judge
from ...projection.aim.problem import AimResult
from ...projection.aim.solver import solve
from ...projection.aim.start import projection_of
from ...projection.volume.viewing_volume import Projection
from .aimed_volume import Patches, moved, write_volume
from .read_problem import AimInputs, read_inputs
from .target_views import AimError
from .verdict import require_better, store_verdict


@dataclass(frozen=True)
class Solution:
    """A solution that is better than the image before, and its judgement."""

    inputs: AimInputs
    result: AimResult
    judgement: Judgement


def solution_for(camera, depsgraph, start: Patches | None = None) -> Solution:
    """Solve for the targets as they are. Raises AimError, or one of RENDER_ERRORS; nothing is changed.

    start: in camera space, by default that of the camera's present volume.
    """
    inputs = read_inputs(camera, depsgraph, start)
    old = judged(inputs, inputs.before)
    result = solve(inputs.problem())
    if result is None or not all(np.isfinite(patch.points).all() for patch in result.patches):
        raise AimError("Not taken, because no volume was found: bring the targets nearer to their places")
    found = judged(inputs, projection_of(result.patches, inputs.present.aspect))
    require_better(camera, inputs, found, old)
    return Solution(inputs, result, found)


def judged(inputs: AimInputs, after: Projection, columns: int = COLUMNS) -> Judgement:
    """The judgement of a projection whose parameters are those of the image; columns: that are cast."""
    targets = inputs.targets
    return judge(
        inputs.arrays.scene,
        inputs.before,
        after,
        targets.pins,
        targets.halos,
        targets.wanted,
        inputs.width,
        columns,
    )


def solve_camera(camera, depsgraph) -> str:
    """Solve, and make the solution the camera's volume; return the line to report.

    Raises AimError, SlotError, SurfaceError or one of RENDER_ERRORS; then the volume is as before.
    """
    found = solution_for(camera, depsgraph)
    take_solution(camera, found)
    return store_verdict(camera, found.inputs, found.judgement)


def take_solution(camera, found: Solution) -> None:
    """Write a solution to the control surfaces."""
    inward = found.inputs.inward
    write_volume(camera, moved(found.inputs.start, inward), moved(found.result.patches, inward))
    camera.scfpf.aim.is_solved, camera.scfpf.aim.between = True, -1.0
