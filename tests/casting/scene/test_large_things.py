# SPDX-License-Identifier: GPL-3.0-or-later
"""Small things beside one large thing, a ground or a sky of 10,000 km, against brute force in float64."""

import numpy as np
import pytest

from benchmarks.scenes import joined, sheet
from scfpf_addon.casting.common.hits import CastCounts
from scfpf_addon.casting.continuation import cast_rays
from scfpf_addon.casting.frame import pixel_centres
from scfpf_addon.casting.scene.cast_scene import CastScene
from scfpf_addon.casting.scene.graded_triangles import graded
from scfpf_addon.projection.surfaces.surface import Plane
from scfpf_addon.projection.volume.viewing_volume import Projection, ViewingVolume

WIDTH, HEIGHT = 64, 48
SIZES = (1e3, 1e5, 1e7)
EYE = np.array([0.2, 0.3, 4.0])
CORNERS = np.array([[x, y, z] for x in (-1, 1) for y in (-1, 1) for z in (-1, 1)], float)
QUADS = np.array([[0, 1, 3, 2], [4, 6, 7, 5], [0, 4, 5, 1], [2, 3, 7, 6], [0, 2, 6, 4], [1, 5, 7, 3]])
FACES = np.concatenate([QUADS[:, [0, 1, 2]], QUADS[:, [0, 2, 3]]]).astype(np.int32)
TURN = np.linalg.qr(np.random.default_rng(1).normal(size=(3, 3)))[0]
GROUND = np.array([[-1.0, 0, -1], [1, 0, -1], [1, 0, 1], [-1, 0, 1]])
# Turned about two axes, so that no coordinate of the plane is 0.
SLANTED = GROUND @ np.array([[0.955, 0.296, 0], [-0.291, 0.941, 0.169], [0.05, -0.161, 0.986]])


def cube(size=1.0, centre=(0.0, 0.0, 0.0)):
    return CORNERS @ TURN.T * (size / 2) + centre, FACES


def plane(corners, size, height, moved=(0.0, 0.0)):
    places = corners * size + np.array([moved[0] * size, height, moved[1] * size])
    return places, np.array([[0, 2, 1], [0, 3, 2]], np.int32)


def sphere(size, centre=(0.0, 0.0, 0.0)):
    turn, tilt = np.meshgrid(np.linspace(0, 2 * np.pi, 13), np.linspace(0, np.pi, 7))
    directions = [np.sin(tilt) * np.cos(turn), np.cos(tilt), np.sin(tilt) * np.sin(turn)]
    vertices, triangles = sheet(size * np.stack(directions, axis=-1))
    return vertices + centre, triangles


LARGE = {
    "ground under the cube": lambda size: plane(GROUND, size, -0.61),
    "ground that the cube stands in": lambda size: plane(SLANTED, size, -0.3),
    "ground far below": lambda size: plane(SLANTED, size, -0.2 * size),
    "ground that ends beside the cube": lambda size: plane(SLANTED, size, -0.3, (0.99999998, 0.3)),
    "sky": sphere,
    "sky that the cube stands in": lambda size: sphere(size, (0.0, size - 1.2, 0.0)),
    "sky, off its middle": lambda size: sphere(size, (0.4 * size, 0.3 * size, 0.2 * size)),
    "box around all": lambda size: cube(2 * size),
    "box that touches the cube": lambda size: cube(2 * size, TURN @ np.array([0, 0, -size - 0.45])),
}


def frame(distance, moved=(0.0, 0.0)):
    matrix = np.eye(4)
    matrix[:3, 3] = EYE - [moved[0], moved[1], distance]
    return Plane(width=0.6 * distance * WIDTH / HEIGHT, height=0.6 * distance, matrix=matrix)


def volume(*frames):
    return Projection(ViewingVolume(frames), aspect=WIDTH / HEIGHT)


VOLUMES = {
    "straight": volume(frame(0.1), frame(8.0)),
    "straight, long": volume(frame(0.1), frame(1e5)),
    "curved": volume(frame(0.1), frame(4.0, (-0.3, 0.1)), frame(8.0)),
}


def wrong(hits, t):
    """Pixels whose t is off, or hit where there is a miss."""
    ours, true = (np.where(np.isfinite(a), a, 2.0) for a in (hits.t, t))
    return np.abs(ours - true) > 1e-9


