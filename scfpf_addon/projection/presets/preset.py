# SPDX-License-Identifier: GPL-3.0-or-later
"""Presets: a projection as a JSON file, checked, and the viewing volume that it describes.

Lengths in a file are Blender units in camera space (looking along -Z), angles
degrees. Inside, angles are radians and their keys lose "_degrees".
"""

from __future__ import annotations

import json
from dataclasses import dataclass, replace
from pathlib import Path
from time import monotonic
from typing import Literal, NamedTuple, cast

import numpy as np

from ..file_limits import (
    MAXIMUM_SURFACES,
    PresetError,
    check_numbers,
    check_nurbs_points,
    check_size,
    check_time,
    parsed,
    read_bytes,
)
from ..file_values import (
    COORDINATE,
    LENGTH,
    SMALLEST_LENGTH,
    Limit,
    degrees,
    parameter_data,
    read_choice,
    read_name,
    read_number,
    read_object,
    read_parameters,
    read_points,
    read_range,
    read_text,
    read_vector,
)
from ..mappings.kinds import ImageMapping, mapping_data, read_mappings
from ..mappings.stack import seen_through
from ..surfaces.kinds import FILE_KINDS, surface_from_parameters
from ..surfaces.surface import ControlSurface
from ..surfaces.uv_chart import UVChart
from ..typing import Array
from ..volume.basis import LARGEST_WEIGHT, SMALLEST_WEIGHT, WEIGHTED, BasisKind
from ..volume.reparameterisation import cropped_ranges, reparameterisation
from ..volume.viewing_volume import Projection, ViewingVolume
from .euler import euler_angles, euler_matrix
from .uv_mesh_data import mesh_data, read_mesh

__all__ = [
    "FORMAT",
    "MAXIMUM_SURFACES",
    "Preset",
    "PresetError",
    "PresetSurface",
    "SubjectBox",
    "load_preset",
    "preset_to_json",
    "read_preset",
]

FORMAT = 1
BASES = ("BEZIER", "POLYLINE", "B_SPLINE", "NURBS", "SMOOTH")
REPARAMETERISATIONS = ("RECTANGLE", "POLAR")
FITS = ("WIDTH", "HEIGHT", "CROP", "NONE")
# Cosine between the axes of a surface beyond which it counts as sheared: float32 with room to spare.
SHEAR_TOLERANCE = 1e-5

FitKind = Literal["WIDTH", "HEIGHT", "CROP", "NONE"]

_ANGLE = Limit(-36000.0, 36000.0)
_ASPECT = Limit(1e-3, 1e3)
_WEIGHT = Limit(SMALLEST_WEIGHT, LARGEST_WEIGHT)


class SubjectBox(NamedTuple):
    """The box in camera space that a volume is built around: its centre and its size."""

    centre: tuple[float, float, float]
    size: tuple[float, float, float]


@dataclass(frozen=True)
class PresetSurface:
    """A control surface of a preset.

    kind: as in ``surface_from_parameters``. matrix: (4, 4), own space to camera space. parameters: the kind's
    numbers, angles in radians. points: (rows, columns, 3) float64, rows along v, for PATCH and GRID, with 3
    or 4 numbers each for NURBS, (V, 3) for UV_MESH. None for the other kinds. weight: of the surface in
    projectors of NURBS, its place in smooth ones. chart: the triangles of a UV_MESH.
    """

    name: str
    kind: str
    matrix: Array
    parameters: dict[str, float]
    points: Array | None = None
    weight: float = 1.0
    chart: UVChart | None = None

    def surface(self) -> ControlSurface:
        """The same as a control surface in camera space."""
        return surface_from_parameters(self.kind, self.parameters, self.points, self.matrix, self.chart)

    def stretched(self, axis: Literal[0, 1], factor: float) -> PresetSurface:
        """The surface with its extent and its place along camera x (0) or y (1) multiplied.

        Along x: width, the points' x and the location's x; along y: height, the
        points' y and the location's y. Radii and arcs stay.
        """
        matrix = self.matrix.copy()
        matrix[axis, 3] *= factor
        parameters = dict(self.parameters)
        extent = ("width", "height")[axis]
        if extent in parameters:
            parameters[extent] *= factor
        points = self.points
        if points is not None:
            points = points.copy()
            points[..., axis] *= factor
        return replace(self, matrix=matrix, parameters=parameters, points=points)


