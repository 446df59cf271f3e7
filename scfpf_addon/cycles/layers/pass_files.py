# SPDX-License-Identifier: GPL-3.0-or-later
"""Passes in uncompressed multilayer OpenEXR files, and the image datablock of the last picture's passes.

Python sees no pixels of Blender's render results, and loaded multilayer files have none either: the files are
read and written here. Layout after "OpenEXR File Layout" (openexr.com): headers, tables of offsets, then scan
lines, each channel's row at once. The datablock is a packed file, which Image Editors and compositors show.
Undo restores that file, but leaves what has been loaded of it.
"""

from __future__ import annotations

import os
import struct
import tempfile
from collections.abc import Callable, Iterable, Mapping
from pathlib import Path
from typing import NamedTuple

import bpy
import numpy as np
from numpy.typing import NDArray

from ...bridge.blender.packing import LARGEST_FILE, TOO_LARGE
from ...bridge.render.result_image import redraw_image_editors
from ...projection.user_error import Message

MAGIC, MULTIPART, LONG_NAMES, VERSION = 20000630, 0x1000, 0x400, 2
FLOAT32 = 2
# The order of a pass's channels, which files have in another one.
LETTERS = "RGBXYZWUVTArgba"
# Bytes of a channel's entry after its name.
CHANNEL_BYTES = 16
IMAGE_NAME = "SCFPF Render Passes"
# The custom property of the image that was made here.
MADE_KEY = "scfpf_passes"


class Pass(NamedTuple):
    """The values (H, W, channels) of a pass, row 0 at the bottom, and the letters that name its channels."""

    letters: str
    values: NDArray[np.float32]


class _Part(NamedTuple):
    """One part of a file: names of its channels, and its columns and rows."""

    channels: list[str]
    left: int
    top: int
    right: int
    bottom: int


def read_passes(path: str, needed: Iterable[str] = ()) -> dict[str, Pass]:
    """Read the passes of a file's only view layer, by name.

    path: of an uncompressed float32 file. needed: names of passes that it has to have. Raises OSError.
    """
    data = np.fromfile(path, np.uint8)
    raw = data.tobytes() if len(data) < 8 else bytes(data[:8])
    if len(raw) < 8 or struct.unpack("<i", raw[:4])[0] != MAGIC:
        raise OSError(f"'{path}' is not an OpenEXR file")
    is_multipart = bool(struct.unpack("<i", raw[4:8])[0] & MULTIPART)
    parts, at = _headers(data, is_multipart)
    rows = sum(part.bottom - part.top + 1 for part in parts)
    found: dict[str, dict[str, NDArray[np.float32]]] = {}
    at += 8 * rows
    for number, part in enumerate(parts):
        width, height = part.right - part.left + 1, part.bottom - part.top + 1
        line = 4 * len(part.channels) * width
        stride = line + 8 + 4 * is_multipart
        lines = data[at : at + height * stride]
        if len(lines) != height * stride:
            raise OSError(f"'{path}' is incomplete, part {number + 1}")
        lines = lines.reshape(height, stride)[:, stride - line :]
        values = np.ascontiguousarray(lines).view("<f4").reshape(height, len(part.channels), width)
        for channel, title in enumerate(part.channels):
            name, _, letter = title.partition(".")[2].rpartition(".")
            found.setdefault(name, {})[letter] = values[::-1, channel]
        at += height * stride
    for name in needed:
        if name not in found:
            raise OSError(f"'{path}' has no pass {name}")
    return {name: _pass(channels) for name, channels in found.items()}


def _pass(channels: dict[str, NDArray[np.float32]]) -> Pass:
    letters = "".join(sorted(channels, key=lambda letter: (LETTERS + letter).index(letter)))
    return Pass(letters, np.stack([channels[letter] for letter in letters], axis=-1))


