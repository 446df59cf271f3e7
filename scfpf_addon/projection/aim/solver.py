# SPDX-License-Identifier: GPL-3.0-or-later
"""Aiming: control surfaces from pins, by Gauss–Newton steps with Levenberg and Marquardt's damping.

The targets of the pins move from the start's own image to what is wanted (a homotopy), a few steps each, so
that each step stays where the linearisation holds. Then steps follow until they move nothing. A drag takes
one step an event, from where the last one ended.
"""

from __future__ import annotations

from collections.abc import Callable

import numpy as np

from ..arrays import median, product
from ..typing import Array
from .banded import Normal
from .control_net import Along, Net, Places
from .energies import (
    FIRST_T,
    FOOTPRINT_RANGE,
    LAST_T,
    LEAST_JACOBIAN,
    FoldEnergy,
    LineEnergy,
    PinEnergy,
    PinTargets,
    StayEnergy,
    across_of,
    dot,
    smoothness,
    unit,
)
from .problem import AimPins, AimProblem, AimResult

# The homotopy: its stages, the steps in each, and the steps at its end.
STAGES, STEPS, FINAL_STEPS = 8, 2, 24
# Steps at the end are enough when the control points move by less than so many pixels and no fold is left.
SETTLED = 1.0
# The barrier grows to this multiple during the last steps.
FOLD_GROWTH = 12.0
# The longest move of a control point in a step, as a share of the image's width where the pins are.
LONGEST_MOVE = 0.6
# Damping: at first, its limits, its factors after good and bad steps, and the attempts at a step.
DAMPING, LEAST_DAMPING, RAISED_DAMPING = 1e-5, 1e-7, 1e-4
EASED, TIGHTENED, ATTEMPTS = 0.3, 8.0, 5
# Where pins start on their projectors.
PIN_T = (0.2, 0.85)
# Projectors along x and y on which folds are tested, and a finer grid on which they are looked for after each
# so many of the last steps; those found are tested from then on.
FOLD_GRID, FINE_GRID, FOLD_SEARCH = (32, 18), (96, 48), 4


