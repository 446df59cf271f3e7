# SPDX-License-Identifier: GPL-3.0-or-later
"""Pixel error 0: the first hit is that of brute force in float64, silhouettes included."""

import math
from functools import cache

import numpy as np
import pytest

from benchmarks.hard_scenes import HARD_SCENES
from benchmarks.scenes import SCENES, bent_projection
from benchmarks.trade import put_into, volumes
from scfpf_addon.casting import tiles as tiling
from scfpf_addon.casting.cast import cast
from scfpf_addon.casting.common import memory
from scfpf_addon.casting.common.hits import CastCounts, CastError
from scfpf_addon.casting.curves import chord_rules
from scfpf_addon.casting.exact import chord_bounds
from scfpf_addon.casting.frame import cast_frame, pixel_centres
from scfpf_addon.casting.scene.cast_scene import CastScene
from scfpf_addon.projection.surfaces.surface import Plane
from scfpf_addon.projection.volume.viewing_volume import Projection, ViewingVolume

WIDTH, HEIGHT = 48, 27

# Two hits count as one when their t differ by less.
SAME = 1e-9

BASES = {"polyline": "POLYLINE", "spline": "B_SPLINE", "smooth": "SMOOTH"}


def volume(name):
    if name in BASES:
        surfaces = bent_projection(5, math.radians(120)).volume.surfaces
        return Projection(ViewingVolume(surfaces, BASES[name], (1.0, 1.5, 4.0, 5.0, 9.0, 9.5)))
    degree, angle = {
        "straight": (1, 0),
        "slight": (2, 10),
        "quadratic": (2, 60),
        "cubic": (3, 180),
        "loop": (4, 300),
        "quintic": (5, 180),
    }[name]
    return bent_projection(degree, math.radians(angle))


@cache
def mesh(name):
    return HARD_SCENES[name]() if name in HARD_SCENES else SCENES[name](1000)


@cache
def cast_scene(name):
    return CastScene(*mesh(name))


def different(hits, t):
    ours, true = (np.where(np.isfinite(a), a, 2.0) for a in (hits.t, t))
    return int((np.abs(ours - true) > SAME).sum())


def agree(reference, scene, name, width=WIDTH, height=HEIGHT, grid=True):
    """The number of pixels whose t and triangle differ from those of brute force."""
    x, y = pixel_centres(width, height, (0, height))
    t, triangle = reference.brute_force(*mesh(scene), volume(name), x, y)
    hits = reference.cast_image(cast_scene(scene), volume(name), width, height, 0.0, grid)
    assert (np.isfinite(t) == (hits.triangle >= 0)).all()
    assert different(hits, t) == 0
    return hits, triangle


@pytest.mark.parametrize(
    "name", ["straight", "slight", "quadratic", "cubic", "loop", "quintic", "polyline", "spline", "smooth"]
)
@pytest.mark.parametrize("scene", SCENES)
def test_every_pixel_sees_what_brute_force_sees(reference, scene, name):
    hits, triangle = agree(reference, scene, name)
    # Triangles that share the point that is hit may stand for each other.
    assert (hits.triangle != triangle).sum() <= 3
    assert (hits.triangle >= 0).mean() > 0.1


@pytest.mark.parametrize("name", ["straight", "quadratic", "loop"])
@pytest.mark.parametrize("scene", HARD_SCENES)
def test_hard_meshes(reference, scene, name):
    """Unwelded, doubled, crossing, near-coincident, non-manifold; slivers and dust."""
    agree(reference, scene, name, 40, 23)


@pytest.mark.parametrize("name", ["straight", "quadratic", "cubic", "polyline"])
def test_loose_projectors_are_as_exact_as_rows_of_pixels(reference, name):
    agree(reference, "boxes", name, 48, 27, grid=False)


@pytest.mark.parametrize("reach", [10.0, 1e3, 1e6])
@pytest.mark.parametrize("count", [2, 3, 4])
def test_volumes_much_larger_than_the_scene(reference, count, reach):
    """Control points far outside, where float32 keeps nothing of the scene's size."""
    vertices, triangles = mesh("boxes")
    surfaces = []
    # In the middle, where the scene is, their curves are back beside it.
    aside = {2: (-1, 1), 3: (-1, 1, -1), 4: (-3, 1, 1, -3)}[count]
    for k, z in enumerate(np.linspace(reach, -reach, count)):
        matrix = np.eye(4)
        matrix[:3, 3] = 6.0 + 0.1 * reach * aside[k], 0.2 * (k % 3), z - 10.0
        surfaces.append(Plane(20.0 + 0.5 * k, 12.0, matrix=matrix))
    projection = Projection(ViewingVolume(tuple(surfaces)))
    x, y = pixel_centres(40, 30, (0, 30))
    t, _ = reference.brute_force(vertices, triangles, projection, x, y)
    assert np.isfinite(t).mean() > 0.02
    for grid in (True, False):
        hits = reference.cast_image(cast_scene("boxes"), projection, 40, 30, 0.0, grid)
        ours, true = (np.where(np.isfinite(a), a, 2.0) for a in (hits.t, t))
        assert (np.abs(ours - true) < 1e-12 * max(1.0, 1e3 / reach)).all()


