# SPDX-License-Identifier: GPL-3.0-or-later
"""Edits of surfaces and volumes as mathematics: blended, inserted, mirrored, scaled, framed."""

from __future__ import annotations

import math
from collections.abc import Sequence
from typing import NamedTuple

import numpy as np

from ...projection.user_error import UserError
from ..surfaces.kinds import PARAMETRIC_KINDS, Axis, Numbers, parametric_kind
from ..surfaces.surface import BilinearPatch, ControlSurface, Grid, Plane, Point
from ..typing import Array
from ..volume.basis import B_SPLINE_DEGREE
from ..volume.viewing_volume import ViewingVolume

# Two linear parts, two arcs, or two sides of a rectangle agree when they differ by less than this share:
# they come from float32 matrices, whose products are good to about 1e-6.
SAME_SHARE = 1e-5
# The most cells along one direction of a grid that holds two grids' lines at once.
MOST_CELLS = 512
HOLES = "A control surface has holes, which a grid cannot have: fill them first"


class Shape(NamedTuple):
    """A control surface by its kind and numbers, as ``kinds.surface_from_parameters`` takes it.

    points: (rows, columns, 3), own space, or None. exact: False if it was sampled.
    """

    kind: str
    matrix: Array
    parameters: dict[str, float]
    points: Array | None
    exact: bool


def lattice(columns: int, rows: int) -> tuple[Array, Array]:
    """u and v, each (rows·columns,), of an even lattice over [0, 1]², row by row from v = 0."""
    u, v = np.meshgrid(np.linspace(0.0, 1.0, columns), np.linspace(0.0, 1.0, rows))
    return u.ravel(), v.ravel()


def sampled(surface: ControlSurface, columns: int, rows: int) -> Array:
    """Points (rows, columns, 3) of a surface on an even lattice, in volume space.

    Raises UserError for a surface with holes.
    """
    placed = surface.evaluate(*lattice(columns, rows))
    if not placed.valid.all():
        raise UserError(HOLES)
    return placed.position.T.reshape(rows, columns, 3)


def blend(first: ControlSurface, second: ControlSurface, weight: float, cells: int) -> Shape:
    """(1 - weight)·first + weight·second, as a surface.

    Exact for points, planes, patches and grids in any mixture, and for two surfaces of one kind with the same
    angles, rotation and scale. All others become a grid of cells × cells faces.
    """
    flat = [_corners(one) for one in (first, second)]
    if flat[0] is not None and flat[1] is not None:
        return _bilinear((1 - weight) * flat[0] + weight * flat[1])
    same = _same_kind(first, second, weight)
    if same is not None:
        return same
    columns, rows, exact = cells + 1, cells + 1, False
    lines = [_lines(one) for one in (first, second)]
    if lines[0] is not None and lines[1] is not None:
        across, up = (math.lcm(a, b) for a, b in zip(*lines, strict=True))
        if max(across, up) <= MOST_CELLS:
            columns, rows, exact = across + 1, up + 1, True
    points = (1 - weight) * sampled(first, columns, rows) + weight * sampled(second, columns, rows)
    return _with_points("GRID", points, exact)


class Insertion(NamedTuple):
    """A volume with one control surface more.

    shapes: new surfaces; they take the places of ``replaced`` old ones from place ``first``
    on. weights: of all surfaces then, None where the basis has none.
    """

    first: int
    replaced: int
    shapes: list[Shape]
    weights: tuple[float, ...] | None


