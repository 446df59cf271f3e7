# SPDX-License-Identifier: GPL-3.0-or-later
"""The image positions of the sheets' vertices behind a camera's image mappings, for the passes of u and v.

Sheets are fine enough for the mappings: between vertices the positions are as exact as the projectors.
"""

from __future__ import annotations

import numpy as np

from ...bridge.render.image_size import image_aspect
from ...projection.mappings.stack import mapped_places
from ...projection.typing import Array
from ...projection.user_error import UserError
from ...scanline.table.mapping_table import image_mappings
from .sheets import disc_places, disc_square

# x and y are the vertex' own, or a position behind the mappings of a rectangular or a polar image.
OWN, RECTANGLE, DISC = range(3)


def mapped_positions(camera, scene, places: Array, disc: bool) -> Array:
    """x, y and one of OWN, RECTANGLE, DISC for vertices of the sheets, (3, N).

    places: (3, N); x and y in the table, the third is ignored. disc: whether the image is a disc, and its
    table the square around it.
    """
    result = np.stack([places[0], places[1], np.full(places.shape[1], float(OWN))])
    try:
        mappings = image_mappings(camera, scene)
    except UserError:
        return result
    if not mappings:
        return result
    aspect, polar = image_aspect(scene), camera.scfpf.reparameterisation == "POLAR"
    x, y = disc_places(*places[:2], aspect) if disc else places[:2]
    seen = mapped_places(mappings, x, y, aspect)
    if polar:
        x, y = disc_square(seen.u, seen.v, aspect)
    else:
        x, y = np.clip(seen.u, 0.0, 1.0), np.clip(seen.v, 0.0, 1.0)
    result[:2] = np.nan_to_num(np.stack([x, y]))
    result[2] = DISC if polar else RECTANGLE
    return result
