# SPDX-License-Identifier: GPL-3.0-or-later
"""The ways to go from the old image to the wanted one."""

from __future__ import annotations

from dataclasses import dataclass


@dataclass(frozen=True)
class Schedule:
    """A homotopy and the weights that change on it.

    stages: of the pins' way, with ``steps`` each. final_steps: the most at its end. fold_growth: the multiple
    to which the barrier grows by then. stay, robust: factors of the weight of stays, and of the distance from
    which they lose their influence.
    """

    stages: int = 8
    steps: int = 2
    final_steps: int = 24
    fold_growth: float = 12.0
    stay: float = 1.0
    robust: float = 1.0

    @property
    def most_steps(self) -> int:
        """Steps at most."""
        return (self.stages - 1) * self.steps + self.final_steps
