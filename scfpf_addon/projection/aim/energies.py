# SPDX-License-Identifier: GPL-3.0-or-later
"""The energies of aiming: residuals in pixels of pins, lines and stays, smoothness, and a fold barrier.

Each energy is a sum of squares. It gives its value, and its residuals linearised by the control points (Gauss
and Newton). A parameter t that belongs to one residual alone is eliminated from them, by the Schur complement
for pins, and for stays by projection along the projector (Golub and Pereyra's variable projection): Q stays
linear in what is left, which makes the few steps suffice.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from ..typing import Array, BoolArray, IndexArray
from .banded import Rows
from .control_net import Along, Net, Places
from .problem import AimLines, AimPins, AimStays, AimWeights

DEGREES = 180.0 / np.pi
# Projectors do not use these shares of t at their ends: pins need projector on both sides.
FIRST_T, LAST_T = 0.05, 0.98
# Pieces of a line between whose ends projectors shall meet it.
LINE_SAMPLES = 12
# The longest change of a t in a step.
LONGEST_SLIDE = 0.1
# Footprints of pixels are limited to this factor about that of the start, since they divide.
FOOTPRINT_RANGE = 10.0
# The scaled Jacobian det / (|Qu| |Qv| |Qt|) is kept above this; it is 1 for a right-angled frame.
LEAST_JACOBIAN = 0.15
# Shares of the way to the first hit at which folds are tested. A little more than 1: the hit itself counts.
FOLD_SHARES = (0.12, 0.3, 0.5, 0.7, 0.85, 0.95, 1.01)


def dot(a: Array, b: Array) -> Array:
    """Dot products of the last axes."""
    found: Array = np.einsum("...c,...c->...", a, b)
    return found


def unit(vectors: Array) -> Array:
    """Vectors of length 1; zero stays zero."""
    result: Array = vectors / np.maximum(np.sqrt(dot(vectors, vectors)), 1e-300)[..., None]
    return result


def across_of(vectors: Array, tangents: Array) -> Array:
    """The parts of vectors (N, 3) perpendicular to unit tangents (N, 3)."""
    result: Array = vectors - dot(vectors, tangents)[:, None] * tangents
    return result


class PinTargets(NamedTuple):
    """The points and frames that pins aim at, (P, 3) each. The last three count where they are wanted."""

    points: Array
    directions: Array
    across: Array
    upward: Array


class PinEnergy:
    """Pins at their places: distance, direction and frame, with one t a pin.

    footprint: (P,) world units in a pixel at the start.
    """

    def __init__(
        self, places: Places, pins: AimPins, weights: AimWeights, t: Array, footprint: Array, width: int
    ) -> None:
        self.places, self.width = places, width
        self.weights, self.home_t, self.footprint = weights, t.copy(), footprint
        self.strength = pins.weights
        self.has_direction: BoolArray = np.isfinite(pins.directions).all(axis=0)
        self.has_frame: BoolArray = np.isfinite(pins.across).all(axis=0) & np.isfinite(pins.upward).all(
            axis=0
        )

    def residuals(self, points: Array, t: Array, targets: PinTargets) -> tuple[Array, Array, Along, Array]:
        """Residuals (P, 10), the vectors (P, 10, 3) that they measure along, samples and controls."""
        controls = self.places.controls(points)
        along = Along.of(controls, t)
        e1 = unit(across_of(targets.across, targets.directions))
        e2 = np.cross(targets.directions, e1)
        vectors = np.zeros((len(t), 10, 3))
        vectors[:, :3] = np.eye(3) * (self.weights.pin * self.strength / self.footprint)[:, None, None]
        turn = self.weights.direction * DEGREES * self.strength * self.has_direction
        speed = np.sqrt(dot(along.dt, along.dt))
        tangent = along.dt / speed[:, None]
        # The derivative of the unit tangent is the part of that of Qt perpendicular to it.
        sideways = np.eye(3) - tangent[:, :, None] * tangent[:, None]
        vectors[:, 3:6] = sideways * (turn / speed)[:, None, None]
        frame = 100.0 * self.weights.frame * self.strength * self.has_frame
        for first, wanted in ((6, targets.across), (8, targets.upward)):
            scale = (frame / np.maximum(np.sqrt(dot(wanted, wanted)), 1e-300))[:, None]
            vectors[:, first], vectors[:, first + 1] = e1 * scale, e2 * scale
        missing = np.zeros((len(t), 10, 3))
        missing[:, :3] = (targets.points - along.position)[:, None]
        missing[:, 6:8] = (targets.across - along.du)[:, None]
        missing[:, 8:] = (targets.upward - along.dv)[:, None]
        residuals = dot(vectors, missing)
        residuals[:, 3:6] = (targets.directions - tangent) * turn[:, None]
        return residuals, vectors, along, controls

    def value(self, points: Array, t: Array, targets: PinTargets) -> float:
        """The energy."""
        residuals = self.residuals(points, t, targets)[0]
        depth = self.weights.depth * self.strength * (t - self.home_t)
        return float((residuals**2).sum() + (depth**2).sum())

    def linearise(self, points: Array, t: Array, targets: PinTargets) -> tuple[Rows, Elimination]:
        """The rows without t, and what gives the change of t of a step.

        min over s of |A x + b s - r|² + w² (s - e)² is |P (A x - r + b e)|² with P = 1 - b bᵀ / (|b|² + w²),
        the Schur complement; its root is 1 - β b bᵀ.
        """
        residuals, vectors, along, controls = self.residuals(points, t, targets)
        count = len(t)
        kinds = (0, 0, 0, 0, 0, 0, 1, 1, 2, 2)
        functions = (along.value,) * 3 + (along.slope,) * 3 + (along.value,) * 4
        parts = zip(kinds, functions, vectors.swapaxes(0, 1), strict=True)
        rows = np.stack([self.places.rows_of(*part) for part in parts], axis=1)
        bend = along.bend(controls, t)
        ut, vt = np.matmul(along.slope[:, None], controls[1:])[:, :, 0]
        slopes = np.stack([along.dt] * 3 + [bend] * 3 + [ut] * 2 + [vt] * 2, axis=1)
        by_t = dot(vectors, slopes)
        back = self.home_t - t
        residuals = residuals - by_t * back[:, None]
        square, depth = dot(by_t, by_t), (self.weights.depth * self.strength) ** 2
        elimination = Elimination(self.places, rows, residuals, by_t, square + depth, back)
        beta = (1.0 - np.sqrt(depth / (square + depth))) / np.maximum(square, 1e-300)
        onto = beta[:, None] * by_t
        reduced = rows - onto[:, :, None] * np.matmul(by_t[:, None], rows)
        right = residuals - onto * dot(by_t, residuals)[:, None]
        # Rows of weight 0 would only cost time.
        used = np.ones((count, 10), bool)
        used[:, 3:6], used[:, 6:] = self.has_direction[:, None], self.has_frame[:, None]
        pin, _ = np.nonzero(used)
        return Rows(self.places.column[pin], self.places.row[pin], reduced[used], right[used]), elimination


class Elimination(NamedTuple):
    """The rows of pins with their t, from which a step's change of t follows."""

    places: Places
    rows: Array
    residuals: Array
    by_t: Array
    square: Array
    back: Array

    def slide(self, step: Array) -> Array:
        """The change of each t, (P,), that belongs to a step of the control points."""
        net = self.places.net
        local = step.reshape(net.points, -1)[self.places.acting].reshape(len(self.back), -1)
        left = self.residuals - np.matmul(self.rows, local[:, :, None])[:, :, 0]
        change: Array = self.back + dot(self.by_t, left) / self.square
        return np.clip(change, -LONGEST_SLIDE, LONGEST_SLIDE)


