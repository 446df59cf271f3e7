# SPDX-License-Identifier: GPL-3.0-or-later
"""The input and the output of aiming: pins, lines, stays, weights, and the solved control surfaces.

Image positions are (2, N) in [0, 1] from the lower left, world points (3, N), all float64. A volume is
parameterised by the image itself: u = x and v = y (``start.start_volume``).
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import astuple, dataclass, field, replace
from typing import NamedTuple, Protocol

import numpy as np

from ...projection.surfaces.nurbs import NurbsPatch
from ...projection.typing import Array, BoolArray, IndexArray
from ...projection.volume.viewing_volume import Projection, ViewingVolume


def _no_points(components: int) -> Callable[[], Array]:
    return lambda: np.zeros((components, 0))


@dataclass(frozen=True)
class AimPins:
    """Points of the scene and the image positions that shall show them.

    points: (3, P). positions: (2, P). directions: (3, P), the unit direction in which the point is seen, NaN
    where free. across, upward: (3, P), the world vectors that a step of 1 along x and y of the image shall
    cover at the point, perpendicular to the direction, NaN where free. weights: (P,). views: (P,), the number
    of the view that a pin belongs to, -1 for a pin by itself. pivots: (3, P), the middle of a view's thing,
    about which it turns. Omitted arrays are free, 1, -1 and the points.
    """

    points: Array
    positions: Array
    directions: Array = field(default_factory=_no_points(3))
    across: Array = field(default_factory=_no_points(3))
    upward: Array = field(default_factory=_no_points(3))
    weights: Array = field(default_factory=lambda: np.zeros(0))
    views: IndexArray = field(default_factory=lambda: np.zeros(0, np.int64))
    pivots: Array = field(default_factory=_no_points(3))

    def __post_init__(self) -> None:
        count = self.count
        for name in ("directions", "across", "upward"):
            if getattr(self, name).shape[1] != count:
                object.__setattr__(self, name, np.full((3, count), np.nan))
        if len(self.weights) != count:
            object.__setattr__(self, "weights", np.ones(count))
        if len(self.views) != count:
            object.__setattr__(self, "views", np.full(count, -1))
        if self.pivots.shape[1] != count:
            object.__setattr__(self, "pivots", self.points)

    @property
    def count(self) -> int:
        """The number of pins."""
        return int(self.points.shape[1])

    @classmethod
    def joined(cls, parts: list[AimPins]) -> AimPins:
        """The pins of all parts, in order; without parts no pins."""
        if not parts:
            return cls(np.zeros((3, 0)), np.zeros((2, 0)))
        return cls(*(np.concatenate(values, axis=-1) for values in zip(*map(astuple, parts), strict=True)))

    def take(self, which: IndexArray | BoolArray) -> AimPins:
        """Some of the pins."""
        return AimPins(*(values[..., which] for values in astuple(self)))


@dataclass(frozen=True)
class AimStays:
    """Points that shall stay where the image shows them, at a grid of its positions.

    x: (U,), y: (V,), ascending. points: (3, U, V). t: (U, V), where they are on the start's projectors.
    weights: (U, V), 0 to 1 for what the old image shows, more for locked regions, 0 where nothing shall stay.
    """

    x: Array
    y: Array
    points: Array
    t: Array
    weights: Array


@dataclass(frozen=True)
class AimLines:
    """Pairs of pins between which the scene's line shall be straight in the image. pins: (2, L) indices."""

    pins: IndexArray = field(default_factory=lambda: np.zeros((2, 0), np.int64))


@dataclass(frozen=True)
class AimDetours:
    """Ways of projectors past what hides their pins.

    pins: (D,), their numbers. t: (D,), where the obstacle is on the projectors. points, passes: (3, D), where
    they are at t, and points beside the obstacle through which they shall pass instead.
    """

    pins: IndexArray = field(default_factory=lambda: np.zeros(0, np.int64))
    t: Array = field(default_factory=lambda: np.zeros(0))
    points: Array = field(default_factory=_no_points(3))
    passes: Array = field(default_factory=_no_points(3))


