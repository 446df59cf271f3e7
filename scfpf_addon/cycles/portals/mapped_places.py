# SPDX-License-Identifier: GPL-3.0-or-later
"""Which place of its base's picture each vertex of the sheets sees through the image mappings of a camera.

The passes of u and v need it. Sheets are fine enough for the mappings, so that between vertices it is
right to the part of a pixel that the projectors themselves are.
"""

from __future__ import annotations

import numpy as np

from ...bridge.mappings.mapping_edits import MappingError
from ...bridge.render.image_size import image_aspect
from ...projection.mappings.stack import mapped_places
from ...projection.typing import Array
from ...scanline.table.mapping_table import picture_mappings
from .sheets import disc_places, disc_square

# What x and y are: those of the vertex itself, or a place behind the mappings of a rectangle or of a disc.
OWN, RECTANGLE, DISC = range(3)


def seen_places(camera, scene, places: Array, disc: bool) -> Array:
    """x, y and one of OWN, RECTANGLE, DISC for vertices of the sheets, (3, N) each.

    places: x and y in the table, then ignored. disc: whether the picture is one, and its table a square
    around it.
    """
    result = np.stack([places[0], places[1], np.full(places.shape[1], float(OWN))])
    try:
        mappings = picture_mappings(camera, scene)
    except MappingError:
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
