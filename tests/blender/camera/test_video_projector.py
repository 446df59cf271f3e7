# SPDX-License-Identifier: GPL-3.0-or-later
"""Projection mapping: what the viewer sees of the projected picture is the picture that it was meant to see.

The light is followed by formulas of pinholes and by Blender's own ray casting, not by ours.
"""

import bpy
import numpy as np
import pytest
from bpy_extras.object_utils import world_to_camera_view
from mathutils import Vector
from mathutils.bvhtree import BVHTree

SIZE, DEVICE = (240, 160), (320, 200)
VIEWER, LIGHT = Vector((-1.5, -5.0, 1.5)), Vector((2.0, -4.0, 2.5))


def wanted(x, y):
    """The picture for the viewer: colors that vary smoothly, (3, N)."""
    return np.stack([x, y, 0.5 + 0.4 * np.sin(3 * x + 2 * y)])


def camera(name, place, lens):
    made = bpy.data.objects.new(name, bpy.data.cameras.new(name))
    bpy.context.scene.collection.objects.link(made)
    made.location, made.data.lens = place, lens
    made.rotation_euler = (Vector((0, 0, 0.8)) - place).to_track_quat("-Z", "Y").to_euler()
    return made


@pytest.fixture
def stage():
    """A wavy wall and a ball before it, a viewer, a video projector, and the picture for the viewer."""
    for obj in list(bpy.data.objects):
        bpy.data.objects.remove(obj)
    scene = bpy.context.scene
    scene.render.resolution_x, scene.render.resolution_y, scene.render.resolution_percentage = *SIZE, 100
    scene.render.pixel_aspect_x = scene.render.pixel_aspect_y = 1.0
    line = np.linspace(-2.5, 2.5, 61)
    x, z = np.meshgrid(line, line)
    points = np.stack([x, 0.5 + 0.25 * np.sin(2 * x) * np.cos(z), z + 0.8], axis=-1).reshape(-1, 3)
    first = (np.arange(60)[:, None] * 61 + np.arange(60)).ravel()
    mesh = bpy.data.meshes.new("Wall")
    mesh.from_pydata(
        points.tolist(), [], np.stack([first, first + 1, first + 62, first + 61], axis=1).tolist()
    )
    wall = bpy.data.objects.new("Wall", mesh)
    scene.collection.objects.link(wall)
    bpy.ops.mesh.primitive_uv_sphere_add(segments=64, ring_count=32, radius=0.5, location=(0.2, -0.6, 0.8))
    viewer, device = camera("Viewer", VIEWER, 35.0), camera("Device", LIGHT, 32.0)
    scene.camera = viewer
    picture = bpy.data.images.new("Content", *SIZE, float_buffer=True, is_data=True)
    x, y = np.meshgrid((np.arange(SIZE[0]) + 0.5) / SIZE[0], (np.arange(SIZE[1]) + 0.5) / SIZE[1])
    pixels = np.ones((SIZE[1], SIZE[0], 4), np.float32)
    pixels[..., :3] = np.moveaxis(wanted(x, y), 0, -1)
    picture.pixels.foreach_set(pixels.ravel())
    wall.select_set(True)
    bpy.data.objects["Sphere"].select_set(True)
    device.select_set(True)
    bpy.context.view_layer.objects.active = device
    bpy.context.view_layer.update()
    return viewer, device


def lit_points(viewer):
    """Points that some of the viewer's pixels see, by Blender's ray casting, and their places, (2, N)."""
    places = np.random.default_rng(5).uniform(0.02, 0.98, (400, 2))
    frame = [viewer.matrix_world @ corner for corner in viewer.data.view_frame(scene=bpy.context.scene)]
    right_top, _, left_bottom, left_top = frame
    tree = lit_things()
    points, seen = [], []
    for x, y in places:
        through = left_bottom + (right_top - left_top) * x + (left_top - left_bottom) * y
        point, *_ = tree.ray_cast(VIEWER, through - VIEWER)
        if point is not None:
            points.append(point)
            seen.append((x, y))
    return points, np.array(seen).T


def lit_things():
    """Wall and ball for Blender's ray casting."""
    points, faces = [], []
    for name in ("Wall", "Sphere"):
        obj = bpy.data.objects[name]
        faces += [[len(points) + number for number in face.vertices] for face in obj.data.polygons]
        points += [obj.matrix_world @ vertex.co for vertex in obj.data.vertices]
    return BVHTree.FromPolygons(points, faces)


def require_seen(image, points, seen, place_on_device):
    """Assert that the light on points is what the viewer wants to see there."""
    width, height = image.size
    pixels = np.array(image.pixels[:]).reshape(height, width, 4)
    shown, tree = 0, lit_things()
    for point, place in zip(points, seen.T, strict=True):
        x, y = place_on_device(point)
        if not (0.01 < x < 0.99 and 0.01 < y < 0.99):
            continue
        if (tree.ray_cast(LIGHT, point - LIGHT)[0] - point).length > 1e-3:
            continue  # in the shadow of the ball
        across, up = x * width - 0.5, y * height - 0.5
        column, row = int(across), int(up)
        a, b = across - column, up - row
        cell = pixels[row : row + 2, column : column + 2]
        if cell[..., 3].min() < 1.0 or np.ptp(cell[..., :2], axis=(0, 1)).max() > 0.015:
            continue  # at an outline
        color = (cell[0, 0] * (1 - a) + cell[0, 1] * a) * (1 - b) + (
            cell[1, 0] * (1 - a) + cell[1, 1] * a
        ) * b
        assert np.abs(color[:3] - wanted(*place)).max() <= 1 / 255
        shown += 1
    assert shown > 100


