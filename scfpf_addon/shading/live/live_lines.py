# SPDX-License-Identifier: GPL-3.0-or-later
"""The lines of Drawn Style in a live image: the same rules as in a drawn frame, between neighbouring pixels.

A frame searches each line's exact place, by casting again and again; here a line covers whole pixels on its
two sides. Contours are left out, as live hits do not know where a smooth surface turns away.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from ...projection.colors import srgb_from_linear
from ...projection.typing import BoolArray, IndexArray
from ..settings.stylised_settings import OUTER, Lines
from ..stylised.edges import kinds_between
from ..stylised.surface_samples import SurfaceSamples
from ..typing import Single
from ..vectors import dot
from .live_hits import LiveHits

# Width of a line in pixels from which it covers both sides of its edge.
BOTH_SIDES = 1.5
# Pixels that wider lines reach beyond these, at most.
MOST_WIDER = 4


def draw_lines(image: Single, hits: LiveHits, lines: Lines, pixel_size: float) -> None:
    """Draw lines over an image (H, W, 4) of display colours, in place.

    lines: their widths are in pixels of the screen. pixel_size: the number of these across a pixel.
    """
    shape = hits.height, hits.width
    reach, footprint = _steps(hits)
    marks = np.zeros((2, *shape), bool)
    for axis in (0, 1):
        first, second = _candidates(hits, reach[axis], axis, lines)
        a, b = (_samples(hits, where, reach, footprint) for where in (first, second))
        kinds = kinds_between(a, b, np.full(len(first), axis), 1.0, lines)
        for number, (some, width) in enumerate(
            ((kinds & OUTER > 0, lines.width), ((kinds > 0) & (kinds & OUTER == 0), lines.inner_width))
        ):
            flat = marks[number].reshape(-1)
            flat[first[some]] = True
            if width >= BOTH_SIDES * pixel_size:
                flat[second[some]] = True
    color = srgb_from_linear(np.clip(lines.color, 0.0, 1.0).astype(np.float32))
    for mark, width in zip(marks, (lines.width, lines.inner_width), strict=True):
        wider = _widened(mark, width / pixel_size)
        opacity = np.float32(min(width / pixel_size, 1.0))
        image[wider, :3] += (color - image[wider, :3]) * opacity


def _steps(hits: LiveHits) -> tuple[NDArray[np.float32], NDArray[np.float32]]:
    """The lengths of pixels' steps along their surface, and across the view: reach and footprint, (2, N).

    Of the steps to both neighbours the shorter one counts: it does not lead over an edge.
    """
    shape = hits.height, hits.width
    position, forward = hits.position.reshape(3, *shape), hits.forward.reshape(3, *shape)
    hit = (hits.look >= 0).reshape(shape)
    found = np.full((2, 2, *shape), np.inf, np.float32)
    for axis in (0, 1):
        after, before = _sides(axis)
        step = position[(slice(None), *after)] - position[(slice(None), *before)]
        along = np.einsum("chw,chw->hw", step, forward[(slice(None), *before)])
        whole = np.einsum("chw,chw->hw", step, step)
        whole[~(hit[after] & hit[before])] = np.inf
        for kind, square in enumerate((whole, np.maximum(whole - along * along, 0.0))):
            length = np.sqrt(square)
            np.minimum(found[kind, axis][after], length, out=found[kind, axis][after])
            np.minimum(found[kind, axis][before], length, out=found[kind, axis][before])
    found[np.isinf(found)] = 0.0
    return found[0].reshape(2, -1), found[1].reshape(2, -1)


def _sides(axis: int) -> tuple[tuple[slice, slice], tuple[slice, slice]]:
    """The right and left (axis 0), or upper and lower, pixels of all pairs of neighbours."""
    after, before, whole = slice(1, None), slice(None, -1), slice(None)
    return ((whole, after), (whole, before)) if axis == 0 else ((after, whole), (before, whole))


def _candidates(hits: LiveHits, reach: Single, axis: int, lines: Lines) -> tuple[IndexArray, IndexArray]:
    """The pairs of neighbours that can have a line between them, by their numbers."""
    shape = hits.height, hits.width
    after, before = _sides(axis)
    look, objects = hits.look.reshape(shape), hits.object.reshape(shape)
    normal, position = hits.normal.reshape(3, *shape), hits.position.reshape(3, *shape)
    apart = position[(slice(None), *after)] - position[(slice(None), *before)]
    length = reach.reshape(shape)
    found = (look[after] != look[before]) | (objects[after] != objects[before])
    found |= np.einsum("chw,chw->hw", apart, apart) > (length[after] + length[before]) ** 2
    cosine = np.einsum("chw,chw->hw", normal[(slice(None), *after)], normal[(slice(None), *before)])
    found |= cosine < np.cos(lines.crease_angle)
    number = np.arange(shape[0] * shape[1]).reshape(shape)
    return number[before][found], number[after][found]


def _samples(hits: LiveHits, where: IndexArray, reach: Single, footprint: Single) -> SurfaceSamples:
    """Some pixels as samples of a surface."""
    normal, forward = hits.normal.take(where, axis=1), hits.forward.take(where, axis=1)
    look = hits.look.take(where)
    return SurfaceSamples(
        mask=hits.mask.take(where),
        hit=look >= 0,
        t=hits.t.take(where).astype(np.float64),
        position=hits.position.take(where, axis=1).astype(np.float64),
        normal=normal.astype(np.float64),
        facing=-dot(normal, forward),
        triangle=look,
        object_index=hits.object.take(where),
        material=look,
        reach=reach.take(where, axis=1),
        footprint=footprint.take(where, axis=1),
        slope=np.zeros(len(where), np.float32),
    )


def _widened(mark: BoolArray, width: float) -> BoolArray:
    """The pixels within half of a line's width, less the two that it covers already."""
    for _ in range(min(round((width - 2.0) / 2.0), MOST_WIDER)):
        wider = mark.copy()
        for axis in (0, 1):
            after, before = _sides(axis)
            wider[after] |= mark[before]
            wider[before] |= mark[after]
        mark = wider
    return mark
