# SPDX-License-Identifier: GPL-3.0-or-later
"""Ready-made styles: values of ``Scene.scfpf_drawn``. Properties that a style omits get their defaults."""

from __future__ import annotations

import math
from typing import NamedTuple


class Style(NamedTuple):
    """A look for the menu. values: by names of properties of ``SCFPF_Drawn``."""

    name: str
    description: str
    values: dict[str, object]


STYLES = {
    "PAPER": Style(
        "Paper Look",
        "Thin dark lines, light flat shades and white paper, as in the paper on flexible projection",
        {
            "line_width": 1.6,
            "inner_width": 0.9,
            "steps": 3,
            "darkest": 0.55,
            "fade": 0.35,
            "use_material": True,
            "crease_angle": math.radians(40),
        },
    ),
    "LINES": Style(
        "Line Drawing", "Black lines on white paper and nothing else", {"fill": "PAPER", "use_material": True}
    ),
    "INK": Style(
        "Pen and Ink",
        "Black lines and cross-hatched shadows on cream paper",
        {
            "fill": "PAPER",
            "use_material": True,
            "exposure": -0.7,
            "hatching": "TONE",
            "hatch_width": 1.0,
            "hatch_spacing": 5.0,
            "paper_color": (0.88, 0.8, 0.66),
        },
    ),
    "DEPTH": Style(
        "Lines of Equal t",
        "Cuts through the viewing volume drawn on everything that is in it",
        {
            "fill": "PAPER",
            "use_material": True,
            "hatching": "DEPTH",
            "hatch_count": 120,
            "hatch_width": 0.8,
            "hatch_color": (0.05, 0.15, 0.5),
        },
    ),
    "CARTOON": Style(
        "Cartoon",
        "Thick outlines and full colors in two shades",
        {"line_width": 3.5, "inner_width": 1.5, "steps": 2, "darkest": 0.5, "use_material": True},
    ),
}


def apply_style(scene, identifier: str, plain_view: bool = True) -> None:
    """Switch Drawn Style on in a scene, with the values of a style.

    plain_view: choose the view transform that shows colours unchanged. Raises KeyError for an unknown style.
    """
    style, options = STYLES[identifier], scene.scfpf_drawn
    for name in options.bl_rna.properties.keys():
        if name not in ("rna_type", "name"):
            options.property_unset(name)
    for name, value in style.values.items():
        setattr(options, name, value)
    options.use_drawn = True
    if plain_view:
        scene.view_settings.view_transform = "Standard"
        scene.view_settings.look = "None"
