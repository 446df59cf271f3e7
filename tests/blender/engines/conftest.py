# SPDX-License-Identifier: GPL-3.0-or-later
"""What tests of other engines' pictures share."""

import pytest


@pytest.fixture
def jobs(addon):
    """The module of the jobs that join pictures."""
    return addon("engines.anchors_job")
