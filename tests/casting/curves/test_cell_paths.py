# SPDX-License-Identifier: GPL-3.0-or-later
"""Paths of cells compared with rays that are followed one by one."""

import numpy as np
import pytest

from scfpf_addon.cycles.portals.paths import needed_faces, next_chords, portals_passed

CHORDS, ROWS, COLUMNS = 9, 6, 7


def made(seed, share):
    """Random occupied chords."""
    return np.random.default_rng(seed).random((CHORDS, ROWS, COLUMNS)) < share


@pytest.mark.parametrize("share", [0.0, 0.1, 0.6, 1.0])
def test_tables_say_what_rays_do(share):
    occupied = made(5, share)
    onward, faces = next_chords(occupied), needed_faces(occupied)
    rays = {(r, c): [k for k in range(CHORDS) if occupied[k, r, c]] for r, c in np.ndindex(ROWS, COLUMNS)}
    for (row, column), ray in rays.items():
        chords, place = [], 0
        while onward[place, row, column] < CHORDS:
            chords.append(int(onward[place, row, column]))
            place = chords[-1] + 1
        assert chords == ray
        near = [rays.get((row + y, column + x), []) for y in (-1, 0, 1) for x in (-1, 0, 1)]
        for place in range(1, CHORDS + 1):
            assert faces[place, row, column] == any(place - 1 in other for other in near)
    assert faces[0].all()
    generator = np.random.default_rng(1)
    row, column, chord = (generator.integers(0, n, 200) for n in (ROWS, COLUMNS, CHORDS + 1))
    passed = [1 + sum(k < hit for k in rays[r, c]) for r, c, hit in zip(row, column, chord, strict=True)]
    assert portals_passed(occupied, row, column, chord).tolist() == passed


def test_rays_that_rounding_moves_into_neighbours_meet_faces_and_skip_only_what_is_empty():
    generator = np.random.default_rng(8)
    occupied = made(8, 0.3)
    onward, faces = next_chords(occupied), needed_faces(occupied)
    hops = 0
    for _ in range(3000):
        cell = np.array([generator.integers(ROWS), generator.integers(COLUMNS)])
        place = 0
        while place < CHORDS:
            start = int(onward[(place, *cell)])
            assert start >= place and not occupied[(slice(place, start), *cell)].any()
            if start == CHORDS:
                break
            assert occupied[(start, *cell)]
            # On to the face there, or to a neighbour's.
            hop = cell + generator.integers(-1, 2, 2)
            if ((hop >= 0) & (hop < (ROWS, COLUMNS))).all():
                hops += int((hop != cell).any())
                cell = hop
            place = start + 1
            assert faces[(place, *cell)]
    assert hops > 1000


def test_many_chords_fit():
    occupied = np.zeros((1000, 1, 1), bool)
    occupied[999] = True
    onward = next_chords(occupied)
    assert onward[0] == 999 and onward[1000] == 1000
