# SPDX-License-Identifier: GPL-3.0-or-later
"""Cameras from calibrations against OpenCV's and COLMAP's own pixels, through Blender's properties."""

import json
import pathlib
import tracemalloc

import bpy
import numpy as np
import pytest
from engine_images import load_pixels

REFERENCES = json.loads(
    (pathlib.Path(__file__).parents[2] / "projection" / "calibration" / "references.json").read_text()
)
SIZE = REFERENCES["size"]
# Pixels.
ERROR = 1e-6
OPERATOR = bpy.ops.scfpf.camera_from_calibration


@pytest.fixture(autouse=True)
def empty_scene():
    for obj in list(bpy.data.objects):
        bpy.data.objects.remove(obj)
    scene = bpy.context.scene
    scene.render.resolution_x, scene.render.resolution_y, scene.render.resolution_percentage = 640, 360, 50
    scene.render.pixel_aspect_x = scene.render.pixel_aspect_y = 1.0
    scene.camera = None


def camera_at_origin(**options):
    """The operator's camera where an ordinary one stands, in camera space."""
    stand = bpy.data.objects.new("Stand", bpy.data.cameras.new("Stand"))
    bpy.context.scene.collection.objects.link(stand)
    bpy.context.view_layer.objects.active = stand
    assert OPERATOR(**options) == {"FINISHED"}
    return bpy.context.object


def lens_file(folder, name, coefficients, matrix, **more):
    data = {"image_width": SIZE[0], "image_height": SIZE[1], "camera_matrix": matrix, "D": coefficients}
    path = folder / name
    path.write_text(json.dumps(data | more))
    return str(path)


def require_seen(addon, camera, points, pixels):
    """Assert that pixels (N, 2), from the image's upper left corner, see points (N, 3) of OpenCV's space.

    Pixels outside of the picture are left out.
    """
    inside = ((np.array(pixels) > 1) & (np.array(pixels) < np.array(SIZE) - 1)).all(axis=1)
    points, pixels = np.array(points)[inside], np.array(pixels)[inside]
    assert len(points) > 30
    reading = addon("bridge.camera.read_projection").read_projection
    projection = reading(camera, bpy.context.evaluated_depsgraph_get(), SIZE[0] / SIZE[1])
    px, py = np.array(pixels).T
    x, y = px / SIZE[0], 1 - py / SIZE[1]
    near, far = projection.projectors(x, y).points
    assert projection.projectors(x, y).valid.all()
    wanted = np.array(points).T * [[1], [-1], [-1]]
    wanted = wanted / np.linalg.norm(wanted, axis=0)
    # A pixel away is this angle away at least: what a pixel's step turns the projector by.
    step = 1e-3
    beside = [
        projection.projectors(x + dx / SIZE[0], y + dy / SIZE[1]).points[1]
        for dx, dy in ((step, 0), (0, step))
    ]
    turns = [np.linalg.norm(unit(each) - unit(far), axis=0) / step for each in beside]
    for end in (near, far):
        off = np.linalg.norm(unit(end) - wanted, axis=0)
        assert (off / np.minimum(*turns)).max() <= ERROR


def unit(vectors):
    return vectors / np.linalg.norm(vectors, axis=0)


@pytest.mark.parametrize("case", (0, 2, 5))
def test_opencv(addon, tmp_path, case):
    case = REFERENCES["opencv"][case]
    path = lens_file(tmp_path, "lens.json", case["coefficients"], REFERENCES["matrix"])
    camera = camera_at_origin(filepath=path)
    assert [slot.object.scfpf_surface.kind for slot in camera.scfpf.surfaces] == ["PLANE", "PLANE"]
    require_seen(addon, camera, REFERENCES["narrow"], np.array(case["pixels"]) + 0.5)
    render = bpy.context.scene.render
    assert (render.resolution_x, render.resolution_y, render.resolution_percentage) == (*SIZE, 100)
    # The focal lengths differ by a hundredth.
    assert render.pixel_aspect_y == 1.0 and render.pixel_aspect_x == pytest.approx(1010.5 / 1000.25)


def test_fisheye(addon, tmp_path):
    case = REFERENCES["fisheye"]
    path = lens_file(tmp_path, "lens.json", case["coefficients"], case["matrix"], fisheye_model=1)
    camera = camera_at_origin(filepath=path)
    require_seen(addon, camera, REFERENCES["wide"], np.array(case["pixels"]) + 0.5)


