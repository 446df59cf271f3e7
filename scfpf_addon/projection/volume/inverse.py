# SPDX-License-Identifier: GPL-3.0-or-later
"""The inverse of a viewing volume: from points of space to (u, v, t), and to the image.

Newton's method on Q(u, v, t) = p for many points at once. It starts from samples of the volume whose first
step is shorter than those of their neighbours. Steps are measured in (u, v, t), so that the shape of the
volume does not matter, even if it is a million times longer than wide. Each layer of a folded volume has its
own start.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from ..arrays import put_columns
from ..typing import Array, BoolArray, IndexArray
from .viewing_volume import Projection, ViewingVolume

# Samples along u, v and t to start from, and for the points that these did not find.
SAMPLES = ((8, 8, 6), (24, 24, 16))
# The most starts of one point.
STARTS = (4, 16)
# The part of a first step outside the ranges counts this much more than the part inside.
OUTSIDE = 10.0
# Samples × points that are looked at together: 2 MB a number of each pair.
PAIRS = 1 << 18
NEWTON_STEPS = 30
# The longest step along u, v and t, as a share of their range: a longer one leaves its neighbourhood.
LONGEST_STEP = 0.25
# A step that leads farther from the point is taken again, shorter, down to this share of it.
SHORTEST_SHARE = 1 / 64
# Newton has converged when it steps by no more than this share of the ranges.
CONVERGED = 1e-13
# Unit columns whose determinant is below this do not span space: the pseudo-inverse steps in their plane.
SINGULAR = 1e-10
# A point is found when Q is this near to it, as a share of the lengths of Qu, Qv and Qt there …
FOUND_SHARE = 1e-9
# … or as a share of the coordinates, the resolution of float64.
ROUNDING_SHARE = 1e-14
# Parameters that exceed their range by no more than this share of it lie on its border (float32 input).
INSIDE_MARGIN = 1e-6
# How far outside the ranges points are followed, as a share of these.
BEYOND = 0.25


class Inverse(NamedTuple):
    """The parameters of N points in a volume. u, v, t: (N,), NaN where found (N,) bool is False."""

    u: Array
    v: Array
    t: Array
    found: BoolArray


class ImagePlaces(NamedTuple):
    """The places of N points in the image. x, y, t: (N,) in [0, 1], NaN where found (N,) bool is False."""

    x: Array
    y: Array
    t: Array
    found: BoolArray


class _Sample(NamedTuple):
    """position: (3, N). jacobian: (3, 3, N), by columns, per share of the ranges. valid: (N,)."""

    position: Array
    jacobian: Array
    valid: BoolArray


def invert(
    volume: ViewingVolume,
    positions: Array,
    u_range: tuple[float, float] = (0.0, 1.0),
    v_range: tuple[float, float] = (0.0, 1.0),
) -> Inverse:
    """The parameters at which the volume passes through points.

    positions: (3, N), in the volume's space. u_range, v_range: the part of the volume to search, in either
    order. Where a folded volume passes through a point several times, the least t counts; of layers that meet
    at a fold nearer than the coarser samples (8 × 8 × 6 over the ranges) it may be another. A point that is
    reached only within a part finer than the finer samples (24 × 24 × 16) may be missed. Q passes through
    every point that is found. Points that are not finite are not found.
    """
    points = np.ascontiguousarray(positions, np.float64)
    low = np.array([min(u_range), min(v_range), 0.0])
    extent = np.array([max(u_range), max(v_range), 1.0]) - low
    search = _NewtonSearch(volume, low, extent)
    result = np.full((3, points.shape[1]), np.nan)
    open_ = np.flatnonzero(np.isfinite(points).all(axis=0))
    for counts, starts in zip(SAMPLES, STARTS, strict=True):
        cloud = _Cloud(search, counts)
        if not cloud.usable:
            break
        if counts is not SAMPLES[0]:
            open_ = open_[cloud.may_reach(points.take(open_, 1))]
        block = max(1, PAIRS // len(cloud.lost))
        for first in range(0, len(open_), block):
            chosen = open_[first : first + block]
            some = points.take(chosen, 1)
            owner, seeds = cloud.seeds(some, starts)
            put_columns(result, chosen, search.nearest(some, owner, seeds))
        open_ = open_[np.isnan(result[2, open_])]
    u, v, t = result * extent[:, None] + low[:, None]
    return Inverse(u, v, t, ~np.isnan(t))


def follow(
    volume: ViewingVolume,
    positions: Array,
    start: Array,
    u_range: tuple[float, float] = (0.0, 1.0),
    v_range: tuple[float, float] = (0.0, 1.0),
) -> Inverse:
    """``invert`` for points (3, N) whose parameters are near ``start`` (3, N), which is much faster.

    Newton's method from there alone, so that the same sheet of a folded volume is found. Points outside the
    ranges are found too, up to BEYOND of them, as the volume goes on there.
    """
    low = np.array([min(u_range), min(v_range), 0.0])
    extent = np.array([max(u_range), max(v_range), 1.0]) - low
    search = _NewtonSearch(volume, low, extent, BEYOND)
    points = np.ascontiguousarray(positions, np.float64)
    usable = np.flatnonzero(np.isfinite(points).all(axis=0) & np.isfinite(start).all(axis=0))
    result = np.full(points.shape, np.nan)
    starts = (start.take(usable, 1) - low[:, None]) / extent[:, None]
    shares, accepted = search.newton(points.take(usable, 1), starts)
    put_columns(result, usable[accepted], shares.compress(accepted, 1))
    u, v, t = result * extent[:, None] + low[:, None]
    return Inverse(u, v, t, ~np.isnan(t))


def find_in_image(projection: Projection, positions: Array) -> ImagePlaces:
    """The places of points (3, N) in the image, as if nothing hid them; see ``invert``."""
    ranges = projection.u_range, projection.v_range
    place = invert(projection.volume, positions, *ranges)
    (u0, u1), (v0, v1) = ranges
    x, y = projection.reparameterisation.image_positions(
        (place.u - u0) / (u1 - u0), (place.v - v0) / (v1 - v0), projection.aspect
    )
    # A mapping may leave parts out of the image.
    return ImagePlaces(x, y, place.t, place.found & np.isfinite(x) & np.isfinite(y))


class _NewtonSearch:
    """Newton's method in a part of a volume; parameters are shares of its ranges, (3, N)."""

    def __init__(
        self, volume: ViewingVolume, low: Array, extent: Array, beyond: float = INSIDE_MARGIN
    ) -> None:
        self.volume, self.low, self.extent, self.beyond = volume, low, extent, beyond

    def sample(self, shares: Array) -> _Sample:
        """The volume at shares (3, N) of the ranges, its derivatives by these."""
        u, v, t = shares * self.extent[:, None] + self.low[:, None]
        controls = self.volume.controls(u, v)
        found = self.volume.evaluate_controls(controls, t)
        jacobian = np.stack([found.du, found.dv, found.dt], axis=1) * self.extent[:, None]
        valid = controls.valid & np.isfinite(found.position).all(axis=0) & np.isfinite(jacobian).all((0, 1))
        return _Sample(found.position, jacobian, valid)

    def nearest(self, points: Array, owner: IndexArray, shares: Array) -> Array:
        """The solution of least t of each of N points, (3, N), NaN for points without one.

        points: (3, N). owner: (S,) the point that each start is for. shares: (3, S) the starts.
        """
        solved, accepted = self.newton(points.take(owner, 1), shares)
        result = np.full(points.shape, np.nan)
        owner, solved = owner[accepted], np.clip(solved.compress(accepted, 1), 0.0, 1.0)
        # The last one written wins: that of least t.
        order = np.argsort(-solved[2], kind="stable")
        put_columns(result, owner[order], solved.take(order, 1))
        return result

    def newton(self, points: Array, shares: Array) -> tuple[Array, BoolArray]:
        """Solutions (3, S) from starts, and whether each has converged to one."""
        shares = shares.copy()
        sample = self.sample(shares)
        accepted = np.zeros(len(sample.valid), bool)
        # All that still move: their numbers, samples, distances to the point and shares of a step.
        moving = np.flatnonzero(sample.valid)
        position, jacobian = sample.position.take(moving, 1), sample.jacobian.take(moving, 2)
        part = np.ones(len(moving))
        for _ in range(NEWTON_STEPS):
            if not len(moving):
                break
            wanted, before = points.take(moving, 1), shares.take(moving, 1)
            missing = wanted - position
            distance = _length(missing)
            step = _solve(jacobian, missing)
            longest = np.abs(step).max(axis=0)
            done = longest <= CONVERGED
            step *= part * np.minimum(1.0, LONGEST_STEP / np.maximum(longest, LONGEST_STEP))
            trial = np.clip(before + step, -LONGEST_STEP, 1.0 + LONGEST_STEP)
            sample = self.sample(trial)
            farther = ~sample.valid | (_length(wanted - sample.position) > distance)
            taken = ~farther | ((part <= SHORTEST_SHARE) & sample.valid)
            done |= farther & (part <= SHORTEST_SHARE)
            after = np.where(taken, trial, before)
            put_columns(shares, moving, after)
            position = np.where(taken, sample.position, position)
            jacobian = np.where(taken, sample.jacobian, jacobian)
            part = np.where(farther, part / 2, np.minimum(1.0, 2 * part))
            ended, on = np.flatnonzero(done), np.flatnonzero(~done)
            accepted[moving[ended]] = self._is_solution(
                *(each.take(ended, -1) for each in (wanted, after, position, jacobian))
            )
            moving, part = moving[on], part[on]
            position, jacobian = position.take(on, 1), jacobian.take(on, 2)
        wanted, before = points.take(moving, 1), shares.take(moving, 1)
        accepted[moving] = self._is_solution(wanted, before, position, jacobian)
        return shares, accepted

    def _is_solution(self, points: Array, shares: Array, position: Array, jacobian: Array) -> BoolArray:
        missed = _length(points - position)
        size = np.sqrt(np.einsum("rcn,rcn->n", jacobian, jacobian))
        near = missed <= FOUND_SHARE * size + ROUNDING_SHARE * np.abs(points).max(axis=0, initial=0.0)
        inside = ((shares >= -self.beyond) & (shares <= 1 + self.beyond)).all(axis=0)
        solved: BoolArray = near & inside
        return solved


