# SPDX-License-Identifier: GPL-3.0-or-later
"""Lattice objects as viewing volumes: made, and read as evaluated (shape keys, hooks and modifiers included).

Alone on a camera's list a lattice is its whole volume, as Blender's Lattice modifier
would deform the box. Among other surfaces its layers along W stand for as many control
surfaces, which the camera's projectors join.
"""

from __future__ import annotations

import bpy
import numpy as np

from ...projection.file_values import LARGEST_LENGTH
from ...projection.surfaces.kinds import SURFACE_KINDS
from ...projection.user_error import UserError
from ...projection.volume.lattice import Lattice

KIND = "LATTICE"
TITLE = SURFACE_KINDS[KIND].title
# Points of a new lattice along W, V and U, at rest.
DEFAULT_SHAPE = (4, 4, 4)
# Blender has no more points along an axis.
MOST_POINTS = 64
AXES = ("u", "v", "w")
INTERPOLATIONS = ("LINEAR", "CARDINAL", "CATMULL_ROM", "BSPLINE")
_PREFIX = "KEY_"


def new_data(name: str, points, parameters: dict):
    """Data for a Lattice object whose box at rest is the unit cube about its origin.

    points: (layers, rows, columns, 3), own space, the near layer (+Z) first; None leaves 4 × 4 × 4
    points at rest. parameters: interpolation, of ``INTERPOLATIONS``, for all three axes.
    Raises UserError.
    """
    shape = DEFAULT_SHAPE if points is None else np.shape(points)[:3]
    if len(shape) != 3 or min(shape) < 2 or max(shape) > MOST_POINTS:
        raise UserError(
            "A {0} needs layers × rows × columns of points, 2 to {1} each, got {2}", TITLE, MOST_POINTS, shape
        )
    unknown = set(parameters) - {"interpolation"}
    if unknown:
        raise UserError("A {0} has no parameter {1!r}", TITLE, min(unknown))
    kind = parameters.get("interpolation", "BSPLINE")
    if kind not in INTERPOLATIONS:
        raise UserError(
            "A {0} is interpolated by one of {1}, not {2!r}", TITLE, ", ".join(INTERPOLATIONS), kind
        )
    data = bpy.data.lattices.new(name)
    # Without an object Blender lets the box grow with the number of points.
    sized = bpy.data.objects.new(name, data)
    data.points_w, data.points_v, data.points_u = shape
    bpy.data.objects.remove(sized)
    for axis in AXES:
        setattr(data, f"interpolation_type_{axis}", _PREFIX + kind)
    if points is not None:
        try:
            _write(data, np.asarray(points, np.float64))
        except UserError:
            bpy.data.lattices.remove(data)
            raise
    return data


def write_parameters(surface, parameters: dict) -> None:
    """Write points (layers, rows, columns, 3), as many as there are. Raises UserError."""
    if set(parameters) != {"points"}:
        raise UserError("A {0} is given by its points alone, not by {1}", TITLE, sorted(parameters))
    _write(surface.data, np.asarray(parameters["points"], np.float64))
    surface.data.update_tag()


def read_parameters(surface) -> dict:
    """points: (layers, rows, columns, 3) float64, own space, the near layer first."""
    return {"points": _coordinates(surface.data, "co_deform")[::-1]}


def _write(data, points) -> None:
    shape = (data.points_w, data.points_v, data.points_u, 3)
    if points.shape != shape:
        raise UserError("'{0}' has points of shape {1}, not {2}", data.name, shape, points.shape)
    if not (np.abs(points) <= LARGEST_LENGTH).all():
        raise UserError("The points of a {0} must be numbers up to {1:g}", TITLE, LARGEST_LENGTH)
    data.points.foreach_set("co_deform", points[::-1].astype(np.float32).ravel())


def _coordinates(data, name: str):
    """Coordinates of all points, (W, V, U, 3) float64. name: co at rest, co_deform as moved."""
    values = np.empty(3 * len(data.points), np.float32)
    data.points.foreach_get(name, values)
    return values.reshape(data.points_w, data.points_v, data.points_u, 3).astype(np.float64)


def mirror(surface, axis: str):
    """Reverse the points along axis "U" or "V" and reflect them in the box.

    Returns the (4, 4) matrix, to go before the object's own, that brings every point back to its place.
    """
    if surface.data.users > 1:
        surface.data = surface.data.copy()
    data, index = surface.data, "UV".index(axis)
    rest, moved = _coordinates(data, "co"), _coordinates(data, "co_deform")
    matrix = np.eye(4)
    matrix[index, index] = -1.0
    matrix[index, 3] = rest[..., index].min() + rest[..., index].max()
    reflected = np.flip(moved, axis=2 - index) @ matrix[:3, :3].T + matrix[:3, 3]
    data.points.foreach_set("co_deform", reflected.astype(np.float32).ravel())
    data.update_tag()
    return matrix


def data_properties(surface) -> list[tuple[str, object, str]]:
    """(label, owner, property) of each setting that defines a lattice besides its points, for panels."""
    if surface.type != "LATTICE":
        return []
    return [
        (f"{label} {axis.upper()}", surface.data, f"{name}_{axis}")
        for label, name in (("Points", "points"), ("Interpolation", "interpolation_type"))
        for axis in AXES
    ]


def read_lattice(evaluated) -> Lattice:
    """An evaluated Lattice object in its own space. Raises UserError when it has no size or no volume."""
    name, data = evaluated.name, evaluated.data
    if evaluated.type != "LATTICE":
        raise UserError(
            "'{0}' is of type {1}, not a lattice: choose another kind", name, evaluated.type.title()
        )
    for axis in AXES[:2]:
        if getattr(data, f"points_{axis}") < 2:
            raise UserError("'{0}' has one point along {1}: give it two or more", name, axis.upper())
    if data.vertex_group and data.vertex_group in evaluated.vertex_groups:
        raise UserError(
            "'{0}' has a vertex group that weighs its effect, which a viewing volume cannot "
            "have: clear Vertex Group in its Object Data properties",
            name,
        )
    rest, moved = _coordinates(data, "co"), _coordinates(data, "co_deform")
    if not (np.abs(moved) <= LARGEST_LENGTH).all():
        raise UserError(
            "'{0}' has points that are not finite or farther out than {1:g}: look for the "
            "modifier or shape key that moves them there",
            name,
            LARGEST_LENGTH,
        )
    kinds = tuple(getattr(data, f"interpolation_type_{axis}").removeprefix(_PREFIX) for axis in AXES)
    return Lattice(rest[0, 0, 0], rest[-1, -1, -1], moved - rest, kinds)
