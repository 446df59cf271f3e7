# SPDX-License-Identifier: GPL-3.0-or-later
"""Faces that are seen from the front only: casting passes their backs, for projectors and for anchors."""

import math

import numpy as np
import pytest

from benchmarks.scenes import bent_projection
from scfpf_addon.anchors.anchor import Anchor, Window
from scfpf_addon.anchors.anchor_view import traced_depth
from scfpf_addon.anchors.seen_scene import SeenScene
from scfpf_addon.casting.frame import pixel_centres
from scfpf_addon.casting.scene.cast_scene import CastScene

# Of each axis: a face of a cube that is counter-clockwise from outside.
FACES = ((0, 1, 3, 2), (4, 6, 7, 5), (0, 4, 5, 1), (2, 3, 7, 6), (0, 2, 6, 4), (1, 5, 7, 3))
CORNERS = np.array([[x, y, z] for x in (-1, 1) for y in (-1, 1) for z in (-1, 1)], float)
CUBE = np.array([half for a, b, c, d in FACES for half in ((a, b, c), (a, c, d))], np.int32)


def nested(sizes, inverted):
    """Cubes inside each other; those of ``inverted`` are turned inside out. One-sided are all of these."""
    vertices = np.concatenate([CORNERS * size for size in sizes])
    triangles = [CUBE[:, ::-1] if number in inverted else CUBE for number in range(len(sizes))]
    triangles = np.concatenate([own + 8 * number for number, own in enumerate(triangles)])
    one_sided = np.repeat([number in inverted for number in range(len(sizes))], len(CUBE))
    return vertices, triangles, one_sided


@pytest.mark.parametrize("angle", [0, 60])
@pytest.mark.parametrize("pixel_error", [0.1, 0.0])
def test_projectors_pass_backs(angle, pixel_error):
    """Through hulls they see what they would see without them; round it, the hulls' insides."""
    vertices, triangles, one_sided = nested((1.2, 1.35, 1.5), {1, 2})
    place = np.array([2.0 if angle else 0.0, 0.0, -9.5])
    seen = SeenScene(CastScene(vertices + place, triangles), one_sided)
    alone = SeenScene(CastScene(CORNERS * 1.2 + place, CUBE))
    projection = bent_projection(2, math.radians(angle))
    x, y = pixel_centres(48, 48, (0, 48))
    hits, inner = (each.first_hits(projection, x, y, (1 / 48, 1 / 48), pixel_error) for each in (seen, alone))
    is_inner = inner.triangle >= 0
    assert is_inner.mean() > 0.02
    np.testing.assert_array_equal(hits.triangle[is_inner], inner.triangle[is_inner])
    world = inner.position[:, is_inner] / alone.scene.scale + alone.scene.centre[:, None]
    own = hits.position[:, is_inner] / seen.scene.scale + seen.scene.centre[:, None]
    np.testing.assert_allclose(own, world, atol=1e-5)
    rim = hits.triangle[~is_inner]
    assert (rim >= len(CUBE)).any()
    normal = seen.scene.normals(rim[rim >= 0])
    way = hits.tangent[:, ~is_inner][:, rim >= 0]
    assert (np.einsum("cn,cn->n", normal, way) < 0.0).all()


@pytest.mark.parametrize("is_parallel", [False, True])
def test_anchors_pass_backs(is_parallel):
    """Their depths are those of the cube within the hulls, and of the hull's far side beside it."""
    seen = SeenScene(CastScene(*nested((0.5, 0.7), {1})[:2]), nested((0.5, 0.7), {1})[2])
    matrix = np.eye(4)
    matrix[2, 3] = 3.0
    window = Window(-1.0, -1.0, 1.0, 1.0) if is_parallel else Window(-0.4, -0.4, 0.4, 0.4)
    depth = traced_depth(seen, Anchor(matrix, window, (64, 64), 0.1, 20.0, is_parallel))
    assert depth[32, 32] == pytest.approx(2.5, abs=1e-5)
    # Rays that pass the cube by meet the hull from inside, at its back or at its side.
    across = (14 + 0.5) / 64 * 0.8 - 0.4
    expected = (depth[32, 12], 3.7) if is_parallel else (depth[32, 14], 0.7 / -across)
    assert expected[0] == pytest.approx(expected[1], abs=1e-5)
    assert np.isinf(depth[0, 0])
