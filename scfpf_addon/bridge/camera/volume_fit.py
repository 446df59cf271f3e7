# SPDX-License-Identifier: GPL-3.0-or-later
"""Fit a volume around a selection, or to an image of another shape."""

from __future__ import annotations

import itertools
import math
from collections.abc import Callable
from dataclasses import replace

import numpy as np
from mathutils import Matrix, Vector

from ...projection.user_error import UserError
from ...projection.volume.inverse import invert
from ...projection.volume.reparameterisation import cropped_ranges
from ..blender.all_or_nothing import PLACE, keep
from .flexible_camera import editable_surfaces
from .read_projection import read_own_projection
from .shown_lens import approximate_lens
from .surface_scale import grow

# Search for the scale of a volume that just holds a selection. It starts at this share of the ratio of their
# sizes, doubles at most so often, and then bisects on a logarithmic scale.
FIRST_SHARE, MOST_DOUBLINGS, BISECTIONS = 0.125, 40, 10
# Room around the selection, as a factor of its size.
FIT_MARGIN = 1.05
# Images whose aspects differ by a smaller share have the same shape: a pixel in a thousand.
SAME_ASPECT = 1e-3


def move_volume(camera, matrix) -> None:
    """Apply an affine (4, 4) matrix in camera space to every surface.

    This changes the parent inverse: animation and modifiers act as before, and a shear is kept. Raises
    UserError for a surface that is not a child of the camera.
    """
    move = Matrix(np.asarray(matrix, np.float64).tolist())
    for surface in _children(camera):
        keep(surface, "matrix_parent_inverse")
        surface.matrix_parent_inverse = move @ surface.matrix_parent_inverse


def _children(camera) -> list:
    """The surfaces of a camera. Raises UserError if one is not its child."""
    surfaces = editable_surfaces(camera)
    for surface in surfaces:
        if surface.parent != camera or surface.parent_type != "OBJECT":
            raise UserError(
                "'{0}' is not a child of '{1}': parent it to the camera (Ctrl-P) first",
                surface.name,
                camera.name,
            )
    return surfaces


def needs_fit(camera, aspect: float) -> bool:
    """Return whether the camera's volume was made for an image of another shape. aspect: width / height."""
    settings = camera.scfpf
    return settings.fit != "NONE" and abs(aspect / settings.fitted_aspect - 1) > SAME_ASPECT


def fit_to_image(camera, depsgraph, aspect: float) -> None:
    """Stretch the volume along the image's width or height, or crop its ranges, to an image's aspect.

    Raises UserError; then nothing has changed.
    """
    settings = camera.scfpf
    if settings.fit == "NONE":
        raise UserError(
            "The volume of '{0}' does not depend on the picture's shape: choose Width, Height "
            "or Crop for Fit first",
            camera.name,
        )
    stretch = aspect / settings.fitted_aspect
    projection = read_own_projection(camera, depsgraph, aspect)
    if settings.fit == "CROP":
        ranges = cropped_ranges(projection.u_range, projection.v_range, stretch)
        settings.u_range, settings.v_range = ranges
        settings.fitted_aspect = aspect
        approximate_lens(camera, replace(projection, u_range=ranges[0], v_range=ranges[1]))
        return
    factors = (stretch, 1.0) if settings.fit == "WIDTH" else (1.0, 1 / stretch)
    matrix = np.diag([*factors, 1.0, 1.0])
    move_volume(camera, matrix)
    settings.fitted_aspect = aspect
    if settings.fit == "WIDTH" and camera.data.sensor_fit == "HORIZONTAL":
        approximate_lens(camera, projection.transformed(matrix))


def fit_volume(camera, depsgraph, aspect: float, corners) -> None:
    """Scale the volume and move the camera, without turning it, so that the volume encloses a box.

    corners: (8, 3), world space. The volume gets the smallest scale at which it holds all corners, its middle
    in the middle of the box. Parametric surfaces without animation change their sizes, others their parent
    inverse. The ordinary lens is set as well. Raises UserError.
    """
    surfaces = _children(camera)
    projection = read_own_projection(camera, depsgraph, aspect)
    volume = projection.volume
    world = np.array(camera.matrix_world, np.float64)
    centre = (corners.min(0) + corners.max(0)) / 2
    around = FIT_MARGIN * np.linalg.solve(world[:3, :3], (corners - centre).T)
    half = np.full(1, 0.5)
    middle = volume.evaluate(half, half, half).position
    ends = volume.evaluate(*np.array(list(itertools.product((0.0, 0.5, 1.0), repeat=3))).T).position

    def holds(scale: float) -> bool:
        return bool(invert(volume, around / scale + middle).found.all())

    size, reach = float(np.abs(ends - middle).max()), float(np.abs(around).max())
    if size == 0 or reach == 0:
        raise UserError("The volume or the selection has no size: there is nothing to fit")
    scale = _least_scale(holds, FIRST_SHARE * reach / size)
    if scale is None:
        raise UserError(
            "The volume of '{0}' holds nothing around its middle: it is flat or folded there", camera.name
        )
    sizes = np.diag([scale, scale, scale, 1.0])
    for surface in surfaces:
        if not grow(surface, scale):
            keep(surface, "matrix_parent_inverse")
            surface.matrix_parent_inverse = Matrix(sizes.tolist()) @ surface.matrix_parent_inverse
    keep(camera, *PLACE)
    place = camera.matrix_world.copy()
    place.translation = Vector(centre - world[:3, :3] @ (scale * middle[:, 0]))
    camera.matrix_world = place
    approximate_lens(camera, projection.transformed(sizes))


def _least_scale(holds: Callable[[float], bool], first: float) -> float | None:
    """The least scale for which ``holds`` is true, searched upwards from ``first``; None if not found."""
    scale = first
    for _ in range(MOST_DOUBLINGS):
        if holds(scale):
            break
        scale *= 2
    else:
        return None
    low, high = scale / 2, scale
    for _ in range(BISECTIONS):
        between = math.sqrt(low * high)
        low, high = (low, between) if holds(between) else (between, high)
    return high
