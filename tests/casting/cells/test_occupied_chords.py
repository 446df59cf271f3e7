# SPDX-License-Identifier: GPL-3.0-or-later
"""Nothing lies in a chord that counts as empty, and few chords without anything count as occupied."""

import math

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from benchmarks.scenes import SCENES, bent_projection
from scfpf_addon.casting.cells import body_tree
from scfpf_addon.casting.cells import cut_triangles as cut_triangles_module
from scfpf_addon.casting.cells import occupied_chords as module
from scfpf_addon.casting.cells.body_tree import boxes_as_bodies
from scfpf_addon.casting.cells.chord_cells import SLACK, planes_around
from scfpf_addon.casting.cells.cut_triangles import cut_triangles
from scfpf_addon.casting.cells.occupied_chords import occupied_chords, separated
from scfpf_addon.casting.scene.embree_meshes import build_mesh

# Pairs of a facet's corners: every plane through three of a hull's eight points.
TRIPLES = [(i, j, k) for i in range(8) for j in range(i + 1, 8) for k in range(j + 1, 8)]


def bent_cells(seed, chords=3, rows=4, columns=5, wild=0.1):
    """Ends of the chords of bent, twisted, widening projectors, some folded: (n+1, 3, R+1, C+1)."""
    generator = np.random.default_rng(seed)
    y, x = np.meshgrid(np.linspace(-1, 1, rows + 1), np.linspace(-1, 1, columns + 1), indexing="ij")
    ends = []
    for k in range(chords + 1):
        angle, size = generator.uniform(-0.4, 0.4) * k, 0.3 + generator.uniform(0, 1) * k
        sheet = np.stack(
            [x * math.cos(angle) - y * math.sin(angle), x * math.sin(angle) + y * math.cos(angle), 0 * x]
        )
        ends.append(sheet * size + generator.normal(size=(3, 1, 1)) * 0.3 + [[[0]], [[0]], [[2.0 * k]]])
    ends = np.array(ends)
    return ends + wild * generator.normal(size=ends.shape)


def hull_corners(ends):
    """The eight corners of each chord's cell, (chords, rows, columns, 8, 3)."""
    both = [ends[k : len(ends) - 1 + k] for k in (0, 1)]
    rows, columns = ends.shape[2] - 1, ends.shape[3] - 1
    corners = [end[:, :, r : rows + r, c : columns + c] for end in both for r in (0, 1) for c in (0, 1)]
    return np.stack(corners).transpose(1, 3, 4, 0, 2)


def triangles_through(points, generator, longest):
    """Triangles (3, 3, N) that contain points (N, 3): needles, dust, huge ones, degenerate ones."""
    count = len(points)
    first = generator.dirichlet(np.full(3, 0.5), count) * (1 - 1e-9) + 1e-9 / 3
    size = 10.0 ** generator.uniform(-6, longest, (2, count, 1))
    second, third = points + generator.normal(size=(2, count, 3)) * size
    # A needle, and one without area.
    needle = generator.random(count) < 0.3
    third[needle] = (second + (third - second) * 1e-7)[needle]
    flat = generator.random(count) < 0.1
    third[flat] = second[flat]
    w = first.T[:, :, None]
    return np.stack([(points - w[1] * second - w[2] * third) / w[0], second, third]).transpose(0, 2, 1)


@settings(max_examples=15, deadline=None)
@given(st.integers(0, 1 << 30), st.sampled_from([0.0, 0.02, 0.3]), st.sampled_from([0.0, 10.0, 1e4]))
def test_a_triangle_through_a_point_of_a_chord_is_found(seed, wild, far):
    """One triangle at a time, so that no other hides a miss."""
    generator = np.random.default_rng(seed)
    ends = bent_cells(seed, wild=wild) + far
    corners = hull_corners(ends)
    shape = corners.shape[:3]
    numbers = generator.integers(0, np.prod(shape), 12)
    chosen = corners.reshape(-1, 8, 3)[numbers]
    shares = generator.dirichlet(np.full(8, 0.3), len(numbers))
    triangles = triangles_through(np.einsum("nk,nkc->nc", shares, chosen), generator, 3)
    for number, triangle in zip(numbers, np.moveaxis(triangles, 2, 0), strict=True):
        found = occupied_chords(ends, [triangle[:, :, None]])
        assert found.reshape(-1)[number]


