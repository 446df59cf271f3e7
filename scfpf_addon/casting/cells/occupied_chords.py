# SPDX-License-Identifier: GPL-3.0-or-later
"""The chords of an image's cells in which anything may lie.

Certain, not sampled: a cell's chord counts as empty only if a plane separates the hull of its corners from
each triangle. In case of doubt it counts as occupied.
"""

from __future__ import annotations

from collections.abc import Iterable, Iterator

import numpy as np

from ...projection.typing import Array, BoolArray, IndexArray
from ..common.parallel import parallel_map
from .body_tree import CHILDREN, TRIANGLE, BodyTree, meet, trees_of
from .chord_cells import SLACK, CellTree, cells_of, planes_around

# Cells of all chords that are tested at a time, about.
CELLS_AT_ONCE = 1 << 16

# Pairs of boxes that are tested at a time.
PAIRS = 1 << 16

# Pairs of a cell and a body that are tested at a time.
TESTS = 1 << 12

# Pairs that are tested for each cell, and for each body, at most; a million triangles take 50 a cell. Blocks
# of cells that are still undecided then count as occupied.
MOST_PAIRS_EACH, MOST_PAIRS_BODY = 256, 32

# A box of triangles counts as one of them where it is narrower than this share of a cell.
SMALL = 0.25

# Cells of a block that has planes of its own. Chords are long and narrow, and their boxes mostly empty.
BLOCK = CHILDREN**2


