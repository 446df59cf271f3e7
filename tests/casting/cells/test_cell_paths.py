# SPDX-License-Identifier: GPL-3.0-or-later
"""Paths of cells compared with rays that are followed one by one."""

import numpy as np
import pytest

from scfpf_addon.casting.cells.cell_paths import needed_faces, next_chords, portals_passed


def followed(occupied, row, column):
    """The chords along which a ray of a cell travels."""
    return [k for k in range(len(occupied)) if occupied[k, row, column]]


@pytest.mark.parametrize("share", [0.0, 0.1, 0.6, 1.0])
def test_tables_say_what_rays_do(share):
    generator = np.random.default_rng(5)
    occupied = generator.random((9, 6, 7)) < share
    following, faces = next_chords(occupied), needed_faces(occupied)
    assert following.shape == faces.shape == (10, 6, 7)
    for row in range(6):
        for column in range(7):
            chords, place = [], following[0, row, column]
            while place < 9:
                chords.append(int(place))
                place = following[place + 1, row, column]
            assert chords == followed(occupied, row, column)
            around = slice(max(row - 1, 0), row + 2), slice(max(column - 1, 0), column + 2)
            near = {k for k in range(9) if occupied[k][around].any()}
            assert set(np.flatnonzero(faces[1:, row, column])) == near
    assert faces[0].all()
    row, column, chord = (generator.integers(0, n, 200) for n in (6, 7, 10))
    passed = portals_passed(occupied, row, column, chord)
    assert passed.tolist() == [
        1 + sum(k < end for k in followed(occupied, r, c))
        for r, c, end in zip(row, column, chord, strict=True)
    ]


def test_many_chords_fit():
    occupied = np.zeros((1000, 1, 1), bool)
    occupied[999] = True
    assert next_chords(occupied)[0] == 999 and next_chords(occupied)[1000] == 1000