@pytest.mark.parametrize("model", ("FOV", "THIN_PRISM_FISHEYE"))
def test_colmap(addon, tmp_path, model):
    case = REFERENCES["colmap"][model]
    path = tmp_path / "cameras.txt"
    path.write_text(f"1 {model} {SIZE[0]} {SIZE[1]} {' '.join(map(repr, case['parameters']))}\n")
    camera = camera_at_origin(filepath=str(path))
    require_seen(addon, camera, REFERENCES["wide" if "FISHEYE" in model else "narrow"], case["pixels"])


def test_pose_of_colmap(addon, tmp_path):
    posed = REFERENCES["posed"]
    numbers = " ".join(map(repr, [*posed["quaternion"], *posed["translation"]]))
    (tmp_path / "images.txt").write_text(f"1 {numbers} 1 one.jpg\n\n")
    (tmp_path / "cameras.txt").write_text(f"1 PINHOLE {SIZE[0]} {SIZE[1]} 1000 1000 800 600\n")
    assert OPERATOR(filepath=str(tmp_path / "images.txt")) == {"FINISHED"}
    camera = bpy.context.object
    middle = np.array(camera.matrix_world) @ [0, 0, -2.0, 1]
    # The axis of COLMAP's camera: R p + t = (0, 0, 2); matrices of Blender's objects are float32.
    points, narrow = np.array(posed["points"]), np.array(REFERENCES["narrow"])
    fit = np.linalg.lstsq(np.c_[narrow, np.ones(len(narrow))], points, rcond=None)[0]
    assert np.abs(middle[:3] - [0, 0, 2, 1] @ fit).max() < 1e-5


def test_typed_numbers(addon):
    case = REFERENCES["opencv"][2]
    k1, k2, p1, p2, k3 = case["coefficients"]
    matrix = np.array(REFERENCES["matrix"])
    camera = camera_at_origin(
        source="NUMBERS",
        model="OPENCV",
        width=SIZE[0],
        height=SIZE[1],
        fx=matrix[0, 0],
        fy=matrix[1, 1],
        cx=matrix[0, 2],
        cy=matrix[1, 2],
        radial=(k1, k2, k3, 0, 0, 0),
        tangential=(p1, p2),
    )
    lens = json.loads(camera.scfpf.mappings[0].calibration)
    # Fields of operators hold float32 numbers.
    assert np.allclose(lens["matrix"], [matrix[0, 0], 0, 0, matrix[1, 1]], rtol=1e-7)
    assert np.allclose(lens["centre"], matrix[:2, 2] + 0.5, rtol=1e-7)
    assert np.allclose(lens["tangential"], (p1, p2), rtol=1e-7)


def test_the_maps_of_a_tiny_lens_have_a_pixel():
    """A focal length of a thousandth of a pixel."""
    camera_at_origin(source="NUMBERS", model="FISHEYE", width=4, height=9, fx=0.001, fy=5.0, st_maps="BOTH")
    assert all(min(image.size) >= 1 for image in bpy.data.images if "ST Map" in image.name)


def test_st_maps_undistort_and_distort(addon, tmp_path):
    case = REFERENCES["opencv"][1]
    matrix = np.array(REFERENCES["matrix"])
    path = lens_file(tmp_path, "lens.json", [-0.2, 0.03, 0.001, -0.002], REFERENCES["matrix"])
    camera = camera_at_origin(filepath=path, st_maps="BOTH")
    images = {image.name: image for image in bpy.data.images}
    undistort, distort = images["lens Undistort"], images["lens Distort"]
    assert tuple(distort.size) == tuple(SIZE)
    width, height = undistort.size
    assert width > SIZE[0] and width % 2 == 0
    # A pixel of the undistorted picture, a pinhole's with overscan, looks up cv2's distorted pixel.
    pixels = np.array(undistort.pixels[:]).reshape(height, width, 4)
    column, row = 700, 300
    x = (column + 0.5 - width / 2 + SIZE[0] / 2 - 0.5 - matrix[0, 2]) / matrix[0, 0]
    y = ((height - 1 - row) + 0.5 - height / 2 + SIZE[1] / 2 - 0.5 - matrix[1, 2]) / matrix[1, 1]
    q = x * x + y * y
    k1, k2, p1, p2 = -0.2, 0.03, 0.001, -0.002
    radial = 1 + k1 * q + k2 * q * q
    seen_x = x * radial + 2 * p1 * x * y + p2 * (q + 2 * x * x)
    seen_y = y * radial + p1 * (q + 2 * y * y) + 2 * p2 * x * y
    wanted = [
        (seen_x * matrix[0, 0] + matrix[0, 2] + 0.5) / SIZE[0],
        1 - (seen_y * matrix[1, 1] + matrix[1, 2] + 0.5) / SIZE[1],
    ]
    assert pixels[row, column, 3] == 1.0
    # Rounding: the height of the picture with overscan is a whole number of pixels, too.
    assert np.abs(pixels[row, column, :2] - wanted).max() < 2e-4
    assert case and camera.data.shift_x != 0.0


