# SPDX-License-Identifier: GPL-3.0-or-later
"""Flexible cameras with a measured lens: a volume around what the lens sees, and the lens as a mapping.

All numbers of the volume are exact in float32, and the mapping keeps those of the lens with all digits, so
that a pixel sees along the very ray of the calibration.
"""

from __future__ import annotations

import math

import numpy as np

from ...projection.calibration.calibration import round_net
from ...projection.mappings.calibrated import CalibratedLens
from ...projection.mappings.kinds import ImageMapping
from ..mappings.mapping_edits import write_mappings
from ..mappings.st_map_image import write_st_map
from .flexible_camera import NewSurface, make_flexible, replace_surfaces
from .read_projection import read_projection, world_to_camera
from .shown_lens import approximate_lens

# The far surface is beyond the farthest point by this factor at least; the near one is this share of it away.
FAR_MARGIN, NEAR_SHARE = 1.25, 2.0**-12
# Focal lengths across and up that differ by less than this share are those of square pixels.
SQUARE = 0.01
MAPPING_NAME = "Calibrated Lens"


def volume_from_lens(camera, lens: CalibratedLens, reach: float, depsgraph_of) -> None:
    """Replace a camera's volume by what a framed lens sees, up to a distance and beyond it.

    reach: Blender units, above 0. depsgraph_of: a function that returns the updated depsgraph.
    """
    far = 2.0 ** math.ceil(math.log2(FAR_MARGIN * reach))
    replace_surfaces(camera, [_end(lens, *end) for end in (("Near", far * NEAR_SHARE), ("Far", far))])
    settings = camera.scfpf
    settings.basis, settings.reparameterisation, settings.fit = "BEZIER", "RECTANGLE", "NONE"
    settings.u_range = settings.v_range = (0.0, 1.0)
    write_mappings(camera, [ImageMapping(MAPPING_NAME, "CALIBRATION", lens=lens)])
    make_flexible(camera)
    if lens.is_round:
        projection = read_projection(camera, depsgraph_of(), lens.size[0] / lens.size[1])
        approximate_lens(camera, projection.transformed(world_to_camera(camera)))
    else:
        _show_frame(camera.data, lens)
        camera.data.clip_start, camera.data.clip_end = far * NEAR_SHARE, far


def _end(lens: CalibratedLens, name: str, distance: float) -> NewSurface:
    """The surface across the frame at a distance that is a power of two."""
    if lens.is_round:
        orders = {"order_u": 3, "order_v": 3}
        return NewSurface(name, "NURBS", np.eye(4), orders, round_net(lens, distance))
    across, up, width, height = (number * distance for number in lens.frame)
    matrix = np.eye(4)
    matrix[:3, 3] = across, up, -distance
    return NewSurface(name, "PLANE", matrix, {"width": width, "height": height})


def _show_frame(data, lens: CalibratedLens) -> None:
    """Give an ordinary camera the view of a flat frame: it shows the undistorted picture with overscan."""
    across, up, width, _height = lens.frame
    data.type, data.sensor_fit = "PERSP", "HORIZONTAL"
    data.angle_x = 2 * math.atan(width / 2)
    data.shift_x, data.shift_y = across / width, up / width


def set_image_size(render, lens: CalibratedLens) -> None:
    """Set a scene's resolution to a lens's image, and its pixel aspect if the pixels are far from square."""
    render.resolution_x, render.resolution_y = (round(side) for side in lens.size)
    render.resolution_percentage = 100
    ratio = lens.matrix[3] / lens.matrix[0]
    is_square = abs(ratio - 1) < SQUARE
    render.pixel_aspect_x = 1.0 if is_square else max(ratio, 1.0)
    render.pixel_aspect_y = 1.0 if is_square else max(1 / ratio, 1.0)


def frame_size(lens: CalibratedLens, overscan: float) -> tuple[int, int]:
    """Width and height in pixels of the frame's picture that has the lens's own scale in its middle."""
    if lens.is_round:
        # On the axis the angle is twice the frame's coordinate.
        side = max(round(2 * lens.matrix[0] * lens.frame[2]), 1)
        return side, side
    width, height = (max(round(side * overscan), 1) for side in lens.size)
    return width, height


def write_lens_maps(camera, lens: CalibratedLens, depsgraph, overscan: float, distorting: bool) -> str:
    """Write the ST map that undistorts the lens's picture, and that which distorts an undistorted one.

    Returns a message if the file cannot store the images, else "".
    """
    projection = read_projection(camera, depsgraph, lens.size[0] / lens.size[1])
    size = round(lens.size[0]), round(lens.size[1])
    image, warning = write_st_map(projection, frame_size(lens, overscan), "MAPPINGS", True)
    image.name = f"{camera.name} Undistort"
    if distorting:
        image, more = write_st_map(projection, size, "MAPPINGS", False)
        image.name = f"{camera.name} Distort"
        warning = warning or more
    return warning
