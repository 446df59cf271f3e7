# SPDX-License-Identifier: GPL-3.0-or-later
"""New cameras and presets are fitted to a scene's things, whatever ground or dome is around them."""

import math

import bmesh
import bpy
import numpy as np
import pytest

WIDTH, HEIGHT = 192, 108
# The height of the ground, below all that the scene shows otherwise.
GROUND = -2.0


def add_mesh(name, build, place=(0, 0, 0), collection=None):
    mesh, shape = bpy.data.meshes.new(name), bmesh.new()
    build(shape)
    shape.to_mesh(mesh)
    shape.free()
    obj = bpy.data.objects.new(name, mesh)
    obj.location = place
    (collection or bpy.context.scene.collection).objects.link(obj)
    return obj


def cube(shape):
    bmesh.ops.create_cube(shape, size=1.0)


def add_things():
    """Three cubes, the last one only by an instance of a collection."""
    add_mesh("One", cube)
    add_mesh("Two", cube, (2, 5, 1))
    held = bpy.data.collections.new("Held")
    add_mesh("Three", cube, (0, 0, 0.5), held)
    empty = bpy.data.objects.new("Instance", None)
    empty.instance_type, empty.instance_collection, empty.location = "COLLECTION", held, (-2, 3, 0)
    bpy.context.scene.collection.objects.link(empty)


def add_ground(size):
    return add_mesh("Ground", lambda s: bmesh.ops.create_grid(s, size=size / 2), (0, 0, GROUND))


def add_dome(size):
    build = bmesh.ops.create_uvsphere
    return add_mesh("Dome", lambda s: build(s, u_segments=32, v_segments=16, radius=size / 2))


BACKGROUNDS = {
    "ground of 100 m": [(add_ground, 1e2)],
    "ground of 1 km": [(add_ground, 1e3)],
    "ground of 1000 km": [(add_ground, 1e6)],
    "dome of 1 km": [(add_dome, 1e3)],
    "dome and ground": [(add_dome, 1e5), (add_ground, 1e4)],
    "ground as large as the dome": [(add_dome, 1e3), (add_ground, 1e3)],
}


def seen(addon, camera):
    """Which pixels show a cube, and which show anything, each (H, W)."""
    depsgraph = bpy.context.evaluated_depsgraph_get()
    projection = addon("bridge.camera.read_projection").read_projection(camera, depsgraph, WIDTH / HEIGHT)
    geometry = addon("bridge.scene.read_scene").read_scene(depsgraph).geometry
    scene = addon("casting.scene.cast_scene").CastScene(geometry.vertices, geometry.triangles)
    triangle = addon("casting.frame").cast_frame(scene, projection, WIDTH, HEIGHT).triangle
    corners = np.asarray(geometry.vertices)[np.asarray(geometry.triangles)]
    size = np.linalg.norm(np.ptp(corners, axis=1), axis=1)
    hit = triangle >= 0
    is_cube = np.zeros(triangle.shape, bool)
    is_cube[hit] = size[triangle[hit]] < 1.5
    return is_cube.reshape(HEIGHT, WIDTH), hit.reshape(HEIGHT, WIDTH)


def add_camera(preset):
    bpy.context.scene.render.resolution_x, bpy.context.scene.render.resolution_y = WIDTH, HEIGHT
    assert bpy.ops.scfpf.camera_add(preset=preset) == {"FINISHED"}
    bpy.context.view_layer.update()
    return bpy.context.object


@pytest.mark.parametrize("name", BACKGROUNDS)
@pytest.mark.parametrize(
    "preset",
    ["VIEW", "perspective", "cylindrical_panorama", "linear_twist", "inverted_perspective", "military"],
)
def test_a_background_changes_nothing_of_the_things_that_a_new_camera_shows(addon, preset, name):
    """The picture of the cubes is that of the scene of the cubes alone."""
    add_things()
    expected, _ = seen(addon, add_camera(preset))
    for obj in list(bpy.context.scene.objects):
        bpy.data.objects.remove(obj)
    add_things()
    for add, size in BACKGROUNDS[name]:
        add(size)
    found, _ = seen(addon, add_camera(preset))
    assert expected.sum() >= 8, "the cubes are hardly seen"
    # A cube's silhouette may differ by rounding where it touches a pixel's centre.
    assert np.count_nonzero(found != expected) <= 2


@pytest.mark.parametrize("size", [1e2, 1e3, 1e6])
def test_the_projectors_of_a_panorama_reach_the_whole_ground(addon, size):
    """The ground is seen down to the angle of its border below the horizon."""
    add_mesh("One", cube)
    add_ground(size)
    bpy.ops.object.camera_add(location=(0, 0, 3), rotation=(math.pi / 2, 0, 0))
    camera = bpy.context.object
    bpy.ops.scfpf.camera_from_camera()
    bpy.context.scene.render.resolution_x, bpy.context.scene.render.resolution_y = WIDTH, HEIGHT
    bpy.ops.scfpf.preset_apply(preset="cylindrical_panorama")
    bpy.context.view_layer.update()
    is_cube, hit = seen(addon, camera)
    depsgraph = bpy.context.evaluated_depsgraph_get()
    projection = addon("bridge.camera.read_projection").read_projection(camera, depsgraph, WIDTH / HEIGHT)
    x, y = np.meshgrid((np.arange(WIDTH) + 0.5) / WIDTH, (np.arange(HEIGHT) + 0.5) / HEIGHT)
    image = projection.parameters(x.ravel(), y.ravel())
    near, far = (
        projection.volume.evaluate(np.tile(image.u, 2), np.tile(image.v, 2), np.repeat([0.0, 1.0], x.size))
        .position.reshape(3, 2, -1)
        .transpose(1, 0, 2)
    )
    towards = far - near
    with np.errstate(divide="ignore"):
        length = (GROUND - near[2]) / towards[2]
    place = near + length * towards
    inside = (np.abs(place[:2]) < size / 2).all(axis=0) & (length > 0)
    border = np.abs(np.abs(place[:2]).max(axis=0) / (size / 2) - 1) < 1e-6
    differs = (hit != inside.reshape(HEIGHT, WIDTH)) & ~is_cube & ~border.reshape(HEIGHT, WIDTH)
    assert inside.any() and not differs.any()


@pytest.mark.parametrize(
    ("sizes", "expected"),
    [
        ([1.0], []),
        ([1.0, 1.0, 3.0], []),
        ([1.0, 0.0], []),
        ([1.0, 0.0, 0.0, 500.0], [3]),
        ([1.0, 2.0, 500.0], [2]),
        ([0.001, 5.0], [1]),
    ],
)
def test_what_is_a_background(addon, sizes, expected):
    """Cubes of several sizes about one point; a mesh without extent is no thing to fit a camera to."""
    for size in sizes:
        add_mesh("Cube", lambda s, size=size: bmesh.ops.create_cube(s, size=size))
    boxes = addon("operators.common.scene_box").scene_boxes(bpy.context)
    assert np.allclose(boxes.whole.size, max(sizes))
    rest = [size for number, size in enumerate(sizes) if number not in expected]
    assert np.allclose(boxes.things.size, max(rest))


def test_a_selected_instance_of_a_collection_can_be_enclosed():
    add_things()
    camera = add_camera("perspective")
    bpy.ops.object.select_all(action="DESELECT")
    bpy.data.objects["Instance"].select_set(True)
    bpy.context.view_layer.objects.active = camera
    camera.select_set(True)
    assert bpy.ops.scfpf.volume_fit() == {"FINISHED"}
