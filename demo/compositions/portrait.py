# SPDX-License-Identifier: GPL-3.0-or-later
"""A cubist portrait: eyes, nose, mouth and ear, each from where it is best seen, joined along hard seams.

Collomosse and Hall, Cubist Style Rendering from Photographs (TVCG 2003).
"""

from __future__ import annotations

import numpy as np

from ..mesh import MeshBuilder, material, place
from ..street import daylight
from .parts import add_camera, blended, new_scene, pinned
from .town import group

SIZE = (640, 800)
PAINTS = {
    "Skin": (0.68, 0.40, 0.27),
    "Hair": (0.05, 0.022, 0.012),
    "Lips": (0.52, 0.07, 0.06),
    "White": (0.78, 0.76, 0.72),
    "Iris": (0.06, 0.20, 0.16),
    "Black": (0.01, 0.01, 0.01),
    "Dress": (0.10, 0.16, 0.36),
    "Band": (0.70, 0.42, 0.06),
}
# The face looks to -y. Balls of the head: middle and radii.
HEAD = (
    ((0.0, 0.10, 0.22), (0.86, 1.02, 0.92)),
    ((0.0, -0.08, -0.22), (0.72, 0.80, 0.86)),
    ((0.0, -0.52, -0.92), (0.26, 0.24, 0.20)),
    ((0.0, -0.20, -0.72), (0.50, 0.55, 0.42)),
    ((0.34, -0.62, -0.30), (0.26, 0.20, 0.24)),
    ((-0.34, -0.62, -0.30), (0.26, 0.20, 0.24)),
    ((0.0, -0.80, 0.22), (0.52, 0.14, 0.12)),
    ((0.0, 0.10, -1.3), (0.36, 0.36, 0.75)),
    ((0.0, 0.14, -1.95), (1.25, 0.50, 0.42)),
)
NOSE = (
    *(
        ((0.0, -0.84 - 0.40 * s**1.3, 0.20 - 0.58 * s), (0.085 + 0.06 * s, 0.13 + 0.02 * s, 0.12))
        for s in np.linspace(0, 1, 12)
    ),
    ((0.0, -0.84, -0.26), (0.17, 0.26, 0.28)),
    ((0.12, -1.05, -0.40), (0.10, 0.14, 0.08)),
    ((-0.12, -1.05, -0.40), (0.10, 0.14, 0.08)),
)


def build():
    """A bust, and its portrait from six sides."""
    scene = new_scene(*SIZE)
    _bust(scene)
    scene.camera = compose(scene)
    return scene


def compose(scene):
    """Blend six cameras by maps without borders, and return the last blend."""
    made = add_camera(scene, "Left Half Profile", (-3.6, -6.6, 0.2), (0.0, -0.1, -0.42), 70.0)
    parts = (
        ("Eye", (0.5, -7.4, 0.2), (0.37, -0.82, 0.04), (0.36, 0.66), 105.0, (0.33, 0.15), -7.0),
        ("Far Eye", (3.2, -6.6, 0.6), (-0.37, -0.82, 0.04), (0.70, 0.635), 105.0, (0.33, 0.165), 9.0),
        ("Mouth", (-1.0, -7.2, -0.9), (0.0, -0.86, -0.64), (0.56, 0.385), 100.0, (0.43, 0.14), 5.0),
        ("Ear", (-7.4, -0.4, 0.0), (-0.9, 0.12, -0.10), (0.19, 0.54), 92.0, (0.24, 0.22), 8.0),
        ("Profile", (-7.4, -1.9, -0.2), (0.0, -1.0, -0.14), (0.575, 0.52), 84.0, (0.19, 0.27), -5.0),
    )
    for name, eye, feature, at, lens, size, turn in parts:
        seen = pinned(scene, name, eye, feature, at, lens)
        made = blended(
            made, seen, "RECTANGLE", f"With {name}", center=at, size=size, angle=np.radians(turn), border=0.0
        )
    made.name = "Portrait"
    return made


def _melted(scene, name: str, balls, paint, size: float):
    """Balls that are melted into one surface. size: of its faces."""
    builder = MeshBuilder()
    for middle, radii in balls:
        builder.ball(middle, radii, name, segments=32)
    made = place(name, builder.mesh(name, {name: paint}), group(scene, name))
    remesh = made.modifiers.new("Melt", "REMESH")
    remesh.mode, remesh.voxel_size, remesh.use_smooth_shade = "VOXEL", size, True
    smooth = made.modifiers.new("Smooth", "SMOOTH")
    smooth.factor, smooth.iterations = 0.5, 14
    return made


