# SPDX-License-Identifier: GPL-3.0-or-later
"""The targets of Aim over the camera's image: the frames of views, the marks of pins, and straight lines."""

from __future__ import annotations

import numpy as np

from ...projection.typing import Array
from ...shading.picking.frame_handles import HandledFrame
from ..blender.user_errors import USER_ERRORS
from ..frames.shown_frame import ShownFrame
from ..frames.shown_image import ShownImage
from ..render.image_size import image_aspect
from ..settings.aim_properties import LINE, PIN, VIEW
from .target_views import target_objects, thing_box, view_map

# A residual above so many pixels is told in the label.
WELL_MET = 1.5


def shown_targets(context, image: ShownImage) -> list[ShownFrame]:
    """The views and pins of the image's camera that are switched on, the active one last.

    A view that shows nothing has no frame, but the mark of a pin; its message says why.
    """
    settings = image.camera.scfpf
    depsgraph = context.evaluated_depsgraph_get()
    found = []
    for index, target in enumerate(settings.aim_targets):
        if not target.is_on or target.kind not in (VIEW, PIN):
            continue
        origin = image.pixels(np.array(target.position, np.float64)[:, None])[:, 0]
        frame = _frame(target, image, origin, depsgraph) if target.kind == VIEW else None
        found.append(ShownFrame(index, origin, frame, index == settings.active_aim, label_of(target)))
    found.sort(key=lambda shown: shown.is_active)
    return found


def label_of(target) -> str:
    """The name of a target, with what is wrong with it."""
    if target.hidden > 0.0 and target.hidden_by:
        return f"{target.name}: hidden by {target.hidden_by}"
    if target.residual_max > WELL_MET:
        return f"{target.name}: {target.residual_max:.1f} px off"
    return target.name


def _frame(target, image: ShownImage, origin: Array, depsgraph) -> HandledFrame | None:
    """The frame around a view's thing in a region; None if the view shows nothing."""
    try:
        corners = box_corners(*thing_box(target_objects(target), depsgraph))
        aspect = image_aspect(depsgraph.scene)
        positions = view_map(target, depsgraph, aspect).positions(corners)
    except USER_ERRORS:
        return None
    seen = image.pixels(positions[:, np.isfinite(positions).all(axis=0)])
    return HandledFrame.around(seen, origin, target.turn) if seen.size else None


def box_corners(low: Array, high: Array) -> Array:
    """The corners of a box, (3, 8)."""
    return np.array(np.meshgrid(*np.stack([low, high], axis=1), indexing="ij")).reshape(3, 8)


def straight_lines(settings, image: ShownImage) -> list[tuple[Array, Array]]:
    """The pixels of both ends of each line that has to stay straight."""
    pins = {t.handle: t.position for t in settings.aim_targets if t.kind == PIN and t.handle is not None}
    lines = []
    for target in settings.aim_targets:
        if target.kind == LINE and target.is_on and target.first in pins and target.second in pins:
            ends = np.array([pins[target.first], pins[target.second]], np.float64).T
            lines.append(tuple(image.pixels(ends).T))
    return lines
