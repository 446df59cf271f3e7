# SPDX-License-Identifier: GPL-3.0-or-later
"""CastScene: placing, degenerate input, shadow rays, errors that say what to do."""

import importlib.metadata
import sys

import numpy as np
import pytest

from benchmarks.scenes import boxes, columns
from scfpf_addon.casting.common.hits import CastError
from scfpf_addon.casting.scene import embreex as module
from scfpf_addon.casting.scene.cast_scene import CastScene
from scfpf_addon.casting.scene.neighbours import edge_neighbours

QUAD = np.array([[-1.0, -1, 0], [1, -1, 0], [1, 1, 0], [-1, 1, 0]])
FACES = np.array([[0, 1, 2], [0, 2, 3]], np.int32)


def down(scene, x, y):
    """The triangles under points of the world's XY plane, from far above."""
    start = np.stack([x, y, np.full(len(x), 5.0)])
    origins = (scene.matrix[:3, :3] @ start + scene.matrix[:3, 3:]).astype(np.float32)
    ways = np.tile(np.float32([[0], [0], [-100]]), len(x)) * np.float32(scene.scale)
    return scene.mesh.trace(origins, ways, np.ones(len(x), np.float32))


def test_the_scene_fits_cast_space_wherever_it_is():
    vertices, triangles = columns(2000)
    for offset, factor in ((0.0, 1.0), (1e6, 1.0), (-300.0, 1e-4), (5.0, 1e5)):
        scene = CastScene(vertices * factor + offset, triangles)
        assert np.abs(scene.vertices).max() == pytest.approx(1.0)
        world = np.concatenate([(vertices * factor + offset).T, np.ones((1, len(vertices)))])
        np.testing.assert_allclose((scene.matrix @ world)[:3], scene.vertices, atol=1e-9)
        assert (scene.lower == scene.vertices.min(axis=1)).all()


def test_planes_barycentrics_and_normals():
    vertices, triangles = boxes(600)
    scene = CastScene(vertices, triangles)
    generator = np.random.default_rng(0)
    index = generator.integers(len(triangles), size=200)
    weights = generator.dirichlet(np.ones(3), 200).T
    corners = scene.vertices[:, triangles[index].T]
    points = (corners * weights).sum(axis=1)
    np.testing.assert_allclose(scene.barycentric(points, index), weights[1:], atol=1e-11)
    np.testing.assert_allclose(
        (scene.planes[:3, index] * points).sum(axis=0), -scene.planes[3, index], atol=1e-14
    )
    normals = np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0], axis=0)
    np.testing.assert_allclose(scene.normals(index), normals / np.linalg.norm(normals, axis=0), atol=1e-12)


def test_bad_triangles_are_never_hit_and_the_others_keep_their_numbers():
    vertices = np.concatenate([QUAD, [[np.nan, 0, 1], [np.inf, 0, 1], [0, 0, 1], [0.5, 0, 1], [1e200, 0, 1]]])
    faces = np.array(
        [[0, 1, 4], [0, 1, 5], [6, 6, 7], [6, 7, 6], [0, 6, 6], [0, 1, 8], [0, 1, 2], [0, 2, 3]], np.int32
    )
    scene = CastScene(vertices, faces)
    x, y = np.array([0.5, -0.5, 0.1, 3.0]), np.array([-0.2, 0.2, 0.0, 0.0])
    assert down(scene, x, y).tolist() == [6, 7, 6, -1]
    assert np.isfinite(scene.planes).all() and np.isfinite(scene.vertices).all()


def test_collinear_and_one_triangle():
    line = np.array([[0.0, 0, 0], [1, 1, 0], [3, 3, 0]])
    with pytest.raises(CastError, match="area"):
        CastScene(line, np.array([[0, 1, 2]], np.int32))
    scene = CastScene(QUAD, FACES[:1])
    assert down(scene, np.array([0.5, -0.5]), np.array([-0.2, 0.5])).tolist() == [0, -1]


