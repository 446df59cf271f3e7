# SPDX-License-Identifier: GPL-3.0-or-later
"""Live images of one viewport: a thread makes a coarse one at once, and finer ones while nothing changes."""

from __future__ import annotations

from time import perf_counter
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from ...casting.common.parallel import thread_count
from ...projection.diagrams.diagram import volume_signature
from ...projection.volume.viewing_volume import Projection
from ...shading.live.cast_live import LiveProjection, LiveWindow, Paint, cast_live
from ...shading.live.live_hits import LiveHits
from ...shading.typing import Single
from ..render.view_painter import Rectangle
from ..tasks.painter import Painter
from .kept_scene import KeptScene
from .live_objects import Placements

# Pixels of the viewport across a pixel of the first image, by the time that there is.
STEPS = (1.0, 1.5, 2.0, 3.0, 4.0, 6.0)
# Seconds that the first image should take at most.
FIRST_SECONDS = 0.05
# The share of a gain in speed that is believed at once.
GAIN = 0.3
# A final image that should take no longer than so many seconds follows the first one at once.
FINAL_SECONDS = 0.4
# Seconds without a change after which finer images are begun; sooner, they would slow down a drag. Those of a
# slow window's drawing count besides, at most LONGEST_DRAWING.
IDLE_SECONDS, LONGEST_DRAWING = 0.1, 1.0
# Seconds without a change after which moved objects are built together with the others.
SETTLE_SECONDS = 1.5

# The step of an image that is made for nobody to see.
SMALL = 50.0


class Request(NamedTuple):
    """A request for images: everything is an array, a number or a function of these.

    window: in pixels of the viewport. rectangle: where it is drawn. paint_key: differs whenever ``paint``
    paints differently. members: see ``LiveProjection``. number: of the request, counted by who asks.
    """

    kept: KeptScene
    placements: Placements
    projection: Projection
    window: LiveWindow
    rectangle: Rectangle
    paint: Paint
    paint_key: bytes
    members: NDArray[np.uint8] | None = None
    number: int = 0


class LiveImage(NamedTuple):
    """An image and where it is drawn. pixels: (H, W, 4). step: viewport pixels across one of its pixels.

    number: of the request that it answers.
    """

    pixels: Single
    rectangle: Rectangle
    step: float
    number: int = 0


class _Seen(NamedTuple):
    """Hits that are kept for the next painting, with the key of the scene, volume and window they are of."""

    key: tuple
    hits: LiveHits
    step: float


def _bytes(members: NDArray[np.uint8] | None) -> bytes:
    return b"" if members is None else members.tobytes()


class LivePainter(Painter[Request, LiveImage]):
    """Paints the latest request: a coarse image at once, and finer ones while no other request comes."""

    def __init__(self) -> None:
        super().__init__("SCFPF live view")
        self._seen: _Seen | None = None
        self._seconds_per_pixel = 0.0
        # Seconds that a drawing of the viewport's window takes.
        self.drawing = 0.0

    def stop(self) -> None:
        """Cancel for ever, wait for the thread, and drop its arrays."""
        super().stop()
        self._seen = None

    def _paint(self, request: Request) -> None:
        scene = request.kept.updated(request.placements)
        key = (scene, volume_signature(request.projection, _bytes(request.members)), request.window)
        seen = self._seen
        if seen is not None and seen.key[0] is scene and seen.key[1:] == key[1:]:
            view, hits, step = None, seen.hits, seen.step
            self._show(_image(request, hits, step))
        else:
            view, step = (
                LiveProjection.of(request.projection, request.members),
                self._first_step(request.window),
            )
            begun = perf_counter()
            # Nothing cancels a first image: a drag would show none if it were asked for too often.
            hits = cast_live(scene, view, request.window.coarser(step))
            self._show(_image(request, hits, step))
            self._note_speed((perf_counter() - begun) / (hits.width * hits.height))
            self._seen = _Seen(key, hits, step)
        if step > 1.0 and not self._is_idle(IDLE_SECONDS + min(self.drawing, LONGEST_DRAWING)):
            return
        while step > 1.0:
            step = self._finer_step(request.window, step)
            view = view or LiveProjection.of(request.projection, request.members)
            hits = cast_live(scene, view, request.window.coarser(step), self)
            if self.is_set():
                return
            self._show(_image(request, hits, step))
            self._seen = _Seen(key, hits, step)
        if step <= 1.0 and self._is_idle(SETTLE_SECONDS) and request.kept.settle():
            # The same image, of a scene built anew; a small one makes what is made at first use.
            scene = request.kept.updated(request.placements)
            view = view or LiveProjection.of(request.projection, request.members)
            cast_live(scene, view, request.window.coarser(SMALL), self)
            self._seen = _Seen((scene, *key[1:]), hits, step)

    def _note_speed(self, seconds: float) -> None:
        """Note the seconds that a pixel took. A gain counts in part, lest the size of pixels flickers."""
        known = self._seconds_per_pixel
        is_slower = known == 0.0 or seconds > known
        self._seconds_per_pixel = seconds if is_slower else known + GAIN * (seconds - known)

    def _first_step(self, window: LiveWindow) -> float:
        """The finest step whose image takes no longer than it should, by the last first image."""
        if self._seconds_per_pixel == 0.0:
            return STEPS[-1]
        pixels = window.width * window.height
        return next((s for s in STEPS if pixels / s**2 * self._seconds_per_pixel <= FIRST_SECONDS), STEPS[-1])

    def _finer_step(self, window: LiveWindow, step: float) -> float:
        """The step of the image after one with this step."""
        pixels = window.width * window.height
        is_quick = self._seconds_per_pixel * pixels <= FINAL_SECONDS * thread_count()
        return STEPS[0] if is_quick or step <= STEPS[3] else STEPS[3]

    def _is_idle(self, seconds: float) -> bool:
        """Wait so long; return whether no other request came."""
        with self._wake:
            return not self._wake.wait_for(self.is_set, seconds)


def _image(request: Request, hits: LiveHits, step: float) -> LiveImage:
    return LiveImage(request.paint(hits, step), request.rectangle, step, request.number)
