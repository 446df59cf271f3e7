# SPDX-License-Identifier: GPL-3.0-or-later
"""Rounds of solving, each on another way from the old image to the new one, among which the judge chooses."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace
from typing import NamedTuple

import numpy as np

from ...projection.aim.problem import AimProblem, AimResult, Schedule
from ...projection.aim.solver import solve
from .judge import Judgement

# The way that is tried first, and others: stays that count more hold the background, while pins and the
# barrier hold their own against them, and stays that count less force no folds.
FIRST, STILL, LOOSE = Schedule(), Schedule(fold=2.0, pin=2.0, stay=2.0, robust=3.0), Schedule(stay=0.5)
# From a solved volume, with more weight on pins and stays: both come nearer to their places.
FIRM = Schedule(stages=1, final_steps=16, pin=3.0, stay=2.0)
# From a solved volume, the ways of detours round what hides pins. The second one frees most, the third one
# holds pins and background best.
_FREEING = Schedule(stages=4, final_steps=40)
FREEING = (_FREEING, replace(_FREEING, pin=1.4, detour=2.0), replace(_FREEING, pin=2.0))
# Stays force folds if more than this share of the pixels is folded or mirrored. Beyond a larger one they are
# too many to be mended.
FORCED, MENDABLE = 0.005, 0.03


class Round(NamedTuple):
    """A result and its judgement.

    number: how many rounds were solved until it was found. schedule: of its way.
    """

    result: AimResult
    judgement: Judgement
    number: int
    schedule: Schedule


# From a result to its judgement.
JudgeResult = Callable[[AimResult], Judgement]
# From the best round to the problem that frees its hidden pins, and the judge of that; None if nothing would.
Free = Callable[[Round], "tuple[AimProblem, JudgeResult] | None"]
# A round is reported as this share of the work that is left: most solves need one.
ROUND_SHARE = 0.7
# Told before each step how much is done, as a share; returns whether to stop.
Report = Callable[[float], bool]


def solve_in_rounds(
    problem: AimProblem,
    judged: JudgeResult,
    old: Judgement,
    report: Report = lambda share: False,
    free: Free = lambda found: None,
) -> Round | None:
    """The best of the rounds, by the judge; None if stopped or if no round has a finite volume.

    old: the judgement of the image before; a round that is no worse wins over one that is. Where pins or the
    background miss their bars, the round goes on with more weight on both. The best one is mended if it
    folds, and if that fails stays count more, then less. Further rounds free hidden pins from where that
    ended.
    """
    rounds = _Rounds(old, report)
    try:
        best = _best_round(rounds, problem, judged)
        freeing = free(best) if best is not None else None
        return best if best is None or freeing is None else _freed(rounds, best, *freeing)
    except _Stopped:
        return None


def _best_round(rounds: _Rounds, problem: AimProblem, judged: JudgeResult) -> Round | None:
    finite = _firmed(rounds, problem, judged, FIRST)
    best = min(finite, key=rounds.rank, default=None)
    if best is None or not rounds.is_good(best):
        for way in [LOOSE] if best is None else other_ways(best.judgement):
            found = _firmed(rounds, problem, judged, way)
            finite += found
            if found and not found[-1].judgement.misses_pins:
                break
    if not finite:
        return None
    best = min(finite, key=rounds.rank)
    # Where folds are left stays count more, then yield.
    finite += _mended(rounds, problem, judged, best, [best.schedule, FIRST])
    for way in (STILL, LOOSE):
        is_clean = min(finite, key=rounds.final_rank).judgement.is_clean
        if not is_clean and all(one.schedule != way for one in finite):
            for other in _firmed(rounds, problem, judged, way):
                finite += [other, *_mended(rounds, problem, judged, other, [other.schedule])]
    return min(finite, key=rounds.final_rank)


def _firmed(rounds: _Rounds, problem: AimProblem, judged: JudgeResult, way: Schedule) -> list[Round]:
    """The round of a way, then the one that brings pins and stays nearer, if they miss their bars."""
    found = rounds.solve(problem, judged, way)
    if found is None:
        return []
    missed = found.judgement.misses_pins or found.judgement.misses_background
    firm = rounds.solve(replace(problem, solved=found.result), judged, FIRM) if missed else None
    return [found] if firm is None else [found, firm]


def _mended(
    rounds: _Rounds, problem: AimProblem, judged: JudgeResult, folded: Round, ways: list[Schedule]
) -> list[Round]:
    """A round mended on ways in turn, until it is clean; none if it is, or if too much is missing."""
    found: list[Round] = []
    if not 0.0 < folded.judgement.unclean <= MENDABLE or folded.judgement.misses_pins:
        return found
    for way in dict.fromkeys(ways):
        mended = rounds.solve(replace(problem, solved=folded.result), judged, way.mending())
        found += [mended] if mended else []
        if mended and mended.judgement.is_clean:
            break
    return found


def _freed(rounds: _Rounds, best: Round, problem: AimProblem, judged: JudgeResult) -> Round:
    """The best of the rounds that free pins from where ``best`` ended; ``best`` itself if none is better.

    Their shortfalls are compared, also if ``best`` meets the bars: no bar counts hidden pins. Those that meet
    the bars win over others. Where the first way frees nothing the others are not tried, nor where one leaves
    nothing to better.
    """
    freer: list[Round] = []
    for way in FREEING:
        found = _firmed(rounds, problem, judged, way)
        if way == FREEING[0] and all(one.judgement.hidden >= best.judgement.hidden for one in found):
            return best
        freer += [one for one in found if rounds.is_freer(best.judgement, one.judgement)]
        if any(one.judgement.shortfall == 0.0 for one in freer):
            break
    kept = [one for one in freer if one.judgement.meets_bars]
    return min([best, *(kept or freer)], key=lambda one: one.judgement.shortfall)


def other_ways(first: Judgement) -> list[Schedule]:
    """The ways that better what the first one missed, in turn."""
    if first.misses_pins:
        return [LOOSE, STILL]
    if first.unclean > FORCED:
        return [LOOSE]
    return [STILL] if first.misses_background else []


class _Stopped(Exception):
    """The user has stopped the solve."""


class _Rounds:
    """Solves rounds, reports them, and compares them. old: the judgement of the image before."""

    def __init__(self, old: Judgement, report: Report) -> None:
        self.old, self._report = old, report
        self._done, self._number = 0.0, 0

    def solve(
        self, problem: AimProblem, judged: JudgeResult, schedule: Schedule, share: float = ROUND_SHARE
    ) -> Round | None:
        """The next round; None if its volume is not finite. share: of the work that is left.

        Raises _Stopped.
        """
        self._number += 1
        part = share * (1.0 - self._done)
        result = solve(problem, _Steps(self._report, self._done, part / schedule.most_steps), schedule)
        self._done += part
        if result is None or self._report(self._done):
            raise _Stopped
        if not all(np.isfinite(patch.points).all() for patch in result.patches):
            return None
        return Round(result, judged(result), self._number, schedule)

    def is_good(self, found: Round) -> bool:
        """Return whether nothing is left to better."""
        return found.judgement.meets_bars and not found.judgement.worse_than(self.old)

    def is_freer(self, old: Judgement, new: Judgement) -> bool:
        """Return whether less is hidden in a judgement than in an old one, and nothing else worse."""
        sees_more = new.hidden < old.hidden and new.shortfall < old.shortfall
        return sees_more and not new.worse_than(self.old) and (new.is_clean or not old.is_clean)

    def rank(self, found: Round) -> tuple[bool, float]:
        """The less the better, if folds can still be mended."""
        return bool(found.judgement.worse_than(self.old)), found.judgement.shortfall

    def final_rank(self, found: Round) -> tuple[bool, int, float]:
        """The less the better: folds and missed pins are seen at once, a background that moved is not."""
        judgement = found.judgement
        missed = judgement.misses_pins + (not judgement.is_clean)
        return bool(judgement.worse_than(self.old)), missed, judgement.shortfall


class _Steps:
    """Reports the steps of a round, each as ``size`` of the work, from ``done`` on."""

    def __init__(self, report: Report, done: float, size: float) -> None:
        self._report, self._done, self._size = report, done, size

    def __call__(self) -> bool:
        self._done += self._size
        return self._report(self._done)