def test_viewer_sees_the_wanted_picture(stage):
    viewer, device = stage
    assert bpy.ops.scfpf.video_projector_picture(picture="Content", width=DEVICE[0], height=DEVICE[1]) == {
        "FINISHED"
    }
    image = bpy.data.images["SCFPF Video Projector Picture"]
    assert tuple(image.size) == DEVICE
    points, seen = lit_points(viewer)
    render = bpy.context.scene.render
    render.resolution_x, render.resolution_y = DEVICE

    def on_device(point):
        return world_to_camera_view(bpy.context.scene, device, point)[:2]

    require_seen(image, points, seen, on_device)
    # What the viewer does not see is left dark: the ball hides a part of the wall from it.
    pixels = np.array(image.pixels[:]).reshape(DEVICE[1], DEVICE[0], 4)
    assert 0.05 < (pixels[..., 3] == 0).mean() < 0.9
    assert not pixels[pixels[..., 3] == 0].any()


def test_a_calibrated_video_projector(stage):
    """Its lens by OpenCV's polynomial."""
    viewer, device = stage
    k1, k2 = -0.15, 0.04
    assert bpy.ops.scfpf.camera_from_calibration(
        source="NUMBERS",
        width=DEVICE[0],
        height=DEVICE[1],
        fx=300.0,
        cx=165.0,
        cy=98.0,
        radial=(k1, k2, 0, 0, 0, 0),
        set_size=False,
        st_maps="NONE",
    ) == {"FINISHED"}
    calibrated = bpy.context.object
    assert (calibrated.matrix_world.translation - LIGHT).length < 1e-6
    for name in ("Wall", "Sphere"):
        bpy.data.objects[name].select_set(True)
    assert bpy.ops.scfpf.video_projector_picture(picture="Content") == {"FINISHED"}
    points, seen = lit_points(viewer)

    def on_device(point):
        x, y, z = device.matrix_world.inverted() @ point
        x, y = x / -z, -y / -z
        q = x * x + y * y
        share = 1 + k1 * q + k2 * q * q
        return (300 * x * share + 165.5) / DEVICE[0], 1 - (300 * y * share + 98.5) / DEVICE[1]

    require_seen(bpy.data.images["SCFPF Video Projector Picture"], points, seen, on_device)


def test_without_a_picture_there_is_a_map(stage):
    assert bpy.ops.scfpf.video_projector_picture() == {"FINISHED"}
    image = bpy.data.images["SCFPF Video Projector Map"]
    pixels = np.array(image.pixels[:]).reshape(*tuple(image.size)[::-1], 4)
    shown = pixels[..., 3] == 1
    assert shown.mean() > 0.3 and pixels[shown][:, :2].min() >= 0 and pixels[shown][:, :2].max() <= 1
    with pytest.raises(RuntimeError, match="no image called 'Nothing'"):
        bpy.ops.scfpf.video_projector_picture(picture="Nothing")


def test_exported_mesh_has_the_viewers_picture_as_uv_map(stage, tmp_path):
    viewer, _device = stage
    path = tmp_path / "stage.obj"
    assert bpy.ops.scfpf.content_mesh_export(filepath=str(path)) == {"FINISHED"}
    before = set(bpy.data.objects)
    assert bpy.ops.wm.obj_import(filepath=str(path)) == {"FINISHED"}
    (made,) = set(bpy.data.objects) - before
    uv = made.data.uv_layers.active.uv
    assert len(made.data.polygons) > 3000
    for loop in list(made.data.loops)[:: len(made.data.loops) // 200]:
        point = made.matrix_world @ made.data.vertices[loop.vertex_index].co
        x, y, _ = world_to_camera_view(bpy.context.scene, viewer, point)
        assert np.allclose(uv[loop.index].vector, (x, y), atol=1e-5)


def test_a_camera_that_sees_nothing_and_a_bad_folder_are_refused(stage, tmp_path):
    viewer, _device = stage
    with pytest.raises(RuntimeError, match=r"Cannot write stage\.obj"):
        bpy.ops.scfpf.content_mesh_export(filepath=str(tmp_path / "none" / "stage.obj"))
    viewer.rotation_euler = (np.pi / 2, 0, np.pi)
    bpy.context.view_layer.update()
    images = len(bpy.data.images)
    with pytest.raises(RuntimeError, match="No pixel of the video projector"):
        bpy.ops.scfpf.video_projector_picture(picture="Content")
    with pytest.raises(RuntimeError, match="sees no whole face"):
        bpy.ops.scfpf.content_mesh_export(filepath=str(tmp_path / "stage.obj"))
    assert len(bpy.data.images) == images and not list(tmp_path.iterdir())
