# SPDX-License-Identifier: GPL-3.0-or-later
"""Stylised images against closed forms: lines, widths and tones; the same whatever the tiles."""

from dataclasses import replace

import numpy as np
import pytest

import scfpf_addon.casting.tiles as tiles
from scfpf_addon.casting.common.ray_visibility import CAMERA, CATCHER, EVERYWHERE, HOLDOUT
from scfpf_addon.projection.surfaces.surface import Plane
from scfpf_addon.projection.volume.viewing_volume import Projection, ViewingVolume
from scfpf_addon.shading.frame import draw_over_frame, render_frame
from scfpf_addon.shading.nodes.graph import Closure, MaterialGraph, Operation, Ref
from scfpf_addon.shading.passes.data_passes import DataPasses
from scfpf_addon.shading.scene.shading_scene import Light
from scfpf_addon.shading.scene.world import World
from scfpf_addon.shading.settings.frame_settings import Border, FrameSettings
from scfpf_addon.shading.settings.stylised_settings import (
    CONTOUR,
    CREASE,
    MATERIAL,
    OBJECT,
    SILHOUETTE,
    Hatching,
    Lines,
    Stylised,
)
from scfpf_addon.shading.stylised.edges import Segments
from scfpf_addon.shading.stylised.strokes import LAYERS, cover_lines

EVERY_KIND = SILHOUETTE | OBJECT | CONTOUR | MATERIAL | CREASE
BALL_CENTRE, BALL_RADIUS = np.array([0.1, -0.05, 0.2]), 0.45


def stylised(**options):
    """Settings of a small image of lines (or whatever is given) on white paper."""
    size = options.pop("size", (96, 64))
    given = {"lines": Lines(EVERY_KIND, 1.0, 1.0), "fill": "PAPER", "on_paper": True, **options}
    return FrameSettings(*size, samples=1, stylised=Stylised(**given), threads=2)


def ink(projection, scene, settings):
    """The share of each pixel that black ink on white paper covers, (H, W)."""
    pixels = render_frame(projection, scene, settings).pixels
    assert np.allclose(pixels[..., 3], 1)
    return 1 - pixels[..., 0]


def box():
    """A cube with flat faces."""
    corners = np.array([[x, y, z] for x in (-0.5, 0.5) for y in (-0.5, 0.5) for z in (-0.5, 0.5)])
    quads = [[0, 1, 3, 2], [4, 6, 7, 5], [0, 4, 5, 1], [2, 3, 7, 6], [0, 2, 6, 4], [1, 5, 7, 3]]
    return corners, [part for a, b, c, d in quads for part in ([a, b, c], [a, c, d])], None


def perspective(build, near=2.0, far=-1.0, eye=4.0):
    """Straight projectors from (0, 0, eye), and the volume that they fill."""
    sides = tuple(
        Plane(matrix=build.placed((0, 0, height)), width=(eye - height) * 0.6, height=(eye - height) * 0.6)
        for height in (near, far)
    )
    return Projection(ViewingVolume(sides))


def bent(build):
    return build.looking_down(2, 1, -1, shifts=[0, 0.8, 0])


def missed_by(projection, settings, x, y):
    """By how much projectors at x, y (n,) in pixels miss the ball, by 400 places on each."""
    image = projection.parameters(x / settings.width, y / settings.height)
    t = np.linspace(0.2, 1, 400)
    u, v = (np.repeat(each, 400) for each in (image.u, image.v))
    place = projection.volume.evaluate(u, v, np.tile(t, len(x))).position - BALL_CENTRE[:, None]
    return np.linalg.norm(place, axis=0).reshape(-1, 400).min(axis=1) - BALL_RADIUS


@pytest.mark.parametrize("make", [perspective, bent])
def test_a_balls_outline_lies_on_its_silhouette(build, make):
    scene = build.scene([build.sphere(96, BALL_CENTRE, BALL_RADIUS)])
    projection, settings = make(build), stylised(size=(60, 50))
    drawn = ink(projection, scene, settings)
    y, x = (axis.ravel() for axis in np.mgrid[0:50, 0:60] + 0.5)
    missed = missed_by(projection, settings, x, y).reshape(drawn.shape)
    # The silhouette in pixels away: by the slope of what it is missed by.
    away = np.abs(missed) / np.hypot(*np.gradient(missed))
    assert (drawn > 0.05).sum() > 80
    assert away[drawn > 0.05].max() < 1.3 and drawn[away < 0.2].min() > 0.6
    # Ink is a pixel wide, so that its sum is the silhouette's length: the mean of both sides'.
    inside = np.sqrt(4 * np.pi * (missed < 0).sum())
    assert drawn.sum() == pytest.approx(inside, rel=0.1)