class Aim:
    """A problem being solved. points: (net points, surfaces, 3), the control points so far."""

    def __init__(self, problem: AimProblem) -> None:
        self.problem, weights = problem, problem.weights
        rows, columns = problem.patches[0].points.shape[:2]
        self.net = Net(columns, rows, len(problem.patches))
        self.start = self.net.gather(problem.patches)
        self.points = self.start.copy()
        self.damping, self.steps = DAMPING, 0
        self._begin_pins(problem.pins)
        self.footprints = self._footprints()
        self.stiffness = smoothness(self.net, weights, self.footprints)
        # Its blocks of 3 × 3 are multiples of 1.
        self.thin_plate = np.ascontiguousarray(self.stiffness[::3, ::3])
        self.stays = StayEnergy(self.net, problem.stays, weights, self.points, problem.width)
        places = self._grid(FOLD_GRID)
        middle = Along.of(places.controls(self.points), np.full(len(places.column), 0.5))
        orientation = float(np.sign(dot(np.cross(middle.du, middle.dv), middle.dt).sum()))
        self.folds = FoldEnergy(places, orientation, weights.fold)

    def _grid(self, counts: tuple[int, int]) -> Places:
        axes = [np.linspace(0.0, 1.0, count) for count in counts]
        u, v = (a.ravel() for a in np.meshgrid(*axes, indexing="ij"))
        return self.net.at(u, v)

    def _add_folds(self) -> None:
        """Test the folds between the tested projectors, too."""
        fine = FoldEnergy(self._grid(FINE_GRID), self.folds.orientation, self.folds.strength)
        if self.problem.first_hits is not None:
            controls = fine.places.controls(self.points)[0]
            fine.look(self.problem.first_hits(np.ascontiguousarray(controls.transpose(1, 2, 0))).t)
        folded = np.flatnonzero(fine.worst(self.points) < 0.2 * LEAST_JACOBIAN)
        if len(folded):
            self.folds = self.folds.joined(fine.places.take(folded))

    def _footprints(self) -> Array:
        """World units in a pixel on each moving surface of the start, (surfaces - 1,)."""
        nets = self.start.reshape(self.net.columns, self.net.rows, self.net.surfaces, 3)[:, :, 1:]
        spans = np.linalg.norm(np.diff(nets, axis=0), axis=3).sum(axis=0)
        return np.asarray(median(spans) / self.problem.width)

    def _begin_pins(self, pins: AimPins) -> None:
        """Find the pins' projectors in the start, and where on them they begin."""
        width = self.problem.width
        places = self.net.at(*pins.positions)
        controls = places.controls(self.start)
        near = controls[0, :, 0]
        distance = np.linalg.norm(pins.points.T - near, axis=1)
        t = np.clip(_t_at_distance(controls, distance), *PIN_T)
        along = Along.of(controls, t)
        tangent = unit(along.dt)
        across, upward = across_of(along.du, tangent), across_of(along.dv, tangent)
        self.old = PinTargets(along.position, tangent, across, upward)
        self.t = t
        footprint = np.sqrt(dot(across, across)) / width
        typical = float(median(footprint)) if len(footprint) else 1.0
        footprint = np.clip(footprint, typical / FOOTPRINT_RANGE, typical * FOOTPRINT_RANGE)
        self.pin_energy = PinEnergy(places, pins, self.problem.weights, t, footprint, width)
        self.pins = pins
        self.lines = LineEnergy(self.net, pins, self.problem.lines, self.pin_energy)

    def targets(self, share: float) -> PinTargets:
        """The aims of the pins at a share of the way from the old image to the wanted one."""
        old, pins = self.old, self.pins
        directions = np.where(np.isfinite(pins.directions), pins.directions, old.directions.T).T
        across = np.where(np.isfinite(pins.across), pins.across, old.across.T).T
        upward = np.where(np.isfinite(pins.upward), pins.upward, old.upward.T).T
        turned = turn_between(old.directions, unit(directions), share)
        return PinTargets(
            old.points + share * (pins.points.T - old.points),
            turned,
            across_of(old.across + share * (across - old.across), turned),
            across_of(old.upward + share * (upward - old.upward), turned),
        )

    def solve(self, is_cancelled: Callable[[], bool] | None = None) -> AimResult | None:
        """Solve from the old image to the wanted one; None if cancelled."""
        for stage in range(1, STAGES + 1):
            targets = self.targets(stage / STAGES)
            final = stage == STAGES
            for step in range(FINAL_STEPS if final else STEPS):
                if is_cancelled is not None and is_cancelled():
                    return None
                growth = FOLD_GROWTH ** min(1.0, step / (FINAL_STEPS - 4)) if final else 1.0
                self.folds.strength = self.problem.weights.fold * growth
                if final and step % FOLD_SEARCH == FOLD_SEARCH - 1:
                    self._add_folds()
                moved = self.step(targets)
                if final and moved < SETTLED and self.folds.worst(self.points).min() > 0.0:
                    break
        return self.result()

    def drag(self, pins: AimPins) -> AimResult:
        """Take one step to pins that have moved a little, as many as before and in their order."""
        t = self.t
        home = self.pin_energy.home_t
        self._begin_pins(pins)
        self.t, self.pin_energy.home_t = t, home
        self.step(self.targets(1.0))
        return self.result()

    def step(self, targets: PinTargets) -> float:
        """Take a damped Gauss–Newton step. Returns the longest move of a control point in pixels."""
        self._look()
        normal = Normal(self.net, self.stiffness.copy(), -self._forces(self.points)[1].reshape(-1))
        pin_rows, elimination = self.pin_energy.linearise(self.points, self.t, targets)
        normal.add(pin_rows)
        normal.add(self.lines.linearise(self.points, targets))
        normal.add(self.stays.linearise(self.points))
        normal.add(self.folds.linearise(self.points))
        before = self._value(self.points, self.t, targets)
        longest = LONGEST_MOVE * self.problem.width
        self.steps += 1
        for _ in range(ATTEMPTS):
            step = normal.solve(self.damping)
            pixels = float(
                (np.abs(step).reshape(-1, len(self.footprints), 3) / self.footprints[:, None]).max()
            )
            step *= min(1.0, longest / max(pixels, 1e-300))
            points = self.net.moved(self.points, step)
            t = np.clip(self.t + elimination.slide(step), FIRST_T, LAST_T)
            if self._value(points, t, targets) < before:
                self.damping = max(self.damping * EASED, LEAST_DAMPING)
                self.points, self.t = points, t
                return min(pixels, longest)
            self.damping = max(self.damping * TIGHTENED, RAISED_DAMPING)
        return 0.0

    def _look(self) -> None:
        """Let the stays and the fold samples know what projectors see."""
        if self.problem.first_hits is None:
            return
        count = len(self.folds.places.column)
        controls = [energy.places.controls(self.points)[0] for energy in (self.folds, self.stays)]
        hits = self.problem.first_hits(np.ascontiguousarray(np.concatenate(controls).transpose(1, 2, 0)))
        self.folds.look(hits.t[:count])
        self.stays.hide(hits.t[count:], hits.wanted[count:])

    def _value(self, points: Array, t: Array, targets: PinTargets) -> float:
        offset, forces = self._forces(points)
        total = self.pin_energy.value(points, t, targets) + self.lines.value(points, targets)
        total += self.stays.value(points) + self.folds.value(points)
        return float(total + (offset * forces).sum())

    def _forces(self, points: Array) -> tuple[Array, Array]:
        """The displacements of the moving control points, (N, 3), and half their energy's gradient."""
        offset = (points - self.start)[:, 1:].reshape(-1, 3)
        return offset, product(self.thin_plate, offset)

    def result(self) -> AimResult:
        """The control surfaces so far."""
        residuals = pin_residuals(self.pin_energy, self.points, self.t, self.pins.points.T, self.problem)
        return AimResult(self.net.patches(self.points), self.t.copy(), residuals, self.steps)


