# SPDX-License-Identifier: GPL-3.0-or-later
"""Hits of live images against brute force and closed forms."""

from dataclasses import replace

import numpy as np
import pytest

from scfpf_addon.casting.common.cancellation import Cancelled
from scfpf_addon.casting.common.geometry import Geometry, Layer
from scfpf_addon.casting.scene.cast_scene import CastScene
from scfpf_addon.projection.surfaces.surface import BilinearPatch
from scfpf_addon.projection.volume.viewing_volume import ImageLayer, Projection, ViewingVolume
from scfpf_addon.shading.live.cast_live import LiveProjection, LiveWindow, cast_live, live_image
from scfpf_addon.shading.live.live_scene import COLOR_LAYER, LiveScene, StillScene

WHOLE = LiveWindow(0.0, 0.0, 1.0, 1.0, 24, 16)


def patch(width, height, depth, turn=0.0, mirrored=False):
    """A rectangle around the axis -Z at a depth."""
    x, y = np.array([-1, 1, -1, 1]) * width / 2, np.array([-1, -1, 1, 1]) * height / 2
    x = -x if mirrored else x
    corners = np.stack([x * np.cos(turn) - y * np.sin(turn), x * np.sin(turn) + y * np.cos(turn)], axis=1)
    return BilinearPatch(corners=np.column_stack([corners, np.full(4, -float(depth))]))


def pinhole():
    """A pinhole camera at the origin that looks along -Z, half as high as wide."""
    return Projection(ViewingVolume((patch(0.2, 0.1, 0.1), patch(40, 20, 20))), aspect=2.0)


def bent():
    """Projectors that bend and turn."""
    surfaces = patch(2, 1, 1), patch(5, 4, 5, 0.5), patch(9, 4, 11, -0.4)
    return Projection(ViewingVolume(surfaces), aspect=2.0)


def soup(count=60, seed=3):
    """Random triangles before the cameras, each with its own look, normals, coordinates and colours."""
    rng = np.random.default_rng(seed)
    middle = rng.uniform([-3, -2, -10], [3, 2, -3], (count, 1, 3))
    points = middle + rng.uniform(-0.8, 0.8, (count, 3, 3))
    normals = rng.normal(size=(count, 3, 3))
    normals /= np.linalg.norm(normals, axis=2, keepdims=True)
    return Geometry(
        vertices=points.reshape(-1, 3),
        triangles=np.arange(3 * count, dtype=np.int32).reshape(-1, 3),
        corner_normals=normals.astype(np.float32),
        material=np.arange(count, dtype=np.int32),
        object_index=np.arange(count, dtype=np.int32) // 7,
        uv=rng.uniform(size=(count, 3, 2)).astype(np.float32),
        layers={
            COLOR_LAYER: Layer(
                np.arange(count, dtype=np.int32), rng.uniform(size=(count, 3, 4)).astype(np.float32)
            )
        },
    )


def part(geometry, kept):
    """Some triangles of a geometry."""
    return geometry.part(kept)


def brute_force(geometry, projection, x, y):
    """Triangle (-1 for none), t and weights of the corners of straight projectors' first hits."""
    (near, far), _ = projection.projectors(x, y)
    corners = geometry.vertices[geometry.triangles]
    best, which = np.full(len(x), np.inf), np.full(len(x), -1)
    weights = np.zeros((3, len(x)))
    for number, triangle in enumerate(corners):
        matrix = np.stack([np.broadcast_to(c[:, None], near.shape) for c in (*triangle,)], axis=1)
        # near + t (far - near) = Σ w c, Σ w = 1.
        system = np.zeros((len(x), 4, 4))
        system[:, :3, :3], system[:, 3, :3] = matrix.transpose(2, 0, 1), 1.0
        system[:, :3, 3] = (near - far).T
        found = np.linalg.solve(system, np.concatenate([near, np.ones((1, len(x)))]).T[..., None])[..., 0]
        ok = (found[:, :3] >= 0).all(axis=1) & (found[:, 3] >= 0) & (found[:, 3] <= 1) & (found[:, 3] < best)
        best[ok], which[ok], weights[:, ok] = found[ok, 3], number, found[ok, :3].T
    return which, best, weights


def test_hits_are_those_of_brute_force():
    geometry, projection = soup(), pinhole()
    hits = cast_live(LiveScene.built(geometry), LiveProjection.of(projection), WHOLE)
    x, y = WHOLE.centres(slice(0, WHOLE.height))
    which, t, weights = brute_force(geometry, projection, x, y)
    hit = which >= 0
    assert 50 < hit.sum() < len(hit) - 50
    assert hits.mask.all()
    np.testing.assert_array_equal(hits.look, which)
    np.testing.assert_array_equal(hits.object, np.where(hit, which // 7, -1))
    np.testing.assert_allclose(hits.t[hit], t[hit], rtol=1e-5)
    assert np.isinf(hits.t[~hit]).all()

    def interpolated(values):
        return np.einsum("kn,nkc->cn", weights[:, hit], values[which[hit]])

    corners = geometry.vertices[geometry.triangles]
    np.testing.assert_allclose(hits.position[:, hit], interpolated(corners), atol=1e-5)
    np.testing.assert_allclose(hits.uv[:, hit], interpolated(geometry.uv), atol=1e-4)
    colors = geometry.layers[COLOR_LAYER].values[:, :, :3]
    np.testing.assert_allclose(hits.color[:, hit], interpolated(colors), atol=1e-4)
    normal = interpolated(geometry.corner_normals)
    normal /= np.linalg.norm(normal, axis=0)
    own = np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0])[which[hit]].T
    own *= -np.sign((own * hits.position[:, hit]).sum(axis=0))
    # Towards the viewer: on the side of the triangle that he sees.
    normal *= np.sign((normal * own).sum(axis=0))
    np.testing.assert_allclose(hits.normal[:, hit], normal, atol=2e-4)
    for values in (hits.position, hits.normal, hits.uv, hits.color):
        assert not values[:, ~hit].any()


