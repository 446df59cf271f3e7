# SPDX-License-Identifier: GPL-3.0-or-later
"""Where a new camera and a new control surface go, so that they are of use at once."""

import math
from typing import NamedTuple

import bpy
import numpy as np
from mathutils import Matrix, Vector

from ...scfpf_addon.bridge.camera.flexible_camera import control_objects
from ...scfpf_addon.bridge.surfaces.surface_object import surface_parameters
from ...scfpf_addon.projection.surfaces.kinds import PARAMETRIC_KINDS, Space

SHAPES = {"MESH", "CURVE", "SURFACE", "FONT", "META"}
# Things may come this much nearer to a new camera before the near surface cuts them off.
NEAR_SHARE = 0.25
# The far surface lies this much farther off than the farthest thing.
FAR_MARGIN = 1.25
# From the middle of a scene the volume reaches at least so far, as a share of the scene's diagonal.
INSIDE_SHARE = 0.5
# The near surface is at most so far off, as a share of the farthest thing, unless all things are farther.
LEAST_SHARE = 0.01
# A preset whose far surface is more than so many times farther off than the scene's end is made smaller.
OVERSIZE = 10.0
# Its far diagonal stays at least so many times that of the scene: parallel projectors see no more.
ACROSS = 2.0
# Without a viewport the camera looks from here, as Blender's own first view does.
DEFAULT_DIRECTION = Vector((0.8, -1.0, 0.55)).normalized()
DEFAULT_MARGIN = 1.1
# A new curved surface between flat ones spans the same width with this arc.
NEW_ARC = math.radians(90)
# Neighbours at least this deep for their width count as round: the new surface is put concentric.
ROUND_DEPTH = 0.25
GRID_POINTS = 4
# A lattice that is a camera's first surface reaches so far from its middle, Blender units along -Z.
NEW_DEPTH, FORWARDS = 4.0, np.array([0.0, 0.0, 1.0])


class Box(NamedTuple):
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
        """(8, 3)."""
        return np.array([[x, y, z] for x in (0, 1) for y in (0, 1) for z in (0, 1)]) * self.size + self.low


def _box(corners) -> Box:
    """The box of corners (N, 3)."""
    return Box(np.min(corners, axis=0), np.max(corners, axis=0))


def _corners(obj, matrix):
    """An evaluated object's bounding box through a (4, 4) matrix, (8, 3)."""
    placed = np.array(matrix, np.float64)
    return np.array(obj.bound_box, np.float64) @ placed[:3, :3].T + placed[:3, 3]


def _shapes(objects, left_out):
    return [o for o in objects if o.type in SHAPES and not o.hide_render and o.name_full not in left_out]


def scene_box(context, selected_only=False) -> Box | None:
    """The box around all that a picture of the scene, or of the selection, may show; None if nothing."""
    depsgraph = context.evaluated_depsgraph_get()
    left_out = control_objects()
    corners = []
    for obj in context.view_layer.objects:
        if not obj.visible_get() or obj.hide_render or (selected_only and not obj.select_get()):
            continue
        if obj.instance_type == "COLLECTION" and obj.instance_collection is not None:
            origin = Matrix.Translation(-obj.instance_collection.instance_offset)
            for part in _shapes(obj.instance_collection.all_objects, left_out):
                corners.append(_corners(part, obj.matrix_world @ origin @ part.matrix_world))
        elif obj.type in SHAPES and obj.name_full not in left_out:
            corners.append(_corners(obj.evaluated_get(depsgraph), obj.matrix_world))
    finite = [c for c in corners if np.isfinite(c).all()]
    return _box(np.concatenate(finite)) if finite else None


