# SPDX-License-Identifier: GPL-3.0-or-later
"""A camera's stack of image mappings as evaluated, for projections and for presets.

Each mapping is first read as numbers and bytes. The mapping made of these is cached, as its inverse may have
to be searched for.
"""

from __future__ import annotations

from functools import lru_cache
from typing import NamedTuple

import numpy as np

from ...projection.mappings.kinds import KINDS, ImageMapping, changed, simple_mapping
from ...projection.user_error import Message, UserError
from ...projection.volume.reparameterisation import Reparameterisation
from ..blender.mesh_grid import grid_points
from ..blender.scene_objects import absent_text, is_absent
from ..volume.volume_object import is_evaluated
from .mapping_edits import calibrated_lens, curve_node, read_numbers
from .st_map_image import st_map, st_map_number

# Steps of the table of a curve widget, whose entries are exact.
CURVE_STEPS = 256
# Mappings in the cache.
KEPT_MAPPINGS = 32


class _Described(NamedTuple):
    """A mapping described by all that it depends on, hashable.

    numbers: by name. points, shape: of an array of float64; for an ST map ``shape`` is its number. lens: the
    text of a calibration.
    """

    kind: str
    numbers: tuple[tuple[str, float], ...]
    points: bytes
    shape: tuple[int, ...]
    influence: float
    backwards: bool
    lens: str

    def array(self) -> np.ndarray | None:
        return np.frombuffer(self.points).reshape(self.shape) if self.points else None


def read_mappings(camera, depsgraph) -> tuple[Reparameterisation, ...]:
    """The enabled mappings of a camera's stack, in order. Raises UserError."""
    return tuple(_built(described) for described in _describe(camera, depsgraph))


def mapping_signature(camera, depsgraph) -> tuple | str:
    """A value that differs between different stacks; the error's text if the stack cannot be read."""
    if not any(mapping.enabled for mapping in camera.scfpf.mappings):
        return ()
    try:
        return _describe(camera, depsgraph)
    except UserError as error:
        return str(error)


def stored_mappings(camera, depsgraph) -> tuple[ImageMapping, ...]:
    """The enabled mappings as presets store them. Raises UserError, also for ST maps."""
    names = [m.name for m in camera.original.scfpf.mappings if m.enabled]
    stored = []
    for name, given in zip(names, _describe(camera, depsgraph), strict=True):
        if given.kind not in KINDS:
            raise UserError(
                "'{0}' is an ST map, which a preset cannot hold: disable it, and share its image", name
            )
        stored.append(
            ImageMapping(
                name=name,
                kind=given.kind,
                parameters=dict(given.numbers),
                points=given.array(),
                influence=given.influence,
                backwards=given.backwards,
                lens=calibrated_lens(given.lens) if given.lens else None,
            )
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
    """mapping: as evaluated. original: the same one in the file, which has the pointers."""
    kind, array, shape = mapping.kind, np.zeros(0), ()
    if kind == "RADIAL_CURVE":
        array = _curve_points(original)
    elif kind == "GRID":
        array = _grid_places(original, camera, depsgraph)
    elif kind == "ST_MAP":
        shape = (st_map_number(original, depsgraph),)
    return _Described(
        kind=kind,
        numbers=tuple(read_numbers(mapping).items()),
        points=array.tobytes(),
        shape=shape or array.shape,
        influence=float(mapping.influence),
        backwards=bool(mapping.backwards),
        lens=_lens_text(original) if kind == "CALIBRATION" else "",
    )


@lru_cache(maxsize=KEPT_MAPPINGS)
def _built(described: _Described) -> Reparameterisation:
    if described.kind == "ST_MAP":
        mapping: Reparameterisation = st_map(described.shape[0])
    else:
        try:
            lens = calibrated_lens(described.lens) if described.lens else None
            mapping = simple_mapping(described.kind, dict(described.numbers), described.array(), lens)
        except ValueError as error:
            raise UserError(str(error)[0].upper() + str(error)[1:]) from error
    return changed(mapping, described.influence, described.backwards)


def _lens_text(mapping) -> str:
    if not mapping.calibration:
        raise UserError(
            "'{0}' has no calibration: add it with Flexible Camera from Calibration", mapping.name
        )
    return mapping.calibration


def _curve_points(mapping) -> np.ndarray:
    """The table of a curve widget, (K, 2): radii and values."""
    node = curve_node(mapping.curve)
    if node is None:
        raise UserError("The radial curve '{0}' has no curve: choose its kind again", mapping.name)
    widget = node.mapping
    widget.initialize()
    radii = np.linspace(0.0, max(widget.clip_max_x, widget.curves[0].points[-1].location[0]), CURVE_STEPS + 1)
    values = [widget.evaluate(widget.curves[0], radius) for radius in radii]
    return np.stack([radii, values], axis=1)


def _grid_places(mapping, camera, depsgraph) -> np.ndarray:
    """The image positions at the points of a deformed grid, (R, C, 2)."""
    grid = mapping.grid
    if grid is None:
        raise UserError(
            "The image mapping '{0}' has no grid: choose a mesh for it, or remove it", mapping.name
        )
    if is_absent(grid, depsgraph.scene):
        lost = absent_text(
            grid, depsgraph.scene, Message("choose another mesh for the image mapping"), camera
        )
        raise UserError("The grid {0}", lost)
    if not is_evaluated(camera, grid, depsgraph):
        raise UserError(
            "The grid '{0}' is hidden and its present shape unknown: press Render, or show it", grid.name
        )
    return np.ascontiguousarray(grid_points(grid.evaluated_get(depsgraph))[..., :2])
