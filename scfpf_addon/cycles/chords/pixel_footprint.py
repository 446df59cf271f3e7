# SPDX-License-Identifier: GPL-3.0-or-later
"""Pixels in space along projectors: by how many pixels the image moves where chords stray from them.

A pixel may be far wider than high in space. So the direction counts in which a chord strays;
the caster's schedule, for speed, takes every direction for the narrow one.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from ...casting.curves.sampled_curves import FINEST, MOST_SQUEEZE, Curves, across, footprint
from ...projection.typing import Array
from ...projection.volume.basis import SpanBasis

# Smaller pixel errors are beyond the float32 of Cycles and count as this.
SMALLEST_ERROR = 0.01

# The least length whose square is above 0.
LEAST_LENGTH = float(np.sqrt(np.finfo(np.float64).tiny))


class Pixels(NamedTuple):
    """Pixels in space at G places of S projectors.

    position, tangent, bend: (3, G, S), Q and its derivatives in the span. widest: (3, G, S), unit, the
    direction across the projector in which pixels are widest. wide, narrow: (G, S), their widths in that
    direction and the other.
    """

    position: Array
    tangent: Array
    bend: Array
    widest: Array
    wide: Array
    narrow: Array

    def moved(self, offset: Array) -> Array:
        """Offsets in space (3, G, S) in pixels, (G, S); their part along the projector does not count."""
        offset = across(offset, self.tangent)
        along = (offset * self.widest).sum(axis=0)
        rest = np.maximum((offset**2).sum(axis=0) - along**2, 0.0)
        moved: Array = np.sqrt((along / self.wide) ** 2 + rest / self.narrow**2)
        return moved


def pixels(curves: Curves, spans: SpanBasis, span: int, local: Array) -> Pixels:
    """The pixels of projectors ``curves`` at ``local`` (G,) in a span."""
    there = footprint(curves, spans, span, local)
    # The direction in the image that is widest in space, from the larger of two equal expressions.
    flat = there.xx >= there.yy
    a, b = np.where(flat, there.wide - there.yy, there.xy), np.where(flat, there.xy, there.wide - there.xx)
    along = there.dx * a + there.dy * b
    length = np.sqrt((along**2).sum(axis=0))
    along = np.divide(along, length, out=np.zeros_like(along), where=length > 0.0)
    # Less than float32 can represent counts as 0, and the narrow width counts less where pixels are squeezed.
    least = (FINEST * np.abs(there.position).max(axis=0) + LEAST_LENGTH) / SMALLEST_ERROR
    wide = np.sqrt(there.wide)
    narrow = np.maximum(np.maximum(np.sqrt(there.narrow), wide / MOST_SQUEEZE), least)
    return Pixels(
        position=there.position,
        tangent=there.tangent,
        bend=there.bend,
        widest=along,
        wide=np.maximum(wide, least),
        narrow=narrow,
    )
