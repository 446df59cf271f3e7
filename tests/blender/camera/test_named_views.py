# SPDX-License-Identifier: GPL-3.0-or-later
"""Dimetric for Tiles and Attention: what they promise, measured in the picture."""

import bpy
import numpy as np
import pytest
from mathutils import Vector

SIZE = (640, 360)


def new_camera(kind="VIEW"):
    render = bpy.context.scene.render
    render.resolution_x, render.resolution_y = SIZE
    assert bpy.ops.scfpf.camera_add(preset=kind) == {"FINISHED"}
    bpy.context.view_layer.update()
    return bpy.context.object


def pixels_of(addon, camera, points):
    """Pixels (2, N) from the lower left at which the picture shows world points (N, 3)."""
    bpy.context.view_layer.update()
    depsgraph = bpy.context.evaluated_depsgraph_get()
    render = bpy.context.scene.render
    size = np.array([render.resolution_x, render.resolution_y])
    projection = addon("bridge.camera.read_projection").read_projection(camera, depsgraph, size[0] / size[1])
    found = addon("projection.volume.inverse").find_in_image(projection, np.asarray(points, float).T)
    assert found.found.all()
    return np.array([found.x, found.y]) * size[:, None]


@pytest.mark.parametrize(("tile", "side"), [(64, 1.0), (32, 2.0), (200, 0.25)])
@pytest.mark.parametrize("size", [(640, 360), (500, 500)])
def test_tiles_of_the_ground_have_their_size_in_pixels(addon, tile, side, size):
    bpy.ops.mesh.primitive_plane_add(size=4 * side, location=(20, 10, 3))
    camera = new_camera()
    bpy.context.scene.render.resolution_x, bpy.context.scene.render.resolution_y = size
    assert bpy.ops.scfpf.dimetric(tile=tile, side=side) == {"FINISHED"}
    middle = np.array([20.0, 10.0, 3.0])
    step = 0.5 * side
    places = pixels_of(
        addon, camera, middle + step * np.array([(0, 0, 0), (1, 0, 0), (0, 1, 0), (-1, 0, 0), (0, -1, 0)])
    )
    assert np.allclose(places[:, 0], np.array(size) / 2, atol=0.01)
    moved = places[:, 1:] - places[:, :1]
    # Half a tile's side along the ground goes a quarter of its width across, an eighth of it up or down.
    assert np.allclose(np.abs(moved[0]), tile / 4, atol=1e-3)
    assert np.allclose(np.abs(moved[1]), tile / 8, atol=1e-3)


def test_nothing_is_cut_off_from_a_large_scene(addon):
    for place in ((0, 0, 0), (300, 200, 0), (100, -200, 80)):
        bpy.ops.mesh.primitive_cube_add(size=2, location=place)
    camera = new_camera()
    bpy.context.scene.render.resolution_x, bpy.context.scene.render.resolution_y = 4000, 3000
    assert bpy.ops.scfpf.dimetric(tile=8) == {"FINISHED"}
    pixels_of(addon, camera, [(0, 0, 0), (300, 200, 0), (100, -200, 80)])


def ball(place, radius):
    bpy.ops.mesh.primitive_uv_sphere_add(segments=64, ring_count=32, radius=radius, location=place)
    return bpy.context.object


@pytest.mark.parametrize("factor", [1.2, 1.5, 3.0])
def test_what_is_attended_to_is_larger_and_the_border_stays(addon, factor):
    target = ball((0.3, 0.2, 0.0), 0.2)
    bpy.ops.mesh.primitive_plane_add(size=3)
    camera = new_camera()
    rim = [vertex.co + target.location for vertex in target.data.vertices]
    before = pixels_of(addon, camera, rim)
    target.select_set(True)
    assert bpy.ops.scfpf.attention(size=factor) == {"FINISHED"}
    after = pixels_of(addon, camera, rim)
    middle = (before.min(axis=1) + before.max(axis=1)) / 2
    assert np.allclose(after - middle[:, None], factor * (before - middle[:, None]), atol=0.02)
    lens = camera.scfpf.mappings[0]
    assert lens.name == "Attention" and camera.scfpf.active_mapping == 0
    # The rest fits around it: nothing is lost or twice in the picture.
    mapping = addon("projection.mappings.radial").MagicLens(lens.radius, lens.magnification, lens.falloff)
    distance = np.linspace(0, 2 * lens.radius, 2000)
    shown = distance * mapping.profile(distance).share
    assert (np.diff(shown) > 0).all()
    assert np.allclose(shown[distance >= lens.radius], distance[distance >= lens.radius])


def test_attention_needs_something_to_attend_to():
    bpy.ops.mesh.primitive_cube_add(size=1)
    camera = new_camera()
    with pytest.raises(RuntimeError, match="Select the things"):
        bpy.ops.scfpf.attention()
    behind = ball(camera.matrix_world @ Vector((0, 0, 50)), 1.0)
    bpy.context.view_layer.objects.active = camera
    behind.select_set(True)
    with pytest.raises(RuntimeError, match="does not show"):
        bpy.ops.scfpf.attention()
    assert len(camera.scfpf.mappings) == 0
