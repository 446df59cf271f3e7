# SPDX-License-Identifier: GPL-3.0-or-later
"""Joined chords keep the pixel error, measured along the curves themselves."""

import math

import numpy as np
import pytest

from benchmarks.extremes import random_projection
from benchmarks.scenes import bent_projection
from scfpf_addon.casting.cells.joined_chords import T_ERROR, chord_ends
from scfpf_addon.projection.volume.viewing_volume import image_derivatives

CHORDS, ROWS, COLUMNS, PIXELS = 24, 3, 4, 20.0
BREAKS = np.linspace(0.0, 1.0, CHORDS + 1)


def corner_places():
    x, y = np.meshgrid(np.arange(COLUMNS + 1) / COLUMNS, np.arange(ROWS + 1) / ROWS)
    return x.ravel(), y.ravel()


def ends_of(projection):
    """The ends of the chords of the cells' corners, on the curves."""
    points = projection.projectors(*corner_places()).points
    weights, _ = projection.volume.spans.weights(BREAKS)
    return np.einsum("kn,kcs->ncs", weights, points).reshape(CHORDS + 1, 3, ROWS + 1, COLUMNS + 1)


def strays(projection, row, column, start, end):
    """How far, in pixels, a corner's curve is from a chord between two breaks at most, and how far off t."""
    x, y = corner_places()
    place = np.array([row * (COLUMNS + 1) + column])
    image = projection.parameters(x[place], y[place])
    t = np.linspace(BREAKS[start], BREAKS[end], 60)
    sample = projection.volume.evaluate(np.repeat(image.u, 60), np.repeat(image.v, 60), t)
    dx, dy = image_derivatives(sample.du, sample.dv, np.repeat(image.jacobian, 60, axis=2))
    first, chord = sample.position[:, :1], sample.position[:, -1] - sample.position[:, 0]
    share = np.clip((sample.position - first).T @ chord / (chord @ chord), 0, 1)
    off = sample.position - first - chord[:, None] * share
    frames = np.stack([dx / (PIXELS * COLUMNS), dy / (PIXELS * ROWS), sample.dt], axis=-1).transpose(1, 0, 2)
    moved = np.linalg.solve(frames, off.T[..., None])[:, :2, 0]
    return np.hypot(*moved.T).max(), np.abs(t[0] + share * (t[-1] - t[0]) - t).max()


@pytest.mark.parametrize("pixel_error", [0.2, 2.0])
def test_joined_chords_keep_the_pixel_error(pixel_error):
    joined = further = 0
    for seed in range(5):
        projection = bent_projection(2 + seed % 3, math.radians(10 + 20 * seed))
        occupied = np.random.default_rng(seed).random((CHORDS, ROWS, COLUMNS)) < 0.9
        last = chord_ends(ends_of(projection), BREAKS, occupied, (PIXELS, PIXELS), pixel_error)
        for row, column in np.ndindex(ROWS, COLUMNS):
            corners = [(row + y, column + x) for y in (0, 1) for x in (0, 1)]
            place = 0
            while place < CHORDS:
                end = int(last[place, row, column])
                assert (last[place:end, row, column] == end).all()
                if end > place + 1:
                    assert occupied[place:end, row, column].all()
                    found = np.array([strays(projection, *corner, place, end) for corner in corners])
                    assert (found.max(axis=0) <= (1.1 * pixel_error, 1.2 * T_ERROR)).all()
                    joined += 1
                if end < CHORDS and occupied[place : end + 1, row, column].all():
                    # The next one could not have been joined as well.
                    found = np.array([strays(projection, *corner, place, end + 1) for corner in corners])
                    assert (found.max(axis=0) / (pixel_error, T_ERROR)).max() > 0.5
                    further += 1
                place = end
    assert joined > 20 and further > 20


def test_straight_projectors_have_one_chord():
    projection = bent_projection(1, 0.0)
    occupied = np.ones((CHORDS, ROWS, COLUMNS), bool)
    occupied[10] = False
    last = chord_ends(ends_of(projection), BREAKS, occupied, (PIXELS, PIXELS), 1e-3)
    assert (last[:10] == 10).all() and (last[10] == 11).all() and (last[11:] == CHORDS).all()


@pytest.mark.parametrize("seed", range(10))
def test_any_volume_has_ends(seed):
    """Folded, collapsed and coinciding ones, and corners that are not finite."""
    ends = ends_of(random_projection(np.random.default_rng(seed)))
    generator = np.random.default_rng(seed)
    ends[:, :, 2, 3] = np.nan
    ends[:, :, 0, 0] = 0.0
    occupied = generator.random((CHORDS, ROWS, COLUMNS)) < 0.8
    last = chord_ends(ends, BREAKS, occupied, (PIXELS, PIXELS), 0.5)
    place = np.arange(CHORDS)[:, None, None]
    assert ((last > place) & (last <= CHORDS)).all()
    assert (last[~occupied] == np.broadcast_to(place + 1, last.shape)[~occupied]).all()
    # Nothing is joined around the corner without a place, nor where all breaks are one point.
    assert (last[:, 1:3, 2:] == place + 1).all() and (last[:, 0, 0] == place[:, 0, 0] + 1).all()
