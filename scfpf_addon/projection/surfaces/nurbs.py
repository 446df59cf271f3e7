# SPDX-License-Identifier: GPL-3.0-or-later
"""NURBS patches: control points with weights over the knots that Blender's surface objects have.

Basis functions by Cox and de Boor, rational derivatives by the quotient rule
(Piegl and Tiller, The NURBS Book, algorithms 2.2 and 4.4).
"""

from __future__ import annotations

from dataclasses import dataclass, field
from functools import cached_property
from typing import NamedTuple

import numpy as np

from ..arrays import BLOCK, evaluate_pieces
from ..typing import Array, IndexArray
from .surface import ControlSurface, SurfacePositions, SurfaceSample

LOWEST_ORDER = 2
# Combinations of control points that move samples by less than this share of the most do not show in them.
UNSEEN = 1e-9
# Rows of parameters shorter than this are not worth a loop over them.
SHORTEST_ROW = 64


@dataclass(frozen=True)
class NurbsAxis:
    """The course of a NURBS patch in one direction: the settings of Blender's splines.

    order: degree + 1, at least 2. endpoint: the patch begins and ends at its
    outer control points. bezier: inner knots of the full multiplicity, so that
    the patch is a row of Bézier pieces. cyclic: the patch closes.
    """

    order: int = 4
    endpoint: bool = True
    bezier: bool = False
    cyclic: bool = False

    def problem(self, count: int) -> str:
        """The reason why ``count`` control points make no patch along this axis; empty if they do.

        The conditions are those under which Blender draws a surface.
        """
        if self.order < LOWEST_ORDER:
            return f"its order is {self.order} and must be at least {LOWEST_ORDER}"
        if count < self.order:
            return f"order {self.order} needs at least {self.order} control points, not {count}"
        if self.bezier and self.cyclic and count % (self.order - 1):
            return f"closed Bézier pieces of order {self.order} need a multiple of {self.order - 1} points"
        if self.bezier and not self.cyclic and not self.endpoint and count == self.order:
            return f"Bézier pieces of order {self.order} without end points need more than {count} points"
        return ""

    def knots(self, count: int) -> Array:
        """The knots over ``count`` control points, (K,) float64, as Blender's ``calcknots`` builds them.

        A cyclic axis repeats its first order - 1 points: K = count + 2 order - 1, else count + order.
        """
        inner = self.order - 1 if self.bezier else 1
        head = self.order - self.cyclic if self.endpoint else min(2, inner)
        tail = 2 * self.order - 1 if self.cyclic else self.order if self.endpoint else 0
        body = count + self.order + (self.order - 1) * self.cyclic - tail
        skipped = int(self.endpoint and self.cyclic)
        # The first value stands ``head`` times, each further one ``inner`` times.
        steps = np.maximum(np.arange(body - skipped + 1) - head + inner, 0) // inner
        knots = [0.0] * skipped + [float(skipped + step) for step in steps]
        after = knots.pop()
        for place in range(tail):
            knots.append(after + knots[place] - knots[0])
        return np.array(knots)


class Acting(NamedTuple):
    """The control points that act at N parameters, and how much.

    point: (order, N), their places. value, slope: (order, N), their basis
    functions and these by the parameter.
    """

    point: IndexArray
    value: Array
    slope: Array


class Pieces(NamedTuple):
    """The basis functions from knot to knot, S pieces.

    middle, length: (S,), in knots. point: (order, S), the control points that act.
    values: (order, S, order), their functions as powers, lowest first, of the place in the
    piece, -½ to ½: about the middle the rounding errors are least.
    """

    middle: Array
    length: Array
    point: IndexArray
    values: Array


