# SPDX-License-Identifier: GPL-3.0-or-later
"""A box before walls, views of it, and the control points of its camera."""

import math

import bpy
import numpy as np


def box_scene(scene):
    """A box on a floor before two walls, in the image of an ordinary camera."""
    scene.render.resolution_x, scene.render.resolution_y = 960, 540
    bpy.ops.mesh.primitive_plane_add(size=60)
    for name, place, size in (
        ("Box", (1.0, 0.0, 1.0), (1.5, 0.8, 1.0)),
        ("Left Wall", (-7, 6, 3), (0.5, 12, 3)),
        ("Back Wall", (0, 18, 4), (14, 0.5, 4)),
    ):
        bpy.ops.mesh.primitive_cube_add(location=place, scale=size)
        bpy.context.object.name = name
    bpy.ops.object.camera_add(location=(0, -12, 3), rotation=(math.radians(82), 0, 0))
    scene.camera = bpy.context.object
    scene.camera.data.clip_end = 60.0
    small_net(scene.camera)
    bpy.context.view_layer.update()
    return scene


def small_net(camera):
    """The smallest net: these tests are about Blender, not about the solver."""
    camera.scfpf.aim.columns, camera.scfpf.aim.rows, camera.scfpf.aim.degree = 8, 6, 2


def turned_view(scene, degrees=15.0, name="Box"):
    """A view of the box from farther to the left, not solved yet."""
    camera = scene.camera
    assert bpy.ops.scfpf.aim_view_add(camera=camera.name, object=name) == {"FINISHED"}
    assert bpy.ops.scfpf.aim_turn(camera=camera.name, left=math.radians(degrees)) == {"FINISHED"}
    bpy.context.view_layer.update()
    return camera


def solve(camera):
    return bpy.ops.scfpf.aim_solve(camera=camera.name)


def points_of(camera):
    """The control points of a camera's surfaces, from near to far."""
    found = []
    for slot in camera.scfpf.surfaces:
        points = slot.object.data.splines[0].points
        values = np.empty(4 * len(points), np.float32)
        points.foreach_get("co", values)
        found.append(values)
    return np.concatenate(found)
