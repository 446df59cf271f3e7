# SPDX-License-Identifier: GPL-3.0-or-later
"""Comparing a pixel with its neighbours, which may have seen what its chords passed."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from ..projection.typing import Array, BoolArray, IndexArray
from .refine import Work, refine

# The t of a pixel that saw nothing: beyond all others.
NOTHING = 2.0

# A surface that slopes on beyond a pixel by a step that differs from the one before
# it by less than this share is smooth there.
SMOOTH = 0.5

# Sums of t in float32 are off by less than this: eight of its roundings.
BEND_ROUNDING = 2.0**-21

# Nearer things of neighbouring pixels that are looked for one behind the other.
LAYERS = 3

# A thing that a chord hits is alone if no curve of the pixel and its neighbours hits
# anything within this many pixels' sizes before or behind. The limb of a smooth thing may
# recede by some hundreds in a pixel, but only away from what is nearer: inside a limb that
# can be seen the surface comes towards the eye. What is behind is another thing sooner.
ALONE_BEFORE = 512.0
ALONE_BEHIND = 64.0

# Side in pixels of the blocks that thin things are told by.
BLOCK = 8


def compare(work: Work, mask: BoolArray, columns: int) -> None:
    """Look again where a neighbouring pixel saw something nearer.

    A chord strays by up to a neighbour's width, so it can pass something that its
    curve hits; but then a neighbour's chord has hit it. There the curve is followed
    finely, at most LAYERS times, from the nearest of the neighbours' hits on. The first
    and the last row are only there to be looked at.
    """
    hits, breaks = work.hits, work.schedule.breaks
    # What a pixel's chord hits and its curve does not, another's curve may hit.
    seen = np.minimum(np.where(hits.triangle >= 0, hits.t, NOTHING), work.passed)
    projector, layers = _jumps(work, seen, mask, columns)
    passed = np.full(len(projector), -np.inf)
    for _ in range(LAYERS):
        ahead = (layers > passed) & (layers < hits.t[projector])
        nearest = np.where(ahead, layers, np.inf).min(axis=0, initial=np.inf)
        going = np.flatnonzero(np.isfinite(nearest))
        if len(going) == 0:
            break
        projector, layers, middle = projector[going], layers[:, going], nearest[going]
        chord = np.clip(np.searchsorted(breaks, middle, side="right") - 1, 0, len(breaks) - 2)
        half = 0.5 * (breaks[chord + 1] - breaks[chord])
        low, high = np.maximum(middle - half, breaks[0]), np.minimum(middle + half, breaks[-1])
        work.counts.compared += len(going)
        hit, found = refine(work, work.bundle.take(projector), low, high)
        nearer = np.flatnonzero(found.t < hits.t[projector[hit]])
        work.store(projector[hit], found, nearer)
        passed = high


def thin_things(work: Work, columns: int) -> NDArray[np.intp]:
    """Pixels around which chords hit things that no curve hits, counted without the border rows.

    Next to a thing wider than chords stray, a neighbour's curve hits it. Things much
    thinner are seen by few chords, so comparing finds a part of them only, and a
    wire or a far tree would look thinner than it is. The answer is made of whole
    blocks of pixels: those where that happens, and the ones around them.
    """
    t, passed = work.hits.t, work.passed[columns:-columns]
    pixels = np.flatnonzero(passed < t[columns:-columns])
    there = passed[pixels]
    column, row = pixels % columns, pixels // columns
    left, right = pixels - (column > 0), pixels + (column < columns - 1)
    around = [p + rise for p in (left, pixels, right) for rise in (0, columns, 2 * columns)]
    behind = (t[np.stack(around)] - there) / work.schedule.pixel_at(there)
    alone = np.flatnonzero(((behind < -ALONE_BEFORE) | (behind > ALONE_BEHIND)).all(axis=0))
    if len(alone) == 0:
        return alone
    rows = len(passed) // columns
    blocks = np.zeros((rows // BLOCK + 3, columns // BLOCK + 3), bool)
    for down in range(3):
        for aside in range(3):
            blocks[row[alone] // BLOCK + down, column[alone] // BLOCK + aside] = True
    block_row = np.arange(rows) // BLOCK + 1
    block_column = np.arange(columns) // BLOCK + 1
    return np.flatnonzero(blocks[block_row[:, None], block_column])


def _jumps(work: Work, seen: Array, mask: BoolArray, columns: int) -> tuple[NDArray[np.intp], Array]:
    """Pixels next to which the picture jumps to something nearer.

    seen: (N,) t that each pixel saw, NOTHING for nothing. Returns the pixels (M,), border
    rows left out, and (8, M) the nearer neighbours' t, inf for the others. A sloping
    surface is no jump: it goes on beyond the pixel as it came, or the two hits are in one
    surface (``_connected``).
    """
    schedule = work.schedule
    own = np.minimum(work.hits.t, NOTHING)
    # Nothing is seen before the nearest of all, nor are pixels smaller there than behind.
    behind = schedule.breaks[1:] >= seen.min(initial=NOTHING)
    least_size = schedule.pixel[behind].min(initial=NOTHING)
    rough = _bends(seen, own, columns) > SMOOTH * least_size - BEND_ROUNDING
    rough &= mask[columns:-columns]
    pixels = np.flatnonzero(rough) + columns
    here = own[pixels]
    column = pixels % columns
    left, right = pixels - (column > 0), pixels + (column < columns - 1)
    below, above = -columns, columns
    # In pairs that face each other across the pixel.
    neighbours = [left, right, pixels + below, pixels + above]
    neighbours += [left + below, right + above, right + below, left + above]
    beside = np.stack([seen[n] for n in neighbours])
    opposite = beside[[1, 0, 3, 2, 5, 4, 7, 6]]
    gap = here - beside
    size = schedule.pixel_at(beside.min(axis=0))
    bend = np.abs(opposite - here - gap)
    jump = (gap > size) & (bend > SMOOTH * gap)
    some = np.flatnonzero(jump.any(axis=0))
    pixels, beside, jump = pixels[some], beside[:, some], jump[:, some]
    which, pixel = np.nonzero(jump & (beside == own[np.stack(neighbours)[:, some]]))
    other = np.stack(neighbours)[:, some][which, pixel]
    one_surface = _connected(work, pixels[pixel], other)
    jump[which[one_surface], pixel[one_surface]] = False
    some = np.flatnonzero(jump.any(axis=0))
    return pixels[some], np.where(jump, beside, np.inf)[:, some]


def _bends(seen: Array, own: Array, columns: int) -> NDArray[np.float32]:
    """By how much t at most bends from a neighbour over a pixel to the one across, without border rows.

    seen, own: (N,) t of the neighbours and of the pixels. The answer is off by BEND_ROUNDING
    at most. At the image's sides the pixel takes the place of the neighbour.
    """
    t = seen.astype(np.float32).reshape(-1, columns)
    wide = np.concatenate([t[:, :1], t, t[:, -1:]], axis=1)
    below, here, above = wide[:-2], wide[1:-1], wide[2:]
    sums = [here[:, :-2] + here[:, 2:], below[:, 1:-1] + above[:, 1:-1]]
    sums += [below[:, :-2] + above[:, 2:], below[:, 2:] + above[:, :-2]]
    most, least = np.maximum(sums[0], sums[1]), np.minimum(sums[0], sums[1])
    for other in sums[2:]:
        np.maximum(most, other, out=most)
        np.minimum(least, other, out=least)
    twice = (2.0 * own[columns:-columns]).astype(np.float32).reshape(most.shape)
    bends: NDArray[np.float32] = np.maximum(most - twice, twice - least).ravel()
    return bends


def _connected(work: Work, pixels: IndexArray, neighbours: IndexArray) -> BoolArray:
    """Whether pixels (M,) and neighbours see one surface: triangles with a common edge, from one side.

    No line goes through both of two such triangles from that side, so the pixel has
    nothing to look for on the other one.
    """
    scene, hits = work.scene, work.hits
    own, other = hits.triangle[pixels], hits.triangle[neighbours]
    result: BoolArray = own == other
    open_ones = np.flatnonzero(~result & (own >= 0) & (other >= 0))
    beside = scene.neighbours.take(own[open_ones], 1) == other[open_ones]
    open_ones = open_ones[beside.any(axis=0)]
    curves = work.bundle.take(pixels[open_ones])
    tangent = curves.at(hits.t[pixels[open_ones]])[1]
    sides = [np.einsum("cn,cn->n", scene.normals(t[open_ones]), tangent) > 0.0 for t in (own, other)]
    result[open_ones] = sides[0] == sides[1]
    return result
