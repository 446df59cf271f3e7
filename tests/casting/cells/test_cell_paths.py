# SPDX-License-Identifier: GPL-3.0-or-later
"""Paths of cells compared with rays that are followed one by one."""

import numpy as np
import pytest

from scfpf_addon.casting.cells.cell_paths import cell_paths, needed_faces, next_chords

CHORDS, ROWS, COLUMNS = 9, 6, 7


def made(seed, share, joined):
    """Random occupied chords, and their ends where some runs are joined, or None."""
    generator = np.random.default_rng(seed)
    occupied = generator.random((CHORDS, ROWS, COLUMNS)) < share
    if not joined:
        return occupied, None
    last = np.zeros(occupied.shape, np.int16)
    for row, column in np.ndindex(ROWS, COLUMNS):
        for k in reversed(range(CHORDS)):
            goes_on = k + 1 < CHORDS and occupied[k : k + 2, row, column].all() and generator.random() < 0.6
            last[k, row, column] = last[k + 1, row, column] if goes_on else k + 1
    return occupied, last


def followed(occupied, last, row, column):
    """The chords along which a ray of a cell travels: (break, break)."""
    chords, place = [], 0
    while place < CHORDS:
        if occupied[place, row, column]:
            chords.append((place, place + 1 if last is None else int(last[place, row, column])))
            place = chords[-1][1]
        else:
            place += 1
    return chords


@pytest.mark.parametrize("share", [0.0, 0.1, 0.6, 1.0])
@pytest.mark.parametrize("joined", [False, True])
def test_tables_say_what_rays_do(share, joined):
    occupied, last = made(5, share, joined)
    paths = cell_paths(occupied, last)
    rays = {cell: followed(occupied, last, *cell) for cell in np.ndindex(ROWS, COLUMNS)}
    for (row, column), ray in rays.items():
        chords, place = [], 0
        while paths.start[place, row, column] < CHORDS:
            chords.append((int(paths.start[place, row, column]), int(paths.end[place, row, column])))
            place = chords[-1][1]
        assert chords == ray
        assert set(np.flatnonzero(paths.arrives[:, row, column])) == {0, *(end for _, end in ray)}
        near = [rays.get((row + y, column + x), []) for y in (-1, 0, 1) for x in (-1, 0, 1)]
        for place in range(1, CHORDS + 1):
            starts = [start for other in near for start, end in other if end == place]
            assert paths.faces[place, row, column] == bool(starts)
            assert paths.origin[place, row, column] == min(starts, default=CHORDS)
    assert paths.faces[0].all() and not paths.origin[0].any()
    generator = np.random.default_rng(1)
    row, column, chord = (generator.integers(0, n, 200) for n in (ROWS, COLUMNS, CHORDS + 1))
    passed = [
        1 + sum(end <= hit for _, end in rays[r, c]) for r, c, hit in zip(row, column, chord, strict=True)
    ]
    assert paths.portals_passed(row, column, chord).tolist() == passed


def test_the_tables_without_joined_chords_are_the_same():
    occupied, _ = made(3, 0.3, False)
    paths = cell_paths(occupied)
    assert np.array_equal(next_chords(occupied), paths.start)
    assert np.array_equal(needed_faces(occupied), paths.faces)


@pytest.mark.parametrize("joined", [False, True])
def test_rays_that_rounding_moves_into_neighbours_meet_faces_and_skip_only_what_is_empty(joined):
    generator = np.random.default_rng(8)
    occupied, last = made(8, 0.3, joined)
    paths = cell_paths(occupied, last)
    hops = 0
    for _ in range(3000):
        cell = np.array([generator.integers(ROWS), generator.integers(COLUMNS)])
        place = 0
        while place < CHORDS:
            here = (place, *cell)
            start, end = int(paths.start[here]), int(paths.end[here])
            assert start >= place and not occupied[(slice(place, start), *cell)].any()
            if start == CHORDS:
                break
            assert end > start and occupied[(slice(start, end), *cell)].all()
            # On to the face there, or to a neighbour's.
            hop = cell + generator.integers(-1, 2, 2)
            if ((hop >= 0) & (hop < (ROWS, COLUMNS))).all():
                hops += int((hop != cell).any())
                cell = hop
            place = end
            assert paths.faces[(place, *cell)] and paths.origin[(place, *cell)] <= start
    assert hops > 1000


def test_many_chords_fit():
    occupied = np.zeros((1000, 1, 1), bool)
    occupied[999] = True
    paths = cell_paths(occupied)
    assert paths.start[0] == 999 and paths.start[1000] == 1000 and paths.end[0] == 1000
