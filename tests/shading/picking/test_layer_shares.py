# SPDX-License-Identifier: GPL-3.0-or-later
"""The image of the layers of a picture: colours by number, darker where a face is seen from its side."""

import numpy as np

from scfpf_addon.projection.diagrams.line_colors import EMPTY, REST
from scfpf_addon.shading.picking.layer_shares import DIM, LayerShares


def test_a_pixel_has_the_color_of_its_layer_and_the_light_of_its_face():
    numbers, facing = np.array([[-1, 0, 1, 2]]), np.array([[0.0, 1.0, 0.0, 0.5]])
    shares = LayerShares(np.zeros(3), np.zeros(3), numbers, facing)
    red, blue = np.array([1.0, 0.0, 0.0]), np.array([0.0, 0.0, 1.0])
    found = shares.picture((tuple(red), tuple(blue)))
    wanted = [EMPTY, REST, DIM * red, (DIM + 0.5 * (1.0 - DIM)) * blue]
    assert np.allclose(found[0, :, :3], wanted) and (found[..., 3] == 1.0).all()
