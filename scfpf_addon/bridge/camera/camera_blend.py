# SPDX-License-Identifier: GPL-3.0-or-later
"""A third camera between two others: its surfaces are grids with two shapes, mixed by one animatable factor.

The shapes are shape keys and drivers mix them, so that it all lives in the file and needs no Python.
"""

from __future__ import annotations

import bpy
import numpy as np

from ...projection.editing.blending import Blend
from ..blender.mesh_grid import write_grid
from ..blender.scene_objects import link_beside

# How far beyond its two cameras a blend goes.
SMALLEST_BLEND, LARGEST_BLEND = -2.0, 3.0
FIRST_KEY, SECOND_KEY = "First Camera", "Second Camera"
FACTOR_PATH = "scfpf.blend_factor"


def is_blend(camera) -> bool:
    """Whether a camera's near surface has the two shapes of a blend."""
    slots = camera.scfpf.surfaces
    near = slots[0].object if len(slots) else None
    keys = near.data.shape_keys if near is not None and near.type == "MESH" else None
    return keys is not None and SECOND_KEY in keys.key_blocks


def knows_its_ends(camera) -> bool:
    """Whether it is known what a camera's blend goes between."""
    ends = camera.scfpf.blend_ends
    return ends.first is not None and (ends.second is not None or bool(ends.preset))


def new_blend_camera(first, name: str):
    """A camera where another is, without surfaces, linked where that is."""
    camera = bpy.data.objects.new(name, first.data.copy())
    camera.matrix_world = first.matrix_world
    link_beside(camera, first)
    bpy.context.view_layer.update()
    if camera.name not in bpy.context.view_layer.objects:
        # The scene's camera may be in a collection that is excluded; the blend is to be seen.
        bpy.context.scene.collection.objects.link(camera)
    return camera


def give_shapes(camera, blend: Blend) -> None:
    """Give each surface of a camera, which are grids in the order of a blend's layers, its second shape."""
    for slot, layer in zip(camera.scfpf.surfaces, blend.layers, strict=True):
        surface = slot.object
        write_grid(surface.data, layer[0])
        surface.shape_key_add(name=FIRST_KEY, from_mix=False)
        key = surface.shape_key_add(name=SECOND_KEY, from_mix=False)
        key.slider_min, key.slider_max = SMALLEST_BLEND, LARGEST_BLEND
        _drive(key, camera)
    write_shapes(camera, blend)


def has_room(camera, blend: Blend) -> bool:
    """Whether the surfaces of a blend can take another one's shapes as they are: as many, of as many points.

    Layers are square grids, so that the number of points tells the rows.
    """
    slots = camera.scfpf.surfaces
    if len(slots) != len(blend.layers):
        return False
    for slot, layer in zip(slots, blend.layers, strict=True):
        own = slot.object is not None and slot.object.type == "MESH" and slot.object.parent == camera
        mesh = slot.object.data if own else None
        keys = mesh.shape_keys if mesh is not None else None
        if keys is None or not {FIRST_KEY, SECOND_KEY} <= set(keys.key_blocks.keys()):
            return False
        if len(mesh.vertices) != layer[0].shape[0] * layer[0].shape[1]:
            return False
    return True


def write_shapes(camera, blend: Blend) -> None:
    """Write both shapes of each surface of a blend that ``has_room``; keys, drivers and objects stay."""
    for slot, layer in zip(camera.scfpf.surfaces, blend.layers, strict=True):
        surface = slot.object
        first, second = (shape.reshape(-1, 3).astype(np.float32).ravel() for shape in layer)
        surface.data.vertices.foreach_set("co", first)
        for name, points in ((FIRST_KEY, first), (SECOND_KEY, second)):
            surface.data.shape_keys.key_blocks[name].data.foreach_set("co", points)
        # Placed as they were made: the points are in the camera's space.
        surface.matrix_parent_inverse.identity()
        surface.matrix_basis.identity()
        surface.data.update()


def _drive(key, camera) -> None:
    """Let the second shape's value be the camera's factor."""
    driver = key.driver_add("value").driver
    driver.type = "AVERAGE"
    variable = driver.variables.new()
    variable.type = "SINGLE_PROP"
    target = variable.targets[0]
    target.id = camera
    target.data_path = FACTOR_PATH
    # Without the add-on the file has no such property.
    target.use_fallback_value = True
    target.fallback_value = 0.5
