# SPDX-License-Identifier: GPL-3.0-or-later
"""Rays in float32, as a renderer has them, meet nothing in chords that count as empty.

Positions, directions and weights are rounded as in Cycles. Things are wires, sheets 1e-4 apart, planes far
larger than the volume, and dust; all of it lies near the origin and far from it.
"""

import numpy as np
import pytest

from scfpf_addon.casting.cells import body_tree, chord_cells
from scfpf_addon.casting.cells.occupied_chords import occupied_chords
from scfpf_addon.casting.scene.embree_meshes import build_mesh

RAYS = 60_000
FARS = (0.0, 1.0, 100.0, 1e4, 1e6)


def made_ends(generator):
    """Ends of the chords of projectors that twist and widen, somewhere and of any size."""
    y, x = np.meshgrid(np.linspace(-1, 1, 8), np.linspace(-1, 1, 7), indexing="ij")
    sheet, ends = np.stack([x, y]), []
    for k in range(9):
        angle = k * generator.uniform(-0.4, 0.4)
        turn = np.array([[np.cos(angle), -np.sin(angle)], [np.sin(angle), np.cos(angle)]])
        flat = np.einsum("ij,jrc->irc", turn, sheet) * (0.3 + k * generator.uniform(0, 1))
        ends.append(
            np.concatenate([flat, np.full((1, *x.shape), 2.0 * k)]) + generator.normal(size=(3, 1, 1)) * 0.3
        )
    ends = np.array(ends) + generator.choice([0, 0.003, 0.05]) * generator.normal(size=(9, 3, *x.shape))
    far = generator.choice(FARS) * generator.normal(size=(3, 1, 1))
    return (ends * 10.0 ** generator.uniform(-2, 3) + far).astype(np.float32)


def made_triangles(generator, kind, lower, upper):
    """Triangles (T, 3, 3) in a box: by kind wires, sheets side by side, huge planes, dust."""
    size = (upper - lower).max()
    if kind == "sheets":
        across = generator.uniform(lower[0], upper[0], (6, 1)) + np.array([0.0, 1e-4 * size])
        (_, y, z), (_, far_y, far_z) = lower, upper
        sheets = [[(x, y, z), (x, far_y, z), (x, far_y, far_z), (x, y, far_z)] for x in across.ravel()]
        return np.array(sheets)[:, [[0, 1, 2], [0, 2, 3]]].reshape(-1, 3, 3)
    middle = generator.uniform(lower, upper, (60, 3))
    if kind == "wires":
        along = generator.normal(size=(60, 3))
        along *= size / np.linalg.norm(along, axis=1, keepdims=True)
        thin = generator.normal(size=(60, 3)) * size * 1e-4
        return np.stack([middle - along, middle + along, middle + along + thin], axis=1)
    if kind == "planes":
        one, other = generator.normal(size=(2, 3, 3)) * size * 10.0 ** generator.uniform(0, 4)
        return middle[:3, None] + np.stack([one, other, -one - other], axis=1)
    return middle[:, None] + generator.normal(size=(60, 3, 3)) * size * 10.0 ** generator.uniform(
        -4, -1, (60, 1, 1)
    )


def rays_in(generator, ends):
    """Rays along chords: the chord, row and column of each, and its start, direction and length in float32.

    They begin in the triangles of the cells' faces, many at edges and corners.
    """
    chord, row, column = cells = [
        generator.integers(0, count - 1, RAYS) for count in np.array(ends.shape)[[0, 2, 3]]
    ]
    a, b = np.clip(generator.uniform(-0.1, 1.1, (2, RAYS)), 0, 1)
    shares = {
        (0, 0): 1 - np.maximum(a, b),
        (1, 1): np.minimum(a, b),
        (0, 1): np.maximum(a - b, 0),
        (1, 0): np.maximum(b - a, 0),
    }
    start = way = np.zeros((RAYS, 3), np.float32)
    for (up, right), share in shares.items():
        one, other = (ends[chord + end, :, row + up, column + right] for end in (0, 1))
        share = share.astype(np.float32)[:, None]
        start, way = start + share * one, way + share * (other - one)
    start += np.abs(start).max(axis=1, keepdims=True) * (generator.normal(size=start.shape) * 1e-7).astype(
        np.float32
    )
    length = np.linalg.norm(way, axis=1).astype(np.float32)
    # A sheet is met a little early or late.
    return cells, start, way / length[:, None], length * np.float32(1 + 5e-7)


def missed(seed, kind):
    """The numbers of rays that hit something, and of those that do so in a chord that counts as empty."""
    generator = np.random.default_rng(seed)
    ends = made_ends(generator)
    lower, upper = (f(ends.astype(np.float64), axis=(0, 2, 3)) for f in (np.min, np.max))
    triangles = made_triangles(generator, kind, lower, upper).astype(np.float32)
    held = occupied_chords(ends, [triangles.astype(np.float64).transpose(1, 2, 0)])
    faces = np.arange(3 * len(triangles), dtype=np.int32).reshape(-1, 3)
    embree, _kept, _ = build_mesh(triangles.reshape(-1, 3), faces)
    with np.errstate(invalid="ignore", divide="ignore"):
        (chord, row, column), start, way, length = rays_in(generator, ends)
    hit = embree.run(start, way, length) >= 0
    return hit.sum(), (hit & ~held[chord, row, column]).sum()


@pytest.mark.parametrize("kind", ["wires", "sheets", "planes", "dust"])
def test_no_ray_hits_anything_in_an_empty_chord(kind):
    found = np.array([missed(seed, kind) for seed in range(8)])
    assert found[:, 0].sum() > 300
    assert found[:, 1].sum() == 0


def test_the_slack_is_needed(monkeypatch):
    """The rays above would find out."""
    monkeypatch.setattr(chord_cells, "SLACK", 2.0**-40)
    monkeypatch.setattr(body_tree, "ROUNDING", 2.0**-40)
    assert sum(missed(seed, "sheets")[1] for seed in range(16)) > 0
