# SPDX-License-Identifier: GPL-3.0-or-later
"""The scene of the presets' thumbnails: people, lamps in a row and a kiosk on the crossing, in the evening.

It is the demo's street without cars and markings. Equal things stand in rows into depth, upright things at
both sides, and a box in the middle, so that small pictures tell projections apart.
"""

from __future__ import annotations

import bpy
import numpy as np

from .mesh import Array, MeshBuilder, material, place
from .people import people
from .street import KERB, build_lamp, build_scene, build_tree

# The sides of the pavement's tiles in metres, and how far they reach.
TILE, PAVED = 2.0, 60.0
# Half the width of the kiosk, its height and that of its roof.
KIOSK, HIGH, ROOF = 1.15, 2.5, 1.3
# Where people of equal height stand one behind the other, and the others: x, y, turn in degrees, coat.
ROW = [(2.9, float(y)) for y in range(-8, 57, 4)]
OTHERS = (
    (-2.4, 0.4, 20.0, "Coat red"),
    (-3.3, 0.0, -35.0, "Coat yellow"),
    (0.7, -2.6, 160.0, "Coat white"),
    (-1.2, 3.4, 90.0, "Coat yellow"),
    (-4.4, 1.0, 70.0, "Coat blue"),
    (5.2, -3.0, -60.0, "Coat red"),
    (4.9, 4.6, 10.0, "Coat white"),
    (-6.6, -2.2, 40.0, "Coat green"),
    (1.3, -7.4, 185.0, "Coat red"),
    (-5.4, 9.0, 0.0, "Coat red"),
    (6.6, -9.6, -100.0, "Coat blue"),
)
LAMPS = [(-4.6, float(y)) for y in range(-6, 57, 6)]
TREES = ((7.4, 0.5), (-7.8, 4.5))


def _palette() -> dict[str, bpy.types.Material]:
    """The materials of the kiosk and the tiles by name."""
    return {
        "Kiosk": material("Kiosk", (0.52, 0.02, 0.015), 0.4),
        "Kiosk trim": material("Kiosk trim", (0.78, 0.72, 0.58), 0.5),
        "Kiosk roof": material("Kiosk roof", (0.03, 0.16, 0.15), 0.4),
        "Kiosk light": material("Kiosk light", (1.0, 0.62, 0.24), 0.4, 0.0, 0.55),
        "Tile light": material("Tile light", (0.46, 0.42, 0.36), 0.8),
        "Tile dark": material("Tile dark", (0.13, 0.125, 0.13), 0.8),
    }


def _kiosk() -> MeshBuilder:
    """A box with lit windows on each side and a pyramid of a roof."""
    builder = MeshBuilder()
    builder.box((-KIOSK - 0.12, -KIOSK - 0.12, 0.0), (KIOSK + 0.12, KIOSK + 0.12, 0.22), "Kiosk trim")
    builder.box((-KIOSK, -KIOSK, 0.22), (KIOSK, KIOSK, HIGH), "Kiosk")
    for turn in range(4):
        cos, sin = (1, 0, -1, 0)[turn], (0, 1, 0, -1)[turn]
        for left in (-0.85, 0.2):
            low, high = np.array([left, -KIOSK - 0.03]), np.array([left + 0.65, -KIOSK + 0.05])
            corners = np.array([cos * low[0] - sin * low[1], sin * low[0] + cos * low[1]])
            others = np.array([cos * high[0] - sin * high[1], sin * high[0] + cos * high[1]])
            first, last = np.minimum(corners, others), np.maximum(corners, others)
            builder.box((*first, 1.15), (*last, 2.05), "Kiosk light")
    eaves = KIOSK + 0.35
    builder.box((-eaves, -eaves, HIGH), (eaves, eaves, HIGH + 0.16), "Kiosk trim")
    base: Array = np.array([(-1, -1, 0), (1, -1, 0), (1, 1, 0), (-1, 1, 0), (0, 0, 1)], np.float64)
    points = base * (eaves, eaves, ROOF) + (0, 0, HIGH + 0.16)
    builder.add(points, [(0, 1, 4), (1, 2, 4), (2, 3, 4), (3, 0, 4)], "Kiosk roof")
    builder.ball((0.0, 0.0, HIGH + ROOF + 0.2), (0.16, 0.16, 0.16), "Kiosk trim")
    return builder


def _tiles() -> MeshBuilder:
    """A chequered pavement over the roads."""
    builder = MeshBuilder()
    steps = np.arange(-PAVED, PAVED, TILE)
    for row, x in enumerate(steps):
        for column, y in enumerate(steps):
            if min(abs(x + TILE / 2), abs(y + TILE / 2)) < 10.0:
                low, high = (x, y, 0.012), (x + TILE, y + TILE, 0.012)
                corners = [low, (high[0], low[1], low[2]), high, (low[0], high[1], low[2])]
                name = "Tile light" if (row + column) % 2 else "Tile dark"
                builder.add(corners, [(0, 1, 2, 3)], name)
    return builder


def _low_sun(scene: bpy.types.Scene) -> None:
    """Late light from behind the camera's left shoulder, which comes along the street, and lit lanterns."""
    sun = bpy.data.objects["Sun"]
    sun.rotation_euler = np.radians((56.0, 0.0, -17.0))
    sun.data.energy, sun.data.color, sun.data.angle = 6.5, (1.0, 0.66, 0.38), np.radians(0.8)
    background = scene.world.node_tree.nodes["Background"].inputs
    background["Color"].default_value, background["Strength"].default_value = (0.20, 0.36, 0.72, 1.0), 1.0
    scene.view_settings.exposure = 0.35


def build_square(scene: bpy.types.Scene) -> None:
    """Fill a scene."""
    build_scene(scene)
    _low_sun(scene)
    for name in ("Car", "Parked cars"):
        collection = bpy.data.collections[name]
        for obj in list(collection.all_objects):
            bpy.data.objects.remove(obj)
        bpy.data.collections.remove(collection)
    bpy.data.objects.remove(bpy.data.objects["Road markings"])
    square = bpy.data.collections.new("Square")
    scene.collection.children.link(square)
    palette = _palette()
    place("Tiles", _tiles().mesh("Tiles", palette), square)
    place("Kiosk", _kiosk().mesh("Kiosk", palette), square)
    figures = people()
    coats = list(figures)
    for number, (x, y) in enumerate(ROW):
        place(f"Row {number}", figures[coats[number % len(coats)]], square, (x, y, 0.0), 0.3 * number)
    for number, (x, y, turn, coat) in enumerate(OTHERS):
        place(f"Person {number}", figures[coat], square, (x, y, 0.0), np.radians(turn))
    street = {one.name: one for one in bpy.data.materials}
    lamp = build_lamp().mesh("Lamp of the row", street, outward=True)
    for number, (x, y) in enumerate(LAMPS):
        place(f"Lamp {number}", lamp, square, (x, y, 0.0))
    tree = build_tree(2).mesh("Tree of the square", street, sharp=np.pi)
    for number, (x, y) in enumerate(TREES):
        place(f"Tree of the square {number}", tree, square, (x, y, KERB))
