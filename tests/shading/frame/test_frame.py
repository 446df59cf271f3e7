# SPDX-License-Identifier: GPL-3.0-or-later
"""The whole pipeline: from a projection and a scene to pixels."""

import threading
from dataclasses import replace

import numpy as np
import pytest

from scfpf_addon.casting import tiles as tiling
from scfpf_addon.casting.cast import cast
from scfpf_addon.casting.common.geometry import Geometry
from scfpf_addon.casting.scene.cast_scene import CastScene
from scfpf_addon.projection.surfaces.surface import Disc
from scfpf_addon.projection.volume.reparameterisation import Polar
from scfpf_addon.projection.volume.viewing_volume import Projection, ViewingVolume
from scfpf_addon.shading.frame import render_frame
from scfpf_addon.shading.lights import lighting
from scfpf_addon.shading.materials.ggx_sampling import single_scatter_albedo
from scfpf_addon.shading.report import RenderReport
from scfpf_addon.shading.scene.shading_scene import Light, Scene
from scfpf_addon.shading.settings.frame_settings import FrameSettings
from scfpf_addon.shading.tracing import scene_view


def overhead(build, **more):
    return Light("SUN", np.full(3, np.pi), build.placed(), **more)


def test_an_image_is_the_right_way_up(build):
    """A square in the right upper quarter, seen from above with +Y up, is white there."""
    scene = build.scene([build.square(0.5, centre=(0.5, 0.5))], [overhead(build)], world=(0, 0, 0.25))
    pixels = render_frame(build.looking_down(1, -1), scene, FrameSettings(8, 4)).pixels
    assert pixels.shape == (4, 8, 4) and pixels.dtype == np.float32
    expected = np.tile(np.float32([0, 0, 0.25, 1]), (4, 8, 1))
    expected[2:, 4:] = [1, 1, 1.25, 1]
    assert np.allclose(pixels, expected, atol=1e-6)


def test_edges_are_the_covered_share(build):
    """A square's edge at 30 % of a pixel column, with 64 samples."""
    scene = build.scene([build.square(1, centre=(-1 + 0.3 * 0.25, 0))], [overhead(build)])
    pixels = render_frame(build.looking_down(1, -1), scene, FrameSettings(8, 2, samples=64)).pixels
    assert np.allclose(pixels[:, :4, 0], 1) and not pixels[:, 5:, 0].any()
    assert np.allclose(pixels[:, 4, 0], 0.3, atol=0.5 / 64 + 1e-6)


def test_corners_are_the_covered_area(build):
    """A corner that covers 40 % × 40 % of a pixel covers 16 % of it."""
    scene = build.scene([build.square(1, centre=(-1.2, -1.2))], [overhead(build)])
    pixels = render_frame(build.looking_down(1, -1), scene, FrameSettings(1, 1, samples=100)).pixels
    assert pixels[0, 0, 0] == pytest.approx(0.16, abs=0.02)


def test_transparent_background(build):
    scene = build.scene([build.square(0.5, centre=(-0.5, 0))], [overhead(build)], world=(3, 3, 3))
    settings = FrameSettings(4, 4, samples=1, transparent=True)
    pixels = render_frame(build.looking_down(1, -1), scene, settings).pixels
    assert (pixels[1:3, :2, 3] == 1).all()
    assert not pixels[:, 2:].any() and not pixels[[0, 3]].any()


def test_half_covered_pixels_are_premultiplied(build):
    scene = build.scene([build.square(1, centre=(-1, 0))], [overhead(build)])
    settings = FrameSettings(1, 1, samples=16, transparent=True)
    pixels = render_frame(build.looking_down(1, -1), scene, settings).pixels
    assert np.allclose(pixels, 0.5)


@pytest.mark.parametrize("transparent", [False, True])
@pytest.mark.parametrize("empty", [False, True])
def test_outside_the_polar_circle_is_transparent_black(build, transparent, empty):
    discs = tuple(Disc(matrix=build.placed((0, 0, z)), radius=1.0) for z in (1, -1))
    projection = Projection(ViewingVolume(discs), Polar(), aspect=2.0)
    scene = build.scene([build.square(0.5)], [overhead(build)], world=(0.5, 0.5, 0.5))
    if empty:
        scene = replace(scene, geometry=empty_geometry())
    pixels = render_frame(projection, scene, FrameSettings(64, 32, 1, transparent=transparent)).pixels
    x, y = np.meshgrid((np.arange(64) - 31.5) / 16, (np.arange(32) - 15.5) / 16)
    outside = np.hypot(x, y) > 1
    assert not pixels[outside].any()
    assert (pixels[~outside][:, 3] == (not transparent)).any()
    if not transparent:
        assert (pixels[~outside][:, 3] == 1).all()


