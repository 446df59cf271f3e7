# SPDX-License-Identifier: GPL-3.0-or-later
"""The choice among rounds, with a solver that returns given judgements in turn."""

from dataclasses import replace
from threading import Event

import numpy as np
import pytest

from scfpf_addon.aim import rounds
from scfpf_addon.aim.judge import Judgement
from scfpf_addon.aim.solver.problem import AimPins, AimProblem, AimResult
from scfpf_addon.casting.common.cancellation import Cancelled, cancelled_by, raise_if_cancelled
from scfpf_addon.projection.surfaces.nurbs import NurbsPatch


def judgement(pixels=0.1, moved=1.0, mirrored=0.0, folded=0.0, hidden=0):
    by = np.full(10, -1)
    by[:hidden] = 3
    pins = np.full(10, float(pixels)), np.zeros(10), by < 0, by
    return Judgement(*pins, mirrored, folded, np.full(50, float(moved)))


OLD = judgement(pixels=60.0, moved=0.0)
PATCH = NurbsPatch(np.zeros((4, 4, 3)))
PROBLEM = AimProblem((PATCH,), 1920, 2.0, AimPins(np.zeros((3, 10)), np.zeros((2, 10))))
FIRM, MEND = rounds.FIRM, rounds.FIRST.mending()
# Where mending fails, stays count more, and then yield. What then folds is mended.
STRICTER, YIELDING = ([way, way.mending()] for way in (rounds.STILL, rounds.LOOSE))


@pytest.fixture
def chosen(monkeypatch):
    """From judgements of the rounds to the number of the one chosen and the ways that were solved."""

    def choose(found, report=lambda share: False, budget=None):
        solved = []

        def fake(problem, is_cancelled, schedule):
            solved.append(schedule)
            assert (problem.solved is not None) == (schedule.mends or schedule == FIRM)
            result = AimResult((PATCH,), np.zeros(10), np.zeros(10), len(solved))
            return None if is_cancelled() else result

        monkeypatch.setattr(rounds, "solve", fake)
        best = rounds.solve_in_rounds(
            PROBLEM, lambda result: found[result.steps - 1], OLD, report, budget=budget
        )
        return best and best.number, solved

    return choose


def test_the_first_that_meets_the_bars_ends_the_rounds(chosen):
    good = judgement(hidden=2)
    assert good.meets_bars and good.shortfall == 0.2 / 0.5
    assert chosen([good, judgement(), judgement()]) == (1, [rounds.FIRST])
    assert chosen([judgement(folded=0.001), good, judgement()]) == (2, [rounds.FIRST, MEND])


def test_without_one_the_least_shortfall_wins(chosen):
    # log2 (8 / 2) and log2 (4 / 2) of the median background.
    assert judgement(moved=8.0).shortfall == 2.0
    for best in range(4):
        moved = np.where(np.arange(4) == best, 4.0, 8.0)
        ways = [rounds.FIRST, FIRM, rounds.STILL, FIRM]
        assert chosen([judgement(moved=each) for each in moved]) == (best + 1, ways)


def test_what_is_missed_by_a_little_is_brought_nearer(chosen):
    for missed in (judgement(pixels=0.6), judgement(moved=2.5)):
        assert chosen([missed, judgement()]) == (2, [rounds.FIRST, FIRM])


def test_a_clean_one_wins_over_one_that_folds(chosen):
    far, folded = judgement(moved=8.0), judgement(folded=0.001)
    assert folded.shortfall == 0.5 < far.shortfall
    # The one that folds is nearer, so it is mended; where that fails, the clean one is taken.
    ways = [rounds.FIRST, FIRM, FIRM.mending(), MEND]
    assert chosen([far, folded, judgement(moved=4.0)]) == (3, ways[:3])
    assert chosen([far, folded, folded, judgement(moved=16.0)]) == (1, ways)
    assert chosen([far, folded, folded, judgement(moved=4.0)]) == (4, ways)
    # A fold and missed pins are two faults; where pins are missed nothing is mended.
    missed = [judgement(pixels=2.0), *[judgement(pixels=1.9, folded=0.001)] * 5]
    assert chosen(missed) == (1, [rounds.FIRST, FIRM, rounds.LOOSE, FIRM, rounds.STILL, FIRM])


@pytest.mark.parametrize(
    ("first", "others"),
    [
        (judgement(moved=40.0), [FIRM, rounds.STILL, FIRM]),
        (
            judgement(moved=40.0, folded=0.001),
            [FIRM, rounds.STILL, FIRM, MEND, rounds.LOOSE, FIRM, rounds.LOOSE.mending(), FIRM.mending()],
        ),
        (judgement(folded=0.02), [rounds.LOOSE, MEND, *STRICTER]),
        (judgement(pixels=30.0), [FIRM, rounds.LOOSE, FIRM, rounds.STILL, FIRM]),
    ],
)
def test_what_the_first_way_misses_chooses_the_others(chosen, first, others):
    assert chosen([first] * 9)[1] == [rounds.FIRST, *others]


def test_where_mending_fails_stays_count_more_then_yield(chosen):
    folded, good = judgement(folded=0.001), judgement()
    ways = [rounds.FIRST, MEND, *STRICTER, *YIELDING]
    for count in range(2, 6):
        assert chosen([*[folded] * count, good]) == (count + 1, ways[: count + 1])
    # One that is clean wins, also over one whose background stays.
    assert chosen([folded, folded, judgement(moved=20.0), folded, folded])[0] == 3


def test_one_that_is_worse_than_before_loses(chosen):
    worse = judgement(mirrored=0.006)
    assert worse.worse_than(OLD) == "MIRRORED"
    # 20 pixels beside the bars are more doublings, but better than before.
    assert chosen([worse, judgement(pixels=40.0), worse])[0] == 2


