# SPDX-License-Identifier: GPL-3.0-or-later
"""Delivery of finished tiles to Blender's render result, and the progress in the header."""

from __future__ import annotations

from dataclasses import fields
from time import perf_counter

import numpy as np

from ...casting.common.cancellation import is_uncancellable
from ...casting.common.geometry import Geometry
from ...shading.typing import Single
from .render_inputs import RenderInputs
from .render_passes import crypto_names, list_render_passes, stamp_depths, stamp_manifests
from .scene_preparation import BUILDING

# Seconds between two updates of the result and of the header.
TICK = 0.25
MEBIBYTE = 2**20
# Largest size of finished tiles that wait for an update. Delivering costs time, because Blender touches the
# result's memory for the first time; it is better spent while other tiles are being made.
MOST_WAITING = 4 * MEBIBYTE
# A size beyond every image: Blender clips a result to the render region.
WHOLE = 2**20


class Delivery:
    """Delivers the tiles of one view of a view layer to Blender. Only the rendering thread uses it."""

    def __init__(self, engine, view_layer, view: str = "", part: tuple[int, int] = (0, 1)) -> None:
        """Announce the passes of the view layer.

        view: Blender's name of the view. part: its number from 0, and how many views there are.
        """
        self._engine = engine
        self._view_layer = view_layer
        self.layer = view_layer.name
        self.view = view
        self._part = part
        self._passes = list(list_render_passes(view_layer))
        self._waiting: list[tuple[slice, Single, dict[str, Single]]] = []
        self._bytes = 0
        self._has_delivered = False
        self._started = self._updated = perf_counter()
        for each in self._passes:
            if each.source:
                engine.add_pass(each.name, len(each.channels), each.channels, layer=self.layer)

    @property
    def sources(self) -> tuple[str, ...]:
        """The names of the data passes, as in ``shading.passes``."""
        return tuple(each.source for each in self._passes if each.source)

    def begin(self, inputs: RenderInputs) -> None:
        """Report the memory of an image's arrays, and start the clock of its progress."""
        region = inputs.settings.region
        scenes = {id(each.scene): each.scene for each in inputs.moments} | {id(inputs.scene): inputs.scene}
        channels = sum(len(each.channels) for each in self._passes)
        arrays = sum(geometry_bytes(scene.geometry) for scene in scenes.values())
        pixels = (region.right - region.left) * (region.top - region.bottom)
        memory = (arrays + 4 * channels * pixels) / MEBIBYTE
        self._engine.update_memory_stats(memory_used=memory, memory_peak=memory)
        stamp_manifests(self._engine.get_result(), self._view_layer, crypto_names(inputs.scene))
        stamp_depths(self._engine.get_result(), self._view_layer, inputs)
        self._started = perf_counter()

    def add(self, rows: slice, pixels: Single, passes: dict[str, Single]) -> None:
        """Take a finished tile of ``render_frame``, whose arrays must not change until delivered."""
        self._waiting.append((rows, pixels, passes))
        self._bytes += pixels.nbytes + sum(values.nbytes for values in passes.values())
        if self._bytes > MOST_WAITING:
            self.flush()

    def progress(self, share: float) -> None:
        """Note the share that is done, and show it every TICK."""
        now = perf_counter()
        if now - self._updated < TICK:
            return
        self._updated = now
        number, count = self._part
        self._engine.update_progress((number + share) / count)
        text = f"Rendering {share:.0%}" if count == 1 else f"Rendering {self.view} {share:.0%}"
        if share > 0.0:
            left = (now - self._started) * (1.0 - share) / share
            text = f"Remaining {int(left // 60):02d}:{int(left % 60):02d} | {text}"
        # With motion blur the threads build the scene of each shutter time at its first use.
        self._engine.update_stats("", BUILDING if is_uncancellable() else text)
        self.flush()

    def flush(self) -> None:
        """Deliver the tiles that wait."""
        waiting, self._waiting, self._bytes = self._waiting, [], 0
        for rows, pixels, passes in waiting:
            self._deliver(rows.start, {"": pixels, **passes})

    def show(self, pixels: Single) -> None:
        """Deliver a preliminary image (H, W, 4)."""
        self._deliver(0, {"": pixels})

    def _deliver(self, bottom: int, made: dict[str, Single]) -> None:
        """Deliver rows from ``bottom`` up. made: by source of the pass, each (rows, W, channels)."""
        height, width = made[""].shape[:2]
        result = self._engine.begin_result(0, bottom, width, height, layer=self.layer, view=self.view)
        try:
            target = result.layers[0].passes
            for each in self._passes:
                if each.source in made:
                    # Blender takes flat arrays only.
                    values = np.ravel(made[each.source])
                    target.find_by_name(each.name, self.view).rect.foreach_set(values)
        finally:
            self._engine.end_result(result)
            self._has_delivered = True

    def close(self) -> None:
        """Deliver the remaining tiles, or an empty image if there were none."""
        try:
            self.flush()
        finally:
            if not self._has_delivered:
                result = self._engine.begin_result(0, 0, WHOLE, WHOLE, layer=self.layer, view=self.view)
                self._engine.end_result(result)


def geometry_bytes(geometry: Geometry) -> int:
    """The memory of a scene's triangles as arrays, in bytes."""
    values = (getattr(geometry, each.name) for each in fields(geometry))
    return sum(value.nbytes for value in values if isinstance(value, np.ndarray))