class StayEnergy:
    """Stays on their projectors, by the robust distance of Geman and McClure (1987): r² / (1 + (r / c)²)."""

    def __init__(self, net: Net, stays: AimStays, weights: AimWeights, points: Array, width: int) -> None:
        self.places = net.at(*stays.positions)
        self.points, self.weights, self.width = stays.points.T, weights, width
        self.strength = stays.weights
        self.t = nearest_t(self.places.controls(points), self.points)
        self.active = np.arange(len(self.t))
        self.old_tangent, self.least = self._measure(points, self.t)
        self.footprint = self.least

    def _measure(self, points: Array, t: Array) -> tuple[Array, Array]:
        along = Along.of(self.places.controls(points), t)
        tangent = unit(along.dt)
        perpendicular = across_of(along.du, tangent)
        return tangent, np.sqrt(dot(perpendicular, perpendicular)) / self.width

    def hide(self, hits_t: Array, wanted: BoolArray) -> None:
        """Drop the stays that pinned things hide in front of them."""
        hidden = wanted & (hits_t < self.t - 0.01)
        self.active = np.flatnonzero(~hidden & (self.strength > 1e-3))

    def _slid(self, controls: Array, t: Array, points: Array) -> tuple[Along, Array]:
        for _ in range(2):
            along = Along.of(controls, t)
            change = dot(points - along.position, along.dt) / np.maximum(dot(along.dt, along.dt), 1e-300)
            t = np.clip(t + np.clip(change, -LONGEST_SLIDE, LONGEST_SLIDE), 0.0, LAST_T)
        return Along.of(controls, t), t

    def _short(self, t: Array, miss: Array, tangent: Array) -> Array:
        """The lengths (N,) by which projectors end before their points, else 0."""
        short: Array = np.where(t >= LAST_T, np.maximum(dot(miss, tangent), 0.0), 0.0)
        return short

    def value(self, points: Array) -> float:
        """The energy, with the footprints of the last linearisation."""
        some = self.active
        places = self.places.take(some)
        along, t = self._slid(places.controls(points), self.t[some], self.points[some])
        tangent = unit(along.dt)
        miss = self.points[some] - along.position
        short = self._short(t, miss, tangent)
        miss = across_of(miss, tangent)
        square = (dot(miss, miss) + short**2) / self.footprint[some] ** 2
        robust = square / (1.0 + square / self.weights.robust**2)
        turn = across_of(self.old_tangent[some], tangent)
        angle = (self.weights.stay_direction * DEGREES) ** 2 * dot(turn, turn)
        share = 1.0 / (1.0 + square / self.weights.robust**2)
        return float(((self.weights.stay * self.strength[some]) ** 2 * (robust + angle * share**2)).sum())

    def linearise(self, points: Array) -> Rows:
        """The rows at the nearest t."""
        some = self.active
        places = self.places.take(some)
        along, self.t[some] = self._slid(places.controls(points), self.t[some], self.points[some])
        tangent = unit(along.dt)
        e1 = across_of(along.du, tangent)
        length = np.sqrt(dot(e1, e1))
        footprint = np.maximum(length / self.width, self.least[some] / FOOTPRINT_RANGE)
        self.footprint = self.footprint.copy()
        self.footprint[some] = footprint
        e1 = e1 / np.maximum(length, 1e-300)[:, None]
        e2 = np.cross(tangent, e1)
        miss = self.points[some] - along.position
        short = self._short(self.t[some], miss, tangent)
        square = (dot(miss, e1) ** 2 + dot(miss, e2) ** 2 + short**2) / footprint**2
        share = self.weights.stay * self.strength[some] / (1.0 + square / self.weights.robust**2)
        rows, residuals = [], []
        speed = np.sqrt(dot(along.dt, along.dt))
        turn = self.weights.stay_direction * DEGREES
        for e in (e1, e2):
            rows.append(places.rows_of(0, along.value, e * (share / footprint)[:, None]))
            residuals.append(dot(miss, e) * share / footprint)
            rows.append(places.rows_of(0, along.slope, e * (turn * share / speed)[:, None]))
            residuals.append(dot(self.old_tangent[some], e) * turn * share)
        ending = tangent * ((short > 0.0) * share / footprint)[:, None]
        rows.append(places.rows_of(0, along.value, ending))
        residuals.append(short * share / footprint)
        return Rows.of(places, np.stack(rows, axis=1), np.stack(residuals, axis=1))