@pytest.mark.parametrize("hatching", [None, Hatching("TONE"), Hatching("DEPTH")])
def test_a_finished_image_is_drawn_over_as_a_rendered_one(build, hatching):
    """Whoever has rendered what is between the lines: here the same renderer, without a style."""
    scene = build.scene([build.sphere(24, BALL_CENTRE, BALL_RADIUS), box()])
    settings = stylised(fill="RENDERED", hatching=hatching)
    rendered = render_frame(bent(build), scene, settings).pixels
    pixels = render_frame(bent(build), scene, replace(settings, stylised=None, transparent=True)).pixels
    assert np.abs(pixels - rendered).max() > 0.5
    assert draw_over_frame(bent(build), scene, settings, pixels)
    np.testing.assert_allclose(pixels, rendered, atol=1e-6)
    assert not draw_over_frame(bent(build), scene, settings, pixels, cancelled=lambda: True)


def test_contours_are_where_projectors_graze_the_normals(build):
    """A tilted sheet with normals of its own: they are at right angles to level projectors at x = 0.3."""
    corners = np.array([[-1, -1, -1], [1, -1, 1], [1, 1, 1], [-1, 1, -1.0]])
    turned = (corners[:, 0] - 0.3) * -0.5
    normals = np.stack([-np.sqrt(1 - turned**2), 0 * turned, turned], axis=1)
    faces = np.array([[0, 1, 2], [0, 2, 3]])
    scene = build.scene([(corners, faces, normals[faces])])
    projection = build.looking_down(2, -2)
    drawn = ink(projection, scene, stylised(lines=Lines(CONTOUR, 1.0, 1.0), size=(60, 40)))
    where = np.flatnonzero(drawn[20] > 0)
    # Interpolated z of both ends changes its sign where the share of the right one is 0.65: x = 0.3.
    assert np.average(where + 0.5, weights=drawn[20][where]) == pytest.approx((0.3 + 1) * 30, abs=0.05)
    assert drawn.sum() == pytest.approx(40, rel=0.01)


def test_creases_of_a_box_are_straight_lines_of_a_width(build):
    """From one corner of a box three creases run, to where an orthographic view has their ends."""
    turn = np.array([[1, -1, 0], [1, 1, -2], [1, 1, 1]]) / np.sqrt([[2], [6], [3]])
    corners, faces, _ = box()
    scene = build.scene([(corners @ turn.T, faces, None)])
    projection = build.looking_down(2, -2)
    creases = ink(projection, scene, stylised(lines=Lines(CREASE, 9.0, 2.0), size=(100, 100)))
    # Each has the length √(2/3) of an edge of 1, in 50 pixels a unit, less what they share in the middle.
    assert creases.sum() == pytest.approx(3 * np.sqrt(2 / 3) * 50 * 2 - 1, rel=0.02)
    y, x = np.mgrid[0:100, 0:100] + 0.5
    away = np.full(x.shape, np.inf)
    for axis in range(3):
        end = -turn[:2, axis] * 50
        share = np.clip(((x - 50) * end[0] + (y - 50) * end[1]) / (end @ end), 0, 1)
        away = np.minimum(away, np.hypot(x - 50 - share * end[0], y - 50 - share * end[1]))
    assert (away[creases > 0] < 1.6).all() and (creases[away < 0.4] > 0.9).all()
    none = stylised(lines=Lines(CREASE, 1, 1, crease_angle=np.radians(91)), size=(100, 100))
    assert not ink(projection, scene, none).any()


def test_a_plane_seen_at_a_grazing_angle_has_no_lines(build):
    """Five hundred units of it, from half a unit above, the horizon near: only its far end is drawn."""
    looks = np.eye(4)
    looks[:3] = np.column_stack([[1, 0, 0], [0, 0.01, 0.99995], [0, -0.99995, 0.01], [0, 0, 0.5]])
    near, far = (
        Plane(matrix=looks @ build.placed((0, 0, -away)), width=away, height=away / 2)
        for away in (0.1, 900.0)
    )
    x, y = np.meshgrid(np.linspace(-300, 300, 61), np.linspace(0.05, 500, 41))
    number = np.arange(x.size).reshape(x.shape)
    a, b, c, d = (
        part.ravel() for part in (number[:-1, :-1], number[:-1, 1:], number[1:, 1:], number[1:, :-1])
    )
    faces = np.concatenate([np.stack([a, b, c], 1), np.stack([a, c, d], 1)])
    scene = build.scene([(np.stack([x, y, 0 * x], -1).reshape(-1, 3), faces, None)])
    drawn = ink(Projection(ViewingVolume((near, far))), scene, stylised(size=(120, 80)))
    rows = np.flatnonzero(drawn.any(axis=1))
    assert 0 < len(rows) <= 3 and rows.min() > 30