def inserted(volume: ViewingVolume, index: int, cells: int) -> Insertion:
    """The same volume with one control surface more. cells: as for ``blend``.

    BEZIER: degree elevation, Pi' = i/(m+1)·P(i-1) + (1 - i/(m+1))·Pi for i = 1 … m; the ends stay. POLYLINE:
    a surface half-way between the one at ``index`` and the next. B_SPLINE and NURBS: up to three surfaces
    are elevated, of four the span is cut in two at t = 1/2. Raises UserError for more, as no even spacing of
    knots with one surface more leaves the volume as it is, and for SMOOTH, whose slopes would change.
    """
    surfaces, count = volume.surfaces, len(volume.surfaces)
    if volume.basis == "POLYLINE":
        index = min(index, count - 2)
        return Insertion(index + 1, 0, [blend(surfaces[index], surfaces[index + 1], 0.5, cells)], None)
    if volume.basis == "SMOOTH" and count > 2:
        raise UserError(
            "Smooth projectors change with each new surface: choose another Shape of the projectors first"
        )
    if volume.basis in {"BEZIER", "SMOOTH"} or count <= B_SPLINE_DEGREE:
        shares = [i / count for i in range(1, count)]
    elif count == B_SPLINE_DEGREE + 1:
        # The blossom at (0, 0, ½), (0, ½, 1) and (½, 1, 1).
        shares = [0.5] * (count - 1)
    else:
        raise UserError(
            "B-spline and NURBS projectors of more than four surfaces change with each new one: "
            "choose another Shape of the projectors first"
        )
    if volume.basis != "NURBS":
        return Insertion(1, count - 2, _blends(surfaces, shares, cells), None)
    old = volume.weights or (1.0,) * count
    # The same for the homogeneous control surfaces (w Q, w).
    inner = [s * old[i] + (1 - s) * old[i + 1] for i, s in enumerate(shares)]
    shares = [s * old[i] / w for i, (s, w) in enumerate(zip(shares, inner, strict=True))]
    return Insertion(1, count - 2, _blends(surfaces, shares, cells), (old[0], *inner, old[-1]))


def _blends(surfaces: Sequence[ControlSurface], shares: Sequence[float], cells: int) -> list[Shape]:
    """Blends of surface i with a share of surface i - 1, for i = 1 … m."""
    return [blend(surfaces[i], surfaces[i - 1], share, cells) for i, share in enumerate(shares, 1)]


def _corners(surface: ControlSurface) -> Array | None:
    """(4, 3) corners at (u, v) = 00, 10, 01, 11 of a surface that is bilinear, else None."""
    bilinear = isinstance(surface, Point | Plane | BilinearPatch)
    if not bilinear and _lines(surface) != (1, 1):
        return None
    return sampled(surface, 2, 2).reshape(4, 3)


def _lines(surface: ControlSurface) -> tuple[int, int] | None:
    """Cells along u and v between which a surface is bilinear, or None."""
    if isinstance(surface, Grid):
        return surface.points.shape[1] - 1, surface.points.shape[0] - 1
    return (1, 1) if isinstance(surface, Point | Plane | BilinearPatch) else None


def _bilinear(corners: Array) -> Shape:
    """A plane if the corners (4, 3) make a rectangle, a point if they coincide, else a patch."""
    c00, c10, c01, c11 = corners
    across, up = c10 - c00, c01 - c00
    width, height = float(np.linalg.norm(across)), float(np.linalg.norm(up))
    matrix = np.eye(4)
    matrix[:3, 3] = corners.mean(0)
    size = float(np.abs(corners - matrix[:3, 3]).max())
    if size <= SAME_SHARE * SAME_SHARE * float(np.abs(corners).max()):
        return Shape("POINT", matrix, {}, None, True)
    skew = float(np.abs(c11 - c10 - up).max()) + abs(float(across @ up)) / size
    if min(width, height) > SAME_SHARE * size and skew < SAME_SHARE * size:
        x = across / width
        y = up - (up @ x) * x
        y /= np.linalg.norm(y)
        matrix[:3, :3] = np.stack([x, y, np.cross(x, y)], 1)
        return Shape("PLANE", matrix, {"width": width, "height": height}, None, True)
    return _with_points("PATCH", corners.reshape(2, 2, 3), True)


def _with_points(kind: str, points: Array, exact: bool) -> Shape:
    """A surface with its origin in the middle of its points."""
    matrix = np.eye(4)
    matrix[:3, 3] = points.reshape(-1, 3).mean(0)
    return Shape(kind, matrix, {}, points - matrix[:3, 3], exact)