@dataclass(frozen=True)
class Preset:
    """A projection as a preset file describes it, in camera space.

    u_range, v_range: rising, within [0, 1]. aspect: width / height of the image
    that the numbers are made for. fit: what another aspect changes, see ``fitted``.
    group: the heading that menus put it under, perhaps empty. mappings: of the image, before
    the re-parameterisation.
    """

    name: str
    description: str
    source: str
    basis: BasisKind
    reparameterisation: str
    u_range: tuple[float, float]
    v_range: tuple[float, float]
    aspect: float
    fit: FitKind
    surfaces: tuple[PresetSurface, ...]
    subject: SubjectBox | None = None
    group: str = ""
    mappings: tuple[ImageMapping, ...] = ()

    def fitted(self, aspect: float) -> Preset:
        """The preset for an image of another aspect (width / height, > 0).

        WIDTH keeps the volume's extent along y and changes that along x, HEIGHT
        the other way round. CROP shows the largest part of the surfaces that has
        the image's shape. NONE changes nothing but ``aspect``.
        """
        if not (np.isfinite(aspect) and aspect > 0):
            raise PresetError("an image needs a width and a height above 0, not the aspect {0}", aspect)
        surfaces, ranges = self.surfaces, (self.u_range, self.v_range)
        if self.fit == "WIDTH":
            surfaces = tuple(s.stretched(0, aspect / self.aspect) for s in surfaces)
        elif self.fit == "HEIGHT":
            surfaces = tuple(s.stretched(1, self.aspect / aspect) for s in surfaces)
        elif self.fit == "CROP":
            ranges = cropped_ranges(*ranges, aspect / self.aspect)
        return replace(self, aspect=float(aspect), surfaces=surfaces, u_range=ranges[0], v_range=ranges[1])

    def volume(self) -> ViewingVolume:
        """The viewing volume in camera space."""
        weights = tuple(s.weight for s in self.surfaces) if self.basis in WEIGHTED else None
        return ViewingVolume(tuple(s.surface() for s in self.surfaces), self.basis, weights)

    def projection(self, aspect: float) -> Projection:
        """The projection in camera space of an image of this aspect."""
        fitted = self.fitted(aspect)
        return Projection(
            fitted.volume(),
            seen_through(
                tuple(m.mapping() for m in self.mappings), reparameterisation(self.reparameterisation)
            ),
            fitted.u_range,
            fitted.v_range,
            float(aspect),
        )


def read_preset(path: Path) -> Preset:
    """The preset in a file. Raises PresetError, with the file's name, when it is unreadable or wrong."""
    try:
        data = read_bytes(path)
    except OSError as error:
        raise PresetError("cannot read {0}: {1}", path.name, error.strerror or error) from error
    try:
        check_size(len(data))
        return load_preset(data.decode("utf-8-sig"))
    except UnicodeDecodeError as error:
        raise PresetError("{0}: not a text file in UTF-8", path.name) from error
    except PresetError as error:
        raise PresetError("{0}: {1}", path.name, error) from error


def load_preset(text: str) -> Preset:
    """The preset in the text of a file.

    Raises PresetError, whose message names the surface and the key, for anything that is not a preset. No key
    may be missing or unknown, every number is finite and in range, and ``file_limits`` bounds all sizes.
    """
    start = monotonic()
    return _preset(parsed(text), start)


def preset_to_json(preset: Preset) -> str:
    """The text of a preset file, made to be read; ``load_preset`` gives the preset back.

    Raises PresetError for a surface whose axes are sheared: a file has no place for that.
    """
    values: dict[str, object] = {
        "format": FORMAT,
        "name": preset.name,
        "description": preset.description,
        "source": preset.source,
        "basis": preset.basis,
        "reparameterisation": preset.reparameterisation,
        "u_range": list(preset.u_range),
        "v_range": list(preset.v_range),
        "aspect": preset.aspect,
        "fit": preset.fit,
    }
    if preset.group:
        values["group"] = preset.group
    if preset.subject is not None:
        values["subject"] = {"centre": list(preset.subject.centre), "size": list(preset.subject.size)}
    lines = [f"  {_dumps(key)}: {_dumps(value)}" for key, value in values.items()]
    if preset.mappings:
        mappings = ",\n".join(f"    {_dumps(mapping_data(m))}" for m in preset.mappings)
        lines.append(f'  "mappings": [\n{mappings}\n  ]')
    surfaces = [_surface_text(_surface_data(i, s)) for i, s in enumerate(preset.surfaces, 1)]
    lines.append('  "surfaces": [\n' + ",\n".join(surfaces) + "\n  ]")
    return "{\n" + ",\n".join(lines) + "\n}\n"


def _dumps(value: object) -> str:
    return json.dumps(value, ensure_ascii=False, allow_nan=False)


def _surface_text(data: dict[str, object]) -> str:
    lines = []
    for key, value in data.items():
        text = _dumps(value)
        if key == "points":
            text = text.replace("[[[", "[\n        [[").replace("]], [[", "]],\n        [[")
        lines.append(f"      {_dumps(key)}: {text}")
    return "    {\n" + ",\n".join(lines) + "\n    }"


def _surface_data(number: int, surface: PresetSurface) -> dict[str, object]:
    linear = surface.matrix[:3, :3]
    scale = np.sqrt((linear**2).sum(axis=0))
    axes = linear / scale
    if np.abs(axes.T @ axes - np.eye(3)).max() > SHEAR_TOLERANCE:
        raise PresetError(
            "surface {0} {1!r} is sheared; apply its transform to its shape before saving",
            number,
            surface.name,
        )
    if np.linalg.det(axes) < 0:
        # One mirrored axis; which one is a free choice, the rotation follows it.
        scale[2], axes[:, 2] = -scale[2], -axes[:, 2]
    data: dict[str, object] = {"name": surface.name, "kind": surface.kind}
    data |= parameter_data(surface.parameters, FILE_KINDS[surface.kind].limits)
    if surface.points is not None and surface.chart is not None:
        data |= mesh_data(surface.points, surface.chart)
    elif surface.points is not None:
        data["points"] = surface.points.tolist()
    data["location"] = surface.matrix[:3, 3].tolist()
    data["rotation_degrees"] = [degrees(angle) for angle in euler_angles(axes)]
    data["scale"] = scale.tolist()
    if surface.weight != 1.0:
        data["weight"] = surface.weight
    return data


