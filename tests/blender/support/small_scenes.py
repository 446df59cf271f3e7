# SPDX-License-Identifier: GPL-3.0-or-later
"""Small scenes to be read, and what was read of them."""

import bpy
import numpy as np


def link(name, data, collection=None):
    obj = bpy.data.objects.new(name, data)
    (collection or bpy.context.scene.collection).objects.link(obj)
    return obj


def cube_mesh(name="Cube"):
    bpy.ops.mesh.primitive_cube_add()
    obj = bpy.context.object
    mesh = obj.data
    mesh.name = name
    bpy.data.objects.remove(obj)
    return mesh


def triangle_mesh(points=((0, 0, 0), (1, 0, 0), (0, 1, 0))):
    mesh = bpy.data.meshes.new("Triangle")
    mesh.from_pydata(points, [], [(0, 1, 2)])
    return mesh


def triangles_of(scene, name):
    geometry = scene.geometry
    return np.flatnonzero(geometry.object_index == geometry.object_names.index(name))


def corners(scene, which):
    """Positions (T, 3, 3) of triangles' corners."""
    return scene.geometry.vertices[scene.geometry.triangles[which]]


def shown(scene):
    """Names of the objects that projectors meet."""
    geometry = scene.geometry
    seen = slice(None) if geometry.visibility is None else (geometry.visibility & 1) != 0
    return set(np.array(geometry.object_names)[np.unique(geometry.object_index[seen])])
