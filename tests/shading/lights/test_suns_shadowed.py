# SPDX-License-Identifier: GPL-3.0-or-later
"""The short way to straight pictures under suns with shadows makes the same picture as the general one."""

from dataclasses import replace

import numpy as np
import pytest

from scfpf_addon.projection.surfaces.surface import Plane, Point
from scfpf_addon.projection.volume.viewing_volume import Projection, ViewingVolume
from scfpf_addon.shading.fast_paths.suns_shadowed import SunsShadowed
from scfpf_addon.shading.frame import render_frame
from scfpf_addon.shading.pipeline import Pipeline
from scfpf_addon.shading.scene.shading_scene import Light
from scfpf_addon.shading.settings.frame_settings import Border, FrameSettings

# Pixels that may see another triangle, or another side of a shadow's edge: rays differ in the last bit.
AT_EDGES = 0.005


def volumes(build):
    """Volumes that end in the scene, and far behind and before it."""
    square = Plane(2.2, 1.8, matrix=build.placed((0, 0, 1.6))), Plane(2, 2.4, matrix=build.placed((0, 0, -2)))
    far = Point(matrix=build.placed((0.2, 0, 3))), Plane(45, 35, matrix=build.placed((0, 1, -50)))
    long = Plane(40, 40, matrix=build.placed((0, 0, 90))), Plane(2, 2, matrix=build.placed((0, 0, -2)))
    return {
        name: Projection(ViewingVolume(pair), aspect=4 / 3)
        for name, pair in {"near": square, "far": far, "long": long}.items()
    }


def scene_of(build, smooth, angle):
    ball = build.sphere(12, (0.1, 0.2, 0.1), 0.5)
    points, faces, _ = ball
    a, b, c = points[faces].transpose(1, 0, 2)
    flat = points, faces[np.linalg.norm(np.cross(b - a, c - a), axis=1) > 1e-9], None
    suns = [
        Light("SUN", np.full(3, 2.0), build.placed(shines=(0.6, 0.2, -1)), angle=angle),
        Light("SUN", np.array([1.0, 0.5, 0.2]), build.placed(shines=(-0.9, 0.4, -0.7)), casts_shadow=False),
    ]
    parts = [build.square(1.4, -0.7), ball if smooth else flat, build.square(0.3, 0.9, (0.5, 0.3))]
    return build.scene(parts, suns, (0.1, 0.2, 0.3), f0=0.04)


@pytest.mark.parametrize("smooth", [False, True], ids=["flat", "smooth"])
@pytest.mark.parametrize(("name", "angle"), [("near", 0.0), ("far", 0.2), ("long", 0.0)])
def test_both_ways_make_the_same_picture(build, monkeypatch, name, angle, smooth):
    projection, scene = volumes(build)[name], scene_of(build, smooth, angle)
    wanted = FrameSettings(60, 45, samples=2, border=Border(3, 2, 57, 45))
    assert isinstance(Pipeline.of(projection, scene, wanted, None).suns_alone, SunsShadowed)
    short = render_frame(projection, scene, wanted)
    monkeypatch.setattr(Pipeline, "suns_alone", None)
    general = render_frame(projection, scene, wanted)
    off = np.abs(short.pixels - general.pixels).max(axis=2)
    assert (off > 1e-4).mean() <= AT_EDGES * wanted.samples
    mine, its = short.report, general.report
    assert (mine.projectors, mine.chords) == (its.projectors, its.chords)
    assert mine.hit_fraction == pytest.approx(its.hit_fraction, abs=AT_EDGES)
    # There are shadows.
    open_air = replace(scene, lights=tuple(replace(each, casts_shadow=False) for each in scene.lights))
    assert np.abs(render_frame(projection, open_air, wanted).pixels - general.pixels).max() > 0.1


@pytest.mark.parametrize("change", ["a point", "scrambled", "exact"])
def test_others_take_the_general_way(build, change):
    scene, wanted = scene_of(build, False, 0.0), FrameSettings(8, 6)
    if change == "a point":
        scene = replace(scene, lights=(*scene.lights, Light("POINT", np.ones(3), build.placed((0, 0, 3)))))
    else:
        wanted = replace(wanted, **{"scrambled": {"scrambled": True}, "exact": {"pixel_error": 0.0}}[change])
    assert Pipeline.of(volumes(build)["near"], scene, wanted, None).suns_alone is None
