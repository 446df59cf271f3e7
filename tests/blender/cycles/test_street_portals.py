# SPDX-License-Identifier: GPL-3.0-or-later
"""The portals that rays of each preset pass on the demo's street: what its light costs in Cycles."""

from benchmarks import counts
from benchmarks.street import portals_passed
from scfpf_addon.cycles.prices import BYTES_PER_VERTEX

# Blender's versions round the street's vertices differently.
SLACK = 0.01
# Bytes of the sheets of an image.
MOST_MEMORY = 110e6
# The presets whose sheets are made: one that looks all round, and the two with the most vertices. Of the
# others, faces that they need are counted.
SHEETS = ("equirectangular", "mirror_ball", "sample_rate_lens")


def test_portals_on_the_street_are_those_of_the_file():
    """After an intended change run `python3 dev.py bench --counts --write`."""
    counted, kept = portals_passed.counted(SHEETS), counts.kept(street=True)
    title = f"vertices of sheets{counts.STREET}"
    assert set(sorted(kept[title], key=kept[title].get)[-2:]) < set(SHEETS) <= set(kept[title])
    kept[title] = {stem: kept[title][stem] for stem in SHEETS}
    assert counts.differences(counted, kept, SLACK) == []
    vertices = counted[title]
    assert max(vertices.values()) * BYTES_PER_VERTEX < MOST_MEMORY