@pytest.mark.parametrize(
    ("vertices", "faces", "message"),
    [
        (np.empty((0, 3)), np.empty((0, 3), np.int32), "no triangles"),
        (QUAD, np.empty((0, 3), np.int32), "no triangles"),
        (np.full((4, 3), np.nan), FACES, "no triangles"),
        (np.zeros((4, 3)), FACES, "area"),
        (QUAD[:3], FACES, "does not exist"),
        (QUAD, -FACES - 1, "does not exist"),
    ],
)
def test_scenes_without_anything_to_hit_are_refused(vertices, faces, message):
    with pytest.raises(CastError, match=message):
        CastScene(vertices, faces)


def test_a_missing_embreex_is_explained(monkeypatch):
    monkeypatch.setitem(sys.modules, "embreex", None)
    with pytest.raises(CastError, match=r"embreex is missing.*install Flexible Projection again.* 4\.4"):
        CastScene(QUAD, FACES)


def test_an_old_embreex_is_explained(monkeypatch):
    monkeypatch.setattr(module, "version", lambda name: "2.17.7.post6")
    with pytest.raises(CastError, match=r"2\.17\.7\.post6 is too old.*4\.4"):
        CastScene(QUAD, FACES)


def test_an_embreex_that_is_being_removed_is_explained(monkeypatch, tmp_path):
    """Its folder of metadata is there, and empty already."""
    (tmp_path / "embreex-9.9.9.dist-info").mkdir()
    monkeypatch.syspath_prepend(tmp_path)
    with pytest.raises(CastError, match=r"embreex is missing.*install Flexible Projection again"):
        CastScene(QUAD, FACES)


def test_the_installed_embreex_is_new_enough():
    found = tuple(int(part) for part in importlib.metadata.version("embreex").split(".")[:2])
    assert found >= module.EMBREEX_MINIMUM


def brute_occlusion(scene, origins, directions, distances):
    """Return whether anything lies on each ray, from the float64 triangles (Möller and Trumbore 1997)."""
    a, b, c = (scene.vertices[:, scene.triangles[:, k]].T for k in range(3))
    result = np.zeros(origins.shape[1], bool)
    for i, (origin, way) in enumerate(zip(origins.T, directions.T, strict=True)):
        p = np.cross(way, c - a)
        determinant = (p * (b - a)).sum(axis=1)
        with np.errstate(divide="ignore", invalid="ignore"):
            u = ((origin - a) * p).sum(axis=1) / determinant
            q = np.cross(origin - a, b - a)
            v = (way * q).sum(axis=1) / determinant
            t = ((c - a) * q).sum(axis=1) / determinant
        result[i] = ((u >= 0) & (v >= 0) & (u + v <= 1) & (t > 0) & (t < distances[i])).any()
    return result


def test_occlusion_against_brute_force():
    scene = CastScene(*boxes(3000))
    generator = np.random.default_rng(4)
    origins = generator.uniform(scene.lower[:, None], scene.upper[:, None], (3, 400))
    directions = generator.normal(size=(3, 400))
    for distances in (np.full(400, 0.3), np.full(400, np.inf)):
        expected = brute_occlusion(scene, origins, directions, distances)
        assert 0.1 < expected.mean() < 0.95
        np.testing.assert_array_equal(scene.occluded(origins, directions, distances), expected)


def test_shadow_rays_ignore_the_lamps_own_surface_and_bad_input():
    scene = CastScene(QUAD, FACES)
    origins, directions = np.array([[0.1], [0.2], [1.0]]), np.array([[0.0], [0.0], [-2.0]])
    hit = 0.5  # the quad is half a direction away
    for distance, expected in ((hit * 1.01, True), (hit, False), (hit * 0.9, False), (0.0, False)):
        assert scene.occluded(origins, directions, np.array([distance]))[0] == expected
    for bad in (np.nan, np.inf):
        assert not scene.occluded(np.full((3, 1), bad), directions, np.ones(1)).any()
        assert not scene.occluded(origins, np.full((3, 1), bad), np.ones(1)).any()
    assert not scene.occluded(origins, directions, np.full(1, np.nan)).any()
    assert scene.occluded(np.empty((3, 0)), np.empty((3, 0)), np.empty(0)).shape == (0,)