class LineEnergy:
    """Lines of the scene that are straight in the image: projectors between two pins meet the line there.

    The distance of a projector from the line is measured at the nearest t, along n = L × Qt.
    """

    def __init__(self, net: Net, pins: AimPins, lines: AimLines, energy: PinEnergy) -> None:
        shares = np.arange(1, LINE_SAMPLES) / LINE_SAMPLES
        self.pins = np.repeat(lines.pins, len(shares), axis=1)
        share = np.tile(shares, lines.pins.shape[1])
        first, last = pins.positions[:, self.pins[0]], pins.positions[:, self.pins[1]]
        self.places = net.at(*(first + share * (last - first)))
        self.t = energy.home_t[self.pins[0]] * (1.0 - share) + energy.home_t[self.pins[1]] * share
        footprint = energy.footprint[self.pins].mean(axis=0)
        self.strength = energy.weights.line / footprint

    def _measure(self, points: Array, targets: PinTargets) -> tuple[Array, Array, Along, Array]:
        """Residuals (N,), the vectors (N, 3) that they measure along, samples, and t."""
        start = targets.points[self.pins[0]]
        along_line = unit(targets.points[self.pins[1]] - start)
        controls, t = self.places.controls(points), self.t
        for _ in range(2):
            along = Along.of(controls, t)
            off, way = across_of(along.position - start, along_line), across_of(along.dt, along_line)
            change = -dot(off, way) / np.maximum(dot(way, way), 1e-300)
            t = np.clip(t + np.clip(change, -LONGEST_SLIDE, LONGEST_SLIDE), 0.0, 1.0)
        along = Along.of(controls, t)
        vectors = unit(np.cross(along_line, along.dt)) * self.strength[:, None]
        return dot(vectors, start - along.position), vectors, along, t

    def value(self, points: Array, targets: PinTargets) -> float:
        """The energy."""
        residuals = self._measure(points, targets)[0]
        return float(residuals @ residuals)

    def linearise(self, points: Array, targets: PinTargets) -> Rows:
        """The rows at the nearest t."""
        residuals, vectors, along, self.t = self._measure(points, targets)
        rows = self.places.rows_of(0, along.value, vectors)
        return Rows(self.places.column, self.places.row, rows, residuals)


