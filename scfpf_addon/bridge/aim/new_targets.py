# SPDX-License-Identifier: GPL-3.0-or-later
"""New targets of Aim, with the cameras and empties that they are seen from and held by."""

from __future__ import annotations

import math
from typing import NamedTuple

import bpy
import numpy as np
from mathutils import Matrix, Vector

from ...aim.sight import free_turn
from ...aim.view_map import LocalEye, local_eye, orbit
from ...aim.views import seen_of
from ...projection.typing import Array
from ...projection.user_error import UserError
from ...projection.volume.inverse import find_in_image
from ...projection.volume.viewing_volume import Projection
from ..blender.scene_objects import delete_with_data, link_beside
from ..blender.slot_animation import AIM_TARGETS, remove_slot
from ..render.image_size import image_aspect
from ..settings.aim_properties import LINE, PIN, STAY, VIEW
from .read_problem import read_arrays
from .target_views import target_objects, thing_box, view_map

# A new eye's lens shows this much more than the thing.
EYE_MARGIN = 1.15
# The largest angle of its lens.
WIDEST_EYE = math.radians(120)
# The length of a handle's arrow, and of an eye's frame, as shares of the distance to the camera.
DRAWN_SIZE = 0.05
# The halo of a new view, in radii of its thing.
HALO = 1.5


def add_view(camera, depsgraph, projection: Projection, collection=None, obj=None, eye=None):
    """Add a view of a collection or an object, at the place and in the size that its image has.

    projection: of the camera, in world space. eye: the camera or empty that the view is seen from; by default
    a new camera that sees the thing as the image shows it. Returns the target. Raises UserError.
    """
    target = _new_target(camera, VIEW, (collection or obj).name)
    try:
        target.collection, target.object = collection, obj
        objects = target_objects(target)
        if not objects or camera in objects:
            raise UserError("'{0}' has no faces to show: choose objects that renders show", target.name)
        shown = shown_thing(camera, projection, objects, depsgraph)
        target.position = shown.position
        target.width = 2.0 * shown.radius / shown.seen.image_width
        target.halo = HALO * shown.radius
        target.eye = eye or framing_eye(camera, f"{target.name} View", shown)
    except UserError:
        remove_target(camera, len(camera.scfpf.aim_targets) - 1)
        raise
    return target


def _new_target(camera, kind: str, name: str):
    """Append a target to a camera's list and make it active."""
    settings = camera.scfpf
    taken = {target.name for target in settings.aim_targets}
    names = (name, *(f"{name} {number}" for number in range(2, len(taken) + 2)))
    target = settings.aim_targets.add()
    target.kind, target.name = kind, next(free for free in names if free not in taken)
    settings.active_aim = len(settings.aim_targets) - 1
    return target


class ShownThing(NamedTuple):
    """A thing as an image has it. position: (x, y) of its middle. seen: the straight camera that sees it so.

    centre: (3,), radius: of the sphere around it, in world space.
    """

    position: tuple[float, float]
    seen: LocalEye
    centre: Array
    radius: float


def shown_thing(camera, projection: Projection, objects: list, depsgraph) -> ShownThing:
    """Look up where and how the image of a camera has objects, hidden or not. Raises UserError."""
    low, high = thing_box(objects, depsgraph)
    centre, radius = (low + high) / 2, float(np.linalg.norm(high - low)) / 2
    x, y, seen = _seen_now(camera, projection, centre)
    return ShownThing((x, y), seen, centre, radius)


def _seen_now(camera, projection: Projection, point: Array) -> tuple[float, float, LocalEye]:
    """The image position of a world point (3,), and the straight camera that sees the point in the same way.

    A point outside the image is seen from the camera object, in the middle of the image.
    """
    place = find_in_image(projection, point[:, None])
    if place.found[0]:
        x, y = float(place.x[0]), float(place.y[0])
        return x, y, local_eye(projection, x, y, float(place.t[0]))
    return 0.5, 0.5, _looking_at(Vector(camera.matrix_world.translation), Vector(point))


def _looking_at(place: Vector, point: Vector) -> LocalEye:
    """An upright eye at a place that looks at a point."""
    way = point - place
    if way.length == 0.0:
        way = Vector((0.0, 1.0, 0.0))
    matrix = Matrix.Translation(place) @ way.to_track_quat("-Z", "Y").to_matrix().to_4x4()
    return LocalEye(np.array(matrix, np.float64), False, 2.0 * way.length)


def framing_eye(camera, name: str, shown: ShownThing, widen: float = 1.0):
    """A camera that sees a thing as the image does, whose lens frames the sphere around it.

    widen: factor of the frame's width.
    """
    seen, centre, radius = shown.seen, shown.centre, shown.radius
    data = bpy.data.cameras.new(name)
    eye = bpy.data.objects.new(data.name, data)
    eye.matrix_world = Matrix(seen.matrix.tolist())
    link_beside(eye, camera)
    own = np.linalg.inv(seen.matrix) @ np.array([*centre, 1.0])
    reach = float(np.linalg.norm(own[:3]))
    data.sensor_fit = "HORIZONTAL"
    if seen.is_parallel:
        data.type, data.ortho_scale = "ORTHO", 2.0 * radius * EYE_MARGIN * widen
        data.shift_x, data.shift_y = own[:2] / data.ortho_scale
    else:
        half = min(radius * EYE_MARGIN * widen / max(-own[2], 1e-6), math.tan(WIDEST_EYE / 2))
        data.angle = 2.0 * math.atan(half)
        data.shift_x, data.shift_y = own[:2] / max(-own[2], 1e-6) / (2.0 * half)
    data.display_size = max(reach * DRAWN_SIZE, 1e-3)
    data.clip_start = max(reach * 1e-3, 1e-6)
    data.clip_end = max(2.0 * (reach + radius), 10.0 * data.clip_start)
    return eye


