# SPDX-License-Identifier: GPL-3.0-or-later
"""Presets for tests of which each costs seconds: those that the demo shows."""

import pathlib

FOLDER = pathlib.Path(__file__).resolve().parents[3] / "presets"
PRESETS = [
    FOLDER / f"{stem}.json"
    for stem in (
        "angular_fisheye",
        "around_the_car",
        "cylindrical_panorama",
        "inverted_perspective",
        "nonlinear_twist",
        "orthographic",
        "perspective",
    )
]
