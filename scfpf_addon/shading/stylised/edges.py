# SPDX-License-Identifier: GPL-3.0-or-later
"""Where lines are: between neighbouring places, and then where exactly.

What differs between two places may be an edge, or a surface that is steep or bent. The interval is halved
until it is a small part of a pixel: what is an edge is one still.
"""

from __future__ import annotations

from collections.abc import Callable
from typing import TYPE_CHECKING, NamedTuple

import numpy as np

from ...projection.typing import Array, IndexArray
from ..settings.stylised_settings import CONTOUR, CREASE, MATERIAL, OBJECT, SILHOUETTE, Lines
from .canvas import View, look

if TYPE_CHECKING:
    from ..pipeline import Pipeline

# An edge is known to 1/64 of the distance of neighbouring places: far below what a line's rim shows.
HALVINGS = 6
# Places that are cast between neighbours at once.
AT_ONCE = 1 << 16


class Edges(NamedTuple):
    """Points on lines, each between two neighbouring places. x, y: (n,) in pixels from the bottom left of the
    image. kinds: (n,) bits, see ``settings``. place: (n,) the number of the left or lower one of the two
    places among the view's, axis: (n,) in which they are neighbours.
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
    """The points of edges joined to lines: in each square of four neighbouring places to their middle.

    shape: rows and columns of the places. A point that has no other one beside it is left out: it
    is no line, but an edge of almost the angle that counts, or something finer than the places are.
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


def kinds_between(a: View, b: View, axis: IndexArray, gap: float, lines: Lines) -> IndexArray:
    """What lines pass between places of two views, (n,) bits.

    axis: (n,) in which they are neighbours, gap: how many pixels they are apart. A surface hides
    another one where b is farther from a than both surfaces' slopes explain, and not on their planes.
    """
    both = a.hit & b.hit
    rim = (a.hit != b.hit) & a.mask & b.mask
    apart = b.position - a.position
    which = np.arange(len(axis))
    explained = gap * (a.reach[axis, which] + b.reach[axis, which])
    height = np.maximum(
        np.abs(np.einsum("cn,cn->n", a.normal, apart)), np.abs(np.einsum("cn,cn->n", b.normal, apart))
    )
    step = lines.jump * np.maximum(a.footprint[axis, which], b.footprint[axis, which])
    jump = both & (height > step) & (np.einsum("cn,cn->n", apart, apart) > explained**2)
    joined = both & ~jump
    found = np.zeros(len(axis), np.intp)
    if lines.kinds & SILHOUETTE:
        found |= SILHOUETTE * (jump | rim)
    if lines.kinds & OBJECT:
        found |= OBJECT * (rim | (both & (a.thing != b.thing)))
    if lines.kinds & CONTOUR:
        found |= CONTOUR * (joined & (a.thing == b.thing) & ((a.facing < 0) != (b.facing < 0)))
    if lines.kinds & MATERIAL:
        found |= MATERIAL * (joined & (a.material != b.material))
    if lines.kinds & CREASE:
        cosine = np.einsum("cn,cn->n", a.normal, b.normal)
        found |= CREASE * (joined & (cosine < np.cos(lines.crease_angle)))
    return found


def neighbours(view: View, shape: tuple[int, int]) -> Pairs:
    """The neighbours in rows and columns of places between which a line may be."""
    number = np.arange(shape[0] * shape[1]).reshape(shape)
    pairs = ((number[:, :-1], number[:, 1:]), (number[:-1], number[1:]))
    turned = view.facing < 0
    firsts, seconds, axes = [], [], []
    for axis, (first, second) in enumerate(pairs):
        first, second = first.ravel(), second.ravel()
        # Within a triangle there is nothing but a contour.
        some = (view.triangle[first] != view.triangle[second]) | (turned[first] != turned[second])
        firsts.append(first[some])
        seconds.append(second[some])
        axes.append(np.full(np.count_nonzero(some), axis))
    return Pairs(np.concatenate(firsts), np.concatenate(seconds), np.concatenate(axes))


def strongest(kinds: IndexArray) -> IndexArray:
    """The lowest bit of each, or more than any where there is none."""
    return np.where(kinds > 0, kinds & -kinds, 2 * CREASE)


def find_edges(
    pipeline: Pipeline,
    view: View,
    rows: slice,
    pairs: Pairs,
    lines: Lines,
    stopped: Callable[[], bool],
) -> Edges:
    """The lines that pass between neighbouring pixels of whole rows, in its pixels.

    view: of all of their centres, with derivatives where there are pairs.
    """
    width, height = pipeline.settings.width, pipeline.settings.height
    first, second, axis = pairs
    none = np.zeros(0, np.intp)
    parts = [Edges(np.zeros(0), np.zeros(0), none, none, none)]
    for start in range(0, len(first), AT_ONCE):
        some = slice(start, start + AT_ONCE)
        a, b, along = view.take(first[some]), view.take(second[some]), axis[some]
        kinds = kinds_between(a, b, along, 1.0, lines)
        kept = np.flatnonzero(kinds)
        place = first[some][kept]
        row, column = np.divmod(place, width)
        x, y = column + 0.5, row + (rows.start + 0.5)
        a, b, along, kinds, gap = a.take(kept), b.take(kept), along[kept], kinds[kept], 1.0
        for _ in range(HALVINGS):
            if stopped():
                return parts[0]
            if not len(kinds):
                break
            gap /= 2
            right, up = gap * (along == 0), gap * (along == 1)
            middle = look(pipeline, (x + right) / width, (y + up) / height)
            before = kinds_between(a, middle, along, gap, lines)
            after = kinds_between(middle, b, along, gap, lines)
            later = strongest(after) < strongest(before)
            x, y = x + right * later, y + up * later
            kinds = np.where(later, after, before)
            ends, starts = np.flatnonzero(~later), np.flatnonzero(later)
            a, b = a.put(starts, middle.take(starts)), b.put(ends, middle.take(ends))
            kept = np.flatnonzero(kinds)
            a, b, along, kinds, x, y = a.take(kept), b.take(kept), along[kept], kinds[kept], x[kept], y[kept]
            place = place[kept]
        parts.append(Edges(x + gap / 2 * (along == 0), y + gap / 2 * (along == 1), kinds, place, along))
    return Edges(*(np.concatenate(each) for each in zip(*parts, strict=True)))
