# SPDX-License-Identifier: GPL-3.0-or-later
"""The space in which Solid shading sees a pixel: its own axes, or the camera's if the image is a perspective.

Blender's Solid view lights all of an image from the camera's axes. That is right for an ordinary
perspective, and wrong where projectors turn: the light would come from beside or behind. There each pixel is
lit from its own axes. Between the two the axes are blended, so that a volume that is bent step by step
changes its light step by step.
"""

from __future__ import annotations

import numpy as np

from ...projection.typing import Array, IndexArray
from ..typing import Single
from ..vectors import dot
from .live_hits import LiveHits
from .studio_light import LitPixels

# Positions along each side of the image at which its projectors are compared with a perspective's.
MEASURES = 7
# Radians off a perspective up to which the camera's axes apply, and from which the pixels' own do.
STRAIGHT, BENT = np.radians(1.0), np.radians(10.0)
# Cosine to the camera's axis below which a direction counts as beside the camera.
BESIDE = 0.02
AHEAD = np.array([[0.0], [0.0], [1.0]], np.float32)


def camera_share(hits: LiveHits, axes: Array | None) -> float:
    """The share of the camera's axes in the light, 0 to 1, by how close to a perspective the image is.

    axes: (3, 3), the camera's right, up and backward in world space as columns; None for none.
    """
    if axes is None or not len(hits.mask):
        return 0.0
    rows, columns = (
        np.linspace(0, size - 1, min(MEASURES, size)).round().astype(np.intp)
        for size in (hits.height, hits.width)
    )
    places = (rows[:, None] * hits.width + columns).ravel()
    places = places[hits.mask[places]]
    directions = axes.T @ hits.forward[:, places].astype(np.float64)
    if len(places) < MEASURES or (directions[2] > -BESIDE).any():
        return 0.0
    turned = _off_perspective(directions, *(places % hits.width, places // hits.width))
    return float(np.clip((BENT - turned) / (BENT - STRAIGHT), 0.0, 1.0))


def _off_perspective(directions: Array, column: IndexArray, row: IndexArray) -> float:
    """The largest angle, radians, to the perspective that is closest.

    directions: (3, n), in camera space. A perspective's points on the plane before the camera depend
    linearly on the position in the image.
    """
    across, upward = directions[:2] / -directions[2]
    fitted = []
    for values, place in ((across, column), (upward, row)):
        basis = np.stack([np.ones(len(place)), place.astype(np.float64)], axis=1)
        fitted.append(basis @ np.linalg.lstsq(basis, values, rcond=None)[0])
    expected = np.stack([*fitted, np.full(len(across), -1.0)])
    cosine = dot(expected, directions) / np.linalg.norm(expected, axis=0)
    return float(np.arccos(np.clip(cosine, -1.0, 1.0)).max())


def seen_by_lights(
    hits: LiveHits, some: slice | IndexArray, axes: Array | None, share: float, in_world: bool
) -> LitPixels:
    """The normals and view vectors of some pixels in the space of the lights.

    axes, share: as for ``camera_share``. in_world: whether the lights stand in world space.
    """
    normal, forward = columns(hits.normal, some), columns(hits.forward, some)
    if in_world:
        return LitPixels(normal, -forward)
    own = None
    if share < 1.0 or axes is None:
        right, up = columns(hits.right, some), columns(hits.up, some)
        own = np.stack([dot(normal, right), dot(normal, up), -dot(normal, forward)])
        if share <= 0.0 or axes is None:
            return LitPixels(own, AHEAD)
    turn = axes.T.astype(np.float32)
    by_camera, incident = turn @ normal, -(turn @ forward)
    if own is None:
        return LitPixels(by_camera, incident)
    part = np.float32(share)
    return LitPixels(_unit(part * by_camera + (1 - part) * own), _unit(part * incident + (1 - part) * AHEAD))


def columns(values: Single, some: slice | IndexArray) -> Single:
    """Some columns of (3, n) values; a view if they are a slice."""
    return values[:, some] if isinstance(some, slice) else values.take(some, axis=1)


def _unit(vectors: Single) -> Single:
    vectors /= np.sqrt(np.maximum(dot(vectors, vectors), np.float32(1e-12)))
    return vectors
