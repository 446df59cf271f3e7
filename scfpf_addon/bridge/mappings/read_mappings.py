# SPDX-License-Identifier: GPL-3.0-or-later
"""A camera's stack of image mappings, as evaluated, as the mappings themselves and as what presets store.

What is read of a mapping is numbers and bytes; the mapping that they make is kept while they stay, since its
inverse may have to be searched for.
"""

from __future__ import annotations

import time
from functools import lru_cache
from typing import NamedTuple

import numpy as np
from bpy.app.handlers import persistent

from ...projection.mappings.grids import STMap
from ...projection.mappings.kinds import COEFFICIENTS, KINDS, ImageMapping, changed, simple_mapping
from ...projection.volume.reparameterisation import Reparameterisation
from ..blender.app_handlers import add_handlers, remove_handlers
from ..blender.mesh_grid import SurfaceError, grid_points
from ..blender.scene_objects import absent_text, is_absent
from ..volume.volume_object import keeps_evaluated
from .mapping_edits import MappingError, curve_node

# A curve widget is a table of so many steps; at its entries it is exact.
CURVE_STEPS = 256
# Mappings that are kept, and images.
KEPT_MAPPINGS, KEPT_IMAGES = 32, 4
# Scripts edit pixels without a sign: viewports read an ST map again when what they have is so old, seconds.
READ_AFTER = 1.0
# Less alpha means that a pixel of an ST map has no value.
LEAST_ALPHA = 0.5


class _Described(NamedTuple):
    """What makes a mapping: kind, numbers by name, points or the key of an image, and how it is used."""

    kind: str
    numbers: tuple[tuple[str, float], ...]
    points: bytes
    shape: tuple[int, ...]
    influence: float
    backwards: bool


class _Images:
    """Arrays of ST maps by number, and which one an image has now. No Blender data."""

    def __init__(self):
        self.maps: dict[int, STMap] = {}
        self.present: dict[int, tuple[tuple, int, float]] = {}
        self.made = 0
        self.edits = 0


_images = _Images()


def read_mappings(camera, depsgraph) -> tuple[Reparameterisation, ...]:
    """The mappings that act on a camera's picture, in order. Raises MappingError."""
    return tuple(_built(described) for described in _describe(camera, depsgraph))


def mapping_signature(camera, depsgraph) -> tuple | str:
    """What tells a stack from another; an error's text where it cannot be read. Empty without mappings."""
    if not any(mapping.enabled for mapping in camera.scfpf.mappings):
        return ()
    try:
        return _describe(camera, depsgraph)
    except MappingError as error:
        return str(error)


def stored_mappings(camera, depsgraph) -> tuple[ImageMapping, ...]:
    """The mappings that act, as presets store them. Raises MappingError, for ST maps too."""
    names = [m.name for m in camera.original.scfpf.mappings if m.enabled]
    stored = []
    for name, given in zip(names, _describe(camera, depsgraph), strict=True):
        if given.kind not in KINDS:
            raise MappingError(
                f"'{name}' is an ST map, which a preset cannot hold: disable it, and share its image"
            )
        points = np.frombuffer(given.points).reshape(given.shape) if given.points else None
        stored.append(
            ImageMapping(name, given.kind, dict(given.numbers), points, given.influence, given.backwards)
        )
    return tuple(stored)


def _describe(camera, depsgraph) -> tuple[_Described, ...]:
    evaluated = camera.evaluated_get(depsgraph).scfpf.mappings
    pairs = zip(evaluated, camera.original.scfpf.mappings, strict=True)
    return tuple(
        _describe_one(mapping, original, camera.original, depsgraph)
        for mapping, original in pairs
        if mapping.enabled
    )


def _describe_one(mapping, original, camera, depsgraph) -> _Described:
    """mapping: as evaluated; original: whose pointers are the file's own."""
    kind, points, shape = mapping.kind, b"", ()
    numbers: dict[str, float] = {}
    if kind in {"RADIAL_CURVE", "LENS", "DISTORTION"}:
        numbers["centre_x"], numbers["centre_y"] = mapping.centre
    if kind in {"LENS", "DISTORTION"}:
        numbers["radius"] = mapping.radius
    if kind == "LENS":
        numbers |= {"magnification": mapping.magnification, "falloff": mapping.falloff}
    elif kind == "DISTORTION":
        numbers |= dict(zip(COEFFICIENTS, (*mapping.numerator, *mapping.denominator), strict=True))
    elif kind == "DISPLAY":
        numbers |= {"arc": mapping.arc, "distance": mapping.distance}
    elif kind == "RADIAL_CURVE":
        array = _curve_points(original)
        points, shape = array.tobytes(), array.shape
    elif kind == "GRID":
        array = _grid_places(original, camera, depsgraph)
        points, shape = array.tobytes(), array.shape
    elif kind == "ST_MAP":
        shape = (_image_number(original, depsgraph),)
    return _Described(
        kind, tuple(numbers.items()), points, shape, float(mapping.influence), bool(mapping.backwards)
    )


