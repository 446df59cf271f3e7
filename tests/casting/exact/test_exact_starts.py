# SPDX-License-Identifier: GPL-3.0-or-later
"""Pixel error 0: projectors that begin inside a prism beside an edge."""

from dataclasses import replace

import numpy as np
import pytest

from benchmarks.scenes import SCENES, bent_projection
from scfpf_addon.casting.cast import cast
from scfpf_addon.casting.common.hits import CastCounts
from scfpf_addon.casting.scene.cast_scene import CastScene

# A thin box, a volume whose near surface cuts it, and the pixels, in an image of this size, whose
# projectors begin within a thousandth of its side.
BOX = slice(75828, 75840)
WIDTH, HEIGHT = 384, 216
PIXELS = np.array([78852, 79236, 80005, 80389, 81158])
BEND = 0.5882712973984706
OFFSETS = (
    (0.12621975, 0.02820526, 0.04958565),
    (0.06157559, -0.15161363, 0.11747715),
    (0.30850542, -0.24576638, -0.25941172),
    (-0.22572471, 0.12621883, 0.01930735),
)


def moved(surface, offset):
    matrix = np.eye(4)
    matrix[:3, 3] = offset
    return surface.transformed(matrix)


@pytest.mark.parametrize("around", [0.0, 1e-3, 1e-2])
def test_the_nearest_face_of_a_box_that_the_near_surface_cuts(reference, around):
    """A hit certified over an edge does not replace a nearer one where the projector begins."""
    vertices, triangles = SCENES["boxes"](100_000)
    triangles = triangles[BOX]
    straight = bent_projection(3, BEND)
    surfaces = tuple(map(moved, straight.volume.surfaces, OFFSETS))
    projection = replace(straight, volume=replace(straight.volume, surfaces=surfaces))
    aside = np.random.default_rng(0).uniform(-around, around, (2, 40, len(PIXELS)))
    x = ((PIXELS % WIDTH + 0.5) / WIDTH + aside[0]).ravel()
    y = ((PIXELS // WIDTH + 0.5) / HEIGHT + aside[1]).ravel()
    t, _ = reference.brute_force(vertices, triangles, projection, x, y)
    scene = CastScene(vertices, triangles)
    inside = projection.transformed(scene.matrix)
    hits = cast(scene, inside, x, y, (1 / WIDTH, 1 / HEIGHT), 0.0, CastCounts())
    assert np.isfinite(t).any() and ((t > 0) & (t < 1e-3)).any()
    assert (np.isfinite(t) == (hits.triangle >= 0)).all()
    hit = np.isfinite(t)
    assert np.abs(t[hit] - hits.t[hit]).max() < 1e-9
