# SPDX-License-Identifier: GPL-3.0-or-later
"""The choice among rounds, with a solver that returns given judgements in turn."""

import numpy as np
import pytest

from scfpf_addon.casting.aim import rounds
from scfpf_addon.casting.aim.judge import Judgement
from scfpf_addon.projection.aim.problem import AimResult
from scfpf_addon.projection.surfaces.nurbs import NurbsPatch


def judgement(pixels=0.1, moved=1.0, mirrored=0.0, folded=0.0, hidden=0):
    by = np.full(10, -1)
    by[:hidden] = 3
    pins = np.full(10, float(pixels)), np.zeros(10), by < 0, by
    return Judgement(*pins, mirrored, folded, np.full(50, float(moved)))


OLD = judgement(pixels=60.0, moved=0.0)


@pytest.fixture
def chosen(monkeypatch):
    """From judgements of the rounds to the number of the one chosen and how many were solved."""

    def choose(found, report=lambda share: False):
        solved = []
        patch = NurbsPatch(np.zeros((4, 4, 3)))

        def fake(problem, is_cancelled, schedule):
            solved.append(schedule)
            result = AimResult((patch,), np.zeros(10), np.zeros(10), len(solved))
            return None if is_cancelled() else result

        monkeypatch.setattr(rounds, "solve", fake)
        best = rounds.solve_in_rounds(None, lambda result: found[result.steps - 1], OLD, report)
        return best and best.number, len(solved)

    return choose


def test_the_first_that_meets_the_bars_ends_the_rounds(chosen):
    good = judgement(hidden=2)
    assert good.meets_bars and good.shortfall == 0.2 / 0.5
    assert chosen([good, judgement(), judgement()]) == (1, 1)
    assert chosen([judgement(folded=0.001), good, judgement()]) == (2, 2)


def test_without_one_the_least_shortfall_wins(chosen):
    # log2 (8 / 2) of the median background, and 0.001 / 0.002 of what is mirrored.
    far, mirrored = judgement(moved=8.0), judgement(mirrored=0.001)
    assert far.shortfall == 2.0 and mirrored.shortfall == 0.5
    assert chosen([far, mirrored]) == (2, 2)
    assert chosen([mirrored, far, judgement(moved=50.0)]) == (1, 3)


@pytest.mark.parametrize(
    ("first", "others"),
    [
        (judgement(moved=40.0), [rounds.STILL]),
        (judgement(moved=40.0, folded=0.001), [rounds.STILL, rounds.LONG]),
        (judgement(folded=0.02), [rounds.LOOSE, rounds.LONG]),
        (judgement(pixels=30.0, folded=0.001), [rounds.LOOSE]),
    ],
)
def test_what_the_first_way_misses_chooses_the_others(monkeypatch, first, others):
    solved = []
    result = AimResult((NurbsPatch(np.zeros((4, 4, 3))),), np.zeros(10), np.zeros(10), 1)
    monkeypatch.setattr(rounds, "solve", lambda problem, report, way: solved.append(way) or result)
    rounds.solve_in_rounds(None, lambda result: first, OLD)
    assert solved == [rounds.FIRST, *others]


def test_one_that_is_worse_than_before_loses(chosen):
    worse = judgement(mirrored=0.006)
    assert worse.worse_than(OLD) == "MIRRORED"
    # 20 pixels beside the bars are more doublings, but better than before.
    assert chosen([worse, judgement(pixels=40.0), worse]) == (2, 3)


def test_progress_rises_and_stops(chosen):
    shares = []
    bad = judgement(folded=0.001)
    chosen([bad] * 3, lambda share: bool(shares.append(share)))
    assert shares == sorted(shares) and 0.9 < shares[-1] <= 1.0
    assert chosen([bad] * 3, lambda share: share > 0.71) == (None, 2)


@pytest.mark.parametrize(
    ("freed", "taken"),
    [
        # log2 (0.8 / 0.5) doublings beside 0.4 / 0.5.
        (judgement(pixels=0.8), True),
        (judgement(hidden=4), False),
        (judgement(pixels=20.0), False),
        (judgement(mirrored=0.006), False),
    ],
)
def test_freed_pins_are_taken_if_the_image_is_better(monkeypatch, freed, taken):
    solved = []
    result = AimResult((NurbsPatch(np.zeros((4, 4, 3))),), np.zeros(10), np.zeros(10), 1)
    monkeypatch.setattr(rounds, "solve", lambda problem, report, way: solved.append((problem, way)) or result)
    hidden = judgement(hidden=4)
    problem = object()
    best = rounds.solve_in_rounds(
        None, lambda result: hidden, OLD, free=lambda found: (problem, lambda result: freed)
    )
    assert solved == [(None, rounds.FIRST), (problem, rounds.FREEING)]
    assert (best.judgement is freed) == taken
