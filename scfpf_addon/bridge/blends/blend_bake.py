# SPDX-License-Identifier: GPL-3.0-or-later
"""Keyframes of a blend's map as shapes: drivers mix them by the frame, so that files play without code.

Between two shapes the map is mixed linearly. As few frames are kept as leave it within TOLERANCE.
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from ...projection.typing import Array
from ...projection.user_error import UserError
from .camera_blend import (
    BAKED,
    SECOND_KEY,
    blend_surfaces,
    drive,
    end_weights,
    mixed,
    read_maps,
    write_map,
)

# The largest error of a weight between two kept frames.
TOLERANCE = 1 / 256
# The most frames that are looked at: their shapes are kept in the file.
MOST_FRAMES = 2000
NO_MAP = "The map of '{0}' cannot be read in frame {1}: choose a map or load its image"


def bake_map(camera, scene, start: int, end: int) -> int:
    """Write the map of each frame from ``start`` to ``end`` into shapes. Returns the number of kept frames.

    Before and after these frames the map stays as in the first and the last one. Raises UserError.
    """
    if not 0 < end - start <= MOST_FRAMES:
        raise UserError("Choose an end after the start, at most {0} frames later", MOST_FRAMES)
    write_map(camera)
    surfaces, now = blend_surfaces(camera), scene.frame_current
    if not surfaces:
        raise UserError("'{0}' has no surfaces of a blend: press Update Blend", camera.name)
    frames = list(range(start, end + 1))
    weights: list[list[Array]] = [[] for _ in surfaces]
    try:
        for frame in frames:
            scene.frame_set(frame)
            maps = read_maps(camera)
            is_known = all(blend_map is not None or end.settings.kind == "NONE" for end, blend_map in maps)
            for own, surface in zip(weights, surfaces, strict=True):
                found = end_weights(camera, surface, maps) if is_known else None
                if found is None:
                    raise UserError(NO_MAP, camera.name, frame)
                own.append(found)
    finally:
        scene.frame_set(now)
    kept = kept_frames(np.array(weights[0]).reshape(len(frames), -1))
    for own, surface in zip(weights, surfaces, strict=True):
        _add_shapes(camera, surface, [frames[k] for k in kept], [own[k] for k in kept])
    return len(kept)


def kept_frames(values: Array) -> list[int]:
    """The places of the rows (F, N) between which the others are linear, within TOLERANCE."""
    kept = [0]
    while kept[-1] < len(values) - 1:
        begin = kept[-1]
        end = begin + 1
        while end + 1 < len(values):
            share = np.arange(1, end + 1 - begin)[:, None] / (end + 1 - begin)
            line = values[begin] + share * (values[end + 1] - values[begin])
            if np.abs(line - values[begin + 1 : end + 1]).max() > TOLERANCE:
                break
            end += 1
        kept.append(end)
    return kept


def _add_shapes(camera, surface, frames: Sequence[int], weights: Sequence[Array]) -> None:
    blocks = surface.data.shape_keys.key_blocks
    for k, (frame, own) in enumerate(zip(frames, weights, strict=True)):
        key = surface.shape_key_add(name=f"{BAKED} {frame}", from_mix=False)
        points = mixed(surface, own)
        key.data.foreach_set("co", np.ascontiguousarray(points, np.float32).ravel())
        drive(key, camera, hat(frames[max(k - 1, 0)], frame, frames[min(k + 1, len(frames) - 1)]))
    blocks[SECOND_KEY].mute = True
    surface.data.update()


def hat(before: int, frame: int, after: int) -> str:
    """The driver's expression that is 1 at a frame and 0 from its neighbours on, times ``factor``.

    An outermost frame is its own neighbour: there the expression stays 1.
    """
    sides = [f"({after} - frame) / {after - frame}"] * (after > frame)
    sides += [f"(frame - {before}) / {frame - before}"] * (frame > before)
    return f"factor * max(0, min(1, {', '.join(sides)}))"
