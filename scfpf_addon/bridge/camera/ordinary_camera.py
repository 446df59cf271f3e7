# SPDX-License-Identifier: GPL-3.0-or-later
"""The frustum of an ordinary camera, as two planes."""

from __future__ import annotations

from dataclasses import replace
from typing import NamedTuple

import numpy as np

from ...projection.surfaces.surface import Plane
from ...projection.typing import Array
from ...projection.user_error import UserError
from ...projection.volume.viewing_volume import Projection, ViewingVolume
from ..blender.scene_objects import missing_text

# The corners of an image, and how far rounding moves a surface's, as a share of its largest coordinate.
CORNERS = np.array([[0.0, 1.0, 0.0, 1.0], [0.0, 0.0, 1.0, 1.0]])
ROUNDED = 2.0**-21
# Image positions across and up at which views are compared, and how far views that count as the same differ,
# as a share of the image: a fifth of a pixel in an image of 2,000.
COMPARED = 33
SAME_VIEW = 1e-4


class FrustumEnd(NamedTuple):
    """An end of a frustum: a rectangle across the view. matrix: (4, 4), to camera space."""

    matrix: Array
    width: float
    height: float


def frustum(camera, scene) -> tuple[FrustumEnd, FrustumEnd]:
    """The near and the far end of a camera's frustum, at clip start and clip end.

    Lens, shift, sensor fit, and the scene's resolution and pixel aspect count. Raises UserError for a
    panoramic or custom camera, one without depth, and any other object: Blender accepts all types of objects
    as the scene's camera.
    """
    if camera.type != "CAMERA":
        lost = missing_text(camera.original)
        if lost:
            raise UserError(lost)
        raise UserError("'{0}' is not a camera: choose one in the Scene properties", camera.name)
    lens = camera.data
    if lens.type not in {"PERSP", "ORTHO"}:
        raise UserError(
            "'{0}' is neither a perspective nor an orthographic camera: change its lens type, "
            "or load a panorama from the presets",
            camera.name,
        )
    if lens.clip_start >= lens.clip_end:
        raise UserError("'{0}' ends where it starts: its clip end must exceed its clip start", camera.name)
    # Corners on one plane across the view: top right, bottom right, bottom left, top left.
    frame = np.array(lens.view_frame(scene=scene), np.float64)
    right_top, left_bottom = frame[0], frame[2]

    def end(depth: float) -> FrustumEnd:
        spread = depth / -frame[0, 2] if lens.type == "PERSP" else 1.0
        width, height = (right_top - left_bottom)[:2] * spread
        matrix = np.eye(4)
        matrix[:2, 3] = (right_top + left_bottom)[:2] / 2 * spread
        matrix[2, 3] = -depth
        return FrustumEnd(matrix, width, height)

    return end(lens.clip_start), end(lens.clip_end)


def frustum_projection(camera, depsgraph, aspect: float) -> Projection:
    """The projection of an ordinary, evaluated camera, in world space.

    aspect: width / height of the image, > 0. Raises UserError.
    """
    place = placement(camera)
    near, far = (
        Plane(matrix=place @ end.matrix, width=end.width, height=end.height)
        for end in frustum(camera, depsgraph.scene_eval)
    )
    return Projection(ViewingVolume((near, far)), aspect=aspect)


def is_own_frustum(projection: Projection, camera, depsgraph) -> bool:
    """Return whether a projection, world space, is what an evaluated camera sees as an ordinary one.

    Corners count as equal that are rounded to float32.
    """
    try:
        own = frustum_projection(camera, depsgraph, projection.aspect)
    except UserError:
        return False
    surfaces = projection.volume.surfaces
    if replace(projection, volume=own.volume, layers=()) != own or len(surfaces) != 2:
        return False
    if not all(isinstance(surface, Plane) for surface in surfaces):
        return False
    points, expected = (each.projectors(*CORNERS).points for each in (projection, own))
    size = np.abs(expected).max(axis=(1, 2), keepdims=True)
    return bool((np.abs(points - expected) <= ROUNDED * size).all())


def is_own_view(projection: Projection, camera, depsgraph) -> bool:
    """Return whether each pixel of a projection, world space, sees along an evaluated camera's own ray.

    The near and far surface may be anywhere along it. Layers of the image are ignored.
    """
    try:
        own = frustum_projection(camera, depsgraph, projection.aspect)
    except UserError:
        return False
    x, y = (a.ravel() for a in np.meshgrid(*(np.linspace(0.0, 1.0, COMPARED),) * 2))
    if not projection.parameters(x, y).mask.all():
        return False
    points = projection.projectors(x, y).points
    near, far = (own.volume.evaluate(x, y, np.full_like(x, t)).position for t in (0.0, 1.0))
    axis = -placement(camera)[:3, 2]
    along = np.einsum("kcn,c->kn", points - near, axis) / ((far - near) * axis[:, None]).sum(axis=0)
    # Of a curve whose control points are all on a line, every point is.
    off = np.linalg.norm(points - near - (far - near) * along[:, None], axis=1)
    # Opposite corners of the image.
    width, far_width = (np.linalg.norm(end[:, -1] - end[:, 0]) for end in (near, far))
    reach = np.abs(width + (far_width - width) * along)
    rounded = ROUNDED * np.abs(points).max(axis=(1, 2))[:, None]
    return bool((off <= SAME_VIEW * reach + rounded).all() and (along[-1] > along[0]).all())


def depth_plane(place: Array) -> Array:
    """(4,) (a, b, c, d): a·x + b·y + c·z + d is a point's distance from the camera along its axis.

    place: (4, 4), rigid, camera space to world space.
    """
    axis = -place[:3, 2]
    return np.array([*axis, -float(axis @ place[:3, 3])])


def placement(camera) -> Array:
    """Camera space to world space, (4, 4), without the camera's scale, which does not act on its view.

    Raises UserError.
    """
    matrix = np.array(camera.matrix_world, np.float64)
    sizes = np.linalg.norm(matrix[:3, :3], axis=0)
    if not (np.isfinite(matrix).all() and sizes.min() > 0):
        raise UserError(
            "'{0}' has no finite place or a scale of 0: clear it with Alt-G, Alt-R and Alt-S", camera.name
        )
    matrix[:3, :3] /= sizes
    return matrix
