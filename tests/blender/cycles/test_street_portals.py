# SPDX-License-Identifier: GPL-3.0-or-later
"""The portals that rays of each preset pass on the demo's street: what its light costs in Cycles."""

from benchmarks import counts
from benchmarks.street import portals_passed

# Blender's versions round the street's vertices differently.
SLACK = 0.01


def test_portals_on_the_street_are_those_of_the_file():
    """After an intended change run `python3 dev.py bench --counts --write`."""
    assert counts.differences(portals_passed.counted(), counts.kept(street=True), SLACK) == []
