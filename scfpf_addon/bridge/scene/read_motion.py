# SPDX-License-Identifier: GPL-3.0-or-later
"""What samples see while the shutter is open: the scene read at several times."""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import fields, is_dataclass, replace

import numpy as np

from ...projection.editing.interpolation import interpolated_projection
from ...projection.typing import Array
from ...projection.volume.viewing_volume import Projection
from ...shading.passes.motion_vectors import Neighbour
from ...shading.scene.depth_of_field import DepthOfField
from ...shading.scene.motion import Moment, shutter_times
from ...shading.scene.shading_scene import Scene

# Where the shutter's curve is looked at.
CURVE_STEPS = 65
# Moments of a moving camera, at most: each is a projection more.
MOST_MOMENTS = 256

# A reader of a depsgraph as it is now, and of the projection alone.
Seen = tuple[Projection, Scene, DepthOfField | None]
ReadAll = Callable[[], Seen]
ReadView = Callable[[], tuple[Projection, DepthOfField | None]]
SetFrame = Callable[..., None]
Cancelled = Callable[[], bool]


def read_moments(
    scene,
    samples: int,
    still: Scene,
    set_frame: SetFrame,
    read: ReadAll,
    read_view: ReadView,
    stopped: Cancelled,
) -> tuple[Moment, ...]:
    """The moments of a frame, () without motion blur, or once the render is to stop.

    scene: evaluated. still: the scene at the frame itself. set_frame(frame, subframe=…): evaluates
    another time. Where only the camera moves each sample has a moment of its own, its
    surfaces between those of the times that were read.
    """
    render = scene.render
    count = min(scene.scfpf_sampling.motion_steps, samples)
    if not render.use_motion_blur or render.motion_blur_shutter <= 0.0 or count < 2:
        return ()
    frame = scene.frame_current + scene.frame_subframe
    opens, closes = shutter(render, frame)
    weight = shutter_curve(render)
    times = shutter_times(count, opens, closes, weight)
    try:
        seen: list[Seen] = []
        for time in times:
            if stopped():
                return ()
            _go_to(set_frame, time)
            projection, there, lens = read()
            known_scenes = (still, *(known for _, known, _ in seen))
            seen.append(
                (projection, next((known for known in known_scenes if same(known, there)), there), lens)
            )
        if any(there is not still for _, there, _ in seen):
            return tuple(Moment(*each) for each in seen)
        ends = []
        for time in (opens, closes):
            _go_to(set_frame, time)
            ends.append(read_view())
    finally:
        _go_to(set_frame, frame)
    views = [ends[0], *((projection, lens) for projection, _, lens in seen), ends[1]]
    known = np.array([opens, *times, closes])
    wanted = shutter_times(min(samples, MOST_MOMENTS), opens, closes, weight)
    return tuple(Moment(projection, still, lens) for projection, lens in _between(views, known, wanted))


def _between(views, known: Array, wanted: Array):
    """The views at the times ``wanted`` from those at the times ``known``."""
    for time in wanted:
        after = min(max(int(np.searchsorted(known, time)), 1), len(known) - 1)
        span = known[after] - known[after - 1]
        share = float((time - known[after - 1]) / span) if span > 0.0 else 0.0
        (one, lens), (other, lens_after) = views[after - 1], views[after]
        if lens is not None and lens_after is not None:
            lens = replace(
                lens,
                centre=lens.centre + (lens_after.centre - lens.centre) * share,
                aperture=lens.aperture if share < 0.5 else lens_after.aperture,
                axes=lens.axes if share < 0.5 else lens_after.axes,
            )
        yield (one if same(one, other) else interpolated_projection(one, other, share)), lens


def read_neighbours(frame: float, still: Scene, set_frame: SetFrame, read: ReadAll):
    """The frames before and after, for motion vectors; see ``read_moments``."""
    found = []
    try:
        for step in (-1.0, 1.0):
            _go_to(set_frame, frame + step)
            projection, there, _lens = read()
            alike = np.array_equal(there.geometry.triangles, still.geometry.triangles)
            found.append(Neighbour(projection, there.geometry.vertices if alike else None))
    finally:
        _go_to(set_frame, frame)
    return found[0], found[1]


def shutter(render, frame: float) -> tuple[float, float]:
    """When the shutter opens and closes, in frames."""
    before = {"START": 0.0, "CENTER": 0.5, "END": 1.0}[render.motion_blur_position]
    opens = frame - before * render.motion_blur_shutter
    return opens, opens + render.motion_blur_shutter


def shutter_curve(render) -> Array | None:
    """How far the shutter is open at equal steps, None if always fully."""
    mapping = render.motion_blur_shutter_curve
    mapping.initialize()
    curve = mapping.curves[0]
    open_ = np.array([mapping.evaluate(curve, x) for x in np.linspace(0.0, 1.0, CURVE_STEPS)])
    return None if np.all(open_ == open_[0]) else open_


def _go_to(set_frame: SetFrame, time: float) -> None:
    whole = math.floor(time)
    set_frame(whole, subframe=time - whole)


def same(a, b) -> bool:
    """Whether two of our values are equal throughout: arrays, dataclasses, tuples, numbers."""
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
