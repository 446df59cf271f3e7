# SPDX-License-Identifier: GPL-3.0-or-later
"""The passes of a render, read from the uncompressed multilayer OpenEXR file that Blender writes.

Python sees no pixels of Blender's render results, and loaded multilayer files have none either. Layout after
"OpenEXR File Layout" (openexr.com): headers, tables of offsets, then scan lines, each channel's row at once.
"""

from __future__ import annotations

import struct
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from ...projection.template_error import TemplateError

MAGIC, MULTIPART = 20000630, 0x1000
FLOAT32 = 2
# Bytes of a channel's entry after its name.
CHANNEL_BYTES = 16


class PassesError(TemplateError):
    """A file does not hold passes as Blender writes them; the message says why."""


class _Part(NamedTuple):
    """One part of a file: names of its channels, and its columns and rows."""

    channels: list[str]
    left: int
    top: int
    right: int
    bottom: int


def read_passes(path: str, name: str) -> NDArray[np.float32]:
    """Read a pass of a file's only view layer, (H, W, channels), row 0 at the bottom.

    path: of an uncompressed float32 file. Channels are in the order in which Blender names them: R, G, B, A
    or X, Y, Z. Raises PassesError, or OSError.
    """
    data = np.fromfile(path, np.uint8)
    raw = data.tobytes() if len(data) < 8 else bytes(data[:8])
    if len(raw) < 8 or struct.unpack("<i", raw[:4])[0] != MAGIC:
        raise PassesError("'{0}' is not an OpenEXR file", path)
    is_multipart = bool(struct.unpack("<i", raw[4:8])[0] & MULTIPART)
    parts, at = _headers(data, is_multipart)
    rows = sum(part.bottom - part.top + 1 for part in parts)
    rows_of: dict[str, NDArray[np.float32]] = {}
    at += 8 * rows
    for number, part in enumerate(parts):
        width, height = part.right - part.left + 1, part.bottom - part.top + 1
        line = 4 * len(part.channels) * width
        stride = line + 8 + 4 * is_multipart
        lines = data[at : at + height * stride]
        if len(lines) != height * stride:
            raise PassesError("'{0}' is incomplete, part {1}", path, number + 1)
        lines = lines.reshape(height, stride)[:, stride - line :]
        values = np.ascontiguousarray(lines).view("<f4").reshape(height, len(part.channels), width)
        for channel, title in enumerate(part.channels):
            rows_of[title] = values[::-1, channel]
        at += height * stride
    return _pass(path, rows_of, name)


def _pass(path: str, rows_of: dict[str, NDArray[np.float32]], name: str) -> NDArray[np.float32]:
    for channels in ("RGBA", "RGB", "XYZ"):
        found = [
            next((rows for key, rows in rows_of.items() if key.endswith(f"{name}.{channel}")), None)
            for channel in channels
        ]
        if all(each is not None for each in found):
            return np.stack([each for each in found if each is not None], axis=-1)
    raise PassesError("'{0}' has no pass {1}", path, name)


def _headers(data: NDArray[np.uint8], is_multipart: bool) -> tuple[list[_Part], int]:
    """The parts of a file, and the offset of its tables."""
    parts, at = [], 8
    while True:
        part, at = _header(data, at)
        parts.append(part)
        if not is_multipart:
            return parts, at
        if not data[at]:
            return parts, at + 1


def _text(data: NDArray[np.uint8], at: int) -> tuple[str, int]:
    """A text that ends with a zero, and the offset behind it."""
    end = at + int(np.argmin(data[at : at + 256] != 0))
    return data[at:end].tobytes().decode(), end + 1


def _header(data: NDArray[np.uint8], at: int) -> tuple[_Part, int]:
    found: dict[str, bytes] = {}
    while data[at]:
        name, at = _text(data, at)
        _kind, at = _text(data, at)
        size = int(data[at : at + 4].view("<i4")[0])
        found[name] = data[at + 4 : at + 4 + size].tobytes()
        at += 4 + size
    if found["compression"] != b"\0":
        raise PassesError("Only uncompressed files can be read")
    entries, names, place = np.frombuffer(found["channels"], np.uint8), [], 0
    while entries[place]:
        name, place = _text(entries, place)
        if int(entries[place : place + 4].view("<i4")[0]) != FLOAT32:
            raise PassesError("Only channels of float32 can be read")
        names.append(name)
        place += CHANNEL_BYTES
    left, top, right, bottom = struct.unpack("<4i", found["dataWindow"])
    return _Part(names, left, top, right, bottom), at + 1
