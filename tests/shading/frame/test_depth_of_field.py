# SPDX-License-Identifier: GPL-3.0-or-later
"""Depth of field and motion blur in the pure pipeline."""

from dataclasses import replace

import numpy as np
import pytest

from scfpf_addon.casting.scene import cast_scene
from scfpf_addon.projection.editing.interpolation import interpolated_projection
from scfpf_addon.projection.surfaces.surface import Cylinder, Plane
from scfpf_addon.projection.volume.viewing_volume import Projection, ViewingVolume
from scfpf_addon.shading.frame import render_frame
from scfpf_addon.shading.sampling.adaptive import Adaptive
from scfpf_addon.shading.scene.depth_of_field import Aperture, lens_of
from scfpf_addon.shading.scene.motion import Moment, moment_of_samples, shutter_times
from scfpf_addon.shading.settings.frame_settings import FrameSettings

AXES = np.diag([1.0, 1.0, -1.0])


def frustum(move=(0.0, 0.0, 0.0), bend=0.0):
    """A perspective from the origin along -Z, half as wide as deep, from 1 to 10."""
    matrices = []
    for depth in (1.0, 10.0):
        matrix = np.eye(4)
        matrix[:3, 3] = np.add(move, (bend * (depth > 1), 0, -depth))
        matrices.append(matrix)
    near, far = (Plane(matrix=m, width=d, height=d) for m, d in zip(matrices, (1.0, 10.0), strict=True))
    return Projection(ViewingVolume((near, far)))


def test_a_lens_is_where_projectors_meet():
    lens = lens_of(frustum((1.0, 2.0, 3.0)), Aperture(0.1, 4.0), AXES)
    assert np.allclose(lens.centre, (1, 2, 3), atol=1e-9) and lens.flat


@pytest.mark.parametrize("width", [1.0, 3.0])
def test_there_is_none_where_they_do_not(width):
    near, far = frustum().volume.surfaces
    parallel = ViewingVolume((near, Plane(matrix=far.matrix, width=1.0, height=1.0)))
    skew = ViewingVolume((near, Plane(matrix=far.matrix, width=10.0, height=width)))
    bent = ViewingVolume((near, near, far))
    for volume in (parallel, skew, bent):
        assert lens_of(Projection(volume), Aperture(0.1, 4.0), AXES) is None


def test_a_panorama_is_sharp_on_a_ball():
    cylinders = tuple(Cylinder(radius=r, arc=2.0, height=r) for r in (1.0, 9.0))
    lens = lens_of(Projection(ViewingVolume(cylinders)), Aperture(0.1, 4.0), AXES)
    assert np.allclose(lens.centre, 0, atol=1e-9) and not lens.flat
    way = np.array([[0.6], [0.0], [-0.8]])
    ends = np.stack([way, 9 * way])
    moved = lens.moved(ends, np.array([[0.3], [0.9]]))
    # The point at distance 4 stays, the one at 0 goes to the lens' place across the projector.
    at = [moved[0] + (moved[1] - moved[0]) * (r - 1) / 8 for r in (0.0, 4.0)]
    assert np.allclose(at[1], 4 * way, atol=1e-12)
    assert np.linalg.norm(at[0]) == pytest.approx(0.1 * np.sqrt(0.9)) and abs((at[0] * way).sum()) < 1e-12


@pytest.mark.parametrize("blades", [0, 3, 5, 6])
def test_apertures_are_filled_evenly(blades):
    grid = (np.arange(210) + 0.5) / 210
    x, y = Aperture(2.0, 1.0, blades).places(np.stack(np.meshgrid(grid, grid)).reshape(2, -1))
    area = np.pi if blades == 0 else blades / 2 * np.sin(2 * np.pi / blades)
    inside = np.hypot(x, y) < 2 * 0.4
    assert inside.mean() == pytest.approx(np.pi * 0.4**2 / area, rel=0.03)
    assert np.hypot(x, y).max() <= 2.0 and abs(x.mean()) < 0.02 and abs(y.mean()) < 0.02


def test_a_points_disc_of_confusion_is_as_large_as_the_thin_lens_equation_has_it(build):
    """An edge at depth 8 through a lens of radius 0.2 that is sharp at 4: the blur at 8 is 2 × 0.2 wide."""
    scene = build.scene(
        [(np.array([[-9, -9, -8], [0, -9, -8], [0, 9, -8], [-9, 9, -8.0]]), [[0, 1, 2], [0, 2, 3]], None)],
        emission=(1, 1, 1),
    )
    lens = lens_of(frustum(), Aperture(0.2, 4.0), AXES)
    settings = FrameSettings(160, 8, samples=256, depth_of_field=lens)
    row = render_frame(frustum(), scene, settings).pixels[4, :, 0]
    # The frame is 8 wide at depth 8, the middle of the edge in its middle; the lens' shadow is a disc.
    x = ((np.arange(160) + 0.5) / 160 - 0.5) * 8 / 0.2
    inside = np.clip(x, -1, 1)
    expected = (np.arccos(inside) - inside * np.sqrt(1 - inside**2)) / np.pi
    assert np.abs(row - expected).max() < 0.03
    assert (row[np.abs(x) > 1.1] == (x[np.abs(x) > 1.1] < 0)).all()


