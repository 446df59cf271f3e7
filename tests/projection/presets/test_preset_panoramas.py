# SPDX-License-Identifier: GPL-3.0-or-later
"""Panoramas and lenses among the presets against closed forms."""

import itertools
from pathlib import Path

import numpy as np
import pytest

from scfpf_addon.projection.presets.preset import read_preset
from scfpf_addon.projection.volume.viewing_volume import determinant

FOLDER = Path(__file__).resolve().parents[3] / "presets"
# Where a street has façades, and how far its side streets are from its middle.
FACADES, SIDE_STREETS = -10.0, (-24.0, 24.0)


def preset(name):
    return read_preset(FOLDER / f"{name}.json")


def seen(name, count=500, low=0.0):
    """Image positions from -1 to 1, t from ``low`` and the points (3, N) that they show."""
    shown = preset(name)
    x, y, t = np.random.default_rng(5).random((3, count))
    t = low + (1 - low) * t
    return 2 * x - 1, 2 * y - 1, t, shown.projection(shown.aspect).volume.evaluate(x, y, t).position


def test_equirectangular_is_azimuth_and_elevation():
    x, y, t, (px, py, pz) = seen("equirectangular")
    assert np.allclose(np.arctan2(px, -pz), np.pi * x, rtol=0, atol=1e-11)
    assert np.allclose(np.arctan2(py, np.hypot(px, pz)), np.pi / 2 * y, rtol=0, atol=1e-11)
    assert np.allclose(np.linalg.norm([px, py, pz], axis=0), 0.1 + 99.9 * t, rtol=1e-12)


def test_strip_camera_is_a_pinhole_for_every_column():
    """A camera on the circle of 10 round the subject, turned to its middle: what its middle column shows."""
    x, y, _, position = seen("strip_camera")
    angle = np.pi * x
    zero = np.zeros_like(x)
    outwards = np.array([np.sin(angle), zero, np.cos(angle)])
    aside = np.array([np.cos(angle), zero, -np.sin(angle)])
    from_camera = position - (np.array([0.0, 0.0, -10.0])[:, None] + 10 * outwards)
    depth = -(from_camera * outwards).sum(axis=0)
    assert (depth > 0.9).all() and (depth < 9.81).all()
    assert np.abs((from_camera * aside).sum(axis=0)).max() < 1e-12
    assert np.allclose(from_camera[1] / depth, 0.25 * y, rtol=0, atol=1e-12)


