# SPDX-License-Identifier: GPL-3.0-or-later
"""The images of live surfaces against padded images and plain means."""

import numpy as np
import pytest

from scfpf_addon.shading.live.live_textures import LiveTexture, LiveTextures, footprints, halved

# NumPy's names for what lies beyond the border of an image of texels.
MODES = {"REPEAT": "wrap", "EXTEND": "edge", "MIRROR": "symmetric", "CLIP": "constant"}
TOLERANCE = 2e-5


def images(count=3):
    random = np.random.default_rng(7)
    return [random.random((5 + 3 * n, 9 - 2 * n, 4), dtype=np.float32) for n in range(count)]


def interpolated(pixels, u, v, mode):
    """The image at one position, from a copy that is padded far enough."""
    height, width = pixels.shape[:2]
    wide = np.pad(pixels.astype(float), ((3 * height,) * 2, (3 * width,) * 2, (0, 0)), mode)
    x, y = (u + 3) * width - 0.5, (v + 3) * height - 0.5
    column, row = int(x), int(y)
    across, upward = x - column, y - row
    low = wide[row, column] * (1 - across) + wide[row, column + 1] * across
    high = wide[row + 1, column] * (1 - across) + wide[row + 1, column + 1] * across
    return low * (1 - upward) + high * upward


@pytest.mark.parametrize("extension", MODES)
def test_interpolation_and_extension_are_those_of_a_padded_image(extension):
    made = images()
    textures = LiveTextures.of([LiveTexture(pixels, extension) for pixels in made])
    random = np.random.default_rng(2)
    uv = random.uniform(-1.9, 2.9, (2, 400)).astype(np.float32)
    which = random.integers(0, len(made), 400)
    found = textures.sample(which, uv, np.zeros(400, np.float32))
    for place, (number, (u, v)) in enumerate(zip(which, uv.T.astype(float), strict=True)):
        expected = interpolated(made[number], u, v, MODES[extension])
        assert np.abs(found[:, place] - expected).max() < TOLERANCE


def test_closest_texels_are_not_mixed():
    pixels = images(1)[0]
    textures = LiveTextures.of([LiveTexture(pixels, "REPEAT", False)])
    uv = np.random.default_rng(4).random((2, 300), dtype=np.float32)
    found = textures.sample(np.zeros(300, int), uv, np.zeros(300, np.float32))
    rows, columns = (uv[1] * pixels.shape[0]).astype(int), (uv[0] * pixels.shape[1]).astype(int)
    assert (pixels[rows, columns] == found.T).all()


def test_a_pixel_as_wide_as_the_image_sees_its_mean():
    pixels = np.random.default_rng(5).random((64, 64, 4), dtype=np.float32)
    textures = LiveTextures.of([LiveTexture(pixels)])
    found = textures.sample(
        np.zeros(50, int), np.random.default_rng(6).random((2, 50), dtype=np.float32), np.ones(50, np.float32)
    )
    assert np.abs(found.T - pixels.mean(axis=(0, 1))).max() < TOLERANCE


def test_halving_is_the_mean_of_squares():
    pixels = np.arange(2 * 6 * 8, dtype=np.float32).reshape(6, 8, 2)
    assert (halved(pixels) == pixels.reshape(3, 2, 4, 2, 2).mean(axis=(1, 3))).all()
    assert halved(np.ones((1, 7, 4), np.float32)).shape == (1, 3, 4)


def test_the_footprint_is_the_step_between_pixels_of_the_same_surface():
    width, height = 12, 9
    column, row = np.meshgrid(np.arange(width), np.arange(height))
    uv = np.stack([0.01 * column, 0.03 * row]).reshape(2, -1).astype(np.float32)
    look = np.where(column < 6, 0, 1)
    uv[0] += np.where(look.ravel() == 1, 0.5, 0)
    found = footprints(uv, look.ravel(), width)
    assert np.abs(found - 0.03).max() < TOLERANCE
    flat = footprints(np.stack([uv[0], 0 * uv[1]]), look.ravel(), width)
    assert np.abs(flat - 0.01).max() < TOLERANCE


def test_coordinates_without_a_value_do_no_harm():
    textures = LiveTextures.of([LiveTexture(images(1)[0])])
    uv = np.array([[np.nan, np.inf, -np.inf, 1e30], [0, 0, np.nan, 1e30]], np.float32)
    assert np.isfinite(textures.sample(np.zeros(4, int), uv, np.full(4, np.nan, np.float32))).all()
