# SPDX-License-Identifier: GPL-3.0-or-later
"""Edits of NURBS patches: more control points, control points in reverse, a patch near another surface."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from ...projection.user_error import UserError
from ..surfaces.nurbs import Basis, NurbsAxis, NurbsPatch, fitted_points, functions
from ..surfaces.surface import ControlSurface, Grid
from ..typing import Array, IndexArray
from .volume_edits import sampled

# Basis functions that differ by less are the same: they are near 1, least squares rounds to about 1e-13.
SAME = 1e-9
# Samples for each control point that basis functions are compared at, and surfaces fitted at.
SAMPLES = 4
CUBIC = 4


def refined(patch: NurbsPatch, along_u: bool, along_v: bool) -> NurbsPatch:
    """The same patch with the fewest control points more along u, v or both: its pieces are halved.

    Knot insertion, as one matrix an axis. Raises UserError where Blender's knots have no such patch.
    """
    points = np.asarray(patch.points, np.float64)
    weighted = points.shape[2] == 4
    if weighted:
        points = np.concatenate([points[..., :3] * points[..., 3:], points[..., 3:]], axis=2)
    if along_v:
        points = np.einsum("nr,rcx->ncx", _refinement(patch.along_v, points.shape[0]), points)
    if along_u:
        points = np.einsum("nc,rcx->rnx", _refinement(patch.along_u, points.shape[1]), points)
    if weighted:
        points = np.concatenate([points[..., :3] / points[..., 3:], points[..., 3:]], axis=2)
    return replace(patch, points=points)


def _refinement(axis: NurbsAxis, count: int) -> Array:
    """The control points of the refined axis, rows, by those of the axis, columns."""
    for more in range(count + 1, 2 * count + axis.order + 1):
        if axis.problem(more):
            continue
        place = np.linspace(0.0, 1.0, SAMPLES * more + 1)
        before, after = functions(Basis(axis, count), place), functions(Basis(axis, more), place)
        if not after.any(axis=0).all():
            continue  # a last Bézier piece that lacks points is not there, and its points do nothing
        solution = np.linalg.lstsq(after, before, rcond=None)[0]
        if np.abs(after @ solution - before).max() < SAME:
            result: Array = solution
            return result
    raise UserError(
        "This patch cannot be subdivided and stay the same: switch on Endpoint, or Bézier off, in its "
        "Active Spline settings"
    )


def reversing(axis: NurbsAxis, count: int) -> IndexArray:
    """The order of an axis's control points, (count,), in which the patch runs backwards.

    Raises UserError where Blender's knots are not the same from both ends.
    """
    place = np.linspace(0.0, 1.0, SAMPLES * count + 1)[1:-1]  # not the ends: of a closed axis they are one
    there, back = functions(Basis(axis, count), place), functions(Basis(axis, count), 1.0 - place)
    for shift in range(count) if axis.cyclic else (count - 1,):
        order: IndexArray = (shift - np.arange(count)) % count
        if np.abs(there - back[:, order]).max() < SAME:
            return order
    raise UserError("The knots of this patch are not alike from both ends: convert it to a grid first")


def patch_near(surface: ControlSurface, columns: int, rows: int) -> NurbsPatch:
    """A patch with the same Q(u, v), in volume space; cubic, with columns × rows control points.

    Exact for what is bilinear; a grid of at least 3 × 3 points becomes a patch of order 2 with these points,
    exactly. Others by least squares, with an error that falls as the fourth power of the
    number of points. Raises UserError for a surface with holes.
    """
    if isinstance(surface, Grid) and min(surface.points.shape[:2]) > 2:
        across, up = surface.points.shape[1], surface.points.shape[0]
        return NurbsPatch(sampled(surface, across, up), NurbsAxis(2), NurbsAxis(2))
    along_u, along_v = NurbsAxis(min(CUBIC, columns)), NurbsAxis(min(CUBIC, rows))
    samples = sampled(surface, SAMPLES * columns + 1, SAMPLES * rows + 1)
    return NurbsPatch(fitted_points(samples, np.ones((rows, columns)), along_u, along_v), along_u, along_v)
