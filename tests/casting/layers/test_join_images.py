# SPDX-License-Identifier: GPL-3.0-or-later
"""Joined images against lists sorted pixel by pixel; shares of halos and masks in closed form."""

import numpy as np

from scfpf_addon.casting.layers.join_images import cover, halo_share, joined, shares
from scfpf_addon.projection.mappings.stack import Stack
from scfpf_addon.projection.surfaces.surface import Plane
from scfpf_addon.projection.volume.reparameterisation import Framed, Unrolled
from scfpf_addon.projection.volume.viewing_volume import ImageLayer, Projection, ViewingVolume


def laid_over(colors, keys):
    seen = np.any([color[:, 3] > 0 for color in colors[1:]], axis=0)
    return joined(colors, shares([color[:, 3] for color in colors], keys), seen)


def test_pixels_are_laid_over_one_another_by_their_keys():
    generator = np.random.default_rng(3)
    sources, places, count = 4, 3, 200
    alpha = generator.choice([0.0, 0.3, 1.0], (sources, count, 1))
    colors = np.concatenate([generator.random((sources, count, 3)) * alpha, alpha], axis=2)
    keys = generator.choice([-1.0, 2.0, 2.5, 7.0], (sources, places, count))
    image = laid_over(colors.astype(np.float32), keys)
    for pixel in range(count):
        total = np.zeros(4)
        for place in range(places):
            shows = 1.0
            for _key, source in sorted((keys[source, place, pixel], source) for source in range(sources)):
                total += shows * colors[source, pixel]
                shows *= 1.0 - colors[source, pixel, 3]
        np.testing.assert_allclose(image[pixel], total / places, atol=1e-6)


def test_a_pixel_without_layers_keeps_its_bits():
    rest = np.random.default_rng(1).random((50, 4)).astype(np.float32)
    layer = np.zeros((50, 4), np.float32)
    layer[:10, 3] = 1.0
    keys = [np.full((3, 50), 5.0), np.full((3, 50), 1.0)]
    keys[1][1:, :5] = np.inf
    image = laid_over([rest, layer], keys)
    np.testing.assert_array_equal(image[10:], rest[10:])
    # A place that meets nothing opaque counts as the nearest one of its pixel.
    np.testing.assert_array_equal(image[:10], layer[:10])


def test_a_frame_and_a_mask_cover_shares_of_pixels():
    framed = Stack((Framed((0.5, 0.5), (0.55, 1.0)),), Unrolled())
    matrix = np.eye(4)
    volume = ViewingVolume((Plane(matrix=matrix, width=1, height=1), Plane(matrix=matrix, width=1, height=1)))
    mask = np.array([[1.0, 1.0], [0.0, 0.0]])
    layer = ImageLayer(Projection(volume, framed), "ORDER", np.zeros(3), mask)
    shares = cover(layer, (10, 4), (0, 0, 10, 4))
    row = np.array([0, 0, 0.75, 1, 1, 1, 1, 0.75, 0, 0])
    np.testing.assert_allclose(shares, np.outer([1, 1, 0, 0], row))


def test_a_halo_shows_its_part_of_what_is_beside_the_things():
    is_seen, nearness = np.zeros((4, 5, 5), bool), np.zeros((4, 5, 5))
    is_seen[:2, :, 3:], nearness[0, :, 3:], nearness[1, :, 3:] = True, 0.75, 0.25
    share = halo_share(is_seen, nearness)
    # Beside the border of what is seen the share is that of the neighbours.
    np.testing.assert_array_equal(share[2], [0.0, 0.0, 0.5, 0.5, 0.5])
