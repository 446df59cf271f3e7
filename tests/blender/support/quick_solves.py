# SPDX-License-Identifier: GPL-3.0-or-later
"""Solves of Aim for tests that are about Blender, not about the rounds."""

import math


def quicken(addon, monkeypatch, columns=64):
    """One way of solving, judged by a small image."""
    targets, rounds = addon("bridge.aim.solve_targets"), addon("aim.rounds")
    monkeypatch.setattr(targets, "COLUMNS", columns)
    # A busy machine finds the same as an idle one.
    monkeypatch.setattr(targets, "BUDGET", math.inf)
    monkeypatch.setattr(rounds, "other_ways", lambda first: [])
    monkeypatch.setattr(rounds, "MENDABLE", 0.0)
