# SPDX-License-Identifier: GPL-3.0-or-later
"""ST maps: images as mappings of a camera, and a camera's mappings as images."""

from __future__ import annotations

import time

import bpy
import numpy as np

from ...projection.mappings.grids import STMap
from ...projection.mappings.stack import Stack, mapped_places
from ...projection.user_error import UserError
from ...projection.volume.viewing_volume import Projection
from ..blender.packing import pack

IMAGE_NAME = "SCFPF ST Map"
CONTENTS = (
    ("MAPPINGS", "Mappings", "Position in the picture without mappings that each pixel shows"),
    ("PARAMETERS", "U and V", "Parameters u and v that each pixel shows, with the mapping and the ranges"),
)
# ST maps in the cache.
KEPT_MAPS = 4
# Scripts can edit pixels without a notice: viewports read an image again after so many seconds.
READ_AFTER = 1.0
# A pixel of an ST map with less alpha has no value.
LEAST_ALPHA = 0.5
# Pixels of an ST map that are computed at a time: the inverse of a mapping takes some 250 bytes a pixel.
PART = 2**17


class _Cache:
    """ST maps by number, and the number of each image's present map. No Blender data.

    present: by session id of an image, (key, number, time of reading, seconds). edits: how often images of
    the file may have changed.
    """

    def __init__(self):
        self.maps: dict[int, STMap] = {}
        self.present: dict[int, tuple[tuple, int, float]] = {}
        self.made = 0
        self.edits = 0

    def add(self, read: STMap) -> int:
        self.made += 1
        self.maps[self.made] = read
        for old in sorted(self.maps)[:-KEPT_MAPS]:
            del self.maps[old]
        return self.made


_cache = _Cache()


def st_map(number: int) -> STMap:
    """An ST map by the number that ``st_map_number`` has returned last."""
    return _cache.maps[number]


def st_map_number(mapping, depsgraph) -> int:
    """The number of the ST map in a mapping's image; equal pixels have equal numbers.

    Renders read the image each time, viewports only when it may have been edited. Raises UserError.
    """
    image = mapping.image
    if image is None:
        raise UserError("The ST map '{0}' has no image: open or choose one", mapping.name)
    key = (tuple(image.size), image.filepath, _cache.edits)
    known = _cache.present.get(image.session_uid)
    before = _cache.maps.get(known[1]) if known is not None else None
    is_known = before is not None and known[0] == key
    if is_known and depsgraph.mode == "VIEWPORT" and time.monotonic() - known[2] < READ_AFTER:
        return known[1]
    read = _read_image(image)
    # The same pixels keep their number, and with it the cached inverse.
    number = known[1] if before is not None and _same(before, read) else _cache.add(read)
    _cache.present[image.session_uid] = (key, number, time.monotonic())
    return number


def _same(one: STMap, other: STMap) -> bool:
    return np.array_equal(one.present, other.present) and np.array_equal(
        one.values[one.present], other.values[other.present]
    )


def _read_image(image) -> STMap:
    width, height = image.size
    if min(width, height) < 2 or image.channels < 2:
        raise UserError(
            "'{0}' is not an ST map: it needs a picture of at least 2 × 2 pixels with red and "
            "green; if its file was moved, find it with File > External Data",
            image.name,
        )
    pixels = np.empty(width * height * image.channels, np.float32)
    image.pixels.foreach_get(pixels)
    pixels = pixels.reshape(height, width, image.channels)
    present = np.isfinite(pixels[..., :2]).all(axis=2)
    if image.channels == 4:
        present &= pixels[..., 3] >= LEAST_ALPHA
    return STMap(pixels[..., :2].copy(), present)


def write_st_map(projection: Projection, size: tuple[int, int], content: str, inverse: bool):
    """A new float image of an ST map: red to the right, green up, alpha 0 at pixels without a value.

    size: width and height, pixels. content: MAPPINGS or PARAMETERS. inverse: for each position, or each u and
    v as shares of their ranges, where in the image it is seen. Also returns a message if the file cannot
    store the image, else "".
    """
    pixels = _st_pixels(projection, size, content, inverse)
    result = bpy.data.images.new(IMAGE_NAME, *size, alpha=True, float_buffer=True, is_data=True)
    # With straight alpha Blender would multiply the pixels when it opens the file again.
    result.alpha_mode = "PREMUL"
    result.pixels.foreach_set(pixels)
    del pixels  # packing needs their memory
    result.update()
    return result, pack(result)


def _st_pixels(projection: Projection, size: tuple[int, int], content: str, inverse: bool):
    """The pixels of an ST map, (H·W·4,) float32, rows upwards, computed in parts of PART pixels."""
    width, height = size
    pixels = np.zeros((height * width, 4), np.float32)
    for first in range(0, len(pixels), PART):
        part = pixels[first : first + PART]
        row, column = np.divmod(np.arange(first, first + len(part)), width)
        u, v, mask = _st_values(projection, content, inverse, (column + 0.5) / width, (row + 0.5) / height)
        part[:, 0], part[:, 1] = np.where(mask, u, 0.0), np.where(mask, v, 0.0)
        part[:, 3] = mask
    return pixels.ravel()


def _st_values(projection: Projection, content: str, inverse: bool, x, y):
    """The values of an ST map at image positions, and where they exist, (N,) each."""
    image = projection.reparameterisation
    mappings = image.mappings if isinstance(image, Stack) else ()
    if not inverse:
        if content == "MAPPINGS":
            return mapped_places(mappings, x, y, projection.aspect)
        found = projection.parameters(x, y)
        return found.u, found.v, found.mask
    u, v = x, y
    for mapping in reversed(mappings) if content == "MAPPINGS" else (image,):
        u, v = mapping.image_positions(u, v, projection.aspect)
    return u, v, np.isfinite(u) & np.isfinite(v)


def scene_updated(_scene, depsgraph) -> None:
    """Note that an image has changed, of which a mapping may read its pixels."""
    if depsgraph.id_type_updated("IMAGE"):
        _cache.edits += 1


def file_changed() -> None:
    """Note that any image may have changed."""
    _cache.edits += 1
