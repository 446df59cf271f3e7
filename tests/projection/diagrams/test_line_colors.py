# SPDX-License-Identifier: GPL-3.0-or-later
"""The colours of lines side by side and of layers differ, also for eyes without one of the cones.

Protanopia and deuteranopia are simulated after Viénot, Brettel and Mollon, Digital Video Colourmaps for
Checking the Legibility of Displays by Dichromats (Color Research and Application 24, 1999). Differences are
those of CIE 1976.
"""

import itertools

import numpy as np
import pytest

from scfpf_addon.projection.diagrams.line_colors import BRIGHT, DARK, EMPTY, LAYERS, REST

SIDE_BY_SIDE = ("SURFACE", "PROJECTOR", "FOLD", "U", "V", "PICK")
# Ten times a just noticeable difference of about 2.
DIFFERENT = 20.0
CONES = np.array([[17.8824, 43.5161, 4.11935], [3.45565, 27.1554, 3.86714], [0.0299566, 0.184309, 1.46709]])
EYES = {
    "all cones": np.eye(3),
    "protanopia": np.array([[0, 2.02344, -2.52581], [0, 1, 0], [0, 0, 1]]),
    "deuteranopia": np.array([[1, 0, 0], [0.494207, 0, 1.24827], [0, 0, 1]]),
}
# From linear sRGB to CIE XYZ, and the white of D65 (IEC 61966-2-1).
XYZ = np.array([[0.4124, 0.3576, 0.1805], [0.2126, 0.7152, 0.0722], [0.0193, 0.1192, 0.9505]])
WHITE = np.array([0.9505, 1.0, 1.089])


def seen(color, eye):
    """Linear sRGB of a display colour as an eye sees it."""
    value = np.array(color[:3])
    linear = np.where(value <= 0.04045, value / 12.92, ((value + 0.055) / 1.055) ** 2.4)
    return np.clip(np.linalg.solve(CONES, EYES[eye] @ CONES @ linear), 0, 1)


def lab(linear):
    """CIE L*a*b* of linear sRGB."""
    share = XYZ @ linear / WHITE
    x, y, z = np.where(share > 216 / 24389, np.cbrt(share), (24389 / 27 * share + 16) / 116)
    return np.array([116 * y - 16, 500 * (x - y), 200 * (y - z)])


def test_the_simulation_keeps_greys_and_confuses_red_and_green():
    assert lab(seen((1, 1, 1), "all cones")) == pytest.approx([100, 0, 0], abs=0.05)
    for eye in ("protanopia", "deuteranopia"):
        assert np.ptp(seen((0.5, 0.5, 0.5), eye)) < 2e-3
        red, green, blue = (seen(color, eye) for color in np.eye(3))
        assert red[0] == pytest.approx(red[1], abs=0.03) and green[0] == pytest.approx(green[1], abs=0.03)
        assert blue[2] > 0.9


@pytest.mark.parametrize("eye", EYES)
@pytest.mark.parametrize("colors", [BRIGHT, DARK], ids=["bright", "dark"])
def test_lines_side_by_side_differ_for_every_eye(colors, eye):
    for one, other in itertools.combinations(SIDE_BY_SIDE, 2):
        difference = np.linalg.norm(lab(seen(colors[one], eye)) - lab(seen(colors[other], eye)))
        assert difference >= DIFFERENT, (one, other)


@pytest.mark.parametrize("eye", EYES)
def test_layers_differ_for_every_eye(eye):
    for one, other in itertools.combinations((*LAYERS, REST, EMPTY), 2):
        assert np.linalg.norm(lab(seen(one, eye)) - lab(seen(other, eye))) >= DIFFERENT, (one, other)