def empty_geometry():
    return Geometry(
        np.zeros((0, 3)),
        np.zeros((0, 3), np.int32),
        np.zeros((0, 3, 3), np.float32),
        np.zeros(0, np.int32),
        np.zeros(0, np.int32),
    )


@pytest.mark.parametrize("transparent", [False, True])
def test_an_empty_scene_is_its_background(build, transparent):
    scene = Scene(empty_geometry(), build.materials(0), (overhead(build),), np.array([0.1, 0.2, 0.3]))
    done = render_frame(build.looking_down(1, -1), scene, FrameSettings(5, 3, transparent=transparent))
    expected = [0, 0, 0, 0] if transparent else [0.1, 0.2, 0.3, 1]
    assert np.allclose(done.pixels, expected)
    assert done.report.rays == done.report.hit_fraction == 0
    assert "5×3" in done.report.summary()


def busy(build):
    """A scene and a curved volume that use every part: soft shadows, highlights, samples."""
    parts = [build.square(3), build.sphere(12, (0.2, 0.1, 0.6), 0.5), build.square(0.3, 1.4, (-0.5, 0))]
    lights = [
        overhead(build),
        Light("AREA", np.array([30, 20, 10.0]), build.placed((1, 1, 3)), size=(1, 0.5)),
        Light("SPOT", np.array([10, 20, 30.0]), build.placed((-1, 1, 3), (1, -1, -3)), radius=0.1),
    ]
    scene = build.scene(parts, lights, base=(0.8, 0.6, 0.4), f0=0.04, roughness=0.3, world=(0.1, 0.1, 0.2))
    return build.looking_down(2, 1, -1, shifts=[0, 0.8, 0]), scene


def test_threads_do_not_change_a_bit(build):
    projection, scene = busy(build)
    one, two, again = (
        render_frame(projection, scene, FrameSettings(70, 50, samples=3, threads=n)).pixels for n in (1, 2, 2)
    )
    assert one.tobytes() == two.tobytes() == again.tobytes()
    assert len(np.unique(one.reshape(-1, 4), axis=0)) > 1000


def test_a_scene_cast_before_gives_the_same_image(build):
    projection, scene = busy(build)
    cast_scene = CastScene(scene.geometry.vertices, scene.geometry.triangles)
    settings = FrameSettings(40, 30, samples=1)
    fresh, kept = (render_frame(projection, scene, settings, c).pixels for c in (None, cast_scene))
    assert fresh.tobytes() == kept.tobytes()


@pytest.mark.parametrize("unit", [1e-4, 1e4])
def test_the_unit_of_length_does_not_matter(build, unit):
    """The same image from a scene of any size anywhere, if watts grow with its square."""
    projection, scene = busy(build)
    move = np.diag([unit, unit, unit, 1.0])
    move[:3, 3] = np.array([30, -20, 10]) * unit
    geometry = replace(scene.geometry, vertices=scene.geometry.vertices * unit + move[:3, 3])
    lights = tuple(
        replace(
            light,
            color=light.color * (1 if light.kind == "SUN" else unit**2),
            matrix=move @ light.matrix,
            radius=light.radius * unit,
        )
        for light in scene.lights
    )
    moved = replace(scene, geometry=geometry, lights=lights)
    settings = FrameSettings(60, 40, samples=2)
    here = render_frame(projection, scene, settings).pixels
    there = render_frame(projection.transformed(move), moved, settings).pixels
    different = np.abs(here - there).max(axis=2) > 1e-3 * here.max()
    assert different.mean() < 0.002


