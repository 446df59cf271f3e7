# SPDX-License-Identifier: GPL-3.0-or-later
"""Medians, against NumPy's."""

import numpy as np
from hypothesis import given
from hypothesis import strategies as st
from hypothesis.extra.numpy import array_shapes, arrays

from scfpf_addon.projection.arrays import median


@given(arrays(float, array_shapes(max_dims=2), elements=st.floats(-1e300, 1e300) | st.just(np.nan)))
def test_medians_are_numpys(values):
    np.testing.assert_array_equal(median(values), np.median(values, axis=0))
