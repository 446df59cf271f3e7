# SPDX-License-Identifier: GPL-3.0-or-later
"""The parameters whose projectors may meet things, against triangles that known projectors pass through."""

from dataclasses import replace

import numpy as np
import pytest

from scfpf_addon.casting.common.hits import CastCounts
from scfpf_addon.casting.frame import pixel_centres
from scfpf_addon.casting.layers.layer_parts import LayerParts
from scfpf_addon.casting.layers.layered_cast import LayeredCast
from scfpf_addon.casting.layers.seen_cells import SeenCells
from scfpf_addon.casting.scene.cast_scene import CastScene
from scfpf_addon.casting.scene.occupancy import Occupancy
from scfpf_addon.projection.mappings.stack import Stack
from scfpf_addon.projection.surfaces.nurbs import NurbsPatch
from scfpf_addon.projection.surfaces.surface import Cylinder, Disc, Grid, Plane, Point, SphereSector
from scfpf_addon.projection.volume.lattice import Lattice
from scfpf_addon.projection.volume.reparameterisation import Framed, Polar, Unrolled
from scfpf_addon.projection.volume.viewing_volume import ImageLayer, Projection, ViewingVolume

BASES = ("BEZIER", "POLYLINE", "B_SPLINE", "NURBS")


def moved(surface, generator, depth):
    """A surface about a place down -Z, turned a little."""
    matrix = np.eye(4)
    matrix[:3, :3] += generator.normal(size=(3, 3)) * 0.1
    matrix[:3, 3] = *generator.normal(size=2) * 0.2, -depth
    return surface.transformed(matrix)


def curved(seed):
    """A volume of three to five surfaces of chance kinds, in which projectors are curved."""
    generator = np.random.default_rng(seed)
    if seed % 6 == 5:
        points = np.stack(np.meshgrid(*[np.linspace(-0.5, 0.5, 4)] * 3, indexing="ij")[::-1], axis=-1)
        return Lattice.through(points + generator.normal(size=points.shape) * 0.05, ("BSPLINE",) * 3).volume(
            np.diag([2.0, 2.0, 4.0, 1.0])
        )
    grid = np.stack([*np.meshgrid(np.linspace(-1, 1, 5), np.linspace(-1, 1, 4)), np.zeros((4, 5))], axis=-1)
    kinds = [
        Plane(width=2.0, height=2.0),
        Point(),
        Grid(grid + generator.normal(size=grid.shape) * 0.1),
        Disc(1.5),
        Cylinder(1.2, 2.0, 2.0),
        SphereSector(1.2, 2.0, -1.0, 1.0),
    ]
    count = 3 + seed % 3
    places = enumerate(generator.permutation(len(kinds))[:count])
    surfaces = tuple(moved(kinds[kind], generator, 2.0 * depth) for depth, kind in places)
    return ViewingVolume(surfaces, BASES[seed % len(BASES)], tuple(generator.uniform(0.5, 2.0, count)))


def cells_of(projection, corners):
    """The cells of a projection that may meet triangles, (3 components, 3 corners, T)."""
    size = np.abs(corners).max()
    matrix = np.diag([1 / size, 1 / size, 1 / size, 1.0])
    places = corners.reshape(3, -1) / size
    occupancy = Occupancy.of(corners.swapaxes(0, 1) / size)
    return SeenCells.of(projection.transformed(matrix), occupancy, places.min(axis=1), places.max(axis=1))


def met(seed):
    """A projection, parameters (2, 30) of projectors of it, and a point (3, 30) on each."""
    generator = np.random.default_rng(seed)
    low, high = np.sort(generator.uniform(size=(2, 2)), axis=0)
    projection = Projection(curved(seed), u_range=(low[0], high[0]), v_range=(low[1], high[1]))
    share = generator.uniform(size=(2, 30))
    place = low[:, None] + share * (high - low)[:, None]
    return projection, share, projection.volume.evaluate(*place, generator.uniform(size=30)).position


def about(place):
    """Small triangles about points (3, N)."""
    return place[:, None] + np.random.default_rng(0).normal(size=(3, 3, place.shape[1])) * 1e-9


@pytest.mark.parametrize("seed", range(24))
def test_cells_of_projectors_through_things_are_held(seed):
    projection, (u, v), place = met(seed)
    assert cells_of(projection, about(place)).hold(u, v).all()
    # A triangle between three projectors, and one cell for each.
    assert cells_of(projection, place[:, :3, None]).hold(u[:3], v[:3]).all()


def test_cells_of_other_projectors_are_not_held():
    for seed in range(24):
        projection, _, place = met(seed)
        # Near a point all projectors of its volume pass by.
        assert cells_of(projection, about(place[:, :1])).held[1:-1, 1:-1].mean() < 0.05


