# SPDX-License-Identifier: GPL-3.0-or-later
"""Projectors marched through anchors' depths, beside the caster's hits of the same things as meshes."""

import math

import numpy as np
import pytest

from benchmarks.scenes import bent_projection, columns, joined, sheet
from scfpf_addon.anchors.anchor import Anchor, Window
from scfpf_addon.anchors.anchor_view import AnchorView, traced_views
from scfpf_addon.anchors.completion import completed
from scfpf_addon.anchors.depth_faces import DepthFaces, faces_of, in_front
from scfpf_addon.anchors.plan import plan_anchors
from scfpf_addon.anchors.seen_scene import SeenScene
from scfpf_addon.anchors.shown_points import shown_points
from scfpf_addon.anchors.stand_ins import StandIns, octahedra, tubes
from scfpf_addon.casting.frame import pixel_centres
from scfpf_addon.casting.scene.cast_scene import CastScene

WIDTH, HEIGHT = 160, 100
PIXEL = (1 / WIDTH, 1 / HEIGHT)
STEPS = 24


def lines(count):
    """Wavy lines in the air, (count, STEPS, 3)."""
    random = np.random.default_rng(5)
    along = np.linspace(0.0, 1.0, STEPS)[:, None]
    made = []
    for _ in range(count):
        start = random.uniform((-6.0, -2.5, -14.0), (6.0, 1.5, -6.0))
        way, aside = random.normal(size=(2, 3))
        made.append(start + 2.0 * way * along + 0.4 * np.sin(6.0 * along + random.uniform(0.0, 6.0)) * aside)
    return np.stack(made)


def round_tube(line, radius):
    """A round mesh around a line (n, 3), closed at its ends."""
    way = np.gradient(line, axis=0)
    side = np.cross(way, (0.3, 0.2, 0.93))
    side /= np.linalg.norm(side, axis=1, keepdims=True)
    up = np.cross(way, side)
    up /= np.linalg.norm(up, axis=1, keepdims=True)
    angle = np.linspace(0.0, 2.0 * np.pi, 11)[None, :, None]
    radius = radius * (1.0 - np.linspace(-1.0, 1.0, len(line)) ** 8)[:, None, None]
    return sheet(line[:, None] + radius * (np.cos(angle) * side[:, None] + np.sin(angle) * up[:, None]))


def seen(mesh):
    return SeenScene(CastScene(*mesh))


def jumps(points):
    """Pixels beside others whose places are far from theirs, or that show nothing, (N,)."""
    place, length = np.full((HEIGHT * WIDTH, 3), 1e3), np.zeros(HEIGHT * WIDTH)
    place[points.number], length[points.number] = points.position.T, points.length
    place, length = place.reshape(HEIGHT, WIDTH, 3), length.reshape(HEIGHT, WIDTH)
    found = np.zeros((HEIGHT, WIDTH), bool)
    for axis in (0, 1):
        rows = range(place.shape[axis])
        pair = [np.take(length, rows[part], axis) for part in (slice(1, None), slice(None, -1))]
        far = np.linalg.norm(np.diff(place, axis=axis), axis=2) > 8.0 * np.minimum(*pair)
        for ends in ((0, 1), (1, 0)):
            found |= np.pad(far, [ends if axis == each else (0, 0) for each in (0, 1)])
    return found.ravel()[points.number]


