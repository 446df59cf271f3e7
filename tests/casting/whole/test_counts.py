# SPDX-License-Identifier: GPL-3.0-or-later
"""Rays, chords, tests and samples of fixed scenes stay what they were: the regression check of speed."""

import platform
import sys

from benchmarks import counts

# Zero where the file is made: two Pythons, two NumPys and processors with and without AVX-512 count alike
# there. Elsewhere sines differ in their last bit and Embree has other instructions.
SAME_MACHINE = sys.platform == "linux" and platform.machine() == "x86_64"
SLACK = 0.0 if SAME_MACHINE else 0.005


def test_counts_are_those_of_the_file():
    """After an intended change run `python3 dev.py bench --counts --write`."""
    assert counts.differences(counts.counted(), counts.kept(), SLACK) == []


def test_a_difference_is_said():
    before = {"a": {"rays": 100, "hits": 0}, "b": {"rays": 1}}
    now = {"a": {"rays": 103, "hits": 2}, "c": {"rays": 1}}
    assert counts.differences(now, before) == [
        "a: 103 rays instead of 100 (+3.0%)",
        "a: 2 hits instead of 0",
        "b: no longer there",
        "c: not there before",
    ]
    assert counts.differences(before, before) == []
    assert counts.differences(now, before, 0.05) == [
        "a: 2 hits instead of 0",
        "b: no longer there",
        "c: not there before",
    ]
