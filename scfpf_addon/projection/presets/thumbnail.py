# SPDX-License-Identifier: GPL-3.0-or-later
"""A thumbnail of a volume for menus, drawn from its lines alone; and images as PNG files."""

from __future__ import annotations

import struct
import zlib

import numpy as np

from ..diagrams.projector_lines import projector_lines
from ..diagrams.segments import Segments
from ..diagrams.surface_lines import surface_lines
from ..typing import Array
from ..volume.viewing_volume import Projection

# The size of the shipped presets' thumbnails.
WIDTH, HEIGHT = 96, 72
# The factor by which the image is drawn larger before it is averaged.
FINER = 4
# The volume is seen from so far to the right of the camera's back and above it, radians.
TURN, RISE = np.radians(40.0), np.radians(24.0)
# The margin on each side, as a share of the image.
MARGIN = 0.06
# The background, on which the lines are as clear in a light menu as in a dark one.
PAPER = (0.17, 0.19, 0.22)
# Colour, and the line's half width in pixels: surfaces, projectors, borders.
GRID = (0.26, 0.60, 0.32), 0.25
PROJECTOR = (0.47, 0.64, 1.0), 0.5
BORDER = (0.36, 0.95, 0.44), 0.8
PROJECTORS = 5, 4

Color = tuple[float, float, float]
SIGNATURE = b"\x89PNG\r\n\x1a\n"


def volume_thumbnail(projection: Projection) -> Array:
    """The lines of a volume in camera space, (HEIGHT, WIDTH, 4) from 0 to 1, row 0 on top."""
    count = len(projection.volume.surfaces)
    drawn = (
        (np.concatenate([surface_lines(projection, i) for i in range(count)]), *GRID),
        (projector_lines(projection, *PROJECTORS), *PROJECTOR),
        (np.concatenate([surface_lines(projection, i, 1) for i in range(count)]), *BORDER),
    )
    flat = [(_seen(lines), color, half) for lines, color, half in drawn]
    ends = np.concatenate([lines.reshape(-1, 2) for lines, _, _ in flat])
    canvas = np.empty((HEIGHT * FINER, WIDTH * FINER, 4))
    canvas[:] = (*PAPER, 1.0)
    if len(ends) == 0:
        return canvas[::FINER, ::FINER]
    low, high = ends.min(axis=0), ends.max(axis=0)
    size = np.maximum(high - low, np.finfo(np.float32).tiny)
    frame = np.array([WIDTH, HEIGHT]) * FINER
    scale = float((frame * (1 - 2 * MARGIN) / size).min())
    for lines, color, half in flat:
        _stroke(canvas, (lines - (low + high) / 2) * scale + frame / 2, color, half * FINER)
    picture: Array = canvas.reshape(HEIGHT, FINER, WIDTH, FINER, 4).mean(axis=(1, 3))
    return picture


def _seen(lines: Segments) -> Array:
    """Segments (S, 2, 3) of camera space in the image's plane, (S, 2, 2), y downwards."""
    x, y, z = np.moveaxis(np.asarray(lines, np.float64), -1, 0)
    across, back = np.cos(TURN) * x - np.sin(TURN) * z, np.sin(TURN) * x + np.cos(TURN) * z
    return np.stack([across, np.sin(RISE) * back - np.cos(RISE) * y], axis=-1)


def _stroke(canvas: Array, lines: Array, color: Color, half: float) -> None:
    """Draw segments (S, 2, 2), in pixels, onto a canvas (H, W, 4): square dots half a pixel apart."""
    length = np.abs(lines[:, 1] - lines[:, 0]).max(axis=1, initial=0.0)
    steps = (2 * np.ceil(length) + 1).astype(np.int64)
    which = np.repeat(np.arange(len(lines)), steps)
    rank = np.arange(len(which)) - np.repeat(np.cumsum(steps) - steps, steps)
    share = (rank / np.maximum(steps[which] - 1, 1))[:, None]
    dots = lines[which, 0] * (1 - share) + lines[which, 1] * share
    reach = int(np.ceil(half))
    for dx in range(-reach, reach + 1):
        for dy in range(-reach, reach + 1):
            if np.hypot(dx, dy) <= half:
                column, row = np.floor(dots).astype(np.int64).T + np.array([[dx], [dy]])
                inside = (column >= 0) & (column < canvas.shape[1]) & (row >= 0) & (row < canvas.shape[0])
                canvas[row[inside], column[inside]] = (*color, 1.0)


def png(pixels: Array) -> bytes:
    """A PNG file of pixels (H, W, 4) from 0 to 1, row 0 on top, 8 bits a channel (RFC 2083)."""
    height, width = pixels.shape[:2]
    rows = np.rint(np.clip(pixels, 0.0, 1.0) * 255).astype(np.uint8).reshape(height, -1)
    # Each row begins with the number of its filter; 0 is no filter.
    data = np.concatenate([np.zeros((height, 1), np.uint8), rows], axis=1).tobytes()
    header = struct.pack(">IIBBBBB", width, height, 8, 6, 0, 0, 0)
    return b"".join(
        [SIGNATURE, _chunk(b"IHDR", header), _chunk(b"IDAT", zlib.compress(data, 9)), _chunk(b"IEND", b"")]
    )


def png_size(start: bytes) -> tuple[int, int] | None:
    """Width and height in the first 24 bytes of a file, or None if it is not a PNG."""
    if len(start) < 24 or start[:8] != SIGNATURE or start[12:16] != b"IHDR":
        return None
    width, height = struct.unpack(">II", start[16:24])
    return width, height


def _chunk(kind: bytes, data: bytes) -> bytes:
    return struct.pack(">I", len(data)) + kind + data + struct.pack(">I", zlib.crc32(kind + data))
