# SPDX-License-Identifier: GPL-3.0-or-later
"""The placement of a new camera, and of a preset's volume in a scene."""

import math

import bpy
import numpy as np
from mathutils import Matrix, Vector

from ..common.scene_box import SceneBox, SceneBoxes, transformed

# Objects may come this much nearer to a new camera before the near surface clips them.
NEAR_SHARE = 0.25
# The far surface of a new camera lies at this multiple of the farthest object's distance.
FAR_MARGIN = 1.25
# The least reach of the volume from within a scene, as a share of the scene's diagonal.
INSIDE_SHARE = 0.5
# The greatest distance of the near surface, as a share of the farthest object's, unless all are farther.
LEAST_SHARE = 0.01
# A preset whose far surface is more than this many times farther off than the scene's end is scaled down.
OVERSIZE = 10.0
# Its far diagonal keeps at least this multiple of the scene's: parallel projectors see no more. Inside the
# scene it does not, as the near surface would lie behind everything.
ACROSS = 2.0
# Without a viewport the camera looks from here, as Blender's default view does.
DEFAULT_DIRECTION = Vector((0.8, -1.0, 0.55)).normalized()
DEFAULT_MARGIN = 1.1


def camera_like_view(context, aspect: float):
    """New camera data and world matrix of the 3D viewport's view, or None without a viewport.

    The image is the largest of its aspect that fits inside the region.
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


def camera_seeing(box: SceneBox, aspect: float):
    """New camera data and a world matrix that see the whole box."""
    data = bpy.data.cameras.new("Flexible Camera")
    # A single point is framed like Blender's default cube.
    radius = float(np.linalg.norm(box.size)) / 2 or math.sqrt(3.0)
    half_width = data.sensor_width / (2 * data.lens) * min(1.0, aspect)
    narrower = math.atan(min(half_width, half_width / aspect))
    distance = DEFAULT_MARGIN * radius / math.sin(narrower)
    rotation = DEFAULT_DIRECTION.to_track_quat("Z", "Y").to_matrix().to_4x4()
    return data, Matrix.Translation(Vector(box.centre) + distance * DEFAULT_DIRECTION) @ rotation


def fit_depth(data, matrix, boxes: SceneBoxes):
    """Set the clip range so that near and far surface enclose the part of the scene in front of the camera.

    Inside the scene, or looking away from it, the far surface is about as far off as the scene is large.
    Returns the world matrix, moved back for an orthographic camera among the scene's things.
    """
    depths = -transformed(matrix.inverted(), boxes.things.corners)[:, 2]
    least = min(
        data.clip_start, LEAST_SHARE * max(float(depths.max()), float(np.linalg.norm(boxes.things.size)))
    )
    if data.type == "ORTHO":
        # Parallel projectors see the same from any distance.
        back = max(0.0, NEAR_SHARE * float(np.ptp(depths)) + least - float(depths.min()))
        matrix = matrix @ Matrix.Translation((0.0, 0.0, back))
    whole = -transformed(matrix.inverted(), boxes.whole.corners)[:, 2]
    data.clip_start = max(least, NEAR_SHARE * float(whole.min()))
    farthest = max(float(whole.max()), INSIDE_SHARE * float(np.linalg.norm(boxes.whole.size)))
    data.clip_end = max(FAR_MARGIN * farthest, data.clip_start / NEAR_SHARE)
    return matrix


def around_subject(subject, box: SceneBox):
    """World matrix and scale of an upright camera that map its preset's subject to ``box``.

    subject: centre and size in camera space. The camera looks along world Y or -X, whichever matches the
    box's longer side with the subject's.
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


def reaching_scale(volume, matrix, box: SceneBox) -> float:
    """The scale of a preset's volume (camera space) that puts its far surface behind the box.

    It is 1 for a volume that reaches farther. Only a box tiny beside the volume, whose near surface might lie
    behind it, gives less; the far surface then stays larger than a box that is seen from outside.
    """
    ends = np.array([0.0, 0.5, 1.0])
    u, v = (grid.ravel() for grid in np.meshgrid(ends, ends))
    far = volume.surfaces[-1].evaluate(u, v).position
    reach = float(np.linalg.norm(far, axis=0).min())
    farthest = float(np.linalg.norm(transformed(matrix.inverted_safe(), box.corners), axis=1).max())
    if not (reach > 0 and farthest > 0):
        return 1.0
    wanted = FAR_MARGIN * farthest / reach
    if wanted >= 1.0 or reach <= OVERSIZE * farthest:
        return max(wanted, 1.0)
    extent = float(np.linalg.norm(np.ptp(far, axis=1)))
    across = ACROSS * float(np.linalg.norm(box.size)) / extent if extent > 0 else 1.0
    eye = np.array(matrix.translation, np.float64)
    is_inside = bool(((box.low <= eye) & (eye <= box.high)).all())
    return min(wanted if is_inside else max(wanted, across), 1.0)


def reaching_depth(volume, matrix, scale: float, box: SceneBox) -> float:
    """The factor, at least 1, by which a preset's projectors grow so that they end behind the box.

    volume: in camera space, before ``scale``. It is 1 for a volume without a ``similarity_of_ends``, whose
    projectors would bend or turn.
    """
    ends = volume.similarity_of_ends()
    if ends is None or not 0.0 <= ends[0] <= 1.0:
        return 1.0
    line = np.linspace(0.0, 1.0, 3)
    u, v = (grid.ravel() for grid in np.meshgrid(line, line))
    near, far = (surface.evaluate(u, v).position for surface in volume.surfaces)
    length = float(np.linalg.norm(far - near, axis=0).min()) * scale
    farthest = float(np.linalg.norm(transformed(matrix.inverted_safe(), box.corners), axis=1).max())
    return max(1.0, FAR_MARGIN * farthest / length) if length > 0 else 1.0
