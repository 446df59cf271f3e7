# SPDX-License-Identifier: GPL-3.0-or-later
"""Offsets in space in pixels, against the solution of the 2 × 2 equations."""

import numpy as np
import pytest

from scfpf_addon.casting.curves.sampled_curves import MOST_SQUEEZE, Curves, across
from scfpf_addon.cycles.chords.pixel_footprint import pixels
from scfpf_addon.projection.volume.basis import span_basis

PLACES = np.array([0.0, 0.3, 1.0])


def projectors(generator, squeeze):
    """Straight projectors between two surfaces, with pixels squeezed in one direction."""
    start, end = generator.normal(size=(2, 3, 40))
    dx, dy = generator.normal(size=(2, 1, 3, 40))
    dy = dx * generator.normal(size=40) + squeeze * dy
    points = np.stack([start, end + 5.0])
    return Curves(points, dx.repeat(2, axis=0), dy.repeat(2, axis=0))


@pytest.mark.parametrize("squeeze", [1.0, 0.2])
def test_ways_across_are_counted_in_pixels(squeeze):
    generator = np.random.default_rng(4)
    curves = projectors(generator, squeeze)
    spans = span_basis("BEZIER", 2)
    there = pixels(curves, spans, 0, PLACES)
    ways = generator.normal(size=(2, len(PLACES), 40))
    for group in range(len(PLACES)):
        for number in range(40):
            tangent = there.tangent[:, group, number]
            dx, dy = (
                across(c[0, :, number][:, None, None], tangent[:, None, None])[:, 0, 0] for c in curves[1:]
            )
            if np.linalg.cond(np.stack([dx, dy], axis=1)) > 0.9 * MOST_SQUEEZE:
                continue
            a, b = ways[:, group, number]
            offset = np.zeros_like(there.position)
            # The part along the projector does not count.
            offset[:, group, number] = a * dx + b * dy + 3.0 * tangent
            assert there.moved(offset)[group, number] == pytest.approx(np.hypot(a, b), rel=1e-6)


def test_squeezed_pixels_count_as_less_squeezed():
    generator = np.random.default_rng(4)
    curves = projectors(generator, 0.0)
    there = pixels(curves, span_basis("BEZIER", 2), 0, PLACES)
    assert there.narrow == pytest.approx(there.wide / MOST_SQUEEZE)
    offset = np.cross(there.tangent, there.widest, axis=0)
    length = np.linalg.norm(offset, axis=0)
    assert there.moved(offset) == pytest.approx(length / there.narrow)


def test_where_all_pixels_are_one_point_nothing_is_not_a_number():
    """A volume begins in a point at the origin, where offsets are no number of pixels."""
    curves = projectors(np.random.default_rng(4), 1.0)
    for control in curves:
        control[0] = 0.0
    there = pixels(curves, span_basis("BEZIER", 2), 0, PLACES)
    for offset in (np.zeros_like(there.position), 1e-3 * there.position):
        moved = there.moved(offset)
        assert np.isfinite(moved).all() and (moved[0] == 0.0).all()