def _same_kind(first: ControlSurface, second: ControlSurface, weight: float) -> Shape | None:
    """The blend of two surfaces of one curved kind as that kind, or None if it is not of that kind."""
    kind = parametric_kind(first)
    if kind is None or type(first) is not type(second):
        return None
    linear = [one.matrix[:3, :3] for one in (first, second)]
    gram = linear[0].T @ linear[0]
    size = float(np.abs(linear[0]).max())
    # An object has no shear: it cannot hold a matrix whose columns are not at right angles.
    sheared = np.abs(gram - np.diag(np.diag(gram))).max() > SAME_SHARE * size * size
    if sheared or np.abs(linear[0] - linear[1]).max() > SAME_SHARE * size:
        return None
    parameters = {}
    for one in kind.parameters:
        a, b = (float(getattr(surface, one.name)) for surface in (first, second))
        if one.is_angle and abs(a - b) > SAME_SHARE:
            return None
        parameters[one.name] = a if one.is_angle else (1 - weight) * a + weight * b
    return Shape(kind.key, (1 - weight) * first.matrix + weight * second.matrix, parameters, None, True)


def mirrored(kind: str, parameters: Numbers, axis: Axis) -> tuple[Array, dict[str, float]]:
    """The matrix (4, 4) and the parameters that make Q(1-u, v) or Q(u, 1-v) of a parametric surface.

    The matrix goes between the surface's own shape and its placement. Raises UserError for V of a disc,
    whose rim cannot become its centre, and for kinds without parameters.
    """
    if kind not in PARAMETRIC_KINDS:
        raise UserError("a surface of kind {0} is not mirrored by its parameters", kind)
    record = PARAMETRIC_KINDS[kind]
    if axis not in record.mirrors:
        raise UserError(
            "the rim of a {0} cannot become its center: convert it to a grid first", record.title.lower()
        )
    mirror, changed = record.mirrors[axis], dict(parameters)
    if mirror.exchanged:
        first, second = mirror.exchanged
        changed[first], changed[second] = parameters[second], parameters[first]
    return mirror.reflection(parameters), changed


def scaled(kind: str, parameters: Numbers, scale: Sequence[float]) -> dict[str, float]:
    """The parameters of a parametric surface whose lengths are those of one scaled by ``scale`` (3,).

    Signs do not count: the object keeps them. Raises UserError for a scale of 0, for a radius whose axes
    are scaled differently, and for kinds without parameters.
    """
    if kind not in PARAMETRIC_KINDS:
        raise UserError("a surface of kind {0} has no sizes to put a scale into", kind)
    changed = dict(parameters)
    for one in PARAMETRIC_KINDS[kind].parameters:
        if one.is_angle:
            continue
        factors = [abs(scale["XYZ".index(axis)]) for axis in one.axes]
        if min(factors) == 0.0:
            raise UserError("its scale is 0, and no size is")
        if max(factors) - min(factors) > SAME_SHARE * max(factors):
            raise UserError("it is scaled unevenly and no longer round: convert it to a grid first")
        changed[one.name] = parameters[one.name] * factors[0]
    return changed


def framing(pan: float, tilt: float, roll: float, dolly: float, zoom: float) -> Array:
    """The (4, 4) matrix in camera space that frames a volume anew.

    pan, tilt, roll: radians, to the right, upwards, anticlockwise in the
    image. dolly: forwards, Blender units. zoom: > 0, above 1 shows less.
    """
    turn = np.eye(4)
    for angle, (a, b) in ((-pan, (2, 0)), (tilt, (1, 2)), (roll, (0, 1))):
        cos, sin = math.cos(angle), math.sin(angle)
        step = np.eye(4)
        step[a, a] = step[b, b] = cos
        step[b, a], step[a, b] = sin, -sin
        turn = turn @ step
    turn[:3, 3] = [0.0, 0.0, -dolly]
    return np.asarray(turn @ np.diag([1 / zoom, 1 / zoom, 1.0, 1.0]))