def test_objects_and_materials_are_told_apart(build):
    parts = [build.square(0.5, 0.0, (-0.5, 0)), build.square(0.5, 0.0, (0.5, 0))]
    scene = build.scene(parts)
    projection = build.looking_down(1, -1)
    one = replace(scene, geometry=replace(scene.geometry, object_index=np.zeros(4, np.int32)))
    for what, kinds, line in (
        (scene, OBJECT, True),
        (scene, MATERIAL, True),
        (one, MATERIAL, True),
        (one, SILHOUETTE | OBJECT | CREASE | CONTOUR, False),
    ):
        drawn = ink(projection, what, stylised(lines=Lines(kinds, 1.0, 1.0)))
        assert (drawn[32, 46:50].max() > 0.4) == line
        assert not drawn[32, 52:90].any()


def test_a_lines_width_is_its_integral():
    along = np.arange(0, 40, 0.5)
    for width in (0.3, 1.0, 2.5, 7.0):
        for slant in (0.2, 0.7):
            right = np.full(80, 0.5)
            pieces = Segments(along, 20.0 + slant * along, right, slant * right, np.ones(80, int))
            covered = cover_lines(pieces, width, slice(0, 60), 40).reshape(60, 40)
            expected = width * np.hypot(1, slant)
            assert covered[:, 10:30].sum(axis=0).mean() == pytest.approx(expected, rel=0.025)


def test_widths_follow_the_image(build):
    drawn = Stylised(Lines(width=2.0, inner_width=1.0), Hatching(width=1.0, spacing=6.0)).scaled(0.5)
    assert (drawn.lines.width, drawn.lines.inner_width) == (1.0, 0.5)
    assert (drawn.hatching.width, drawn.hatching.spacing) == (0.5, 3.0)


@pytest.mark.parametrize(("steps", "shadows"), [(2, True), (3, False), (5, True)])
def test_steps_of_light_are_so_many_tones(build, steps, shadows):
    sun = Light("SUN", np.full(3, np.pi), build.placed(shines=(0.4, 0.2, -1)), shadows)
    scene = build.scene([build.sphere(48, (0, 0, 0), 0.8)], [sun], base=(0.5, 0.5, 0.5))
    settings = stylised(lines=None, fill="TOON", steps=steps, darkest=0.2)
    pixels = render_frame(build.looking_down(2, -2), scene, settings).pixels
    tones = np.unique(np.round(pixels[..., 0], 5))
    expected = 0.5 * np.linspace(0.2, 1, steps)
    assert np.allclose(tones[:-1], expected, atol=1e-4) and tones[-1] == 1
    # The paper's sun at right angles is full light, and step k begins at a perceived tone of k / steps.
    x, y = np.meshgrid((np.arange(96) + 0.5) / 48 - 1, (np.arange(64) + 0.5) / 32 - 1)
    inside = np.hypot(x, y) < 0.78
    normal = np.stack([x, y, np.sqrt(np.maximum(0.64 - x**2 - y**2, 0))]) / 0.8
    light = np.maximum(np.einsum("i,ijk->jk", np.array([-0.4, -0.2, 1]) / np.sqrt(1.2), normal), 0)
    place = light ** (1 / 2.2) * steps
    sure = inside & (np.abs(place - np.rint(place)) > 0.08)
    level = np.minimum(np.floor(place), steps - 1).astype(int)
    assert np.allclose(pixels[..., 0][sure], expected[level][sure], atol=1e-4)


