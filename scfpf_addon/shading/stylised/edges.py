# SPDX-License-Identifier: GPL-3.0-or-later
"""The lines between neighbouring places of the image, and their exact positions.

Two places that differ may have an edge between them, or a steep or bent surface. The interval is halved
until it is a small part of a pixel: only an edge still differs there.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from ...casting.common.cancellation import raise_if_cancelled
from ...projection.typing import Array, IndexArray
from ..settings.stylised_settings import CONTOUR, CREASE, MATERIAL, OBJECT, SILHOUETTE, Lines
from ..tracing.scene_view import SceneView
from ..vectors import dot
from .surface_samples import SurfaceSamples, sample_surface

# Edges are located to 1/64 of the distance of neighbouring places, far below the soft rim of a line.
HALVINGS = 6
# Pairs of neighbours whose edges are searched at once.
AT_ONCE = 1 << 16


class Edges(NamedTuple):
    """Points on lines, each between two neighbouring places.

    x, y: (n,) in pixels from the bottom left of the image. kinds: (n,) bits, see ``stylised_settings``.
    place: (n,) number of the left or lower one of the two places. axis: (n,) in which they are neighbours.
    """

    x: Array
    y: Array
    kinds: IndexArray
    place: IndexArray
    axis: IndexArray


class Pairs(NamedTuple):
    """Neighbouring places by their numbers, (n,) each, and the axis along which they are neighbours."""

    first: IndexArray
    second: IndexArray
    axis: IndexArray


class Segments(NamedTuple):
    """Pieces of lines from (x, y) by (right, up), each (n,). kinds: (n,) bits."""

    x: Array
    y: Array
    right: Array
    up: Array
    kinds: IndexArray


def joined_up(edges: Edges, shape: tuple[int, int]) -> Segments:
    """Join the points of edges to lines: in each square of four neighbouring places, to their middle.

    shape: rows and columns of the places. A point without another one beside it is left out: it is not a
    line, but an edge of almost the crease angle, or a detail finer than the places.
    """
    rows, columns = shape
    row, column = np.divmod(edges.place, columns)
    parts = []
    for before in (0, 1):
        # The square on either side of the pair: above and below, to its right and to its left.
        square_row, square_column = row - before * (edges.axis == 0), column - before * (edges.axis == 1)
        there = (square_row >= 0) & (square_column >= 0) & (square_row < rows - 1)
        there &= square_column < columns - 1
        parts.append(np.where(there, square_row * columns + square_column, rows * columns))
    squares = np.concatenate(parts)
    count = np.bincount(squares, minlength=rows * columns + 1)
    count[-1] = 0
    x, y = np.tile(edges.x, 2), np.tile(edges.y, 2)
    kept = np.flatnonzero(count[squares] > 1)
    at, many = squares[kept], np.maximum(count, 1)
    middle_x = np.bincount(squares, x, len(count)) / many
    middle_y = np.bincount(squares, y, len(count)) / many
    x, y = x[kept], y[kept]
    return Segments(x, y, middle_x[at] - x, middle_y[at] - y, np.tile(edges.kinds, 2)[kept])


def kinds_between(
    a: SurfaceSamples, b: SurfaceSamples, axis: IndexArray, gap: float, lines: Lines
) -> IndexArray:
    """The kinds of lines between n pairs of places, (n,) bits.

    axis: (n,) in which they are neighbours. gap: their distance in pixels. A surface hides another one
    where b is farther from a than the slopes of both surfaces explain, and off their planes.
    """
    both = a.hit & b.hit
    rim = (a.hit != b.hit) & a.mask & b.mask
    apart = b.position - a.position
    which = np.arange(len(axis))
    explained = gap * (a.reach[axis, which] + b.reach[axis, which])
    height = np.maximum(np.abs(dot(a.normal, apart)), np.abs(dot(b.normal, apart)))
    step = lines.jump * np.maximum(a.footprint[axis, which], b.footprint[axis, which])
    jump = both & (height > step) & (dot(apart, apart) > explained**2)
    joined = both & ~jump
    found = np.zeros(len(axis), np.intp)
    if lines.kinds & SILHOUETTE:
        found |= SILHOUETTE * (jump | rim)
    if lines.kinds & OBJECT:
        found |= OBJECT * (rim | (both & (a.object_index != b.object_index)))
    if lines.kinds & CONTOUR:
        found |= CONTOUR * (joined & (a.object_index == b.object_index) & ((a.facing < 0) != (b.facing < 0)))
    if lines.kinds & MATERIAL:
        found |= MATERIAL * (joined & (a.material != b.material))
    if lines.kinds & CREASE:
        cosine = dot(a.normal, b.normal)
        found |= CREASE * (joined & (cosine < np.cos(lines.crease_angle)))
    return found


def neighbours(surface: SurfaceSamples, shape: tuple[int, int]) -> Pairs:
    """The neighbours in rows and columns of places that may have a line between them."""
    number = np.arange(shape[0] * shape[1]).reshape(shape)
    pairs = ((number[:, :-1], number[:, 1:]), (number[:-1], number[1:]))
    turned = surface.facing < 0
    firsts, seconds, axes = [], [], []
    for axis, (first, second) in enumerate(pairs):
        first, second = first.ravel(), second.ravel()
        # Within a triangle only a contour is possible.
        some = (surface.triangle[first] != surface.triangle[second]) | (turned[first] != turned[second])
        firsts.append(first[some])
        seconds.append(second[some])
        axes.append(np.full(np.count_nonzero(some), axis))
    return Pairs(np.concatenate(firsts), np.concatenate(seconds), np.concatenate(axes))


def strongest(kinds: IndexArray) -> IndexArray:
    """The lowest bit of each, or a number above all bits where none is set."""
    return np.where(kinds > 0, kinds & -kinds, 2 * CREASE)


def find_edges(view: SceneView, surface: SurfaceSamples, rows: slice, pairs: Pairs, lines: Lines) -> Edges:
    """Find the lines that pass between neighbouring pixels of whole rows of the view's image.

    surface: at the centres of all these pixels, with derivatives where there are pairs.
    """
    none = np.zeros(0, np.intp)
    parts = [Edges(np.zeros(0), np.zeros(0), none, none, none)]
    for start in range(0, len(pairs.first), AT_ONCE):
        some = slice(start, start + AT_ONCE)
        parts.append(_bisect(view, surface, rows, Pairs(*(each[some] for each in pairs)), lines))
    return Edges(*(np.concatenate(each) for each in zip(*parts, strict=True)))


def _bisect(view: SceneView, surface: SurfaceSamples, rows: slice, pairs: Pairs, lines: Lines) -> Edges:
    """Halve the intervals between neighbours, and keep the halves that have a line."""
    width, height = view.settings.width, view.settings.height
    a, b, gap = surface.take(pairs.first), surface.take(pairs.second), 1.0
    kinds = kinds_between(a, b, pairs.axis, gap, lines)
    kept = np.flatnonzero(kinds)
    place, axis = pairs.first[kept], pairs.axis[kept]
    row, column = np.divmod(place, width)
    x, y = column + 0.5, row + (rows.start + 0.5)
    a, b, kinds = a.take(kept), b.take(kept), kinds[kept]
    for _ in range(HALVINGS):
        raise_if_cancelled()
        if not len(kinds):
            break
        gap /= 2
        right, up = gap * (axis == 0), gap * (axis == 1)
        middle = sample_surface(view, (x + right) / width, (y + up) / height)
        before = kinds_between(a, middle, axis, gap, lines)
        after = kinds_between(middle, b, axis, gap, lines)
        later = strongest(after) < strongest(before)
        x, y = x + right * later, y + up * later
        kinds = np.where(later, after, before)
        ends, starts = np.flatnonzero(~later), np.flatnonzero(later)
        a, b = a.put(starts, middle.take(starts)), b.put(ends, middle.take(ends))
        kept = np.flatnonzero(kinds)
        a, b, kinds, x, y = a.take(kept), b.take(kept), kinds[kept], x[kept], y[kept]
        place, axis = place[kept], axis[kept]
    return Edges(x + gap / 2 * (axis == 0), y + gap / 2 * (axis == 1), kinds, place, axis)