@pytest.mark.parametrize(
    "towards, shines", [((0.6, 0, 0.8), True), ((0.5, 0, 1), False), ((0.375, 0, 1), False)]
)
def test_highlights_follow_the_tangent_of_a_curved_projector(build, towards, shines):
    """Every projector is the parabola x = t², z = 1 - 2t, which meets the floor at t = ¾ along (1.5, 0, -2).

    A sun that this direction mirrors shows at full strength, one that the chord from
    near to far or from near to the floor mirrors does not.
    """
    towards = np.asarray(towards) / np.linalg.norm(towards)
    sun = Light("SUN", np.ones(3), build.placed(shines=-towards))
    scene = build.scene([build.square(5, -0.5)], [sun], metallic=1.0, roughness=0.2)
    projection = build.looking_down(1, 0, -1, shifts=[0, 0, 1])
    done = render_frame(projection, scene, FrameSettings(6, 4, samples=2))
    # GGX's density and Smith's masking where the half vector is the normal.
    squared, up = 0.04**2, towards[2]
    full = 1 / (np.pi * squared) / (4 * np.sqrt(squared + (1 - squared) * up**2))
    full /= single_scatter_albedo(np.array([up]), np.array([0.2]))[0]
    if shines:
        assert np.allclose(done.pixels[..., :3], full, rtol=3e-3)
    else:
        assert done.pixels[..., :3].max() < 0.1 * full
    assert not done.report.straight
    assert done.report.error_bound <= 0.1


def test_callbacks_come_from_the_calling_thread_and_cover_the_image(build, monkeypatch):
    projection, scene = busy(build)
    # Progress is told every so many seconds: a quick machine would be done before.
    monkeypatch.setattr(tiling, "POLL_SECONDS", 0)
    seen, shares, callers = np.full((50, 70, 4), np.nan, np.float32), [], set()

    def on_tile(rows, pixels, _passes):
        assert pixels.shape[1:] == (70, 4) and np.isnan(seen[rows]).all()
        seen[rows] = pixels
        callers.add(threading.get_ident())

    def progress(share):
        shares.append(share)
        callers.add(threading.get_ident())

    def cancelled():
        callers.add(threading.get_ident())
        return False

    done = render_frame(projection, scene, FrameSettings(70, 50, 1), None, progress, cancelled, on_tile)
    assert np.array_equal(seen, done.pixels)
    assert shares == sorted(shares) and shares[-1] == 1 and len(shares) > 5
    assert callers == {threading.get_ident()}


def test_progress_is_told_between_the_samples_of_a_tile(build, monkeypatch):
    projection, scene = busy(build)
    monkeypatch.setattr(tiling, "POLL_SECONDS", 0)
    shares, tiles = [], []
    render_frame(
        projection,
        scene,
        FrameSettings(64, 1, samples=64),
        progress=shares.append,
        on_tile=lambda *tile: tiles.append(shares[-1]),
    )
    assert len(tiles) == 1 and len(set(shares)) > 3 and tiles[0] > 0


def test_cancelling_drops_the_rest_and_leaves_no_thread(build, monkeypatch):
    """The two threads finish the samples that they are at, out of 128, and stop."""
    projection, scene = busy(build)
    before, finished, casts, casts_then = threading.active_count(), [], [], []

    def counting(*arguments):
        casts.append(1)
        return cast(*arguments)

    def cancelled():
        if finished:
            casts_then.append(len(casts))
        return bool(finished)

    monkeypatch.setattr(scene_view, "cast", counting)
    settings = FrameSettings(160, 160, samples=8, threads=2)
    result = render_frame(projection, scene, settings, None, finished.append, cancelled)
    assert result is None
    assert finished and max(finished) < 1
    assert len(casts) < casts_then[0] + 16
    assert threading.active_count() == before


def test_cancelling_at_once_renders_nothing(build, monkeypatch):
    projection, scene = busy(build)
    monkeypatch.setattr(tiling, "POLL_SECONDS", 0)
    assert render_frame(projection, scene, FrameSettings(64, 64), cancelled=lambda: True) is None


@pytest.mark.parametrize(("room", "where"), [(scene_view, "cast"), (lighting.Lighting, "radiance")])
def test_what_a_tile_raises_is_raised_after_the_threads_have_ended(build, monkeypatch, room, where):
    projection, scene = busy(build)
    before, calls = threading.active_count(), []
    proper = getattr(room, where)

    def fails(*arguments):
        calls.append(1)
        if len(calls) == 3:
            raise ZeroDivisionError("in a tile")
        return proper(*arguments)

    monkeypatch.setattr(room, where, fails)
    with pytest.raises(ZeroDivisionError, match="in a tile"):
        render_frame(projection, scene, FrameSettings(64, 64, samples=2))
    assert threading.active_count() == before
    assert len(calls) < 32


@pytest.mark.parametrize("wrong", [{"width": 0}, {"height": -1}, {"samples": 0}])
def test_settings_that_make_no_image_are_refused(wrong):
    with pytest.raises(ValueError, match=r"resolution|sample"):
        FrameSettings(**{"width": 4, "height": 4} | wrong)


