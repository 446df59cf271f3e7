# SPDX-License-Identifier: GPL-3.0-or-later
"""Aim in 3D viewports: what a view's eye looks at, and from where pins are seen."""

from __future__ import annotations

import bpy
import gpu
import numpy as np
from gpu_extras.batch import batch_for_shader
from mathutils import Vector

from ...projection.typing import Array
from ...projection.user_error import UserError
from ..blender.draw_handler import DrawHandler
from ..camera.live_camera import chosen_camera
from ..overlays.image_marks import MARK, SHADER
from ..overlays.viewport_overlay import visible_cameras
from ..settings.aim_properties import PIN, VIEW
from .shown_targets import box_corners
from .target_views import target_objects, thing_box

# Display colour of targets that are not active.
QUIET = (0.75, 0.75, 0.75, 0.6)
LINE_WIDTH = 1.5
# The arrow of a pin in sizes of its empty: its length, and the length and half the width of its head.
ARROW, HEAD, HEAD_WIDTH = 3.0, 0.6, 0.25


def view_lines(target, depsgraph) -> Array:
    """The frame around a view's thing as its eye sees it, with lines to the eye, (2 N, 3) in the world.

    Raises UserError.
    """
    matrix = np.array(target.eye.evaluated_get(depsgraph).matrix_world.normalized(), np.float64)
    is_parallel = target.eye.type == "CAMERA" and target.eye.data.type == "ORTHO"
    corners = box_corners(*thing_box(target_objects(target), depsgraph))
    own = np.linalg.inv(matrix)[:3] @ np.concatenate([corners, np.ones((1, 8))])
    depth = float(own[2].mean())
    scale = np.ones(8) if is_parallel else depth / np.minimum(own[2], depth * 1e-3)
    if not is_parallel and depth >= 0.0:
        raise UserError("'{0}' looks away", target.eye.name)
    flat = own[:2] * scale
    (left, low), (right, high) = flat.min(axis=1), flat.max(axis=1)
    x, y = np.array([[left, right, right, left], [low, low, high, high]])
    frame = np.stack([x, y, np.full(4, depth)], axis=1)
    eye = np.stack([x, y, np.zeros(4)], axis=1) if is_parallel else np.zeros((4, 3))
    ends = [end for n in range(4) for end in (frame[n], frame[(n + 1) % 4], frame[n], eye[n])]
    placed: Array = np.array(ends) @ matrix[:3, :3].T + matrix[:3, 3]
    return placed


def pin_lines(handle) -> Array:
    """The arrow along the direction in which a pin is seen, (2 N, 3) in the world: it ends at the point."""
    size = handle.empty_display_size
    ends = [(0, 0, ARROW * size), (0, 0, 0)]
    for x, y in ((1, 0), (-1, 0), (0, 1), (0, -1)):
        ends += [(0, 0, 0), (HEAD_WIDTH * size * x, HEAD_WIDTH * size * y, HEAD * size)]
    return np.array([handle.matrix_world @ Vector(end) for end in ends])


def target_lines(target, depsgraph) -> Array | None:
    """The lines of a target in the scene, (2 N, 3), None if it has none."""
    if not target.is_on:
        return None
    if target.kind == VIEW and target.eye is not None:
        try:
            return view_lines(target, depsgraph)
        except (UserError, np.linalg.LinAlgError):
            return None  # the target's message says why
    if target.kind == PIN and target.handle is not None and target.use_direction:
        return pin_lines(target.handle)
    return None


def draw_viewport() -> None:
    """The draw handler: the targets of the cameras whose volumes a viewport shows."""
    context = bpy.context
    if chosen_camera(context) is not None:
        return  # They would hide what the camera shows.
    looking_through = context.region_data.view_perspective == "CAMERA"
    cameras = visible_cameras(context.scene, context.view_layer, context.space_data, looking_through)
    aimed = [camera for camera in cameras if len(camera.scfpf.aim_targets)]
    if not aimed:
        return
    depsgraph = context.evaluated_depsgraph_get()
    shader = gpu.shader.from_builtin(SHADER)
    gpu.state.blend_set("ALPHA")
    gpu.state.depth_test_set("LESS_EQUAL")
    shader.bind()
    shader.uniform_float("viewportSize", gpu.state.viewport_get()[2:])
    shader.uniform_float("lineWidth", LINE_WIDTH * context.preferences.system.pixel_size)
    for camera in aimed:
        for index, target in enumerate(camera.scfpf.aim_targets):
            lines = target_lines(target, depsgraph)
            if lines is not None:
                shader.uniform_float("color", MARK if index == camera.scfpf.active_aim else QUIET)
                batch_for_shader(shader, "LINES", {"pos": lines.astype(np.float32)}).draw(shader)
    gpu.state.depth_test_set("NONE")
    gpu.state.blend_set("NONE")


_draw_handler = DrawHandler(bpy.types.SpaceView3D, draw_viewport, "POST_VIEW")
register, unregister = _draw_handler.register, _draw_handler.unregister
