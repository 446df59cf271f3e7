# SPDX-License-Identifier: GPL-3.0-or-later
"""Maps of a blend against their definitions."""

import math

import numpy as np
import pytest

from scfpf_addon.projection.editing.blend_map import BlendMap, bilinear, normalised

ASPECT = 2.0


def at(blend_map, *places):
    x, y = np.array(places, float).T
    return blend_map.values(x, y, ASPECT)


def test_a_gradient_grows_along_its_direction():
    """Half way at its centre, and by half its border, in widths of the image, to either end."""
    blend_map = BlendMap("LINEAR", centre=(0.4, 0.5), angle=0.0, border=0.2)
    assert at(blend_map, (0.29, 0.1), (0.4, 0.9), (0.51, 0.5)) == pytest.approx([0, 0.5, 1])
    share = 0.25
    assert at(blend_map, (0.35, 0.5)) == pytest.approx(3 * share**2 - 2 * share**3)
    upwards = BlendMap("LINEAR", angle=math.pi / 2, border=0.2)
    # The image is half as high as wide.
    assert at(upwards, (0.9, 0.5 + 0.05 * ASPECT)) == pytest.approx(1 - 3 * share**2 + 2 * share**3)


def test_a_circle_is_one_in_space_and_a_rectangle_turns():
    circle = BlendMap("RADIAL", centre=(0.5, 0.5), size=(0.4, 0.0), border=0.0)
    turn = np.linspace(0, 2 * np.pi, 50)
    for radius, wanted in ((0.199, 1.0), (0.201, 0.0)):
        x, y = 0.5 + radius * np.cos(turn), 0.5 + ASPECT * radius * np.sin(turn)
        assert (circle.values(x, y, ASPECT) == wanted).all()
    generator = np.random.default_rng(0)
    x, y = generator.uniform(size=(2, 2000))
    box = BlendMap("RECTANGLE", centre=(0.3, 0.6), size=(0.4, 0.3), angle=0.5, border=0.0)
    # The same turn by complex numbers.
    place = (x - 0.3 + 1j * (y - 0.6) / ASPECT) * np.exp(-0.5j)
    inside = (np.abs(place.real) < 0.2) & (np.abs(place.imag) < 0.15 / ASPECT)
    assert (box.values(x, y, ASPECT) == inside).all() and 0.05 < inside.mean() < 0.2


def test_the_border_of_a_rectangle_is_as_wide_at_its_corners():
    box = BlendMap("RECTANGLE", size=(0.4, 0.4), border=0.1)
    corner = np.array([0.7, 0.5 + 0.2])
    way = np.array([1.0, ASPECT]) / math.sqrt(2)
    assert at(box, corner + 0.0499 * way, corner + 0.0501 * way) == pytest.approx([0, 0], abs=1e-4)
    assert at(box, corner + 0.025 * way) == pytest.approx(3 * 0.25**2 - 2 * 0.25**3)


def test_an_image_is_bilinear_between_the_middles_of_its_pixels():
    generator = np.random.default_rng(1)
    pixels = generator.uniform(size=(5, 7))
    rows, columns = np.mgrid[:5, :7]
    assert bilinear(pixels, (columns.ravel() + 0.5) / 7, (rows.ravel() + 0.5) / 5) == pytest.approx(
        pixels.ravel()
    )
    plane = 0.1 + 0.05 * columns + 0.08 * rows
    x, y = generator.uniform(0.1, 0.9, size=(2, 100))
    wanted = 0.1 + 0.05 * (7 * x - 0.5) + 0.08 * (5 * y - 0.5)
    blend_map = BlendMap("IMAGE", pixels=plane)
    assert blend_map.values(x, y, ASPECT) == pytest.approx(wanted)
    turned = BlendMap("IMAGE", pixels=plane, is_inverted=True)
    assert turned.values(x, y, ASPECT) == pytest.approx(1 - wanted)


def test_around_views_a_field_is_one_and_falls_off_outside():
    """In a circle 1, half way through its border a half, beyond that 0; the nearer of two counts."""
    blend_map = BlendMap("VIEWS", border=0.1, circles=((0.2, 0.5, 0.2), (0.8, 0.5, 0.1)))
    assert at(blend_map, (0.2, 0.5), (0.299, 0.5), (0.35, 0.5), (0.401, 0.5)) == pytest.approx(
        [1, 1, 0.5, 0], abs=1e-3
    )
    # The image is half as high as wide.
    assert at(blend_map, (0.8, 0.5 + 0.1 * ASPECT), (0.8, 0.5 + 0.151 * ASPECT)) == pytest.approx([0.5, 0])


def test_weights_are_divided_by_their_sum_only_above_one():
    weights = np.array([[0.2, 1.0, 3.0, 0.0], [0.3, 1.0, 1.0, 0.0]])
    wanted = [[0.2, 0.5, 0.75, 0.0], [0.3, 0.5, 0.25, 0.0]]
    assert np.allclose(normalised(weights), wanted, rtol=1e-15, atol=0)
