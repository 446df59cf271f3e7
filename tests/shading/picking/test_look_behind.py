# SPDX-License-Identifier: GPL-3.0-or-later
"""Things that an image hides, beside counts by all triangles in float64."""

from dataclasses import replace

import numpy as np
import pytest

from scfpf_addon.casting.frame import cast_frame
from scfpf_addon.casting.scene.cast_scene import CastScene
from scfpf_addon.projection.surfaces.surface import Plane
from scfpf_addon.projection.volume.viewing_volume import Projection, ViewingVolume
from scfpf_addon.shading.nodes.graph import Closure, MaterialGraph
from scfpf_addon.shading.picking.look_behind import COLUMNS, hidden_things

# Of the image: pixels at a silhouette may count either way.
CLOSE = 0.003


def named(made, *names):
    """A scene whose parts have names."""
    return replace(made, geometry=replace(made.geometry, object_names=names))


@pytest.fixture
def scene(build):
    """Seen from above: a lid over a ball and half of a box's top, a ground below, a far ball in the open."""
    parts = [
        build.square(3.0, 0.0),
        build.square(0.8, 2.0, (-0.5, 0.3)),
        build.sphere(5, (-0.5, 0.3, 1.0), 0.5),
        build.square(0.6, 1.2, (0.2, 0.4)),
        build.sphere(5, (1.2, -1.0, 0.6), 0.3),
    ]
    return named(build.scene(parts), "Ground", "Lid", "Ball", "Box", "Free")


def brute(projection, scene):
    """The first hit of each object at each pixel, (O, N) t, inf for none: Möller and Trumbore (1997)."""
    rows = round(COLUMNS / projection.aspect)
    x, y = np.meshgrid((np.arange(COLUMNS) + 0.5) / COLUMNS, (np.arange(rows) + 0.5) / rows)
    (start, end), _ = projection.projectors(x.ravel(), y.ravel())
    start, way = start.T, (end - start).T
    geometry = scene.geometry
    found = np.full((len(geometry.object_names), len(start)), np.inf)
    for triangle, number in zip(geometry.triangles, geometry.object_index, strict=True):
        a, b, c = geometry.vertices[triangle].astype(np.float64)
        normal = np.cross(way, c - a)
        with np.errstate(divide="ignore", invalid="ignore"):
            share = 1.0 / (normal @ (b - a))
            off = start - a
            u, cross = np.einsum("nc,nc->n", off, normal) * share, np.cross(off, b - a)
            v, t = np.einsum("nc,nc->n", way, cross) * share, (cross @ (c - a)) * share
            met = (u >= 0) & (v >= 0) & (u + v <= 1) & (t >= 0) & (t <= 1)
        found[number, met] = np.minimum(found[number, met], t[met])
    return found


def shares(found):
    """Of first hits t (O, N): the shares that each object covers alone and hidden, and what hides it most."""
    alone, front = np.isfinite(found), found.argmin(axis=0)
    hidden = alone & (front != np.arange(len(found))[:, None])
    hiders = [int(np.bincount(front[each]).argmax()) if each.any() else -1 for each in hidden]
    return alone.mean(axis=1), hidden.mean(axis=1), hiders


def assert_as(rows, found):
    """Rows about all objects are those of first hits."""
    alone, hidden, hiders = shares(found)
    assert {each.number for each in rows} == set(np.flatnonzero(hidden))
    for each in rows:
        assert each.share == pytest.approx(alone[each.number], abs=CLOSE)
        assert each.share * each.hidden == pytest.approx(hidden[each.number], abs=CLOSE)
        assert each.hider == hiders[each.number]


def pinhole(build, aspect=1.0):
    """A camera at z = 6 that looks down."""
    planes = (build.placed((0, 0, 5)), 1.0), (build.placed((0, 0, -1)), 7.0)
    planes = tuple(Plane(matrix=m, width=w, height=w / aspect) for m, w in planes)
    return Projection(ViewingVolume(planes), aspect=aspect)


