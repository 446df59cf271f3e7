# SPDX-License-Identifier: GPL-3.0-or-later
"""The Bump node: normals of a surface displaced by a height (Blinn 1978; Mikkelsen 2010).

The height is a graph of its own, evaluated in float64 at the hit and tiny steps beside it. The slope
does not depend on the pixel footprint.
"""

from __future__ import annotations

from collections.abc import Mapping

import numpy as np

from ...projection.typing import Array
from ..vectors import dot_row, unit
from .context import ShadingContext
from .graph import Evaluator, Inputs, Settings, registers
from .inputs import towards_viewer

# The step beside a hit, as a share of the triangle's longer edge: more than half of float64's digits.
STEP = 1e-5


def bump(
    table: Mapping[str, Evaluator],
    inputs: Inputs,
    settings: Settings,
    context: ShadingContext,
) -> tuple[Array, ...]:
    """Strength, distance, normal → normal, on the side of the viewer. table: all operations."""
    strength, distance, normal = inputs
    length = context.edge() * STEP
    # Two directions in the triangle's plane, square to each other.
    axis = np.zeros((3, context.count))
    axis[np.abs(context.flat).argmin(axis=0), np.arange(context.count)] = 1.0
    first = unit(np.cross(context.flat, axis, axis=0))
    second = np.cross(context.flat, first, axis=0)

    def height(where: ShadingContext) -> Array:
        """The height (1, n) or (1, 1) elsewhere on the surface."""
        ref = settings["output"]
        values: Array = registers(settings["height"], where, table)[ref.operation][ref.output]
        return values

    here = height(context)
    along, across = (
        (height(context.beside(way * length)) - here) / np.where(length > 0.0, length, 1.0)
        for way in (first, second)
    )
    normal = np.broadcast_to(normal, first.shape)
    right, up = np.cross(second, normal, axis=0), np.cross(normal, first, axis=0)
    area = dot_row(first, right)
    slope = (along * right + across * up) * np.sign(area)
    raised = unit(np.abs(area) * normal - distance * settings["sign"] * slope)
    share = np.maximum(strength, 0.0)
    return (towards_viewer(unit(share * raised + (1.0 - share) * normal), context),)