def test_a_render_shows_things_where_opencv_says(addon, tmp_path):
    case = REFERENCES["opencv"][1]
    path = lens_file(tmp_path, "lens.json", case["coefficients"], REFERENCES["matrix"])
    chosen = 0
    x, y, z = REFERENCES["narrow"][chosen]
    bpy.ops.mesh.primitive_uv_sphere_add(radius=0.01 * z, location=(x, -y, -z))
    camera = camera_at_origin(filepath=path, st_maps="NONE")
    scene = bpy.context.scene
    scene.camera = camera
    scene.render.engine = "SCFPF"
    scene.render.film_transparent = True
    scene.render.image_settings.file_format = "OPEN_EXR"
    scene.render.filepath = str(tmp_path / "picture.exr")
    assert bpy.ops.render.render(write_still=True) == {"FINISHED"}
    alpha = load_pixels(tmp_path / "picture.exr")[..., 3]
    rows, columns = np.nonzero(alpha > 0.5)
    assert len(rows) > 100
    # The rows of a file as Blender loads it go up.
    seen = columns.mean(), SIZE[1] - 1 - rows.mean()
    assert np.abs(np.array(seen) - case["pixels"][chosen]).max() < 0.3


def test_bad_files_change_nothing(tmp_path):
    path = tmp_path / "lens.yml"
    path.write_text("camera_matrix: [1, 2]\n")
    before = len(bpy.data.objects), len(bpy.data.cameras), bpy.context.scene.render.resolution_x
    with pytest.raises(RuntimeError, match=r"lens\.yml: the file has no camera matrix"):
        OPERATOR(filepath=str(path))
    with pytest.raises(RuntimeError, match="Choose a calibration file"):
        OPERATOR()
    assert before == (len(bpy.data.objects), len(bpy.data.cameras), bpy.context.scene.render.resolution_x)


def test_a_calibrated_camera_is_a_preset(addon, tmp_path):
    case = REFERENCES["fisheye"]
    path = lens_file(tmp_path, "lens.json", case["coefficients"], case["matrix"], model="fisheye")
    camera = camera_at_origin(filepath=path, st_maps="NONE")
    stored = str(tmp_path / "own.json")
    assert bpy.ops.scfpf.preset_export(filepath=stored, name="Lens") == {"FINISHED"}
    lens = camera.scfpf.mappings[0].calibration
    bpy.ops.scfpf.mapping_remove()
    assert bpy.ops.scfpf.preset_load(filepath=stored, fit=False) == {"FINISHED"}
    assert json.loads(camera.scfpf.mappings[0].calibration) == json.loads(lens)
    require_seen(addon, camera, REFERENCES["wide"], np.array(case["pixels"]) + 0.5)


def test_maps_of_large_pictures_take_little_memory():
    numbers = {"width": 2048, "height": 1024, "fx": 900.0, "radial": (-0.1, 0.02, 0, 0, 0, 0)}
    tracemalloc.start()
    try:
        camera_at_origin(source="NUMBERS", model="OPENCV", st_maps="BOTH", overscan=1.0, **numbers)
        most = tracemalloc.get_traced_memory()[1]
    finally:
        tracemalloc.stop()
    undistort, distort = (
        bpy.data.images[f"{bpy.context.object.name} {way}"] for way in ("Undistort", "Distort")
    )
    assert tuple(undistort.size) == tuple(distort.size) == (2048, 1024)
    # The pixels of one map themselves are 16 bytes each.
    assert most < 80 * 2048 * 1024