class _Cloud:
    """Samples of a part of a volume, from which searches start."""

    def __init__(self, search: _NewtonSearch, counts: tuple[int, int, int]) -> None:
        self.counts = counts
        # Middles of cells: poles, points and seams are on borders.
        axes = [(np.arange(count) + 0.5) / count for count in counts]
        self.shares = np.stack([axis.ravel() for axis in np.meshgrid(*axes, indexing="ij")])
        sample = search.sample(self.shares)
        inverse, regular = _inverse(sample.jacobian)
        usable = sample.valid & regular
        self.lost = ~usable
        self.usable = bool(usable.any())
        self._inverse = np.where(usable, inverse, 0.0).transpose(2, 0, 1)
        position = np.where(usable, sample.position, 0.0).T
        self._offset = self.shares.T - np.einsum("sij,sj->si", self._inverse, position)
        reach = np.abs(sample.jacobian[..., usable]).sum(axis=1)
        around = sample.position[:, usable]
        self._low, self._high = (
            (around - reach).min(axis=1, initial=np.inf),
            (around + reach).max(axis=1, initial=-np.inf),
        )

    def may_reach(self, points: Array) -> BoolArray:
        """Return whether points (3, N) lie in a generous box around the volume."""
        above, below = points >= self._low[:, None], points <= self._high[:, None]
        inside: BoolArray = (above & below).all(axis=0)
        return inside

    def seeds(self, points: Array, most: int) -> tuple[IndexArray, Array]:
        """At most ``most`` starts of each of N points.

        Returns the number of the point that each start is for, (S,), and the starts, (3, S).
        """
        count = points.shape[1]
        # Where Newton's first step would lead, and how far that is.
        target = (self._inverse.reshape(-1, 3) @ points).reshape(-1, 3, count) + self._offset[..., None]
        far = np.abs(target - self.shares.T[..., None]).max(axis=1)
        outside = np.maximum(np.abs(target - 0.5) - 0.5, 0.0).max(axis=1)
        score = far + OUTSIDE * outside
        score[self.lost] = np.inf
        grid = score.reshape(*self.counts, count)
        least = np.isfinite(grid)
        for axis in range(3):
            ahead, behind = [slice(None)] * 4, [slice(None)] * 4
            ahead[axis], behind[axis] = slice(1, None), slice(None, -1)
            least[tuple(ahead)] &= grid[tuple(ahead)] <= grid[tuple(behind)]
            least[tuple(behind)] &= grid[tuple(behind)] <= grid[tuple(ahead)]
        sample, owner = np.nonzero(least.reshape(-1, count))
        order = np.lexsort((score[sample, owner], owner))
        sample, owner = sample[order], owner[order]
        rank = np.arange(len(owner)) - np.searchsorted(owner, owner)
        kept = rank < most
        return owner[kept], self.shares[:, sample[kept]]


