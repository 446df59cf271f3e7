# SPDX-License-Identifier: GPL-3.0-or-later
"""The lines of constant u and v on control surfaces and on iso-surfaces.

As in ``diagram``: segments (S, 2, 3) float32 in the space of the projection.
"""

from __future__ import annotations

from collections.abc import Callable
from typing import TypeAlias

import numpy as np

from ..arrays import bilinear_net
from ..surfaces.surface import ControlSurface, Plane
from ..typing import Array, BoolArray, IndexArray
from ..volume.viewing_volume import Projection
from .segments import Segments, joined, ranged, segments

# Positions (3, N), their validity and their tiles at (u, v), (N,) each.
Sheet: TypeAlias = Callable[[Array, Array], tuple[Array, BoolArray, IndexArray]]

# Cells along u and along v between the lines of a surface. A flat one needs few, and it often fills the view:
# a camera that is added looks as the viewport does.
SURFACE_CELLS, PLANE_CELLS = 8, 4
# Cells of a surface that leaves the net of the others, half-way between its lines, by more than this share of
# a cell's size. A sphere leaves it by 0.2.
BENT_CELLS, LEAVES_LINES = 16, 0.25


def surface_lines(
    projection: Projection, index: int, lines: int | None = None, resolution: int = 48
) -> Segments:
    """Lines of constant u and of constant v on control surface ``index``.

    Over the u and v ranges, lines + 1 in each direction with the borders among
    them, each of ``resolution`` segments. lines: None for as many as the
    surface needs. A point surface has none.
    """
    if lines is None:
        lines = _lines_needed(projection, index)
    surface = projection.volume.surfaces[index]

    def sheet(u: Array, v: Array) -> tuple[Array, BoolArray, IndexArray]:
        """Points of the control surface, their validity and their tile."""
        sample = surface.evaluate(u, v)
        return sample.position, sample.valid, sample.tile

    return _families(projection, sheet, lines, resolution)


def iso_lines(projection: Projection, t: float, lines: int = 8, resolution: int = 48) -> Segments:
    """Lines of constant u and of constant v on Q(·, ·, t), t in [0, 1], as ``surface_lines``."""
    weights, _ = projection.volume.spans.weights(np.array([t]))

    def sheet(u: Array, v: Array) -> tuple[Array, BoolArray, IndexArray]:
        """Points of the iso-surface, their validity and their tile."""
        controls = projection.volume.controls(u, v)
        return np.einsum("k,kcn->cn", weights[:, 0], controls.points), controls.valid, controls.tile

    return _families(projection, sheet, lines, resolution)


def _families(projection: Projection, sheet: Sheet, lines: int, resolution: int) -> Segments:
    """``lines`` + 1 lines of constant u and as many of constant v, of ``resolution`` segments each."""
    across = np.linspace(0.0, 1.0, lines + 1)
    along = np.linspace(0.0, 1.0, resolution + 1)
    fixed, moving = np.meshgrid(across, along, indexing="ij")
    families = []
    for x, y in ((fixed, moving), (moving, fixed)):
        position, valid, tile = sheet(*ranged(projection, x.ravel(), y.ravel()))
        drawn = position.reshape(3, *x.shape)
        families.append(segments(drawn, valid.reshape(x.shape), tile.reshape(x.shape)))
    return joined(families)


def _lines_needed(projection: Projection, index: int) -> int:
    """Return the number of cells along u and v that shows the bends of a surface."""
    surface = projection.volume.surfaces[index]
    if isinstance(surface, Plane):
        return PLANE_CELLS
    left = distance_from_net(projection, surface, (SURFACE_CELLS, SURFACE_CELLS), BENT_CELLS // SURFACE_CELLS)
    return BENT_CELLS if left.max(initial=0.0) > LEAVES_LINES else SURFACE_CELLS


def distance_from_net(
    projection: Projection, surface: ControlSurface, cells: tuple[int, int], parts: int
) -> Array:
    """Return the distance of a surface, between a net of cells (along u, along v), from its bilinear faces.

    Returns (V · parts + 1, U · parts + 1), at ``parts`` places along each side of a cell, in mean sizes of a
    cell. It is 0 beside holes and in cells that lead from tile to tile.
    """
    steps = [np.linspace(0.0, 1.0, parts * count + 1) for count in cells]
    x, y = np.meshgrid(*steps)
    sample = surface.evaluate(*ranged(projection, x.ravel(), y.ravel()))
    points = np.where(sample.valid, sample.position, np.nan).reshape(3, *x.shape)
    known = points[:, np.isfinite(points[0])]
    size = float(np.linalg.norm(np.ptp(known, axis=1))) / max(cells) if known.size else 0.0
    if size == 0.0:
        return np.zeros(x.shape)
    tile = sample.tile.reshape(x.shape).astype(np.float64)
    net = bilinear_net(np.stack([*points, tile])[:, ::parts, ::parts], parts)
    away = np.linalg.norm(points - net[:3], axis=0)
    found: Array = np.where(net[3] == tile, np.nan_to_num(away / size), 0.0)
    return found