def test_strip_camera_sees_all_sides_of_its_subject():
    """First hits on the subject's box: front, side, back, side, each of them whole."""
    shown = preset("strip_camera")
    size = np.array(shown.subject.size) / 2
    x, t = np.linspace(0.002, 0.998, 499), np.linspace(0, 1, 801)
    u, depth = (a.ravel() for a in np.meshgrid(x, t, indexing="ij"))
    path = shown.volume().evaluate(u, np.full_like(u, 0.5), depth).position
    path = path.reshape(3, len(x), len(t)) - np.array(shown.subject.centre)[:, None, None]
    first = (np.abs(path) <= size[:, None, None]).all(axis=0).argmax(axis=1)
    hit = path[:, np.arange(len(x)), first]
    assert (first > 0).all()
    faces = {"front": hit[2] > 1.38, "right": hit[0] > 1.38, "left": hit[0] < -1.38, "back": hit[2] < -1.38}
    for name, face in faces.items():
        assert face.sum() > len(x) / 5, name
    assert faces["front"][len(x) // 2] and faces["back"][[0, -1]].all()
    assert faces["left"][len(x) // 4] and faces["right"][3 * len(x) // 4]


@pytest.mark.parametrize("name", ["street_panorama", "street_panorama_curved"])
def test_streets_are_level_and_as_high_as_designed(name):
    """Heights 8, 24, 40 at depths 0, 30, 60: a pinhole's, 15 behind the street, as far as y goes."""
    _, y, t, (_, py, pz) = seen(name)
    assert np.allclose(pz, -60 * t, rtol=0, atol=1e-9)
    bottom, top = -2 - 8 * t, 6 + 24 * t
    assert np.allclose(py, bottom + (y + 1) / 2 * (top - bottom), rtol=0, atol=1e-9)


def test_straight_street_keeps_every_front_s_width():
    x, _, _, (px, _, _) = seen("street_panorama")
    assert np.allclose(px, 60 * x, rtol=0, atol=1e-11)


def slope_of_far_surface(name, u):
    return preset(name).volume().evaluate(u, np.full_like(u, 0.5), np.ones_like(u)).du[0] / 120


def test_curved_street_looks_down_its_side_streets():
    """Figure 11: x of the far surface runs three times as fast in A and B, half as fast elsewhere."""
    u = np.linspace(0, 1, 2001)
    slope = slope_of_far_surface("street_panorama_curved", u)
    inside = (np.abs(u - 0.3) < 0.015) | (np.abs(u - 0.7) < 0.015)
    outside = (u < 0.2) | (u > 0.8) | (np.abs(u - 0.5) < 0.1)
    assert np.allclose(slope[inside], 3, rtol=0, atol=0.05)
    assert np.allclose(slope[outside], 0.5, rtol=0, atol=0.05)
    assert slope.min() > 0.45 and slope.max() < 3.05
    assert np.allclose(slope_of_far_surface("street_panorama", u), 1, rtol=0, atol=1e-12)


@pytest.mark.parametrize("centre", SIDE_STREETS)
def test_a_side_street_s_walls_are_seen_only_with_curved_projectors(centre):
    """Walls run from the façades into depth, 6 to either side: whether projectors go through them."""
    for name, reached in (("street_panorama", False), ("street_panorama_curved", True)):
        volume = preset(name).volume()
        u = np.linspace(0, 1, 4001)
        depth = [np.full_like(u, t) for t in (1 / 6, 1.0)]
        start, end = (volume.evaluate(u, np.full_like(u, 0.5), t).position[0] - centre for t in depth)
        into_right = (start < 6) & (start > 0) & (end > 6.01)
        into_left = (start > -6) & (start < 0) & (end < -6.01)
        assert into_right.any() == into_left.any() == reached


def test_barrel_lens_is_brown_s_distortion_from_a_bulging_glass():
    """At the far surface p (1 + 0.3 |p|²); on the glass p itself, which falls back by 0.2 |p|²."""
    x, y, t, position = seen("barrel_lens")
    a = 9 / 16 * y
    squared = x * x + a * a
    glass = np.array([0.4 * x, 0.4 * a, -0.5 + 0.2 * squared])
    far = np.array([90 * x * (1 + 0.3 * squared), 90 * a * (1 + 0.3 * squared), np.full_like(x, -100)])
    assert np.allclose(position, (1 - t) * glass + t * far, rtol=0, atol=1e-4)


def test_barrel_lens_bows_lines_outwards():
    """A straight line of the far plane appears nearer to the border in its middle than at its ends."""
    volume = preset("barrel_lens").volume()
    u, v = (a.ravel() for a in np.meshgrid(np.linspace(0.5, 1, 401), np.array([0.05, 0.5])))
    far = volume.evaluate(u, v, np.ones_like(u)).position[0].reshape(2, -1)
    end, middle = (np.interp(90.0, row, u[:401]) for row in far)
    assert middle - end > 0.015


def test_magic_lens_magnifies_by_the_depth_that_is_left():
    """Rays run to one spot: what is shown shrinks by 1 - t, so the image grows by 1 / (1 - t)."""
    volume = preset("magic_lens").volume()
    u, v = (a.ravel() for a in np.meshgrid(*(np.linspace(-0.25, 0.25, 9) / side + 0.5 for side in (16, 9))))
    for t in (0.0, 0.25, 0.5, 0.75):
        sample = volume.evaluate(u, v, np.full_like(u, t))
        assert np.allclose(sample.position[0], 16 * (u - 0.5) * (1 - t), rtol=0, atol=1e-9)
        assert np.allclose(sample.position[1], 9 * (v - 0.5) * (1 - t), rtol=0, atol=1e-9)


def test_magic_lens_leaves_what_is_around_it_parallel():
    volume = preset("magic_lens").volume()
    u, v = (a.ravel() for a in np.meshgrid(np.linspace(0, 1, 101), np.linspace(0, 1, 101)))
    x, y = 16 * (u - 0.5), 9 * (v - 0.5)
    end = volume.evaluate(u, v, np.ones_like(u)).position
    aside = np.hypot(end[0] - x, end[1] - y)
    r = np.hypot(x, y)
    assert aside[r > 4.8].max() < 1e-3 and aside[r < 3].min(initial=9, where=r[r < 3] > 1) > 0.1
    # Between the spot and the parallel projectors they never cross.
    t = np.full_like(u, 0.999)
    assert (determinant(volume.evaluate(u, v, t)) < 0).all()


def test_stereographic_is_twice_the_tangent_of_half_the_angle():
    """180 degrees across the image's width; straight projectors from one point."""
    x, y, _, (px, py, pz) = seen("stereographic", low=0.01)
    across, up = 2 * x, 2 * 9 / 16 * y
    angle = np.arctan2(np.hypot(px, py), -pz)
    assert np.allclose(2 * np.tan(angle / 2), np.hypot(across, up), rtol=0, atol=1e-5)
    turn = np.exp(1j * np.arctan2(py, px)) - np.exp(1j * np.arctan2(up, across))
    assert np.abs(turn).max() < 1e-5


def test_stereographic_keeps_shapes():
    """A small step along x and one along y see directions at right angles, equally far apart."""
    volume = preset("stereographic").volume()
    u, v = np.random.default_rng(2).random((2, 200))

    def direction(u, v):
        position = volume.evaluate(u, v, np.ones_like(u)).position
        return position / np.linalg.norm(position, axis=0)

    step = 1e-5
    across = (direction(u + step, v) - direction(u - step, v)) / step
    up = (direction(u, v + step) - direction(u, v - step)) / step * 16 / 9
    assert np.allclose((across * up).sum(axis=0), 0, rtol=0, atol=1e-4)
    assert np.allclose(np.linalg.norm(across, axis=0), np.linalg.norm(up, axis=0), rtol=1e-4)


def b_spline_functions(order, count, parameter):
    """Cox and de Boor's recurrence over clamped uniform knots, (count, N)."""
    inner = np.arange(1, count - order + 1)
    knots = np.concatenate([np.zeros(order), inner, np.full(order, count - order + 1)])
    place = np.clip(parameter * knots[-1], 0, knots[-1] - 1e-12)
    values = [np.where((low <= place) & (place < high), 1.0, 0.0) for low, high in itertools.pairwise(knots)]
    for width in range(1, order):
        rising = [np.zeros_like(place) for _ in range(len(values) - 1)]
        for i in range(len(rising)):
            for at, length, sign in (
                (i, knots[i + width] - knots[i], 1),
                (i + 1, knots[i + width + 1] - knots[i + 1], -1),
            ):
                if length > 0:
                    start = knots[i] if sign > 0 else knots[i + width + 1]
                    rising[i] = rising[i] + values[at] * sign * (place - start) / length
        values = rising
    return np.array(values)


def test_digital_cubism_sends_rays_between_two_nurbs_surfaces():
    shown = preset("digital_cubism")
    u, v, t = np.random.default_rng(8).random((3, 300))
    across, up = b_spline_functions(3, 3, u), b_spline_functions(3, 9, v)
    near, far = (np.einsum("rn,cn,rck->kn", up, across, surface.points) for surface in shown.surfaces)
    position = shown.volume().evaluate(u, v, t).position
    assert np.allclose(position, (1 - t) * near + t * far, rtol=0, atol=1e-9)


@pytest.mark.parametrize(("v", "angle"), [(0.0, -35), (0.5, 40), (1.0, -10)])
def test_digital_cubism_looks_from_three_sides(v, angle):
    """Each part is a plan seen from a place of its own, degrees around the subject."""
    u = np.linspace(0, 1, 9)
    along = preset("digital_cubism").volume().evaluate(u, np.full_like(u, v), np.full_like(u, 0.5)).dt
    assert np.allclose(np.degrees(np.arctan2(-along[0], -along[2])), angle, rtol=0, atol=1e-3)
    assert np.abs(along[1]).max() < 1e-9
