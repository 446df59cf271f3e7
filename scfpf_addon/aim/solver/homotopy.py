# SPDX-License-Identifier: GPL-3.0-or-later
"""The way of pins from the start's own image to what is wanted.

The thing of a view turns rigidly on it, as if it were turned before the old camera: a straight way from the
old points to the new ones would shrink it by cos (angle / 2). Pins by themselves turn on great circles.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from ...projection.arrays import median
from ...projection.typing import Array, IndexArray
from .control_net import Along, Places, position_and_tangent
from .pin_energy import PinTargets
from .problem import AimPins
from .vectors import across_of, dot, nearest_t, rotation_between, turned_by, unit

# Where pins start on their projectors: both sides need some.
PIN_T = (0.2, 0.85)
# Footprints of pixels are limited to this factor about the typical one, since they divide.
FOOTPRINT_RANGE = 10.0
# Samples of a projector among which a distance is looked for.
SAMPLES = 97


class _Turn(NamedTuple):
    """The motion of pins.

    which: (N,), their numbers. matrix: (3, 3), turns old vectors to new ones. old_pivot, pivot: (3, 1).
    """

    which: IndexArray
    matrix: Array
    old_pivot: Array
    pivot: Array


class Homotopy:
    """The targets of pins between the start and what is wanted.

    t: (P,), where they are on the start's projectors. footprint: (P,), world units in a pixel there. last:
    the way before an event of a drag. Its t and turns are kept if pins only move in the image: a drag needs
    the end of the way, which hardly depends on them.
    """

    def __init__(
        self, places: Places, start: Array, pins: AimPins, width: int, last: Homotopy | None = None
    ) -> None:
        self._pins = pins
        controls = places.controls(start)
        if last is not None and last.differs_in_positions_only(pins):
            turns, t = last._turns, last.t
        else:
            turns, t = self._begun(controls)
        self._turns: list[_Turn] = turns
        self.t: Array = t
        along = Along.of(controls, self.t)
        tangent = unit(along.dt)
        across, upward = across_of(along.du, tangent), across_of(along.dv, tangent)
        self._old = PinTargets(along.position, tangent, across, upward)
        footprint = np.sqrt(dot(across, across)) / width
        typical = float(median(footprint)) if len(footprint) else 1.0
        self.footprint = np.clip(footprint, typical / FOOTPRINT_RANGE, typical * FOOTPRINT_RANGE)

    def differs_in_positions_only(self, pins: AimPins) -> bool:
        """Return whether pins want what these want, though elsewhere in the image."""
        names = ("points", "directions", "across", "upward", "views", "pivots")
        pairs = ((getattr(self._pins, name), getattr(pins, name)) for name in names)
        return all(np.array_equal(one, other, equal_nan=True) for one, other in pairs)

    def _begun(self, controls: Array) -> tuple[list[_Turn], Array]:
        """The motion of the pins, and where they are at the start, ``t``."""
        pins = self._pins
        distance = np.linalg.norm(pins.pivots - controls[0, 0], axis=0)
        along = Along.of(controls, _t_at_distance(controls[0], distance))
        turns = self._found_turns(along)
        wanted = along.position.copy()
        for turn in turns:
            away = turn.matrix.T @ (pins.points[:, turn.which] - turn.pivot)
            wanted[:, turn.which] = turn.old_pivot + away
        return turns, np.clip(nearest_t(controls[0], wanted), *PIN_T)

    def _found_turns(self, along: Along) -> list[_Turn]:
        """The turns of views and of pins by themselves. along: the start at the distances of the pivots."""
        pins, turns = self._pins, []
        tangent = unit(along.dt)
        for view in np.unique(pins.views[pins.views >= 0]):
            which = np.flatnonzero(pins.views == view)
            old, new = (np.zeros((3, 0)),) * 2
            parts = ((tangent, pins.directions), (along.du, pins.across), (along.dv, pins.upward))
            for before, after in parts:
                known = which[np.isfinite(after[:, which]).all(axis=0)]
                old = np.hstack([old, unit(before[:, known])])
                new = np.hstack([new, unit(after[:, known])])
            matrix = _rotation(old, new)
            pivot = pins.pivots[:, which].mean(axis=1, keepdims=True)
            away = matrix.T @ (pins.points[:, which] - pivot)
            turns.append(_Turn(which, matrix, _pivot_before(along, tangent, which, away), pivot))
        for pin in np.flatnonzero(pins.views < 0):
            direction = pins.directions[:, pin]
            if np.isfinite(direction).all():
                matrix = rotation_between(tangent[:, pin], unit(direction))
            else:
                matrix = np.eye(3)
            turns.append(_Turn(np.array([pin]), matrix, along.position[:, [pin]], pins.points[:, [pin]]))
        return turns

    def targets(self, share: float) -> PinTargets:
        """The aims of the pins at a share of the way."""
        old, pins = self._old, self._pins
        found = PinTargets(*(part.copy() for part in old))
        for turn in self._turns:
            which, matrix = turn.which, turn.matrix
            part = turned_by(matrix, share)

            def between(before: Array, after: Array, back: Array = matrix.T, on: Array = part) -> Array:
                """Vectors at the share: exact at both ends, turned in between."""
                after = np.where(np.isfinite(after), back @ np.nan_to_num(after), before)
                mixed: Array = on @ (before + share * (after - before))
                return mixed

            pivot = turn.old_pivot + share * (turn.pivot - turn.old_pivot)
            away = old.points[:, which] - turn.old_pivot, pins.points[:, which] - turn.pivot
            found.points[:, which] = pivot + between(*away)
            directions = unit(between(old.directions[:, which], pins.directions[:, which]))
            found.directions[:, which] = directions
            for name in ("across", "upward"):
                vectors = between(getattr(old, name)[:, which], getattr(pins, name)[:, which])
                getattr(found, name)[:, which] = across_of(vectors, directions)
        return found


def _rotation(old: Array, new: Array) -> Array:
    """The rotation (3, 3) that leads unit vectors (3, N) nearest to others (Kabsch 1976)."""
    if not old.shape[1]:
        return np.eye(3)
    left, _, right = np.linalg.svd(new @ old.T)
    mirrored = np.linalg.det(left @ right) < 0.0
    found: Array = (left * np.array([1.0, 1.0, -1.0 if mirrored else 1.0])) @ right
    return found


def _pivot_before(along: Along, tangent: Array, which: IndexArray, away: Array) -> Array:
    """The pivot (3, 1) at which the turned thing is nearest to the old projectors of its pins.

    away: (3, N), the pins from the pivot. Its distance is that of the samples ``along``.
    """
    ahead, position = tangent[:, which], along.position[:, which]
    middle = unit(ahead.mean(axis=1, keepdims=True))
    # Rows perpendicular to each projector, and one for the distance along their mean.
    perpendicular = np.eye(3) * len(which) - ahead @ ahead.T
    missing = position - away
    right = (missing - dot(missing, ahead) * ahead).sum(axis=1, keepdims=True)
    matrix = perpendicular + len(which) * (middle @ middle.T)
    depth = float((middle.T @ position).mean())
    found: Array = np.linalg.solve(matrix, right + len(which) * depth * middle)
    return found


def _t_at_distance(controls: Array, distance: Array) -> Array:
    """The t (N,) at which projectors (surfaces, 3, N) have these distances from their near points."""
    t, every = np.linspace(0.0, 1.0, SAMPLES), np.arange(len(distance))
    position, _ = position_and_tangent(controls, np.repeat(t[:, None], len(distance), axis=1))
    away = np.linalg.norm(position - controls[0][:, None], axis=0)
    nearest = np.abs(away - distance).argmin(axis=0)
    # Newton's step from the nearest sample.
    slope = np.gradient(away, t, axis=0)[nearest, every]
    found: Array = t[nearest] - (away[nearest, every] - distance) / np.maximum(slope, 1e-300)
    return np.clip(found, 0.0, 1.0)
