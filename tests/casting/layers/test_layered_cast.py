# SPDX-License-Identifier: GPL-3.0-or-later
"""Who is in front in an image with layers, against a list of the keys of all triangles on every projector."""

from dataclasses import replace
from itertools import pairwise

import numpy as np
import pytest

from scfpf_addon.casting.common.geometry import Geometry
from scfpf_addon.casting.common.hits import CastCounts
from scfpf_addon.casting.frame import pixel_centres
from scfpf_addon.casting.layers.layer_parts import LayerParts
from scfpf_addon.casting.layers.layered_cast import LayeredCast, LayeredProjectors
from scfpf_addon.casting.scene.cast_scene import CastScene
from scfpf_addon.projection.surfaces.surface import Plane
from scfpf_addon.projection.volume.viewing_volume import ImageLayer, Projection, ViewingVolume

SIDE = 24
SCENES = 50
CORNERS = ((0, 0), (1, 0), (1, 1), (0, 1))
FRONTS = ("DEPTH", "ANCHOR", "ORDER")


def view(generator):
    """A frustum from a random place that looks about the origin."""
    turn = np.linalg.qr(generator.normal(size=(3, 3)))[0]
    planes = []
    for depth, width in ((1.0, 0.6), (9.0, 5.0)):
        matrix = np.eye(4)
        matrix[:3, :3], matrix[:3, 3] = turn, turn[:, 2] * (5.0 - depth) + generator.normal(size=3) * 0.1
        planes.append(Plane(matrix=matrix, width=width, height=width))
    return Projection(ViewingVolume(tuple(planes)))


def random_case(seed):
    """Triangles in 0 to 8 layers, the projection with these, and the cast."""
    generator = np.random.default_rng(seed)
    count = 40
    centre = generator.uniform(-1.5, 1.5, (count, 1, 3))
    vertices = (centre + generator.normal(size=(count, 3, 3)) * 0.5).reshape(-1, 3)
    triangles = np.arange(3 * count, dtype=np.int32).reshape(-1, 3)
    layers = 1 + seed % 8
    eye = generator.normal(size=3) * 4
    projection = replace(
        view(generator),
        layers=tuple(
            ImageLayer(view(generator), FRONTS[(seed + k) % 3], eye, halo=0.5 * (k % 2))
            for k in range(layers)
        ),
    )
    numbers = generator.integers(0, layers + 1, count).astype(np.uint8)
    nothing = np.zeros(count, np.int32)
    geometry = Geometry(vertices, triangles, None, nothing, nothing, image_layer=numbers)
    scene = CastScene(vertices, triangles)
    inside = projection.transformed(scene.matrix)
    parts = LayerParts.of(geometry.image_layer, scene, inside.layers)
    made = LayeredCast(parts=parts, projection=inside, pixel_size=(1 / SIDE, 1 / SIDE), pixel_error=0.1)
    return projection, vertices[triangles], numbers, made


def all_hits(projection, corners, x, y):
    """t (T, N) of every projector in every triangle, infinite for misses: Möller and Trumbore (1997)."""
    start, end = projection.projectors(x, y).points
    way = (end - start).T
    first, along, across = corners[:, 0], corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0]
    normal = np.cross(way[None], across[:, None])
    volume = np.einsum("tnc,tc->tn", normal, along)
    off = start.T[None] - first[:, None]
    u = np.einsum("tnc,tnc->tn", off, normal) / volume
    turned = np.cross(off, along[:, None])
    v = np.einsum("nc,tnc->tn", way, turned) / volume
    t = np.einsum("tc,tnc->tn", across, turned) / volume
    return np.where((u >= 0) & (v >= 0) & (u + v <= 1) & (t >= 0) & (t <= 1), t, np.inf)


def listed(projection, corners, numbers, x, y):
    """The keys of all that is seen: (key, layer, triangle) of each position, sorted."""
    layers = projection.layers
    found = [[] for _ in x]
    for number, own in enumerate(projection.of_layers):
        members = corners[numbers == number]
        if not len(members) and number:
            continue
        layer = layers[max(number - 1, 0)]
        t = all_hits(own, corners, x, y)
        start, end = own.projectors(x, y).points
        low, high = (f(members.reshape(-1, 3), axis=0) for f in (np.min, np.max)) if number else (0, 0)
        for triangle, pixel in np.argwhere(np.isfinite(t)):
            place = start[:, pixel] + t[triangle, pixel] * (end - start)[:, pixel]
            if numbers[triangle] != number:
                off = np.linalg.norm(place - np.clip(place, low, high)) if number else np.inf
                if numbers[triangle] or not number or off > layer.halo or layer.halo == 0:
                    continue
            front = layer.front if number else "DEPTH"
            if front == "ORDER":
                key = number - len(layers) - 1
            else:
                key = np.linalg.norm(((low + high) / 2 if front == "ANCHOR" else place) - layer.eye)
            found[pixel].append((key, number, t[triangle, pixel], triangle))
    return [sorted(each) for each in found]


