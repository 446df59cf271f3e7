# SPDX-License-Identifier: GPL-3.0-or-later
"""Projections as control surfaces of the same number and kind, to be blended point by point.

If the projectors of all are Bézier curves, they become curves of one degree, which is exact. Otherwise all
become polylines. The control points that the image shows become grids over the same parameters, or triangles
that are cut along seams.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from math import comb, lcm

import numpy as np

from ...projection.user_error import UserError
from ..arrays import bilinear_net
from ..typing import Array
from ..volume.basis import BasisKind
from ..volume.reparameterisation import Polar
from ..volume.viewing_volume import Projection
from .blend_map import BlendMap
from .seam_mesh import PROBES, SeamMesh, seam_mesh
from .volume_edits import lattice

# Pieces of a polyline in place of curves that are not alike, at least and at most.
FEWEST_PIECES, MOST_PIECES = 12, 36
# Faces along an axis that are tried until a grid is within GRID_ERROR of the size of what it holds.
FACES = (1, 8, 16, 32, 64, 128)
GRID_ERROR = 2e-4
# Faces of a grid that has to hold a map with smooth borders, or with sharp ones.
SMOOTH_FACES, SHARP_FACES = 64, FACES[-1]
# A size that divides where all points coincide.
SMALLEST_SIZE = 1e-300
# Places that are looked at along each side of a face.
STEPS = 4


@dataclass(frozen=True)
class Blend:
    """Volumes point by point.

    basis: of the projectors. layers: from near to far, (P, R, C, 3) each: the points of all P, rows along v;
    with a mesh (P, V, 3), those of its vertices. polar: whether u and v are those of a polar image; else they
    are the image's x and y. error: about the distance of the grids and polylines from the volumes, as a share
    of the size. mesh: of the image, cut along seams; None for grids.
    """

    basis: BasisKind
    layers: tuple[Array, ...]
    polar: bool
    error: float
    mesh: SeamMesh | None = None


def blended(
    ends: Sequence[Projection],
    least_faces: int = 1,
    seams: Sequence[BlendMap] = (),
    aspect: float = 1.0,
) -> Blend:
    """Return projections as control surfaces of the same number and kind, in their own space.

    least_faces: of the grids along each axis, at most SHARP_FACES. Polar images without mappings give a polar
    blend. seams: sharp maps, whose borders cut the image, of this aspect, unless the blend is polar.
    Raises UserError where one image has holes.
    """
    polar = all(isinstance(p.reparameterisation, Polar) for p in ends)
    basis, matrices, times = _common(ends)
    if seams and not polar:
        pairs = tuple(zip(ends, matrices, strict=True))
        return _with_seams(basis, pairs, times, least_faces, seams, aspect)
    if seams:
        least_faces = SHARP_FACES
    for faces in (count for count in FACES if count >= least_faces):
        points = [_points(p, matrices[k], times, faces, polar) for k, p in enumerate(ends)]
        off = [_bend(p) for p in points]
        if max(off) <= GRID_ERROR:
            break
    # The lines between were needed only to measure the grid.
    layers = tuple(np.stack([p[k, ::STEPS, ::STEPS] for p in points]) for k in range(len(points[0])))
    return Blend(basis, layers, polar, max(off))


def _with_seams(
    basis: BasisKind,
    ends: Sequence[tuple[Projection, Array | None]],
    times: Array,
    least_faces: int,
    seams: Sequence[BlendMap],
    aspect: float,
) -> Blend:
    """The blend of projections on triangles that are cut along seams. ends: each with its matrix."""
    for faces in (count for count in FACES if count >= least_faces):
        mesh = seam_mesh(seams, aspect, faces)
        points = [_points_at(p, matrix, times, mesh.inner.T) for p, matrix in ends]
        off = []
        for (projection, matrix), own in zip(ends, points, strict=True):
            probed = _points_at(projection, matrix, times, mesh.probes.reshape(-1, 2).T)
            expected = np.einsum("pc,ktcd->kptd", PROBES, own[:, mesh.triangles])
            worst = float(np.linalg.norm(probed.reshape(expected.shape) - expected, axis=-1).max())
            off.append(worst / max(float(np.ptp(own.reshape(-1, 3), axis=0).max()), SMALLEST_SIZE))
        if max(off) <= GRID_ERROR:
            break
    layers = tuple(np.stack([own[k] for own in points]) for k in range(len(points[0])))
    return Blend(basis, layers, False, max(off), mesh)


def _common(ends: Sequence[Projection]) -> tuple[BasisKind, list[Array | None], Array]:
    """The basis of all, and how their layers are made: from control points by matrices, or at times t."""
    spans = [p.volume.spans for p in ends]
    if all(len(s.matrices) == 1 and s.point_weights is None for s in spans):
        degree = max(s.degree for s in spans)
        return "BEZIER", [_elevation(s.degree, degree) @ s.matrices[0] for s in spans], np.zeros(0)
    counts = [len(s.matrices) for s in spans]
    pieces = lcm(*counts)
    straight = all(s.is_polyline for s in spans)
    if not straight or pieces > MOST_PIECES:
        pieces *= max(1, -(-FEWEST_PIECES // pieces))
    pieces = min(pieces, MOST_PIECES)
    return "POLYLINE", [None] * len(ends), np.linspace(0.0, 1.0, pieces + 1)


def _elevation(degree: int, wanted: int) -> Array:
    """The matrix (wanted + 1, degree + 1) from control points of a Bézier curve to those of a higher degree.

    Farin, Curves and Surfaces for CAGD, §6.1, applied wanted - degree times.
    """
    more = wanted - degree
    matrix = np.zeros((wanted + 1, degree + 1))
    for row in range(wanted + 1):
        for column in range(max(0, row - more), min(degree, row) + 1):
            matrix[row, column] = comb(degree, column) * comb(more, row - column) / comb(wanted, row)
    return matrix


def _points(projection: Projection, matrix: Array | None, times: Array, faces: int, polar: bool) -> Array:
    """Layers (K, R, C, 3) over STEPS · faces + 1 places along each axis."""
    count = STEPS * faces + 1
    layers = _points_at(projection, matrix, times, np.stack(lattice(count, count)), polar)
    placed: Array = layers.reshape(len(layers), count, count, 3)
    return placed


def _points_at(
    projection: Projection, matrix: Array | None, times: Array, places: Array, polar: bool = False
) -> Array:
    """Layers (K, N, 3) at places (2, N) of the image, or of the used part of a polar one's parameters."""
    x, y = places
    if polar:
        (u0, u1), (v0, v1) = projection.u_range, projection.v_range
        u, v = u0 + x * (u1 - u0), v0 + y * (v1 - v0)
        shown = np.ones(len(x), bool)
    else:
        u, v, _, shown = projection.parameters(x, y)
        # Beyond the rim of a polar image its surfaces go on, as far as they do.
        shown = shown | isinstance(projection.reparameterisation, Polar)
    controls = projection.volume.controls(u, v)
    if not (controls.valid & shown).all() or not np.isfinite(controls.points).all():
        raise UserError("The picture of one camera has empty parts, which have nothing to be blended with")
    if matrix is None:
        weights, _ = projection.volume.spans.weights(times)
        matrix = weights.T
    layers: Array = np.einsum("kc,cdn->knd", matrix, controls.points)
    return layers


def _bend(layers: Array) -> float:
    """The distance of points from a grid of every STEPS-th line, as a share of the size."""
    size = float(np.ptp(layers.reshape(-1, 3), axis=0).max())
    points = np.moveaxis(layers, -1, 1)
    off = points - bilinear_net(points[..., ::STEPS, ::STEPS], STEPS)
    worst = float(np.linalg.norm(off, axis=1).max())
    return worst / size if size > 0.0 else 0.0