def pin_residuals(energy: PinEnergy, points: Array, t: Array, wanted: Array, problem: AimProblem) -> Array:
    """Distances in the image, in pixels, (P,), by Newton's step from each pin's place to its point."""
    along = Along.of(energy.places.controls(points), t)
    jacobian = np.stack([along.du, along.dv, along.dt], axis=2)
    step = np.matmul(np.linalg.pinv(jacobian), (wanted - along.position)[:, :, None])[:, :, 0]
    result: Array = np.hypot(step[:, 0], step[:, 1] / problem.aspect) * problem.width
    return result


def turn_between(start: Array, end: Array, share: float) -> Array:
    """Unit vectors (N, 3) a share of the way on great circles from ``start`` to ``end``."""
    side = across_of(end, start)
    lengths = np.sqrt(dot(side, side))
    angle = share * np.arctan2(lengths, dot(start, end))
    # Opposite vectors have no great circle of their own: any side will do.
    other = np.eye(3)[np.abs(start).argmin(axis=1)] if len(start) else np.zeros((0, 3))
    side = unit(np.where((lengths > 1e-9)[:, None], side, across_of(other, start)))
    result: Array = start * np.cos(angle)[:, None] + side * np.sin(angle)[:, None]
    return result


def _t_at_distance(controls: Array, distance: Array) -> Array:
    """The t (N,) at which projectors have these distances from their near points."""
    t = np.linspace(0.0, 1.0, 97)
    many = np.repeat(controls[:, :, None], len(t), axis=2).reshape(
        3, len(distance) * len(t), *controls.shape[2:]
    )
    position = Along.of(many, np.tile(t, len(distance))).position.reshape(len(distance), len(t), 3)
    away = np.linalg.norm(position - controls[0, :, :1], axis=2)
    nearest = np.abs(away - distance[:, None]).argmin(axis=1)
    row = np.arange(len(distance))
    # Newton's step from the nearest sample.
    slope = np.gradient(away, t, axis=1)[row, nearest]
    found: Array = t[nearest] - (away[row, nearest] - distance) / np.maximum(slope, 1e-300)
    return np.clip(found, 0.0, 1.0)


def solve(problem: AimProblem, is_cancelled: Callable[[], bool] | None = None) -> AimResult | None:
    """Solve a problem; None if cancelled."""
    return Aim(problem).solve(is_cancelled)
