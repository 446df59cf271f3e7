# SPDX-License-Identifier: GPL-3.0-or-later
"""The depth of field of a camera, for volumes in which it is defined."""

from __future__ import annotations

import numpy as np

from ...projection.user_error import Message
from ...projection.volume.viewing_volume import Projection
from ...shading.scene.depth_of_field import Aperture, DepthOfField, lens_of
from .stereo_views import Eye, eye_place

# Cycles raises smaller f-numbers to this one.
SMALLEST_F_STOP = 1e-5
# The least focus distance, Blender units.
NEAREST_FOCUS = 1e-5
MILLIMETRE = 1e-3

NOT_DEFINED = Message(
    "Depth of field is not defined for the volume of '{0}', whose projectors are bent or do not come from "
    "one point: all is sharp. Switch it off in the camera's properties, or use a perspective volume"
)


def read_lens(camera, projection: Projection, depsgraph, eye: Eye = "") -> tuple[DepthOfField | None, str]:
    """The depth of field of an evaluated camera, or None, and a warning if the volume has none.

    projection: of the eye. The radius of the aperture is that of Cycles: focal length / twice the f-number.
    """
    settings = camera.data.dof
    if not settings.use_dof:
        return None, ""
    axes = eye_place(camera, eye)[:3, :3]
    axes[:, 2] *= -1.0
    radius = camera.data.lens * MILLIMETRE / (2.0 * max(settings.aperture_fstop, SMALLEST_F_STOP))
    aperture = Aperture(
        radius,
        max(settings.focus_distance, NEAREST_FOCUS),
        settings.aperture_blades,
        settings.aperture_rotation,
        settings.aperture_ratio,
    )
    lens = lens_of(projection, aperture, axes)
    if lens is None:
        return None, Message(NOT_DEFINED, camera.name)
    target = settings.focus_object
    if target is not None:
        place = np.array(target.evaluated_get(depsgraph).matrix_world.translation, np.float64)
        away = place - lens.centre
        distance = abs(float(axes[:, 2] @ away)) if lens.flat else float(np.linalg.norm(away))
        lens = lens.focused(max(distance, NEAREST_FOCUS))
    return lens, ""
