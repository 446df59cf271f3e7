# SPDX-License-Identifier: GPL-3.0-or-later
"""Images of a viewport: a thread refines one until the next is requested."""

from __future__ import annotations

import threading
from typing import NamedTuple

from ...shading.frame import render_frame
from ...shading.typing import Single
from ..blender.user_errors import NO_THREAD, failure_message
from .coarse_image import coarse_inputs
from .render_inputs import RenderInputs
from .scene_preparation import SceneCache


class Rectangle(NamedTuple):
    """A rectangle in a viewport, in pixels of its region: left bottom corner and size."""

    left: float
    bottom: float
    width: float
    height: float


class Painting(NamedTuple):
    """An image and where it is drawn. pixels: (H, W, 4) as in Frame. is_final: whether it gets no finer."""

    pixels: Single
    rectangle: Rectangle
    is_final: bool


class Commission(NamedTuple):
    """A request for an image. The border of the inputs is drawn in the rectangle."""

    inputs: RenderInputs
    rectangle: Rectangle


class ViewPainter:
    """Paints the latest commission. Only the caller's thread may call its methods."""

    def __init__(self) -> None:
        self._lock = threading.Lock()
        self._wanted: Commission | None = None
        self._thread: threading.Thread | None = None
        self._stopped = False
        self._cache: SceneCache | None = None
        # The newest painting, or the message of an error instead; the number changes with each.
        self.painting: Painting | None = None
        self.message = ""
        self.number = 0

    @property
    def busy(self) -> bool:
        """Return whether the thread is at work."""
        with self._lock:
            return self._thread is not None

    def ask(self, commission: Commission) -> None:
        """Paint this, and drop earlier commissions; return at once."""
        with self._lock:
            self._wanted = commission
            if self._thread is None and not self._stopped:
                thread = threading.Thread(target=self._run, name="SCFPF viewport")
                try:
                    thread.start()
                except RuntimeError:
                    self._wanted = None
                    self._show(None, NO_THREAD)
                else:
                    self._thread = thread

    def stop(self) -> None:
        """Cancel for ever and wait for the thread."""
        with self._lock:
            self._stopped, thread = True, self._thread
        if thread is not None:
            thread.join()

    def _run(self) -> None:
        while True:
            with self._lock:
                commission, self._wanted = self._wanted, None
                if commission is None or self._stopped:
                    self._thread = None
                    return
            try:
                self._paint(commission)
            except Exception as error:  # A thread has nowhere to raise.
                self._show(None, failure_message(error))

    def _is_cancelled(self) -> bool:
        return self._stopped or self._wanted is not None

    def _show(self, painting: Painting | None, message: str = "") -> None:
        self.painting, self.message = painting, message
        self.number += 1

    def _paint(self, commission: Commission) -> None:
        inputs = commission.inputs
        self._cache = SceneCache.of(inputs.scene.geometry, self._cache)
        for step in (*coarse_inputs(inputs), inputs):
            frame = render_frame(
                step.projection,
                step.scene,
                step.settings,
                self._cache.cast_scene,
                cancelled=self._is_cancelled,
            )
            if frame is None:
                return
            self._show(Painting(frame.pixels, commission.rectangle, step is inputs))
