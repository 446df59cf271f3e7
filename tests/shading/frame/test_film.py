# SPDX-License-Identifier: GPL-3.0-or-later
"""The sample sets are even, the film averages."""

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from scfpf_addon.shading.sampling.films import Film
from scfpf_addon.shading.sampling.sample_sets import lamp_positions, pixel_positions

SHAPES = ("SQUARE", "DISC", "BALL")


def test_one_sample_is_the_centre():
    assert pixel_positions(1).tolist() == [[0.5], [0.5]]
    for shape in SHAPES:
        assert not lamp_positions(1, shape).any()


@given(st.integers(1, 600))
def test_pixel_positions_are_stratified(count):
    positions = pixel_positions(count)
    assert positions.shape == (2, count)
    assert (positions >= 0).all() and (positions < 1).all()
    assert np.allclose(positions.mean(axis=1), 0.5, atol=1e-12)
    for axis in positions:
        assert sorted((axis * count).astype(int)) == list(range(count))


@pytest.mark.parametrize("count", [4, 5, 8, 13, 16, 34, 64])
def test_pixel_positions_keep_apart(count):
    """On the torus no two are nearer than 0.6 times the side of the cell that each has."""
    x, y = pixel_positions(count)
    apart = np.stack([x[:, None] - x, y[:, None] - y])
    apart -= np.round(apart)
    distance = np.hypot(*apart)[~np.eye(count, dtype=bool)]
    assert distance.min() > 0.6 / np.sqrt(count)


@given(st.integers(1, 300), st.sampled_from(SHAPES))
def test_lamp_positions_are_centred(count, shape):
    places = lamp_positions(count, shape)
    assert places.shape == (3 if shape == "BALL" else 2, count)
    assert np.allclose(places.mean(axis=1), 0, atol=1e-12)
    assert len(np.unique(places.round(12), axis=1).T) == count


def test_disc_is_filled_evenly():
    radius = np.sort(np.hypot(*lamp_positions(4096, "DISC")))
    assert np.allclose(radius, 0.5 * np.sqrt((np.arange(4096) + 0.5) / 4096), atol=2e-3)


def test_ball_looks_like_an_even_disc_from_any_side():
    places = lamp_positions(8192, "BALL")
    assert np.linalg.norm(places, axis=0).max() < 1.01
    for towards in np.random.default_rng(1).normal(size=(20, 3)):
        towards /= np.linalg.norm(towards)
        across = places - towards[:, None] * (towards @ places)
        seen = np.sort(np.linalg.norm(across, axis=0))
        assert np.abs(seen**2 - (np.arange(8192) + 0.5) / 8192).max() < 0.02


def test_lamp_and_pixel_positions_are_not_in_step():
    """Every quarter of the pixel sees every quarter of the lamp."""
    pixel = (pixel_positions(64) * 2).astype(int)
    lamp = (lamp_positions(64, "SQUARE") > 0).astype(int)
    pairs = {(*p, *q) for p, q in zip(pixel.T.tolist(), lamp.T.tolist(), strict=True)}
    assert len(pairs) == 16


def developed(film, count):
    pixels = np.full((count, 4), np.nan, np.float32)
    film.develop(np.arange(count), pixels)
    return pixels


def test_film_averages_hits_background_and_nothing():
    film = Film(3, np.array([0.5, 0.25, 0.125]), transparent=False)
    color = np.array([[4.0], [2.0], [1.0]], np.float32)
    film.add(np.arange(3), np.array([True, True, False]), np.array([0]), color)
    film.add(np.arange(3), np.array([True, True, True]), np.array([0, 2]), np.ones((3, 2), np.float32))
    expected = [[2.5, 1.5, 1, 1], [0.5, 0.25, 0.125, 1], [0.5, 0.5, 0.5, 0.5]]
    assert np.allclose(developed(film, 3), expected)


def test_transparent_film_premultiplies():
    film = Film(2, np.ones(3), transparent=True)
    color = np.full((3, 1), 2, np.float32)
    film.add(np.arange(2), np.ones(2, bool), np.array([1]), color)
    film.add(np.arange(2), np.ones(2, bool), np.array([], np.int64), np.zeros((3, 0), np.float32))
    assert developed(film, 2).tolist() == [[0, 0, 0, 0], [1, 1, 1, 0.5]]
