# SPDX-License-Identifier: GPL-3.0-or-later
"""Anchors of a moving volume: most stay from frame to frame, and colours change smoothly."""

import math
from dataclasses import replace
from itertools import pairwise

import numpy as np
import pytest

from benchmarks.scenes import bent_projection, boxes
from scfpf_addon.anchors.join import join
from scfpf_addon.anchors.kept_plan import KeptPlan
from scfpf_addon.anchors.seen_scene import SeenScene
from scfpf_addon.anchors.shot import FADE, TOGETHER, LookedAt, Shot, completed_sets
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


def plan_for(shot, frame, scene):
    """Plan what a frame of a shot needs; return how many chunks that were."""
    missing = shot.missing(frame)
    for chunk in missing:
        looked_at = [LookedAt(scene, moved(each), str(each)) for each in shot.frames(chunk)]
        shot.plan(chunk, looked_at, SIZE, np.eye(3))
    assert not shot.missing(frame)
    return len(missing)


def matt(position):
    """Colours (N,) of a surface that looks alike from everywhere, from 0 to 1."""
    return 0.5 + 0.5 * np.sin(position[0] + 1.5 * position[1] + 0.5 * position[2])


def painted(_scene, view, number):
    """A picture of two channels: the matt colour, and a gloss that every anchor sees in another way."""
    begin, way, far = shown_by(view)
    gloss = np.full(len(far), 0.5 * (number % 2))
    return picture_of(view, matt(begin + way * far), gloss)


def mirrors(scene, view, _number):
    """A picture of what mirrors in the place of all faces show of their surroundings, twice."""
    begin, way, far = shown_by(view)
    inside = ((begin - scene.scene.centre[:, None]) * scene.scene.scale).astype(np.float32)
    reach = np.full(len(far), 2.0 * (view.anchor.end - view.anchor.start), np.float32)
    triangle = scene.scene.mesh.trace(inside, (way * scene.scene.scale).astype(np.float32), reach)
    shown = np.zeros(len(far))
    met = triangle >= 0
    shown[met] = mirrored(
        scene.scene.normals(triangle[met]), way[:, met] / np.linalg.norm(way[:, met], axis=0)
    )
    return picture_of(view, shown, shown)


def mirrored(normal, direction):
    """What surroundings with stripes of 45° look like in mirrors (3, N), from 0 to 1."""
    away = direction - 2.0 * (direction * normal).sum(axis=0) * normal
    return 0.5 + 0.5 * np.sin(8.0 * (away * np.array([[0.3], [0.5], [0.8]])).sum(axis=0))


def shown_by(view):
    """Where the rays of an anchor's pixels begin, their ways (3, N) and how far they go (N,)."""
    height, width = view.depth.shape
    column, row = np.tile(np.arange(width), height), np.repeat(np.arange(height), width)
    begin, way = view.anchor.rays(column, row)
    return begin, way, np.where(np.isfinite(view.depth), view.depth, 0.0).ravel() - view.anchor.start


def picture_of(view, *channels):
    colors = np.stack(channels, axis=1)
    return np.ascontiguousarray(colors.reshape(*view.depth.shape, len(channels)), np.float32)


def filmed(scene, paint):
    """The numbers of each frame's anchors, its share of holes, and how colours (2,) change at the surfaces.

    A change is that of what a pixel shows: of the same point of the surface, by the next frame's anchors.
    """
    shot, numbers, kept, frames, before = Shot(0, FRAMES - 1), {}, [], [], None
    for place in range(FRAMES):
        plan_for(shot, place, scene)
        views, sets = completed_sets(scene, moved(place), SIZE, shot.sets(place))
        own = [numbers.setdefault(id(view.anchor), len(numbers)) for view in views]
        kept += [view.anchor for view in views]
        pictures = [paint(scene, view, number) for view, number in zip(views, own, strict=True)]

        def looked_up(points, views=views, sets=sets, pictures=pictures):
            colors, is_hole = join(points, views, sets, pictures)
            return np.where(is_hole[:, None], np.nan, colors)

        change = None if before is None else np.abs(looked_up(before[0]) - before[1])
        x, y = pixel_centres(*SIZE, (0, SIZE[1]))
        points = shown_points(scene, moved(place), x, y, (1 / SIZE[0], 1 / SIZE[1]))
        points = points.take(np.flatnonzero(points.is_hit))
        before = points, looked_up(points)
        frames.append((own, np.isnan(before[1]).mean(), change))
    return frames


@pytest.fixture(scope="module")
def film():
    return filmed(seen(*boxes(2000)), painted)


def changes(film):
    """The changes (N, 2) of all frames."""
    found = np.concatenate([change for *_, change in film[1:]])
    return found[np.isfinite(found).all(axis=1)]


