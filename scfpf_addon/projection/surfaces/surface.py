# SPDX-License-Identifier: GPL-3.0-or-later
"""Control surfaces: parametric sheets Q(u, v) with their derivatives.

A kind is one class, which maps (u, v) in [0, 1]² to the surface's own space; ``matrix`` places it in the
volume's space. With the camera looking along -Z, u grows to the right and v up. Angles are radians.
"""

from __future__ import annotations

from dataclasses import dataclass, field, replace
from functools import cached_property
from typing import NamedTuple, Self

import numpy as np

from ..arrays import BLOCK, evaluate_pieces, transform
from ..typing import Array, BoolArray, IndexArray


class SurfaceSample(NamedTuple):
    """A control surface at N parameters.

    position, du, dv: (3, N). tile: (N,) int32, the smooth piece that (u, v)
    falls in; derivatives are one-sided at its edges. valid: (N,) bool, False
    where the surface has a hole.
    """

    position: Array
    du: Array
    dv: Array
    tile: IndexArray
    valid: BoolArray


class SurfacePositions(NamedTuple):
    """A control surface at N parameters, without derivatives. position: (3, N). valid: (N,) bool."""

    position: Array
    valid: BoolArray


def _rows(*components: Array) -> Array:
    return np.stack(np.broadcast_arrays(*components))


def _box(x: float, y: float, z: float) -> Array:
    """The corners (3, 8) of a box about the origin that reaches to x, y, z."""
    return np.stack(np.meshgrid([-x, x], [-y, y], [-z, z])).reshape(3, -1)


def _bilinear(terms: tuple[Array, Array, Array, Array], u: Array, v: Array) -> Array:
    """a + b·u + c·v + d·u·v, (3, N), of four vectors (3,); terms that are 0 cost nothing."""
    constant, by_u, by_v, by_uv = terms
    result = np.empty((3, len(u)))
    term = np.empty(len(u))
    for row, target in enumerate(result):
        if by_u[row] or by_uv[row]:
            if by_uv[row]:
                np.multiply(v, by_uv[row], out=target)
                target += by_u[row]
                target *= u
            else:
                np.multiply(u, by_u[row], out=target)
            target += constant[row]
        else:
            target.fill(constant[row])
        if by_v[row]:
            target += np.multiply(v, by_v[row], out=term)
    return result


@dataclass(frozen=True)
class ControlSurface:
    """Base of all kinds. matrix: (4, 4) affine, own space to volume space."""

    matrix: Array = field(default_factory=lambda: np.eye(4), kw_only=True)

    def local(self, u: Array, v: Array) -> SurfaceSample:
        """The sample in the surface's own space. u, v: (N,)."""
        raise NotImplementedError

    def local_position(self, u: Array, v: Array) -> SurfacePositions:
        """``local`` without derivatives; kinds override it where that saves work."""
        sample = self.local(u, v)
        return SurfacePositions(sample.position, sample.valid)

    def evaluate(self, u: Array, v: Array) -> SurfaceSample:
        """Position and derivatives in volume space.

        u, v: (N,) in [0, 1]; outside, smooth kinds continue.
        """
        u = np.atleast_1d(np.asarray(u, np.float64))
        v = np.atleast_1d(np.asarray(v, np.float64))
        sample = self.local(u, v)
        linear = self.matrix[:3, :3]
        return sample._replace(
            position=transform(linear, sample.position, self.matrix[:3, 3]),
            du=transform(linear, sample.du),
            dv=transform(linear, sample.dv),
        )

    def positions(self, u: Array, v: Array) -> SurfacePositions:
        """``evaluate`` without derivatives. u, v: (N,) float64."""
        placement = self.local_position(u, v)
        moved = transform(self.matrix[:3, :3], placement.position, self.matrix[:3, 3])
        return placement._replace(position=moved)

    def local_hull(self) -> Array:
        """Points (3, N), own space, whose convex hull holds the surface for u and v in [0, 1]."""
        raise NotImplementedError

    def hull(self) -> Array:
        """``local_hull`` in volume space."""
        return transform(self.matrix[:3, :3], self.local_hull(), self.matrix[:3, 3])

    @property
    def bends(self) -> tuple[float, float] | None:
        """The greatest lengths of the second derivatives by u and by v for u and v in [0, 1], own space.

        None if they are not known. They hold between the lines of ``creases``.
        """
        return None

    @property
    def creases(self) -> tuple[Array, Array]:
        """The u and the v, increasing, at which derivatives may jump."""
        return np.zeros(0), np.zeros(0)

    def transformed(self, matrix: Array) -> Self:
        """The same surface with ``matrix`` (4, 4) applied after its own."""
        return replace(self, matrix=np.asarray(matrix, np.float64) @ self.matrix)

    def _whole(self, position: Array, du: Array, dv: Array) -> SurfaceSample:
        count = position.shape[1]
        return SurfaceSample(position, du, dv, np.zeros(count, np.int32), np.ones(count, bool))

    def _placed(self, *components: Array) -> SurfacePositions:
        return SurfacePositions(_rows(*components), np.ones(np.shape(components[0]), bool))