@dataclass(frozen=True)
class Basis:
    """The basis functions of an axis over ``count`` control points, the parameter from 0 to 1."""

    axis: NurbsAxis
    count: int

    @cached_property
    def knots(self) -> Array:
        """The knots, ascending, (count + order,); a cyclic axis has order - 1 more."""
        return self.axis.knots(self.count)

    @cached_property
    def ends(self) -> tuple[float, float]:
        """The knots at which the patch begins and ends."""
        last = self.count + (self.axis.order - 1 if self.axis.cyclic else 0)
        return float(self.knots[self.axis.order - 1]), float(self.knots[last])

    @cached_property
    def creases(self) -> Array:
        """The knots inside the patch at which its derivative may jump, (C,)."""
        low, high = self.ends
        values, repeats = np.unique(self.knots, return_counts=True)
        inside = (values > low) & (values < high)
        creases: Array = values[inside & (repeats >= self.axis.order - 1)]
        return creases

    def at(self, parameter: Array) -> tuple[Array, IndexArray]:
        """Knot values for parameters (N,), and the smooth piece of the patch that each falls in."""
        low, high = self.ends
        place = low + (high - low) * parameter
        return place, np.searchsorted(self.creases, place, side="right")

    @cached_property
    def pieces(self) -> Pieces:
        """The basis functions from knot to knot as polynomials, by the recurrence of ``acting``."""
        degree = self.axis.order - 1
        first = np.searchsorted(self.knots, self.ends[0], side="right") - 1
        last = np.searchsorted(self.knots, self.ends[1], side="left") - 1
        span = np.arange(first, last + 1)
        span = span[self.knots[span] < self.knots[span + 1]]
        middle = (self.knots[span] + self.knots[span + 1]) / 2
        length = self.knots[span + 1] - self.knots[span]
        values = np.zeros((self.axis.order, len(span), self.axis.order))
        values[0, :, 0] = 1.0
        for reach in range(1, degree + 1):
            before, values = values[:reach], np.zeros_like(values)
            for i in range(reach):
                right, left = self.knots[span + 1 + i] - middle, middle - self.knots[span - (reach - 1 - i)]
                share = before[i] / (right + left)[:, None]
                # Times (right - length·s) and (left + length·s).
                values[i] += right[:, None] * share
                values[i, :, 1:] -= length[:, None] * share[:, :-1]
                values[i + 1] += left[:, None] * share
                values[i + 1, :, 1:] += length[:, None] * share[:, :-1]
        point = (span - degree + np.arange(degree + 1)[:, None]) % self.count
        return Pieces(middle, length, point, values)

    def locate(self, parameter: Array) -> tuple[IndexArray, Array]:
        """The piece of ``pieces`` at parameters (N,), and the place in it, -½ to ½."""
        low, high = self.ends
        middle, length = self.pieces[:2]
        place = low + (high - low) * parameter
        piece = np.searchsorted(middle[1:] - length[1:] / 2, place, side="right")
        place -= middle.take(piece)
        place /= length.take(piece)
        return piece, place

    def acting(self, place: Array) -> Acting:
        """The acting control points at knot values (N,); at a knot the right-hand piece, at the end the last.

        Outside the patch the outer pieces continue.
        """
        knots, degree = self.knots, self.axis.order - 1
        low, high = self.ends
        first = np.searchsorted(knots, low, side="right") - 1
        last = np.searchsorted(knots, high, side="left") - 1
        span = np.clip(np.searchsorted(knots, place, side="right") - 1, first, last)
        right = [knots[span + 1 + i] - place for i in range(degree)]
        left = [place - knots[span - i] for i in range(degree)]
        value = np.ones((1, len(place)))
        slope = np.zeros((1, len(place)))
        for reach in range(1, degree + 1):
            # Share of each lower function by the width of its support: both recurrences use it.
            share = np.stack([value[i] / (right[i] + left[reach - 1 - i]) for i in range(reach)])
            value = np.zeros((reach + 1, len(place)))
            for i in range(reach):
                value[i] += right[i] * share[i]
                value[i + 1] += left[reach - 1 - i] * share[i]
            if reach == degree:
                slope = np.zeros_like(value)
                slope[:-1] -= degree * share
                slope[1:] += degree * share
        point = (span - degree + np.arange(degree + 1)[:, None]) % self.count
        return Acting(point, value, slope)


