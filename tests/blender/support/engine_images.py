# SPDX-License-Identifier: GPL-3.0-or-later
"""Images by F12 and by the Render button, as arrays."""

import os
import struct

import bpy
import numpy as np

MAGIC, MULTIPART = 20000630, 0x1000


def _text(data, at):
    end = data.index(b"\0", at)
    return data[at:end].decode(), end + 1


def _header(data, at):
    """One part's channel names and data window (xmin, ymin, xmax, ymax), and where it ends."""
    found = {}
    while data[at]:
        name, at = _text(data, at)
        _kind, at = _text(data, at)
        (size,) = struct.unpack_from("<i", data, at)
        found[name] = data[at + 4 : at + 4 + size]
        at += 4 + size
    assert found["compression"] == b"\0", "only uncompressed files can be read"
    names, channels = [], found["channels"]
    place = 0
    while channels[place]:
        name, place = _text(channels, place)
        assert struct.unpack_from("<i", channels, place)[0] == 2, "only float32 can be read"
        names.append(name)
        place += 16
    return names, struct.unpack("<4i", found["dataWindow"]), at + 1


def read_exr(path):
    """An uncompressed float32 file: {"Layer.Pass.Channel": (H, W) float32}, row 0 at the bottom."""
    with open(path, "rb") as file:
        data = file.read()
    magic, version = struct.unpack_from("<ii", data)
    assert magic == MAGIC
    multipart, at, parts = bool(version & MULTIPART), 8, []
    while True:
        names, window, at = _header(data, at)
        parts.append((names, window))
        if not multipart or not data[at]:
            break
    at += multipart
    images = {}
    heights = [window[3] - window[1] + 1 for _names, window in parts]
    at += 8 * sum(heights)
    for part, height in zip(parts, heights, strict=True):
        names, (left, _top, right, _bottom) = part
        width = right - left + 1
        for name in names:
            images[name] = np.empty((height, width), np.float32)
    for _ in range(sum(heights)):
        number = 0
        if multipart:
            (number,) = struct.unpack_from("<i", data, at)
            at += 4
        names, (left, _top, right, bottom) = parts[number]
        line, size = struct.unpack_from("<ii", data, at)
        row = np.frombuffer(data, "<f4", size // 4, at + 8).reshape(len(names), -1)
        for name, values in zip(names, row, strict=True):
            images[name][bottom - line] = values
        at += 8 + size
    return images


# The order of a pass's channels.
CHANNELS = "RGBArgbaXYZUVTW"


def passes(path):
    """A multilayer file as {"Layer.Pass": (H, W, channels)}."""
    layers = {}
    for name, values in read_exr(path).items():
        layer, _, channel = name.rpartition(".")
        layers.setdefault(layer, {})[channel] = values
    return {
        layer: np.stack([found[channel] for channel in sorted(found, key=CHANNELS.index)], -1)
        for layer, found in layers.items()
    }


def write_multilayer(scene, path):
    """Let F12 write an uncompressed multilayer EXR."""
    settings = scene.render.image_settings
    if bpy.app.version >= (5, 0, 0):
        settings.media_type = "MULTI_LAYER_IMAGE"
    settings.file_format, settings.color_depth = "OPEN_EXR_MULTILAYER", "32"
    settings.exr_codec = "NONE"
    scene.render.filepath = str(path)


def f12(scene, **options):
    """Render as F12 does and read the file that was written: passes()."""
    path = f"{scene.render.filepath}.exr"
    if os.path.exists(path):
        os.remove(path)
    assert bpy.ops.render.render(write_still=True, **options) == {"FINISHED"}
    return passes(path)


def button(**options):
    """Return the Render button's image, (H, W, 4)."""
    assert bpy.ops.scfpf.render(**options) == {"FINISHED"}
    image = bpy.data.images["SCFPF Render"]
    values = np.empty(len(image.pixels), np.float32)
    image.pixels.foreach_get(values)
    return values.reshape(image.size[1], image.size[0], 4)


def load_pixels(path):
    """The pixels of an image file, (H, W, 4) float64."""
    image = bpy.data.images.load(str(path))
    pixels = np.array(image.pixels[:], np.float64).reshape(image.size[1], image.size[0], 4)
    bpy.data.images.remove(image)
    return pixels