@dataclass(frozen=True)
class Point(ControlSurface):
    """A centre of projection: every (u, v) lies at the origin, and both derivatives vanish."""

    def local(self, u: Array, v: Array) -> SurfaceSample:
        nought = np.zeros((3, len(u)))
        return self._whole(nought, nought, nought)

    def local_hull(self) -> Array:
        return np.zeros((3, 1))

    @property
    def bends(self) -> tuple[float, float]:
        return 0.0, 0.0


@dataclass(frozen=True)
class Plane(ControlSurface):
    """A width × height rectangle in the XY plane, centred at the origin."""

    width: float = 1.0
    height: float = 1.0

    def positions(self, u: Array, v: Array) -> SurfacePositions:
        across, up = self.matrix[:3, 0] * self.width, self.matrix[:3, 1] * self.height
        corner = self.matrix[:3, 3] - 0.5 * (across + up)
        return SurfacePositions(_bilinear((corner, across, up, np.zeros(3)), u, v), np.ones(len(u), bool))

    def local(self, u: Array, v: Array) -> SurfaceSample:
        zero, one = np.zeros_like(u), np.ones_like(u)
        return self._whole(
            _rows((u - 0.5) * self.width, (v - 0.5) * self.height, zero),
            _rows(self.width * one, zero, zero),
            _rows(zero, self.height * one, zero),
        )

    def local_hull(self) -> Array:
        return _box(0.5 * self.width, 0.5 * self.height, 0.0)

    @property
    def bends(self) -> tuple[float, float]:
        return 0.0, 0.0


@dataclass(frozen=True)
class BilinearPatch(ControlSurface):
    """Four corners joined bilinearly. corners: (4, 3) at (u,v) = 00, 10, 01, 11."""

    corners: Array = field(
        default_factory=lambda: np.array([[-1.0, -1, 0], [1, -1, 0], [-1, 1, 0], [1, 1, 0]]) / 2
    )

    def positions(self, u: Array, v: Array) -> SurfacePositions:
        linear = self.matrix[:3, :3]
        c00, c10, c01, c11 = np.asarray(self.corners, np.float64) @ linear.T + self.matrix[:3, 3]
        terms = (c00, c10 - c00, c01 - c00, c11 - c10 - c01 + c00)
        return SurfacePositions(_bilinear(terms, u, v), np.ones(len(u), bool))

    def local(self, u: Array, v: Array) -> SurfaceSample:
        c00, c10, c01, c11 = np.asarray(self.corners, np.float64)[:, :, None]
        bottom, top = c00 + (c10 - c00) * u, c01 + (c11 - c01) * u
        along = (c10 - c00) * (1 - v) + (c11 - c01) * v
        return self._whole(bottom + (top - bottom) * v, along, top - bottom)

    def local_hull(self) -> Array:
        return np.asarray(self.corners, np.float64).T

    @property
    def bends(self) -> tuple[float, float]:
        return 0.0, 0.0


