# SPDX-License-Identifier: GPL-3.0-or-later
"""The surface at a hit: normals that face the viewer, the view direction, the material.

All in float32: cast space has the size of the unit box, so that a float32
keeps seven digits of it. Hits do not depend on anything here.
"""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from dataclasses import dataclass
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from ...casting.common.geometry import Geometry
from ...casting.scene.cast_scene import CastScene
from ...projection.typing import Array, IndexArray
from ..typing import Single
from ..vectors import dot
from .normals import normals_of

# The least divisor of vectors: a zero vector stays 0 instead of NaN.
TINY = np.float32(1e-30)


class ShadowStart(NamedTuple):
    """The origins of the shadow rays of N points, in cast space.

    origin: (3, N), just off the triangle on the side of the viewer. flat: (3, N)
    unit normal of the triangle on that side. height: (N,), see ``smooth_height``; None if all is flat.
    """

    origin: Single
    flat: Single
    height: Single | None


class SurfacePoints(NamedTuple):
    """The surface at N hits, float32, in cast space.

    position: (3, N). normal: (3, N) unit, interpolated, on the side of the viewer.
    view: (3, N) unit, towards the viewer: against the projector's tangent (paper §4.3).
    material: (N,) index. shadow: None if no lamp casts shadows. linked: (N,), see ``Geometry.linked``.
    """

    position: Single
    normal: Single
    view: Single
    material: IndexArray
    shadow: ShadowStart | None
    linked: IndexArray | None = None

    def take(self, index: IndexArray) -> SurfacePoints:
        """The points at ``index``."""
        shadow = self.shadow
        if shadow is not None:
            height = None if shadow.height is None else shadow.height.take(index)
            shadow = ShadowStart(shadow.origin.take(index, 1), shadow.flat.take(index, 1), height)
        return SurfacePoints(
            position=self.position.take(index, 1),
            normal=self.normal.take(index, 1),
            view=self.view.take(index, 1),
            material=self.material.take(index),
            shadow=shadow,
            linked=None if self.linked is None else self.linked.take(index),
        )


@dataclass(frozen=True)
class SurfaceTable:
    """Tables by triangle, component-first so that a lookup is one take.

    flat: (3, T) float32, unit normals of the triangles, on the side of the corners'.
    smooth: (9, T) float32: the first corner's normal, and the differences to it of the second's
    and third's; None if all shading is flat.
    bulge: (6, T) float32, see ``corner_heights``; None without shadows or smooth shading.
    shadows: whether any light casts shadows. material: (T,). linked: (T,) or None.
    """

    cast_scene: CastScene
    flat: Single
    smooth: Single | None
    bulge: Single | None
    shadows: bool
    material: IndexArray
    linked: IndexArray | None = None

    @property
    def weighted(self) -> bool:
        """Return whether ``points`` needs the barycentric weights of a hit."""
        return self.smooth is not None

    @classmethod
    def of(cls, geometry: Geometry, cast_scene: CastScene, shadows: bool, threads: int = 0) -> SurfaceTable:
        """The table of the triangles of ``cast_scene``, made in threads (0: all cores)."""
        normals = normals_of(geometry, cast_scene, shadows, threads)
        number = geometry.material
        # One number need not be stored a million times.
        alike = bool((number == number[0]).all())
        material = (
            np.broadcast_to(number[0].astype(np.intp), number.shape) if alike else number.astype(np.intp)
        )
        return cls(
            cast_scene=cast_scene,
            flat=normals.flat,
            smooth=normals.smooth,
            bulge=normals.bulge,
            shadows=shadows,
            material=material,
            linked=geometry.linked,
        )

    def points(
        self,
        triangle: IndexArray,
        barycentric: Iterable[NDArray[Any]] | None,
        position: Array,
        tangent: NDArray[Any],
    ) -> SurfacePoints:
        """The surface at hits: triangle (N,), barycentric (2, N), position and tangent (3, N).

        The weights are those of the second and third corner, None if all shading is flat. Position is
        in cast space; the tangent is dQ/dt of the projector, of any length, and overwritten if it is float32.
        """
        triangle = triangle.astype(np.intp)
        # NumPy's fastest mode; for -1 it reads the last triangle.
        flat = self.flat.take(triangle, axis=1, mode="wrap")
        view = tangent.astype(np.float32, copy=False)
        view *= -1 / (np.sqrt(dot(view, view)) + TINY)
        # The triangle's normal decides which side is visible: an interpolated one errs near a silhouette.
        side = np.copysign(np.float32(1), dot(flat, view))
        normal = flat
        if self.smooth is None or barycentric is None or self.shadows:
            flat *= side
        if self.smooth is not None and barycentric is not None:
            weight = [row.astype(np.float32, copy=False) for row in barycentric]
            normal = smooth_normal(self.smooth, triangle, weight, side)
        place, shadow = position.astype(np.float32), None
        if self.shadows:
            height = None
            if self.bulge is not None and barycentric is not None:
                height = smooth_height(self.bulge.take(triangle, axis=1, mode="wrap"), weight, side)
            # As ``offset_origins``: float32's rounding is far less than the offset.
            shadow = ShadowStart(place + flat * self.cast_scene.offsets(triangle, place), flat, height)
        material = self.material.take(triangle, mode="wrap")
        linked = None if self.linked is None else self.linked.take(triangle, mode="wrap")
        return SurfacePoints(
            position=place, normal=normal, view=view, material=material, shadow=shadow, linked=linked
        )


def smooth_normal(
    table: Single, triangle: IndexArray, weight: Sequence[Single] | Single, side: Single
) -> Single:
    """Interpolated unit normals (3, N), on the given side.

    table: (9, T) as in ``SurfaceTable.smooth``; triangle: (N,); weight: two (N,); side: (N,) ±1.
    """
    normal: Single = table[3:6].take(triangle, axis=1, mode="wrap")
    normal *= weight[0]
    term = table[:3].take(triangle, axis=1, mode="wrap")
    normal += term
    table[6:].take(triangle, axis=1, out=term, mode="wrap")
    term *= weight[1]
    normal += term
    normal *= side / (np.sqrt(dot(normal, normal)) + TINY)
    return normal


def smooth_height(heights: Single, weight: Sequence[Single], side: Single) -> Single:
    """Height, along the normal, of the rounded surface that smooth shading pretends to, (N,).

    heights: (6, N) of ``corner_heights``; weight: two (N,); side: (N,) ±1. The mean of
    the distances by which the point lies below the corners' tangent planes, 0 where it lies above, in a
    hollow. After Hanika, Hacking the Shadow Terminator (Ray
    Tracing Gems II, ch. 4).
    """
    weights = (1 - weight[0] - weight[1], weight[0], weight[1])
    height = np.zeros_like(side)
    for k in range(3):
        above = heights[2 * k] * weights[(k + 1) % 3]
        above += heights[2 * k + 1] * weights[(k + 2) % 3]
        above *= side
        height -= weights[k] * np.minimum(above, 0)
    return height
