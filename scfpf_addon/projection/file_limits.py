# SPDX-License-Identifier: GPL-3.0-or-later
"""Limits of preset files, which strangers may have made, and the checks before parsing."""

from __future__ import annotations

import json
import os
import stat
from pathlib import Path
from time import monotonic

from ..projection.user_error import UserError

MAXIMUM_BYTES = 16 * 2**20
# Seconds and bytes that reading takes at most.
MAXIMUM_SECONDS = 5.0
MAXIMUM_MEMORY = 500_000_000
# Keys in one object.
MAXIMUM_KEYS = 4096
MAXIMUM_SURFACES = 64
# Numbers of all points, UVs and triangles together.
MAXIMUM_NUMBERS = 1_000_000
# Points of all NURBS surfaces together: Blender takes 3 s to draw this many.
MAXIMUM_NURBS_POINTS = 256 * 256
# Triangles of a UV mesh that a look-up of one (u, v) may test: with 2048 an HD image takes minutes.
MAXIMUM_OVERLAPS = 2048
# Triangles of a UV mesh that meet at one vertex: Blender's time for its normals grows with their square.
MAXIMUM_AT_VERTEX = 10_000
TOO_MANY = "the preset has too many numbers, at most {0} are allowed"
# Of a key in a message.
SHOWN_CHARACTERS = 80

# Upper bounds of what Python 3.11 and 3.13 take for an object, a list and a value in them, in bytes.
OBJECT_BYTES, LIST_BYTES, VALUE_BYTES = 400, 120, 70
# Commas that a preset has besides those between numbers: keys, settings and prose.
OTHER_COMMAS = 100_000


class PresetError(UserError):
    """A preset that cannot be used; the message says what to change."""


def read_bytes(path: Path, most: int = MAXIMUM_BYTES + 1) -> bytes:
    """The first ``most`` bytes of a regular file. Raises OSError, also for what is not a regular file.

    A FIFO would be waited for and a device may have no end: neither is read.
    """
    # O_NONBLOCK: opening a FIFO would wait for a writer. Neither flag is on all systems.
    flags = os.O_RDONLY | getattr(os, "O_NONBLOCK", 0) | getattr(os, "O_BINARY", 0)
    handle = os.open(path, flags)
    try:
        if not stat.S_ISREG(os.fstat(handle).st_mode):
            raise OSError("it is not a regular file")
        with os.fdopen(handle, "rb", closefd=False) as file:
            return file.read(most)
    finally:
        os.close(handle)


def check_size(size: int) -> None:
    """Raise PresetError for more bytes or characters than a preset may have."""
    if size > MAXIMUM_BYTES:
        raise PresetError("the preset is larger than {0} MB", MAXIMUM_BYTES // 2**20)


def parsed(text: str) -> object:
    """The JSON data of a text. Raises PresetError for bad JSON and for more than a preset may have."""
    _check_text(text)
    try:
        return json.loads(text, object_pairs_hook=_unique_keys)
    except PresetError:
        raise
    except RecursionError as error:
        raise PresetError("the preset is nested too deeply") from error
    except ValueError as error:
        raise PresetError("the preset is not valid JSON: {0}", error) from error


def _check_text(text: str) -> None:
    """Raise PresetError for a text that would take too much memory or has too many numbers to be a preset.

    Punctuation is counted, that in strings too, which is quicker than parsing by far.
    """
    check_size(len(text))
    objects, lists, commas = (text.count(mark) for mark in "{[,")
    if objects * OBJECT_BYTES + lists * LIST_BYTES + commas * VALUE_BYTES > MAXIMUM_MEMORY:
        raise PresetError("reading the preset would take more than {0} MB of memory", MAXIMUM_MEMORY // 10**6)
    if commas > MAXIMUM_NUMBERS + OTHER_COMMAS:
        raise PresetError(TOO_MANY, MAXIMUM_NUMBERS)


def check_numbers(count: int) -> None:
    """Raise PresetError for more numbers of points, UVs and triangles than a preset may have."""
    if count > MAXIMUM_NUMBERS:
        raise PresetError(TOO_MANY, MAXIMUM_NUMBERS)


def check_nurbs_points(count: int) -> None:
    """Raise PresetError for more NURBS control points than a preset may have."""
    if count > MAXIMUM_NURBS_POINTS:
        raise PresetError(
            "the preset has too many NURBS points, at most {0} are allowed", MAXIMUM_NURBS_POINTS
        )


def check_time(start: float) -> None:
    """Raise PresetError when reading, begun at ``start`` by ``monotonic``, takes too long."""
    if monotonic() - start > MAXIMUM_SECONDS:
        raise PresetError("reading the preset takes longer than {0:g} s", MAXIMUM_SECONDS)


def _unique_keys(pairs: list[tuple[str, object]]) -> dict[str, object]:
    """A JSON object from its pairs; PresetError when a key stands twice, or for too many keys."""
    if len(pairs) > MAXIMUM_KEYS:
        raise PresetError("an object has {0} keys, at most {1} are allowed", len(pairs), MAXIMUM_KEYS)
    values = dict(pairs)
    if len(values) < len(pairs):
        left = dict.fromkeys(values)
        twice = next(key for key, _ in pairs if left.pop(key, key) is not None)
        raise PresetError("the key {0} stands twice in one object", shown(twice))
    return values


def shown(key: str) -> str:
    """A key in quotation marks, as messages show it: not all of a long one."""
    return repr(key if len(key) <= SHOWN_CHARACTERS else key[: SHOWN_CHARACTERS - 1] + "…")
