# SPDX-License-Identifier: GPL-3.0-or-later
"""Thumbnails of volumes for menus: lines on paper, in a file that others read."""

import io

import numpy as np
import pytest
from matplotlib import image as reader

from scfpf_addon.projection.presets import thumbnail
from scfpf_addon.projection.presets.thumbnail import HEIGHT, PAPER, WIDTH, png, png_size, volume_thumbnail
from scfpf_addon.projection.surfaces.surface import Plane, Point
from scfpf_addon.projection.volume.viewing_volume import Projection, ViewingVolume


def plane(depth, width):
    matrix = np.eye(4)
    matrix[2, 3] = -depth
    return Plane(width, 0.75 * width, matrix=matrix)


def inked(image):
    """Pixels that are not paper."""
    return np.abs(image[..., :3] - PAPER).max(axis=2) > 1e-9


@pytest.mark.parametrize("scale", [1e-6, 1.0, 1e6])
def test_a_volume_fills_its_image_but_for_a_margin(scale):
    image = volume_thumbnail(Projection(ViewingVolume((plane(scale, scale), plane(4 * scale, 4 * scale)))))
    assert image.shape == (HEIGHT, WIDTH, 4) and (image[..., 3] == 1.0).all()
    assert image.min() >= 0.0 and image.max() <= 1.0
    rows, columns = np.nonzero(inked(image))
    free = [rows.min(), HEIGHT - 1 - rows.max(), columns.min(), WIDTH - 1 - columns.max()]
    margin = thumbnail.MARGIN * np.array([HEIGHT, HEIGHT, WIDTH, WIDTH])
    assert (free >= margin - 2).all() and (free <= margin + 1).sum() >= 2
    assert 0.05 < inked(image).mean() < 0.7


def test_surfaces_projectors_and_borders_have_their_colours():
    """Of two planes seen askew all three kinds of lines show."""
    image = volume_thumbnail(Projection(ViewingVolume((plane(1, 1), plane(3, 3)))))
    for color, _ in (thumbnail.GRID, thumbnail.PROJECTOR, thumbnail.BORDER):
        nearest = np.abs(image[..., :3] - color).max(axis=2).min()
        assert nearest < 0.12, color


def test_it_is_seen_from_the_right_and_from_above():
    """The near end is to the left of the far one's middle and lower; a taller volume is drawn upwards."""
    x, y = thumbnail._seen(np.array([[[0, 0, 0], [0, 0, -1]]], np.float32))[0].T
    assert x[1] > x[0] and y[1] < y[0]
    x, y = thumbnail._seen(np.array([[[0, 0, 0], [0, 1, 0]]], np.float32))[0].T
    assert x[1] == x[0] and y[1] < y[0]


def test_a_volume_without_lines_is_blank_paper():
    image = volume_thumbnail(Projection(ViewingVolume((Point(), Point()))))
    assert image.shape == (HEIGHT, WIDTH, 4) and not inked(image).any()


def test_files_are_read_by_others():
    pixels = np.random.default_rng(1).integers(0, 256, (5, 7, 4)) / 255
    data = png(pixels)
    np.testing.assert_allclose(reader.imread(io.BytesIO(data), format="png"), pixels, atol=1e-6)
    assert png_size(data[:24]) == (7, 5)
    assert reader.imread(io.BytesIO(png(pixels * 3 - 1)), format="png").max() == 1.0
    for other in (b"", data[:23], b"\x89PNX" + data[4:24], data[:12] + b"IDAT" + data[16:24]):
        assert png_size(other) is None
