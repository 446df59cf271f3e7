# SPDX-License-Identifier: GPL-3.0-or-later
"""Aim's bars: single views on the demo's street and three other scenes, random sets of pins, and times.

    python3 dev.py bench --aim [--sets N] [--seed S] [--only PLACE] [--degree D]

Single views: at least 95 % of the pins within 0.5 px and all within 1.5 px at 1920 px, no mirrored pixel, no
fold before a hit, a background that moves by a median of 2 px and a 95th percentile of 25 px outside the
halo. Sets of 5 to 12 pins: 99 % solved of those shifted by up to 3 % and turned by up to 20°, and 90 %
without mirrored pixels of those up to 6 % and 40°; none worse than before is taken. Times are the thread's,
which do not count what BLAS does in other threads; OPENBLAS_NUM_THREADS=1 counts all.
"""

from __future__ import annotations

import argparse
import sys
from dataclasses import replace
from functools import cache
from pathlib import Path
from time import perf_counter, thread_time

import numpy as np

sys.path.insert(0, str(Path(__file__).resolve().parents[2]))

from benchmarks.aim.cases import (
    DEGREE,
    WIDTH,
    Place,
    Setting,
    figure,
    random_setting,
    room,
    street,
    terrain,
    view_setting,
)
from scfpf_addon.aim.rounds import Round
from scfpf_addon.aim.solver.gauss_newton import Aim

# Built once each: the street registers Blender's classes.
PLACES = {make.__name__: cache(make) for make in (street, room, terrain, figure)}
# Degrees to the left and above.
VIEWS = {"45°": (45.0, 10.0), "side": (90.0, 5.0), "above": (0.0, 60.0)}
# Random sets: degrees, shift.
SETS = ((20.0, 0.03), (40.0, 0.06))
DRAG_EVENTS, DRAG_PIXELS = 30, 10.0


def solved(case: Setting) -> tuple[Round, float, float]:
    """The best round and its seconds of the thread and of the clock, the judge's included."""
    clock, own = perf_counter(), thread_time()
    found = case.solved()
    assert found is not None
    return found, thread_time() - own, perf_counter() - clock


def view_line(title: str, case: Setting) -> str:
    """The figures of a single view, as a row of a table."""
    round_, own, clock = solved(case)
    found, pixels = round_.judgement, round_.judgement.pixels
    met = (pixels <= 0.5).mean() >= 0.95 and pixels.max() <= 1.5
    clean = found.mirrored == 0.0 and found.folded == 0.0
    still = found.background_median <= 2.0 and found.background_most <= 25.0
    marks = "".join("+" if good else "-" for good in (met, clean, still))
    return (
        f"| {title} | {np.median(pixels):.2f} / {pixels.max():.2f} | {100 * found.mirrored:.2f} % "
        f"| {100 * found.folded:.2f} % | {found.background_median:.1f} / {found.background_most:.1f} "
        f"| {found.seen.mean():.0%} | {np.nanmedian(found.angles):.1f} | {round_.number} "
        f"| {own:.2f} / {clock:.2f} | {marks} |"
    )


def drag_line(case: Setting) -> str:
    """Times and lags of a drag of all pins, 10 px an event."""
    aim = Aim(case.problem)
    aim.solve()
    times, lags = [], []
    for event in range(1, DRAG_EVENTS + 1):
        moved = case.problem.pins.positions + np.array([[DRAG_PIXELS * event / WIDTH], [0.0]])
        before = thread_time()
        result = aim.drag(replace(case.problem.pins, positions=moved))
        times.append(thread_time() - before)
        lags.append(float(np.median(result.residuals)))
    return (
        f"drag of {aim.net.unknowns} unknowns: {1000 * np.median(times):.1f} ms an event (thread), "
        f"behind by {np.median(lags):.2f} px at the median and {max(lags):.2f} px at most"
    )


def sets_line(place: Place, seeds: range, degrees: float, shift: float) -> str:
    """Solve random sets of pins, and count those that are met, clean, and refused as worse."""
    met = clean = refused = 0
    count = len(seeds)
    times = []
    for seed in seeds:
        case = random_setting(place, seed, degrees, shift)
        round_, own, _ = solved(case)
        found = round_.judgement
        times.append(own)
        good, unmirrored = bool(found.pixels.max() <= 0.5), found.mirrored == 0.0
        met += good
        clean += good and unmirrored
        refused += bool(found.worse_than(case.old))
    return (
        f"{count} sets to {degrees:.0f}° and {shift:.0%}: {met / count:.1%} solved, {clean / count:.1%} "
        f"without mirrored pixels, {refused / count:.1%} not taken, {np.median(times):.2f} s each (thread)"
    )


def main() -> None:
    """Print the tables."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--sets", type=int, default=20, help="random sets of each kind")
    parser.add_argument("--seed", type=int, default=0, help="of the first set")
    parser.add_argument("--only", choices=PLACES, help="one place")
    parser.add_argument("--degree", type=int, default=DEGREE, help="of the projectors of single views")
    options = parser.parse_args()
    print(
        "| view | px median / max | mirrored | folds | background 50 / 95 % | seen | ° | rounds | s | bars |"
    )
    print("|---|---|---|---|---|---|---|---|---|---|")
    for name, make in PLACES.items():
        if options.only in (None, name):
            place = make()
            for title, angles in VIEWS.items():
                print(view_line(f"{name}, {title}", view_setting(place, *angles, options.degree)), flush=True)
    place = PLACES[options.only or "figure"]()
    print(drag_line(view_setting(place, *VIEWS["45°"])))
    seeds = range(options.seed, options.seed + options.sets)
    for degrees, shift in SETS if seeds else ():
        print(sets_line(place, seeds, degrees, shift), flush=True)


if __name__ == "__main__":
    main()
