# SPDX-License-Identifier: GPL-3.0-or-later
"""The sample sets are even, the film averages."""

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from scfpf_addon.shading.sampling.films import Film
from scfpf_addon.shading.sampling.sample_sets import lamp_places, pixel_positions

SHAPES = ("SQUARE", "DISC", "POINT")


def test_one_sample_is_the_centre():
    assert pixel_positions(1).tolist() == [[0.5], [0.5]]
    assert not lamp_places(np.float32([[0.1], [0.7]]), "POINT").any()


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


@pytest.mark.parametrize("shape", SHAPES)
def test_lamp_places_are_centred(shape):
    places = lamp_places(pixel_positions(4096).astype(np.float32), shape)
    assert places.shape == (2, 4096)
    assert np.allclose(places.mean(axis=1), 0, atol=1e-3)


def test_disc_is_filled_evenly():
    radius = np.sort(np.hypot(*lamp_places(pixel_positions(4096).astype(np.float32), "DISC")))
    assert np.allclose(radius, 0.5 * np.sqrt((np.arange(4096) + 0.5) / 4096), atol=2e-3)


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