def occupied_chords(ends: Array, bodies: Iterable[Array], slack: float = 0.0) -> BoolArray:
    """Return whether anything may lie in each chord of each cell, (chords, rows, columns).

    ends: (chords + 1, 3, rows + 1, columns + 1), the ends of the chords of the projectors through the cells'
    corners, as the sheets' vertices have them. bodies: arrays of points (K, 3, M) whose hulls are the scene:
    triangles (K = 3), triangles at the start and the end of a straight motion (6), ``boxes_as_bodies`` (8).
    Triangles with a point that is not finite are ignored, as ray tracers do; if another body has one, all
    chords count as occupied. So do all chords of cells with such a corner. slack: a distance within which
    things count as in a cell. Rounding to float32, also of rays, is included without it.
    """
    ends = np.asarray(ends, np.float64)
    occupied = np.zeros((len(ends) - 1, ends.shape[2] - 1, ends.shape[3] - 1), bool)
    lower, upper = _bounds(ends, slack)
    at_once = max(1, CELLS_AT_ONCE // max(1, occupied[0].size))
    groups = [slice(first, min(first + at_once, len(occupied))) for first in range(0, len(occupied), at_once)]
    for points in bodies:
        finite = np.isfinite(points).all(axis=(0, 1))
        if len(points) > TRIANGLE and not finite.all():
            return np.ones_like(occupied)
        whole = np.asarray(points, np.float64)
        for tree in trees_of(whole if finite.all() else whole[:, :, finite], lower, upper):

            def search(group: slice, tree: BodyTree = tree) -> None:
                """Mark the cells of a few chords."""
                cells = cells_of(ends[group.start : group.stop + 1], slack)
                part = occupied[group].reshape(-1)
                held = part[cells.number] & (cells.number >= 0)
                _CellSearch(cells, tree, held).run()
                part[cells.number[held]] = True

            parallel_map(search, groups)
    occupied |= ~_are_finite(ends)
    return occupied


def _bounds(ends: Array, slack: float) -> tuple[Array, Array]:
    """A box around all finite ends, with their slack, (3,) both; without any, lower exceeds upper."""
    finite = np.isfinite(ends).all(axis=1, keepdims=True)
    reach = slack + SLACK * np.abs(ends).max(initial=0.0, where=finite)
    lower = ends.min(axis=(0, 2, 3), initial=np.inf, where=finite) - reach
    upper = ends.max(axis=(0, 2, 3), initial=-np.inf, where=finite) + reach
    return lower, upper


def _are_finite(ends: Array) -> BoolArray:
    """Return whether all corners of each cell are finite, (chords, rows, columns)."""
    finite = np.isfinite(ends).all(axis=1)
    finite = finite[1:] & finite[:-1]
    finite = finite[:, 1:] & finite[:, :-1]
    cells: BoolArray = finite[..., 1:] & finite[..., :-1]
    return cells


class _CellSearch:
    """The search for the cells that bodies meet.

    held: (M,) of the cells in the order of their tree; those that are True are not searched, and those found
    become True.
    """

    def __init__(self, cells: CellTree, tree: BodyTree, held: BoolArray) -> None:
        self._cells, self._tree, self._held = cells, tree, held
        count = len(held)
        first = count + count // CHILDREN
        self._of_block = slice(first, first + count // BLOCK)
        # Of cells, then of the nodes up to the blocks.
        count = self._of_block.stop
        self._planned = np.zeros(count, bool)
        self._normals, self._limits = np.empty((count, 6, 3)), np.empty((count, 6))
        self._width = np.empty(count)

    def run(self) -> None:
        """Find the cells."""
        cells, roots = self._cells.roots, self._tree.roots
        waiting = [(np.repeat(cells, len(roots)), np.tile(roots, len(cells)))]
        left = MOST_PAIRS_EACH * len(self._held) + MOST_PAIRS_BODY * len(self._tree.points)
        while waiting and left > 0:
            # The latest first: what they find spares the others.
            taken, count = [], 0
            while waiting and count < PAIRS:
                taken.append(waiting.pop())
                count += len(taken[-1][0])
            cell, node = (np.concatenate(side) for side in zip(*taken, strict=True))
            if len(cell) > PAIRS:
                waiting.append((cell[PAIRS:], node[PAIRS:]))
                cell, node = cell[:PAIRS], node[:PAIRS]
            waiting.extend(self._step(cell, node))
            left -= len(cell)
        self._hold(np.unique(np.concatenate([np.zeros(0, np.intp), *(cell for cell, _ in waiting)])))

    def _hold(self, blocks: IndexArray) -> None:
        """Mark all cells of blocks, which are those in between in their order."""
        start, level, length = 0, len(self._held), 1
        while len(blocks):
            here = blocks[blocks < start + level]
            cells = (here - start)[:, None] * length + np.arange(length)
            self._held[cells.ravel()] = self._cells.number[cells.ravel()] >= 0
            blocks = blocks[len(here) :]
            start, level, length = start + level, level // CHILDREN, length * CHILDREN

    def _step(self, cell: IndexArray, node: IndexArray) -> Iterator[tuple[IndexArray, IndexArray]]:
        """Test pairs of a block or cell and a node or body; the pairs of children that are left."""
        cells, tree = self._cells, self._tree
        met = np.flatnonzero(meet(cells.boxes.take(cell, 0), tree.boxes.take(node, 0)))
        cell, node = cell.take(met), node.take(met)
        cell, node = self._left_of_blocks(cell, node)
        inner = cells.child.take(cell) >= 0
        body = tree.child.take(node) < 0
        size, block = cells.extent.take(cell), self._are_blocks(cell)
        size[block] = self._width.take(cell[block])
        larger = inner & (body | (size >= tree.extent.take(node)) | (cell < self._of_block.start))
        yield from _expanded(cells.child, cell[larger], node[larger])
        smaller = inner & ~larger
        yield from _swapped(_expanded(tree.child, node[smaller], cell[smaller]))
        single = np.flatnonzero(~inner)
        cell, node, body = cell.take(single), node.take(single), body.take(single)
        left = np.flatnonzero(~self._held.take(cell))
        yield from self._of_cells(cell.take(left), node.take(left), body.take(left))

    def _are_blocks(self, cell: IndexArray) -> BoolArray:
        """Return whether nodes of the tree of cells are blocks."""
        return (cell >= self._of_block.start) & (cell < self._of_block.stop)

    def _left_of_blocks(self, cell: IndexArray, node: IndexArray) -> tuple[IndexArray, IndexArray]:
        """The pairs that still have to be looked at.

        A pair is left out if its node lies beyond a plane of its block, or if all of the block is held.
        """
        some = np.flatnonzero(self._are_blocks(cell))
        if len(some) == 0:
            return cell, node
        held = (self._held | (self._cells.number < 0)).reshape(-1, BLOCK).all(axis=1)
        done = held.take(cell.take(some) - self._of_block.start)
        some, settled = some[~done], some[done]
        self._plan_blocks(cell.take(some))
        beyond = self._beyond_planes(cell.take(some), node.take(some))
        left = np.ones(len(cell), bool)
        left[settled] = left[some[beyond]] = False
        return cell[left], node[left]

    def _plan_blocks(self, block: IndexArray) -> None:
        """Make the planes of blocks that have none yet: those of a cell in each, moved out around all."""
        new = block[~self._planned.take(block)]
        if len(new) == 0:
            return
        new = np.unique(new)
        self._planned[new] = True
        own = (new - self._of_block.start)[:, None] * BLOCK + np.arange(BLOCK)
        # Cells that fill up a block meet nothing, nor do those with a corner that is not finite.
        real = np.isfinite(self._cells.boxes.take(own, 0)[..., 0])
        one = own[np.arange(len(new)), real.argmax(axis=1)]
        corners = self._cells.points.take(self._cells.corner.take(own, 0), 0)
        own_corners = self._cells.points.take(self._cells.corner.take(one, 0), 0)
        normals = planes_around(own_corners, np.zeros(len(new))).normals
        with np.errstate(invalid="ignore"):
            height = np.einsum("mpc,mbkc->bkpm", normals, corners, order="C")
        real = real.T[:, None, None]
        limits = np.where(real, height, -np.inf).max(axis=(0, 1))
        width = (limits - np.where(real, height, np.inf).min(axis=(0, 1))).min(axis=0)
        room = self._cells.room.take(own).max(axis=1, initial=0.0, where=real[:, 0, 0].T)
        self._normals[new], self._limits[new], self._width[new] = normals, (limits + room).T, width

    def _of_cells(
        self, cell: IndexArray, node: IndexArray, body: BoolArray
    ) -> Iterator[tuple[IndexArray, IndexArray]]:
        """Test pairs of a cell and a node or body whose boxes meet; yield the children's pairs."""
        if len(cell) == 0:
            return
        self._plan(cell)
        outside = np.flatnonzero(~self._beyond_planes(cell, node))
        cell, node, body = cell.take(outside), node.take(outside), body.take(outside)
        small = ~body & (self._tree.extent.take(node) <= SMALL * self._width.take(cell))
        self._held[cell[small]] = True
        some = np.flatnonzero(body)
        self._test(cell.take(some), node.take(some))
        left = ~body & ~small
        left &= ~self._held.take(cell)
        yield from _swapped(_expanded(self._tree.child, node[left], cell[left]))

    def _plan(self, cell: IndexArray) -> None:
        """Make the planes of cells that have none yet."""
        new = cell[~self._planned.take(cell)]
        if len(new):
            new = np.unique(new)
            self._planned[new] = True
            corners = self._cells.points.take(self._cells.corner.take(new, 0), 0)
            planes = planes_around(corners, self._cells.room.take(new))
            self._normals[new], self._limits[new], self._width[new] = planes

    def _beyond_planes(self, cell: IndexArray, node: IndexArray) -> BoolArray:
        """Return whether boxes of nodes are outside of a plane of the cell."""
        rows = self._tree.boxes.take(node, 0).astype(np.float64)
        low, high = rows[:, 3:6], -rows[:, :3]
        middle, half = 0.5 * (low + high), 0.5 * (high - low)
        normals = self._normals.take(cell, 0)
        # Short axes first: NumPy reduces those several times as fast.
        nearest = np.einsum("npc,nc->pn", normals, middle, order="C")
        nearest -= np.einsum("npc,nc->pn", np.abs(normals, out=normals), half)
        beyond: BoolArray = (nearest > self._limits.take(cell, 0).T).any(axis=0)
        return beyond

    def _test(self, cell: IndexArray, body: IndexArray) -> None:
        """Mark the cells that no plane separates from their bodies."""
        for start in range(0, len(cell), TESTS):
            some = slice(start, start + TESTS)
            # What the pairs before have found spares the others.
            left = np.flatnonzero(~self._held.take(cell[some]))
            self._test_pairs(cell[some].take(left), body[some].take(left))

    def _test_pairs(self, cell: IndexArray, body: IndexArray) -> None:
        """Mark the cells of so few pairs that the arrays stay in a core's cache."""
        points = np.ascontiguousarray(self._tree.points.take(body, 0).transpose(1, 2, 0))
        room = self._tree.room.take(body)
        normals = np.ascontiguousarray(self._normals.take(cell, 0).transpose(1, 2, 0))
        least = np.einsum("pcn,kcn->kpn", normals, points).min(axis=0) - room
        left = np.flatnonzero((least <= self._limits.take(cell, 0).T).all(axis=0))
        cell = cell.take(left)
        if len(points) == TRIANGLE:
            corners = self._cells.points.take(self._cells.corner.take(cell, 0), 0)
            room = room.take(left) + self._cells.room.take(cell)
            corners = np.ascontiguousarray(corners.transpose(1, 2, 0))
            cell = cell[~separated(corners, points.take(left, axis=2), room)]
        self._held[cell] = True


def separated(corners: Array, triangles: Array, room: Array) -> BoolArray:
    """Return whether the triangle's plane, or one along an edge and the chord, parts it from a cell, (N,).

    corners: (CORNERS, 3, N) of the cells. triangles: (3, 3, N), by corner. room: (N,) the least distance.
    """
    corners = corners - triangles[0]
    first, second, third = (triangles[(k + 1) % 3] - triangles[k] for k in range(3))
    along = corners[4:].sum(axis=0) - corners[:4].sum(axis=0)
    apart: BoolArray = np.zeros(corners.shape[2], bool)
    pairs = ((first, second), *((edge, along) for edge in (first, second, third)))
    for normal in (np.cross(*pair, axis=0) for pair in pairs):
        # Any normal will do, however rounded: the heights of both are compared.
        height = np.einsum("cn,kcn->kn", normal, corners)
        at_second, at_third = (normal * first).sum(axis=0), -(normal * third).sum(axis=0)
        reach = room * np.sqrt((normal * normal).sum(axis=0))
        apart |= height.min(axis=0) > np.maximum(np.maximum(at_second, at_third), 0.0) + reach
        apart |= height.max(axis=0) < np.minimum(np.minimum(at_second, at_third), 0.0) - reach
    return apart


def _expanded(
    child: IndexArray, parent: IndexArray, other: IndexArray
) -> Iterator[tuple[IndexArray, IndexArray]]:
    """The pairs of the children of each parent and its partner, if there are any."""
    if len(parent):
        yield (child.take(parent)[:, None] + np.arange(CHILDREN)).ravel(), np.repeat(other, CHILDREN)


def _swapped(pairs: Iterator[tuple[IndexArray, IndexArray]]) -> Iterator[tuple[IndexArray, IndexArray]]:
    """Pairs the other way round."""
    return ((b, a) for a, b in pairs)
