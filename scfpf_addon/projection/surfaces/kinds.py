# SPDX-License-Identifier: GPL-3.0-or-later
"""Records of the kinds of control surface: their numbers, how they are made, mirrored, placed and scaled.

Everything else reads these records; ``bridge.surfaces.kinds`` adds what needs Blender. The formula of a kind
is its class in ``surface``.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping
from dataclasses import dataclass, replace
from typing import Any, Literal, NamedTuple, TypeAlias

import numpy as np

from ..file_values import DEGREES, LENGTH, Limit, Limits
from ..typing import Array
from .nurbs import NurbsAxis, NurbsPatch
from .surface import (
    BilinearPatch,
    Cone,
    ControlSurface,
    Cylinder,
    Disc,
    Grid,
    Paraboloid,
    Plane,
    Point,
    SphereSector,
)
from .uv_chart import UVChart
from .uv_mesh import UVMesh

Axis = Literal["U", "V"]
Numbers: TypeAlias = Mapping[str, float]

# Blender makes no patch of fewer points along a direction.
FEWEST_NURBS_POINTS = 3


class Parameter(NamedTuple):
    """A number that defines a surface.

    name: as in code, such as ``radius_start``. text: its tooltip. limit: its least and greatest value in a
    preset file, in Blender units or degrees. axes: the axes of the surface's own space along which a length
    runs, such as "XZ"; empty for other numbers. is_angle: radians in code, degrees in files.
    """

    name: str
    text: str
    limit: Limit
    axes: str = ""
    is_angle: bool = False

    @property
    def label(self) -> str:
        """The name in the interface."""
        return self.name.replace("_", " ").title()

    @property
    def file_key(self) -> str:
        """The name in preset files."""
        return self.name + DEGREES * self.is_angle

    @property
    def range(self) -> Limit:
        """The least and greatest value in the interface, where a length or an arc may also be 0."""
        low, high = min(self.limit.low, 0.0), self.limit.high
        return Limit(math.radians(low), math.radians(high)) if self.is_angle else Limit(low, high)


class Space(NamedTuple):
    """The room that a new surface fills, facing the camera.

    width, height: Blender units. radius, arc: of a surface that turns about its Y axis and is ``width`` wide.
    """

    width: float
    height: float
    radius: float
    arc: float


class Mirror(NamedTuple):
    """The rule by which Q(1-u, v) or Q(u, 1-v) follows from Q(u, v).

    reflection: a matrix (4, 4) between the surface's own shape and its placement, made from its parameters.
    exchanged: two parameters that trade places.
    """

    reflection: Callable[[Numbers], Array]
    exchanged: tuple[str, str] | None = None


class PointLimits(NamedTuple):
    """The points of a kind in a preset file: exactly (rows, columns), or any; with weights or without."""

    exactly: tuple[int, int] | None = None
    weighted: bool = False


@dataclass(frozen=True, kw_only=True)
class SurfaceKind:
    """A kind of control surface.

    key: its name in files. title, text: its name and tooltip in the interface. parameters: the numbers that
    define it. straight: the directions along which it is straight, of "UV". net: its points in a preset file.
    has_chart: whether it has triangles in UV. build: (parameters, points, chart) → the surface in its own
    space; None for a kind that is several surfaces. problem: (parameters, points) → the reason why a file may
    not have these, or "".
    """

    key: str
    title: str
    text: str
    parameters: tuple[Parameter, ...] = ()
    straight: str = ""
    net: PointLimits | None = None
    has_chart: bool = False
    build: Callable[[Numbers, Any, Any], ControlSurface] | None = None
    problem: Callable[[Numbers, Any], str] = lambda parameters, points: ""

    @property
    def limits(self) -> Limits:
        """The limits of the parameters by their keys in a preset file."""
        return {one.file_key: one.limit for one in self.parameters}


@dataclass(frozen=True, kw_only=True)
class ParametricKind(SurfaceKind):
    """A kind whose shape follows from numbers alone.

    surface: its class, whose fields are the parameters. mirrors: by direction; a missing one is impossible.
    fill: the parameters with which it fills a space. turns_about_y: whether it turns about its Y axis, with
    -Z in the middle of its arc, as around a viewer.
    """

    surface: type[ControlSurface]
    mirrors: Mapping[Axis, Mirror]
    fill: Callable[[Space], dict[str, float]]
    turns_about_y: bool = False

    def default(self, name: str) -> float:
        """The default of a parameter: that of the class."""
        value: float = getattr(self.surface, name)
        return value


def _matrix(x: float, y: float) -> Callable[[Numbers], Array]:
    return lambda parameters: np.diag([x, y, 1.0, 1.0])


def _about_middle_of_arc(parameters: Numbers) -> Array:
    """The reflection about the line in the middle of an arc that begins at +X."""
    matrix = np.eye(4)
    cos, sin = math.cos(parameters["arc"]), math.sin(parameters["arc"])
    matrix[:2, :2] = [[cos, sin], [sin, -cos]]
    return matrix


UNMOVED, FLIPPED_X, FLIPPED_Y = _matrix(1.0, 1.0), _matrix(-1.0, 1.0), _matrix(1.0, -1.0)

_ARC = Parameter("arc", "How far the surface turns as u goes from 0 to 1", Limit(1e-6, 360.0), is_angle=True)
_LATITUDE = Limit(-90.0, 90.0)
# The orders that Blender's interface offers.
_ORDER = Limit(2, 6)
_LENGTH_OR_NOUGHT = Limit(0.0, LENGTH.high)
_RADIUS = "Distance from the axis or center"
_HEIGHT = Parameter("height", "Extent along the axis as v goes from 0 to 1", LENGTH, "Y")


def _cone_problem(parameters: Numbers, points: None) -> str:
    missing = not max(parameters["radius_start"], parameters["radius_end"])
    return "radius_start or radius_end must be above 0" if missing else ""


def _sphere_problem(parameters: Numbers, points: None) -> str:
    equal = parameters["latitude_start"] == parameters["latitude_end"]
    return "latitude_start_degrees and latitude_end_degrees must differ" if equal else ""


def _nurbs_problem(parameters: Numbers, points: Array) -> str:
    rows, columns = points.shape[:2]
    if min(rows, columns) < FEWEST_NURBS_POINTS:
        return "points must be at least 3 × 3 for a surface of kind NURBS"
    for name, count in (("order_u", columns), ("order_v", rows)):
        if not parameters[name].is_integer():
            return f"{name} must be a whole number"
        problem = NurbsAxis(int(parameters[name])).problem(count)
        if problem:
            return f"{name}: {problem}"
    return ""


def _patch(parameters: Numbers, points: Array, chart: None) -> BilinearPatch:
    if points.shape != (2, 2, 3):
        raise ValueError(f"a patch needs 2 × 2 points, got shape {points.shape}")
    return BilinearPatch(points.reshape(4, 3))


def _nurbs(parameters: Numbers, points: Array, chart: None) -> NurbsPatch:
    for name in ("order_u", "order_v"):
        if not float(parameters.get(name, np.nan)).is_integer():
            raise ValueError(f"a surface of kind NURBS needs {name}, a whole number")
    return NurbsPatch(points, *(NurbsAxis(int(parameters[name])) for name in ("order_u", "order_v")))


# Meshes in saved files name parametric kinds by their places among each other here: new ones come last.
_KINDS = (
    ParametricKind(
        key="POINT",
        title="Point",
        text="One point for the whole picture, such as a center of projection",
        straight="UV",
        surface=Point,
        mirrors={"U": Mirror(UNMOVED), "V": Mirror(UNMOVED)},
        fill=lambda space: {},
    ),
    ParametricKind(
        key="PLANE",
        title="Plane",
        text="A rectangle",
        straight="UV",
        parameters=(
            Parameter("width", "Extent along X as u goes from 0 to 1", LENGTH, "X"),
            Parameter("height", "Extent along Y as v goes from 0 to 1", LENGTH, "Y"),
        ),
        surface=Plane,
        mirrors={"U": Mirror(FLIPPED_X), "V": Mirror(FLIPPED_Y)},
        fill=lambda space: {"width": space.width, "height": space.height},
    ),
    SurfaceKind(
        key="PATCH",
        title="Patch",
        text="Four corners joined bilinearly: a mesh of one quadrilateral with a UV map",
        straight="UV",
        net=PointLimits(exactly=(2, 2)),
        build=_patch,
    ),
    ParametricKind(
        key="DISC",
        title="Disk",
        text="A disk: u turns about the center, v runs outwards",
        straight="V",
        parameters=(Parameter("radius", "Distance from the center at v = 1", LENGTH, "XY"), _ARC),
        surface=Disc,
        mirrors={"U": Mirror(_about_middle_of_arc)},
        fill=lambda space: {"radius": max(space.width, space.height) / 2},
    ),
    ParametricKind(
        key="CYLINDER",
        title="Cylinder",
        text="An arc of a cylinder about the Y axis, open towards +Z",
        straight="V",
        parameters=(Parameter("radius", _RADIUS, LENGTH, "XZ"), _ARC, _HEIGHT),
        surface=Cylinder,
        mirrors={"U": Mirror(FLIPPED_X), "V": Mirror(FLIPPED_Y)},
        fill=lambda space: {"radius": space.radius, "arc": space.arc, "height": space.height},
        turns_about_y=True,
    ),
    ParametricKind(
        key="CONE",
        title="Cone",
        text="An arc of a cone about the Y axis, open towards +Z",
        straight="V",
        parameters=(
            Parameter("radius_start", "Distance from the axis at v = 0", _LENGTH_OR_NOUGHT, "XZ"),
            Parameter("radius_end", "Distance from the axis at v = 1", _LENGTH_OR_NOUGHT, "XZ"),
            _ARC,
            _HEIGHT,
        ),
        surface=Cone,
        mirrors={"U": Mirror(FLIPPED_X), "V": Mirror(FLIPPED_Y, ("radius_start", "radius_end"))},
        fill=lambda space: {
            "radius_start": space.radius,
            "radius_end": space.radius / 2,
            "arc": space.arc,
            "height": space.height,
        },
        turns_about_y=True,
        problem=_cone_problem,
    ),
    ParametricKind(
        key="SPHERE",
        title="Sphere",
        text="A sector of a sphere with its poles on the Y axis",
        parameters=(
            Parameter("radius", _RADIUS, LENGTH, "XYZ"),
            _ARC,
            Parameter("latitude_start", "Latitude at v = 0", _LATITUDE, is_angle=True),
            Parameter("latitude_end", "Latitude at v = 1", _LATITUDE, is_angle=True),
        ),
        surface=SphereSector,
        mirrors={"U": Mirror(FLIPPED_X), "V": Mirror(UNMOVED, ("latitude_start", "latitude_end"))},
        fill=lambda space: {"radius": space.radius, "arc": space.arc},
        turns_about_y=True,
        problem=_sphere_problem,
    ),
    ParametricKind(
        key="PARABOLOID",
        title="Paraboloid",
        text="A dish about the Z axis, open towards +Z: u turns about the axis, v runs outwards",
        parameters=(
            Parameter("radius", "Distance from the axis at v = 1", LENGTH, "XY"),
            _ARC,
            Parameter("depth", "Extent along the axis from the vertex to v = 1", LENGTH, "Z"),
        ),
        surface=Paraboloid,
        mirrors={"U": Mirror(_about_middle_of_arc)},
        fill=lambda space: {
            "radius": max(space.width, space.height) / 2,
            "depth": max(space.width, space.height) / 4,
        },
    ),
    SurfaceKind(
        key="GRID",
        title="Grid",
        text="A mesh whose vertices lie on a regular grid in its UV map",
        net=PointLimits(),
        build=lambda parameters, points, chart: Grid(points),
    ),
    SurfaceKind(
        key="UV_MESH",
        title="UV Mesh",
        text="Any mesh with a UV map: (u, v) is where the map has it; islands may be apart",
        has_chart=True,
        build=lambda parameters, points, chart: UVMesh(points, chart),
    ),
    SurfaceKind(
        key="NURBS",
        title="Surface Patch",
        text="A B-spline, NURBS or Bézier patch: a surface object with one net of points",
        parameters=(
            Parameter("order_u", "Order of the patch along u", _ORDER),
            Parameter("order_v", "Order of the patch along v", _ORDER),
        ),
        net=PointLimits(weighted=True),
        build=_nurbs,
        problem=_nurbs_problem,
    ),
    SurfaceKind(
        key="LATTICE",
        title="Lattice",
        text="A Lattice object: alone the whole volume, as its modifier deforms the box from +Z to -Z; "
        "among others its layers along W are control surfaces",
    ),
)
SURFACE_KINDS = {kind.key: kind for kind in _KINDS}
PARAMETRIC_KINDS = {kind.key: kind for kind in _KINDS if isinstance(kind, ParametricKind)}
# Kinds that preset files may have.
FILE_KINDS = {kind.key: kind for kind in _KINDS if isinstance(kind, ParametricKind) or kind.build}


def parametric_kind(surface: ControlSurface) -> ParametricKind | None:
    """The parametric kind that a surface is of, or None."""
    return next((kind for kind in PARAMETRIC_KINDS.values() if type(surface) is kind.surface), None)


def surface_from_parameters(
    kind: str,
    parameters: Numbers,
    points: Array | None,
    matrix: Array,
    chart: UVChart | None = None,
) -> ControlSurface:
    """The control surface of a kind.

    kind: one of ``FILE_KINDS``. parameters: those of the kind, lengths and radians; others are ignored.
    points: in the surface's own space, rows along v: (rows, columns, 3) for GRID, (2, 2, 3) for PATCH, (rows,
    columns, 3 or 4) with weights for NURBS, (V, 3) with a chart for UV_MESH. A NURBS patch begins and ends at
    its outer points. matrix: (4, 4), own space to volume space.
    Raises ValueError for an unknown kind or a missing parameter.
    """
    if kind not in FILE_KINDS:
        raise ValueError(f"unknown surface kind {kind!r}")
    record, placed = FILE_KINDS[kind], np.asarray(matrix, np.float64)
    if isinstance(record, ParametricKind):
        missing = [one.name for one in record.parameters if one.name not in parameters]
        if missing:
            raise ValueError(f"a surface of kind {kind} needs {', '.join(missing)}")
        return record.surface(
            **{one.name: float(parameters[one.name]) for one in record.parameters}, matrix=placed
        )
    if points is None or (record.has_chart and chart is None):
        raise ValueError(f"a surface of kind {kind} needs points{' and a chart' * record.has_chart}")
    assert record.build is not None
    return replace(record.build(parameters, np.asarray(points, np.float64), chart), matrix=placed)