@pytest.mark.parametrize("view", ("parallel", "pinhole"))
def test_shares_are_those_of_all_triangles(build, scene, view):
    camera = build.looking_down(5.0, -1.0, size=4.0) if view == "parallel" else pinhole(build)
    assert_as(hidden_things(camera, scene, wanted=range(5)), brute(camera, scene))


def test_large_hidden_things_are_listed_by_their_area(build, scene):
    """The ground is hidden in part only, and the free ball is seen."""
    camera = build.looking_down(5.0, -1.0, size=4.0)
    names = [scene.geometry.object_names[each.number] for each in hidden_things(camera, scene)]
    assert names == ["Box", "Ball"]
    assert [each.number for each in hidden_things(camera, scene, wanted={0})] == [0, 3, 2]


def test_the_gap_and_the_side_are_those_of_the_scene(build):
    """A small square one below a large one whose right edge is nearest to it."""
    parts = [build.square(0.2, 0.0, (0.5, 0.1)), build.square(0.9, 1.0)]
    for turn, side in enumerate(("RIGHT", "UP", "LEFT", "DOWN")):
        made = named(build.scene(parts), "Thing", "Lid")
        angle = turn * np.pi / 2
        spin = np.array([[np.cos(angle), -np.sin(angle), 0], [np.sin(angle), np.cos(angle), 0], [0, 0, 1]])
        turned = replace(made.geometry, vertices=made.geometry.vertices @ spin.T)
        (row,) = hidden_things(build.looking_down(5.0, -1.0, size=4.0), replace(made, geometry=turned))
        assert (row.side, row.hider, row.hidden) == (side, 1, 1.0)
        assert row.gap == pytest.approx(1.0, abs=1e-6)
        # From the left edge of the small square, 0.3, to the right one of the large, 0.9, of an image of 4.
        assert row.away == pytest.approx(0.6 / 4.0, abs=0.006)


def test_a_lining_is_listed_only_if_it_is_wanted(build):
    made = named(build.scene([build.square(0.5, 0.999), build.square(0.9, 1.0)]), "Lining", "Coat")
    camera = build.looking_down(5.0, -1.0, size=4.0)
    assert hidden_things(camera, made) == []
    (row,) = hidden_things(camera, made, wanted={0})
    assert row.number == 0 and row.hidden == 1.0


def test_what_may_let_light_through_hides_nothing(build, scene):
    glass = MaterialGraph((), (Closure("TRANSPARENT", 0, {}),))
    clear = replace(scene, materials=replace(scene.materials, graphs={1: glass}))
    camera = build.looking_down(5.0, -1.0, size=4.0)
    found = brute(camera, scene)
    # Nothing else is behind it alone.
    found[1] = np.inf
    assert_as(hidden_things(camera, clear, wanted=range(5)), found)


def test_bent_projectors_see_past_what_straight_ones_do_not(build, scene):
    """They come round the lid from the side. Each object is cast alone."""
    straight = {
        each.number: each.hidden for each in hidden_things(build.looking_down(5.0, -1.0, size=4.0), scene)
    }
    bent = build.looking_down(5.0, 2.0, -1.0, size=4.0, shifts=[0.0, 5.0, 0.0])
    rows = hidden_things(bent, scene, wanted=range(5))
    whole = CastScene(scene.geometry.vertices, scene.geometry.triangles)
    alone = [whole.only(scene.geometry.object_index == number) for number in range(5)]
    assert_as(rows, np.stack([cast_frame(each, bent, COLUMNS, COLUMNS).t for each in alone]))
    hidden = {each.number for each in rows}
    assert straight[2] == 1.0 and 2 not in hidden


def test_nothing_is_listed_of_nothing(build, scene):
    """No triangles, or none in the volume."""
    empty = replace(scene, geometry=scene.geometry.part(np.zeros(len(scene.geometry.triangles), bool)))
    assert hidden_things(build.looking_down(5.0, -1.0, size=4.0), empty) == []
    assert hidden_things(build.looking_down(50.0, 40.0, size=4.0), scene, wanted=range(5)) == []


def test_it_can_be_cancelled(build, scene):
    camera = build.looking_down(5.0, -1.0, size=4.0)
    assert hidden_things(camera, scene, cancelled=lambda: True) is None
