# SPDX-License-Identifier: GPL-3.0-or-later
"""A live image: the scene as the projectors of a window see it, painted."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np

from ...casting.common.cancellation import Signal
from ..typing import Single
from .cast_live import LiveProjection, LiveWindow, cast_live
from .live_hits import LiveHits
from .live_scene import LiveScene

# Colours (H, W, 4) of hits, display-encoded sRGB, premultiplied; the number is that of pixels of the screen
# across a pixel of the image.
Paint = Callable[[LiveHits, float], Single]


def live_image(
    scene: LiveScene,
    view: LiveProjection,
    window: LiveWindow,
    paint: Paint,
    step: float = 1.0,
    signal: Signal | None = None,
    threads: int = 0,
) -> Single:
    """Make the image of a window, (H, W, 4) float32 from the bottom, display-encoded and premultiplied.

    window: in pixels of the screen. step: the number of these across a pixel of the image. signal: raises
    Cancelled when it is set. threads: 0 for all cores. Raises CastError.
    """
    return paint(cast_live(scene, view, window.coarser(step), signal, threads), step)


def plain_paint(hits: LiveHits, step: float = 1.0) -> Single:
    """Grey, the lighter the more a surface faces the viewer; a dark grey where there is nothing."""
    facing = np.abs(np.einsum("cn,cn->n", hits.normal, hits.forward))
    pixels = np.empty((len(facing), 4), np.float32)
    pixels[:, :3] = np.where(hits.look >= 0, 0.15 + 0.7 * facing, 0.2)[:, None]
    pixels[:, 3] = hits.mask
    pixels[:, :3] *= pixels[:, 3:]
    return pixels.reshape(hits.height, hits.width, 4)