@dataclass(frozen=True)
class NurbsPatch(ControlSurface):
    """A rational B-spline patch, as Blender's SURFACE objects have them.

    points: (rows, columns, 3), or 4 with positive weights; rows along v and
    columns along u. u and v in [0, 1] span the whole patch, evenly in its knots.
    Tiles end where the derivative may jump. Raises ValueError for points that
    make no patch.
    """

    points: Array = field(default_factory=lambda: np.zeros((4, 4, 3)))
    along_u: NurbsAxis = field(default_factory=NurbsAxis)
    along_v: NurbsAxis = field(default_factory=NurbsAxis)

    def __post_init__(self) -> None:
        shape = np.shape(self.points)
        if len(shape) != 3 or shape[2] not in (3, 4):
            raise ValueError(f"a NURBS patch needs rows × columns × 3 or 4 numbers, got shape {shape}")
        for name, axis, count in (("u", self.along_u, shape[1]), ("v", self.along_v, shape[0])):
            problem = axis.problem(count)
            if problem:
                raise ValueError(f"along {name}, {problem}")
        if shape[2] == 4 and not np.asarray(self.points)[..., 3].min() > 0:
            raise ValueError("the weights of a NURBS patch must be above 0")

    @cached_property
    def _bases(self) -> tuple[Basis, Basis]:
        rows, columns = np.shape(self.points)[:2]
        return Basis(self.along_u, columns), Basis(self.along_v, rows)

    @cached_property
    def _homogeneous(self) -> Array:
        """Control points component by component, (3 or 4, rows · columns): w·x, w·y, w·z and w.

        Equal weights cancel; then there are three rows.
        """
        flat = np.asarray(self.points, np.float64).reshape(-1, np.shape(self.points)[2]).T
        if len(flat) == 3 or np.ptp(flat[3]) == 0:
            return np.ascontiguousarray(flat[:3])
        return np.concatenate([flat[:3] * flat[3], flat[3:]])

    def local_hull(self) -> Array:
        return np.asarray(self.points, np.float64)[..., :3].reshape(-1, 3).T

    def local_position(self, u: Array, v: Array) -> SurfacePositions:
        """The positions; quicker where u, v (N,) are the rows of a grid."""
        basis_u, basis_v = self._bases
        width = _row_length(u, v)
        if width >= SHORTEST_ROW:
            across, up = basis_u.acting(basis_u.at(u[:width])[0]), basis_v.acting(basis_v.at(v[::width])[0])
            total = self._combine_rows(up, across)
        else:
            total = np.empty((len(self._homogeneous), len(u)))
            for start in range(0, len(u), BLOCK):
                part = slice(start, start + BLOCK)
                self._evaluate_block(u[part], v[part], total[:, part])
        if len(total) == 4:
            total[:3] /= total[3]
        return SurfacePositions(total[:3], np.ones(len(u), bool))

    def local(self, u: Array, v: Array) -> SurfaceSample:
        """The sample; its tiles are what lies between creases."""
        basis_u, basis_v = self._bases
        (place_u, tile_u), (place_v, tile_v) = basis_u.at(u), basis_v.at(v)
        total, du, dv = found = np.zeros((3, len(self._homogeneous), len(u)))
        for start in range(0, len(u), BLOCK):
            part = slice(start, start + BLOCK)
            self._combine(basis_v.acting(place_v[part]), basis_u.acting(place_u[part]), *found[..., part])
        # From knots to [0, 1].
        du *= basis_u.ends[1] - basis_u.ends[0]
        dv *= basis_v.ends[1] - basis_v.ends[0]
        if len(total) == 4:
            total, weight = total[:3] / total[3], total[3]
            du = (du[:3] - total * du[3]) / weight
            dv = (dv[:3] - total * dv[3]) / weight
        tile = (tile_v * (len(basis_u.creases) + 1) + tile_u).astype(np.int32)
        return SurfaceSample(total, du, dv, tile, np.ones(len(u), bool))

    @cached_property
    def _coefficients(self) -> Array:
        """The patch in each rectangle of knots as a polynomial: (powers of v, of u, 3 or 4, rectangles).

        By the place in the rectangle, -½ to ½ either way; row by row.
        """
        rows, columns = np.shape(self.points)[:2]
        across, up = (basis.pieces for basis in self._bases)
        net = self._homogeneous.reshape(-1, rows, columns)
        around = net[:, up.point[:, None, :, None], across.point[None, :, None, :]]
        table = np.einsum("ivp,juq,kijvu->pqkvu", up.values, across.values, around, optimize=True)
        return np.ascontiguousarray(table.reshape(*table.shape[:3], -1))

    def _evaluate_block(self, u: Array, v: Array, total: Array) -> None:
        """Homogeneous positions at u, v into ``total``."""
        basis_u, basis_v = self._bases
        (column, a), (row, b) = basis_u.locate(u), basis_v.locate(v)
        evaluate_pieces(self._coefficients, row * len(basis_u.pieces.middle) + column, a, b, total)

    def _combine_rows(self, up: Acting, across: Acting) -> Array:
        """Combine H rows of parameters that have the same W in each of them, (3 or 4, H · W).

        Along v once a row, then along u the curve that this gives.
        """
        flat = self._homogeneous
        rows, columns = np.shape(self.points)[:2]
        net = flat.reshape(-1, rows, columns)
        total = np.empty((len(flat), up.point.shape[1], across.point.shape[1]))
        term = np.empty((len(flat), across.point.shape[1]))
        for row in range(up.point.shape[1]):
            curve = np.einsum("r,krc->kc", up.value[:, row], net[:, up.point[:, row]])
            target = total[:, row]
            np.multiply(curve.take(across.point[0], 1), across.value[0], out=target)
            for place, weight in zip(across.point[1:], across.value[1:], strict=True):
                target += np.multiply(curve.take(place, 1), weight, out=term)
        return total.reshape(len(flat), -1)

    def _combine(self, up: Acting, across: Acting, total: Array, du: Array, dv: Array) -> None:
        """Add homogeneous positions and their derivatives by the knot values of u and v, (3 or 4, N) each."""
        width = np.shape(self.points)[1]
        flat = self._homogeneous
        curve, tangent, term = np.empty((3, *total.shape))
        for row, weight, slope in zip(*up, strict=True):
            # Along u first: both derivatives share what that gives.
            curve[:], tangent[:] = 0.0, 0.0
            for column, of_column, slope_of_column in zip(*across, strict=True):
                point = flat.take(row * width + column, 1)
                curve += np.multiply(point, of_column, out=term)
                tangent += np.multiply(point, slope_of_column, out=term)
            total += np.multiply(curve, weight, out=term)
            du += np.multiply(tangent, weight, out=term)
            dv += np.multiply(curve, slope, out=term)