def _bust(scene) -> None:
    palette = {name: material(name, paint, 0.5) for name, paint in PAINTS.items()}
    _melted(scene, "Head", (*HEAD, *NOSE), palette["Skin"], 0.035)
    hair = [((0.0, 0.30, 0.42), (0.96, 1.00, 0.92)), ((0.0, 0.95, 0.30), (0.45, 0.42, 0.42))]
    for side in (-1, 1):
        for s in np.linspace(0, 0.72, 7):
            hair.append(((side * (0.28 + 0.60 * s), -0.62 + 0.75 * s, 0.86 - 0.75 * s), (0.26, 0.26, 0.24)))
    _melted(scene, "Hair", hair, palette["Hair"], 0.04)
    builder = MeshBuilder()
    for side in (-1, 1):
        eye = np.array([side * 0.37, -0.74, 0.02])
        builder.ball(eye, (0.19, 0.17, 0.15), "White", segments=48)
        builder.ball(eye - (0, 0.125, 0), (0.095, 0.06, 0.095), "Iris", segments=32)
        builder.ball(eye - (0, 0.165, 0), (0.05, 0.035, 0.05), "Black", segments=24)
        for s in np.linspace(-1, 1, 25):
            wide = 0.045 * (1.1 - 0.5 * abs(s))
            builder.ball(
                (side * (0.39 + 0.27 * s), -0.93 + 0.14 * s * s, 0.32 - 0.09 * s * s),
                (0.03, 0.04, wide),
                "Hair",
                segments=12,
            )
            for up in (-1, 1):
                lid = eye + np.array([0.22 * s * side, -0.17 + 0.10 * s * s, up * 0.135 * (1 - s * s) ** 0.6])
                builder.ball(lid, (0.035, 0.045, 0.026), "Lids", segments=12)
        for s in np.linspace(0, 1, 15):
            builder.ball(
                (side * 0.27 * s, -0.84 + 0.14 * s * s, -0.575 - 0.02 * abs(s - 0.3)),
                (0.05, 0.075, 0.055 * (1 - 0.6 * s)),
                "Lips",
                segments=16,
            )
            builder.ball(
                (side * 0.25 * s, -0.83 + 0.14 * s * s, -0.665 + 0.05 * s),
                (0.05, 0.085, 0.065 * (1 - 0.6 * s)),
                "Lips",
                segments=16,
            )
        builder.ball((side * 0.95, -0.02, -0.50), (0.06, 0.06, 0.09), "Band", segments=24)
    for middle, radii in _ears():
        builder.ball(middle, radii, "Lids", segments=20)
    for s in np.radians(np.arange(0, 360, 12)):
        builder.ball(
            (0.44 * np.cos(s), 0.08 + 0.44 * np.sin(s), -1.50 + 0.06 * np.sin(s)),
            (0.075, 0.075, 0.075),
            "Band",
            segments=20,
        )
    builder.lathe([(0.75, -1.95), (1.22, -2.2), (1.35, -2.8), (0.0, -2.8)], 64, "Z", (0, 0.1, 0), "Dress")
    palette["Lids"] = palette["Skin"]
    place("Features", builder.mesh("Features", palette, outward=True), group(scene, "Features"))
    wall = MeshBuilder()
    wall.lathe([(15.0, -14.0), (15.0, 14.0)], 64, "Z", (0, 0, 0), "Wall")
    paint = material("Wall", (0.30, 0.34, 0.30), 0.9, emission=0.6)
    backdrop = place("Wall", wall.mesh("Wall", {"Wall": paint}), group(scene, "Wall"))
    # The light of sun and sky comes through it.
    backdrop.visible_shadow = False
    daylight(scene, group(scene, "Lights"), (56.0, 0.0, -38.0))
    scene.view_settings.exposure = -0.35


def _ears():
    """Balls of both ears: rims that are bent tubes, shells and lobes."""
    ears = []
    for side in (-1, 1):
        for s in np.radians(np.arange(-75, 225, 4)):
            middle = (side * (0.95 + 0.03 * np.sin(s)), 0.12 + 0.19 * np.sin(s), -0.08 + 0.27 * np.cos(s))
            ears.append((middle, (0.055, 0.055, 0.055)))
        for s in np.radians(np.arange(-20, 180, 5)):
            middle = (side * 0.94, 0.10 + 0.11 * np.sin(s), -0.10 + 0.17 * np.cos(s))
            ears.append((middle, (0.04, 0.035, 0.035)))
        ears.append(((side * 0.86, 0.10, -0.08), (0.09, 0.18, 0.26)))
        ears.append(((side * 0.93, -0.02, -0.34), (0.06, 0.08, 0.09)))
        ears.append(((side * 0.93, -0.08, -0.10), (0.05, 0.05, 0.08)))
    return ears