@dataclass(frozen=True)
class Disc(ControlSurface):
    """A disc in the XY plane: u turns through ``arc`` from +X, v is the radius."""

    radius: float = 1.0
    arc: float = 2 * np.pi

    def local(self, u: Array, v: Array) -> SurfaceSample:
        angle = self.arc * u
        cos, sin, zero = np.cos(angle), np.sin(angle), np.zeros_like(u)
        r = self.radius * v
        return self._whole(
            _rows(r * cos, r * sin, zero),
            self.arc * _rows(-r * sin, r * cos, zero),
            self.radius * _rows(cos, sin, zero),
        )

    def local_hull(self) -> Array:
        return _box(self.radius, self.radius, 0.0)

    @property
    def bends(self) -> tuple[float, float]:
        return self.arc**2 * abs(self.radius), 0.0


@dataclass(frozen=True)
class Paraboloid(ControlSurface):
    """A paraboloid about +Z with its vertex at the origin: u turns through ``arc`` from +X, v is the radius.

    It opens towards +Z up to ``depth``; its focus is at z = radius² / (4 depth).
    """

    radius: float = 1.0
    arc: float = 2 * np.pi
    depth: float = 0.5

    def local(self, u: Array, v: Array) -> SurfaceSample:
        angle = self.arc * u
        cos, sin, zero = np.cos(angle), np.sin(angle), np.zeros_like(u)
        r = self.radius * v
        return self._whole(
            _rows(r * cos, r * sin, self.depth * v * v),
            self.arc * _rows(-r * sin, r * cos, zero),
            _rows(self.radius * cos, self.radius * sin, 2.0 * self.depth * v),
        )

    def local_hull(self) -> Array:
        hull = _box(self.radius, self.radius, 0.5 * self.depth)
        hull[2] += 0.5 * self.depth
        return hull

    @property
    def bends(self) -> tuple[float, float]:
        return self.arc**2 * abs(self.radius), 2.0 * abs(self.depth)


@dataclass(frozen=True)
class Cone(ControlSurface):
    """A cone about +Y. u turns through ``arc`` with -Z in the middle (u = ½).

    v runs along the axis over ``height``, centred; the radius goes from
    ``radius_start`` at v = 0 to ``radius_end`` at v = 1.
    """

    radius_start: float = 1.0
    radius_end: float = 0.5
    arc: float = 2 * np.pi
    height: float = 1.0

    def local_position(self, u: Array, v: Array) -> SurfacePositions:
        angle = (u - 0.5) * self.arc
        r = self.radius_start + (self.radius_end - self.radius_start) * v
        return self._placed(r * np.sin(angle), (v - 0.5) * self.height, -r * np.cos(angle))

    def local(self, u: Array, v: Array) -> SurfaceSample:
        angle = (u - 0.5) * self.arc
        cos, sin, zero = np.cos(angle), np.sin(angle), np.zeros_like(u)
        slope = self.radius_end - self.radius_start
        r = self.radius_start + slope * v
        return self._whole(
            _rows(r * sin, (v - 0.5) * self.height, -r * cos),
            self.arc * _rows(r * cos, zero, r * sin),
            _rows(slope * sin, self.height + zero, -slope * cos),
        )

    def local_hull(self) -> Array:
        radius = max(abs(self.radius_start), abs(self.radius_end))
        return _box(radius, 0.5 * self.height, radius)

    @property
    def bends(self) -> tuple[float, float]:
        return self.arc**2 * max(abs(self.radius_start), abs(self.radius_end)), 0.0


@dataclass(frozen=True)
class Cylinder(ControlSurface):
    """A cylinder about +Y: u turns through ``arc`` with -Z in the middle, v is the height."""

    radius: float = 1.0
    arc: float = 2 * np.pi
    height: float = 1.0

    def local_position(self, u: Array, v: Array) -> SurfacePositions:
        return Cone(self.radius, self.radius, self.arc, self.height).local_position(u, v)

    def local(self, u: Array, v: Array) -> SurfaceSample:
        return Cone(self.radius, self.radius, self.arc, self.height).local(u, v)

    def local_hull(self) -> Array:
        return _box(self.radius, 0.5 * self.height, self.radius)

    @property
    def bends(self) -> tuple[float, float]:
        return self.arc**2 * abs(self.radius), 0.0