def test_most_anchors_stay_from_frame_to_frame(film):
    shares = [len(set(one) & set(other)) / len(one) for (one, *_), (other, *_) in pairwise(film)]
    assert np.mean(shares) > 0.9 and min(shares) >= 0.5
    assert max(holes for _, holes, _ in film) <= 1e-3


def test_matt_surfaces_that_stand_still_do_not_change(film):
    matt_changes = changes(film)[:, 0]
    assert len(matt_changes) > 100_000 and matt_changes.max() <= 0.01


def test_gloss_does_not_pop(film):
    """Anchors that see a surface in different ways, by half of white, fade into each other."""
    gloss = changes(film)[:, 1]
    assert (gloss > 1e-3).mean() > 0.01
    assert (gloss > 0.06).mean() < 1e-4


def test_mirrors_do_not_pop():
    """Their anchors stand near to the projectors, so that these see nearly the same."""
    scene = seen(*boxes(2000))
    scene = replace(scene, directional=np.ones(len(scene.scene.usable), bool))
    assert changes(filmed(scene, mirrors)).max() <= 0.1


def numbers_of(sets):
    """All numbers of sets of anchors, to be compared."""
    anchors = [(own.share, part, each) for own in sets for part in (own.anchors, own.rest) for each in part]
    return [
        (share, *each.matrix.ravel(), *each.window, *each.size, each.start, each.end)
        for share, _part, each in anchors
    ]


def test_sets_fade_into_each_other():
    """By equal steps, which end before the next change."""
    shot, scene = Shot(0, 3 * TOGETHER - 1), seen(*boxes(200))
    frames = range(TOGETHER, 2 * TOGETHER)
    plan_for(shot, TOGETHER, scene)
    shares = [shot.sets(frame)[-1].share for frame in frames]
    assert np.diff([0.0, *shares]).max() <= 1.0 / FADE and shares[-1] == 1.0
    assert all(sum(each.share for each in shot.sets(frame)) == 1.0 for frame in frames)


@pytest.mark.parametrize("step", [1, 3])
def test_a_frame_has_the_same_anchors_wherever_a_run_begins(step):
    """Rendered in order, from a frame on, backwards or alone; of a shot that begins within a chunk."""
    scene, ends = seen(*boxes(200)), (5, 2 * TOGETHER * step + 9)
    frames = (7, TOGETHER * step + step, TOGETHER * step + FADE * step + 1, 2 * TOGETHER * step + 2)
    runs = {}
    for name, order in {"all": frames, "back": frames[::-1]}.items():
        shot = Shot(*ends, step)
        for frame in order:
            plan_for(shot, frame, scene)
            runs[name, frame] = numbers_of(shot.sets(frame))
    for frame in frames:
        shot = Shot(*ends, step)
        assert plan_for(shot, frame, scene) <= 3
        runs["alone", frame] = numbers_of(shot.sets(frame))
    assert len(runs["all", frames[1]]) > len(runs["all", frames[0]]) > 3
    for frame in frames:
        assert runs["all", frame] == runs["back", frame] == runs["alone", frame]


def test_frames_are_looked_at_within_the_shot():
    shot = Shot(5, TOGETHER + 1)
    assert shot.frames(0) == [5, 10, 15] and shot.frames(1) == [TOGETHER, TOGETHER + 1]
    # Beyond the shot there is nothing that would be left out.
    assert shot.frames(4) == [64, 71, 79] and shot.frames(-1) == [-16, -9, -1]
    assert shot.missing(5) == [0] and shot.missing(TOGETHER) == [0, 1] and shot.missing(-1) == [-2, 0, -1]


def test_where_nothing_moves_all_frames_have_one_set():
    """Also that of a plan that was kept and fits; one that was made for something else is left alone."""
    scene, shot = seen(*boxes(200)), Shot(0, 4 * TOGETHER)
    still = [LookedAt(scene, moved(0), "still")] * 3
    for chunk in (0, 2, 1, 3):
        shot.plan(chunk, still, SIZE, np.eye(3))
    (one,) = shot.sets(1)
    assert all(shot.sets(frame) == [one] for frame in (TOGETHER, TOGETHER + 3, 3 * TOGETHER + 2))
    anchors = (*one.anchors, *one.rest)[:3]
    for made_for, is_taken in (("still", True), ("other", False)):
        kept, shot = KeptPlan(anchors, made_for, SIZE, 0.5, False), Shot(0, TOGETHER)
        shot.plan(0, still, SIZE, np.eye(3), kept=kept)
        assert (shot.sets(0)[0].anchors == [*anchors]) == is_taken
