# SPDX-License-Identifier: GPL-3.0-or-later
"""Write ``references.json``: pixels and files by OpenCV and COLMAP themselves, which the tests compare with.

It needs Python packages that the tests do not: ``pip install opencv-python-headless pycolmap``.
"""

import json
import pathlib
import tempfile

import cv2
import numpy as np
import pycolmap

HERE = pathlib.Path(__file__).resolve().parent
SIZE, POINTS = (1600, 1200), 60
MATRIX = np.array([[1000.25, 0.0, 800.3], [0.0, 1010.5, 601.2], [0.0, 0.0, 1.0]])
BROWN = [0.2, 0.05, 0.001, -0.002, -0.02, 0.1, 0.02, 0.01, 0.003, 0.001, -0.002, 0.001, 0.05, -0.03]
COLMAP = {
    "SIMPLE_PINHOLE": [1000.25, 800.3, 601.2],
    "PINHOLE": [1000.25, 1010.5, 800.3, 601.2],
    "SIMPLE_RADIAL": [1000.25, 800.3, 601.2, -0.2],
    "RADIAL": [1000.25, 800.3, 601.2, -0.2, 0.05],
    "OPENCV": [1000.25, 1010.5, 800.3, 601.2, -0.2, 0.05, 0.001, -0.002],
    "OPENCV_FISHEYE": [400.0, 405.0, 800.3, 601.2, -0.02, 0.01, -0.003, 0.0005],
    "FULL_OPENCV": [1000.25, 1010.5, 800.3, 601.2, 0.2, 0.05, 0.001, -0.002, -0.02, 0.1, 0.02, 0.01],
    "FOV": [1000.25, 1010.5, 800.3, 601.2, 0.9],
    "SIMPLE_FISHEYE": [400.0, 800.3, 601.2],
    "FISHEYE": [400.0, 405.0, 800.3, 601.2],
    "SIMPLE_RADIAL_FISHEYE": [400.0, 800.3, 601.2, -0.02],
    "RADIAL_FISHEYE": [400.0, 800.3, 601.2, -0.02, 0.01],
    "THIN_PRISM_FISHEYE": [400.0, 405.0, 800.3, 601.2, -0.02, 0.01, 1e-3, -2e-3, -3e-3, 5e-4, 3e-3, -1e-3],
}


def points(random, widest):
    """Points up to an angle from the axis, (N, 3), as OpenCV's camera space has them."""
    angle, turn = random.uniform(0.0, widest, POINTS), random.uniform(0.0, 2 * np.pi, POINTS)
    length = random.uniform(0.5, 20.0, POINTS)
    across = np.sin(angle)
    return (np.stack([across * np.cos(turn), across * np.sin(turn), np.cos(angle)]) * length).T


def storage(ending, coefficients):
    """What cv2.FileStorage writes of a calibration, as text."""
    with tempfile.TemporaryDirectory() as folder:
        path = pathlib.Path(folder) / f"camera.{ending}"
        file = cv2.FileStorage(str(path), cv2.FILE_STORAGE_WRITE)
        file.write("calibration_time", "Sat Nov 28 20:00:00 2026")
        file.write("image_width", SIZE[0])
        file.write("image_height", SIZE[1])
        file.write("camera_matrix", MATRIX)
        file.write("distortion_coefficients", np.array(coefficients)[:, None])
        file.write("avg_reprojection_error", 0.25)
        file.release()
        return path.read_text()


def main():
    random = np.random.default_rng(49)
    zero = np.zeros(3)
    narrow, wide = points(random, 0.65), points(random, 1.5)
    opencv = []
    for count in (0, 4, 5, 8, 12, 14):
        coefficients = np.array(BROWN[:count])
        seen = cv2.projectPoints(narrow, zero, zero, MATRIX, coefficients)[0][:, 0]
        opencv.append({"coefficients": coefficients.tolist(), "pixels": seen.tolist()})
    fisheye = np.array([-0.02, 0.01, -0.003, 0.0005])
    wide_matrix = MATRIX.copy()
    wide_matrix[0, 0], wide_matrix[1, 1] = 400.0, 405.0
    alpha = 0.01
    seen = cv2.fisheye.projectPoints(wide[:, None], zero, zero, wide_matrix, fisheye, alpha=alpha)[0][:, 0]
    wide_matrix[0, 1] = alpha * wide_matrix[0, 0]
    colmap = {}
    for model, numbers in COLMAP.items():
        camera = pycolmap.Camera(model=model, width=SIZE[0], height=SIZE[1], params=numbers)
        given = wide if "FISHEYE" in model else narrow
        colmap[model] = {"parameters": numbers, "pixels": np.asarray(camera.img_from_cam(given)).tolist()}
    turn = np.array([0.4, -0.7, 0.2])
    shift = np.array([0.3, -0.2, 5.0])
    quaternion = pycolmap.Rotation3d(cv2.Rodrigues(turn)[0]).quat[[3, 0, 1, 2]]
    in_world = (narrow - shift) @ cv2.Rodrigues(turn)[0]
    posed = cv2.projectPoints(in_world, turn, shift, MATRIX, np.array(BROWN[:4]))[0][:, 0]
    data = {
        "versions": {"opencv": cv2.__version__, "pycolmap": pycolmap.__version__},
        "size": SIZE,
        "matrix": MATRIX.tolist(),
        "narrow": narrow.tolist(),
        "wide": wide.tolist(),
        "opencv": opencv,
        "fisheye": {
            "matrix": wide_matrix.tolist(),
            "coefficients": fisheye.tolist(),
            "pixels": seen.tolist(),
        },
        "colmap": colmap,
        "posed": {
            "quaternion": quaternion.tolist(),
            "translation": shift.tolist(),
            "points": in_world.tolist(),
            "pixels": posed.tolist(),
        },
        "files": {ending: storage(ending, BROWN[:5]) for ending in ("yml", "xml", "json")},
    }
    (HERE / "references.json").write_text(json.dumps(data) + "\n")


if __name__ == "__main__":
    main()
