# SPDX-License-Identifier: GPL-3.0-or-later
"""Presets that are made by image mappings, against their own definitions."""

from pathlib import Path

import numpy as np
import pytest

from scfpf_addon.projection.presets.preset import load_preset, preset_to_json, read_preset

FOLDER = Path(__file__).resolve().parents[3] / "presets"
ASPECTS = (0.7, 1.0, 1.8)


def seen(name, aspect, count=4000):
    """Places in halves of the shorter side about the centre, and directions of what is seen there."""
    projection = read_preset(FOLDER / f"{name}.json").projection(aspect)
    x, y = np.random.default_rng(7).uniform(size=(2, count))
    image = projection.parameters(x, y)
    across, up = (x - 0.5) * 2 * max(aspect, 1), (y - 0.5) * 2 * max(1 / aspect, 1)
    radius = np.hypot(across, up)
    away = np.abs(radius - 1) > 1e-9
    np.testing.assert_array_equal(image.mask[away], radius[away] <= 1)
    x, y, across, up = (values[image.mask] for values in (x, y, across, up))
    position = projection.volume.evaluate(image.u[image.mask], image.v[image.mask], np.array([1.0])).position
    return across, up, position / np.linalg.norm(position, axis=0)


def same_heading(across, up, direction):
    """Return whether directions turn about the axis as their places do about the centre."""
    heading, turn = np.arctan2(direction[1], direction[0]), np.arctan2(up, across)
    return np.allclose(np.exp(1j * heading), np.exp(1j * turn), rtol=0, atol=1e-8)


@pytest.mark.parametrize("aspect", ASPECTS)
def test_the_equisolid_fisheye_keeps_areas(aspect):
    across, up, direction = seen("equisolid_fisheye", aspect)
    theta = np.arctan2(np.hypot(*direction[:2]), -direction[2])
    # Between the curve's 33 points: a two-hundredth of a pixel of a thousand.
    np.testing.assert_allclose(np.hypot(across, up), np.sin(theta / 2) / np.sin(np.pi / 4), atol=1e-5)
    assert same_heading(across, up, direction)
    # Of random places the share within an angle is the share of the half sphere there, 1 - cos.
    assert np.mean(theta < 1.0) == pytest.approx(1 - np.cos(1.0), abs=0.03)


@pytest.mark.parametrize("aspect", ASPECTS)
def test_the_lens_like_fisheye_is_its_polynomial(aspect):
    across, up, direction = seen("polynomial_fisheye", aspect)
    theta, r = np.arctan2(np.hypot(*direction[:2]), -direction[2]), np.hypot(across, up)
    np.testing.assert_allclose(theta, np.pi / 2 * (2 / 3 * r + r**3 / 3), atol=1e-12)
    assert same_heading(across, up, direction)


@pytest.mark.parametrize("aspect", ASPECTS)
def test_the_mirror_ball_reflects_parallel_rays(aspect):
    across, up, direction = seen("mirror_ball", aspect)
    # The ray along -Z meets the unit ball at the place itself.
    normal = np.stack([across, up, np.sqrt(1 - across**2 - up**2)])
    ray = np.array([0.0, 0.0, -1.0])[:, None]
    reflected = ray - 2 * (normal * ray).sum(axis=0) * normal
    # What is behind the ball's photographer is put ahead, as Cycles' camera has it.
    reflected[2] *= -1
    off = np.linalg.norm(direction - reflected, axis=0)
    # At the rim the curve is as steep as no curve through points can be.
    assert off[np.hypot(across, up) < 0.99].max() < 1e-4 and off.max() < 2e-2


@pytest.mark.parametrize("aspect", ASPECTS)
def test_the_sample_rate_lens_has_the_samples_that_it_says(aspect):
    """Against perspective: dr'/dr = 1 - 0.6 (1 - q)² + 2.4 q (1 - q) with q = (r / 0.9)², 1 beyond."""
    plain = read_preset(FOLDER / "perspective.json").projection(aspect)
    lens = read_preset(FOLDER / "sample_rate_lens.json").projection(aspect)
    r = np.linspace(0.001, 1.2, 600)
    unit = 2 * max(aspect, 1.0)
    x = 0.5 + r / unit
    shown = x <= 1.0
    image = lens.parameters(x[shown], np.full(shown.sum(), 0.5))
    q = np.minimum(r[shown] / 0.9, 1.0) ** 2
    rate = 1 - 0.6 * (1 - q) ** 2 + 2.4 * q * (1 - q)
    # At 0.9 its slope has a corner, which the curve rounds off.
    corner = np.abs(r[shown] - 0.9) < 0.03
    np.testing.assert_allclose(image.jacobian[0, 0][~corner], rate[~corner], atol=0.01)
    np.testing.assert_allclose(image.jacobian[0, 0], rate, atol=0.05)
    np.testing.assert_allclose((image.u - 0.5) * unit, r[shown] * (1 - 0.6 * (1 - q) ** 2), atol=3e-4)
    np.testing.assert_array_equal(plain.volume.surfaces[1].matrix, lens.volume.surfaces[1].matrix)
    assert 1 / image.jacobian[0, 0, 0] == pytest.approx(2.5, rel=0.02)


@pytest.mark.parametrize(
    "name", ["equisolid_fisheye", "mirror_ball", "polynomial_fisheye", "sample_rate_lens"]
)
def test_files_keep_the_mappings(name):
    before = read_preset(FOLDER / f"{name}.json")
    after = load_preset(preset_to_json(before))
    assert before.mappings
    for old, new in zip(before.mappings, after.mappings, strict=True):
        assert (old.name, old.kind, old.parameters) == (new.name, new.kind, new.parameters)
        assert old.points is None or np.array_equal(old.points, new.points)
