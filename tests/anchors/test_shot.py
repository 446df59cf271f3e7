# SPDX-License-Identifier: GPL-3.0-or-later
"""Anchors of a moving volume: most stay from frame to frame, and colours change smoothly."""

import math
from itertools import pairwise

import numpy as np
import pytest

from benchmarks.scenes import bent_projection, boxes
from scfpf_addon.anchors.join import join
from scfpf_addon.anchors.plan import PlanLimits
from scfpf_addon.anchors.seen_scene import SeenScene
from scfpf_addon.anchors.shot import FADE, TOGETHER, Shot, completed_sets
from scfpf_addon.anchors.shown_points import shown_points
from scfpf_addon.casting.frame import pixel_centres
from scfpf_addon.casting.scene.cast_scene import CastScene

SIZE = (96, 54)
FRAMES = 48
# What the volume moves from frame to frame; the scene is two units wide.
STEP = 0.004


def seen(vertices, triangles):
    """Faces that are seen from both sides."""
    return SeenScene(CastScene(vertices, triangles))


def moved(frame):
    matrix = np.eye(4)
    matrix[0, 3] = frame * STEP
    return bent_projection(2, math.radians(60)).transformed(matrix)


def matt(position):
    """Colours (N,) of a surface that looks alike from everywhere, from 0 to 1."""
    return 0.5 + 0.5 * np.sin(position[0] + 1.5 * position[1] + 0.5 * position[2])


def painted(view, number):
    """A picture of two channels: the matt colour, and a gloss that every anchor sees in another way."""
    anchor, depth = view.anchor, view.depth
    height, width = depth.shape
    column, row = np.tile(np.arange(width), height), np.repeat(np.arange(height), width)
    begin, way = anchor.rays(column, row)
    far = np.where(np.isfinite(depth), depth, 0.0).ravel() - anchor.start
    gloss = np.full(height * width, 0.5 * (number % 2))
    colors = np.stack([matt(begin + way * far), gloss], axis=1)
    return np.ascontiguousarray(colors.reshape(height, width, 2), np.float32)


@pytest.fixture(scope="module")
def film():
    """The numbers of each frame's anchors, its share of holes, and how colours (2,) change at the surfaces.

    A change is that of what a pixel shows: of the same point of the surface, by the next frame's anchors.
    """
    scene, shot, numbers, kept, frames, before = seen(*boxes(2000)), Shot(FRAMES), {}, [], [], None
    for place in range(FRAMES):
        if needed := shot.needs(place):
            projections = [moved(each) for each in needed]
            shot.plan(place, [scene] * len(needed), projections, SIZE, np.eye(3))
        views, sets, added = completed_sets(scene, moved(place), SIZE, shot.sets(place))
        shot.add(added)
        own = [numbers.setdefault(id(view.anchor), len(numbers)) for view in views]
        kept += [view.anchor for view in views]
        pictures = [painted(view, number) for view, number in zip(views, own, strict=True)]

        def looked_up(points, views=views, sets=sets, pictures=pictures):
            colors, is_hole = join(points, views, sets, pictures, PlanLimits().angle)
            return np.where(is_hole[:, None], np.nan, colors)

        change = None if before is None else np.abs(looked_up(before[0]) - before[1])
        x, y = pixel_centres(*SIZE, (0, SIZE[1]))
        points = shown_points(scene, moved(place), x, y, (1 / SIZE[0], 1 / SIZE[1]))
        points = points.take(np.flatnonzero(points.is_hit))
        before = points, looked_up(points)
        frames.append((own, np.isnan(before[1]).mean(), change))
    return frames


def changes(film):
    """The changes (N, 2) of all frames."""
    found = np.concatenate([change for *_, change in film[1:]])
    return found[np.isfinite(found).all(axis=1)]


def test_most_anchors_stay_from_frame_to_frame(film):
    shares = [len(set(one) & set(other)) / len(one) for (one, *_), (other, *_) in pairwise(film)]
    assert np.mean(shares) > 0.9 and min(shares) > 0.6
    assert max(holes for _, holes, _ in film) <= 1e-3


def test_matt_surfaces_that_stand_still_do_not_change(film):
    matt_changes = changes(film)[:, 0]
    assert len(matt_changes) > 100_000 and matt_changes.max() <= 0.01


def test_gloss_does_not_pop(film):
    """Anchors that see a surface in different ways, by half of white, fade into each other."""
    gloss = changes(film)[:, 1]
    assert (gloss > 1e-3).mean() > 0.01
    assert (gloss > 0.06).mean() < 1e-4


def test_sets_fade_into_each_other(film):
    """By equal steps, which end before the next change."""
    shot = Shot(3 * TOGETHER)
    scene = seen(*boxes(200))
    for place in (0, TOGETHER):
        assert shot.needs(place)[0] == place
        shot.plan(place, [scene] * 3, [moved(each) for each in shot.needs(place)], SIZE, np.eye(3))
    shares = [shot.sets(place)[-1].share for place in range(TOGETHER, 2 * TOGETHER)]
    assert np.diff([0.0, *shares]).max() <= 1.0 / FADE and shares[-1] == 1.0
    assert all(sum(each.share for each in shot.sets(place)) == 1.0 for place in range(TOGETHER, 2 * TOGETHER))
