# SPDX-License-Identifier: GPL-3.0-or-later
"""A picture that is made in a thread and refined, and that gives way to the next one asked for."""

from __future__ import annotations

import threading
import traceback
from dataclasses import dataclass, replace
from typing import NamedTuple

from ...shading.frame import render_frame
from ...shading.settings.frame_settings import Border
from ...shading.typing import Single
from .render_job import NO_THREAD, RENDER_ERRORS, RenderInputs, reason
from .scene_cache import SceneCache

# The first picture has squares of this many pixels, the next ones are finer.
COARSE_STEPS = (8, 2)
# Pixel error of all but the last picture, if the last one's is smaller.
COARSE_ERROR = 1.0


class Painting(NamedTuple):
    """pixels: (H, W, 4) as in Frame. place: (left, bottom, right, top) in the region, pixels.
    is_final: whether it gets no finer.
    """

    pixels: Single
    place: tuple[float, float, float, float]
    is_final: bool


@dataclass(frozen=True)
class Commission:
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
        self._kept: SceneCache | None = None
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
            except RENDER_ERRORS as error:
                self._show(None, reason(error))
            except Exception as error:  # A thread has nowhere to raise.
                traceback.print_exc()
                self._show(
                    None, f"SCFPF failed: look at the system console for the place ({type(error).__name__})"
                )

    def _given_up(self) -> bool:
        return self._stopped or self._wanted is not None

    def _show(self, painting: Painting | None, message: str = "") -> None:
        self.painting, self.message = painting, message
        self.number += 1

    def _paint(self, commission: Commission) -> None:
        inputs = commission.inputs
        self._kept = SceneCache.of(inputs.scene.geometry, self._kept)
        for step in (*coarser(inputs), inputs):
            frame = render_frame(
                step.projection, step.scene, step.settings, self._kept.cast_scene, cancelled=self._given_up
            )
            if frame is None:
                return
            self._show(Painting(frame.pixels, commission.place, step is inputs))


def coarser(inputs: RenderInputs):
    """Inputs of the same picture with fewer pixels and one sample a pixel."""
    whole = inputs.settings
    for step in COARSE_STEPS:
        width, height = max(whole.width // step, 1), max(whole.height // step, 1)
        region = whole.region
        # Shown stretched to the same place, which it covers but for a part of a coarse pixel.
        left, right = (round(x * width / whole.width) for x in (region.left, region.right))
        bottom, top = (round(y * height / whole.height) for y in (region.bottom, region.top))
        left, bottom = min(left, width - 1), min(bottom, height - 1)
        border = Border(left, bottom, max(right, left + 1), max(top, bottom + 1))
        yield replace(
            inputs,
            settings=replace(
                whole,
                width=width,
                height=height,
                samples=1,
                pixel_error=max(whole.pixel_error, COARSE_ERROR),
                border=border,
                scrambled=False,
                adaptive=None,
                depth_of_field=None,
                stylised=whole.stylised and replace(whole.stylised.scaled(1 / step), detail=1),
            ),
        )
