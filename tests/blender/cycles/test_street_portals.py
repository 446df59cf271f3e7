# SPDX-License-Identifier: GPL-3.0-or-later
"""The portals that rays of each preset pass on the demo's street: what its light costs in Cycles."""

from benchmarks import counts
from benchmarks.street import portals_passed
from scfpf_addon.cycles.chord_planning import BYTES_PER_VERTEX

# Blender's versions round the street's vertices differently.
SLACK = 0.01
# Bytes of the sheets of an image.
MOST_MEMORY = 100e6


def test_portals_on_the_street_are_those_of_the_file():
    """After an intended change run `python3 dev.py bench --counts --write`."""
    counted = portals_passed.counted()
    assert counts.differences(counted, counts.kept(street=True), SLACK) == []
    vertices = counted[f"vertices of sheets{counts.STREET}"]
    assert max(vertices.values()) * BYTES_PER_VERTEX < MOST_MEMORY
