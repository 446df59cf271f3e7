# SPDX-License-Identifier: GPL-3.0-or-later
"""Values of a JSON file, checked one by one: every message says where a value stands and what it must be."""

from __future__ import annotations

from collections.abc import Mapping
from itertools import chain
from typing import NamedTuple, TypeAlias

import numpy as np

from .file_limits import PresetError, check_numbers, shown
from .typing import Array

# A name that Blender 4.5 keeps whole.
MAXIMUM_NAME_BYTES = 63
MAXIMUM_TEXT = 10_000
# Blender stores float32: past this a coordinate is coarser than 64 units.
LARGEST_LENGTH = 1e9
# As far below one unit as the largest is above it; its square is still a normal float32.
SMALLEST_LENGTH = 1e-9


class Limit(NamedTuple):
    """The least and the greatest value of a number."""

    low: float
    high: float


# The numbers of a kind of surface or mapping by their keys in a file, which end in DEGREES for angles.
Limits: TypeAlias = Mapping[str, Limit]
DEGREES = "_degrees"

LENGTH = Limit(SMALLEST_LENGTH, LARGEST_LENGTH)
COORDINATE = Limit(-LARGEST_LENGTH, LARGEST_LENGTH)
SHARE = Limit(0.0, 1.0)


def read_object(
    data: object, where: str, required: tuple[str, ...], optional: tuple[str, ...] = ()
) -> dict[str, object]:
    """A JSON object with all required keys and no unknown ones."""
    if not isinstance(data, dict):
        raise PresetError("{0} must be an object", where)
    for key in data:
        if key not in required and key not in optional:
            raise PresetError("{0} has an unknown key {1}", where, shown(key))
    for key in required:
        if key not in data:
            raise PresetError("{0} needs {1}", where, key)
    return data


def read_number(value: object, where: str, limit: Limit) -> float:
    """A finite number within the limit."""
    # A JSON true is an int to Python, but no number to a reader.
    number = value if isinstance(value, (int, float)) and not isinstance(value, bool) else None
    if number is not None and limit.low <= number <= limit.high:
        return float(number)
    if limit.low > 0 and (number is None or number <= 0):
        raise PresetError("{0} must be a number above 0", where)
    raise PresetError("{0} must be a number between {1:g} and {2:g}", where, limit.low, limit.high)


def read_parameters(values: Mapping[str, object], where: str, limits: Limits) -> dict[str, float]:
    """Numbers within their limits, by their names in code: angles are radians and lose "_degrees"."""
    parameters = {}
    for key, limit in limits.items():
        value = read_number(values[key], f"{where}: {key}", limit)
        parameters[key.removesuffix(DEGREES)] = float(np.radians(value)) if key.endswith(DEGREES) else value
    return parameters


def parameter_data(parameters: Mapping[str, float], limits: Limits) -> dict[str, float]:
    """Numbers as ``read_parameters`` reads them."""
    values = {key: parameters[key.removesuffix(DEGREES)] for key in limits}
    return {key: degrees(value) if key.endswith(DEGREES) else value for key, value in values.items()}


def degrees(radians: float) -> float:
    """An angle in degrees of 15 digits: 350 degrees come back as 350, not as 350.00000000000006."""
    return float(f"{np.degrees(radians):.15g}")


def read_vector(value: object, where: str, limit: Limit) -> tuple[float, float, float]:
    """Three numbers within the limit."""
    if not isinstance(value, list) or len(value) != 3:
        raise PresetError("{0} must be three numbers [x, y, z]", where)
    x, y, z = (read_number(item, where, limit) for item in value)
    return x, y, z


def read_range(value: object, where: str) -> tuple[float, float]:
    """Two rising numbers within [0, 1]."""
    if not isinstance(value, list) or len(value) != 2:
        raise PresetError("{0} must be two numbers [start, end]", where)
    start, end = (read_number(item, where, SHARE) for item in value)
    if not start < end:
        raise PresetError("{0} must rise from its start to its end", where)
    return start, end


def read_choice(value: object, where: str, choices: tuple[str, ...]) -> str:
    """A word of the given choices."""
    if not isinstance(value, str) or value not in choices:
        raise PresetError("{0} must be one of {1}", where, ", ".join(choices))
    return value


def read_name(value: object, where: str) -> str:
    """A name: not empty, printable, short enough for Blender to keep whole."""
    if not isinstance(value, str) or not value.strip() or not value.isprintable():
        raise PresetError("{0} must be a text in one line", where)
    if len(value.encode()) > MAXIMUM_NAME_BYTES:
        raise PresetError("{0} must not be longer than {1} bytes", where, MAXIMUM_NAME_BYTES)
    return value


def read_text(value: object, where: str) -> str:
    """Prose, perhaps empty, perhaps of several lines."""
    if not isinstance(value, str) or not value.replace("\n", "").isprintable():
        raise PresetError("{0} must be a text", where)
    if len(value) > MAXIMUM_TEXT:
        raise PresetError("{0} must not be longer than {1} characters", where, MAXIMUM_TEXT)
    return value


def read_numbers(rows: list[list[object]], where: str, limit: Limit) -> Array:
    """Rows of equally many numbers within the limit, (N, width) float64."""
    error = PresetError("{0} must be numbers between {1:g} and {2:g}", where, limit.low, limit.high)
    if not set(map(type, chain.from_iterable(rows))) <= {int, float}:
        raise error
    try:
        array = np.array(rows, np.float64)
    except OverflowError as overflow:
        raise error from overflow
    if not ((array >= limit.low) & (array <= limit.high)).all():
        raise error
    return array


def read_points(
    value: object, where: str, exactly: tuple[int, int] | None = None, weighted: bool = False
) -> Array:
    """Rows of points as (rows, columns, 3) float64, at least 2 × 2, or exactly as many as said.

    weighted: every point may have a weight above 0 as a fourth number.
    """
    wanted = "at least 2 × 2" if exactly is None else f"{exactly[0]} × {exactly[1]}"
    form = "[x, y, z] or [x, y, z, weight]" if weighted else "[x, y, z]"
    shape_error = PresetError("{0} must be {1} points {2}, in rows of one length", where, wanted, form)
    if not isinstance(value, list) or set(map(type, value)) != {list}:
        raise shape_error
    points = list(chain.from_iterable(value))
    check_numbers(3 * len(points))
    if len(set(map(len, value))) != 1 or set(map(type, points)) != {list}:
        raise shape_error
    widths = set(map(len, points))
    if widths != {3} and not (weighted and widths == {4}):
        raise shape_error
    size = (len(value), len(value[0]))
    if min(size) < 2 or exactly not in (None, size):
        raise shape_error
    array = read_numbers(points, where, COORDINATE)
    if array.shape[1] == 4 and array[:, 3].min() < SMALLEST_LENGTH:
        raise PresetError("{0}: every weight must be a number above 0", where)
    return array.reshape(*size, -1)
