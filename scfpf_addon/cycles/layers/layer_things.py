# SPDX-License-Identifier: GPL-3.0-or-later
"""The things of an image's layers as a render evaluates them: their bounds, and the objects of each layer."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field

import numpy as np

from ...bridge.blender import versions
from ...bridge.scene.instances import NO_THINGS, MeshTable, instances, is_finite
from ...bridge.scene.mesh_arrays import read_mesh
from ...bridge.scene.read_visibility import ShownInRenders, has_hair
from ...casting.common.ray_visibility import CAMERA
from ...casting.layers.layer_parts import DIRECTIONS, Box, Hull
from ...projection.typing import Array
from ..seen_data import materials_of
from ..skipping.reasons import displaces


@dataclass
class Things:
    """The things of one layer.

    points: (3, N) blocks, world space, with the bounds of the things. is_open: whether Cycles may show them
    beyond these.
    """

    points: list[Array] = field(default_factory=list)
    is_open: bool = False

    @property
    def bounds(self) -> tuple[Box, Hull] | None:
        """The box and the hull around the points, None without any."""
        if not self.points:
            return None
        points = np.concatenate(self.points, axis=1)
        return Box.around(points), Hull.around(points)


@dataclass
class FoundThings:
    """The things that renders show, by layer.

    by_layer: the things of each layer that has some. boxes: around the objects of layer 0, by session id of
    the object or of its instancer.
    """

    by_layer: dict[int, Things] = field(default_factory=dict)
    boxes: dict[int, list[Array]] = field(default_factory=dict)


def find_things(depsgraph, members: Mapping[int, int], with_rest: bool) -> FoundThings:
    """Find the things of layers from 1 on. members: see ``ReadLayers``. with_rest: boxes of layer 0."""
    found, scene = FoundThings(), depsgraph.scene_eval
    meshes = MeshTable(_used_points)
    # By address of the data.
    corners: dict[int, Array] = {}
    for instance in instances(depsgraph, renders=ShownInRenders(depsgraph)):
        obj, owner = instance.obj, instance.key.owner_uid
        if obj.type in NO_THINGS or not instance.rays & CAMERA:
            continue
        # Cycles shows an instance in the layer of what makes it, whatever layer the object is in.
        number = members.get(owner, 0)
        if not number and not with_rest:
            continue
        matrix = instance.matrix
        if not is_finite(matrix):
            continue
        if number and obj.type == "MESH":
            points = meshes.of(instance)
        else:
            address = instance.data
            if address not in corners:
                corners[address] = np.array(obj.bound_box, np.float64).T
            points = corners[address]
        if not points.shape[1]:
            continue
        placed = matrix[:3, :3] @ points + matrix[:3, 3:]
        if number:
            things = found.by_layer.setdefault(number, Things())
            things.points.append(_extremes(placed))
            things.is_open = things.is_open or _is_open(obj, scene)
        else:
            found.boxes.setdefault(owner, []).append(placed)
    return found


def _used_points(mesh) -> Array:
    """The vertices (3, N) of an evaluated mesh's triangles."""
    arrays = read_mesh(mesh)
    points: Array = arrays.vertices[np.unique(arrays.triangles)].astype(np.float64).T
    return points


def _extremes(points: Array) -> Array:
    """The points, of (3, N), N > 0, that reach farthest in one of DIRECTIONS."""
    heights = [direction @ points for direction in DIRECTIONS]
    ends = {int(end) for each in heights for end in (each.argmin(), each.argmax())}
    return points[:, sorted(ends)]


def _is_open(obj, scene) -> bool:
    """Return whether Cycles may show an object beyond its mesh: hair, points, volumes, displacement."""
    if obj.type != "MESH" or has_hair(obj):
        return True
    subdivided = (each for each in obj.modifiers if each.type == "SUBSURF" and each.show_render)
    if any(versions.is_subdivided_adaptively(each, obj, scene) for each in subdivided):
        return True
    return any(displaces(material) for material in materials_of(obj))
