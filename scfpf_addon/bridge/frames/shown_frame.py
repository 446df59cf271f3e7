# SPDX-License-Identifier: GPL-3.0-or-later
"""Members of one of a camera's lists in a region, which are dragged by their frames or marks."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from ...projection.typing import Array
from ...shading.picking.frame_handles import BODY, REACH, HandledFrame


class ShownFrame(NamedTuple):
    """A member of a list in a region.

    index: its place in the list. origin: (2,), the pixel of its position. frame: None for a mark. label: its
    name, with what is wrong with it.
    """

    index: int
    origin: Array
    frame: HandledFrame | None
    is_active: bool
    label: str


def frame_at(frames: list[ShownFrame], x: float, y: float, scale: float) -> tuple[int, int] | None:
    """The index of the member at a pixel and the part of it; handles come before bodies.

    frames: the last one is in front. scale: of the display.
    """
    bodies = []
    for shown in reversed(frames):
        if shown.frame is None:
            is_near = np.hypot(x - shown.origin[0], y - shown.origin[1]) <= REACH * scale
            part = BODY if is_near else None
        else:
            part = shown.frame.part_at(x, y, scale)
        if part == BODY and shown.frame is not None:
            bodies.append((shown.index, BODY))
        elif part is not None:
            return shown.index, part
    return bodies[0] if bodies else None