def test_neither_tiles_nor_threads_show(monkeypatch):
    frames = []
    for threads, pixels in ((1, 1 << 16), (2, 7 * WIDTH), (3, 16 * WIDTH)):
        monkeypatch.setattr(tiling, "TILE_PIXELS", pixels)
        frames.append(cast_frame(cast_scene("boxes"), volume("quadratic"), WIDTH, HEIGHT, 0.0, threads))
    for other in frames[1:]:
        assert (frames[0].triangle == other.triangle).all()
        np.testing.assert_array_equal(frames[0].t, other.t)
        np.testing.assert_array_equal(frames[0].position, other.position)


@pytest.mark.parametrize("scene", SCENES)
def test_skipping_empty_space_loses_nothing(monkeypatch, scene):
    """In narrow tiles, through a volume that turns about itself: blocks of many shapes."""
    twist = volumes()["Nonlinear Twist"]
    placed = CastScene(*put_into(SCENES[scene](10_000), twist))
    width, height = 160, 90
    monkeypatch.setattr(tiling, "TILE_PIXELS", 12 * width)
    skipped = cast_frame(placed, twist, width, height, 0.0)
    x, y = pixel_centres(width, height, (0, height))
    plain = cast(placed, twist.transformed(placed.matrix), x, y, (1 / width, 1 / height), 0.0)
    assert (np.isfinite(skipped.t) == np.isfinite(plain.t)).all() and different(skipped, plain.t) == 0


def test_projectors_that_need_too_many_chords_together_are_cast_apart(monkeypatch, reference):
    """The bound is kept, or the cast refused in words: never dropped."""
    scene, whole = cast_scene("terrain"), volume("quadratic")
    points = whole.transformed(scene.matrix).projectors(*pixel_centres(WIDTH, HEIGHT, (0, HEIGHT))).points
    lower, upper, epsilon = scene.prisms.lower, scene.prisms.upper, scene.prisms.epsilon
    needed = chord_bounds.certain_chords(whole.volume.spans, points, lower, upper, epsilon)[0].count
    expected = reference.cast_image(scene, whole, WIDTH, HEIGHT, 0.0)
    monkeypatch.setattr(chord_rules, "MOST_CERTAIN", needed - 1)
    _, bound = chord_bounds.certain_chords(whole.volume.spans, points, lower, upper, epsilon)
    assert bound > epsilon
    assert different(reference.cast_image(scene, whole, WIDTH, HEIGHT, 0.0), expected.t) == 0
    monkeypatch.setattr(chord_rules, "MOST_CERTAIN", 2)
    with pytest.raises(CastError, match="set the pixel error above 0"):
        reference.cast_image(scene, whole, WIDTH, HEIGHT, 0.0)


def test_what_is_reported(reference):
    counts = CastCounts()
    reference.cast_image(cast_scene("terrain"), volume("quadratic"), WIDTH, HEIGHT, 0.0, counts=counts)
    assert counts.projectors == WIDTH * HEIGHT and counts.error_bound == 0.0
    assert 0.5 * counts.projectors < counts.tested < 3 * counts.projectors
    assert counts.chords < counts.rays < 20 * counts.projectors
    assert counts.unresolved == 0


def test_prisms_are_made_only_for_exact_casting_and_once(reference):
    scene = CastScene(*mesh("terrain"))
    for error in (0.1, 1.0):
        reference.cast_image(scene, volume("quadratic"), 16, 9, error)
        assert scene._prisms._make is not None
    reference.cast_image(scene, volume("quadratic"), 16, 9, 0.0)
    made = scene.prisms
    reference.cast_image(scene, volume("cubic"), 16, 9, 0.0)
    assert scene.prisms is made


def test_too_little_memory_is_refused_in_words(monkeypatch, reference):
    scene = CastScene(*mesh("terrain"))
    monkeypatch.setattr(memory, "available_memory", lambda: 1000)
    with pytest.raises(CastError, match=r"needs 0\.0 GB .* set the pixel error above 0"):
        reference.cast_image(scene, volume("quadratic"), 16, 9, 0.0)
    monkeypatch.setattr(memory, "available_memory", lambda: None)
    assert reference.cast_image(scene, volume("quadratic"), 16, 9, 0.0).mask.all()
