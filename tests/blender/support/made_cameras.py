# SPDX-License-Identifier: GPL-3.0-or-later
"""Cameras and volumes of a few surfaces for tests, and what the volume object takes."""

import bpy
from mathutils import Matrix


def new_camera(name="Camera", scene=None):
    camera = bpy.data.objects.new(name, bpy.data.cameras.new(name))
    (scene or bpy.context.scene).collection.objects.link(camera)
    return camera


def names(camera):
    return [slot.object.name if slot.object else None for slot in camera.scfpf.surfaces]


def taken(camera):
    """Names of what the volume object's modifier takes."""
    modifier = camera.scfpf.volume_object.modifiers[0]
    sockets = [i.identifier for i in modifier.node_group.interface.items_tree if i.in_out == "INPUT"]
    inputs = modifier.properties.inputs if bpy.app.version >= (5, 2, 0) else None
    values = [getattr(inputs, i).value if inputs else modifier[i] for i in sockets]
    return [value.name if value else None for value in values]


def read(reading, camera, scene=None, aspect=1.0):
    layer = (scene or bpy.context.scene).view_layers[0]
    with bpy.context.temp_override(scene=scene or bpy.context.scene, view_layer=layer):
        return reading.read_projection(camera, bpy.context.evaluated_depsgraph_get(), aspect)


def three_surfaces(bridge, camera):
    bridge.make_flexible(camera)
    return [
        bridge.add_surface(camera, kind, name, Matrix.Translation((0, 0, -depth)))
        for kind, name, depth in (("PLANE", "A", 1), ("DISC", "B", 2), ("GRID", "C", 3))
    ]
