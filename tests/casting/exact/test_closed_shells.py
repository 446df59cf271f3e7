# SPDX-License-Identifier: GPL-3.0-or-later
"""Closed meshes all round the camera, whose vertices lie on pixel centres: no projector gets out."""

import numpy as np
import pytest

from benchmarks.hard_scenes import sphere, welded
from benchmarks.scenes import joined, sheet
from scfpf_addon.casting.cast import cast
from scfpf_addon.casting.scene.cast_scene import CastScene
from scfpf_addon.projection.surfaces.surface import Plane, SphereSector
from scfpf_addon.projection.volume.viewing_volume import Projection, ViewingVolume

# Columns and rows of the image of everything round the camera.
ACROSS, UP = 64, 32


def placed(surface, x, y, z, turn=0.0):
    matrix = np.eye(4)
    matrix[0, 0] = matrix[2, 2] = np.cos(turn)
    matrix[0, 2], matrix[2, 0] = np.sin(turn), -np.sin(turn)
    matrix[:3, 3] = x, y, z
    return surface.transformed(matrix)


def view(size):
    """An ordinary square view of 90°, from next to the origin to behind the shells of a size."""
    ends = 1e-3 * size, 4.0 * size
    return Projection(ViewingVolume(tuple(placed(Plane(2 * z, 2 * z), 0, 0, -z) for z in ends)))


def all_round(size):
    """Straight projectors in all directions."""
    return Projection(ViewingVolume((SphereSector(1e-3 * size), SphereSector(4.0 * size))))


def bent(size, basis="BEZIER"):
    """Curves in all directions, which leave the shells of a size before they end."""
    between = (
        placed(SphereSector(0.5 * size), 0.1 * size, 0, 0.05 * size, 0.5),
        placed(SphereSector(1.2 * size), -0.1 * size, 0.1 * size, 0, -0.4),
    )
    return Projection(ViewingVolume((SphereSector(1e-3 * size), *between, SphereSector(6.0 * size)), basis))


VIEWS = {"view": view, "all round": all_round, "bent": bent, "polyline": lambda size: bent(size, "POLYLINE")}


def box():
    """A cube from -1 to 1 whose front is seen at the centres of UP × UP pixels of ``view``."""
    line = np.concatenate([[-1.0], 2 * (np.arange(UP) + 0.5) / UP - 1, [1.0]])
    x, y = np.meshgrid(line, line)
    sides = [
        sheet(np.roll(np.stack([np.full_like(x, end), x, y], axis=-1), axis, axis=-1))
        for axis in range(3)
        for end in (-1.0, 1.0)
    ]
    return welded(joined(sides))


def pixels():
    """A sphere with a vertex in the middle of each pixel of ``all_round``, and one on each pole."""
    longitude = 2 * np.pi * ((np.arange(ACROSS + 1) + 0.5) / ACROSS - 0.5)
    latitude = np.pi * np.concatenate([[0.0], (np.arange(UP) + 0.5) / UP, [1.0]]) - np.pi / 2
    u, v = np.meshgrid(longitude, latitude)
    return welded(sheet(np.stack([np.cos(v) * np.sin(u), np.sin(v), -np.cos(v) * np.cos(u)], axis=-1)))


def icosphere(halvings=3):
    """An icosahedron whose faces are halved so often, on the unit sphere."""
    golden = (1 + 5**0.5) / 2
    points = [np.roll([0.0, a, b * golden], turn) for turn in range(3) for a in (-1, 1) for b in (-1, 1)]
    vertices = np.array(points) / np.linalg.norm(points[0])
    distance = np.linalg.norm(vertices[:, None] - vertices, axis=-1)
    near = (distance > 0.1) & (distance < 1.1)
    faces = np.argwhere(near[:, :, None] & near[:, None] & near[None])
    faces = np.unique(np.sort(faces, axis=1), axis=0).astype(np.int32)
    for _ in range(halvings):
        a, b, c = (vertices[faces[:, k]] for k in range(3))
        parts = a, a + b, a + c, a + b, b, b + c, a + c, b + c, c, a + b, b + c, a + c
        corners = np.stack(parts, axis=1).reshape(-1, 3)
        corners /= np.linalg.norm(corners, axis=1)[:, None]
        vertices, faces = welded((corners, np.arange(len(corners), dtype=np.int32).reshape(-1, 3)))
    return vertices, faces


SHELLS = {"box": box, "pixels": pixels, "UV sphere": lambda: sphere(UP), "icosphere": icosphere}


@pytest.mark.parametrize("pixel_error", [0.0, 0.1])
@pytest.mark.parametrize("size", [0.01, 37.7, 1e4])
@pytest.mark.parametrize("kind", VIEWS)
@pytest.mark.parametrize("shell", SHELLS)
def test_no_projector_gets_out(reference, shell, kind, size, pixel_error):
    """Vertices are rounded to float32, as in a file."""
    vertices, triangles = SHELLS[shell]()
    scene = CastScene((size * vertices).astype(np.float32).astype(np.float64), triangles)
    width = UP if kind == "view" else ACROSS
    hits = reference.cast_image(scene, VIEWS[kind](size), width, UP, pixel_error)
    assert (hits.triangle >= 0).all()


@pytest.mark.parametrize("pixel_error", [0.0, 0.1])
@pytest.mark.parametrize("size", [0.01, 37.7, 1e4])
def test_none_gets_out_through_the_vertices_of_an_icosphere(size, pixel_error):
    vertices, triangles = icosphere(4)
    scene = CastScene(size * vertices, triangles)
    x, y, z = vertices[np.abs(vertices[:, 1]) < 0.999].T
    u, v = np.arctan2(x, -z) / (2 * np.pi) + 0.5, np.arcsin(y) / np.pi + 0.5
    projection = all_round(size).transformed(scene.matrix)
    hits = cast(scene, projection, u, v, (1 / ACROSS, 1 / UP), pixel_error)
    assert (hits.triangle >= 0).all() and len(u) > 2000
