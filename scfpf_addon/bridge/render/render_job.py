# SPDX-License-Identifier: GPL-3.0-or-later
"""A render in a thread of its own, and the one job that may run at a time."""

from __future__ import annotations

import threading

import numpy as np

from ...casting.common.cancellation import is_uncancellable
from ...projection.user_error import UserError
from ...shading.frame import Frame
from ...shading.typing import Single
from ..tasks.task import Task
from .render_inputs import RenderInputs
from .scene_preparation import SceneCache, prepare_scene

RUNNING = "A render is already running: wait for it, or press Esc to cancel it"


class RenderJob(Task[Frame]):
    """One image that is rendered by a thread of its own. Its ``result`` is the frame."""

    def __init__(
        self,
        inputs: RenderInputs,
        with_tiles: bool = False,
        cache: SceneCache | None = None,
        keep: bool = False,
    ):
        """with_tiles: ``new_tiles`` shows the image in the making. cache, keep: as for ``prepare_scene``."""
        super().__init__(self._render, "SCFPF render")
        self._inputs: RenderInputs | None = inputs
        self.cache, self._keep = cache, keep
        self._building = True
        size = (inputs.settings.height, inputs.settings.width, 4)
        self._tiles = np.zeros(size, np.float32) if with_tiles else None
        self._has_new_tiles = threading.Event()

    def _render(self, _task: Task[Frame]) -> Frame | None:
        inputs, self._inputs = self._inputs, None
        prepared = prepare_scene(inputs, self.cache, self._keep)
        # Frees the part of the scene that the volume cannot meet.
        del inputs
        self.cache, self._building = prepared.cache, False
        return prepared.render(
            self.cancellation.is_set,
            None if self._tiles is None else self._take_coarse,
            progress=self._set_progress,
            on_tile=lambda *_: self._has_new_tiles.set(),
            pixels=self._tiles,
        )

    def _take_coarse(self, pixels: Single) -> None:
        self._tiles[:] = pixels
        self._has_new_tiles.set()

    def _set_progress(self, share: float) -> None:
        self.progress = share

    def new_tiles(self) -> Single | None:
        """The image so far, (H, W, 4) as in Frame, or None if nothing was added since the last call."""
        if self._tiles is None or not self._has_new_tiles.is_set():
            return None
        self._has_new_tiles.clear()
        return self._tiles

    @property
    def building(self) -> bool:
        """Return whether the scene is being built, which cannot be cancelled."""
        return self._building or is_uncancellable()


_current: RenderJob | None = None
# The cache of the last job, with persistent data.
_cache: SceneCache | None = None


def start(inputs: RenderInputs, with_tiles: bool = False, keep: bool = False) -> RenderJob:
    """Start the one job that may run at a time. Raises UserError while another runs.

    keep: whether the built scene is cached for the next job, which uses it if the scene is the same.
    """
    global _current
    if current() is not None:
        raise UserError(RUNNING)
    job = RenderJob(inputs, with_tiles, _cache if keep else None, keep)
    job.start()
    _current = job
    return job


def current() -> RenderJob | None:
    """The job that is running, if any."""
    return _current if _current is not None and _current.running else None


def stop() -> None:
    """Cancel the job, if any, wait for its thread, and release its arrays."""
    global _current, _cache
    if _current is not None:
        _current.cancel()
        _current.wait()
        _cache = _current.cache
    _current = None


def forget() -> None:
    """Stop the job, and release the cache of the last one."""
    global _cache
    stop()
    _cache = None