def camera_like_view(context, aspect: float):
    """Camera data and world matrix of what the 3D viewport shows, or None without a viewport.

    The picture is the largest of its aspect that fits inside the region.
    """
    view = context.region_data if context.area is not None and context.area.type == "VIEW_3D" else None
    if view is None:
        return None
    through = context.space_data.camera if view.view_perspective == "CAMERA" else None
    if through is not None and through.type == "CAMERA":
        data = through.data.copy()
        data.name = "Flexible Camera"
        if data.type not in {"PERSP", "ORTHO"}:
            data.type = "PERSP"
        return data, through.matrix_world.normalized()
    data = bpy.data.cameras.new("Flexible Camera")
    # The window matrix's diagonal is 1 / half extent: at distance 1, or anywhere if orthographic.
    half_width = min(1 / view.window_matrix[0][0], aspect / view.window_matrix[1][1])
    longer = half_width * max(1.0, 1 / aspect)
    if view.view_perspective == "ORTHO":
        data.type = "ORTHO"
        data.ortho_scale = 2 * longer
    else:
        data.lens = data.sensor_width / (2 * longer)
    return data, view.view_matrix.inverted()


def camera_seeing(box: Box, aspect: float):
    """Camera data and world matrix from which the whole box is seen."""
    data = bpy.data.cameras.new("Flexible Camera")
    # A point has no size: it is seen as a cube of Blender's usual size is.
    radius = float(np.linalg.norm(box.size)) / 2 or math.sqrt(3.0)
    half_width = data.sensor_width / (2 * data.lens) * min(1.0, aspect)
    narrower = math.atan(min(half_width, half_width / aspect))
    distance = DEFAULT_MARGIN * radius / math.sin(narrower)
    rotation = DEFAULT_DIRECTION.to_track_quat("Z", "Y").to_matrix().to_4x4()
    return data, Matrix.Translation(Vector(box.centre) + distance * DEFAULT_DIRECTION) @ rotation


def fit_depth(data, matrix, box: Box):
    """Set the clip range so that near and far surface hold what the camera has of the box before it.

    From inside the box, and where the camera looks away from it, the far surface is about as far off as
    the box is large. Returns the matrix, moved back for an orthographic camera that stands inside.
    """
    depths = -_through(matrix.inverted(), box.corners)[:, 2]
    size = float(np.linalg.norm(box.size))
    least = min(data.clip_start, LEAST_SHARE * max(float(depths.max()), size))
    if data.type == "ORTHO":
        # Parallel projectors see the same from any distance.
        back = max(0.0, NEAR_SHARE * float(np.ptp(depths)) + least - float(depths.min()))
        matrix = matrix @ Matrix.Translation((0.0, 0.0, back))
        depths = depths + back
    data.clip_start = max(least, NEAR_SHARE * float(depths.min()))
    farthest = max(float(depths.max()), INSIDE_SHARE * size)
    data.clip_end = max(FAR_MARGIN * farthest, data.clip_start / NEAR_SHARE)
    return matrix


def _through(matrix, points):
    placed = np.array(matrix, np.float64)
    return points @ placed[:3, :3].T + placed[:3, 3]


def around_subject(subject, box: Box):
    """World matrix and scale of an upright camera whose preset's subject becomes ``box``.

    subject: centre and size in camera space. The camera looks along world Y or
    -X, whichever fits the box's longer side to the subject's.
    """
    wanted = np.maximum(np.array(subject.size, np.float64), np.finfo(np.float32).tiny)
    choices = []
    for turn in (0.0, math.radians(90)):
        rotation = Matrix.Rotation(turn, 4, "Z") @ Matrix.Rotation(math.radians(90), 4, "X")
        own = np.abs(np.array(rotation.to_3x3().transposed(), np.float64)) @ box.size
        choices.append((float(np.max(own / wanted)), rotation))
    scale, rotation = min(choices, key=lambda choice: choice[0])
    scale = scale or 1.0
    centre = rotation @ (Vector(subject.centre) * scale)
    return Matrix.Translation(Vector(box.centre) - centre) @ rotation, scale


