# SPDX-License-Identifier: GPL-3.0-or-later
"""The lens, clip range and frame that Blender shows of a flexible camera; renders do not use them."""

from __future__ import annotations

import math

import numpy as np

from ...projection.volume.viewing_volume import Projection

# Limits of the lens's angle, radians: a smaller turn makes it orthographic, a larger one is clamped.
NARROWEST_LENS, WIDEST_LENS = math.radians(1), math.radians(150)
# Positions along each side of the image at which the volume is measured.
MEASURES = 17
# Blender units. An orthographic camera of width 0 would show nothing.
SMALLEST_ORTHO = 1e-6
# The least clip start as a share of the clip end, for the precision of a depth buffer.
SMALLEST_CLIP_SHARE = 1e-4
# The largest size of the camera's frame as a share of the clip end, which is about the volume's depth.
FRAME_SHARE = 1 / 64


def approximate_lens(camera, projection: Projection) -> None:
    """Set the lens and clip range so that they approximate a projection in camera space.

    The angle of the lens is the turn of the projectors from the left border to the right one at mid height,
    clamped. If the projectors do not spread, the lens is orthographic. Camera data that another object shares
    is copied first.
    """
    if not _is_own(camera.data):
        camera.data = camera.data.copy()
    lens = camera.data
    lens.sensor_fit = "HORIZONTAL"
    lens.shift_x = lens.shift_y = 0.0
    turn, width = _spread(projection)
    if turn < NARROWEST_LENS:
        lens.type = "ORTHO"
        lens.ortho_scale = max(width, SMALLEST_ORTHO)
    else:
        lens.type = "PERSP"
        lens.angle_x = min(turn, WIDEST_LENS)
    line = np.linspace(0.0, 1.0, MEASURES)
    x, y, t = (axis.ravel() for axis in np.meshgrid(line, line, line))
    image = projection.parameters(x, y)
    distance = np.linalg.norm(projection.volume.evaluate(image.u, image.v, t).position, axis=0)
    lens.clip_end = distance.max()
    lens.clip_start = max(distance.min(), lens.clip_end * SMALLEST_CLIP_SHARE)
    size_frame(camera)


def _spread(projection: Projection) -> tuple[float, float]:
    """The turn, radians, and the mean width of the volume across the middle of the image."""
    line = np.linspace(0.0, 1.0, MEASURES)
    middle = projection.parameters(line, np.full(MEASURES, 0.5))
    near, far = (
        projection.volume.evaluate(middle.u, middle.v, np.full(MEASURES, t)).position for t in (0.0, 1.0)
    )
    x, z = (far - near)[[0, 2]]
    # The sum of small turns does not wrap at half a circle, as the angle between the borders would.
    steps = np.arctan2(x[:-1] * z[1:] - x[1:] * z[:-1], x[1:] * x[:-1] + z[1:] * z[:-1])
    # Outside of a round image the projectors are arbitrary.
    turn = steps[middle.mask[1:] & middle.mask[:-1]].sum()
    width = sum(np.linalg.norm(end[:, -1] - end[:, 0]) for end in (near, far)) / 2
    return turn, width


def _is_own(lens) -> bool:
    """Return whether camera data can be changed without a change to another object."""
    return lens.is_editable and lens.users - lens.use_fake_user <= 1


def size_frame(camera) -> None:
    """Make a camera's frame small while it is flexible, as a handle to click on; else restore its size.

    This keeps a size that the artist has set in between, and camera data that another object shares or that
    cannot be edited.
    """
    settings, lens = camera.scfpf, camera.data
    before, given = settings.frame_sizes
    is_own = _is_own(lens)
    is_changed = given > 0.0 and lens.display_size != given
    if settings.enabled and is_own and not is_changed:
        before = before if given > 0.0 else lens.display_size
        lens.display_size = min(before, FRAME_SHARE * lens.clip_end)
        settings.frame_sizes = before, lens.display_size
    elif not settings.enabled and given > 0.0:
        if is_own and not is_changed:
            lens.display_size = before
        settings.frame_sizes = 0.0, 0.0
