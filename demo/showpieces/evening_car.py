# SPDX-License-Identifier: GPL-3.0-or-later
"""A car unfolded before its street: a layer, which another camera sees that walks round the car."""

from __future__ import annotations

import numpy as np

from ..recipes.layer_pictures import add_camera, add_layer
from .walk import walk

# The layer's shares of the image's width, beyond its borders, and height, and where the layer's middle is.
SIZE, POSITION = (1.04, 0.50), (0.5, 0.24)
# Half the width that the layer shows, in widths of things, and its lowest and highest point.
HALF, LOW, HIGH = 5.43, -0.75, 1.75
# Distances of the surfaces from the car's middle, and how far projectors fall on each metre.
REACH, DOWN = (8.0, 0.02), 0.16
# Where the volume begins to turn, the radius of the turn, and how far it turns, in degrees.
START, RADIUS, TURN = -1.3, 0.9, 72.0
# How fast the layer's middle passes over things: below 1, the car's front is wider.
FRONT = 0.766
# Metres around the car within which its ground is seen as it is, and fades into the street's.
HALO = 0.8
ROWS, COLUMNS = 9, 161


def evening_car(size: tuple[int, int]):
    """Build the street by day, with the unfolded car as a layer, and return the scene. size: its image's."""
    import bpy

    from .. import render_demo
    from .street_film import camera_of

    scene = render_demo.build_street()
    # A picture with layers has the shape that its image has now.
    scene.render.resolution_x, scene.render.resolution_y = size
    street = add_camera(scene, "Street", (0.0, -14.0, 2.2), (0.0, 2.0, 3.2), 27.0)
    heights, across = np.linspace(LOW, HIGH, ROWS), np.linspace(-1, 1, COLUMNS)
    along = HALF * across * (FRONT + (1 - FRONT) * across**2)
    turns = np.full(ROWS, np.radians(TURN))
    surfaces = [
        walk(reach, heights + DOWN * reach, along, turns, radius=RADIUS, start=START) for reach in REACH
    ]
    eye = camera_of(scene, render_demo.MODULE, surfaces, "Round the Car")
    scene.camera = street
    frame = {"position": POSITION, "size": SIZE}
    add_layer(street, "Car", eye, front="ORDER", halo=HALO, feather=1.0, **frame)
    bpy.context.view_layer.update()
    return scene