class FoldEnergy:
    """A barrier that keeps projectors from turning inside out before their first hit.

    The scaled Jacobian g is that of mesh quality (Knupp, 2000); below LEAST_JACOBIAN a hinge acts. Like the
    regularised barrier of Garanzha et al. (Foldover-free maps in 50 lines of code, 2021) it is finite in
    folds, so that the solver can leave them, and its strength grows as they go.
    """

    def __init__(self, places: Places, orientation: float, strength: float) -> None:
        self.places, self.orientation, self.strength = places, orientation, strength
        self.look(np.ones(len(places.column)))

    def look(self, hits_t: Array) -> None:
        """Test up to the first hits (N,)."""
        self.at: IndexArray = np.repeat(np.arange(len(hits_t)), len(FOLD_SHARES))
        ends = np.minimum(hits_t, 1.0)
        self.t = (ends[:, None] * np.array(FOLD_SHARES)).clip(0.0, 1.0).ravel()

    def worst(self, points: Array) -> Array:
        """The least scaled Jacobian of each projector, (N,)."""
        least: Array = self.jacobians(points)[0].reshape(-1, len(FOLD_SHARES)).min(axis=1)
        return least

    def joined(self, places: Places) -> FoldEnergy:
        """The barrier with more places, tested along whole projectors until the next look."""
        mine = self.places
        both = Places(
            mine.net,
            np.concatenate([mine.column, places.column]),
            np.concatenate([mine.row, places.row]),
            np.concatenate([mine.local, places.local], axis=1),
        )
        return FoldEnergy(both, self.orientation, self.strength)

    def jacobians(self, points: Array) -> tuple[Array, Along]:
        """The scaled Jacobians and the samples."""
        along = Along.of(self.places.controls(points)[:, self.at], self.t)
        volume = dot(np.cross(along.du, along.dv), along.dt)
        lengths = np.sqrt(dot(along.du, along.du) * dot(along.dv, along.dv) * dot(along.dt, along.dt))
        return self.orientation * volume / np.maximum(lengths, 1e-300), along

    def value(self, points: Array) -> float:
        """The energy."""
        short = np.maximum(LEAST_JACOBIAN - self.jacobians(points)[0], 0.0)
        return float((self.strength * short) @ (self.strength * short))

    def linearise(self, points: Array) -> Rows:
        """The rows of the samples below LEAST_JACOBIAN."""
        g, along = self.jacobians(points)
        some = np.flatnonzero(g < LEAST_JACOBIAN)
        du, dv, dt, short = along.du[some], along.dv[some], along.dt[some], g[some]
        squares = [dot(d, d) for d in (du, dv, dt)]
        scale = self.orientation / np.maximum(np.sqrt(squares[0] * squares[1] * squares[2]), 1e-300)
        places = self.places.take(self.at[some])
        rows = np.zeros((len(some), 48 * (places.net.surfaces - 1)))
        parts = (
            (1, along.value, np.cross(dv, dt), du),
            (2, along.value, np.cross(dt, du), dv),
            (0, along.slope, np.cross(du, dv), dt),
        )
        for (kind, weights, cofactor, own), square in zip(parts, squares, strict=True):
            gradient = cofactor * scale[:, None] - own * (short / square)[:, None]
            rows += places.rows_of(kind, weights[some], gradient * self.strength)
        return Rows(places.column, places.row, rows, (LEAST_JACOBIAN - short) * self.strength)


