# SPDX-License-Identifier: GPL-3.0-or-later
"""All background tasks in one table: results, exceptions, cancellation, and a system without threads.

The jobs are those of the product. What they do in the thread is replaced where it must fail or wait.
"""

import contextlib
import gc
import threading
import time
import weakref

import bpy
import numpy as np
import pytest
from engine_images import button

PATIENCE = 30.0
SIZE = (64, 36)


def until(condition):
    """Wait for a condition."""
    end = time.monotonic() + PATIENCE
    while not condition():
        assert time.monotonic() < end, "the thread hangs"
        time.sleep(0.005)


def threads():
    """The names of the product's threads that are alive."""
    return [thread.name for thread in threading.enumerate() if thread.name.startswith("SCFPF")]


class Render:
    """The Render button's job."""

    # The function that does the work, which tests replace.
    work = "bridge.render.scene_preparation", "render_frame"
    waits_without_thread = False

    def __init__(self, addon, scene):
        self.jobs, self.scene = addon("bridge.render.render_job"), scene
        self.prepare = addon("bridge.render.render_inputs").prepare
        self.expected = button()

    def begin(self):
        inputs = self.prepare(self.scene, bpy.context.view_layer, self.scene.camera)
        self.job = self.jobs.RenderJob(inputs)
        self.job.start()

    def result(self):
        """The pixels, None if cancelled. Raises the error, or one with the message of it."""
        frame = self.job.result()
        return None if frame is None else frame.pixels

    def cancel(self):
        self.job.cancel()

    def close(self):
        self.job.cancel()
        self.job.wait()


class Solve(Render):
    """A solve whose work is a sum of squares, in two parts."""

    work = "whole.squares", "squares"
    waits_without_thread = True

    def __init__(self, addon, _scene):
        self.solves, self.written = addon("bridge.aim.solve_work"), []
        self.squares = lambda task: np.arange(5.0) ** 2
        self.expected = np.full(1, 60.0)

    def _steps(self):
        def work(task):
            task.progress = 1.0
            return self.squares(task)

        first = yield self.solves.Work(work, 0.0, 0.5)
        second = yield self.solves.Work(work, 0.5, 0.5)
        self.written.append(np.array([first.sum() + second.sum()]))
        return "written"

    def begin(self):
        self.written.clear()
        self.job = self.solves.WatchedSolve(self._steps())

    def result(self):
        until(self.job.is_done)
        return self.written[0] if self.written else None

    def close(self):
        self.job.cancel()
        self.job.task.wait()


class Painting(Render):
    """A viewport in Rendered shading."""

    work = "bridge.render.view_painter", "render_frame"

    def __init__(self, addon, scene):
        super().__init__(addon, scene)
        module = addon("bridge.render.view_painter")
        self.rectangle = module.Rectangle(0.0, 0.0, *map(float, SIZE))
        self.commission, self.painter = module.Commission, module.ViewPainter()

    def begin(self):
        inputs = self.prepare(self.scene, bpy.context.view_layer, self.scene.camera)
        self.painter.ask(self.commission(inputs, self.rectangle))

    def result(self):
        until(lambda: not self.painter.busy)
        if self.painter.message:
            assert self.painter.image is None
            raise RuntimeError(self.painter.message)
        return None if self.painter.image is None else self.painter.image.pixels

    def cancel(self):
        self.painter.retire()

    def close(self):
        self.painter.stop()


class Live(Painting):
    """A viewport of Live View."""

    work = "bridge.live.live_painter", "cast_live"

    def __init__(self, addon, scene):
        views, rectangle = addon("bridge.live.live_view"), addon("bridge.render.view_painter").Rectangle
        self.scene, self.view = scene, views.LiveView()
        self.painter = self.view.painter
        self.frame = rectangle(0.0, 0.0, *map(float, SIZE))
        self.window = addon("shading.live.cast_live").LiveWindow(0.0, 0.0, 1.0, 1.0, *SIZE)
        self.expected = views.LiveView().refresh(
            bpy.context.evaluated_depsgraph_get(), self.scene.camera, SIZE
        )

    def begin(self):
        self.view._key = ()  # ask again for the same image
        depsgraph = bpy.context.evaluated_depsgraph_get()
        assert self.view.request(depsgraph, self.scene.camera, self.frame, self.window, self.frame)


@pytest.fixture(params=[Render, Solve, Painting, Live], ids=lambda cls: cls.__name__)
def job(request, addon, engine_scene):
    made = request.param(addon, engine_scene)
    yield made
    if hasattr(made, "job") or hasattr(made, "painter"):
        made.close()
    assert threads() == []


