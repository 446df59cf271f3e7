# SPDX-License-Identifier: GPL-3.0-or-later
"""Casting through every sort of volume: where nothing may change, and where things degenerate."""

import math
from dataclasses import replace

import numpy as np
import pytest

from benchmarks.scenes import bent_projection, boxes, columns, frame_at, sheet, terrain
from scfpf_addon.casting.cast import CastCounts, cast
from scfpf_addon.casting.common.hits import CastError
from scfpf_addon.casting.curves.projector_batch import ProjectorBatch
from scfpf_addon.casting.frame import pixel_centres
from scfpf_addon.casting.scene.cast_scene import CastScene
from scfpf_addon.projection.surfaces.surface import Cylinder, Disc, Grid, Plane, Point, SphereSector
from scfpf_addon.projection.volume.basis import span_basis
from scfpf_addon.projection.volume.reparameterisation import Polar
from scfpf_addon.projection.volume.viewing_volume import Projection, ViewingVolume

WIDTH, HEIGHT = 96, 54
SIZE = (1 / WIDTH, 1 / HEIGHT)


def placed(surface, x, y, z):
    matrix = np.eye(4)
    matrix[:3, 3] = x, y, z
    return surface.transformed(matrix)


def same_depth(one, other, tolerance=1e-9):
    """Pixels (N,) that see the same t."""
    a, b = (np.where(np.isfinite(h.t), h.t, 2.0) for h in (one, other))
    return np.abs(a - b) < tolerance


def agreement(one, other, tolerance=1e-9):
    """Share of pixels with the same t and triangle."""
    return float(np.mean(same_depth(one, other, tolerance) & (one.triangle == other.triangle)))


@pytest.mark.parametrize(("degree", "angle"), [(1, 0), (2, 60), (3, 180)])
@pytest.mark.parametrize("offset", [(1e6, -2e6, 5e5), (-1e4, 0, 3e3)])
def test_a_scene_far_from_the_origin_looks_the_same(reference, degree, angle, offset):
    vertices, triangles = columns(3000)
    projection = bent_projection(degree, math.radians(angle))
    matrix = np.eye(4)
    matrix[:3, 3] = offset
    here = reference.cast_image(CastScene(vertices, triangles), projection, WIDTH, HEIGHT)
    there = CastScene(vertices + matrix[:3, 3], triangles)
    moved = reference.cast_image(there, projection.transformed(matrix), WIDTH, HEIGHT)
    assert agreement(here, moved, 1e-8) > 0.9995
    assert (here.triangle >= 0).mean() > 0.5


@pytest.mark.parametrize("factor", [1e-4, 1e4])
def test_scale_does_not_matter(reference, factor):
    vertices, triangles = boxes(3000)
    projection = bent_projection(2, math.radians(60))
    matrix = np.diag([factor, factor, factor, 1.0])
    here = reference.cast_image(CastScene(vertices, triangles), projection, WIDTH, HEIGHT)
    scaled = CastScene(vertices * factor, triangles)
    there = reference.cast_image(scaled, projection.transformed(matrix), WIDTH, HEIGHT)
    assert agreement(here, there, 1e-11) > 0.9995


def test_a_straight_volume_of_higher_degree_is_cast_like_the_straight_one(reference):
    scene = CastScene(*boxes(3000))
    near, far = Plane(1.0, 0.6), placed(Plane(21.0, 12.6), 2, 0, -20)
    straight = Projection(ViewingVolume((near, far)), aspect=16 / 9)
    plain = reference.cast_image(scene, straight, WIDTH, HEIGHT)
    for count in (3, 4, 6):
        between = [k / (count - 1) for k in range(count)]
        surfaces = tuple(placed(Plane(1 + 20 * s, 0.6 + 12 * s), 2 * s, 0, -20 * s) for s in between)
        for basis, most in (("BEZIER", 1), ("POLYLINE", count - 1)):
            counts = CastCounts()
            raised = replace(straight, volume=ViewingVolume(surfaces, basis))
            hits = reference.cast_image(scene, raised, WIDTH, HEIGHT, counts=counts)
            # Two triangles may share a hit, so only t is compared.
            assert same_depth(plain, hits).mean() > 0.999
            assert counts.chords <= most * counts.projectors
            np.testing.assert_allclose(hits.tangent, plain.tangent, atol=1e-10)