class FirstHits(NamedTuple):
    """The first hits of N projectors. t: (N,), inf on a miss. wanted: (N,), whether a pinned thing is hit."""

    t: Array
    wanted: BoolArray


class FindHits(Protocol):
    """Casts N projectors for the solver. controls: (K, 3, N), their control points."""

    def __call__(self, controls: Array, /) -> FirstHits:
        """Return the first hits."""

    def may_meet_wanted(self, controls: Array) -> BoolArray:
        """Return whether each projector may meet a pinned thing, (N,); where False it certainly does not."""


@dataclass(frozen=True)
class AimWeights:
    """The weights of the residuals, which are in pixels unless stated otherwise.

    pin: of a pin's distance. depth: of a pin's change of t, in its whole range. direction: of an angle, in
    degrees. frame: of a relative error of across and upward, in percent. line: of a line's distance. detour:
    of a detour's distance, shared by all, as neighbours help each other. stay: of a stay's distance; stays
    farther than ``robust`` pixels lose their influence. stay_direction: of an angle of a stay, in degrees.
    smooth: of the differences of displacements. home: of displacements. fold: of the barrier.
    """

    pin: float = 200.0
    depth: float = 6000.0
    direction: float = 10.0
    frame: float = 2.0
    line: float = 20.0
    detour: float = 25.0
    stay: float = 1.5
    robust: float = 50.0
    stay_direction: float = 0.05
    smooth: float = 0.01
    home: float = 0.002
    fold: float = 150.0


@dataclass(frozen=True)
class AimProblem:
    """A start and what its image shall show instead.

    patches: the control surfaces of the start, near to far, cubic B-splines with equal nets, joined by a
    Bézier projector. The first one stays fixed. width: of the image in pixels. aspect: its width / height.
    first_hits: finds what projectors see; None: nothing hides anything, and folds count along the whole
    projector. solved: a result from which to go on, None to begin at the start.
    """

    patches: tuple[NurbsPatch, ...]
    width: int
    aspect: float
    pins: AimPins
    stays: tuple[AimStays, ...] = ()
    lines: AimLines = field(default_factory=AimLines)
    weights: AimWeights = field(default_factory=AimWeights)
    first_hits: FindHits | None = None
    detours: AimDetours = field(default_factory=AimDetours)
    solved: AimResult | None = None


@dataclass(frozen=True)
class SolvePlan:
    """A way from the old image to the wanted one: a homotopy, and the weights that change on it.

    stages: of the pins' way, with ``steps`` each. final_steps: the most at its end. fold, fold_growth: factor
    of the barrier's weight, and the multiple to which it grows by then. pin, stay, robust, detour: factors of
    the weights of pins' distances and of stays, of the distance from which stays lose their influence, and of
    the weight of detours. mends: whether folds are looked for on a finer grid, from the first step on.
    """

    stages: int = 6
    steps: int = 2
    final_steps: int = 24
    fold: float = 1.0
    fold_growth: float = 12.0
    pin: float = 1.0
    stay: float = 1.0
    robust: float = 1.0
    detour: float = 1.0
    mends: bool = False

    @property
    def most_steps(self) -> int:
        """Steps at most."""
        return (self.stages - 1) * self.steps + self.final_steps

    def mending(self) -> SolvePlan:
        """The way from a result of this one that takes the last folds out of it."""
        return replace(self, stages=1, final_steps=24, fold=8.0, fold_growth=2.0, mends=True)


@dataclass(frozen=True)
class AimResult:
    """The solved control surfaces.

    patches: near to far. t: (P,), where each pin lies on its projector. residuals: (P,), distances of the
    pins from their positions in the image, in pixels. steps: Gauss–Newton steps taken.
    """

    patches: tuple[NurbsPatch, ...]
    t: Array
    residuals: Array
    steps: int

    def projection(self, aspect: float) -> Projection:
        """The projection of the solved volume."""
        return Projection(ViewingVolume(self.patches), aspect=aspect)