@pytest.mark.parametrize(("angle", "radius"), [(0, 0.3), (60, 0.3), (60, 0.03)])
def test_marching_agrees_with_the_hits_of_meshes(angle, radius):
    """Tubes that only the engine has, and the caster's hits of the same tubes.

    Agreement is within six pixels: in front of a column by less is on it. Of tubes thinner than pixels, which
    are hit or not by chance, as much is shown as there is.
    """
    made = lines(30)
    base, hidden = columns(4000), joined([round_tube(line, radius) for line in made])
    real, whole = seen(base), seen(joined([base, hidden]))
    stands = tubes(made.reshape(-1, 3), np.full(len(made), STEPS), np.full(made.size // 3, radius))
    planned, projection = real.with_stand_ins(stands), bent_projection(2, math.radians(angle))
    size = (WIDTH, HEIGHT)
    plan = plan_anchors([planned], [projection], size, np.eye(3))
    done = completed(planned, projection, size, traced_views(planned, plan.anchors))
    anchors = [view.anchor for view in done.views]
    depths = [view.depth for view in traced_views(whole, anchors)]
    faces = DepthFaces.of(real, traced_views(real, anchors), depths, [False] * len(anchors))
    x, y = pixel_centres(WIDTH, HEIGHT, (0, HEIGHT))
    found, wanted = faces.shown_points(projection, x, y, PIXEL), shown_points(whole, projection, x, y, PIXEL)
    np.testing.assert_array_equal(found.number, wanted.number)
    is_hidden, inner = wanted.triangle >= len(base[1]), ~jumps(wanted)
    agrees = np.linalg.norm(found.position - wanted.position, axis=0) <= 6.0 * wanted.length
    assert is_hidden.mean() > 0.02 and agrees[inner].mean() >= 0.999
    assert (~agrees & ~is_hidden & inner).mean() <= 2e-4, "false faces"
    bare = shown_points(real, projection, x, y, PIXEL)
    is_marched = np.linalg.norm(found.position - bare.position, axis=0) > 1e-6
    assert abs(is_marched.sum() / is_hidden.sum() - 1.0) < (0.03 if radius == 0.3 else 0.15)
    # Colours are places, in meters: they are those of what is shown.
    pictures = [places(view) for view in faces.views]
    things = found.take(np.flatnonzero(found.is_hit))
    colors, lacks = faces.colors(things, [done.own], pictures)
    off = np.linalg.norm(colors - things.position.T, axis=1) / things.length
    assert lacks.mean() < 2e-3 and (off[inner[found.is_hit]] < 4.0).mean() > 0.995


def places(view):
    """The places that an anchor's pixels show, (H, W, 3)."""
    width, height = view.anchor.size
    column, row = np.tile(np.arange(width), height), np.repeat(np.arange(height), width)
    begin, way = view.anchor.rays(column, row)
    depth = np.where(np.isinf(view.depth), view.anchor.end, view.depth).ravel()
    return (begin + way * (depth - view.anchor.start)).T.reshape(height, width, 3).astype(np.float32)


def flat_view(depth, is_parallel=True):
    """An anchor that looks along -z from the origin, with its hits' depths."""
    height, width = depth.shape
    window = Window(-width / 20, -height / 20, width / 20, height / 20)
    anchor = Anchor(np.eye(4), window, (width, height), 0.1, 100.0, is_parallel)
    return AnchorView(anchor, depth.astype(np.float32))


def test_what_engine_and_caster_may_differ_about_is_not_in_front():
    """A pixel at an outline has the depth of the thing beside it; one in the air has a depth of its own."""
    traced = np.full((5, 9), 10.0)
    traced[:, :3] = 4.0
    rendered = traced.copy()
    rendered[2, 3], rendered[2, 6], rendered[4, 8], rendered[0, 0] = 4.01, 6.0, np.inf, 3.999
    np.testing.assert_array_equal(
        np.argwhere(in_front(flat_view(traced), rendered.astype(np.float32))), [[2, 6]]
    )


@pytest.mark.parametrize("is_parallel", [False, True])
def test_faces_of_a_slope_are_one_surface(is_parallel):
    """All corners that neighbours share are at one place, and on the plane."""
    column, row = np.meshgrid(np.arange(8), np.arange(6))
    depth = (20.0 + 0.05 * column + 0.03 * row).astype(np.float32)
    anchor = flat_view(depth, is_parallel).anchor
    vertices, triangles = faces_of(anchor, depth, np.ones_like(depth, bool))
    assert triangles.shape == (2 * 48, 3)
    different = np.unique(np.round(vertices, 9), axis=0)
    assert len(different) == 7 * 9
    first, second, third = (vertices[triangles[:, k]] for k in range(3))
    normal = np.cross(second - first, third - first)
    assert (normal[:, 2] > 0.0).all(), "they face the anchor"


def test_a_jump_of_depth_is_a_gap():
    depth = np.where(np.arange(8) < 4, 20.0, 30.0).astype(np.float32) * np.ones((6, 1), np.float32)
    vertices, _ = faces_of(flat_view(depth).anchor, depth, np.ones_like(depth, bool))
    np.testing.assert_allclose(np.unique(-vertices[:, 2]), (20.0, 30.0))


def test_near_planes_stand_before_boxes():
    """The view of the points stays as it is; a box around the eye is left to be cut."""
    box = np.array([[x, y, z] for x in (-1, 1) for y in (-1, 1) for z in (-8, -4)], float)[None]
    for is_parallel in (False, True):
        anchor = flat_view(np.zeros((9, 9)), is_parallel).anchor
        late = Anchor(anchor.matrix, anchor.window, anchor.size, 6.0, 50.0, is_parallel)
        assert late.cuts(box).all()
        early = late.before(box)
        assert not early.cuts(box).any()
        point = np.array([[0.1], [0.2], [-9.0]])
        np.testing.assert_allclose(early.places(point)[:2], late.places(point)[:2])
        np.testing.assert_allclose(early.end - early.places(point).depth, late.end - late.places(point).depth)
    around = box + np.array([0.0, 0.0, 6.0])
    eye = flat_view(np.zeros((9, 9)), False).anchor
    assert eye.before(around).cuts(around).all()


def test_stand_ins_enclose_what_they_stand_for():
    """Each point of a ball, and of a round tube, is inside: rays from it meet a face in any direction."""
    random = np.random.default_rng(1)
    way = random.normal(size=(200, 3))
    way /= np.linalg.norm(way, axis=1, keepdims=True)
    for made, inside in (
        (octahedra(np.zeros((1, 3)), np.array([0.5])), 0.499 * way),
        (
            tubes(np.array([[0.0, 0.0, -9.0], [0.0, 0.0, 9.0]]), np.array([2]), np.array([0.5, 0.5])),
            0.499 * way * (1, 1, 0) / np.linalg.norm(way[:, :2], axis=1, keepdims=True),
        ),
    ):
        scene = CastScene(made.vertices, made.triangles)
        begin = ((inside.T - scene.centre[:, None]) * scene.scale).astype(np.float32)
        outward = np.where(np.abs(inside).max(axis=0) > 0.0, inside, 0.0).T.astype(np.float32)
        assert (scene.mesh.trace(begin, outward, np.full(200, 1e3, np.float32)) >= 0).all()
    assert StandIns.joined([]) is None