def write_passes(path: str, layer: str, passes: Mapping[str, Pass]) -> None:
    """Write passes of one size as those of a view layer into a file that Blender reads. Raises OSError."""
    rows = {
        f"{layer}.{name}.{letter}": each.values[::-1, :, channel]
        for name, each in passes.items()
        for channel, letter in enumerate(each.letters)
    }
    # Readers expect the channels in the order of their names' bytes.
    titles = sorted(rows, key=str.encode)
    height, width = rows[titles[0]].shape
    channels = b"".join(title.encode() + b"\0" + struct.pack("<iiii", FLOAT32, 0, 1, 1) for title in titles)
    window = struct.pack("<4i", 0, 0, width - 1, height - 1)
    attributes = (
        ("channels", "chlist", channels + b"\0"),
        ("compression", "compression", b"\0"),
        ("dataWindow", "box2i", window),
        ("displayWindow", "box2i", window),
        ("lineOrder", "lineOrder", b"\0"),
        ("pixelAspectRatio", "float", struct.pack("<f", 1.0)),
        ("screenWindowCenter", "v2f", struct.pack("<2f", 0.0, 0.0)),
        ("screenWindowWidth", "float", struct.pack("<f", 1.0)),
        ("BlenderMultiChannel", "string", b"Blender V2.55.1 and newer"),
    )
    header = struct.pack("<ii", MAGIC, VERSION | LONG_NAMES)
    for name, kind, value in attributes:
        header += name.encode() + b"\0" + kind.encode() + b"\0" + struct.pack("<i", len(value)) + value
    header += b"\0"
    size = 4 * len(titles) * width
    first = len(header) + 8 * height
    with open(path, "wb") as file:
        file.write(header + (first + np.arange(height, dtype="<u8") * (size + 8)).tobytes())
        for row in range(height):
            file.write(struct.pack("<ii", row, size))
            for title in titles:
                file.write(rows[title][row].astype("<f4").tobytes())


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
        raise OSError("Only uncompressed files can be read")
    entries, names, place = np.frombuffer(found["channels"], np.uint8), [], 0
    while entries[place]:
        name, place = _text(entries, place)
        if int(entries[place : place + 4].view("<i4")[0]) != FLOAT32:
            raise OSError("Only channels of float32 can be read")
        names.append(name)
        place += CHANNEL_BYTES
    left, top, right, bottom = struct.unpack("<4i", found["dataWindow"])
    return _Part(names, left, top, right, bottom), at + 1


def passes_image():
    """The image datablock of the passes, or None."""
    return bpy.data.images.get((IMAGE_NAME, None))


def deliver_passes(passes: Mapping[str, Pass], layer: str, save: Callable | None, keeps: bool) -> str:
    """Make an image datablock of passes.

    passes: by name, of one size. layer: the name of their view layer. save: called with the image, None for
    nothing. keeps: whether it is kept in the file afterwards. Returns a warning if it is too large, else "".
    Raises what ``save`` does.
    """
    with tempfile.TemporaryDirectory(prefix="scfpf-") as folder:
        path = os.path.join(folder, "passes.exr")
        write_passes(path, layer, passes)
        if not keeps:
            image = bpy.data.images.load(path)
            try:
                if save is not None:
                    save(image)
            finally:
                bpy.data.images.remove(image)
            return ""
        image = _image(path)
        is_small = Path(path).stat().st_size < LARGEST_FILE
        try:
            if save is not None:
                save(image)
            if is_small:
                image.pack()
        finally:
            image.filepath_raw = f"//{IMAGE_NAME}.exr"
            if not image.packed_file:
                bpy.data.images.remove(image)
        redraw_image_editors()
        return "" if is_small else Message(TOO_LARGE, IMAGE_NAME)


def _image(path: str):
    """The datablock, which shows a file."""
    image = passes_image()
    if image is not None and MADE_KEY not in image:
        image.name, image = f"{IMAGE_NAME} (other)", None
    if image is None:
        image = bpy.data.images.load(path)
        image.name, image.use_fake_user, image[MADE_KEY] = IMAGE_NAME, True, True
        return image
    if image.packed_file:
        image.unpack(method="REMOVE")
    image.filepath_raw = path
    image.buffers_free()
    return image


def history_changed() -> None:
    """Read the pixels again after undo or redo, which Blender does not."""
    image = passes_image()
    if image is not None and image.packed_file:
        image.buffers_free()