def test_a_soft_lamp_has_sharp_tones_with_any_number_of_samples(build):
    """A cube's shadow on a wall, under a wide sun and a sky: each pixel is of one of two tones."""
    sun = Light("SUN", np.full(3, np.pi), build.placed(shines=(0.5, 0.2, -1)), angle=2.0)
    corners, faces, normals = box()
    scene = build.scene([build.square(3.0), (corners * 0.5 + [0, 0, 0.5], faces, normals)], [sun])
    dim = Operation("CONSTANT", (), {"value": np.array([0.005])})
    closure = Closure("EMISSION", Ref(0), {"color": Ref(1)})
    sky = World(MaterialGraph((dim, Operation("POSITION")), (closure,)))
    settings = stylised(lines=None, fill="TOON", steps=2, darkest=0.2)
    made = {}
    for samples in (1, 9):
        image = render_frame(
            build.looking_down(2, -2), replace(scene, world=sky), replace(settings, samples=samples)
        )
        made[samples] = image.pixels[..., :3].max(axis=2)  # the sky tints the others
    low, high = np.unique(np.round(made[1], 4))
    assert high > 2 * low
    # Pixels that an edge crosses are between both.
    between = (np.abs(made[9] - low) > 1e-3) & (np.abs(made[9] - high) > 1e-3)
    assert 0 < between.mean() < 0.05


def test_flat_colours_know_no_light_and_softness_no_steps(build):
    sun = Light("SUN", np.full(3, np.pi), build.placed(shines=(0.4, 0.2, -1)))
    scene = build.scene([build.sphere(24, (0, 0, 0), 0.8)], [sun], base=(0.5, 0.4, 0.3))
    view = build.looking_down(2, -2)
    flat = render_frame(view, scene, stylised(lines=None, fill="FLAT")).pixels
    assert np.allclose(flat[32, 48, :3], (0.5, 0.4, 0.3), atol=1e-5)
    assert len(np.unique(flat[..., 0])) == 2
    soft = render_frame(view, scene, stylised(lines=None, fill="TOON", softness=1.0)).pixels
    assert len(np.unique(soft[..., 0])) > 100
    faded = render_frame(view, scene, stylised(lines=None, fill="FLAT", fade=0.5)).pixels
    assert np.allclose(faded[32, 48, :3], (0.75, 0.7, 0.65), atol=1e-5)


def test_strokes_of_equal_t_are_cuts_through_the_volume(build):
    """A sheet that rises 1 to 10 in an orthographic volume 2 high: t falls evenly along x."""
    corners = np.array([[-1, -1, -0.9], [1, -1, 0.9], [1, 1, 0.9], [-1, 1, -0.9]])
    scene = build.scene([(corners, [[0, 1, 2], [0, 2, 3]], None)])
    hatching = Hatching("DEPTH", width=1.5, count=10)
    drawn = ink(
        build.looking_down(1, -1), scene, stylised(lines=None, hatching=hatching, size=(200, 8), detail=4)
    )
    # z = 1 - 2t = 0.9 x, so that x = (1 - 0.2 k) / 0.9 for t = k / 10.
    places = [(1 + (1 - 0.2 * k) / 0.9) * 100 for k in range(1, 10)]
    for place in places:
        near = slice(int(place) - 4, int(place) + 5)
        share = drawn[4, near]
        assert share.sum() == pytest.approx(1.5, abs=0.01)
        assert np.average(np.arange(200)[near] + 0.5, weights=share) == pytest.approx(place, abs=0.1)
    assert drawn[4].sum() == pytest.approx(1.5 * 9, abs=0.1)


@pytest.mark.parametrize("cross", [False, True])
def test_darker_tones_have_denser_strokes(build, cross):
    shares = []
    for light in (1.0, 0.45, 0.15, 0.001):
        scene = build.scene([build.square(3)], world=(light,) * 3)
        hatching = Hatching("TONE", width=1.5, spacing=8.0, cross=cross)
        drawn = ink(build.looking_down(1, -1), scene, stylised(lines=None, hatching=hatching, detail=3))
        shares.append(drawn.mean())
    assert shares[0] == 0 and np.all(np.diff(shares) > 0.05)
    assert len(LAYERS) == 3
    # One layer of full strokes covers 1.5 of 8; three hide a part of each other when they cross.
    assert shares[3] == pytest.approx(1 - (1 - 1.5 / 8) ** 3 if cross else 4 * 1.5 / 8, abs=0.02)


def test_paper_is_where_nothing_is_hit_unless_the_film_is_transparent(build):
    scene = build.scene([build.square(0.5)], world=(0.2, 0.3, 0.4))
    settings = stylised(lines=None, fill="FLAT", paper=np.array([1, 0.9, 0.8]))
    pixels = render_frame(build.looking_down(1, -1), scene, settings).pixels
    assert np.allclose(pixels[2, 2], (1, 0.9, 0.8, 1))
    clear = render_frame(build.looking_down(1, -1), scene, replace(settings, transparent=True)).pixels
    assert not clear[2, 2].any()


