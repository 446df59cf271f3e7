# SPDX-License-Identifier: GPL-3.0-or-later
"""Rounds of solving, each on another way from the old image to the new one, among which the judge chooses."""

from __future__ import annotations

from collections.abc import Callable
from typing import NamedTuple

import numpy as np

from ...projection.aim.problem import AimProblem, AimResult, Schedule
from ...projection.aim.solver import solve
from .judge import Judgement

# The way that is tried first, and others: stays that count more hold the background, more steps leave folds,
# and stays that count less do not force any.
FIRST = Schedule()
STILL, LONG, LOOSE = Schedule(stay=2.0, robust=3.0), Schedule(final_steps=60), Schedule(stay=0.5)
# From a solved volume, the way of detours round what hides pins.
FREEING = Schedule(stages=4, final_steps=40)
# Stays force folds if more than this share of the pixels is folded or mirrored.
FORCED = 0.005


class Round(NamedTuple):
    """A result and its judgement. number: how many rounds were solved until it was the best."""

    result: AimResult
    judgement: Judgement
    number: int


# From a result to its judgement.
Judge = Callable[[AimResult], Judgement]
# From the best round to the problem that frees its hidden pins, and the judge of that; None if nothing would.
Free = Callable[[Round], "tuple[AimProblem, Judge] | None"]
# A round is reported as this share of the work that is left: most solves need one.
ROUND_SHARE = 0.7
# Told before each step how much is done, as a share; returns whether to stop.
Report = Callable[[float], bool]


def solve_in_rounds(
    problem: AimProblem,
    judged: Judge,
    old: Judgement,
    report: Report = lambda share: False,
    free: Free = lambda found: None,
) -> Round | None:
    """The best of the rounds, by the judge; None if stopped or if no round has a finite volume.

    old: the judgement of the image before; a round that is no worse wins over one that is. A last round frees
    hidden pins from where the best one ended.
    """
    best: Round | None = None
    done, number, ways = 0.0, 0, [FIRST]
    while ways:
        schedule, number = ways.pop(0), number + 1
        part = ROUND_SHARE * (1.0 - done)
        result = solve(problem, _Steps(report, done, part / schedule.most_steps), schedule)
        done += part
        if result is None or report(done):
            return None
        if not all(np.isfinite(patch.points).all() for patch in result.patches):
            ways = ways or [LOOSE] * (number == 1)
            continue
        found = Round(result, judged(result), number)
        if number == 1:
            ways = _other_ways(found.judgement)
        if best is None or _rank(found, old) < _rank(best, old):
            best = found
        if best.judgement.meets_bars and not best.judgement.worse_than(old):
            break
    freeing = free(best) if best is not None else None
    if best is None or freeing is None:
        return best
    return _freed(best, *freeing, old, report, done)


def _freed(
    best: Round, problem: AimProblem, judged: Judge, old: Judgement, report: Report, done: float
) -> Round | None:
    """The round that frees pins from where the best one ended, if it is better; None if stopped.

    Their shortfalls are compared, also if the best one meets the bars: no bar counts hidden pins.
    """
    result = solve(problem, _Steps(report, done, (1.0 - done) / FREEING.most_steps), FREEING)
    if result is None:
        return None
    if not all(np.isfinite(patch.points).all() for patch in result.patches):
        return best
    found = judged(result)
    sees_more = found.hidden < best.judgement.hidden
    is_better = sees_more and not found.worse_than(old) and found.shortfall < best.judgement.shortfall
    return Round(result, found, best.number + 1) if is_better else best


class _Steps:
    """Reports the steps of a round, each as ``size`` of the work, from ``done`` on."""

    def __init__(self, report: Report, done: float, size: float) -> None:
        self._report, self._done, self._size = report, done, size

    def __call__(self) -> bool:
        self._done += self._size
        return self._report(self._done)


def _other_ways(first: Judgement) -> list[Schedule]:
    """The ways that mend what the first one missed, in turn."""
    if max(first.mirrored, first.folded) > FORCED:
        return [LOOSE, LONG]
    if first.misses_pins:
        return [LOOSE]
    return [STILL, LONG] if first.mirrored or first.folded else [STILL]


def _rank(found: Round, old: Judgement) -> tuple[bool, bool, float]:
    """The less the better."""
    judgement = found.judgement
    return bool(judgement.worse_than(old)), not judgement.meets_bars, judgement.shortfall
