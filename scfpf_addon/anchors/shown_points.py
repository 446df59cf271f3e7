# SPDX-License-Identifier: GPL-3.0-or-later
"""The points that an image shows at some of its positions, and the directions in which it sees them."""

from __future__ import annotations

from collections.abc import Sequence
from typing import NamedTuple

import numpy as np

from ..casting.common.hits import Hits
from ..casting.curves.sampled_curves import MOST_SQUEEZE, across, pixel_widths
from ..projection.typing import Array, BoolArray, IndexArray
from ..projection.volume.viewing_volume import Projection, image_derivatives
from .seen_scene import SeenScene

# The largest angle between an anchor's ray and the projector, and that of what changes with the direction in
# which it is seen, as gloss does, radians.
ANGLE, DIRECTIONAL_ANGLE = float(np.radians(20.0)), float(np.radians(10.0))


class ShownPoints(NamedTuple):
    """N points that an image shows.

    position: (3, N), world space; of projectors that meet nothing, their ends. begin: (3, N), where the
    projectors begin. direction: (3, N) unit, in
    which projectors arrive. normal: (3, N) unit, of the side that is seen, 0 where nothing is met. length:
    (N,), the side of the image's pixel there, in world units. triangle: (N,) int, -1 where nothing is met.
    place: (2, N), the image positions, in [0, 1]. t: (N,), of their projectors, inf where nothing is met.
    number: (N,), of the image position. frame: (N,), of the picture, of several. angle: (N,), radians, the
    largest one between an anchor's ray and the projector.
    """

    position: Array
    begin: Array
    direction: Array
    normal: Array
    length: Array
    triangle: IndexArray
    place: Array
    t: Array
    number: IndexArray
    frame: IndexArray
    angle: Array

    @property
    def is_hit(self) -> BoolArray:
        """Return whether each point is on a thing, (N,)."""
        found: BoolArray = self.triangle >= 0
        return found

    def take(self, which: IndexArray) -> ShownPoints:
        """Return the points with the numbers ``which`` (n,)."""
        return ShownPoints._make(each.take(which, -1) for each in self)


def from_all_sides(points: ShownPoints) -> ShownPoints:
    """The points without normals: anchors show strokes and hair from all sides."""
    return points._replace(normal=np.zeros_like(points.normal))


def joined_points(parts: Sequence[ShownPoints]) -> ShownPoints:
    """The points of one or more parts as one, in their order."""
    return ShownPoints._make(np.concatenate(each, axis=-1) for each in zip(*parts, strict=True))


def shown_points(
    seen: SeenScene,
    projection: Projection,
    x: Array,
    y: Array,
    pixel_size: tuple[float, float],
    pixel_error: float = 0.1,
) -> ShownPoints:
    """Cast at image positions x, y (N,) in [0, 1]; positions that show nothing at all are left out.

    projection: in world space. pixel_size, pixel_error: as for ``cast``. Raises CastError.
    """
    hits = seen.first_hits(projection, x, y, pixel_size, pixel_error)
    return points_of(seen, projection, hits, x, y, pixel_size)


def points_of(
    seen: SeenScene,
    projection: Projection,
    hits: Hits,
    x: Array,
    y: Array,
    pixel_size: tuple[float, float],
) -> ShownPoints:
    """The points that hits (N,) of a scene show at image positions x, y (N,). See ``shown_points``."""
    scene, kept = seen.scene, np.flatnonzero(hits.mask)
    t, triangle = hits.t.take(kept), hits.triangle.take(kept).astype(np.int64)
    is_hit = triangle >= 0
    position = hits.position.take(kept, 1) / scene.scale + scene.centre[:, None]
    tangent = hits.tangent.take(kept, 1)
    speed = np.linalg.norm(tangent, axis=0)
    direction = tangent / np.maximum(speed, np.finfo(np.float64).tiny)
    normal = np.zeros_like(position)
    normal[:, is_hit] = scene.normals(triangle[is_hit])
    normal *= -np.copysign(1.0, np.einsum("cn,cn->n", normal, direction))
    place = np.stack([x.take(kept), y.take(kept)])
    length = _lengths(projection, place, np.where(is_hit, t, 1.0), direction, pixel_size)
    first = projection.volume.spans.weights(np.zeros(1))[0][:, 0]
    begin = np.einsum("k,kcn->cn", first, projection.projectors(*place).points)
    frame = np.zeros(len(kept), np.intp)
    angle = np.full(len(kept), ANGLE)
    if seen.directional is not None:
        angle[is_hit] = np.where(seen.directional[triangle[is_hit]], DIRECTIONAL_ANGLE, ANGLE)
    return ShownPoints(position, begin, direction, normal, length, triangle, place, t, kept, frame, angle)


def _lengths(
    projection: Projection, place: Array, t: Array, direction: Array, pixel_size: tuple[float, float]
) -> Array:
    """The sides (N,) of squares as large as the image's pixels at t (N,) of projectors, in world units."""
    image = projection.parameters(*place)
    with np.errstate(invalid="ignore", over="ignore"):
        controls = projection.volume.controls(image.u, image.v)
        weights, _ = projection.volume.spans.weights(t)
        sides = [
            across(np.einsum("kn,kcn->cn", weights, control) * size, direction)
            for control, size in zip(
                image_derivatives(controls.du, controls.dv, image.jacobian), pixel_size, strict=True
            )
        ]
        xx, yy, xy = (
            np.einsum("cn,cn->n", sides[one], sides[other]) for one, other in ((0, 0), (1, 1), (0, 1))
        )
        wide, narrow = pixel_widths(xx, yy, xy)
        # Near a pole and at a fold pixels are squeezed by any factor, for which nobody looks so closely.
        narrow = np.maximum(narrow, wide / MOST_SQUEEZE**2)
        return np.nan_to_num((wide * narrow) ** 0.25)