@lru_cache(maxsize=KEPT_MAPPINGS)
def _built(described: _Described) -> Reparameterisation:
    if described.kind == "ST_MAP":
        mapping: Reparameterisation = _images.maps[described.shape[0]]
    else:
        points = np.frombuffer(described.points).reshape(described.shape) if described.points else None
        try:
            mapping = simple_mapping(described.kind, dict(described.numbers), points)
        except ValueError as error:
            raise MappingError(str(error)[0].upper() + str(error)[1:]) from error
    return changed(mapping, described.influence, described.backwards)


def _curve_points(mapping) -> np.ndarray:
    """The entries of a curve widget's table, (K, 2)."""
    node = curve_node(mapping.curve)
    if node is None:
        raise MappingError(f"The radial curve '{mapping.name}' has no curve: choose its kind again")
    widget = node.mapping
    widget.initialize()
    radii = np.linspace(0.0, max(widget.clip_max_x, widget.curves[0].points[-1].location[0]), CURVE_STEPS + 1)
    values = [widget.evaluate(widget.curves[0], radius) for radius in radii]
    return np.stack([radii, values], axis=1)


def _grid_places(mapping, camera, depsgraph) -> np.ndarray:
    grid = mapping.grid
    if grid is None:
        raise MappingError(
            f"The image mapping '{mapping.name}' has no grid: choose a mesh for it, or remove it"
        )
    if is_absent(grid, depsgraph.scene):
        lost = absent_text(grid, depsgraph.scene, "choose another mesh for the image mapping", camera)
        raise MappingError(f"The grid {lost}")
    if not (keeps_evaluated(camera, grid, depsgraph) or grid.name in depsgraph.objects):
        raise MappingError(
            f"The grid '{grid.name}' is hidden and its present shape unknown: press Render, or show it"
        )
    try:
        return np.ascontiguousarray(grid_points(grid.evaluated_get(depsgraph))[..., :2])
    except SurfaceError as error:
        raise MappingError(str(error)) from error


def _image_number(mapping, depsgraph) -> int:
    """The number of an image's ST map; renders read the image anew, viewports when it has been edited."""
    image = mapping.image
    if image is None:
        raise MappingError(f"The ST map '{mapping.name}' has no image: open or choose one")
    key = (tuple(image.size), image.filepath, _images.edits)
    known = _images.present.get(image.session_uid)
    is_known = known is not None and known[0] == key and known[1] in _images.maps
    if is_known and depsgraph.mode == "VIEWPORT" and time.monotonic() - known[2] < READ_AFTER:
        return known[1]
    read = _read_image(image)
    # The same pixels keep their number, and with it what has been worked out for them.
    before = _images.maps.get(known[1]) if known is not None else None
    if before is None or not _same(before, read):
        _images.made += 1
        _images.maps[_images.made] = read
        number = _images.made
        for old in sorted(_images.maps)[:-KEPT_IMAGES]:
            del _images.maps[old]
    else:
        number = known[1]
    _images.present[image.session_uid] = (key, number, time.monotonic())
    return number


def _same(one: STMap, other: STMap) -> bool:
    return np.array_equal(one.present, other.present) and np.array_equal(
        one.values[one.present], other.values[other.present]
    )


def _read_image(image) -> STMap:
    width, height = image.size
    if min(width, height) < 2 or image.channels < 2:
        raise MappingError(
            f"'{image.name}' is not an ST map: it needs a picture of at least 2 × 2 pixels with red and "
            f"green; "
            "if its file was moved, find it with File > External Data"
        )
    pixels = np.empty(width * height * image.channels, np.float32)
    image.pixels.foreach_get(pixels)
    pixels = pixels.reshape(height, width, image.channels)
    present = np.isfinite(pixels[..., :2]).all(axis=2)
    if image.channels == 4:
        present &= pixels[..., 3] >= LEAST_ALPHA
    return STMap(pixels[..., :2].copy(), present)


@persistent
def _scene_updated(_scene, depsgraph):
    if depsgraph.id_type_updated("IMAGE"):
        _images.edits += 1


@persistent
def _file_changed(*_):
    _images.edits += 1


HANDLERS = {
    "depsgraph_update_post": _scene_updated,
    "undo_post": _file_changed,
    "redo_post": _file_changed,
    "load_post": _file_changed,
}


def register():
    # Other handlers ask whether a stack has changed.
    add_handlers(HANDLERS, at_front=True)


def unregister():
    remove_handlers(HANDLERS)
