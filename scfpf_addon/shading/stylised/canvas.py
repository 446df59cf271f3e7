# SPDX-License-Identifier: GPL-3.0-or-later
"""What is seen at many places of the image, as lines are found between them."""

from __future__ import annotations

from collections.abc import Iterator
from typing import TYPE_CHECKING, Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from ...casting.common.hits import CastCounts, Hits
from ...projection.typing import Array, BoolArray, IndexArray
from ...projection.volume.viewing_volume import image_derivatives
from ..scene.surface import smooth_normal
from ..typing import Single

if TYPE_CHECKING:
    from ..pipeline import Pipeline

# Places whose derivatives are made at once: those of a volume of four surfaces take 20 MB.
AT_ONCE = 1 << 15
# A surface is not taken to be seen at a flatter angle than this sine: float64 ends at 1e-16.
FLATTEST = 1e-9
# Keeps a vector of no length from becoming NaN.
TINY = 1e-300


class View(NamedTuple):
    """n places of the image, what is seen there in cast space.

    mask: (n,) whether the image shows something there, hit: (n,) whether that is the scene; the rest
    counts where it is. t: (n,). position: (3, n). normal: (3, n) of the triangle, on the side of the
    viewer. facing: (n,) cosine of the shading normal, on that side, with the projector's tangent reversed:
    below 0 a smooth surface turns away. triangle, thing, material: (n,) numbers. reach: (2, n) how far
    the surface goes on in a pixel along x and y. footprint: (2, n) how wide a pixel is there. slope:
    (n,) the length of t's gradient, a pixel.
    """

    mask: BoolArray
    hit: BoolArray
    t: Array
    position: Array
    normal: Array
    facing: Single
    triangle: NDArray[np.int32]
    thing: NDArray[np.int32]
    material: NDArray[np.int32]
    reach: Single
    footprint: Single
    slope: Single

    def take(self, index: IndexArray) -> View:
        """The places at ``index``."""
        return View._make(values[..., index] for values in self)

    def put(self, where: IndexArray, other: View) -> View:
        """The same places, with those at ``where`` replaced by other ones, in order."""
        made = View._make(values.copy() for values in self)
        pairs: Iterator[tuple[Any, Any]] = zip(made, other, strict=True)
        for mine, its in pairs:
            mine[..., where] = its
        return made


def see(pipeline: Pipeline, hits: Hits) -> View:
    """What projectors of the pipeline have hit, as yet without derivatives.

    The pipeline must have something to hit.
    """
    cast_scene, geometry, shading = pipeline.cast_scene, pipeline.geometry, pipeline.shading
    if cast_scene is None or geometry is None or shading is None:
        raise ValueError("there is nothing to see")
    count = len(hits.t)
    mask, hit = hits.mask, hits.triangle >= 0
    triangle = np.maximum(hits.triangle, 0).astype(np.intp)
    if shading.held_out is not None:
        # A hole in the picture has neither rim nor surface.
        held = shading.held_out.take(triangle) & hit
        mask, hit = mask & ~held, hit & ~held
    if shading.catchers is not None:
        hit = hit & ~shading.catchers.meets(triangle)
    normal = cast_scene.normals(triangle)
    ahead = hits.tangent / np.maximum(np.sqrt(np.einsum("cn,cn->n", hits.tangent, hits.tangent)), TINY)
    corners = shading.surface.smooth
    side = -np.copysign(1.0, np.einsum("cn,cn->n", normal, ahead))
    if corners is None:
        facing = np.ones(count, np.float32)
    else:
        flat = shading.surface.flat.take(triangle, axis=1)
        turned = -np.copysign(np.float32(1), np.einsum("cn,cn->n", flat, ahead.astype(np.float32)))
        smooth = smooth_normal(corners, triangle, hits.barycentric.astype(np.float32), turned)
        facing = -np.einsum("cn,cn->n", smooth, ahead.astype(np.float32))
    normal = normal * side
    return View(
        mask,
        hit,
        np.where(hit, hits.t, 0.0),
        hits.position,
        normal,
        facing,
        hits.triangle,
        np.where(hit, geometry.object_index[triangle], -1).astype(np.int32),
        np.where(hit, geometry.material[triangle], -1).astype(np.int32),
        np.zeros((2, count), np.float32),
        np.zeros((2, count), np.float32),
        np.zeros(count, np.float32),
    )


def measure(pipeline: Pipeline, view: View, x: Array, y: Array, where: IndexArray) -> None:
    """Fill in the derivatives of the view's places ``where`` (m,), which must be hits: half of its cost."""
    for first in range(0, len(where), AT_ONCE):
        some = where[first : first + AT_ONCE]
        view.reach[:, some], view.footprint[:, some], view.slope[some] = _derivatives(
            pipeline, x[some], y[some], view.t[some], view.normal[:, some]
        )


def _derivatives(
    pipeline: Pipeline, x: Array, y: Array, t: Array, normal: Array
) -> tuple[Array, Array, Array]:
    """``View.reach``, ``footprint`` and ``slope``, lengths in the pipeline's pixels.

    Q(x, y, t) stays on the plane of the triangle: n·(Qx + Qt tx) = 0 gives the derivative of t.
    """
    projection = pipeline.projection
    image = projection.parameters(x, y)
    sample = projection.volume.evaluate(image.u, image.v, t)
    towards = np.einsum("cn,cn->n", normal, sample.dt)
    speed = np.maximum(np.sqrt(np.einsum("cn,cn->n", sample.dt, sample.dt)), TINY)
    towards = np.copysign(np.maximum(np.abs(towards), FLATTEST * speed), towards)
    ahead = sample.dt / speed
    reach, footprint, squared = np.empty((2, len(x))), np.empty((2, len(x))), np.zeros(len(x))
    sizes = pipeline.settings.width, pipeline.settings.height
    sides = image_derivatives(sample.du, sample.dv, image.jacobian)
    for axis, (side, pixels) in enumerate(zip(sides, sizes, strict=True)):
        side = side / pixels
        across = side - np.einsum("cn,cn->n", side, ahead) * ahead
        change = -np.einsum("cn,cn->n", normal, side) / towards
        moved = side + sample.dt * change
        reach[axis] = np.sqrt(np.einsum("cn,cn->n", moved, moved))
        footprint[axis] = np.sqrt(np.einsum("cn,cn->n", across, across))
        squared += change * change
    return reach, footprint, np.sqrt(squared)


def look(pipeline: Pipeline, x: Array, y: Array) -> View:
    """What is seen at any places x, y (n,)."""
    view = see(pipeline, pipeline.cast(x, y, CastCounts(), in_rows=False))
    measure(pipeline, view, x, y, np.flatnonzero(view.hit))
    return view