def test_what_is_held_out_is_a_hole_without_a_rim(build):
    scene = build.scene([build.square(0.5)])
    held = replace(scene, geometry=replace(scene.geometry, visibility=np.full(2, CAMERA | HOLDOUT, np.uint8)))
    for hatching in ("DEPTH", "TONE"):
        settings = replace(stylised(hatching=Hatching(hatching)), transparent=True)
        assert render_frame(build.looking_down(1, -1), scene, settings).pixels.any()
        assert not render_frame(build.looking_down(1, -1), held, settings).pixels.any()


def test_shadows_that_are_caught_are_those_of_the_rendered_image(build):
    """In all fills, and nothing else of the catcher: neither its fill nor its rim."""
    lights = [Light("SUN", np.full(3, np.pi), build.placed(shines=(0.5, 0.2, -1)))]
    scene = build.scene([build.square(0.7), build.square(0.3, 0.6)], lights)
    visibility = np.array([EVERYWHERE | CATCHER] * 2 + [EVERYWHERE] * 2, np.uint8)
    scene = replace(scene, geometry=replace(scene.geometry, visibility=visibility))
    made = {}
    for fill in ("RENDERED", "TOON", "FLAT", "PAPER"):
        settings = replace(stylised(lines=None, fill=fill, on_paper=False), transparent=True)
        made[fill] = render_frame(build.looking_down(1, -1), scene, settings).pixels[..., 3]
        lined = replace(settings, stylised=replace(settings.stylised, lines=Lines(EVERY_KIND, 1.0, 1.0)))
        rim = render_frame(build.looking_down(1, -1), scene, lined).pixels[..., 3] - made[fill]
        assert np.ptp(np.flatnonzero(rim.any(axis=0))) < 35
    assert all(np.array_equal(alpha, made["RENDERED"]) for alpha in made.values())
    assert set(np.unique(made["FLAT"])) == {0.0, 1.0} and 0.1 < made["FLAT"].mean() < 0.2


@pytest.fixture(scope="module")
def view(build):
    """A ball, a floating square and the ground, lit so that they throw shadows; all of the style on."""
    parts = [build.square(3), build.sphere(12, (0.2, 0.1, 0.6), 0.5), build.square(0.3, 1.4, (-0.5, 0))]
    lights = [Light("SUN", np.full(3, np.pi), build.placed(shines=(0.5, 0.2, -1)))]
    scene = build.scene(parts, lights, base=(0.8, 0.6, 0.4), f0=0.04, world=(0.1, 0.1, 0.2))
    settings = replace(
        stylised(
            lines=Lines(EVERY_KIND, 5.0, 2.0), hatching=Hatching("TONE"), fill="TOON", steps=4, size=(48, 40)
        ),
        samples=2,
    )
    return scene, settings


def test_a_border_and_threads_make_no_difference(build, view):
    scene, settings = view
    whole = render_frame(bent(build), scene, settings).pixels
    for border in (Border(0, 0, 24, 21), Border(24, 21, 48, 40)):
        part = render_frame(bent(build), scene, replace(settings, border=border, threads=1)).pixels
        assert np.array_equal(part, whole[border.bottom : border.top, border.left : border.right])


@pytest.mark.parametrize("kind", ["TONE", "DEPTH"])
def test_the_tiling_makes_no_difference(build, view, monkeypatch, kind):
    """Of straight projectors, which share no chords: a tile of all rows, and tiles of one row."""
    scene, settings = view
    settings = replace(settings, stylised=replace(settings.stylised, hatching=Hatching(kind)))
    images = []
    for fewest, pixels in ((1, 1 << 20), (40, 1)):
        monkeypatch.setattr(tiles, "FEWEST_TILES", fewest)
        monkeypatch.setattr(tiles, "FEWEST_PIXELS", pixels)
        images.append(render_frame(perspective(build), scene, settings).pixels)
    assert np.array_equal(*images)


def test_passes_stay_as_they_are_and_off_is_off(build, view):
    scene, settings = view
    passes = DataPasses(("DEPTH", "NORMAL", "OBJECT_INDEX", "DIFFUSE", "SPECULAR", "ENVIRONMENT", "SHADOW"))
    scene = replace(scene, object_index=(1, 2, 3))
    drawn = render_frame(bent(build), scene, replace(settings, passes=passes))
    plain = render_frame(bent(build), scene, replace(settings, passes=passes, stylised=None))
    for name, values in plain.passes.items():
        assert np.array_equal(values, drawn.passes[name])
    same = render_frame(bent(build), scene, replace(settings, stylised=Stylised(fill="RENDERED")))
    assert np.array_equal(same.pixels, plain.pixels)
