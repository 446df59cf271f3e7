# SPDX-License-Identifier: GPL-3.0-or-later
"""A solution of a camera's targets, with all that is measured in its image."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any, NamedTuple

from ...aim.judge import Judgement
from ...aim.solver.problem import AimResult
from ...aim.survey import Spread
from .read_problem import AimInputs


@dataclass(frozen=True)
class Solution:
    """A solution and its judgement, beside that of the image before.

    spreads: of the things of views and of stays, by their places in the list. background: None where it may
    go anywhere or is not seen. is_late: whether the time was over before all was tried.
    """

    inputs: AimInputs
    result: AimResult
    judgement: Judgement
    old: Judgement
    spreads: dict[int, Spread]
    background: Spread | None
    is_late: bool


# The properties of Aim and of a target that tell of the image of a solution, and their values without one.
OF_AIM = {"background_95": -1.0, "background_max": -1.0, "flaws": ""}
OF_TARGET = {"whole_95": -1.0, "whole_max": -1.0}


class Measures(NamedTuple):
    """The measurements in the image of a camera's last solution: of Aim, and of each target."""

    aim: dict[str, Any]
    targets: list[dict[str, Any]]

    @classmethod
    def of(cls, camera) -> Measures:
        """The measures that a camera's properties tell."""
        settings = camera.scfpf
        targets = [{name: getattr(target, name) for name in OF_TARGET} for target in settings.aim_targets]
        return cls({name: getattr(settings.aim, name) for name in OF_AIM}, targets)

    def store(self, camera) -> None:
        """Let a camera's properties tell these."""
        settings = camera.scfpf
        pairs = [(settings.aim, self.aim), *zip(settings.aim_targets, self.targets, strict=False)]
        for owner, values in pairs:
            for name, value in values.items():
                setattr(owner, name, value)


def forget_measures(camera) -> None:
    """Forget what was measured, as the volume has changed."""
    Measures(OF_AIM, [OF_TARGET] * len(camera.scfpf.aim_targets)).store(camera)