@pytest.fixture
def replaced(job, addon, monkeypatch):
    """Replace the work of the job by another function within a context."""

    def patched(function):
        patch = pytest.MonkeyPatch()
        if isinstance(job, Solve):
            patch.setattr(job, "squares", function)
        else:
            patch.setattr(addon(job.work[0]), job.work[1], function)
        return patch

    return patched


def refused(_thread):
    raise RuntimeError("can't start new thread")


def test_the_result_comes(job):
    job.begin()
    assert np.allclose(job.result(), job.expected, atol=1e-3)


@pytest.mark.parametrize(
    ("error", "told"),
    [
        (ZeroDivisionError("in the core"), "in the core"),
        (MemoryError(), "not enough memory"),
    ],
)
def test_an_exception_of_the_work_is_told_and_the_next_request_works(job, replaced, addon, error, told):
    def fail(*_arguments, **_options):
        raise error

    reason = addon("bridge.blender.user_errors").reason
    patch = replaced(fail)
    job.begin()
    with pytest.raises((RuntimeError, type(error))) as caught:
        job.result()
    assert told in reason(caught.value)
    patch.undo()
    job.begin()
    assert np.allclose(job.result(), job.expected, atol=1e-3)


def test_cancelled_work_ends_without_a_result(job, replaced, addon):
    """The work waits for its own signal: it ends only if that reaches it."""
    entered, seen = threading.Event(), []
    cast = getattr(addon(job.work[0]), job.work[1]) if isinstance(job, Live) else None

    def wait(*arguments, cancelled=None, **_options):
        if isinstance(job, Live):
            if len(arguments) < 4:  # nothing cancels a first image
                return cast(*arguments)
            cancelled = arguments[3].is_set
        elif isinstance(job, Solve):
            cancelled = arguments[0].cancellation.is_set
        entered.set()
        until(cancelled)
        seen.append(True)
        addon("casting.common.cancellation").raise_if_cancelled()
        return None

    patch = replaced(wait)
    job.begin()
    assert entered.wait(PATIENCE)
    assert len(threads()) == 1
    job.cancel()
    until(lambda: threads() == [])
    assert seen == [True]
    if isinstance(job, Solve):
        assert job.written == []
    elif not isinstance(job, Live):
        assert job.result() is None
    patch.undo()


def test_without_threads(job, monkeypatch):
    """The user is told, or Blender waits; with threads again it works."""
    with monkeypatch.context() as patch:
        patch.setattr(threading.Thread, "start", refused)
        if job.waits_without_thread:
            job.begin()
            assert np.allclose(job.result(), job.expected, atol=1e-3)
            return
        with pytest.raises((RuntimeError, ValueError), match="starts no more threads"):
            job.begin()
            job.result()
    job.begin()
    assert np.allclose(job.result(), job.expected, atol=1e-3)


# What only painters do


@pytest.fixture
def painter(addon):
    """A painter whose images are the squares of its requests; a list of what it began, and a gate."""

    class Squares(addon("bridge.tasks.painter").Painter):
        def __init__(self):
            super().__init__("SCFPF squares")
            self.begun, self.gate = [], threading.Event()

        def _paint(self, request):
            self.begun.append(request)
            assert self.gate.wait(PATIENCE)
            if not self.is_set():
                self._show(request**2)

    made = Squares()
    yield made
    made.gate.set()
    made.stop()
    assert threads() == []


def test_the_latest_request_wins(painter):
    painter.ask(1)
    until(lambda: painter.begun == [1])
    for request in range(2, 10):
        painter.ask(request)
    assert painter.is_set() and not painter.wait(0.0)
    painter.gate.set()
    assert painter.wait(PATIENCE)
    until(lambda: not painter.busy)
    assert painter.begun == [1, 9] and painter.image == 81 and painter.number == 1
    assert painter.asked == painter.answered == 9


def test_a_retired_painter_paints_no_more(painter):
    painter.ask(1)
    until(lambda: painter.begun == [1])
    painter.retire()
    assert painter.wait(0.0), "nobody waits for it"
    painter.gate.set()
    painter.stop()
    painter.ask(2)
    assert not painter.busy and painter.image is None and painter.begun == [1]


# What only tasks do


@pytest.mark.parametrize("fails", [False, True])
def test_a_task_holds_nothing_of_its_work_afterwards(addon, fails):
    """Images are large: what the work holds is freed without Python's collector of circles."""

    class Arrays:
        def work(self, task):
            task.progress = 0.5
            if fails:
                raise ZeroDivisionError
            return "done"

    arrays = Arrays()
    held = weakref.ref(arrays)
    task = addon("bridge.tasks.task").Task(arrays.work, "SCFPF arrays")
    del arrays
    gc.disable()
    try:
        task.start()
        if fails:
            with contextlib.suppress(ZeroDivisionError):
                task.result()
        else:
            assert task.result() == "done"
        assert task.progress == 0.5 and held() is None
    finally:
        gc.enable()
