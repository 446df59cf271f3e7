# SPDX-License-Identifier: GPL-3.0-or-later
"""A sheet before the camera that ends the rays of pixels that a picture with layers does not need.

Only camera rays meet it, and those of other pixels pass beside it: they see what they saw without it.
"""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import contextmanager

import bpy
import numpy as np

from ...bridge.blender.scene_objects import delete_with_data, object_by_uid
from ...projection.typing import Array, BoolArray

# The sheet is this share farther away than where the camera's rays begin, or as far as float32 tells its
# places apart by this share of a pixel. What is before it is rendered as ever.
BEHIND, PRECISE = 2.0**-8, 1.0 / 8.0
# Pixels that a ray of a needed one may pass besides the filter's, for the places of rays are rounded.
MARGIN = 1
# Fewer pixels are not worth a sheet.
FEWEST = 64
NAME = "SCFPF Covered"


def without_neighbours(is_needless: BoolArray, filter_width: float) -> BoolArray:
    """The mask (H, W) without pixels within the filter's radius of its border: the mask, eroded.

    Rays of pixels outside the mask do not come near the pixels that remain. filter_width: in pixels.
    """
    reach = MARGIN + int(np.ceil(filter_width / 2.0))
    kept = is_needless
    for axis in (0, 1):
        padded = np.pad(kept, [(reach, reach) if axis == each else (0, 0) for each in (0, 1)])
        windows = np.lib.stride_tricks.sliding_window_view(padded, 2 * reach + 1, axis)
        kept = windows.all(axis=-1)
    return kept


def runs(is_covered: BoolArray) -> tuple[Array, Array, Array]:
    """The runs of covered pixels in the rows of an image (H, W): their rows, first columns and ends."""
    steps = np.diff(np.pad(is_covered, [(0, 0), (1, 1)]).astype(np.int8), axis=1)
    row, first = np.nonzero(steps == 1)
    return row, first, np.nonzero(steps == -1)[1]


@contextmanager
def covered(scene, place: Array, is_covered: BoolArray) -> Iterator[None]:
    """Cover pixels of the whole image (H, W), row 0 at the bottom, of a scene's camera without a rig.

    place: (4, 4) of the camera, without scale.
    """
    plane = _plane(scene, place, is_covered.shape)
    if plane is None or np.count_nonzero(is_covered) < FEWEST:
        yield
        return
    made = None
    try:
        made = _add_sheet(scene, place, is_covered, *plane)
        yield
    finally:
        # Undo may have removed it.
        if made is not None and (sheet := object_by_uid(made)) is not None:
            delete_with_data(sheet)


def _plane(scene, place: Array, shape: tuple[int, int]) -> tuple[Array, Array, Array] | None:
    """The lower left corner of the sheet's plane in the camera's space, and the sides of the image, (3,).

    None if float32 does not tell the pixels (H, W) of an image apart there.
    """
    lens, eps = scene.camera.data, float(np.finfo(np.float32).eps)
    frame = np.array([corner[:] for corner in lens.view_frame(scene=scene)])
    depth = (1.0 + BEHIND) * lens.clip_start
    if lens.type == "PERSP":
        frame /= -frame[0, 2]
    right, corner, left = frame[1:4]
    pixel = min(np.linalg.norm(right - corner) / shape[1], np.linalg.norm(left - corner) / shape[0])
    off = eps * (np.abs(place[:3, 3]).max() + np.abs(frame).max())
    if lens.type == "PERSP":
        depth = max(depth, off / (pixel * PRECISE))
        frame *= depth
    elif lens.type != "ORTHO" or off > pixel * PRECISE:
        return None
    frame[:, 2] = -depth
    right, corner, left = frame[1:4]
    return corner, right - corner, left - corner


def _add_sheet(scene, place: Array, is_covered: BoolArray, corner: Array, across: Array, up: Array) -> int:
    """Add a rectangle for each run of pixels in a ``_plane``; returns the object's session id."""
    (row, first, end), (height, width) = runs(is_covered), is_covered.shape
    x, y = np.stack([first, end, end, first]) / width, np.stack([row, row, row + 1, row + 1]) / height
    points = corner + x.T[..., None] * across + y.T[..., None] * up
    mesh = bpy.data.meshes.new(NAME)
    faces = np.arange(4 * len(row)).reshape(-1, 4)
    mesh.from_pydata(points.reshape(-1, 3).tolist(), [], faces.tolist())
    sheet = bpy.data.objects.new(NAME, mesh)
    sheet.matrix_world = place.T.tolist()
    # A hole has no position and no light, whatever the view layer's material is.
    sheet.is_holdout = True
    for kind in ("diffuse", "glossy", "transmission", "volume_scatter", "shadow"):
        setattr(sheet, f"visible_{kind}", False)
    scene.collection.objects.link(sheet)
    return sheet.session_uid
