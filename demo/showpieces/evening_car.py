# SPDX-License-Identifier: GPL-3.0-or-later
"""A car unfolded before its street: a layer, which another camera sees that walks round the car."""

from __future__ import annotations

import numpy as np

from ..recipes.layer_pictures import add_camera, add_layer
from .walk import walk

# The layer's shares of the image's width and height, and where the layer's middle is.
SIZE, POSITION = (0.94, 0.50), (0.5, 0.24)
# Half the width that the layer shows, in widths of things, and its lowest and highest point.
HALF, LOW, HIGH = 4.7, -0.75, 1.75
# Distances of the surfaces from the car's middle, and how far projectors fall on each metre.
REACH, DOWN = (8.0, 0.02), 0.16
# Where the volume begins to turn, the radius of the turn, and how far it turns, in degrees.
START, RADIUS, TURN = -1.3, 0.9, 72.0
# How fast the layer's middle passes over things: below 1, the car's front is wider.
FRONT = 0.8
# The part of the layer over which its ground fades into the street's, as shares of its width and height.
FADE = (0.05, 0.16)
ROWS, COLUMNS = 9, 161
MASK_SIZE = (512, 256)


def evening_car():
    """Build the street by day, with the unfolded car as a layer, and return the scene."""
    import bpy

    from .. import render_demo
    from .street_film import camera_of

    scene = render_demo.build_street()
    street = add_camera(scene, "Street", (0.0, -14.0, 2.2), (0.0, 2.0, 3.2), 28.0)
    heights, across = np.linspace(LOW, HIGH, ROWS), np.linspace(-1, 1, COLUMNS)
    along = HALF * across * (FRONT + (1 - FRONT) * across**2)
    turns = np.full(ROWS, np.radians(TURN))
    surfaces = [
        walk(reach, heights + DOWN * reach, along, turns, radius=RADIUS, start=START) for reach in REACH
    ]
    eye = camera_of(scene, render_demo.MODULE, surfaces, "Round the Car")
    scene.camera = street
    layer = add_layer(street, "Car", eye, front="ORDER", halo=0.3, position=POSITION, size=SIZE)
    layer.mask = _mask()
    bpy.context.view_layer.update()
    return scene


def _mask():
    """An image over the whole picture that fades the layer out at its sides and its lower end."""
    import bpy

    width, height = MASK_SIZE
    x, y = (np.arange(width) + 0.5) / width, (np.arange(height) + 0.5) / height
    across = 0.5 - np.abs(x - POSITION[0]) / SIZE[0]
    up = 0.5 + (y - POSITION[1]) / SIZE[1]
    shown = _ramp(up / FADE[1])[:, None] * _ramp(across / FADE[0])[None]
    pixels = np.ones((height, width, 4), np.float32)
    pixels[..., :3] = shown[..., None]
    image = bpy.data.images.new("Layer Mask", width, height, float_buffer=True)
    image.pixels.foreach_set(pixels.ravel())
    image.pack()
    return image


def _ramp(share):
    """Rise smoothly from 0 to 1."""
    share = np.clip(share, 0.0, 1.0)
    return share * share * (3.0 - 2.0 * share)