def test_a_straight_volume_of_uneven_speed_hits_the_same_points(reference):
    scene = CastScene(*boxes(3000))
    straight = Projection(ViewingVolume((Plane(1, 0.6), placed(Plane(21, 12.6), 2, 0, -20))))
    middle = placed(Plane(1 + 20 * 0.2, 0.6 + 12 * 0.2), 0.4, 0, -4)
    uneven = Projection(ViewingVolume((straight.volume.surfaces[0], middle, straight.volume.surfaces[1])))
    counts = CastCounts()
    one = reference.cast_image(scene, straight, WIDTH, HEIGHT)
    other = reference.cast_image(scene, uneven, WIDTH, HEIGHT, counts=counts)
    same = np.linalg.norm(one.position - other.position, axis=0) < 1e-9
    assert same.mean() > 0.999 and 0 < counts.chords <= counts.projectors
    assert counts.refined == 0


def test_near_and_far_surface_clip(reference):
    wall = np.array([[-9.0, -9, 0], [9, -9, 0], [9, 9, 0], [-9, 9, 0]])
    walls = np.concatenate([wall + np.array([0, 0, z]) for z in (-1.0, -5.0, -9.0)])
    faces = np.concatenate([np.array([[0, 1, 2], [0, 2, 3]]) + 4 * k for k in range(3)]).astype(np.int32)
    scene = CastScene(walls, faces)
    for depths, expected in (
        ((0, -10), 0),
        ((-2, -10), 1),
        ((-6, -8), None),
        ((-8, -2), 1),
        ((-2, -5.001), 1),
    ):
        for count in (2, 3):
            surfaces = tuple(placed(Plane(), 0, 0, z) for z in np.linspace(*depths, count))
            for basis in ("BEZIER", "POLYLINE"):
                hits = reference.cast_image(scene, Projection(ViewingVolume(surfaces, basis)), 8, 8)
                if expected is None:
                    assert (hits.triangle == -1).all()
                else:
                    assert (hits.triangle // 2 == expected).all()
                    z = -1.0 - 4.0 * expected
                    np.testing.assert_allclose(hits.t, (depths[0] - z) / (depths[0] - depths[1]), atol=1e-12)


@pytest.mark.parametrize("distance", [1e3, 1e5, 1e7])
@pytest.mark.parametrize("count", [2, 3])
def test_a_volume_much_larger_than_the_scene_keeps_its_precision(reference, distance, count):
    vertices, triangles = terrain(2000)
    scene = CastScene(vertices, triangles)

    def parallel(reach):
        turn = np.array([[1, 0, 0, 6], [0, 0, 1, 0], [0, -1, 0, -12], [0, 0, 0, 1.0]])
        surfaces = [
            placed(Plane(20, 20), 0.01 * z, 0, z).transformed(turn) for z in np.linspace(reach, -reach, count)
        ]
        return Projection(ViewingVolume(tuple(surfaces)))

    near = reference.cast_image(scene, parallel(10.0), 64, 64)
    far = reference.cast_image(scene, parallel(distance), 64, 64)
    assert (near.triangle >= 0).all()
    assert (near.triangle == far.triangle).mean() > 0.998
    same = near.triangle == far.triangle
    np.testing.assert_allclose(near.position[:, same], far.position[:, same], atol=1e-15 * distance + 1e-11)


def regular_grid(cells):
    x, y = np.meshgrid(np.linspace(-1, 1, cells + 1), np.linspace(-1, 1, cells + 1))
    return sheet(np.stack([x, y, np.zeros_like(x)], axis=-1))


def test_no_projector_slips_through_a_vertex():
    # Perspective rays through all vertices and edge middles of a grid.
    cells = 256
    scene = CastScene(*regular_grid(cells))
    pixels = 2 * (cells - 2) + 1
    width = pixels / cells
    volume = ViewingVolume(
        (placed(Plane(0.2 * width, 0.2 * width), 0, 0, 2.4), placed(Plane(2 * width, 2 * width), 0, 0, -3))
    )
    x, y = pixel_centres(pixels, pixels, (0, pixels))
    inside = Projection(volume).transformed(scene.matrix)
    assert (cast(scene, inside, x, y, (1 / pixels, 1 / pixels)).triangle >= 0).all()


def finite(hits):
    return all(np.isfinite(a).all() for a in (hits.position, hits.tangent, hits.barycentric))


def test_point_surfaces_poles_and_polar_centres(reference):
    scene = CastScene(*boxes(6000))
    centre = (6.0, 0.5, -12.0)
    spheres = [placed(SphereSector(r), *centre) for r in (0.01, 3.0, 30.0)]
    tilted = spheres[1].transformed(np.diag([1.0, 1.0, 1.02, 1.0]))
    point = placed(Point(), *centre)
    disc = placed(Disc(2.0), 6, 0.5, -13)
    volumes = [
        Projection(ViewingVolume((point, spheres[2]))),
        Projection(ViewingVolume((point, tilted, spheres[2]))),
        Projection(ViewingVolume((spheres[0], tilted, spheres[2]))),
        Projection(ViewingVolume((point, placed(Cylinder(3, 6.0, 2), *centre), spheres[2]), "POLYLINE")),
        Projection(ViewingVolume((point, disc, placed(Disc(40.0), 9, 0.5, -40))), Polar()),
        Projection(ViewingVolume((placed(Disc(0.1), *centre), placed(SphereSector(30), *centre))), Polar()),
    ]
    for projection in volumes:
        for width, height in ((64, 33), (33, 33)):  # odd: pixels exactly on poles, seams and centres
            for grid in (True, False):
                counts = CastCounts()
                hits = reference.cast_image(scene, projection, width, height, 0.1, grid, counts)
                assert finite(hits) and (hits.triangle >= 0).mean() > 0.1
                assert counts.chords < 300 * counts.projectors
    # The first of them, curved in name only, is the second with an even middle.
    even = Projection(ViewingVolume((point, spheres[2], spheres[2])))
    one = reference.cast_image(scene, volumes[0], 64, 33)
    other = reference.cast_image(scene, even, 64, 33)
    assert (one.triangle == other.triangle).mean() > 0.999


def test_the_corners_of_a_polar_image_show_nothing(reference):
    scene = CastScene(*terrain(200))
    turn = np.array([[1, 0, 0, 6], [0, 0, 1, 5], [0, -1, 0, -12], [0, 0, 0, 1.0]])
    for count in (2, 3):
        surfaces = tuple(
            placed(Disc(1.0 + k), 0, 0.1 * k * k, -9.0 * k / (count - 1)).transformed(turn)
            for k in range(count)
        )
        hits = reference.cast_image(scene, Projection(ViewingVolume(surfaces), Polar()), 40, 40)
        x, y = pixel_centres(40, 40, (0, 40))
        shown = np.hypot(x - 0.5, y - 0.5) <= 0.5
        assert (hits.mask == shown).all()
        assert (hits.triangle[~shown] == -1).all() and not hits.tangent[:, ~shown].any()
        assert (hits.triangle[shown] >= 0).all()


@pytest.mark.parametrize("value", [np.nan, np.inf, 1e300])
@pytest.mark.parametrize("count", [2, 3])
def test_projectors_that_are_not_finite_miss(reference, value, count):
    scene = CastScene(*boxes(3000))
    grids = []
    for k in range(count):
        z = -24.0 * k / (count - 1)
        x, y = np.meshgrid(np.linspace(-1, 1, 9) * (1 - z / 2), np.linspace(-1, 1, 5) * (1 - z / 4))
        grids.append(Grid(np.stack([x + 0.001 * z * z, y, np.full_like(x, z)], axis=-1)))
    whole = reference.cast_image(scene, Projection(ViewingVolume(tuple(grids))), WIDTH, HEIGHT)
    broken = grids[-1].points.copy()
    broken[2, 4] = value
    for basis in ("BEZIER", "POLYLINE"):
        volume = ViewingVolume((*grids[:-1], Grid(broken)), basis)
        hits = reference.cast_image(scene, Projection(volume), WIDTH, HEIGHT)
        assert 0.7 < hits.mask.mean() < 0.9 and finite(hits)
        assert (hits.triangle[~hits.mask] == -1).all() and np.isinf(hits.t[~hits.mask]).all()
        if basis == "BEZIER":
            # Chords of the whole volume and of the broken one differ, each within the pixel error.
            assert (hits.triangle == whole.triangle)[hits.mask].mean() > 0.997


def test_projectors_without_length_miss(reference):
    scene = CastScene(*boxes(600))
    for count in (2, 3):
        hits = reference.cast_image(scene, Projection(ViewingVolume((Plane(),) * count)), 16, 9)
        assert (hits.triangle == -1).all() and finite(hits)


def test_holes_of_a_surface_show_nothing(reference):
    class Window(Plane):
        def positions(self, u, v):
            return super().positions(u, v)._replace(valid=u < 0.5)

    scene = CastScene(*terrain(200))
    turn = np.array([[1, 0, 0, 6], [0, 0, 1, 5], [0, -1, 0, -12], [0, 0, 0, 1.0]])
    surfaces = (Plane(), placed(Window(), 0.5, 0, -5), placed(Plane(), 0, 0, -9))
    for used in (surfaces[1:], surfaces):
        volume = ViewingVolume(tuple(s.transformed(turn) for s in used))
        hits = reference.cast_image(scene, Projection(volume), 20, 20)
        left = pixel_centres(20, 20, (0, 20))[0] < 0.5
        assert (hits.mask == left).all() and ((hits.triangle >= 0) == left).all()


def test_a_projector_that_stands_still_for_an_instant_has_a_direction():
    points = np.zeros((3, 3, 3))
    points[:, 2] = [[0, 0, 0], [0, 0, -1], [-4, -2, -1]]
    batch = ProjectorBatch(span_basis("BEZIER", 3), points)
    t = np.array([0.0, 0.0, 1.0])
    tangent = batch.at(t)[1]
    assert not tangent.any()
    batch.steer(t, tangent)
    assert (tangent[2] < 0).all() and not tangent[:2].any()
    cubic = ProjectorBatch(
        span_basis("BEZIER", 4), np.array([0.0, 0, 0, -2])[:, None, None] * np.ones((1, 3, 1))
    )
    tangent = cubic.at(np.zeros(1))[1]
    cubic.steer(np.zeros(1), tangent)
    assert (tangent < 0).all()


def test_sheets_close_behind_each_other_are_told_apart(reference):
    vertices, triangles = regular_grid(24)
    gap = np.array([0, 0, 1e-5])
    both = np.concatenate([triangles, triangles + len(vertices)]).astype(np.int32)
    scene = CastScene(np.concatenate([vertices, vertices - gap]), both)
    surfaces = tuple(
        frame_at(np.array([x, 0, z]), turn, 0.8, 0.8)
        for x, z, turn in ((0, 1, 0), (0.1, 0, 0.1), (0, -1, -0.1))
    )
    for grid in (True, False):
        hits = reference.cast_image(scene, Projection(ViewingVolume(surfaces)), 64, 64, 0.1, grid)
        assert (hits.triangle >= 0).all()
        assert (hits.triangle < len(triangles)).mean() > 0.999


def test_counts_are_sane(reference):
    scene = CastScene(*boxes(6000))
    straight, curved = CastCounts(), CastCounts()
    reference.cast_image(scene, bent_projection(1, 0), WIDTH, HEIGHT, counts=straight)
    pixels = WIDTH * HEIGHT
    assert straight.projectors == straight.rays == straight.chords == pixels
    assert straight.error_bound == 0.0 and straight.refined == 0
    reference.cast_image(scene, bent_projection(2, 1.0), WIDTH, HEIGHT, 0.1, counts=curved)
    assert curved.projectors == pixels
    assert pixels < curved.chords < curved.rays < 100 * pixels
    assert 0 < curved.error_bound <= 0.1
    assert curved.unresolved <= curved.refined < 0.05 * pixels
    total = CastCounts()
    total.add(straight)
    total.add(curved)
    assert total.rays == straight.rays + curved.rays and total.error_bound == curved.error_bound


def test_bad_input_is_explained_and_nothing_is_nothing():
    scene = CastScene(*boxes(60))
    projection = bent_projection(2, 1.0).transformed(scene.matrix)
    x = np.array([0.25, 0.75, 0.5])
    for error in (-0.1, math.nan, math.inf):
        with pytest.raises(CastError, match="pixel error"):
            cast(scene, projection, x, x, SIZE, error)
    with pytest.raises(CastError, match="rows of 2"):
        cast(scene, projection, x, x, SIZE, columns=2)
    for degree in (1, 2):
        volume = bent_projection(degree, degree - 1.0).transformed(scene.matrix)
        assert len(cast(scene, volume, np.empty(0), np.empty(0), SIZE).t) == 0
        assert len(cast(scene, volume, x, x, SIZE).t) == 3
        assert len(cast(scene, volume, x, x, SIZE, columns=1).t) == 3
        assert len(cast(scene, volume, x[:1], x[:1], SIZE, columns=1).t) == 1


@pytest.mark.parametrize("pixel_error", [0.1, 0.0])
@pytest.mark.parametrize("basis", ["straight", "POLYLINE", "BEZIER"])
def test_no_projector_passes_a_vertex_that_it_is_aimed_at(reference, basis, pixel_error):
    """A sheet without gaps, whose vertices lie on the projectors of the pixels' centres."""
    width, height = 256, 128
    projection = bent_projection(1, 0.0, 2.0) if basis == "straight" else bent_projection(3, 1.0, 2.0)
    if basis == "POLYLINE":
        projection = Projection(ViewingVolume(projection.volume.surfaces, basis), aspect=2.0)
    x, y = pixel_centres(width, height, (0, height))
    image = projection.parameters(x, y)
    place = projection.volume.evaluate(
        image.u, image.v, 0.5 + 0.05 * np.sin(17 * x) * np.cos(13 * y)
    ).position
    scene = CastScene(*sheet(place.T.reshape(height, width, 3)))
    hits = reference.cast_image(scene, projection, width, height, pixel_error)
    assert (hits.triangle.reshape(height, width)[1:-1, 1:-1] >= 0).all()