@pytest.mark.parametrize("seed", range(SCENES))
def test_the_nearest_key_of_all_is_in_front(seed):
    projection, corners, numbers, layered = random_case(seed)
    x, y = pixel_centres(SIDE, SIDE, (0, SIDE))
    hits, layer = layered.first_hits(x, y, CastCounts(), SIDE)
    for k, keys in enumerate(listed(projection, corners, numbers, x, y)):
        # Of each layer the first hit alone counts: keys of one projector may fall.
        first = {}
        for key, number, t, triangle in keys:
            if number not in first or t < first[number][2]:
                first[number] = (key, number, t, triangle)
        best = min(first.values()) if first else None
        expected = (best[3], best[1]) if best else (-1, 0)
        assert (hits.triangle[k], layer[k]) == expected


@pytest.mark.parametrize("halo", [0.0, 0.5])
@pytest.mark.parametrize("seed", range(0, SCENES, 5))
def test_hits_behind_transparent_ones_come_by_their_keys(seed, halo):
    projection, corners, numbers, layered = random_case(seed)
    # With keys that rise along projectors.
    eye = projection.layers[0].eye
    layers = tuple(
        replace(layer, halo=halo, front="ORDER" if k % 2 else "ANCHOR", eye=eye)
        for k, layer in enumerate(projection.layers)
    )
    projection = replace(projection, layers=layers)
    scene = layered.parts.whole
    inside = projection.transformed(scene.matrix)
    rest = LayerParts.of(numbers, scene, inside.layers)
    layered = replace(layered, projection=inside, parts=rest)
    x, y = pixel_centres(SIDE, SIDE, (0, SIDE))
    hits, _layer = layered.first_hits(x, y, CastCounts(), SIDE)
    tile = LayeredProjectors(layered, x, y, hits.mask)
    which = np.flatnonzero(hits.triangle >= 0)
    after = tile.next_hits(which, hits.t[which], hits.triangle[which])
    lists = listed(projection, corners, numbers, x, y)
    compared = 0
    for k, triangle in zip(which, after.triangle, strict=True):
        own = [each for each in lists[k] if each[1] == 0]
        # Hits in the halo of another layer continue as those of layer 0.
        if any(a[2] > b[2] for a, b in pairwise(own)) or (lists[k][0][1] and not numbers[lists[k][0][3]]):
            continue
        expected = lists[k][1][3] if len(lists[k]) > 1 else -1
        compared += 1
        assert triangle == expected
    assert compared > SIDE


@pytest.mark.parametrize("seed", range(8))
def test_layers_cost_rays_only_where_their_things_may_be_seen(seed):
    generator = np.random.default_rng(seed)
    base = view(generator)
    near, far = base.volume.surfaces
    axes = near.matrix[:3, :3].T
    ends = [base.projectors(np.array([x]), np.array([y])).points[:, :, 0] for x, y in CORNERS]
    # A box that fills a fifth of the image, turned by chance in space as the camera is.
    share = np.sqrt(0.2)
    corners = [e[0] + (e[1] - e[0]) * t for e in ends for t in (0.5, 0.52)]
    middle = np.mean(corners, axis=0)
    box = middle + (np.array(corners) - middle) * share
    wall = np.array([[-9, -9, 0], [9, -9, 0], [9, 9, 0], [-9, 9, 0]]) @ axes + far.matrix[:3, 3] * 0.9
    vertices = np.concatenate([box, wall])
    triangles = np.array([[0, 2, 4], [0, 4, 6], [1, 3, 5], [1, 5, 7], [8, 9, 10], [8, 10, 11]], np.int32)
    nothing = np.zeros(6, np.int32)
    numbers = np.array([1, 1, 1, 1, 0, 0], np.uint8)
    geometry = Geometry(vertices, triangles, None, nothing, nothing, image_layer=numbers)
    scene = CastScene(vertices, triangles)
    projection = replace(base, layers=(ImageLayer(base, "DEPTH", np.zeros(3)),)).transformed(scene.matrix)
    parts = LayerParts.of(geometry.image_layer, scene, projection.layers)
    made = LayeredCast(parts=parts, projection=projection, pixel_size=(0.01, 0.01), pixel_error=0.1)
    x, y = pixel_centres(100, 100, (0, 100))
    counts = CastCounts()
    hits, _layer = made.first_hits(x, y, counts, 100)
    seen = made.hits_of(1, np.arange(len(x)), x, y, CastCounts()).triangle >= 0
    assert 0.15 < seen.mean() < 0.25 and (hits.triangle >= 0).all()
    assert counts.projectors == 10_000 and counts.rays <= 1.3 * 10_000