def reaching_scale(volume, matrix, box: Box) -> float:
    """By how much a preset's volume (camera space) must grow for its far surface to lie behind the box.

    Below 1 only for a box that is tiny beside the volume, whose near surface might lie behind it; the far
    surface then stays larger than the box. Any other volume that reaches farther is left as it is.
    """
    ends = np.array([0.0, 0.5, 1.0])
    u, v = (grid.ravel() for grid in np.meshgrid(ends, ends))
    far = volume.surfaces[-1].evaluate(u, v).position
    reach = float(np.linalg.norm(far, axis=0).min())
    farthest = float(np.linalg.norm(_through(matrix.inverted_safe(), box.corners), axis=1).max())
    if not (reach > 0 and farthest > 0):
        return 1.0
    wanted = FAR_MARGIN * farthest / reach
    if wanted >= 1.0 or reach <= OVERSIZE * farthest:
        return max(wanted, 1.0)
    extent = float(np.linalg.norm(np.ptp(far, axis=1)))
    across = ACROSS * float(np.linalg.norm(box.size)) / extent if extent > 0 else 1.0
    return min(max(wanted, across), 1.0)


def surface_place(camera, depsgraph, kind: str, index: int):
    """Matrix (camera space), parameters and points for a new surface at ``index`` of the list.

    Between two surfaces it lies half-way and has the mean size; at an end it
    goes on as the last two do.
    """
    slots = [slot.object for slot in camera.scfpf.surfaces]
    present = [obj if obj is not None and obj.name in depsgraph.scene.objects else None for obj in slots]
    before = present[index - 1] if index > 0 else None
    after = present[index] if index < len(present) else None
    to_camera = camera.matrix_world.inverted_safe()
    boxes = [
        None if obj is None else _box(_corners(obj.evaluated_get(depsgraph), to_camera @ obj.matrix_world))
        for obj in present
    ]
    if kind == "LATTICE":
        box = _room(boxes, index)
        return Matrix.Translation(Vector(box.centre)) @ Matrix.Diagonal((*box.size, 1.0)), None, None
    box = _between(boxes, index)
    if before is not None and before.scfpf_surface.kind == kind and kind in PARAMETRIC_KINDS:
        matrix = to_camera @ before.matrix_world
        shift = box.centre - boxes[index - 1].centre
        return (
            Matrix.Translation(Vector(shift)) @ matrix,
            _mean_parameters(before, after, depsgraph),
            None,
        )
    return _fill(kind, box)


def _between(boxes, index: int) -> Box:
    before = boxes[index - 1] if index > 0 else None
    after = boxes[index] if index < len(boxes) else None
    if before is not None and after is not None:
        return Box((before.low + after.low) / 2, (before.high + after.high) / 2)
    if before is None and after is None:
        return Box(np.array([-1.0, -1.0, -5.0]), np.array([1.0, 1.0, -5.0]))
    known, step = (before, -1) if before is not None else (after, 1)
    second = index - 2 if before is not None else index + 1
    other = boxes[second] if 0 <= second < len(boxes) else None
    if other is None:
        shift = np.array([0.0, 0.0, step * max(known.size.max(), 1.0)])
        return Box(known.low + shift, known.high + shift)
    centre = 2 * known.centre - other.centre
    half = np.maximum(2 * known.size - other.size, known.size / 2) / 2
    return Box(centre - half, centre + half)


def _room(boxes, index: int) -> Box:
    """A box with a depth, for a lattice: the middle third of the way between its neighbours.

    Where there is none on a side, the box reaches a third of its width to either side of ``_between``;
    of an empty list it is all of a volume.
    """
    middle = _between(boxes, index)
    around = [boxes[i] for i in (index - 1, index) if 0 <= i < len(boxes) and boxes[i] is not None]
    if not around:
        return Box(middle.low - NEW_DEPTH * FORWARDS, middle.high + NEW_DEPTH * FORWARDS)
    across = np.where(middle.size > 0, middle.size, 1.0) / 2
    depth = float(across.max()) / 3
    if len(around) == 2:
        depth = abs(float(around[1].centre[2] - around[0].centre[2])) / 6 or depth
    half = np.array([across[0], across[1], depth])
    return Box(middle.centre - half, middle.centre + half)


def _mean_parameters(before, after, depsgraph) -> dict:
    parameters = surface_parameters(before.evaluated_get(depsgraph))
    if after is not None and after.scfpf_surface.kind == before.scfpf_surface.kind:
        others = surface_parameters(after.evaluated_get(depsgraph))
        return {name: (value + others[name]) / 2 for name, value in parameters.items()}
    return parameters


def _fill(kind: str, box: Box):
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
