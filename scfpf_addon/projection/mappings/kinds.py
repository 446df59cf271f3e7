# SPDX-License-Identifier: GPL-3.0-or-later
"""Mappings of the image as data: their kinds, the limits of their numbers, and their form in files."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field

import numpy as np

from ..file_limits import PresetError
from ..file_values import (
    Limit,
    Limits,
    parameter_data,
    read_choice,
    read_name,
    read_number,
    read_numbers,
    read_object,
    read_parameters,
)
from ..typing import Array
from ..volume.reparameterisation import Reparameterisation
from .calibrated import CalibratedLens, lens_data, read_lens
from .grids import DeformedGrid
from .radial import CurvedDisplay, Distortion, MagicLens, RadialCurve
from .stack import InverseMapping, PartialMapping

MAXIMUM_MAPPINGS = 32
# Points of a radial curve, and of a deformed grid along each side.
MOST_CURVE_POINTS, MOST_GRID_POINTS = 257, 256
# Places as shares of the image, radii in halves of its shorter side.
PLACE = Limit(-10.0, 10.0)
RADIUS = Limit(1e-4, 20.0)
COEFFICIENT = Limit(-100.0, 100.0)
INFLUENCE = Limit(-2.0, 2.0)
_RADII = Limit(0.0, RADIUS.high)

COEFFICIENTS = ("k1", "k2", "k3", "k4", "k5", "k6")
# The numbers of each kind, by their names in a file.
KINDS: dict[str, Limits] = {
    "RADIAL_CURVE": {"centre_x": PLACE, "centre_y": PLACE},
    "LENS": {
        "centre_x": PLACE,
        "centre_y": PLACE,
        "radius": RADIUS,
        "magnification": Limit(0.01, 100.0),
        "falloff": Limit(0.0, 1.0),
    },
    "DISTORTION": {
        "centre_x": PLACE,
        "centre_y": PLACE,
        "radius": RADIUS,
        **dict.fromkeys(COEFFICIENTS, COEFFICIENT),
    },
    "DISPLAY": {"arc_degrees": Limit(0.1, 170.0), "distance": Limit(0.05, 1000.0)},
    "GRID": {},
    "CALIBRATION": {},
}
# Those that a file may leave out.
_DEFAULTS = {"centre_x": 0.5, "centre_y": 0.5} | dict.fromkeys(COEFFICIENTS, 0.0)
_WITH_POINTS = ("RADIAL_CURVE", "GRID")
_WITH_LENS = "CALIBRATION"


@dataclass(frozen=True, eq=False)
class ImageMapping:
    """A mapping of a stack.

    kind: of KINDS. parameters: its numbers, angles in radians and without "_degrees". points: (K, 2) the
    curve of RADIAL_CURVE, (R, C, 2) the places of GRID, else None. influence: the share of their way that
    places move. backwards: whether the mapping is inverted. lens: that of CALIBRATION, else None.
    """

    name: str
    kind: str
    parameters: dict[str, float] = field(default_factory=dict)
    points: Array | None = None
    influence: float = 1.0
    backwards: bool = False
    lens: CalibratedLens | None = None

    def mapping(self) -> Reparameterisation:
        """The mapping itself. Raises ValueError for numbers that make no mapping."""
        return changed(
            simple_mapping(self.kind, self.parameters, self.points, self.lens), self.influence, self.backwards
        )


def simple_mapping(
    kind: str,
    given: Mapping[str, float],
    points: Array | None = None,
    lens: CalibratedLens | None = None,
) -> Reparameterisation:
    """A mapping of a kind from its numbers (see ImageMapping). Raises ValueError."""
    centre = float(given.get("centre_x", 0.5)), float(given.get("centre_y", 0.5))
    if kind == "LENS":
        return MagicLens(given["radius"], given["magnification"], given["falloff"], centre)
    if kind == "DISTORTION":
        k1, k2, k3, k4, k5, k6 = (float(given[name]) for name in COEFFICIENTS)
        return Distortion((k1, k2, k3), (k4, k5, k6), given["radius"], centre)
    if kind == "DISPLAY":
        return CurvedDisplay(given["arc"], given["distance"])
    if kind == _WITH_LENS and lens is not None:
        return lens
    if kind not in _WITH_POINTS:
        raise ValueError(f"unknown mapping {kind!r}")
    if points is None:
        raise ValueError(f"a mapping of kind {kind} needs points")
    return RadialCurve(points, centre) if kind == "RADIAL_CURVE" else DeformedGrid(points)


def changed(mapping: Reparameterisation, influence: float, backwards: bool) -> Reparameterisation:
    """A mapping with an influence, inverted if ``backwards``."""
    if influence != 1.0:
        mapping = PartialMapping(mapping, float(influence))
    return InverseMapping(mapping) if backwards else mapping


def read_mappings(data: object) -> tuple[ImageMapping, ...]:
    """The mappings of a preset file. Raises PresetError for anything else."""
    if not isinstance(data, list) or len(data) > MAXIMUM_MAPPINGS:
        raise PresetError("mappings must be a list of at most {0} mappings", MAXIMUM_MAPPINGS)
    return tuple(_read(item, f"mapping {number}") for number, item in enumerate(data, 1))


def _read(data: object, where: str) -> ImageMapping:
    if not isinstance(data, dict) or "kind" not in data:
        raise PresetError("{0} must be an object with a kind", where)
    kind = read_choice(data["kind"], f"{where}: kind", tuple(KINDS))
    limits = KINDS[kind]
    required = [name for name in limits if name not in _DEFAULTS]
    required += ["points"] if kind in _WITH_POINTS else ["lens"] if kind == _WITH_LENS else []
    optional = [name for name in limits if name in _DEFAULTS]
    values = _DEFAULTS | read_object(
        data, where, ("name", "kind", *required), (*optional, "influence", "backwards")
    )
    backwards = values.get("backwards", False)
    if not isinstance(backwards, bool):
        raise PresetError("{0}: backwards must be true or false", where)
    points = _points(values["points"], kind, f"{where}: points") if kind in _WITH_POINTS else None
    read = ImageMapping(
        name=read_name(values["name"], f"{where}: name"),
        kind=kind,
        parameters=read_parameters(values, where, limits),
        points=points,
        influence=read_number(values.get("influence", 1.0), f"{where}: influence", INFLUENCE),
        backwards=backwards,
        lens=read_lens(values["lens"], f"{where}: lens") if kind == _WITH_LENS else None,
    )
    try:
        read.mapping()
    except ValueError as error:
        raise PresetError("{0}: {1}", where, error) from error
    return read


def _points(value: object, kind: str, where: str) -> Array:
    if kind == "RADIAL_CURVE":
        return _pairs(value, where, MOST_CURVE_POINTS, _RADII)
    if not isinstance(value, list) or not 2 <= len(value) <= MOST_GRID_POINTS:
        raise PresetError("{0} must be 2 to {1} rows of points [x, y]", where, MOST_GRID_POINTS)
    rows = [_pairs(row, where, MOST_GRID_POINTS, PLACE) for row in value]
    if len(set(map(len, rows))) != 1:
        raise PresetError("{0} must be in rows of one length", where)
    return np.stack(rows)


def _pairs(value: object, where: str, most: int, limit: Limit) -> Array:
    if not isinstance(value, list) or not 2 <= len(value) <= most:
        raise PresetError("{0} must be 2 to {1} pairs of numbers", where, most)
    if any(not isinstance(pair, list) or len(pair) != 2 for pair in value):
        raise PresetError("{0} must be pairs of numbers", where)
    return read_numbers(value, where, limit)


def mapping_data(mapping: ImageMapping) -> dict[str, object]:
    """A mapping as ``read_mappings`` reads it."""
    data: dict[str, object] = {"name": mapping.name, "kind": mapping.kind}
    data |= parameter_data(mapping.parameters, KINDS[mapping.kind])
    if mapping.points is not None:
        data["points"] = mapping.points.tolist()
    if mapping.lens is not None:
        data["lens"] = lens_data(mapping.lens)
    if mapping.influence != 1.0:
        data["influence"] = mapping.influence
    if mapping.backwards:
        data["backwards"] = True
    return data
