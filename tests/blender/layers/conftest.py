# SPDX-License-Identifier: GPL-3.0-or-later
"""The scene of the tests of image layers through Cycles."""

import pytest
from layer_scenes import fill


@pytest.fixture(name="scene")
def layers_scene(engine_scene):
    """A cube on a floor before a second one, seen by a flexible camera."""
    fill(engine_scene)
    return engine_scene