def test_the_report_counts(build):
    scene = build.scene([build.square(0.5, centre=(0.5, 0.5))])
    report = render_frame(build.looking_down(1, -1), scene, FrameSettings(8, 4, samples=3)).report
    assert (report.projectors, report.chords, report.hit_fraction) == (96, 96, 0.25)
    assert report.straight and report.error_bound == 0 and not report.folded
    assert 0 <= report.build_seconds <= report.seconds


def test_summary_lines():
    straight = RenderReport(1920, 1080, 0.412, 0.1, True, 2073600, 2073600, 2073600, 0.7, 0.0, 0.0)
    assert straight.summary() == "1920×1080 in 0.41 s · 2.1 M rays · straight projectors"
    mirrored = RenderReport(1920, 1080, 0.412, 0.1, True, 2073600, 2073600, 2073600, 0.7, 0.0, 0.0, True)
    slow = replace(straight, shaded=2.0)
    assert slow.statistics() == straight.statistics() + " · Cycles is faster at these samples"
    assert mirrored.outcome() == "1920×1080 in 0.41 s · mirrored"
    assert mirrored.statistics() == straight.statistics() == "2.1 M rays · straight projectors"
    curved = RenderReport(100, 50, 61.234, 0.1, False, 5000, 61000, 36000, 0.7, 0.0987, 0.124)
    assert curved.summary() == (
        "100×50 in 61.23 s · 12% of the volume folds"
        " · 61.0 k rays · 7.2 chords a projector · error ≤ 0.099 px"
    )


def test_what_is_outside_the_volume_is_not_built_but_casts_shadows(build):
    """A shelf over the near surface, out of the volume's reach, and eight more far aside."""
    aside = [build.square(1, 0.5, (9.0 * k, 9.0)) for k in range(1, 9)]
    parts = [build.square(3), build.square(0.6, 2.0, (0.0, 0.0)), *aside]
    projection = build.looking_down(1, -1)
    settings = FrameSettings(20, 20, samples=1)
    images, reports = [], []
    for lights in ((overhead(build),), (replace(overhead(build), casts_shadow=False),)):
        scene = build.scene(parts, lights)
        whole = CastScene(scene.geometry.vertices, scene.geometry.triangles)
        all_built = render_frame(projection, scene, settings, whole)
        done = render_frame(projection, scene, settings)
        np.testing.assert_allclose(done.pixels, all_built.pixels, atol=1e-6)
        images.append(done.pixels[..., 0])
        reports.append(done.report)
    shadow, plain = images
    assert shadow[10, 10] < 0.1 * plain[10, 10] and shadow[1, 1] == pytest.approx(plain[1, 1])
    assert [(r.triangles, r.built) for r in reports] == [(20, 2)] * 2
    assert "2 of 20 triangles in reach" in reports[0].summary()


def test_what_is_out_of_reach_is_built_only_when_light_asks_for_it(build):
    scene = build.scene([build.square(3), build.square(0.6, 2.0, (0.0, 0.0))])
    whole = scene.geometry
    near = whole.part(np.array([True, True, False, False]))
    made = CastScene(near.vertices, near.triangles, lambda: (whole.vertices, whole.triangles[2:]))
    up, origin = np.array([[0.0], [0], [1]]), np.zeros((3, 2))
    origin[:, 1] = made.matrix[:3, :3] @ np.array([1.2, 1.2, 0.0])
    origin += 1e-3 * up
    assert made._beyond._make is not None
    hidden = made.occluded(origin, np.repeat(up, 2, axis=1), np.full(2, np.inf))
    assert hidden.tolist() == [True, False] and made._beyond._make is None


def test_an_exact_frame_says_so(build):
    scene = build.scene([build.square(3)])
    projection = build.looking_down(1, 0.5, -1, shifts=[0, 0.3, 0])
    report = render_frame(projection, scene, FrameSettings(12, 12, samples=1, pixel_error=0.0)).report
    assert report.exact and report.tests >= 144 and report.peak_memory > 0
    assert f"exact, {report.tests} tests" in report.summary() and "memory up to" in report.summary()
    assert "error" not in report.summary()
    weighted = replace(projection, volume=ViewingVolume(projection.volume.surfaces, "NURBS", (1, 2, 1)))
    assert render_frame(weighted, scene, FrameSettings(4, 4, samples=1, pixel_error=0.0)).report.exact