def nearest_t(controls: Array, points: Array) -> Array:
    """The t (N,) at which projectors (``Places.controls``) are nearest to points (N, 3)."""
    t = np.linspace(0.0, 1.0, 65)
    along = Along.of(
        np.repeat(controls[:, :, None], len(t), axis=2).reshape(3, len(points) * len(t), *controls.shape[2:]),
        np.tile(t, len(points)),
    )
    miss = along.position.reshape(len(points), len(t), 3) - points[:, None]
    return t[dot(miss, miss).argmin(axis=1)]


def _difference(count: int, order: int) -> Array:
    """The matrix of differences of an order between ``count`` values."""
    return np.diff(np.eye(count), order, axis=0)


def smoothness(net: Net, weights: AimWeights, footprints: Array) -> Array:
    """The matrix of the smoothness of displacements and of the pull home, (unknowns, unknowns).

    Second differences along u and v and the mixed one (a thin plate), weak first differences along u, v and
    from surface to surface, and the displacements themselves. Differences shrink with the net's spacing;
    their weights make up for it.
    """
    columns, rows, free = np.eye(net.columns), np.eye(net.rows), np.diag(1.0 / footprints)
    fine_u, fine_v = net.columns / 8, net.rows / 6
    terms = [
        (_difference(net.columns, 2), rows, free, weights.smooth * fine_u**1.5),
        (columns, _difference(net.rows, 2), free, weights.smooth * fine_v**1.5),
        (_difference(net.columns, 1), _difference(net.rows, 1), free, 1.4 * weights.smooth),
        (_difference(net.columns, 1), rows, free, 0.3 * weights.smooth * fine_u**0.5),
        (columns, _difference(net.rows, 1), free, 0.3 * weights.smooth * fine_v**0.5),
        (columns, rows, _difference(net.surfaces - 1, 1) @ free, 0.3 * weights.smooth),
        (columns, rows, free, weights.home),
    ]
    total = np.zeros((net.unknowns // 3, net.unknowns // 3))
    for a, b, c, weight in terms:
        total += np.kron(a.T @ a, np.kron(b.T @ b, c.T @ c)) * weight**2
    return np.asarray(np.kron(total, np.eye(3)), np.float64)
