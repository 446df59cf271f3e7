# SPDX-License-Identifier: GPL-3.0-or-later
"""The scene read at several times: the moments of motion blur, and the frames around for motion vectors."""

from __future__ import annotations

import math
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from dataclasses import fields, is_dataclass, replace
from typing import NamedTuple

import bpy
import numpy as np

from ...projection.editing.interpolation import interpolated_projection
from ...projection.typing import Array
from ...projection.volume.viewing_volume import Projection
from ...shading.passes.motion_vectors import Neighbour
from ...shading.scene.depth_of_field import DepthOfField
from ...shading.scene.motion import Moment, shutter_times
from ...shading.scene.shading_scene import Scene

# Number of points at which the shutter's curve is evaluated.
CURVE_STEPS = 65
# Largest number of moments of a moving camera: each adds a projection.
MOST_MOMENTS = 256

View = tuple[Projection, DepthOfField | None]
Everything = tuple[Projection, Scene, DepthOfField | None]


class MotionReader(NamedTuple):
    """Reader of an evaluated scene at other times than its frame.

    still: the scene at the frame itself. set_frame(frame, subframe=…): evaluates another time. read,
    read_view: read everything, or the view alone, at that time. cancelled(): whether the render is.
    """

    scene: bpy.types.Scene
    still: Scene
    set_frame: Callable[..., None]
    read: Callable[[], Everything]
    read_view: Callable[[], View]
    cancelled: Callable[[], bool]

    @property
    def frame(self) -> float:
        """The frame of the scene, subframe included."""
        return self.scene.frame_current + self.scene.frame_subframe

    @contextmanager
    def other_times(self) -> Iterator[Callable[[float], None]]:
        """Yield the function that evaluates a time; afterwards the frame itself is evaluated again."""
        frame = self.frame

        def go_to(time: float) -> None:
            number = math.floor(time)
            self.set_frame(number, subframe=time - number)

        try:
            yield go_to
        finally:
            go_to(frame)


def read_moments(reader: MotionReader, samples: int) -> tuple[Moment, ...]:
    """The moments of a frame, () without motion blur or once the render is cancelled.

    samples: of a pixel. If only the camera moves, each sample has a moment of its own, with surfaces
    interpolated between those of the times that were read.
    """
    scene, still, render = reader.scene, reader.still, reader.scene.render
    count = min(scene.scfpf_sampling.motion_steps, samples)
    if not render.use_motion_blur or render.motion_blur_shutter <= 0.0 or count < 2:
        return ()
    opens, closes = shutter(render, reader.frame)
    weight = shutter_curve(render)
    times = shutter_times(count, opens, closes, weight)
    read: list[Everything] = []
    ends: list[View] = []
    with reader.other_times() as go_to:
        for time in times:
            if reader.cancelled():
                return ()
            go_to(time)
            projection, there, lens = reader.read()
            known_scenes = (still, *(known for _, known, _ in read))
            there = next((known for known in known_scenes if same(known, there)), there)
            read.append((projection, there, lens))
        if any(there is not still for _, there, _ in read):
            return tuple(Moment(*each) for each in read)
        for time in (opens, closes):
            go_to(time)
            ends.append(reader.read_view())
    views = [ends[0], *((projection, lens) for projection, _, lens in read), ends[1]]
    known = np.array([opens, *times, closes])
    wanted = shutter_times(min(samples, MOST_MOMENTS), opens, closes, weight)
    return tuple(Moment(projection, still, lens) for projection, lens in _interpolated(views, known, wanted))


def _interpolated(views: list[View], known: Array, wanted: Array) -> Iterator[View]:
    """The views at the times ``wanted`` from those at the times ``known``."""
    for time in wanted:
        after = min(max(int(np.searchsorted(known, time)), 1), len(known) - 1)
        span = known[after] - known[after - 1]
        share = float((time - known[after - 1]) / span) if span > 0.0 else 0.0
        (one, lens), (other, lens_after) = views[after - 1], views[after]
        if lens is not None and lens_after is not None:
            nearer = lens if share < 0.5 else lens_after
            centre = lens.centre + (lens_after.centre - lens.centre) * share
            lens = replace(lens, centre=centre, aperture=nearer.aperture, axes=nearer.axes)
        yield (one if same(one, other) else interpolated_projection(one, other, share)), lens


def read_neighbours(reader: MotionReader) -> tuple[Neighbour, Neighbour]:
    """The frames before and after, for motion vectors."""
    found = []
    # Going to another time changes the reader's frame.
    frame = reader.frame
    with reader.other_times() as go_to:
        for time in (frame - 1.0, frame + 1.0):
            go_to(time)
            projection, there, _lens = reader.read()
            alike = np.array_equal(there.geometry.triangles, reader.still.geometry.triangles)
            found.append(Neighbour(projection, there.geometry.vertices if alike else None))
    return found[0], found[1]


def shutter(render, frame: float) -> tuple[float, float]:
    """The times at which the shutter opens and closes, in frames."""
    before = {"START": 0.0, "CENTER": 0.5, "END": 1.0}[render.motion_blur_position]
    opens = frame - before * render.motion_blur_shutter
    return opens, opens + render.motion_blur_shutter


def shutter_curve(render) -> Array | None:
    """The openness of the shutter at equal steps (CURVE_STEPS,), None if it is always the same."""
    mapping = render.motion_blur_shutter_curve
    mapping.initialize()
    curve = mapping.curves[0]
    open_ = np.array([mapping.evaluate(curve, x) for x in np.linspace(0.0, 1.0, CURVE_STEPS)])
    return None if np.all(open_ == open_[0]) else open_


def same(a, b) -> bool:
    """Return whether two values are equal throughout: arrays, dataclasses, tuples, numbers."""
    if a is b:
        return True
    if type(a) is not type(b):
        return False
    if isinstance(a, np.ndarray):
        return np.array_equal(a, b, equal_nan=a.dtype.kind == "f")
    if is_dataclass(a):
        return all(same(getattr(a, each.name), getattr(b, each.name)) for each in fields(a))
    if isinstance(a, (tuple, list)):
        return len(a) == len(b) and all(map(same, a, b))
    if isinstance(a, dict):
        return a.keys() == b.keys() and all(same(value, b[key]) for key, value in a.items())
    return a == b
