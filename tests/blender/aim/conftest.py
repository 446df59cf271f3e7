# SPDX-License-Identifier: GPL-3.0-or-later
"""Fixtures of the tests of Aim."""

import os
import sys

import bpy
import numpy as np
import pytest
from quick_solves import quicken

sys.path.append(os.path.join(os.path.dirname(os.path.abspath(__file__)), "support"))


@pytest.fixture(autouse=True)
def quick_solves(addon, monkeypatch):
    """See ``quicken``."""
    quicken(addon, monkeypatch)


@pytest.fixture
def places(addon, reading):
    """The image positions in pixels, (N, 2), at which a flexible camera shows world points (N, 3)."""
    inverse = addon("projection.volume.inverse")

    def found(camera, points):
        projection = reading.read_projection(camera, bpy.context.evaluated_depsgraph_get(), 960 / 540)
        place = inverse.find_in_image(projection, np.array(points, np.float64).T)
        assert place.found.all()
        return np.stack([place.x * 960, place.y * 540], axis=1)

    return found