def test_axes_of_a_pinhole_camera():
    window = WHOLE._replace(width=96, height=64)
    hits = cast_live(LiveScene.built(soup()), LiveProjection.of(pinhole()), window)
    x, y = window.centres(slice(0, window.height))
    forward = np.stack([2 * (x - 0.5), y - 0.5, np.full(len(x), -1.0)])
    forward /= np.linalg.norm(forward, axis=0)
    right = np.array([[1.0], [0], [0]]) - forward * forward[0]
    right /= np.linalg.norm(right, axis=0)
    np.testing.assert_allclose(hits.forward, forward, atol=1e-6)
    # Differences instead of derivatives.
    np.testing.assert_allclose(hits.right, right, atol=0.02)
    np.testing.assert_allclose(hits.up, np.cross(right, forward, axis=0), atol=0.02)
    assert not hits.is_mirrored.any()


@pytest.mark.parametrize("make", [pinhole, bent])
def test_axes_are_orthonormal(make):
    hits = cast_live(LiveScene.built(soup()), LiveProjection.of(make()), WHOLE)
    axes = np.stack([hits.right, hits.up, hits.forward])
    np.testing.assert_allclose(
        np.einsum("icn,jcn->nij", axes, axes), np.broadcast_to(np.eye(3), (384, 3, 3)), atol=1e-5
    )


def crossing():
    """A volume whose projectors cross at a depth of 5.5 in a line, with a wall before and behind it."""
    return Projection(ViewingVolume((patch(2, 1, 1), patch(2, 1, 10, mirrored=True))), aspect=2.0)


def wall(depth):
    """A wall across the axis."""
    points = np.array([[-99, -99, -depth], [99, -99, -depth], [0, 99, -depth]], float)
    return Geometry(points, np.array([[0, 1, 2]], np.int32), None, *[np.zeros(1, np.int32)] * 2)


@pytest.mark.parametrize("depth, is_mirrored", [(3.0, False), (8.0, True)])
def test_folds_are_mirrored(depth, is_mirrored):
    hits = cast_live(LiveScene.built(wall(depth)), LiveProjection(crossing(), False), WHOLE)
    assert (hits.is_mirrored == is_mirrored).all()
    handedness = np.einsum("cn,cn->n", np.cross(hits.right, hits.up, axis=0), hits.forward)
    np.testing.assert_allclose(handedness, 1.0 if is_mirrored else -1.0, atol=1e-5)
    # Image x runs along world x before the line, against it behind.
    assert (np.sign(hits.right[0]) == (-1 if is_mirrored else 1)).all()


def test_a_mirrored_volume_is_no_fold():
    surfaces = patch(2, 1, 1, mirrored=True), patch(4, 2, 10, mirrored=True)
    view = LiveProjection.of(Projection(ViewingVolume(surfaces), aspect=2.0))
    assert view.is_mirrored
    assert not cast_live(LiveScene.built(wall(5.0)), view, WHOLE).is_mirrored.any()


@pytest.mark.parametrize("make", [pinhole, bent])
@pytest.mark.parametrize("seed", range(4))
def test_two_parts_are_one_scene(make, seed):
    geometry = soup(80)
    rng = np.random.default_rng(seed)
    moves, gone = rng.random(80) < 0.3, rng.random(80) < 0.2
    stays = ~moves & ~gone
    others = soup(80, seed + 10)
    still = StillScene(LiveScene.built(geometry), stays)
    found = cast_live(still.with_moving(part(others, moves)), LiveProjection.of(make()), WHOLE)
    alone = [part(geometry, stays), part(others, moves)]
    joined = Geometry(
        vertices=np.concatenate([each.vertices for each in alone]),
        triangles=np.concatenate([alone[0].triangles, alone[1].triangles + len(alone[0].vertices)]),
        corner_normals=np.concatenate([each.corner_normals for each in alone]),
        material=np.concatenate([each.material for each in alone]),
        object_index=np.concatenate([each.object_index for each in alone]),
        uv=np.concatenate([each.uv for each in alone]),
    )
    expected = cast_live(LiveScene.built(joined), LiveProjection.of(make()), WHOLE)
    assert len(set(expected.look)) > 10
    for name in ("look", "object"):
        np.testing.assert_array_equal(getattr(found, name), getattr(expected, name))
    for name in ("t", "position", "normal", "uv", "forward", "right", "up"):
        np.testing.assert_allclose(getattr(found, name), getattr(expected, name), atol=2e-4)
    only = cast_live(still.with_moving(None), LiveProjection.of(make()), WHOLE)
    assert set(only.look) - {-1} <= set(np.flatnonzero(stays))


