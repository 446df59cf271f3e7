# SPDX-License-Identifier: GPL-3.0-or-later
"""The object that a viewport shows at a place of a flexible camera's frame, as a click selects it."""

from __future__ import annotations

from collections.abc import Collection
from dataclasses import replace
from itertools import compress
from typing import NamedTuple

import numpy as np

from ...casting.common.ray_visibility import CAMERA
from ...projection.typing import Array, BoolArray
from ...shading.picking.seen import first_seen, may_be_met_in_layers
from ..camera.live_camera import live_camera
from ..camera.read_projection import read_projection
from ..layers.read_image_layers import read_image_layers
from ..render.render_engine import ENGINE
from ..render.render_viewport import Rectangle, camera_rectangle, viewport_eye
from ..scene.instances import MeshTable, copies_shown, instances
from ..scene.mesh_arrays import read_mesh, without_slots
from ..scene.read_materials import unmet_slots, volume_only_materials
from ..scene.read_visibility import ObjectKey, ShownInRenders


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
    wanted = {obj.session_uid: obj for obj in context.selectable_objects}
    renders = ShownInRenders(depsgraph)
    keys, may_be_seen, boxes = _boxes(depsgraph, renders, wanted)
    if not keys:
        return None
    layers = None
    if read.layers:
        projection = replace(projection, layers=read.layers)
        layers = np.array([key.image_layer(read.members) for key in keys], np.uint8)
    met = may_be_met_in_layers(projection, place.x, place.y, boxes[:, 0], boxes[:, 1], layers)
    met &= may_be_seen
    meshes = _meshes(depsgraph, renders, met)
    pixel = 1.0 / frame.width, 1.0 / frame.height
    own = None if layers is None else layers[met]
    first = first_seen(projection, meshes, place.x, place.y, pixel, own)
    return wanted[keys[np.flatnonzero(met)[first]].owner_uid] if first >= 0 else None


def _boxes(
    depsgraph, renders: ShownInRenders, wanted: Collection[int]
) -> tuple[list[ObjectKey], BoolArray, Array]:
    """The key of each mesh's instance, whether it may be seen, (N,), and its box in the world, (N, 2, 3).

    wanted: the session ids of owners.
    """
    keys, may_be_seen, corners, matrices, data = [], [], [], [], []
    known: dict[int, list] = {}
    for instance in instances(depsgraph, {"MESH"}, renders):
        keys.append(instance.key)
        may_be_seen.append(bool(instance.rays & CAMERA) and instance.key.owner_uid in wanted)
        matrices.append(instance.matrix)
        data.append(instance.data)
        if data[-1] not in known:
            known[data[-1]] = [tuple(corner) for corner in instance.obj.bound_box]
        corners.append(known[data[-1]])
    matrix = np.array(matrices).reshape(-1, 4, 4)
    with np.errstate(invalid="ignore", over="ignore"):
        placed = np.array(corners, np.float64).reshape(-1, 8, 3) @ matrix[:, :3, :3].swapaxes(1, 2)
        placed += matrix[:, None, :3, 3]
    boxes = np.stack([placed.min(axis=1), placed.max(axis=1)], axis=1)
    return keys, np.array(may_be_seen, bool) & copies_shown(data, matrices), boxes


def _meshes(depsgraph, renders: ShownInRenders, met: BoolArray) -> list:
    """Vertices in the world and triangles of the instances that are ``met`` (N,), in order."""
    meshes = MeshTable(read_mesh)
    placed, volume_only = [], volume_only_materials()
    for instance in compress(instances(depsgraph, {"MESH"}, renders), met):
        slots = max(len(instance.obj.material_slots), 1)
        mesh = without_slots(meshes.of(instance), unmet_slots(instance.obj, volume_only), slots)
        matrix = instance.matrix
        placed.append((mesh.vertices @ matrix[:3, :3].T + matrix[:3, 3], mesh.triangles))
    return placed