@pytest.mark.parametrize("offset", [0.0, 1e5])
def test_offset_origins_leave_their_surface_to_the_right_side(offset):
    # A closed box: from its walls outwards nothing is in the way, inwards the other wall is.
    corners = np.array([[x, y, z] for x in (-1, 1) for y in (-1, 1) for z in (-1, 1)], float) * [3, 1, 2]
    quads = np.array([[0, 1, 3, 2], [4, 6, 7, 5], [0, 4, 5, 1], [2, 3, 7, 6], [0, 2, 6, 4], [1, 5, 7, 3]])
    faces = np.concatenate([quads[:, [0, 1, 2]], quads[:, [0, 2, 3]]]).astype(np.int32)
    generator = np.random.default_rng(5)
    turned = np.linalg.qr(generator.normal(size=(3, 3)))[0]
    scene = CastScene(corners @ turned + offset, faces)
    index = generator.integers(12, size=3000)
    weights = generator.dirichlet(np.ones(3), 3000).T
    positions = (scene.vertices[:, faces[index].T] * weights).sum(axis=1)
    outward = positions - scene.vertices.mean(axis=1, keepdims=True)
    normals = scene.normals(index)
    normals *= np.sign((normals * outward).sum(axis=0))
    grazing = np.cross(normals, generator.normal(size=(3, 3000)), axis=0)
    for tilt in (1.0, 1e-2, 1e-4):
        way = tilt * normals + grazing
        away = scene.offset_origins(positions, index, way)
        assert ((away - positions) * normals).sum(axis=0).min() > 0
        assert not scene.occluded(away, way, np.full(3000, np.inf)).any()
        into = scene.offset_origins(positions, index, -way)
        assert scene.occluded(into, -way, np.full(3000, np.inf)).mean() > 0.999


def test_neighbours_are_those_across_the_edges():
    mesh = columns(900)[1]
    result = edge_neighbours(mesh)
    assert result.shape == (3, len(mesh))
    by_edge = {}
    for number, face in enumerate(mesh.tolist()):
        for corner in range(3):
            edge = frozenset(face[:corner] + face[corner + 1 :])
            by_edge.setdefault(edge, []).append((corner, number))
    for sides in by_edge.values():
        if len(sides) == 1:
            ((corner, number),) = sides
            assert result[corner, number] == -1
        else:
            (one, a), (other, b) = sides
            assert result[one, a] == b and result[other, b] == a


def test_an_edge_of_three_triangles_pairs_two():
    fan = np.array([[0, 1, 2], [1, 0, 3], [0, 1, 4]], np.int32)
    assert edge_neighbours(fan)[2].tolist() == [1, 0, -1]
    assert edge_neighbours(np.empty((0, 3), np.int32)).shape == (3, 0)


def test_a_part_that_asks_first_leaves_the_whole_its_tables():
    square = np.array([[0, 0, 0], [1, 0, 0], [1, 1, 0], [0, 1, 0]], float)
    scene = CastScene(square, np.array([[0, 1, 2], [0, 2, 3]], np.int32))
    part = scene.only(np.array([True, False]))
    assert part.weights is scene.weights
    # What the part does not show is no neighbour in it.
    assert (part.neighbours == -1).all()
    assert (scene.neighbours >= 0).sum(axis=0).tolist() == [1, 1]
    for number in (0, 1):
        middle = scene.corners_at(np.array([number])).mean(axis=0)
        np.testing.assert_allclose(scene.barycentric(middle, np.array([number])), 1 / 3, atol=1e-12)