@pytest.mark.parametrize("seed", range(6))
def test_bodies_other_than_triangles_are_found(seed):
    """Boxes, and triangles somewhere on their straight way."""
    generator = np.random.default_rng(seed)
    ends = bent_cells(seed)
    corners = hull_corners(ends).reshape(-1, 8, 3)
    for number in generator.integers(0, len(corners), 20):
        point = generator.dirichlet(np.ones(8)) @ corners[number]
        size = np.abs(generator.normal(size=(2, 3))) * 10.0 ** generator.uniform(-4, 0)
        box = boxes_as_bodies((point - size[0])[:, None], (point + size[1])[:, None])
        assert box.min(axis=0)[:, 0] == pytest.approx(point - size[0])
        assert occupied_chords(ends, [box]).reshape(-1)[number]
        middle = triangles_through(point[None], generator, 0)
        way = generator.normal(size=(3, 3, 1))
        share = generator.random()
        moving = np.concatenate([middle - way * share, middle + way * (1 - share)])
        assert occupied_chords(ends, [moving]).reshape(-1)[number]


def test_rays_of_embree_hit_only_in_occupied_chords():
    """float32 rays between sheets, as a renderer has them, at scenes near and far from the origin."""
    for name, far in (("boxes", 0.0), ("columns", 0.0), ("terrain", 300.0)):
        vertices, triangles = SCENES[name](3000)
        vertices = vertices + far
        embree, _kept, _ = build_mesh(vertices.astype(np.float32), triangles)
        generator = np.random.default_rng(3)
        projection = bent_projection(3, math.radians(120))
        x, y = np.meshgrid(np.linspace(0, 1, 25), np.linspace(0, 1, 15))
        points = projection.projectors(x.ravel(), y.ravel()).points + far
        weights = projection.volume.spans.weights(np.linspace(0, 1, 13))[0]
        ends = np.einsum("kn,kcp->ncp", weights, points).reshape(13, 3, *x.shape)
        held = occupied_chords(ends, [vertices[triangles].transpose(1, 2, 0)])
        assert 0.05 < held.mean() < 0.6
        count = 200_000
        chord, row, column = (generator.integers(0, n, count) for n in held.shape)
        a, b = generator.random((2, count))
        # Places on edges and at corners of the cells too.
        a, b = np.clip(1.2 * a - 0.1, 0, 1), np.clip(1.2 * b - 0.1, 0, 1)
        places = [
            sum(
                share * ends[chord + end, :, row + r, column + c].T
                for (r, c), share in {
                    (0, 0): 1 - np.maximum(a, b),
                    (1, 1): np.minimum(a, b),
                    (0, 1): np.maximum(a - b, 0),
                    (1, 0): np.maximum(b - a, 0),
                }.items()
            )
            for end in (0, 1)
        ]
        start, end = (np.ascontiguousarray(place.T, np.float32) for place in places)
        found = embree.run(start, end - start, np.ones(count, np.float32))
        hit = found >= 0
        assert 0.02 < hit.mean() < 0.9
        assert held[chord[hit], row[hit], column[hit]].all()


def clipped_away(corners, triangle):
    """Return whether a hull (8, 3) and a triangle (3, 3) are disjoint: the hull's facets clip all of it."""
    middle = corners.mean(axis=0)
    polygon = list(triangle)
    for triple in TRIPLES:
        a, b, c = corners[list(triple)]
        normal = np.cross(b - a, c - a)
        heights = (corners - a) @ normal
        if (middle - a) @ normal > 0:
            normal, heights = -normal, -heights
        if heights.max() > 1e-9 * np.abs(heights).max() or not normal.any():
            continue
        values = [(point - a) @ normal for point in polygon]
        kept = []
        for k, point in enumerate(polygon):
            before, value = values[k - 1], values[k]
            if (before > 0) != (value > 0):
                kept.append(polygon[k - 1] + (point - polygon[k - 1]) * (before / (before - value)))
            if value <= 0:
                kept.append(point)
        polygon = kept
        if not polygon:
            return True
    return False