def _row_length(u: Array, v: Array) -> int:
    """W where u, v (N,) are rows of W parameters with one v each and the same u in all, else 0."""
    if len(v) == 0:
        return 0
    differs = v != v[0]
    width = int(differs.argmax()) or len(v)
    if len(v) % width:
        return 0
    across, up = u.reshape(-1, width), v.reshape(-1, width)
    return width if (up == up[:, :1]).all() and (across == across[0]).all() else 0


def fitted_points(samples: Array, weights: Array, along_u: NurbsAxis, along_v: NurbsAxis) -> Array:
    """The control points of the patch that passes through samples, or nearest by, (rows, columns, 3).

    samples: (V, U, 3) at parameters even in the knots: both ends among them, or
    on a cyclic axis the first alone, as Blender tessellates. weights: (rows,
    columns) of the control points, > 0. Least squares in homogeneous space.
    """
    rows, columns = weights.shape
    of_row = _collocation(Basis(along_v, rows), samples.shape[0])
    of_column = _collocation(Basis(along_u, columns), samples.shape[1])
    scaled = samples * (of_row @ weights @ of_column.T)[..., None]
    from_row, from_column = (np.linalg.pinv(matrix, UNSEEN) for matrix in (of_row, of_column))
    points: Array = np.einsum("rv,vux,cu->rcx", from_row, scaled, from_column, optimize=True)
    return points / weights[..., None]


def _collocation(basis: Basis, samples: int) -> Array:
    """The basis functions (columns) at even parameters (rows), (samples, count)."""
    step = samples if basis.axis.cyclic else max(samples - 1, 1)
    return functions(basis, np.arange(samples) / step)


def functions(basis: Basis, parameter: Array) -> Array:
    """Values of the basis functions (columns) at parameters (N,) (rows), (N, count)."""
    acting = basis.acting(basis.at(parameter)[0])
    matrix = np.zeros((len(parameter), basis.count))
    np.add.at(matrix, (np.arange(len(parameter)), acting.point), acting.value)
    return matrix