def around_a_post(base="BEZIER"):
    """Projectors that bend about the Y axis, over an image of their own in the middle of the whole."""
    places = np.linspace(-1.0, 1.0, 25)
    nets = []
    for reach, depth, bend in ((0.2, 4.0, 0.0), (2.0, 2.0, 1.5), (1.0, -2.0, 0.0)):
        x, y = np.meshgrid(places, places[::4])
        nets.append(np.stack([x * reach, y * reach, depth - bend * x**2], axis=-1))
    volume = ViewingVolume(tuple(Grid(net) for net in nets), base)
    return Projection(volume, Stack((Framed((0.5, 0.5), (0.8, 0.8)),), Unrolled()))


def layered(projection, halo):
    """A cast of a post in the layer before a wall, which the straight volume of layer 0 shows."""
    box = np.array([[x, y, z] for x in (-0.2, 0.3) for y in (-0.4, 0.3) for z in (0.0, 0.4)])
    wall = np.array([[-3, -3, -1.5], [3, -3, -1.5], [3, 3, -1.5], [-3, 3, -1.5]])
    sides = [[0, 1, 3, 2], [4, 6, 7, 5], [0, 4, 5, 1], [2, 3, 7, 6], [0, 2, 6, 4], [1, 5, 7, 3]]
    triangles = [[q[0], q[k], q[k + 1]] for q in [*sides, [8, 9, 10, 11]] for k in (1, 2)]
    numbers = np.array([1] * 12 + [0] * 2, np.uint8)
    scene = CastScene(np.concatenate([box, wall]), np.array(triangles, np.int32))
    ends = (
        np.diag([s, s, 1.0, 1.0]) + np.eye(4)[:, 2:3] * d * np.eye(4)[3] for s, d in ((0.2, 4.0), (2.0, -2.0))
    )
    base = Projection(ViewingVolume(tuple(Plane(matrix=each, width=2, height=2) for each in ends)))
    layer = ImageLayer(projection, "DEPTH", np.array([0.0, 0.0, 4.0]), halo=halo)
    inside = replace(base, layers=(layer,)).transformed(scene.matrix)
    parts = LayerParts.of(numbers, scene, inside.layers)
    return LayeredCast(parts=parts, projection=inside, pixel_size=(0.01, 0.01), pixel_error=0.1)


@pytest.mark.parametrize("halo", [0.0, 0.3])
def test_images_are_as_without_cells(halo):
    made, (x, y) = layered(around_a_post(), halo), pixel_centres(100, 100, (0, 100))
    (part,) = made.parts.parts
    assert part.cells is not None
    whole = replace(made, parts=replace(made.parts, parts=(replace(part, cells=None),)))
    found, expected = (each.first_hits(x, y, CastCounts(), 100) for each in (made, whole))
    # Edges may move by less than the pixel error: the chords are those of all that is cast.
    differ = (found.layer != expected.layer) | (found.hits.triangle != expected.hits.triangle)
    assert differ.mean() < 5e-4
    same = ~differ & (found.layer == 1)
    assert same.mean() > 0.02
    np.testing.assert_allclose(found.hits.t[same], expected.hits.t[same], atol=1e-9)


def test_few_projectors_are_cast_in_vain():
    made, (x, y) = layered(around_a_post(), 0.0), pixel_centres(100, 100, (0, 100))
    seen = made.hits_of(1, np.arange(len(x)), x, y, CastCounts()).triangle >= 0
    kept = made.may_meet(1, x, y)
    assert not (seen & ~kept).any()
    (part,) = made.parts.parts
    hull = replace(made, parts=replace(made.parts, parts=(replace(part, cells=None),))).may_meet(1, x, y)
    assert kept.sum() < 1.5 * seen.sum() < hull.sum()


@pytest.mark.parametrize("image", [Unrolled(), Polar()])
def test_parameters_outside_of_the_image_are_held(image):
    projection = Projection(curved(0), image)
    far = np.full((3, 3, 1), 9.0)
    cells = SeenCells.of(projection, Occupancy.of(far), far[0, :, 0], far[0, :, 0])
    assert not cells.held[1:-1, 1:-1].any()
    outside = np.array([-0.3, -1e-9, 1.0, 1.7])
    middle = np.full(4, 0.5)
    assert cells.hold(outside, middle).all() and cells.hold(middle, outside).all()
    assert not cells.hold(np.array([0.0, 1.0 - 1e-9]), np.array([0.0, 0.5])).any()


def test_volumes_that_do_not_know_their_boxes_have_no_cells():
    occupancy = Occupancy.of(np.zeros((3, 3, 1)))
    surfaces = (Plane(), NurbsPatch(), Plane())
    assert SeenCells.of(Projection(ViewingVolume(surfaces)), occupancy, *np.zeros((2, 3))) is None


def test_straight_layers_have_no_cells():
    ends = tuple(Grid(np.random.default_rng(k).normal(size=(3, 3, 3))) for k in range(2))
    (part,) = layered(Projection(ViewingVolume(ends)), 0.0).parts.parts
    assert part.cells is None and part.bounds is None
