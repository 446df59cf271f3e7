# SPDX-License-Identifier: GPL-3.0-or-later
"""Aiming: control surfaces from pins, by Gauss–Newton steps with Levenberg and Marquardt's damping.

The targets of the pins move from the start's own image to what is wanted (a homotopy), a few steps each, so
that each step stays where the linearisation holds. Then steps follow until they move nothing. A drag takes
a step an event, from where the last one ended.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace

import numpy as np

from ...projection.arrays import median
from ...projection.typing import Array
from .banded import Normal, Rows
from .control_net import Along, ControlNet, NetBasis
from .detour_energy import DetourEnergy
from .fold_barrier import LEAST_JACOBIAN, FoldBarrier
from .homotopy import Homotopy
from .line_energy import LineEnergy
from .pin_energy import PinEnergy, PinTargets
from .problem import AimPins, AimProblem, AimResult, FindHits, FirstHits, SolvePlan
from .stay_energy import LAST_T, StayEnergy
from .thin_plate import ThinPlate
from .vectors import cross, dot

# Steps at the end are enough when no fold is left and the control points move by less than so many pixels, or
# when, once folds were looked for, so many steps in turn have ended less than this share below the least
# energy. Detours go on: projectors bend round a thing by many small gains.
SETTLED = 1.0
LEAST_GAIN, SMALL_GAINS = 5e-3, 2
# The last steps are proximal (Rockafellar 1976): a move of a pixel costs the square of this. It moves nothing
# from where the energy is least, but what is weakly held cannot swing into folds.
PROXIMAL = 0.03
# The longest move of a control point in a step, as a share of the image's width where the pins are.
LONGEST_MOVE = 0.6
# A way ends when so many steps in turn have found nothing better: one may fail where what is seen changes.
STUCK = 2
# Damping: at first, its limits, its factors after good and bad steps, and the attempts at a step.
DAMPING, LEAST_DAMPING, RAISED_DAMPING = 1e-5, 1e-7, 1e-3
EASED, TIGHTENED, ATTEMPTS = 0.5, 8.0, 5
# Drags and mending go a little way only, where the least damping of a long way would let what is weakly held
# swing. An event of a drag that is behind by more pixels takes further steps, at most so many in all.
DRAG_DAMPING, MENDING_DAMPING, BEHIND, DRAG_STEPS = 1e-3, 1e-2, 1.0, 3
# The least t of pins.
FIRST_T = 0.05
# Projectors along x and y on which folds are tested, and a finer grid on which they are looked for after each
# so many of the last steps; those found are tested from then on.
FOLD_GRID, FINE_GRID, FOLD_SEARCH = (32, 18), (96, 48), 4
# Found are those whose scaled Jacobian is below this share of the barrier's bound. A way that mends looks at
# the pixels of an image of so many columns; its share, and that above which nothing is left to mend.
FOUND, MENDED_COLUMNS, MENDED_FOUND, MENDED = 0.2, 192, 1.0, 0.7
# Stays and folds are told what projectors see before the first of so many steps.
LOOK = 2


class Aim:
    """A problem being solved. points: (net points, surfaces, 3), the control points so far."""

    def __init__(self, problem: AimProblem, schedule: SolvePlan | None = None) -> None:
        self.problem, self.schedule = problem, schedule or SolvePlan()
        plan, weights = self.schedule, problem.weights
        names = ("pin", "stay", "robust", "fold", "detour")
        factors = {name: getattr(weights, name) * getattr(plan, name) for name in names}
        self.weights = weights = replace(weights, **factors)
        rows, columns = problem.patches[0].points.shape[:2]
        self.net = ControlNet(columns, rows, len(problem.patches))
        self.start = self.net.gather(problem.patches)
        self.points = self.start.copy()
        self.least_damping = MENDING_DAMPING if plan.mends else LEAST_DAMPING
        self.damping = max(DAMPING, self.least_damping)
        self.steps, self.fold_grid = 0, self._grid(FOLD_GRID)
        self.orientation = _usual_orientation(self.fold_grid, self.start)
        # How many of the last steps in turn have gained little, the cost of a move, and the least energy.
        self.small_gains, self.proximal, self.least = 0, 0.0, np.inf
        self._begin_pins(problem.pins)
        self.footprints = self._footprints()
        self.plate = ThinPlate(self.net, weights, self.footprints)
        stays = (StayEnergy(self.net, s, weights, self.points, problem.width) for s in problem.stays)
        # Energies of nothing would only cost time.
        self.stays = [each for each in stays if len(each.listed)]
        self.folds = [FoldBarrier(self.fold_grid, self.orientation)]
        self.fold_strength = weights.fold
        if problem.solved is not None:
            self.points, self.t = self.net.gather(problem.solved.patches), problem.solved.t.copy()

    def _grid(self, counts: tuple[int, int]) -> NetBasis:
        return self.net.grid(*(np.linspace(0.0, 1.0, count) for count in counts))

    def _find_folds(self) -> float:
        """Test the folds between the tested projectors, too. Returns the least scaled Jacobian of all."""
        if self.schedule.mends:
            columns, rows = MENDED_COLUMNS, max(1, round(MENDED_COLUMNS / self.problem.aspect))
            grid = self.net.grid(*((np.arange(count) + 0.5) / count for count in (columns, rows)))
        else:
            grid = self._grid(FINE_GRID)
        t = None
        if self.problem.first_hits is not None:
            t = self.problem.first_hits(grid.controls(self.points)[0]).t
            t = _farthest_near(t, grid) if self.schedule.mends else t
        fine = FoldBarrier(grid, self.orientation, t)
        worst = fine.worst(self.points)
        folded = np.flatnonzero(worst < (MENDED_FOUND if self.schedule.mends else FOUND) * LEAST_JACOBIAN)
        if len(folded):
            found = fine.take(folded)
            # Among those of pixels are all of before that are not mended.
            if len(self.folds) > 1 and not self.schedule.mends:
                found = self.folds[1].joined(found)
            self.folds = [self.folds[0], found]
        return float(worst.min())

    @property
    def is_folded(self) -> bool:
        """Return whether a tested projector folds."""
        return any(fold.worst(self.points).min(initial=1.0) <= 0.0 for fold in self._barriers)

    @property
    def _barriers(self) -> list[FoldBarrier]:
        return [*self.folds, self.pin_folds]

    def _footprints(self) -> Array:
        """World units in a pixel on each moving surface of the start, (surfaces - 1,)."""
        nets = self.start.reshape(self.net.columns, self.net.rows, self.net.surfaces, 3)[:, :, 1:]
        spans = np.linalg.norm(np.diff(nets, axis=0), axis=3).sum(axis=0)
        return np.asarray(median(spans) / self.problem.width)

    def _begin_pins(self, pins: AimPins, last: Homotopy | None = None) -> None:
        """Find the way of the pins from the start. last: that of the last event of a drag."""
        places = self.net.at(*pins.positions)
        self.pins, self.way = pins, Homotopy(places, self.start, pins, self.problem.width, last)
        self.t = self.way.t
        footprint = self.way.footprint
        self.pin_energy = PinEnergy(places, pins, self.weights, self.t, footprint, self.problem.width)
        self.pin_folds = FoldBarrier(places, self.orientation)
        lines, detours = self.problem.lines, self.problem.detours
        has_lines, has_detours = lines.pins.shape[1] > 0, len(detours.pins) > 0
        self.lines = [LineEnergy(self.net, pins, lines, self.pin_energy)] if has_lines else []
        self.detours = [DetourEnergy(detours, self.pin_energy)] if has_detours else []

    def solve(self, is_cancelled: Callable[[], bool] | None = None) -> AimResult | None:
        """Solve from the old image to the wanted one; None if cancelled.

        From a solved result only the detours are on their way, and a way that mends ends when nothing folds.
        """
        plan, warm, stuck = self.schedule, self.problem.solved is not None, 0
        for stage in range(1, plan.stages + 1):
            share = stage / plan.stages
            targets = self.way.targets(1.0 if warm else share)
            for detours in self.detours:
                detours.share = share
            final = stage == plan.stages
            self.proximal, self.least = PROXIMAL if final and not warm else 0.0, np.inf
            for step in range(plan.final_steps if final else plan.steps):
                if is_cancelled is not None and is_cancelled():
                    return None
                growth = min(1.0, step / max(plan.final_steps - 4, 1)) if final else 0.0
                self.fold_strength = self.weights.fold * plan.fold_growth**growth
                if final and step % FOLD_SEARCH == (0 if plan.mends else FOLD_SEARCH - 1):
                    worst = self._find_folds()
                    if plan.mends and step > 0 and worst > MENDED * LEAST_JACOBIAN:
                        break
                moved = self.step(targets)
                stuck = stuck + 1 if moved == 0.0 else 0
                if final and stuck >= STUCK:
                    break
                gained = self.detours or step <= FOLD_SEARCH or self.small_gains < SMALL_GAINS
                if final and (moved < SETTLED or not gained) and not self.is_folded:
                    break
        return self.result()

    def drag(self, pins: AimPins) -> AimResult:
        """Follow pins that have moved a little, as many as before and in their order, mostly by one step."""
        t, home = self.t, self.pin_energy.home_t
        self._begin_pins(pins, self.way)
        self.t, self.pin_energy.home_t = t, home
        self.pin_folds.look(t)
        self.least_damping, self.damping = DRAG_DAMPING, max(self.damping, DRAG_DAMPING)
        self.proximal = 0.0
        for _ in range(DRAG_STEPS):
            self.step(self.way.targets(1.0))
            found = self.result()
            if not len(found.residuals) or median(found.residuals) <= BEHIND:
                break
        return found

    def step(self, targets: PinTargets) -> float:
        """Take a damped Gauss–Newton step. Returns the longest move of a control point in pixels."""
        if self.steps % LOOK == 0:
            self._look()
        self.steps += 1
        forces = self.plate.forces(self._offset(self.points))
        normal = Normal(self.net, self.plate.band.copy(), -forces.reshape(-1))
        pin_rows, elimination = self.pin_energy.linearise(self.points, self.t, targets)
        rows = [pin_rows, *(lines.linearise(self.points, targets) for lines in self.lines)]
        rows += [detours.linearise(self.points) for detours in self.detours]
        rows += [folds.linearise(self.points, self.fold_strength) for folds in self._barriers]
        normal.add(Rows.joined(rows))
        for stays in self.stays:
            normal.add_grid(stays.linearise(self.points))
        before = self._value(self.points, self.t, targets)
        normal.resist(self.proximal / self.footprints)
        longest = LONGEST_MOVE * self.problem.width
        for _ in range(ATTEMPTS):
            try:
                step = normal.solve(self.damping)
            except np.linalg.LinAlgError:
                self.damping = max(self.damping * TIGHTENED, RAISED_DAMPING)
                continue
            pixels = float(
                (np.abs(step).reshape(-1, len(self.footprints), 3) / self.footprints[:, None]).max()
            )
            step *= min(1.0, longest / max(pixels, 1e-300))
            points = self.net.moved(self.points, step)
            t = np.clip(self.t + elimination.slide(step), FIRST_T, LAST_T)
            after = self._value(points, t, targets)
            if after < before:
                self.small_gains = self.small_gains + 1 if after > (1.0 - LEAST_GAIN) * self.least else 0
                self.least = min(self.least, after)
                self.damping = max(self.damping * EASED, self.least_damping)
                self.points, self.t = points, t
                return min(pixels, longest)
            self.damping = max(self.damping * TIGHTENED, RAISED_DAMPING)
        self.small_gains += 1
        return 0.0

    def _look(self) -> None:
        """Let the stays and the barriers know what projectors see.

        Those of pins are kept from folding up to their points: beyond a fold nothing is shown.
        """
        self.pin_folds.look(self.t)
        find = self.problem.first_hits
        if find is None:
            return
        parts = [fold.places.controls(self.points)[0] for fold in self.folds]
        near = []
        for stays in self.stays:
            controls = stays.controls(self.points)[0]
            near.append(np.flatnonzero(find.may_meet_wanted(controls)))
            parts.append(controls[..., near[-1]])
        seen = _found_at_once(find, parts)
        self.folds[0].look(_farthest_near(seen[0].t, self.fold_grid))
        for fold, found in zip(self.folds[1:], seen[1:], strict=False):
            fold.look(found.t)
        for stays, which, found in zip(self.stays, near, seen[len(self.folds) :], strict=True):
            stays.hide(which, found)

    def _value(self, points: Array, t: Array, targets: PinTargets) -> float:
        total = self.pin_energy.value(points, t, targets)
        total += sum(lines.value(points, targets) for lines in self.lines)
        total += sum(detours.value(points) for detours in self.detours)
        total += sum(stays.value(points) for stays in self.stays)
        total += sum(folds.value(points, self.fold_strength) for folds in self._barriers)
        return float(total + self.plate.value(self._offset(points)))

    def _offset(self, points: Array) -> Array:
        """The displacements of the moving control points, (unknowns / 3, 3)."""
        offset: Array = (points - self.start)[:, 1:].reshape(-1, 3)
        return offset

    def result(self) -> AimResult:
        """The control surfaces so far."""
        residuals = pin_residuals(self.pin_energy, self.points, self.t, self.pins.points, self.problem)
        return AimResult(self.net.patches(self.points), self.t.copy(), residuals, self.steps)


def _usual_orientation(grid: NetBasis, points: Array) -> float:
    """The sign of the determinant where nothing folds."""
    middle = Along.of(grid.controls(points), np.full(grid.count, 0.5))
    return float(np.sign(dot(cross(middle.du, middle.dv), middle.dt).sum()))


def _found_at_once(find: FindHits, parts: list[Array]) -> list[FirstHits]:
    """The first hits of each part of projectors (K, 3, N)."""
    hits = find(np.concatenate(parts, axis=2))
    ends = np.cumsum([part.shape[2] for part in parts])[:-1]
    return [FirstHits(*part) for part in zip(*(np.split(each, ends) for each in hits), strict=True)]


def _farthest_near(t: Array, grid: NetBasis) -> Array:
    """The largest t of each place of a grid and its eight neighbours: what one meets the next may pass."""
    wide = np.pad(t.reshape(len(grid.u), len(grid.v)), 1, mode="edge")
    along = np.maximum(np.maximum(wide[:-2], wide[1:-1]), wide[2:])
    found: Array = np.maximum(np.maximum(along[:, :-2], along[:, 1:-1]), along[:, 2:])
    return found.ravel()


def pin_residuals(energy: PinEnergy, points: Array, t: Array, wanted: Array, problem: AimProblem) -> Array:
    """Distances in the image, in pixels, (P,), by Newton's step from each pin's place to its point."""
    along = Along.of(energy.places.controls(points), t)
    jacobian = np.stack([along.du, along.dv, along.dt], axis=1)
    missing = (wanted - along.position).T[:, :, None]
    step = np.matmul(np.linalg.pinv(np.moveaxis(jacobian, 2, 0)), missing)[:, :, 0]
    result: Array = np.hypot(step[:, 0], step[:, 1] / problem.aspect) * problem.width
    return result


def solve(
    problem: AimProblem, is_cancelled: Callable[[], bool] | None = None, schedule: SolvePlan | None = None
) -> AimResult | None:
    """Solve a problem; None if cancelled."""
    return Aim(problem, schedule).solve(is_cancelled)
