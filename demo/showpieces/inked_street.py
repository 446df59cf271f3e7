# SPDX-License-Identifier: GPL-3.0-or-later
"""An inked street whose volume rises: a blend of two cameras, whose factor has keyframes."""

from __future__ import annotations

from ..inked_town import Colors, add_cars, build_town
from ..recipes.jobs import RISING
from ..recipes.scenes import add_level_and_above
from ..toon import draw_outlines, draw_tones

# The frames from one end of the blend to the other, and the thickness of lines in metres, by collection.
FRAMES, LINES = 24, {"Town": 0.2, "Cars": 0.1}
COLORS = Colors(
    walls=(
        (0.86, 0.66, 0.36),
        (0.80, 0.30, 0.20),
        (0.88, 0.82, 0.70),
        (0.22, 0.44, 0.46),
        (0.84, 0.48, 0.30),
        (0.55, 0.62, 0.60),
        (0.90, 0.76, 0.52),
    ),
    pavement=(0.74, 0.70, 0.64),
    road=(0.24, 0.25, 0.30),
    dark=(0.035, 0.05, 0.10),
    light=(1.0, 0.93, 0.72),
    sky=(0.42, 0.70, 0.86),
)
# The places of cars, and their paints.
CARS = ((2.6, -5.0), (-2.6, 3.0), (2.6, 17.5), (-2.6, 27.0), (2.6, 36.0), (-2.6, 50.0))
PAINTS = ((0.78, 0.12, 0.10), (0.90, 0.72, 0.20), (0.86, 0.86, 0.82), (0.16, 0.38, 0.66))


def inked_street():
    """The town in colors through the volume of the recipe of a street that rises. Returns the scene."""
    import bpy

    scene = build_town(COLORS)
    cars = bpy.data.collections.new("Cars")
    scene.collection.children.link(cars)
    add_cars(cars, CARS, PAINTS)
    draw_tones()
    draw_outlines(LINES)
    add_level_and_above(scene)
    for step in RISING:
        step.act()
        bpy.context.view_layer.update()
    scene.frame_start, scene.frame_end = 0, FRAMES - 1
    for frame, factor in ((0, 0.0), (FRAMES - 1, 1.0)):
        scene.camera.scfpf.blend_factor = factor
        scene.camera.scfpf.keyframe_insert("blend_factor", frame=frame)
    return scene
