# SPDX-License-Identifier: GPL-3.0-or-later
"""The times of pixels: each pixel is in one step, whose middle is nearest to its time."""

import numpy as np
import pytest

from scfpf_addon.shading.time_map import IMAGE, ROLLING, SLIT, shares_of_time, time_steps


@pytest.mark.parametrize("way", [ROLLING, SLIT, IMAGE])
@pytest.mark.parametrize("count", [1, 3, 7, 100])
def test_each_pixel_is_in_one_step_that_is_near_its_time(way, count):
    painted = np.random.default_rng(2).uniform(-0.2, 1.2, (5, 4))
    shares = shares_of_time(way, (31, 17), painted)
    assert shares.shape == (17, 31) and shares.min() >= 0 and shares.max() <= 1
    seen, time = np.zeros((17, 31), int), np.zeros((17, 31))
    for step in time_steps(shares, count):
        part = slice(step.border.bottom, step.border.top), slice(step.border.left, step.border.right)
        seen[part] += step.shown
        time[part] += step.share * step.shown
        # No border is larger than it need be.
        assert step.shown.any(axis=1)[[0, -1]].all() and step.shown.any(axis=0)[[0, -1]].all()
    assert (seen == 1).all()
    assert (np.abs(time - shares) <= 0.5 / count + 1e-12).all()


def test_values_that_are_no_numbers_are_the_present():
    assert (shares_of_time(IMAGE, (3, 2), np.full((2, 2), np.nan)) == 0).all()