@pytest.mark.parametrize("size", [0.03, 0.5, 5.0])
def test_few_chords_that_triangles_miss_count_as_occupied(size):
    """Compared with exact intersections of hulls and triangles."""
    generator = np.random.default_rng(4)
    ends = bent_cells(11, wild=0.02)
    hulls = hull_corners(ends).reshape(-1, 8, 3)
    exact = held = 0
    for _ in range(20):
        middle = generator.dirichlet(np.ones(8)) @ hulls[generator.integers(len(hulls))]
        triangle = middle + generator.normal(size=(3, 3)) * size
        found = occupied_chords(ends, [triangle[:, :, None]]).reshape(-1)
        truth = np.array([not clipped_away(hull, triangle) for hull in hulls])
        assert not (truth & ~found).any()
        exact, held = exact + truth.sum(), held + found.sum()
    assert exact > 15
    assert held <= 1.3 * exact


@pytest.mark.parametrize("seed", range(4))
def test_the_trees_find_what_all_pairs_do(seed, monkeypatch):
    """Every cell against every triangle, large and small ones, few at a time and many."""
    generator = np.random.default_rng(seed)
    ends = bent_cells(seed, chords=5, rows=21, columns=19, wild=0.003)
    corners = hull_corners(ends).reshape(-1, 8, 3)
    lower, upper = corners.reshape(-1, 3).min(axis=0), corners.reshape(-1, 3).max(axis=0)
    size = 10.0 ** generator.uniform(-3, 0.5, 150)
    triangles = generator.uniform(lower, upper, (150, 3)).T + generator.normal(size=(3, 3, 150)) * size
    room = SLACK * np.abs(corners).max(axis=(1, 2))
    planes = planes_around(corners, room)
    wanted = np.zeros(len(corners), bool)
    for triangle in np.moveaxis(triangles, 2, 0):
        reach = 2.0**-22 * np.abs(triangle).max()
        box = (corners.min(axis=1) - room[:, None] <= triangle.max(axis=0) + reach).all(axis=1)
        box &= (corners.max(axis=1) + room[:, None] >= triangle.min(axis=0) - reach).all(axis=1)
        least = (planes.normals @ triangle.T).min(axis=2)
        box &= (least - reach <= planes.limits).all(axis=1)
        same = np.broadcast_to(triangle[:, :, None], (3, 3, len(corners)))
        wanted |= box & ~separated(corners.transpose(1, 2, 0), same, room + reach)
    assert 0.05 < wanted.mean() < 0.8
    # Pieces are easier to separate than their triangles.
    assert (occupied_chords(ends, [triangles]).reshape(-1) & ~wanted).mean() < 0.01
    monkeypatch.setattr(cut_triangles_module, "WASTE", np.inf)
    found = occupied_chords(ends, [triangles]).reshape(-1)
    assert not (wanted & ~found).any() and (found & ~wanted).mean() < 0.01
    monkeypatch.setattr(module, "SMALL", 0.0)
    for pairs, cells, bodies in ((50, 1, 40), (1 << 16, 1 << 17, 1 << 20)):
        monkeypatch.setattr(module, "PAIRS", pairs)
        monkeypatch.setattr(module, "CELLS_AT_ONCE", cells)
        monkeypatch.setattr(body_tree, "BODIES", bodies)
        assert np.array_equal(occupied_chords(ends, [triangles]).reshape(-1), wanted)
        parts = [triangles[:, :, :50], triangles[:, :, 50:]]
        assert np.array_equal(occupied_chords(ends, parts).reshape(-1), wanted)


def test_what_takes_too_long_counts_as_occupied(monkeypatch):
    """At every stage of the search all that it would have found is marked."""
    generator = np.random.default_rng(6)
    ends = bent_cells(6, chords=5, rows=21, columns=19, wild=0.003)
    inside = hull_corners(ends).reshape(-1, 3)
    middle = inside[generator.integers(0, len(inside), 300)]
    triangles = (middle[:, None] + generator.normal(size=(300, 3, 3)) * 0.05).transpose(1, 2, 0)
    wanted = occupied_chords(ends, [triangles])
    shares = []
    monkeypatch.setattr(module, "PAIRS", 256)
    monkeypatch.setattr(module, "MOST_PAIRS_BODY", 0)
    for most in (0, 0.1, 0.5, 1, 2, 100):
        monkeypatch.setattr(module, "MOST_PAIRS_EACH", most)
        found = occupied_chords(ends, [triangles])
        assert not (wanted & ~found).any()
        shares.append(found.mean())
    assert shares[0] == 1.0 and wanted.mean() == pytest.approx(shares[-1], abs=0.01) and shares[-1] < 0.6


