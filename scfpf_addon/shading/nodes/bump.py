# SPDX-License-Identifier: GPL-3.0-or-later
"""The Bump node: normals of the surface that a height raises (Blinn 1978; Mikkelsen 2010).

The height is a graph of its own, reckoned at the hit and a tiny step beside it, in float64: its slope, so
that the size of a pixel does not count.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np

from ...projection.typing import Array
from ..vectors import dot_row, unit
from .context import ShadingContext
from .graph import Evaluator, registers
from .inputs import towards_viewer

# The step beside a hit, as a share of the triangle's longer edge: half of float64's digits, and some.
STEP = 1e-5


def bump(
    table: Mapping[str, Evaluator],
    inputs: Sequence[Array],
    settings: Mapping[str, Any],
    place: ShadingContext,
) -> tuple[Array, ...]:
    """Strength, distance, normal → normal, on the side of the viewer. table: all operations."""
    strength, distance, normal = inputs
    length = place.edge() * STEP
    # Two directions in the triangle's plane: across the axis that lies flattest in it, and across both.
    axis = np.zeros((3, place.count))
    axis[np.abs(place.flat).argmin(axis=0), np.arange(place.count)] = 1.0
    first = unit(np.cross(place.flat, axis, axis=0))
    second = np.cross(place.flat, first, axis=0)

    def height(where: ShadingContext) -> Array:
        """The height (1, n) or (1, 1) that the nodes give other places."""
        ref = settings["output"]
        values: Array = registers(settings["height"], where, table)[ref.operation][ref.output]
        return values

    here = height(place)
    along, across = (
        (height(place.beside(way * length)) - here) / np.where(length > 0.0, length, 1.0)
        for way in (first, second)
    )
    normal = np.broadcast_to(normal, first.shape)
    right, up = np.cross(second, normal, axis=0), np.cross(normal, first, axis=0)
    area = dot_row(first, right)
    slope = (along * right + across * up) * np.sign(area)
    raised = unit(np.abs(area) * normal - distance * settings["sign"] * slope)
    share = np.maximum(strength, 0.0)
    return (towards_viewer(unit(share * raised + (1.0 - share) * normal), place),)