def _preset(data: object, start: float) -> Preset:
    about = ("format", "name", "description", "source")
    settings = ("basis", "reparameterisation", "u_range", "v_range", "aspect", "fit", "surfaces")
    values = read_object(data, "the preset", (*about, *settings), ("subject", "group", "mappings"))
    if type(values["format"]) is not int or values["format"] != FORMAT:
        raise PresetError(
            "format must be {0}, the only one that this version of Flexible Projection reads", FORMAT
        )
    items = values["surfaces"]
    if not isinstance(items, list) or not 2 <= len(items) <= MAXIMUM_SURFACES:
        raise PresetError("surfaces must be a list of 2 to {0} surfaces", MAXIMUM_SURFACES)
    return Preset(
        name=read_name(values["name"], "name"),
        description=read_text(values["description"], "description"),
        source=read_text(values["source"], "source"),
        basis=cast(BasisKind, read_choice(values["basis"], "basis", BASES)),
        reparameterisation=read_choice(
            values["reparameterisation"], "reparameterisation", REPARAMETERISATIONS
        ),
        u_range=read_range(values["u_range"], "u_range"),
        v_range=read_range(values["v_range"], "v_range"),
        aspect=read_number(values["aspect"], "aspect", _ASPECT),
        fit=cast(FitKind, read_choice(values["fit"], "fit", FITS)),
        surfaces=_surfaces(items, start),
        subject=_subject(values["subject"]) if "subject" in values else None,
        group=read_name(values["group"], "group") if "group" in values else "",
        mappings=read_mappings(values.get("mappings", [])),
    )


def _surfaces(items: list[object], start: float) -> tuple[PresetSurface, ...]:
    surfaces: list[PresetSurface] = []
    numbers = nurbs_points = 0
    for number, item in enumerate(items, 1):
        one = _surface(item, number)
        check_time(start)
        surfaces.append(one)
        if one.points is not None:
            numbers += one.points.size
            nurbs_points += one.points[..., 0].size * (one.kind == "NURBS")
            if one.chart is not None:
                # A file has a UV for each point.
                numbers += one.chart.vertices.size + 2 * len(one.points)
        check_numbers(numbers)
        check_nurbs_points(nurbs_points)
    return tuple(surfaces)


def _surface(data: object, number: int) -> PresetSurface:
    where = f"surface {number}"
    if not isinstance(data, dict):
        raise PresetError("{0} must be an object", where)
    for key in ("name", "kind"):
        if key not in data:
            raise PresetError("{0} needs {1}", where, key)
    name = read_name(data["name"], f"{where}: name")
    where = f"{where} {name!r}"
    kind = FILE_KINDS[read_choice(data["kind"], f"{where}: kind", tuple(FILE_KINDS))]
    shape = ("points", "uv", "triangles") if kind.has_chart else ("points",) * (kind.net is not None)
    required = ("name", "kind", *kind.limits, *shape)
    values = read_object(data, where, required, ("location", "rotation_degrees", "scale", "weight"))
    parameters = read_parameters(values, where, kind.limits)
    points, chart = None, None
    if kind.has_chart:
        points, chart = read_mesh(values, where)
    elif kind.net is not None:
        points = read_points(values["points"], f"{where}: points", *kind.net)
    if problem := kind.problem(parameters, points):
        raise PresetError("{0}: {1}", where, problem)
    return PresetSurface(
        name=name,
        kind=kind.key,
        matrix=_matrix(values, where),
        parameters=parameters,
        points=points,
        weight=read_number(values.get("weight", 1.0), f"{where}: weight", _WEIGHT),
        chart=chart,
    )


def _matrix(values: dict[str, object], where: str) -> Array:
    location = read_vector(values.get("location", [0, 0, 0]), f"{where}: location", COORDINATE)
    angles = read_vector(values.get("rotation_degrees", [0, 0, 0]), f"{where}: rotation_degrees", _ANGLE)
    scale = read_vector(values.get("scale", [1, 1, 1]), f"{where}: scale", COORDINATE)
    if min(map(abs, scale)) < SMALLEST_LENGTH:
        raise PresetError("{0}: scale must not be 0 along any axis", where)
    matrix = np.eye(4)
    matrix[:3, :3] = euler_matrix(np.radians(angles)) * np.array(scale)
    matrix[:3, 3] = location
    return matrix


def _subject(data: object) -> SubjectBox:
    values = read_object(data, "subject", ("centre", "size"))
    return SubjectBox(
        read_vector(values["centre"], "subject: centre", COORDINATE),
        read_vector(values["size"], "subject: size", LENGTH),
    )