def test_what_the_blurred_lens_alone_sees_is_there(build):
    """A thing beside the frame at twice the focus: none without a lens, its edge's half disc with one."""
    # The frame is 8 wide at depth 8, so that it ends at 4.
    wall = np.array([[4.02, -9, -8], [9, -9, -8], [9, 9, -8], [4.02, 9, -8.0]]), [[0, 1, 2], [0, 2, 3]], None
    scene = build.scene([wall], emission=(1, 1, 1))
    sharp = FrameSettings(160, 2, samples=256)
    assert not render_frame(frustum(), scene, sharp).pixels[..., :3].any()
    settings = replace(sharp, depth_of_field=lens_of(frustum(), Aperture(0.2, 4.0), AXES))
    row = render_frame(frustum(), scene, settings).pixels[1, :, 0]
    x = np.clip((4.02 - ((np.arange(160) + 0.5) / 160 - 0.5) * 8) / 0.2, -1, 1)
    expected = (np.arccos(x) - x * np.sqrt(1 - x**2)) / np.pi
    assert expected[-1] > 0.3 and np.abs(row - expected).max() < 0.03


def test_a_moving_volume_blurs_what_stands_still(build):
    """A volume that moves by 1 at depth 8 smears an edge evenly over that width."""
    scene = build.scene(
        [(np.array([[-9, -9, -8], [0, -9, -8], [0, 9, -8], [-9, 9, -8.0]]), [[0, 1, 2], [0, 2, 3]], None)],
        emission=(1, 1, 1),
    )
    still = frustum()
    before, after = frustum((-0.5, 0, 0)), frustum((0.5, 0, 0))
    moments = tuple(
        Moment(interpolated_projection(before, after, float(share)), scene)
        for share in shutter_times(32, 0.0, 1.0)
    )
    frame = render_frame(still, scene, FrameSettings(80, 4, samples=32), moments=moments)
    x = ((np.arange(80) + 0.5) / 80 - 0.5) * 8
    assert np.abs(frame.pixels[2, :, 0] - np.clip(0.5 - x, 0, 1)).max() < 0.06


def test_a_moving_object_is_at_each_moment_where_it_then_is(build):
    scenes = [
        build.scene([build.square(0.25, centre=(c, 0.0))], emission=(1, 1, 1)) for c in (-0.5, 0.0, 0.5)
    ]
    view = build.looking_down(1, -1)
    moments = tuple(Moment(view, scene) for scene in scenes)
    pixels = render_frame(view, scenes[1], FrameSettings(16, 16, samples=12), moments=moments).pixels
    row = pixels[8, :, 0]
    assert np.allclose(row[[3, 7, 11]], 1 / 3, atol=1e-6) and not row[[0, 15]].any()


@pytest.mark.parametrize("adaptive", [None, Adaptive(1e3, 2)])
def test_only_the_shutter_times_that_samples_see_are_made_ready(build, monkeypatch, adaptive):
    """Prisms of exact casting are built at the first use: none for the frame itself, and none twice."""
    scenes = [build.scene([build.square(0.25, centre=(c / 9, 0.0))]) for c in range(5)]
    view = build.looking_down(1, 0, -1, shifts=[0, 0.2, 0])
    made, built = cast_scene._prisms_of, []
    monkeypatch.setattr(cast_scene, "_prisms_of", lambda *of: built.append(of[0]) or made(*of))
    settings = FrameSettings(6, 4, samples=8, pixel_error=0.0, adaptive=adaptive)
    moments = tuple(Moment(view, scene) for scene in scenes[1:])
    render_frame(view, scenes[0], settings, moments=moments)
    seen = set(moment_of_samples(8, 4)[: adaptive.least if adaptive else 8])
    assert len(built) == len(set(map(id, built))) == len(seen) == (2 if adaptive else 4)
    # Where only the camera moves there is one scene.
    built.clear()
    moving = tuple(Moment(view.transformed(build.placed((c / 9, 0, 0))), scenes[0]) for c in range(4))
    render_frame(view, scenes[0], settings, moments=moving)
    assert len(built) == 1


def test_surfaces_half_way():
    half = interpolated_projection(frustum(), frustum((2.0, 0.0, 4.0)), 0.25)
    u, v = np.array([0.1, 0.7]), np.array([0.2, 0.9])
    middle = frustum((0.5, 0.0, 1.0))
    for one, other in zip(half.volume.surfaces, middle.volume.surfaces, strict=True):
        for a, b in zip(one.evaluate(u, v), other.evaluate(u, v), strict=True):
            assert np.allclose(a, b, atol=1e-12)
        assert np.allclose(one.positions(u, v).position, other.positions(u, v).position)
    turned = half.transformed(np.diag([2.0, 2.0, 2.0, 1.0]))
    assert np.allclose(
        turned.volume.surfaces[1].positions(u, v).position, 2 * half.volume.surfaces[1].positions(u, v)[0]
    )


@pytest.mark.parametrize(("samples", "moments"), [(4, 4), (64, 8), (10, 4), (256, 256)])
def test_moments_get_their_shares(samples, moments):
    which = np.array(moment_of_samples(samples, moments))
    counts = np.bincount(which, minlength=moments)
    assert np.ptp(counts) <= 1
    if samples >= 8:
        # The first half of the samples is spread over time too.
        assert abs(which[: samples // 2].mean() / (moments - 1) - 0.5) < 0.15


def test_a_shutters_curve_is_followed():
    even = shutter_times(4, 10.0, 12.0)
    assert np.allclose(even, [10.25, 10.75, 11.25, 11.75])
    rising = shutter_times(1000, 0.0, 1.0, np.array([0.0, 1.0]))
    assert np.allclose(rising, np.sqrt((np.arange(1000) + 0.5) / 1000), atol=1e-3)
    assert np.allclose(shutter_times(4, 0.0, 1.0, np.zeros(3)), shutter_times(4, 0.0, 1.0))
