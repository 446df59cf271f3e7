# SPDX-License-Identifier: GPL-3.0-or-later
"""The colours of the lines of a volume, by their role and by the background, and of layers in an image."""

from __future__ import annotations

from typing import Literal, TypeAlias

import numpy as np

from ..colors import LUMINANCE, linear_from_srgb

# ISO: a surface of equal t. FOLDED: dashes all over where the volume is inside out. FOLD: a projector there.
# FAR: the rim of the far surface. SAFE: safe areas of the image. FRAME: the image on the near surface. U, V:
# where u and v grow. PICK: the projector that was asked for.
Role: TypeAlias = Literal[
    "ISO", "SURFACE", "FOLDED", "PROJECTOR", "FOLD", "FAR", "SAFE", "FRAME", "U", "V", "PICK"
]
Color: TypeAlias = tuple[float, float, float, float]

# Display colours of layers in an image, of what is in no layer, and of empty pixels: about those of Okabe and
# Ito (Color Universal Design, 2008). They differ for colour-blind eyes as well.
LAYERS = (
    (0.90, 0.62, 0.00),
    (0.34, 0.71, 0.91),
    (0.78, 0.28, 0.00),
    (0.98, 0.94, 0.45),
    (0.00, 0.45, 0.70),
    (0.94, 0.58, 0.70),
    (0.00, 0.58, 0.42),
)
REST, EMPTY = (0.30, 0.30, 0.30), (0.08, 0.08, 0.08)

# Display colours (sRGB), red green blue alpha, for dark and for light backgrounds. Blender's
# light theme has a 3D viewport of medium grey: the bright colours serve it too. What may lie
# side by side (SURFACE, PROJECTOR, FOLD, U, V, PICK) differs for colour-blind eyes as well.
BRIGHT: dict[Role, Color] = {
    "ISO": (0.48, 0.78, 0.50, 1.0),
    "SURFACE": (0.25, 1.00, 0.45, 1.0),
    "FOLDED": (0.94, 0.44, 0.42, 1.0),
    "PROJECTOR": (0.36, 0.62, 1.00, 1.0),
    "FOLD": (0.96, 0.45, 0.47, 1.0),
    "FAR": (0.10, 0.85, 0.55, 1.0),
    "SAFE": (0.80, 0.88, 0.62, 1.0),
    "FRAME": (0.55, 1.00, 0.40, 1.0),
    "U": (1.00, 0.57, 0.00, 1.0),
    "V": (0.91, 0.44, 0.67, 1.0),
    "PICK": (0.98, 1.00, 0.04, 1.0),
}
DARK: dict[Role, Color] = {
    "ISO": (0.14, 0.36, 0.16, 1.0),
    "SURFACE": (0.08, 0.41, 0.34, 1.0),
    "FOLDED": (0.40, 0.06, 0.12, 1.0),
    "PROJECTOR": (0.08, 0.22, 0.80, 1.0),
    "FOLD": (0.32, 0.07, 0.12, 1.0),
    "FAR": (0.00, 0.35, 0.22, 1.0),
    "SAFE": (0.24, 0.30, 0.04, 1.0),
    "FRAME": (0.02, 0.40, 0.02, 1.0),
    "U": (0.38, 0.12, 0.00, 1.0),
    "V": (0.29, 0.00, 0.34, 1.0),
    "PICK": (0.43, 0.37, 0.03, 1.0),
}
# Backgrounds of a higher relative luminance get the dark lines: there black and the blue that
# projectors have stand out equally.
LIGHT_BACKGROUND = 0.26


def line_colors(background: tuple[float, float, float]) -> dict[Role, Color]:
    """The colours that show on a background, a display colour, (red, green, blue) in [0, 1]."""
    return DARK if luminance(background) > LIGHT_BACKGROUND else BRIGHT


def luminance(color: tuple[float, ...]) -> float:
    """Relative luminance of a display colour, 0 black to 1 white (WCAG 2.1, "relative luminance")."""
    return float(LUMINANCE @ linear_from_srgb(np.array(color[:3])))