def _length(vectors: Array) -> Array:
    found: Array = np.sqrt(np.einsum("cn,cn->n", vectors, vectors))
    return found


def _inverse(jacobian: Array) -> tuple[Array, BoolArray]:
    """Inverses (3, 3, N) of matrices (3, 3, N), and whether they have one that means anything."""
    a, b, c = jacobian.transpose(1, 0, 2)
    rows = np.stack([_cross(b, c), _cross(c, a), _cross(a, b)])
    determinant = np.einsum("cn,cn->n", a, rows[0])
    regular = np.abs(determinant) > SINGULAR * _length(a) * _length(b) * _length(c)
    with np.errstate(divide="ignore", invalid="ignore", over="ignore"):
        return rows / determinant, regular


def _cross(a: Array, b: Array) -> Array:
    return np.stack([a[1] * b[2] - a[2] * b[1], a[2] * b[0] - a[0] * b[2], a[0] * b[1] - a[1] * b[0]])


def _solve(jacobian: Array, right: Array) -> Array:
    """x with J x = right, (3, N); for singular J the least squares of the pseudo-inverse."""
    inverse, regular = _inverse(jacobian)
    singular = np.flatnonzero(~regular)
    if len(singular):
        inverse[..., singular] = np.linalg.pinv(jacobian[..., singular].transpose(2, 0, 1)).transpose(1, 2, 0)
    found: Array = np.einsum("ijn,jn->in", inverse, right)
    return found
