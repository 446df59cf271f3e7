# SPDX-License-Identifier: GPL-3.0-or-later
"""Presets against Blender's own camera, moved for every column of a strip, or before a sheared scene."""

import bpy
import numpy as np
import pytest
from bpy_extras.object_utils import world_to_camera_view
from mathutils import Matrix, Vector

# Blender's matrices are float32; of lengths of some tens.
FLOAT32 = 2e-6
PLACE = Matrix.Translation((0.4, -0.6, 0.3)) @ Matrix.Rotation(0.7, 4, "Z") @ Matrix.Rotation(1.2, 4, "X")


@pytest.fixture
def shown(addon):
    """A preset's projection in world space, for a camera at a place."""
    presets, folder = addon("projection.presets.preset"), addon("operators.camera.presets").FOLDER

    def read(name, aspect=None):
        preset = presets.read_preset(folder / f"{name}.json")
        return preset.projection(aspect or preset.aspect).transformed(np.array(PLACE, np.float64))

    return read


def ordinary(width, height, **lens):
    scene = bpy.context.scene
    scene.render.resolution_x, scene.render.resolution_y = width, height
    scene.render.resolution_percentage = 100
    data = bpy.data.cameras.new("Camera")
    for name, value in lens.items():
        setattr(data, name, value)
    camera = scene.camera = bpy.data.objects.new("Camera", data)
    scene.collection.objects.link(camera)
    return camera


def test_the_strip_is_what_a_camera_sees_that_is_moved_column_by_column(addon, shown):
    """First hits of a strip, against rays that Blender casts through the middle column of a moved camera."""
    for k in range(12):
        bpy.ops.mesh.primitive_uv_sphere_add(segments=16, ring_count=10)
        bpy.context.object.matrix_world = (
            PLACE @ Matrix.Translation((2 * np.sin(k), 1.3 * np.cos(3 * k), -10 + 2 * np.cos(k)))
        ) @ Matrix.Diagonal((0.7, 0.4, 0.5, 1))
    bpy.context.view_layer.update()
    depsgraph = bpy.context.evaluated_depsgraph_get()
    geometry = addon("bridge.scene.read_scene").read_scene(depsgraph).geometry
    cast_scene = addon("casting.scene.cast_scene").CastScene(geometry.vertices, geometry.triangles)
    width, height, projection = 48, 16, shown("strip_camera", 3.0)
    hits = addon("casting.frame").cast_frame(cast_scene, projection, width, height, 0.1)
    corners = geometry.vertices[geometry.triangles[hits.triangle]]
    second, third = hits.barycentric
    met = np.einsum("kn,nkc->nc", np.stack([1 - second - third, second, third]), corners)
    met, hit = met.reshape(height, width, 3), (hits.triangle >= 0).reshape(height, width)
    camera = ordinary(100, 100, sensor_fit="VERTICAL", sensor_height=18.0, lens=36.0)
    top, wrong = camera.data.view_frame(scene=bpy.context.scene)[0], 0
    for column in range(width):
        angle = np.pi * (2 * (column + 0.5) / width - 1)
        # On a circle of 10 round the point 10 in front, turned to its middle.
        around = Matrix.Translation((0, 0, -10)) @ Matrix.Rotation(angle, 4, "Y")
        camera.matrix_world = PLACE @ around @ Matrix.Translation((0, 0, 10))
        eye, turned = camera.matrix_world.translation, camera.matrix_world.to_3x3()
        for row in range(height):
            way = turned @ Vector((0.0, (2 * (row + 0.5) / height - 1) * top.y, top.z))
            # To where the strip's projectors end, a little before the axis.
            reach = 9.8 * way.length / -top.z
            found, where, *_ = bpy.context.scene.ray_cast(depsgraph, eye, way, distance=reach)
            if not (found and hit[row, column]):
                wrong += found != hit[row, column]
            elif (where - Vector(met[row, column])).length > 1e-4:
                wrong += 1
    assert hit.sum() > 120 and wrong == 0


def test_oblique_is_blender_s_orthographic_camera_before_a_sheared_scene(shown):
    """A cabinet drawing: depth goes half as long to the upper right, at 45 degrees."""
    x, y, t = np.random.default_rng(2).random((3, 200))
    projection = shown("oblique")
    points = projection.volume.evaluate(x, y, t).position
    inward = np.linalg.inv(np.array(PLACE, np.float64))
    px, py, pz = inward[:3, :3] @ points + inward[:3, 3:]
    slant = 0.5 * np.sqrt(0.5)
    middle = projection.volume.evaluate(np.full(2, 0.5), np.full(2, 0.5), np.array([0.0, 1.0])).position
    middle = inward[:3, :3] @ middle + inward[:3, 3:]
    near = -middle[2, 0]
    sheared = np.stack(
        [px - middle[0, 0] + slant * (-pz - near), py - middle[1, 0] + slant * (-pz - near), pz]
    )
    camera = ordinary(1600, 900, type="ORTHO")
    left, right = projection.volume.evaluate(np.array([0.0, 1.0]), np.full(2, 0.5), np.zeros(2)).position.T
    camera.data.ortho_scale = np.linalg.norm(right - left)
    bpy.context.view_layer.update()
    seen = np.array([world_to_camera_view(bpy.context.scene, camera, Vector(p)) for p in sheared.T])
    assert np.abs(seen[:, 0] - x).max() < FLOAT32 and np.abs(seen[:, 1] - y).max() < FLOAT32