def image_of(reference, vertices, triangles, projection, scene=None, pixel_error=0.1):
    """The wrong pixels of an image, in number."""
    x, y = pixel_centres(WIDTH, HEIGHT, (0, HEIGHT))
    t, seen = reference.brute_force(vertices, triangles, projection, x, y)
    assert ((seen >= 0) & (seen < len(FACES))).sum() > 100
    scene = scene or CastScene(vertices, triangles)
    return wrong(reference.cast_image(scene, projection, WIDTH, HEIGHT, pixel_error), t).sum()


@pytest.mark.parametrize("name", VOLUMES)
@pytest.mark.parametrize("large", LARGE)
def test_silhouettes_beside_one_large_thing(reference, large, name):
    # A tenth of a pixel decides at silhouettes of curved volumes, as it does without the large thing.
    most = 4 if name == "curved" else 0
    for size in SIZES:
        assert image_of(reference, *joined([cube(), LARGE[large](size)]), VOLUMES[name]) <= most, size


ON_GROUND = [cube(), LARGE["ground that the cube stands in"](1e6)]


@pytest.mark.parametrize(("name", "size"), [("straight", 1e7), ("curved", 1e4)])
@pytest.mark.parametrize("large", LARGE)
def test_exact_silhouettes_beside_one_large_thing(reference, large, name, size):
    mesh = joined([cube(), LARGE[large](size)])
    assert image_of(reference, *mesh, VOLUMES[name], pixel_error=0.0) == 0


def test_exact_casting_takes_no_longer_beside_a_large_thing(reference):
    """Rays, not a clock."""
    balls = [sphere(1.0, (2.2 * k, 0.1 * k, -abs(k))) for k in (-1, 0, 1)]
    counts = {}
    for size in (0, 1e3, 1e5):
        counts[size] = CastCounts()
        scene = CastScene(*joined(balls + ([sphere(size)] if size else [])))
        reference.cast_image(scene, VOLUMES["straight"], WIDTH, HEIGHT, 0.0, counts=counts[size])
    assert max(count.rays for count in counts.values()) < 2 * counts[0].rays
    assert max(count.tested for count in counts.values()) < 2 * counts[0].tested


MOVED = {
    "far from the origin": (joined(ON_GROUND), np.array([3e5, 2e5, -4e5])),
    "with a thing a million times as fine": (joined([*ON_GROUND, cube(1e-6, (0.1, 0.7, 0.1))]), np.zeros(3)),
    "with some cubes far away": (
        joined([*ON_GROUND, *(cube(2.0, (-9e5, 9e5, z)) for z in (0, 4))]),
        np.zeros(3),
    ),
}


@pytest.mark.parametrize(("mesh", "moved"), MOVED.values(), ids=MOVED)
def test_silhouettes_wherever_the_scene_is(reference, mesh, moved):
    matrix = np.eye(4)
    matrix[:3, 3] = moved
    vertices, triangles = mesh
    projection = VOLUMES["straight"].transformed(matrix)
    assert image_of(reference, vertices + moved, triangles, projection) <= (1 if moved.any() else 0)


def hit_by_any(origins, directions, corners):
    """Return whether rays (3, N) hit any of triangles (T, 3, 3), by Cramer's rule."""
    hit = np.zeros(origins.shape[1], bool)
    for a, b, c in corners:
        matrix = np.stack(np.broadcast_arrays((b - a)[:, None], (c - a)[:, None], -directions), axis=-1)
        with np.errstate(all="ignore"):
            solved = np.linalg.solve(matrix.transpose(1, 0, 2), (origins - a[:, None]).T[..., None])
        u, v, far = solved[..., 0].T
        hit |= (u >= 0) & (v >= 0) & (u + v <= 1) & (far > 0)
    return hit


@pytest.mark.parametrize("size", SIZES)
def test_shadows_on_a_large_ground_begin_at_the_thing(size):
    vertices, triangles = joined([cube(), plane(SLANTED, size, -0.3)])
    scene = CastScene(vertices, triangles)
    (a, b, _, d), generator = vertices[len(CORNERS) :], np.random.default_rng(5)
    at = generator.uniform(-3.0, 3.0, (2, 4000)) / (2 * size) + 0.5
    ground = (a[:, None] + np.outer(b - a, at[0]) + np.outer(d - a, at[1])).astype(float)
    sun = np.repeat(np.array([[0.5], [0.8], [0.3]]), 4000, axis=1)
    expected = hit_by_any(ground, sun, vertices[FACES])
    triangle = np.where(at[0] < at[1], len(FACES) + 1, len(FACES))
    inside = (ground - scene.centre[:, None]) * scene.scale
    origins = scene.offset_origins(inside, triangle, sun)
    found = scene.occluded(origins, sun, np.full(4000, np.inf))
    assert expected.sum() > 200
    # Where the plane leaves the cube, and at the shadow's edge.
    assert (found != expected).sum() <= 4


