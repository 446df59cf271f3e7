# SPDX-License-Identifier: GPL-3.0-or-later
"""Cancelled tiles end at the next rays that they cast, wherever they are."""

import gc
import weakref
from threading import Event, Thread, get_ident

import numpy as np
import pytest

from scfpf_addon.casting.common.cancellation import (
    Cancelled,
    also_cancelled_by,
    cancelled_by,
    raise_if_cancelled,
)
from scfpf_addon.casting.common.parallel import beside, parallel_map
from scfpf_addon.casting.scene.cast_scene import CastScene
from scfpf_addon.casting.tiles import run_tiles

RAY = np.zeros((3, 1)), np.ones((3, 1)), np.ones(1)


@pytest.fixture(scope="module")
def scene():
    return CastScene(np.array([[0, 0, 0], [1, 0, 0], [0, 1, 0.0]]), np.array([[0, 1, 2]], np.int32))


def test_rays_are_where_work_ends(scene):
    stop = Event()
    single = tuple(np.asarray(each, np.float32) for each in RAY)
    casts = (
        lambda: scene.mesh.trace(*single),
        lambda: scene.occluded(*RAY),
        lambda: scene.prisms.trace(*single),
    )
    with cancelled_by(stop):
        for cast in casts:
            cast()
        stop.set()
        for cast in casts:
            with pytest.raises(Cancelled):
                cast()
    for cast in casts:
        cast()


@pytest.mark.parametrize("which", ["outer", "inner"])
def test_either_of_two_signals_ends_the_work(which):
    signals = {"outer": Event(), "inner": Event()}
    with cancelled_by(signals["outer"]), also_cancelled_by(signals["inner"]):
        raise_if_cancelled()
        signals[which].set()
        with pytest.raises(Cancelled):
            raise_if_cancelled()
    raise_if_cancelled()


def test_a_signal_counts_by_itself_where_there_is_no_other():
    stop = Event()
    with also_cancelled_by(stop):
        raise_if_cancelled()
        stop.set()
        with pytest.raises(Cancelled):
            raise_if_cancelled()


def test_a_cancelled_image_ends_amid_tiles_that_never_would(scene):
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
    raise_if_cancelled()


def test_a_cancelled_image_holds_nothing_of_its_scene():
    """Scenes are large: they are freed without Python's collector, which may come when Embree has ended."""

    class Scene:
        pass

    started, held = Event(), []

    def work(_job):
        scene = Scene()
        held.append(weakref.ref(scene))
        started.set()
        while True:
            raise_if_cancelled()

    gc.disable()
    try:
        assert not run_tiles(work, [slice(0, 1)], 1, lambda *_: None, cancelled=started.is_set)
        assert len(held) == 1 and held[0]() is None
    finally:
        gc.enable()


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


@pytest.fixture(params=[0, 1])
def few_threads(request, monkeypatch):
    """A system that starts no or one thread and refuses the others."""
    left, start = [request.param], Thread.start

    def limited(thread):
        if not left[0]:
            raise RuntimeError("can't start new thread")
        left[0] -= 1
        start(thread)

    monkeypatch.setattr(Thread, "start", limited)
    return request.param


def test_threads_that_cannot_start_leave_the_work_to_the_others(few_threads):
    done = []
    tiles = [slice(row, row + 1) for row in range(20)]
    finished = []
    run_tiles(lambda job: done.append(get_ident()), tiles, 4, lambda rows, _: finished.append(rows.start))
    assert sorted(finished) == list(range(20)) and len(set(done)) == 1
    assert (done[0] == get_ident()) == (few_threads == 0)


def test_without_threads_what_is_cancelled_ends_and_what_fails_is_raised(monkeypatch):
    def refused(_thread):
        raise RuntimeError("can't start new thread")

    monkeypatch.setattr(Thread, "start", refused)
    parts, done = [slice(n, n + 1) for n in range(20)], []

    def work(job):
        done.append(job.rows.start)

    assert not run_tiles(work, parts, 4, lambda *_: None, cancelled=lambda: len(done) == 3)
    assert done == [0, 1, 2]
    with pytest.raises(ZeroDivisionError):
        run_tiles(lambda job: 1 // 0, parts, 4, lambda *_: None)
    assert parallel_map(lambda part: part.start**2, parts, 4) == [n**2 for n in range(20)]
    with pytest.raises(ZeroDivisionError):
        parallel_map(lambda part: 1 // part.start, parts, 4)
    assert beside(lambda: done.append("beside"), lambda: len(done)) == 4


def test_chunks_and_work_beside_raise_what_threads_raise(few_threads):
    parts = [slice(n, n + 1) for n in range(20)]
    assert parallel_map(lambda part: part.start, parts, 4) == list(range(20))
    with pytest.raises(ZeroDivisionError):
        beside(lambda: 1 // 0, lambda: None)
    with pytest.raises(KeyError):
        beside(lambda: None, lambda: {}["x"])
