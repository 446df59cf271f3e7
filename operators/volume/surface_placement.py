# SPDX-License-Identifier: GPL-3.0-or-later
"""The placement of a new control surface among those that a camera has."""

import math

import numpy as np
from mathutils import Matrix, Vector

from ...scfpf_addon.bridge.blender.user_errors import USER_ERRORS
from ...scfpf_addon.bridge.live.seen_depth import median_depth
from ...scfpf_addon.bridge.surfaces.surface_object import surface_parameters
from ...scfpf_addon.projection.surfaces.kinds import PARAMETRIC_KINDS, Space
from ..common.scene_box import SceneBox, box_of, corners_of

# A new curved surface between flat ones spans the same width with this arc.
NEW_ARC = math.radians(90)
# Neighbours at least this deep for their width count as round: the new surface is concentric with them.
ROUND_DEPTH = 0.25
GRID_POINTS = 4
# Shares of the way between two surfaces: the middle, and the least distance from either.
HALF, LEAST_SHARE = 0.5, 1e-4
# Half the depth of a lattice that is a camera's first surface, in Blender units, and its axis.
NEW_DEPTH, FORWARDS = 4.0, np.array([0.0, 0.0, 1.0])


def surface_place(camera, depsgraph, kind: str, index: int):
    """Matrix (camera space), parameters and points of a new surface at ``index`` of the list.

    Between the two surfaces of a volume it lies where most things in the image are, between others half-way;
    at an end it continues the step between the last two. Parameters or points are None where the kind has
    none.
    """
    slots = [slot.object for slot in camera.scfpf.surfaces]
    present = [obj if obj is not None and obj.name in depsgraph.scene.objects else None for obj in slots]
    before = present[index - 1] if index > 0 else None
    after = present[index] if index < len(present) else None
    to_camera = camera.matrix_world.inverted_safe()
    boxes = [
        None
        if obj is None
        else box_of(corners_of(obj.evaluated_get(depsgraph), to_camera @ obj.matrix_world))
        for obj in present
    ]
    if kind == "LATTICE":
        box = _room(boxes, index)
        return Matrix.Translation(Vector(box.centre)) @ Matrix.Diagonal((*box.size, 1.0)), None, None
    share = _share_of_things(camera, depsgraph) if index == 1 and len(slots) == 2 else HALF
    box = _between(boxes, index, share)
    if before is not None and before.scfpf_surface.kind == kind and kind in PARAMETRIC_KINDS:
        matrix = to_camera @ before.matrix_world
        shift = box.centre - boxes[index - 1].centre
        return (
            Matrix.Translation(Vector(shift)) @ matrix,
            _mean_parameters(before, after, depsgraph, share),
            None,
        )
    return _fill(kind, box)


def _share_of_things(camera, depsgraph) -> float:
    """The share of the way between the two surfaces of a volume at which most things in the image are."""
    try:
        found = median_depth(camera, depsgraph)
    except USER_ERRORS:
        return HALF  # The image shows nothing of such a volume or scene.
    return HALF if found is None else min(max(found, LEAST_SHARE), 1.0 - LEAST_SHARE)


def _between(boxes, index: int, share: float = HALF) -> SceneBox:
    """The box of a surface at ``index``: between its neighbours, or the continuation of the last two.

    share: of the way from the neighbour before to the one after.
    """
    before = boxes[index - 1] if index > 0 else None
    after = boxes[index] if index < len(boxes) else None
    if before is not None and after is not None:
        ends = (before.low, after.low), (before.high, after.high)
        return SceneBox(*((1.0 - share) * start + share * end for start, end in ends))
    if before is None and after is None:
        return SceneBox(np.array([-1.0, -1.0, -5.0]), np.array([1.0, 1.0, -5.0]))
    known, step = (before, -1) if before is not None else (after, 1)
    second = index - 2 if before is not None else index + 1
    other = boxes[second] if 0 <= second < len(boxes) else None
    if other is None:
        shift = np.array([0.0, 0.0, step * max(known.size.max(), 1.0)])
        return SceneBox(known.low + shift, known.high + shift)
    centre = 2 * known.centre - other.centre
    half = np.maximum(2 * known.size - other.size, known.size / 2) / 2
    return SceneBox(centre - half, centre + half)


def _room(boxes, index: int) -> SceneBox:
    """The box of a lattice: the middle third of the space between its neighbours.

    Without a neighbour on one side, it extends a third of its width to either side of ``_between``. In an
    empty list it is a whole volume.
    """
    middle = _between(boxes, index)
    around = [boxes[i] for i in (index - 1, index) if 0 <= i < len(boxes) and boxes[i] is not None]
    if not around:
        return SceneBox(middle.low - NEW_DEPTH * FORWARDS, middle.high + NEW_DEPTH * FORWARDS)
    across = np.where(middle.size > 0, middle.size, 1.0) / 2
    depth = float(across.max()) / 3
    if len(around) == 2:
        depth = abs(float(around[1].centre[2] - around[0].centre[2])) / 6 or depth
    half = np.array([across[0], across[1], depth])
    return SceneBox(middle.centre - half, middle.centre + half)


def _mean_parameters(before, after, depsgraph, share: float) -> dict:
    """The parameters of one surface, or those on the way to a following surface of the same kind."""
    parameters = surface_parameters(before.evaluated_get(depsgraph))
    if after is not None and after.scfpf_surface.kind == before.scfpf_surface.kind:
        others = surface_parameters(after.evaluated_get(depsgraph))
        return {name: (1.0 - share) * value + share * others[name] for name, value in parameters.items()}
    return parameters


def _fill(kind: str, box: SceneBox):
    """Matrix, parameters and points of a surface of ``kind`` that fills a box facing the camera."""
    width, height, depth = (float(extent) for extent in box.size)
    width, height = (width or 1.0), (height or 1.0)
    centre = Vector(box.centre)
    if kind in PARAMETRIC_KINDS:
        radius, arc = width / 2, math.tau
        if depth < ROUND_DEPTH * width and PARAMETRIC_KINDS[kind].turns_about_y:
            radius, arc = radius / math.sin(NEW_ARC / 2), NEW_ARC
            centre.z = float(box.low[2]) + radius
        parameters = PARAMETRIC_KINDS[kind].fill(Space(width, height, radius, arc))
        return Matrix.Translation(centre), parameters, None
    count = 2 if kind == "PATCH" else GRID_POINTS
    across, up = np.linspace(-0.5, 0.5, count) * width, np.linspace(-0.5, 0.5, count) * height
    points = np.stack([*np.meshgrid(across, up), np.zeros((count, count))], axis=-1)
    return Matrix.Translation(centre), None, points
