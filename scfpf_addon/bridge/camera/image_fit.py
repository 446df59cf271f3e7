# SPDX-License-Identifier: GPL-3.0-or-later
"""A volume made for one shape of picture, stretched for another: what a changed resolution needs."""

from __future__ import annotations

import numpy as np

from .flexible_camera import FlexibleCameraError, approximate_lens
from .read_projection import read_projection
from .volume_edits import move_volume

# Two pictures whose aspects differ by less have the same shape: a pixel more or less in a thousand.
SAME_ASPECT = 1e-3


def needs_fit(camera, aspect: float) -> bool:
    """Whether the camera's volume was made for a picture of another shape. aspect: width / height."""
    settings = camera.scfpf
    return settings.fit != "NONE" and abs(aspect / settings.fitted_aspect - 1) > SAME_ASPECT


def fit_to_picture(camera, depsgraph, aspect: float) -> None:
    """Stretch the volume along the picture's width or height, so that nothing looks stretched.

    It goes into the surfaces' parent inverse, so that their edits and animation stay. Raises
    FlexibleCameraError or ProjectionError; then nothing has changed.
    """
    settings = camera.scfpf
    if settings.fit == "NONE":
        raise FlexibleCameraError(
            f"The volume of '{camera.name}' does not depend on the picture's shape: choose Width or "
            f"Height for Fit first"
        )
    stretch = aspect / settings.fitted_aspect
    factors = (stretch, 1.0) if settings.fit == "WIDTH" else (1.0, 1 / stretch)
    matrix = np.diag([*factors, 1.0, 1.0])
    world = np.array(camera.evaluated_get(depsgraph).matrix_world, np.float64)
    projection = read_projection(camera, depsgraph, aspect).transformed(np.linalg.inv(world))
    move_volume(camera, matrix)
    settings.fitted_aspect = aspect
    if settings.fit == "WIDTH" and camera.data.sensor_fit == "HORIZONTAL":
        approximate_lens(camera, projection.transformed(matrix))
