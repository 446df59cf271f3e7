# SPDX-License-Identifier: GPL-3.0-or-later
"""A joiner as David Hockney's: many prints of one crossing, each from where it was looked at."""

from __future__ import annotations

import numpy as np

from ..evening import evening
from ..mesh import MeshBuilder, material, place
from ..render_demo import build_street
from .parts import Array, Tile, add_camera, frame_rays, sized, tiled

SIZE = (930, 620)
LENS, DISTANCE = 26.0, 10.0
COLUMNS, ROWS = 8, 6
# A print's width and height in widths of the image, and the white border of it.
PRINT, BORDER = (0.158, 0.128), 0.0022
NEAR, FAR = 0.3, 140.0
# How far the photographer walks to the side and bends down, in metres, from the middle to the border.
WALK, BEND = 7.0, 1.5
# Height of the sheet on which the prints lie: far below the street.
SHEET = -400.0


def build():
    """The street's crossing, put together from some fifty prints."""
    import bpy

    scene = sized(build_street(), *SIZE)
    camera = scene.camera = add_camera(scene, "Joiner", (-1.8, -11.2, 1.9), (-0.6, 0.0, 2.4), LENS)
    bpy.context.view_layer.update()
    sheet = MeshBuilder()
    sheet.box((-9.0, -9.0, SHEET - 1.0), (9.0, 9.0, SHEET), "Paper")
    white = material("Paper", (1.0, 0.98, 0.93), emission=3.0)
    place("Paper", sheet.mesh("Paper", {"Paper": white}), scene.collection)
    aspect = SIZE[0] / SIZE[1]
    random = np.random.default_rng(3)
    prints = []
    for row in range(ROWS):
        for column in range(COLUMNS):
            spread = random.uniform(-1, 1, 6)
            at = (np.array([column, row]) + 0.5 + 0.14 * spread[:2]) / (COLUMNS, ROWS)
            prints.append(_print(at, aspect, spread[2:]))
    # Down to the paper, seen from the camera's own space.
    down = np.array(camera.matrix_world.inverted())
    low, high = (_flat(down, z) for z in (SHEET + 1.0, SHEET - 0.5))
    tiles = []
    for number in random.permutation(len(prints)):
        inner, outer = prints[number]
        tiles += [inner, Tile(outer, [low, high])]
    whole = np.array([[[0.0, 0.0], [1.0, 0.0]], [[0.0, 1.0], [1.0, 1.0]]])
    tiled(camera, [*tiles, Tile(whole, [low, high])], ("Prints", "Seen"))
    evening(scene, exposure=0.95)
    return scene


def _flat(matrix: Array, height: float) -> Array:
    """Four points (2, 2, 3) at a height, in a space that a matrix leads to from the world's."""
    points = np.array([[[x, y, height] for x in (-1.0, 1.0)] for y in (-1.0, 1.0)])
    placed: Array = points @ matrix[:3, :3].T + matrix[:3, 3]
    return placed


def _print(at: Array, aspect: float, spread: Array) -> tuple[Tile, Array]:
    """A print whose middle is at an image position, which shows what is there from a step aside; its border.

    spread: (4,) random numbers in [-1, 1].
    """
    corner = np.array([[[-1, -1], [1, -1]], [[-1, 1], [1, 1]]]) / 2
    turn = np.radians(5.0) * spread[0]
    matrix = np.array([[np.cos(turn), np.sin(turn)], [-np.sin(turn), np.cos(turn)]])
    inside, outside = (corner * (np.array(PRINT) - edge) for edge in (2 * BORDER, 0.0))
    away = at - 0.5
    eye = np.array([WALK * away[0] + 0.5 * spread[1], BEND * away[1] + 0.2 * spread[2], 0.0])
    # A point of the first camera's view, as far away as the crossing.
    middle = frame_rays(at, LENS, aspect) * DISTANCE
    forward = (middle - eye) / np.linalg.norm(middle - eye)
    right = np.cross(forward, (0.0, 1.0, 0.0))
    right /= np.linalg.norm(right)
    up = np.cross(right, forward)
    zoom = 36.0 / LENS * (1.12 + 0.1 * spread[3])
    rays = forward + zoom * (inside[..., :1] * right + inside[..., 1:] * up)
    inner = Tile(at + inside @ matrix * (1.0, aspect), [eye + NEAR * rays, eye + FAR * rays])
    return inner, at + outside @ matrix * (1.0, aspect)
