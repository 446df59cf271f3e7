# SPDX-License-Identifier: GPL-3.0-or-later
"""The bounding boxes of what a scene shows, which cameras and volumes are fitted to."""

from typing import NamedTuple

import numpy as np

from ...scfpf_addon.bridge.scene.instances import NO_THINGS, instances, is_finite
from ...scfpf_addon.bridge.scene.read_visibility import ShownInRenders

# A flat object, such as a ground, and any other, such as a dome, that are this many times as large as the
# rest of a scene together are its background. A box is flat whose least side is this share of its longest.
GROUND, DOME = 10.0, 100.0
FLAT = 0.1


class SceneBox(NamedTuple):
    """An axis-aligned box: low and high corner, each (3,)."""

    low: np.ndarray
    high: np.ndarray

    @property
    def centre(self):
        return (self.low + self.high) / 2

    @property
    def size(self):
        return self.high - self.low

    @property
    def corners(self):
        """The eight corners, (8, 3)."""
        return np.array([[x, y, z] for x in (0, 1) for y in (0, 1) for z in (0, 1)]) * self.size + self.low


class SceneBoxes(NamedTuple):
    """The box of all that a scene shows, and the box without the background that surrounds the rest."""

    whole: SceneBox
    things: SceneBox


def box_of(corners) -> SceneBox:
    """The box around points (N, 3)."""
    return SceneBox(np.min(corners, axis=0), np.max(corners, axis=0))


def transformed(matrix, points):
    """Points (N, 3) transformed by a (4, 4) matrix."""
    placed = np.array(matrix, np.float64)
    return points @ placed[:3, :3].T + placed[:3, 3]


def corners_of(obj, matrix):
    """The corners of an evaluated object's bounding box, transformed by a (4, 4) matrix, (8, 3)."""
    return transformed(matrix, np.array(obj.bound_box, np.float64))


def is_thing(obj) -> bool:
    """Return whether an object, or what it instances, may have a size in a picture."""
    return obj.type not in NO_THINGS or (obj.type == "EMPTY" and obj.instance_type == "COLLECTION")


def scene_boxes(context, selected_only=False) -> SceneBoxes | None:
    """The boxes around what the scene, or its selection, shows in an image; None if that is nothing."""
    depsgraph = context.evaluated_depsgraph_get()
    corners = []
    for instance in instances(depsgraph, renders=ShownInRenders(depsgraph)):
        if instance.obj.type in NO_THINGS or (selected_only and not instance.owner.select_get()):
            continue
        matrix = instance.matrix
        if is_finite(matrix):
            corners.append(corners_of(instance.obj, matrix))
    if not corners:
        return None
    box = np.array(corners)
    low, high = box.min(axis=1), box.max(axis=1)
    things = ~_is_background(low, high)
    return SceneBoxes(
        SceneBox(low.min(axis=0), high.max(axis=0)),
        SceneBox(low[things].min(axis=0), high[things].max(axis=0)),
    )


def _is_background(low, high):
    """Return which of N boxes are background, (N,). low, high: corners, (N, 3)."""
    size = np.linalg.norm(high - low, axis=1)
    order = np.argsort(-size, kind="stable")[: np.count_nonzero(size)]
    background = np.zeros(len(size), bool)
    if len(order) < 2:
        return background
    low, high, size = low[order], high[order], size[order]
    # The diagonal of the box around all that are smaller.
    rest = np.linalg.norm(
        np.maximum.accumulate(high[::-1])[::-1][1:] - np.minimum.accumulate(low[::-1])[::-1][1:], axis=1
    )
    side = high - low
    is_flat = (side.min(axis=1) <= FLAT * side.max(axis=1))[:-1]
    surrounds = size[:-1] > np.where(is_flat, GROUND, DOME) * rest
    if surrounds.any():
        # Under a dome there may be a ground: a flat object that is much larger than the rest, too.
        last = int(np.argmax(surrounds))
        while last + 1 < len(surrounds) and surrounds[last + 1] and is_flat[last + 1]:
            last += 1
        background[order[: last + 1]] = True
    return background
