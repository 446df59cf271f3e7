# SPDX-License-Identifier: GPL-3.0-or-later
"""Rounds of solving, each on another way from the old image to the new one, among which the judge chooses."""

from __future__ import annotations

from collections.abc import Callable
from contextlib import nullcontext, suppress
from dataclasses import replace
from time import monotonic
from typing import NamedTuple

import numpy as np

from ..casting.common.cancellation import Cancelled, Signal, also_cancelled_by
from .judge import Judgement
from .solver.gauss_newton import solve
from .solver.problem import AimProblem, AimResult, SolvePlan

# The way that is tried first, and others: stays that count more hold the background, while pins and the
# barrier hold their own against them, and stays that count less force no folds.
FIRST, STILL, LOOSE = SolvePlan(), SolvePlan(fold=2.0, pin=2.0, stay=2.0, robust=3.0), SolvePlan(stay=0.5)
# From a solved volume, with more weight on pins and stays: both come nearer to their places.
FIRM = SolvePlan(stages=1, final_steps=16, pin=3.0, stay=2.0)
# From a solved volume, the ways of detours round what hides pins. The second one frees most, the third one
# holds pins and background best.
_FREEING = SolvePlan(stages=4, final_steps=40)
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
    schedule: SolvePlan


# From a result to its judgement.
JudgeResult = Callable[[AimResult], Judgement]
# From the best round to the problem that frees its hidden pins, and the judge of that; None if nothing would.
Free = Callable[[Round], "tuple[AimProblem, JudgeResult] | None"]
# A round is reported as this share of the work that is left: most solves need one.
ROUND_SHARE = 0.7
# Told before each step how much is done, as a share; returns whether to stop.
Report = Callable[[float], bool]
# Seconds after which no further round begins, and one under way is dropped. The first one always ends.
BUDGET = 10.0


class Budget:
    """A signal that is set once the time for a solve is over. clock: tells seconds."""

    def __init__(self, seconds: float = BUDGET, clock: Callable[[], float] = monotonic) -> None:
        self._clock, self._end = clock, clock() + seconds

    def is_set(self) -> bool:
        """Return whether the time is over."""
        return self._clock() >= self._end


def solve_in_rounds(
    problem: AimProblem,
    judged: JudgeResult,
    old: Judgement,
    report: Report = lambda share: False,
    free: Free = lambda found: None,
    budget: Signal | None = None,
) -> Round | None:
    """The best of the rounds, by the judge; None if stopped or if no round has a finite volume.

    old: the judgement of the image before; a round that is no worse wins over one that is. budget: ends the
    rounds with the best one so far. Where pins or the background miss their bars, the round goes on with more
    weight on both. The best one is mended if it folds, and if that fails stays count more, then less. Further
    rounds free hidden pins from where that ended.
    """
    rounds = _Rounds(old, report, budget or Budget(np.inf))
    try:
        with suppress(_Late):
            _try_ways(rounds, problem, judged)
        best = min(rounds.found, key=rounds.final_rank, default=None)
        freeing = None if best is None or rounds.budget.is_set() else free(best)
        if best is None or freeing is None:
            return best
        rounds.found.clear()
        with suppress(_Late):
            _free_pins(rounds, best, *freeing)
        return _freest(rounds, best)
    except _Stopped:
        return None


def _try_ways(rounds: _Rounds, problem: AimProblem, judged: JudgeResult) -> None:
    """Try ways from the start. Raises _Late, as everything that solves rounds does."""
    found = rounds.found
    _firmed(rounds, problem, judged, FIRST)
    best = min(found, key=rounds.rank, default=None)
    if best is None or not rounds.is_good(best):
        for way in [LOOSE] if best is None else other_ways(best.judgement):
            last = _firmed(rounds, problem, judged, way)
            if last is not None and not last.judgement.misses_pins:
                break
    if not found:
        return
    best = min(found, key=rounds.rank)
    # Where folds are left stays count more, then yield.
    _mended(rounds, problem, judged, best, [best.schedule, FIRST])
    for way in (STILL, LOOSE):
        is_clean = min(found, key=rounds.final_rank).judgement.is_clean
        if not is_clean and all(one.schedule != way for one in found):
            first = len(found)
            _firmed(rounds, problem, judged, way)
            for other in found[first:]:
                _mended(rounds, problem, judged, other, [other.schedule])


