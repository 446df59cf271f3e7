# SPDX-License-Identifier: GPL-3.0-or-later
"""Tiles end at the next rays that they cast once they are to stop, wherever they are."""

from threading import Event, get_ident

import numpy as np
import pytest

from scfpf_addon.casting.scene import CastScene
from scfpf_addon.casting.stopping import Stopped, stop_here, watching
from scfpf_addon.casting.tiles import run_tiles

RAY = np.zeros((3, 1)), np.ones((3, 1)), np.ones(1)


@pytest.fixture(scope="module")
def scene():
    return CastScene(np.array([[0, 0, 0], [1, 0, 0], [0, 1, 0.0]]), np.array([[0, 1, 2]], np.int32))


def test_rays_are_where_work_ends(scene):
    stop = Event()
    single = tuple(np.asarray(each, np.float32) for each in RAY)
    casts = (lambda: scene.trace(*single), lambda: scene.occluded(*RAY), lambda: scene.prisms.trace(*single))
    with watching(stop):
        for cast in casts:
            cast()
        stop.set()
        for cast in casts:
            with pytest.raises(Stopped):
                cast()
    for cast in casts:
        cast()


def test_a_cancelled_picture_ends_amid_tiles_that_never_would(scene):
    started, ended = Event(), []

    def work(_job):
        try:
            while True:
                scene.occluded(*RAY)
                started.set()
        finally:
            ended.append(get_ident())

    tiles = [slice(0, 1), slice(1, 2), slice(2, 3)]
    assert not run_tiles(work, tiles, 2, lambda *_: None, cancelled=started.is_set)
    assert 1 <= len(ended) <= 2
    stop_here()


def test_a_failing_tile_ends_the_others_and_is_what_is_raised(scene):
    started = Event()

    def work(job):
        if job.rows.start:
            assert started.wait(60.0)
            raise ZeroDivisionError
        while True:
            scene.occluded(*RAY)
            started.set()

    with pytest.raises(ZeroDivisionError):
        run_tiles(work, [slice(0, 1), slice(1, 2)], 2, lambda *_: None)