def share_of_image(eye, shown: ShownThing) -> float:
    """The width of the frame of a ``framing_eye``, in widths of the image, in the plane of the thing."""
    depth = -float((np.linalg.inv(shown.seen.matrix) @ np.array([*shown.centre, 1.0]))[2])
    lens = eye.data
    width = lens.ortho_scale if lens.type == "ORTHO" else 2.0 * math.tan(lens.angle / 2.0) * depth
    return float(width) / shown.seen.image_width


def turn_to_free(target, depsgraph, way: float | None) -> bool:
    """Turn the eye of a view round its thing to the nearest direction in which nothing hides the thing.

    way: the direction of turns that comes first, radians from the left upwards; None for none. Returns
    whether there is one; the eye stays otherwise. Raises UserError, CastError.
    """
    arrays = read_arrays(depsgraph)
    shown = view_map(target, depsgraph, image_aspect(depsgraph.scene))
    own = arrays.triangles_of(target_objects(target))
    points = seen_of(arrays.scene, own, shown).points
    turn = None if way is None else free_turn(arrays.scene, ~own, shown, points, way)
    turn = turn or free_turn(arrays.scene, ~own, shown, points)
    if turn is None:
        return False
    turn_eye(target, depsgraph, *turn)
    return True


def add_pin(
    camera, point: Array, position: tuple[float, float], direction: Array | None = None, name: str = "Pin"
):
    """Add a pin that shows a world point (3,) at an image position.

    direction: (3,), in which the point shall be seen, None for any. Returns the target.
    """
    target = _new_target(camera, PIN, name)
    handle = bpy.data.objects.new(name, None)
    reach = (Vector(point) - camera.matrix_world.translation).length
    handle.empty_display_size = max(reach * DRAWN_SIZE, 1e-3)
    handle.empty_display_type = "PLAIN_AXES" if direction is None else "SINGLE_ARROW"
    turn = Matrix.Identity(4)
    if direction is not None:
        turn = Vector(direction).to_track_quat("-Z", "Y").to_matrix().to_4x4()
    handle.matrix_world = Matrix.Translation(Vector(point)) @ turn
    link_beside(handle, camera)
    target.handle, target.position = handle, position
    target.use_direction, target.halo = direction is not None, reach * DRAWN_SIZE
    return target


def add_line(camera, first, second):
    """Add a straight line between the handles of two pins. Returns the target. Raises UserError."""
    handles = [target.handle for target in camera.scfpf.aim_targets if target.kind == PIN]
    if first == second or not {first, second} <= set(handles):
        raise UserError("A straight line needs two pins: choose the handles of two different ones")
    target = _new_target(camera, LINE, f"{first.name} to {second.name}")
    target.first, target.second = first, second
    return target


def add_stay(camera, collection=None, obj=None, mask=None):
    """Add a region that stays: a collection, an object or a painted image. Returns the target."""
    target = _new_target(camera, STAY, (collection or obj or mask).name)
    target.collection, target.object, target.mask = collection, obj, mask
    target.halo = 0.0
    return target


def remove_target(camera, index: int) -> None:
    """Remove a target, with its animation, and the handle of a pin if no other target uses it.

    The camera of a view stays: it may be in use. Raises UserError.
    """
    targets = camera.scfpf.aim_targets
    if not 0 <= index < len(targets):
        raise UserError("'{0}' has no target at place {1}", camera.name, index + 1)
    handle = targets[index].handle if targets[index].kind == PIN else None
    remove_slot(camera.scfpf, index, AIM_TARGETS)
    if handle is not None and handle.is_editable:
        used = [
            t
            for o in bpy.data.objects
            for t in o.scfpf.aim_targets
            if handle in (t.handle, t.first, t.second)
        ]
        if not used and not handle.children:
            delete_with_data(handle)


def turn_eye(target, depsgraph, left: float, up: float, start: Matrix | None = None) -> None:
    """Move the eye of a view round its thing: radians to its own left, and up. Raises UserError.

    start: the eye's matrix from which it moves, by default its present one.
    """
    eye = target.eye
    if eye is None or not eye.is_editable:
        raise UserError(
            "The view '{0}' has no camera that can be turned: choose one under Seen From", target.name
        )
    low, high = thing_box(target_objects(target), depsgraph)
    world = np.array(eye.matrix_world if start is None else start, np.float64)
    eye.matrix_world = Matrix((orbit(world, (low + high) / 2, left, up) @ world).tolist())