@pytest.mark.parametrize("moved", ["the layer", "the rest", "some of both"])
def test_layers_of_a_scene_in_parts(moved):
    """A layer may have all its things in one part."""
    geometry, others, layer = soup(80), soup(80, 13), (np.arange(80) // 7) % 2 > 0
    some = np.arange(80) % 3 == 0
    moves = {"the layer": layer, "the rest": ~layer, "some of both": some}[moved]
    scene = StillScene(LiveScene.built(geometry), ~moves).with_moving(part(others, moves))
    members = np.arange(12, dtype=np.uint8) % 2
    turned = Projection(ViewingVolume((patch(0.2, 0.1, 0.1, 0.4), patch(40, 20, 20, 0.4))), aspect=2.0)
    seen = replace(pinhole(), layers=(ImageLayer(turned, "ORDER", np.zeros(3)),))
    found = cast_live(scene, LiveProjection.of(seen, members), WHOLE)
    points = np.where(
        moves[:, None, None], others.vertices.reshape(-1, 3, 3), geometry.vertices.reshape(-1, 3, 3)
    )
    own = [replace(geometry, vertices=points.reshape(-1, 3)).part(which) for which in (layer, ~layer)]
    over, under = (
        cast_live(LiveScene.built(one), LiveProjection.of(view), WHOLE)
        for one, view in zip(own, (turned, pinhole()), strict=True)
    )
    expected = np.where(over.look >= 0, over.look, under.look)
    assert len(set(over.look)) > 5 and ((over.look < 0) & (under.look >= 0)).any()
    assert np.count_nonzero(found.look != expected) <= 2


def test_a_moving_part_alone():
    still = StillScene(LiveScene.built(soup()), np.zeros(60, bool))
    found = cast_live(still.with_moving(wall(5.0)), LiveProjection.of(pinhole()), WHOLE)
    assert (found.look == 0).all()
    assert (cast_live(still.with_moving(None), LiveProjection.of(pinhole()), WHOLE).look == -1).all()


def test_nothing_to_hit():
    empty = Geometry(np.zeros((0, 3)), np.zeros((0, 3), np.int32), None, *[np.zeros(0, np.int32)] * 2)
    hits = cast_live(LiveScene.built(empty), LiveProjection.of(bent()), WHOLE)
    assert (hits.look == -1).all() and np.isinf(hits.t).all() and hits.mask.all()
    ends, tangents = bent().volume.projectors(*WHOLE.centres(slice(0, 16))).points[1:]
    way = tangents - ends
    np.testing.assert_allclose(hits.forward, way / np.linalg.norm(way, axis=0), atol=1e-6)


def test_threads_change_nothing():
    scene, view = LiveScene.built(soup()), LiveProjection.of(pinhole())
    window = WHOLE._replace(width=240, height=160)
    one, two = (cast_live(scene, view, window, threads=count) for count in (1, 3))
    np.testing.assert_array_equal(one.look, two.look)
    np.testing.assert_array_equal(one.normal, two.normal)


def test_a_signal_ends_it():
    class Set:
        def is_set(self):
            return True

    with pytest.raises(Cancelled):
        cast_live(LiveScene.built(soup()), LiveProjection.of(pinhole()), WHOLE, Set())


def plain_paint(hits, _step):
    """Grey, the lighter the more a surface faces the viewer; a dark grey where there is nothing."""
    facing = np.abs(np.einsum("cn,cn->n", hits.normal, hits.forward))
    pixels = np.empty((len(facing), 4), np.float32)
    pixels[:, :3] = np.where(hits.look >= 0, 0.15 + 0.7 * facing, 0.2)[:, None]
    pixels[:, 3] = hits.mask
    pixels[:, :3] *= pixels[:, 3:]
    return pixels.reshape(hits.height, hits.width, 4)


def test_a_part_of_the_frame_is_that_part():
    scene, view = LiveScene.built(soup()), LiveProjection.of(pinhole())
    whole = live_image(scene, view, WHOLE, plain_paint)
    left = live_image(scene, view, LiveWindow(0.0, 0.25, 0.5, 0.75, 12, 8), plain_paint)
    np.testing.assert_allclose(left, whole[4:12, :12], atol=1e-5)
    assert live_image(scene, view, WHOLE, plain_paint, 3.0).shape == (5, 8, 4)


def test_a_given_cast_space_is_kept():
    geometry = soup()
    whole = CastScene(geometry.vertices, geometry.triangles)
    other = CastScene(geometry.vertices + 3.0, geometry.triangles, space=whole.space)
    np.testing.assert_array_equal(other.matrix, whole.matrix)
    np.testing.assert_allclose(other.vertices, whole.vertices + 3.0 * whole.scale)