def test_a_feather_shows_the_ground_as_often_as_its_distance_says():
    matrix = np.diag([1.0, -1.0, -1.0, 1.0])
    high, low = (matrix + np.eye(4)[:, 2:3] * z * np.eye(4)[3] for z in (5.0, -1.0))
    base = Projection(ViewingVolume(tuple(Plane(matrix=each, width=8, height=8) for each in (high, low))))
    thing = np.array([[-4, -9, 1.0], [0, -9, 1.0], [0, 9, 1.0], [-4, 9, 1.0]])
    ground = np.array([[-9, -9, 0.0], [9, -9, 0.0], [9, 9, 0.0], [-9, 9, 0.0]])
    vertices, quad = np.concatenate([thing, ground]), np.array([[0, 1, 2], [0, 2, 3]], np.int32)
    triangles, numbers = np.concatenate([quad, quad + 4]), np.array([1, 1, 0, 0], np.uint8)
    scene = CastScene(vertices, triangles)
    layer = ImageLayer(base, "ORDER", np.zeros(3), halo=2.5, feather=0.6)
    projection = replace(base, layers=(layer,)).transformed(scene.matrix)
    made = LayeredCast(
        parts=LayerParts.of(numbers, scene, projection.layers),
        projection=projection,
        pixel_size=(0.005, 0.005),
        pixel_error=0.1,
    )
    x, y = pixel_centres(200, 200, (0, 200))
    _hits, shown = made.first_hits(x, y, CastCounts(), 200)
    # The ground is 1 below the thing's box, whose side is at x = 0; columns are 0.04 apart.
    distance = np.hypot((np.arange(100) + 0.5) * 0.04, 1.0)
    left = np.clip((2.5 - distance) / (0.6 * 2.5), 0.0, 1.0)
    share = left**2 * (3.0 - 2.0 * left)
    found = shown.reshape(200, 200)[:, 100:].mean(axis=0)
    # Four standard deviations of 200 throws of a coin, and of means over ten columns.
    assert np.abs(found - share).max() < 4 * np.sqrt(0.25 / 200)
    assert np.abs((found - share).reshape(10, 10).mean(axis=1)).max() < 4 * np.sqrt(0.25 / 2000)
    assert (found[share == 0.0] == 0.0).all() and (shown.reshape(200, 200)[:, :100] == 1).all()


def test_a_mask_shows_a_layer_in_part():
    _projection, _corners, _numbers, layered = random_case(1)
    mask = np.zeros((2, 2))
    mask[:, 1] = 1.0
    layers = tuple(replace(layer, mask=mask) for layer in layered.projection.layers)
    part = replace(layered, projection=replace(layered.projection, layers=layers))
    x, y = pixel_centres(SIDE, SIDE, (0, SIDE))
    full, layer = layered.first_hits(x, y, CastCounts(), SIDE)
    hits, shown = part.first_hits(x, y, CastCounts(), SIDE)
    right = x > 0.5
    assert (shown[~right] == 0).all() and shown[right].any()
    np.testing.assert_array_equal(hits.t[right], full.t[right])
    np.testing.assert_array_equal(shown[right], layer[right])


@pytest.mark.parametrize("seed", range(0, SCENES, 10))
def test_samples_that_are_cast_together_are_those_cast_alone(seed):
    _projection, _corners, _numbers, layered = random_case(seed)
    x, y = pixel_centres(SIDE, SIDE, (0, SIDE))
    samples = [(x + step / SIDE, y - step / SIDE) for step in (-0.3, 0.1, 0.4)]
    rests = [layered.rest_hits(*each, CastCounts(), SIDE) for each in samples]
    together = layered.in_front(*map(np.concatenate, zip(*samples, strict=True)), rests, CastCounts())
    for place, found in zip(samples, together, strict=True):
        alone = layered.first_hits(*place, CastCounts(), SIDE)
        np.testing.assert_array_equal(found.layer, alone.layer)
        for one, other in zip(found.hits, alone.hits, strict=True):
            np.testing.assert_array_equal(one, other)