def test_mirrored_rays_beside_a_large_thing(reference):
    vertices, triangles = joined([cube(), LARGE["ground that the cube stands in"](1e7)])
    scene, count = CastScene(vertices, triangles), 2000
    generator = np.random.default_rng(3)
    origins = generator.normal(size=(3, count)) + np.array([[0.0], [3.0], [0.0]])
    directions = generator.normal(size=(3, count)) * 0.3 - origins
    directions /= np.linalg.norm(directions, axis=0)
    hits = cast_rays(scene, (origins - scene.centre[:, None]) * scene.scale, directions)
    expected = hit_by_any(origins, directions, vertices[FACES])
    assert expected.sum() > 200
    # Those that meet the ground first are among those that meet the cube.
    on_cube = (hits.triangle >= 0) & (hits.triangle < len(FACES))
    assert not (on_cube & ~expected).any()
    ground = hits.triangle >= len(FACES)
    place = hits.position[:, ground] / scene.scale + scene.centre[:, None]
    assert not hit_by_any(place, origins[:, ground] - place, vertices[FACES]).any()


def test_parts_of_a_scene_are_as_precise(reference):
    """Boxes that image layers cut out, the still part of Live View, and parts by ray visibility."""
    vertices, triangles = joined(
        [cube(), LARGE["ground that the cube stands in"](1e6), cube(1.0, (9.0, 9, 9))]
    )
    scene, kept = CastScene(vertices, triangles), np.ones(len(triangles), bool)
    kept[len(FACES) + 2 :] = False
    box = np.array([-5.0, -5.0, -5.0]), np.array([5.0, 5.0, 5.0])
    lower, upper = ((side - scene.centre) * scene.scale for side in box)
    for part in (scene.only(kept), scene.enclosed(kept, lower, upper), scene.keeping(kept)):
        assert image_of(reference, vertices, triangles[kept], VOLUMES["straight"], part) == 0


def edges_of(pieces):
    """The number of pieces (3 corners, 3, M) that have each edge; edges as pairs of corners."""
    names = {}
    number = [[names.setdefault(tuple(corner), len(names)) for corner in corners.T] for corners in pieces]
    pairs = np.concatenate([np.sort([number[k], number[(k + 1) % 3]], axis=0) for k in range(3)], axis=1)
    return np.unique(pairs, axis=1, return_counts=True)[1]


def test_pieces_leave_no_gap():
    """Each edge inside belongs to two pieces, also where triangles have no common vertices."""
    a, b, c, d = (SLANTED * 1e5 + [0.1, -0.3, 0.2]) / 1e5
    corners = np.stack([np.stack([a, c]), np.stack([b, d]), np.stack([c, a])]).transpose(0, 2, 1)
    pieces, owner = graded(corners, 1e-4)
    counts = edges_of(pieces)
    assert set(counts) == {1, 2} and 100 < pieces.shape[2] < 2000
    # The border has those edges that are its own.
    border = np.linalg.norm(np.diff([a, b, c, d, a], axis=0), axis=1)
    assert (counts == 1).sum() < 30 * len(border)
    area = np.linalg.norm(np.cross(pieces[1] - pieces[0], pieces[2] - pieces[0], axis=0), axis=0) / 2
    whole = np.linalg.norm(np.cross(b - a, c - a)) / 2
    np.testing.assert_allclose(np.bincount(owner, area), whole, rtol=1e-12)
    longest = np.linalg.norm(pieces - pieces[[1, 2, 0]], axis=1)
    assert (longest <= np.maximum(1e-4, np.linalg.norm(pieces + pieces[[1, 2, 0]], axis=1) / 2)).all()


def test_ordinary_scenes_are_built_as_they_are():
    scene = CastScene(*joined([cube(), plane(GROUND, 50.0, -0.5)]))
    assert scene.core == np.inf and scene.mesh._numbers is None


def test_counts_stay_one_ray_a_pixel(reference):
    counts = CastCounts()
    scene = CastScene(*joined([cube(), LARGE["sky"](1e6)]))
    reference.cast_image(scene, VOLUMES["straight"], WIDTH, HEIGHT, counts=counts)
    assert counts.rays == WIDTH * HEIGHT and counts.unresolved == 0
