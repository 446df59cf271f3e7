# SPDX-License-Identifier: GPL-3.0-or-later
"""The surface that the image shows at many places, sampled to find the lines between them."""

from __future__ import annotations

from collections.abc import Iterator
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from ...casting.common.hits import CastCounts, Hits
from ...projection.typing import Array, BoolArray, IndexArray
from ...projection.volume.viewing_volume import Projection, image_derivatives
from ..scene.surface import smooth_normal
from ..tracing.scene_view import SceneView
from ..typing import Single
from ..vectors import dot, unit

# Places whose derivatives are made at once: those of a volume of four surfaces take 20 MB.
AT_ONCE = 1 << 15
# The smallest sine of an angle between surface and projector: float64 ends at 1e-16.
FLATTEST = 1e-9
# Keeps a vector of no length from becoming NaN.
TINY = 1e-300


class SurfaceSamples(NamedTuple):
    """The surface at n places of the image, in cast space.

    mask: (n,) whether the image shows anything there. hit: (n,) whether that is the scene; the other fields
    hold only there. t: (n,). position: (3, n). normal: (3, n) of the triangle, on the side of the viewer.
    facing: (n,) cosine between the shading normal, on that side, and the projector's tangent reversed:
    negative where a smooth surface turns away. triangle, object_index, material: (n,) numbers.
    reach: (2, n) distance along the surface of a pixel's step along x and y. footprint: (2, n) size of a
    pixel there. slope: (n,) length of t's gradient, per pixel.
    """

    mask: BoolArray
    hit: BoolArray
    t: Array
    position: Array
    normal: Array
    facing: Single
    triangle: NDArray[np.int32]
    object_index: NDArray[np.int32]
    material: NDArray[np.int32]
    reach: Single
    footprint: Single
    slope: Single

    def take(self, index: IndexArray) -> SurfaceSamples:
        """The places at ``index``."""
        return SurfaceSamples._make(values[..., index] for values in self)

    def put(self, where: IndexArray, other: SurfaceSamples) -> SurfaceSamples:
        """A copy in which other samples replace those at ``where``, in order."""
        made = SurfaceSamples._make(values.copy() for values in self)
        pairs: Iterator[tuple[Any, Any]] = zip(made, other, strict=True)
        for mine, its in pairs:
            mine[..., where] = its
        return made


def samples_of_hits(view: SceneView, hits: Hits) -> SurfaceSamples:
    """The surface at hits of the view's projectors, without derivatives.

    Raises ValueError without triangles.
    """
    cast_scene, geometry, shading = view.cast_scene, view.scene.geometry, view.shading
    if cast_scene is None or shading is None:
        raise ValueError("the view has no triangles")
    count = len(hits.t)
    mask, hit = hits.mask, hits.triangle >= 0
    triangle = np.maximum(hits.triangle, 0).astype(np.intp)
    if shading.held_out is not None:
        # A hole in the image has neither rim nor surface.
        held = shading.held_out.take(triangle) & hit
        mask, hit = mask & ~held, hit & ~held
    if shading.catchers is not None:
        hit = hit & ~shading.catchers.meets(triangle)
    normal = cast_scene.normals(triangle)
    ahead = unit(hits.tangent)
    corners = shading.surface.smooth
    facing = np.ones(count, np.float32)
    if corners is not None:
        flat, direction = shading.surface.flat.take(triangle, axis=1), ahead.astype(np.float32)
        turned = -np.copysign(np.float32(1), dot(flat, direction))
        smooth = smooth_normal(corners, triangle, hits.barycentric.astype(np.float32), turned)
        facing = -dot(smooth, direction)
    return SurfaceSamples(
        mask=mask,
        hit=hit,
        t=np.where(hit, hits.t, 0.0),
        position=hits.position,
        normal=normal * -np.copysign(1.0, dot(normal, ahead)),
        facing=facing,
        triangle=hits.triangle,
        object_index=np.where(hit, geometry.object_index[triangle], -1).astype(np.int32),
        material=np.where(hit, geometry.material[triangle], -1).astype(np.int32),
        reach=np.zeros((2, count), np.float32),
        footprint=np.zeros((2, count), np.float32),
        slope=np.zeros(count, np.float32),
    )


def add_derivatives(view: SceneView, samples: SurfaceSamples, x: Array, y: Array, where: IndexArray) -> None:
    """Fill in reach, footprint and slope of the samples ``where`` (m,), which must be hits.

    They are half of the cost of samples.
    """
    for number, projection in enumerate(view.projection.of_layers):
        own = where
        if view.parts:
            own = where[view.parts.numbers.take(samples.triangle[where]) == number]
        for first in range(0, len(own), AT_ONCE):
            some = own[first : first + AT_ONCE]
            samples.reach[:, some], samples.footprint[:, some], samples.slope[some] = _derivatives(
                view, projection, x[some], y[some], samples.t[some], samples.normal[:, some]
            )
        if not view.parts:
            break


def _derivatives(
    view: SceneView, projection: Projection, x: Array, y: Array, t: Array, normal: Array
) -> tuple[Array, Array, Array]:
    """Reach, footprint and slope of ``SurfaceSamples``, by pixels of the view.

    projection: of the samples' layer.
    Q(x, y, t) stays on the plane of the triangle: n·(Qx + Qt tx) = 0 gives the derivative of t.
    """
    image = projection.parameters(x, y)
    sample = projection.volume.evaluate(image.u, image.v, t)
    towards = dot(normal, sample.dt)
    speed = np.maximum(np.sqrt(dot(sample.dt, sample.dt)), TINY)
    towards = np.copysign(np.maximum(np.abs(towards), FLATTEST * speed), towards)
    ahead = sample.dt / speed
    reach, footprint, squared = np.empty((2, len(x))), np.empty((2, len(x))), np.zeros(len(x))
    sizes = view.settings.width, view.settings.height
    sides = image_derivatives(sample.du, sample.dv, image.jacobian)
    for axis, (side, pixels) in enumerate(zip(sides, sizes, strict=True)):
        side = side / pixels
        across = side - dot(side, ahead) * ahead
        change = -dot(normal, side) / towards
        moved = side + sample.dt * change
        reach[axis] = np.sqrt(dot(moved, moved))
        footprint[axis] = np.sqrt(dot(across, across))
        squared += change * change
    return reach, footprint, np.sqrt(squared)


def sample_surface(view: SceneView, x: Array, y: Array) -> SurfaceSamples:
    """The surface at any image positions x, y (n,), with derivatives."""
    samples = samples_of_hits(view, view.cast(x, y, CastCounts(), in_rows=False))
    add_derivatives(view, samples, x, y, np.flatnonzero(samples.hit))
    return samples
