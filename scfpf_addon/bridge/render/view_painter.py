# SPDX-License-Identifier: GPL-3.0-or-later
"""A picture that is made in a thread and refined, and that gives way to the next one asked for."""

from __future__ import annotations

import threading
from typing import NamedTuple

from ...shading.frame import render_frame
from ...shading.typing import Single
from .coarse_image import coarse_inputs
from .render_errors import NO_THREAD, failure_message
from .render_inputs import RenderInputs
from .scene_preparation import SceneCache


class Painting(NamedTuple):
    """pixels: (H, W, 4) as in Frame. place: (left, bottom, right, top) in the region, pixels.
    is_final: whether it gets no finer.
    """

    pixels: Single
    place: tuple[float, float, float, float]
    is_final: bool


class Commission(NamedTuple):
    """What to paint: inputs, whose border is shown at ``place`` of the region."""

    inputs: RenderInputs
    place: tuple[float, float, float, float]


class ViewPainter:
    """Paints what was asked for last. All methods belong to one thread, the caller's."""

    def __init__(self) -> None:
        self._lock = threading.Lock()
        self._wanted: Commission | None = None
        self._thread: threading.Thread | None = None
        self._stopped = False
        self._cache: SceneCache | None = None
        # The newest painting, and what went wrong instead; the number tells one from the next.
        self.painting: Painting | None = None
        self.message = ""
        self.number = 0

    @property
    def busy(self) -> bool:
        """Whether there is more to come."""
        with self._lock:
            return self._thread is not None

    def ask(self, commission: Commission) -> None:
        """Paint this, and nothing of what was asked for before; returns at once."""
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
        """Give up for good and wait for the thread."""
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

    def _given_up(self) -> bool:
        return self._stopped or self._wanted is not None

    def _show(self, painting: Painting | None, message: str = "") -> None:
        self.painting, self.message = painting, message
        self.number += 1

    def _paint(self, commission: Commission) -> None:
        inputs = commission.inputs
        self._cache = SceneCache.of(inputs.scene.geometry, self._cache)
        for step in (*coarse_inputs(inputs), inputs):
            frame = render_frame(
                step.projection, step.scene, step.settings, self._cache.cast_scene, cancelled=self._given_up
            )
            if frame is None:
                return
            self._show(Painting(frame.pixels, commission.place, step is inputs))