@dataclass(frozen=True)
class SphereSector(ControlSurface):
    """A sector of a sphere with its poles on ±Y.

    u is longitude through ``arc`` with -Z in the middle; v is latitude from
    ``latitude_start`` to ``latitude_end``. At a pole du vanishes.
    """

    radius: float = 1.0
    arc: float = 2 * np.pi
    latitude_start: float = -np.pi / 2
    latitude_end: float = np.pi / 2

    def local(self, u: Array, v: Array) -> SurfaceSample:
        longitude = (u - 0.5) * self.arc
        extent = self.latitude_end - self.latitude_start
        latitude = self.latitude_start + extent * v
        sin_u, cos_u = np.sin(longitude), np.cos(longitude)
        sin_v, cos_v = np.sin(latitude), np.cos(latitude)
        return self._whole(
            self.radius * _rows(cos_v * sin_u, sin_v, -cos_v * cos_u),
            self.radius * self.arc * _rows(cos_v * cos_u, np.zeros_like(u), cos_v * sin_u),
            self.radius * extent * _rows(-sin_v * sin_u, cos_v, sin_v * cos_u),
        )

    def local_hull(self) -> Array:
        return _box(self.radius, self.radius, self.radius)

    @property
    def bends(self) -> tuple[float, float]:
        extent = self.latitude_end - self.latitude_start
        return self.arc**2 * abs(self.radius), extent**2 * abs(self.radius)


@dataclass(frozen=True)
class Grid(ControlSurface):
    """A regular grid of points, joined bilinearly cell by cell.

    points: (rows, columns, 3), rows along v and columns along u, at least 2 × 2.
    Derivatives at a grid line are those of the cell to its right and above, at
    the far border those of the last cell. Raises ValueError for a smaller grid.
    """

    points: Array = field(default_factory=lambda: np.zeros((2, 2, 3)))

    def __post_init__(self) -> None:
        shape = np.shape(self.points)
        if len(shape) != 3 or shape[2] != 3 or min(shape[:2]) < 2:
            raise ValueError(f"a grid needs at least 2 × 2 points, got shape {shape}")

    @cached_property
    def _polynomials(self) -> Array:
        """Each cell's corner, edges and twist: its polynomial by the place in it, (2, 2, 3, cells).

        As ``evaluate_pieces`` takes it: powers along v, along u, component.
        """
        points = np.asarray(self.points, np.float64).transpose(2, 0, 1)
        corner, beside, above = points[:, :-1, :-1], points[:, :-1, 1:], points[:, 1:, :-1]
        right, up = beside - corner, above - corner
        table = np.array([[corner, right], [up, points[:, 1:, 1:] - above - right]])
        return np.ascontiguousarray(table.reshape(2, 2, 3, -1))

    def local(self, u: Array, v: Array) -> SurfaceSample:
        rows, columns = self.points.shape[:2]
        cell, a, b = self._cells(u, v)
        (corner, right), (up, twist) = self._polynomials.take(cell, 3)
        along, across = right + twist * b, up + twist * a
        return self._whole(corner + along * a + up * b, (columns - 1) * along, (rows - 1) * across)

    def local_position(self, u: Array, v: Array) -> SurfacePositions:
        """The positions, computed for a block of points at a time."""
        position = np.empty((3, len(u)))
        for start in range(0, len(u), BLOCK):
            part = slice(start, start + BLOCK)
            evaluate_pieces(self._polynomials, *self._cells(u[part], v[part]), position[:, part])
        return SurfacePositions(position, np.ones(len(u), bool))

    def _cells(self, u: Array, v: Array) -> tuple[IndexArray, Array, Array]:
        """The cells that hold (u, v), (N,), and the places in them."""
        rows, columns = self.points.shape[:2]
        across, up = u * (columns - 1), v * (rows - 1)
        # Conversion to integers truncates, which is right from 0 on.
        column = np.clip(across.astype(np.int64), 0, columns - 2)
        row = np.clip(up.astype(np.int64), 0, rows - 2)
        return row * (columns - 1) + column, across - column, up - row

    def local_hull(self) -> Array:
        return np.asarray(self.points, np.float64).reshape(-1, 3).T

    @property
    def bends(self) -> tuple[float, float]:
        return 0.0, 0.0

    @property
    def creases(self) -> tuple[Array, Array]:
        rows, columns = self.points.shape[:2]
        return np.linspace(0.0, 1.0, columns), np.linspace(0.0, 1.0, rows)