def _firmed(rounds: _Rounds, problem: AimProblem, judged: JudgeResult, way: SolvePlan) -> Round | None:
    """The round of a way, or else the one that brings its pins and stays nearer, if they miss their bars."""
    found = rounds.solve(problem, judged, way)
    if found is None or not (found.judgement.misses_pins or found.judgement.misses_background):
        return found
    return rounds.solve(replace(problem, solved=found.result), judged, FIRM) or found


def _mended(
    rounds: _Rounds, problem: AimProblem, judged: JudgeResult, folded: Round, ways: list[SolvePlan]
) -> None:
    """Mend a round on ways in turn, until it is clean; not if it is, or if too much is missing."""
    if not 0.0 < folded.judgement.unclean <= MENDABLE or folded.judgement.misses_pins:
        return
    for way in dict.fromkeys(ways):
        mended = rounds.solve(replace(problem, solved=folded.result), judged, way.mending())
        if mended and mended.judgement.is_clean:
            break


def _free_pins(rounds: _Rounds, best: Round, problem: AimProblem, judged: JudgeResult) -> None:
    """Try ways that free pins from where ``best`` ended.

    Where the first way frees nothing the others are not tried, nor where one leaves nothing to better.
    """
    for way in FREEING:
        _firmed(rounds, problem, judged, way)
        if all(one.judgement.hidden >= best.judgement.hidden for one in rounds.found):
            return
        if any(one.judgement.shortfall == 0.0 for one in rounds.found if rounds.is_freer(best, one)):
            return


def _freest(rounds: _Rounds, best: Round) -> Round:
    """The best of the rounds that free pins of ``best``; ``best`` itself if none is better.

    Their shortfalls are compared, also if ``best`` meets the bars: no bar counts hidden pins. Those that meet
    the bars win over others.
    """
    freer = [one for one in rounds.found if rounds.is_freer(best, one)]
    kept = [one for one in freer if one.judgement.meets_bars]
    return min([best, *(kept or freer)], key=lambda one: one.judgement.shortfall)


def other_ways(first: Judgement) -> list[SolvePlan]:
    """The ways that better what the first one missed, in turn."""
    if first.misses_pins:
        return [LOOSE, STILL]
    if first.unclean > FORCED:
        return [LOOSE]
    return [STILL] if first.misses_background else []


class _Stopped(Exception):
    """The user has stopped the solve."""


class _Late(Exception):
    """The budget is over."""


class _Rounds:
    """Solves rounds, reports them, and compares them.

    old: the judgement of the image before. found: the rounds so far.
    """

    def __init__(self, old: Judgement, report: Report, budget: Signal) -> None:
        self.old, self.budget, self._report = old, budget, report
        self.found: list[Round] = []
        self._done, self._number = 0.0, 0

    def solve(self, problem: AimProblem, judged: JudgeResult, schedule: SolvePlan) -> Round | None:
        """The next round; None if its volume is not finite.

        Raises _Stopped, or _Late if the budget is over before a round other than the first has ended.
        """
        self._number += 1
        part = ROUND_SHARE * (1.0 - self._done)
        steps = _Steps(self._stops, self._done, part / schedule.most_steps)
        try:
            with nullcontext() if self._number == 1 else also_cancelled_by(self.budget):
                result = solve(problem, steps, schedule)
                self._done += part
                if result is None or self._stops(self._done):
                    raise Cancelled
                if not all(np.isfinite(patch.points).all() for patch in result.patches):
                    return None
                found = Round(result, judged(result), self._number, schedule)
        except Cancelled:
            if self._report(self._done):
                raise _Stopped from None
            if self._number > 1 and self.budget.is_set():
                raise _Late from None
            raise
        self.found.append(found)
        return found

    def _stops(self, share: float) -> bool:
        """Report the work done; return whether a round ends at that."""
        return self._report(share) or (self._number > 1 and self.budget.is_set())

    def is_good(self, found: Round) -> bool:
        """Return whether nothing is left to better."""
        return found.judgement.meets_bars and not found.judgement.worse_than(self.old)

    def is_freer(self, best: Round, found: Round) -> bool:
        """Return whether less is hidden in a round than in an older one, and nothing else worse."""
        old, new = best.judgement, found.judgement
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