@pytest.mark.parametrize("seed", range(5))
def test_cut_triangles_are_their_pieces(seed):
    """Points of triangles in a box lie in a piece of their own, and slanted wires have small boxes."""
    generator = np.random.default_rng(seed)
    start, way = generator.uniform(-1, 1, (3, 40)), generator.normal(size=(3, 40)) * 3
    thin = generator.normal(size=(3, 40)) * 10.0 ** generator.uniform(-4, 0, 40)
    triangles = np.stack([start - way, start + way, start + way + thin])
    lower, upper = -np.ones(3), np.ones(3)
    pieces, owner = cut_triangles(triangles, lower, upper)
    shares = generator.dirichlet(np.ones(3), (300, 40))
    points = np.einsum("smk,kcm->mcs", shares, triangles)
    size = np.ptp(pieces, axis=0).prod(axis=0).sum()
    assert size < 0.2 * np.ptp(np.clip(triangles, -1, 1), axis=0).prod(axis=0).sum()
    for number in range(40):
        own = pieces[:, :, owner == number]
        inside = (np.abs(points[number]) <= 1).all(axis=0)
        for point in points[number][:, inside].T[:20]:
            edges = np.concatenate(
                [own[1:] - own[:1], np.cross(own[1] - own[0], own[2] - own[0], axis=0)[None]]
            )
            with np.errstate(all="ignore"):
                weights = np.linalg.solve(edges.transpose(2, 1, 0), (point[:, None] - own[0]).T[..., None])[
                    ..., 0
                ]
            least = np.minimum(weights[:, :2].min(axis=1), 1 - weights[:, :2].sum(axis=1))
            assert least.max() > -1e-6


def test_only_what_cannot_be_hit_is_ignored():
    ends = bent_cells(2)
    box = hull_corners(ends).reshape(-1, 3)
    inside = np.stack([box.min(axis=0), box.max(axis=0), box.mean(axis=0)])[:, :, None]
    assert occupied_chords(ends, [inside]).any()
    assert not occupied_chords(ends, []).any() and not occupied_chords(ends, [inside[:, :, :0]]).any()
    broken = inside.copy()
    broken[0, 1] = np.nan
    assert not occupied_chords(ends, [broken]).any()
    assert np.array_equal(
        occupied_chords(ends, [np.concatenate([broken, inside], axis=2)]), occupied_chords(ends, [inside])
    )
    # An object of unknown size.
    everywhere = boxes_as_bodies(np.full((3, 1), -np.inf), np.full((3, 1), np.inf))
    assert occupied_chords(ends, [everywhere]).all()
    ends[1, 0, 2, 3] = np.nan
    held = occupied_chords(ends, [])
    assert held[:2, 1:3, 2:4].all() and held.sum() == 8


def test_slack_is_a_distance():
    """A thing 0.1 beside a straight, square cell."""
    y, x = np.meshgrid([0.0, 1.0], [0.0, 1.0], indexing="ij")
    ends = np.array([np.stack([x, y, 0 * x]), np.stack([x, y, 0 * x + 3])])
    thing = np.array([[1.1, 0.4, 1.0], [1.1, 0.6, 1.0], [1.1, 0.5, 2.0]])[:, :, None]
    assert not occupied_chords(ends, [thing]).any() and not occupied_chords(ends, [thing], 0.099).any()
    assert occupied_chords(ends, [thing], 0.101).all()
    sheets = thing - [[[0.1 + 1e-4], [0], [0]]], thing - [[[0.1 - 1e-4], [0], [0]]]
    assert occupied_chords(ends, [sheets[0]]).all() and not occupied_chords(ends, [sheets[1]]).any()
