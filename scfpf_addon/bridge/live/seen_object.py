# SPDX-License-Identifier: GPL-3.0-or-later
"""The object that a viewport shows at a place of a flexible camera's frame, as a click selects it."""

from __future__ import annotations

from dataclasses import replace
from typing import NamedTuple

import numpy as np

from ...casting.common.ray_visibility import CAMERA
from ...projection.typing import Array
from ...shading.picking.seen import first_seen, may_be_met_in_layers
from ..camera.read_projection import read_projection
from ..layers.read_image_layers import read_image_layers
from ..render.render_engine import ENGINE
from ..render.render_viewport import Rectangle, camera_rectangle, viewport_eye
from ..scene.mesh_arrays import LARGEST_COORDINATE, MeshArrays, of_mesh, read_mesh, without_slots
from ..scene.read_materials import unmet_slots
from ..scene.read_visibility import ShownInRenders, flattened_copies
from .live_drawing import live_camera


class Place(NamedTuple):
    """A place in a camera's frame in a viewport.

    camera: the flexible one. x, y: shares of the frame from its lower left. frame: in pixels of the region.
    """

    camera: object
    x: float
    y: float
    frame: Rectangle


def shown_camera(context):
    """The flexible camera whose image the present viewport shows in the camera's frame, or None. Quick.

    Live View shows it, or the engine in Rendered shading.
    """
    space, view = context.space_data, context.region_data
    if space is None or space.type != "VIEW_3D":
        return None
    if space.shading.type != "RENDERED":
        return live_camera(context)
    if view is None or view.view_perspective != "CAMERA" or context.scene.render.engine != ENGINE:
        return None
    camera = space.camera if space.use_local_camera else context.scene.camera
    is_flexible = camera is not None and camera.type == "CAMERA" and camera.scfpf.enabled
    return camera if is_flexible else None


def place_at(context, event) -> Place | None:
    """The place of the pixel under the mouse in the frame of the ``shown_camera``; None outside."""
    camera = shown_camera(context)
    if camera is None:
        return None
    depsgraph = context.evaluated_depsgraph_get()
    eye = viewport_eye(context.space_data, depsgraph)
    frame = camera_rectangle(camera, depsgraph, context.region, context.region_data, eye)
    if frame is None:
        return None
    x = (event.mouse_region_x + 0.5 - frame.left) / frame.width
    y = (event.mouse_region_y + 0.5 - frame.bottom) / frame.height
    return Place(camera, x, y, frame) if 0.0 <= x <= 1.0 and 0.0 <= y <= 1.0 else None


def seen_object(context, place: Place):
    """The object of ``context.selectable_objects`` that is seen first at a place, None for none.

    Objects that cannot be selected do not hide others, as in Blender. An instance stands for the object
    that makes it. Raises USER_ERRORS.
    """
    depsgraph = context.evaluated_depsgraph_get()
    frame = place.frame
    projection = read_projection(place.camera, depsgraph, frame.width / frame.height)
    read = read_image_layers(place.camera, depsgraph, frame.width / frame.height)
    wanted = {obj.as_pointer(): obj for obj in context.selectable_objects}
    owners, boxes = _boxes(depsgraph, wanted)
    if not owners:
        return None
    layers = None
    if read.layers:
        projection = replace(projection, layers=read.layers)
        numbers = [read.members.get(wanted[owner].session_uid, 0) if owner else 0 for owner in owners]
        layers = np.array(numbers, np.uint8)
    met = may_be_met_in_layers(projection, place.x, place.y, boxes[:, 0], boxes[:, 1], layers)
    met &= np.array(owners) != 0
    meshes = _meshes(depsgraph, met)
    pixel = 1.0 / frame.width, 1.0 / frame.height
    own = None if layers is None else layers[met]
    first = first_seen(projection, meshes, place.x, place.y, pixel, own)
    return wanted[owners[np.flatnonzero(met)[first]]] if first >= 0 else None


def _boxes(depsgraph, wanted) -> tuple[list[int], Array]:
    """The address in ``wanted`` of each instance's owner, or 0, and its box, (N, 2, 3) in the world."""
    owners, corners, matrices, data = [], [], [], []
    renders = ShownInRenders(depsgraph)
    for instance in depsgraph.object_instances:
        obj, parent = instance.object, instance.parent
        owner = (parent or obj).original.as_pointer()
        is_shown = obj.type == "MESH" and renders.rays(obj, parent) & CAMERA
        is_seen = is_shown and owner in wanted
        owners.append(owner if is_seen else 0)
        # Objects that are not shown share no mesh.
        data.append(obj.data.as_pointer() if is_shown else -len(data))
        corners.append([tuple(corner) for corner in obj.bound_box] if is_seen else [(0.0, 0.0, 0.0)] * 8)
        matrices.append(np.array(instance.matrix_world, np.float64))
    matrix = np.array(matrices).reshape(-1, 4, 4)
    mesh = np.unique(np.array(data, np.int64), return_inverse=True)[1]
    for number in np.flatnonzero(flattened_copies(mesh, matrix)):
        owners[number] = 0
    with np.errstate(invalid="ignore", over="ignore"):
        placed = np.array(corners, np.float64).reshape(-1, 8, 3) @ matrix[:, :3, :3].swapaxes(1, 2)
        placed += matrix[:, None, :3, 3]
    return owners, np.stack([placed.min(axis=1), placed.max(axis=1)], axis=1)


def _meshes(depsgraph, wanted) -> list:
    """Vertices in the world and triangles of the instances that are ``wanted`` (N,), in order."""
    read: dict[tuple[int, frozenset[int]], MeshArrays] = {}
    placed = []
    for instance, is_wanted in zip(depsgraph.object_instances, wanted, strict=True):
        if not is_wanted:
            continue
        obj = instance.object
        unmet, slots = unmet_slots(obj), max(len(obj.material_slots), 1)
        key = obj.data.as_pointer(), unmet
        if key not in read:
            read[key] = without_slots(of_mesh(obj, read_mesh), unmet, slots)
        mesh, matrix = read[key], np.array(instance.matrix_world, np.float64)
        is_finite = bool((np.abs(matrix) <= LARGEST_COORDINATE).all())
        triangles = mesh.triangles if is_finite else mesh.triangles[:0]
        placed.append((mesh.vertices @ matrix[:3, :3].T + matrix[:3, 3], triangles))
    return placed