def test_progress_rises_and_stops(chosen):
    shares = []
    bad = judgement(folded=0.001)
    chosen([bad] * 6, lambda share: bool(shares.append(share)))
    assert shares == sorted(shares) and 0.9 < shares[-1] <= 1.0
    assert chosen([bad] * 4, lambda share: share > 0.71) == (None, [rounds.FIRST, MEND])


class Clock:
    """A clock that goes on by a second at each look."""

    def __init__(self):
        self.seconds = 0

    def __call__(self):
        self.seconds += 1
        return self.seconds


def test_a_budget_is_over_when_its_clock_says_so():
    clock = Clock()
    budget = rounds.Budget(3, clock)
    assert [budget.is_set() for _ in range(4)] == [False, False, True, True]
    assert not rounds.Budget(np.inf, clock).is_set()


def test_the_best_so_far_is_taken_when_the_time_is_over(chosen):
    far, folded = judgement(moved=8.0), judgement(folded=0.001)
    all_ways = [rounds.FIRST, FIRM, FIRM.mending(), MEND]
    found = [far, folded, judgement(moved=4.0), far]
    assert chosen(found, budget=rounds.Budget(1000, Clock())) == (3, all_ways[:3])
    # After the first one a round looks once as it solves, and once as it ends. One under way is dropped.
    assert chosen(found, budget=rounds.Budget(2, Clock())) == (1, all_ways[:2])
    assert chosen(found, budget=rounds.Budget(3, Clock())) == (1, all_ways[:3])
    # The first one ends in any case.
    assert chosen(found, budget=rounds.Budget(0, Clock())) == (1, all_ways[:2])
    assert chosen([judgement()], budget=rounds.Budget(0, Clock())) == (1, all_ways[:1])


def test_rays_of_a_late_round_end_it_too(monkeypatch):
    """A judge casts; the budget cancels its rays, and what others cancel is no matter of the budget."""
    clock = Clock()
    result = AimResult((PATCH,), np.zeros(10), np.zeros(10), 1)
    monkeypatch.setattr(rounds, "solve", lambda *_: result)
    judged = []

    def judge(_result):
        judged.append(1)
        clock.seconds += 100 * (len(judged) > 1)
        raise_if_cancelled()
        return judgement(moved=8.0)

    best = rounds.solve_in_rounds(PROBLEM, judge, OLD, budget=rounds.Budget(50, clock))
    assert best.number == 1 and len(judged) == 2
    stop = Event()
    stop.set()
    with pytest.raises(Cancelled), cancelled_by(stop):
        rounds.solve_in_rounds(PROBLEM, judge, OLD)


def test_hidden_pins_are_freed_only_in_time(monkeypatch):
    result = AimResult((PATCH,), np.zeros(10), np.zeros(10), 1)
    monkeypatch.setattr(rounds, "solve", lambda *_: result)

    def free(_found):
        raise AssertionError("the time is over")

    hidden = judgement(hidden=4)
    budget = rounds.Budget(0, Clock())
    best = rounds.solve_in_rounds(PROBLEM, lambda _: hidden, OLD, free=free, budget=budget)
    assert best.judgement is hidden


@pytest.mark.parametrize(
    ("freed", "taken"),
    [
        # log2 (0.8 / 0.5) doublings beside 0.4 / 0.5.
        (judgement(pixels=0.8), True),
        (judgement(hidden=4), False),
        (judgement(pixels=20.0), False),
        # Nothing is freed at the price of a fold.
        (judgement(folded=0.0001), False),
        (judgement(mirrored=0.006), False),
    ],
)
def test_freed_pins_are_taken_if_the_image_is_better(monkeypatch, freed, taken):
    solved = []
    result = AimResult((PATCH,), np.zeros(10), np.zeros(10), 1)

    def fake(problem, report, way):
        solved.append((problem.width, way))
        return result

    monkeypatch.setattr(rounds, "solve", fake)
    hidden, narrow = judgement(hidden=4), replace(PROBLEM, width=100)
    best = rounds.solve_in_rounds(
        PROBLEM, lambda result: hidden, OLD, free=lambda found: (narrow, lambda result: freed)
    )
    # Where the first way frees nothing no other is tried. Pins that are missed are brought nearer.
    ways = rounds.FREEING[:1] if freed.hidden else rounds.FREEING
    nearer = [FIRM] if freed.misses_pins else []
    assert solved == [(1920, rounds.FIRST), *((100, each) for way in ways for each in (way, *nearer))]
    assert (best.judgement is freed) == taken


@pytest.mark.parametrize(
    ("freed", "taken", "count"),
    [
        # Nothing is left to better: no other way is tried.
        ([judgement()], 0, 1),
        ([judgement(pixels=0.6), judgement()], 1, 2),
        # One that keeps the bars wins, though its shortfall, 0.6, is more than log2 (0.55 / 0.5).
        ([judgement(pixels=0.55), judgement(pixels=0.55), *[judgement(hidden=3)] * 2], 2, 4),
    ],
)
def test_freed_pins_that_keep_the_bars_win(monkeypatch, freed, taken, count):
    solved = []

    def fake(problem, report, way):
        solved.append(way)
        return AimResult((PATCH,), np.zeros(10), np.zeros(10), len(solved))

    monkeypatch.setattr(rounds, "solve", fake)
    hidden = judgement(hidden=4)
    best = rounds.solve_in_rounds(
        PROBLEM,
        lambda result: hidden,
        OLD,
        free=lambda found: (PROBLEM, lambda result: freed[result.steps - 2]),
    )
    assert best.judgement is freed[taken] and len(solved) == 1 + count
