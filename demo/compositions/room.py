# SPDX-License-Identifier: GPL-3.0-or-later
"""A room whose walls, floor and ceiling are seen from several places at once, as the rooms of the film Ryan.

Coleman and Singh, RYAN: Rendering Your Animation Nonlinearly Projected (NPAR 2004).
"""

from __future__ import annotations

import numpy as np

from ..mesh import MeshBuilder, material, place
from ..street import daylight
from .parts import add_camera, blended, new_scene
from .town import group

SIZE = (1120, 630)
WIDE, DEEP, HIGH = 4.2, 5.0, 3.3
PAINTS = {
    "Plaster": (0.55, 0.50, 0.38),
    "Green": (0.10, 0.20, 0.15),
    "Light tile": (0.60, 0.57, 0.50),
    "Dark tile": (0.10, 0.11, 0.12),
    "White": (0.75, 0.74, 0.70),
    "Wood": (0.26, 0.11, 0.04),
    "Red": (0.48, 0.045, 0.03),
    "Steel": (0.30, 0.31, 0.33),
    "Skin": (0.62, 0.36, 0.25),
    "Coat": (0.10, 0.13, 0.26),
    "Cup": (0.72, 0.70, 0.64),
    "Yellow": (0.72, 0.46, 0.06),
}


def build():
    """A canteen with a lone guest, blended of four cameras."""
    scene = new_scene(*SIZE)
    _furnish(scene)
    boss = add_camera(scene, "Boss", (0.3, -4.6, 1.55), (0.0, 2.0, 1.35), 20.0)
    ceiling = add_camera(scene, "Ceiling", (0.2, -3.0, 0.35), (0.0, 2.2, 2.5), 17.0)
    wall = add_camera(scene, "Wall", (3.4, -2.4, 1.1), (-3.4, 2.6, 1.7), 20.0)
    table = add_camera(scene, "Table", (1.0, -2.6, 3.1), (0.7, 0.9, 0.6), 22.0)
    wall.rotation_euler.rotate_axis("Z", np.radians(-14.0))
    table.rotation_euler.rotate_axis("Z", np.radians(9.0))
    made = blended(
        boss, ceiling, "LINEAR", "Boss and Ceiling", center=(0.5, 0.80), angle=np.pi / 2, border=0.34
    )
    made = blended(
        made, wall, "LINEAR", "Boss and Wall", center=(0.24, 0.5), angle=np.radians(172.0), border=0.42
    )
    made = blended(made, table, "RADIAL", "Room", center=(0.66, 0.20), size=(0.46, 0.5), border=0.34)
    scene.camera = made
    return scene


def _furnish(scene) -> None:
    palette = {name: material(name, paint, 0.55) for name, paint in PAINTS.items()}
    palette["Lamp"] = material("Lamp", (1.0, 0.86, 0.62), emission=6.0)
    palette["Sky"] = material("Sky", (0.55, 0.75, 1.0), emission=2.2)
    for name, build_part in (("Walls", _walls), ("Furniture", _furniture), ("Guest", _guest)):
        builder = MeshBuilder()
        build_part(builder)
        place(name, builder.mesh(name, palette, outward=name != "Walls"), group(scene, name))
    _lights(scene)


def _walls(builder: MeshBuilder) -> None:
    tile = 0.6
    for i, x in enumerate(np.arange(-WIDE, WIDE - 0.01, tile)):
        for j, y in enumerate(np.arange(-DEEP, DEEP - 0.01, tile)):
            corners = [(x, y, 0), (x + tile, y, 0), (x + tile, y + tile, 0), (x, y + tile, 0)]
            builder.add(corners, [(0, 1, 2, 3)], "Dark tile" if (i + j) % 2 else "Light tile")
    for z0, z1, name in ((0.0, 1.15, "Green"), (1.15, 1.22, "White"), (1.22, HIGH, "Plaster")):
        depth = 0.03 if name == "White" else 0.0
        builder.box((-WIDE - 0.2, -DEEP, z0), (-WIDE + depth, DEEP, z1), name)
        builder.box((WIDE - depth, -DEEP, z0), (WIDE + 0.2, DEEP, z1), name)
        builder.box((-WIDE, DEEP - depth, z0), (WIDE, DEEP + 0.2, z1), name)
    builder.box((-WIDE, -DEEP, HIGH), (WIDE, DEEP, HIGH + 0.2), "Plaster")
    for y in np.arange(-4.2, DEEP, 1.4):
        builder.box((-WIDE, y - 0.09, HIGH - 0.22), (WIDE, y + 0.09, HIGH), "Wood")
    # Windows on the left, a door and a counter's shelves behind, frames on the right.
    for y in (-2.2, 0.4, 3.0):
        builder.box((-WIDE - 0.1, y - 0.75, 1.3), (-WIDE + 0.02, y + 0.75, 2.7), "Sky")
        for low, high in ((y - 0.81, y - 0.73), (y - 0.03, y + 0.03), (y + 0.73, y + 0.81)):
            builder.box((-WIDE, low, 1.24), (-WIDE + 0.07, high, 2.76), "White")
        for z in (1.24, 2.0, 2.70):
            builder.box((-WIDE, y - 0.81, z), (-WIDE + 0.07, y + 0.81, z + 0.06), "White")
    builder.box((1.9, DEEP - 0.04, 0.0), (3.1, DEEP, 2.25), "White")
    builder.box((2.0, DEEP - 0.07, 0.0), (3.0, DEEP, 2.15), "Wood")
    builder.ball((2.12, DEEP - 0.1, 1.05), (0.05, 0.05, 0.05), "Steel")
    for y, name in ((-1.4, "Red"), (0.4, "Yellow"), (2.2, "Coat")):
        builder.box((WIDE - 0.05, y - 0.5, 1.5), (WIDE, y + 0.5, 2.5), "Wood")
        builder.box((WIDE - 0.06, y - 0.42, 1.58), (WIDE, y + 0.42, 2.42), name)
        builder.ball((WIDE - 0.06, y, 2.0), (0.02, 0.22, 0.3), "Light tile")


def _table(builder: MeshBuilder, x: float, y: float) -> None:
    builder.lathe(
        [(0.0, 0.70), (0.56, 0.70), (0.58, 0.72), (0.58, 0.74), (0.0, 0.745)], 40, "Z", (x, y, 0), "Red"
    )
    builder.lathe([(0.28, 0.0), (0.28, 0.03), (0.05, 0.06), (0.05, 0.70)], 24, "Z", (x, y, 0), "Steel")
    for angle in np.radians((20, 140, 260)):
        sx, sy = x + 0.92 * np.cos(angle), y + 0.92 * np.sin(angle)
        builder.lathe([(0.2, 0.44), (0.21, 0.46), (0.2, 0.49), (0.0, 0.5)], 24, "Z", (sx, sy, 0), "Yellow")
        builder.lathe([(0.16, 0.0), (0.16, 0.02), (0.03, 0.04), (0.03, 0.44)], 16, "Z", (sx, sy, 0), "Steel")


def _furniture(builder: MeshBuilder) -> None:
    for x, y in ((0.9, 0.3), (-2.2, -0.6), (-1.7, 2.6), (2.8, 2.7)):
        _table(builder, x, y)
    builder.box((-3.2, 4.0, 0.0), (1.2, 4.5, 1.0), "Wood")
    builder.box((-3.3, 3.92, 1.0), (1.3, 4.55, 1.06), "White")
    for z in (1.7, 2.2):
        builder.box((-3.0, 4.75, z), (1.0, 5.0, z + 0.05), "Wood")
    for number, x in enumerate(np.arange(-2.8, 0.9, 0.24)):
        name = ("Green", "Red", "Cup", "Yellow", "Steel")[number % 5]
        profile = [(0.07, 0.0), (0.07, 0.2), (0.03, 0.26), (0.03, 0.33), (0.0, 0.33)]
        builder.lathe(profile, 16, "Z", (x, 4.86, 1.75), name)
        builder.lathe([(0.05, 0.0), (0.06, 0.14), (0.0, 0.14)], 16, "Z", (x, 4.86, 2.25), name)
    for x, y in ((0.9, 0.3), (-2.2, -0.6), (-1.7, 2.6)):
        builder.lathe(
            [(0.0, 0.75), (0.13, 0.75), (0.14, 0.765), (0.0, 0.76)], 24, "Z", (x - 0.15, y - 0.22, 0), "Cup"
        )
        builder.lathe(
            [(0.04, 0.76), (0.065, 0.85), (0.055, 0.85), (0.0, 0.79)], 24, "Z", (x - 0.15, y - 0.22, 0), "Cup"
        )
    for x in (-2.0, 0.9):
        for y in (-1.6, 1.0, 3.2)[x > 0 :]:
            builder.lathe([(0.015, 2.55), (0.015, HIGH)], 8, "Z", (x, y, 0), "Steel")
            builder.lathe([(0.30, 2.35), (0.06, 2.56), (0.0, 2.58)], 32, "Z", (x, y, 0), "Green")
            builder.ball((x, y, 2.38), (0.09, 0.09, 0.09), "Lamp")


def _guest(builder: MeshBuilder) -> None:
    """A man at the table, his arms on it."""
    x, y = 1.76, 0.62
    torso = [(0.0, 0.44), (0.20, 0.46), (0.19, 0.70), (0.24, 1.0), (0.20, 1.13), (0.07, 1.2), (0.065, 1.3)]
    builder.lathe(torso, 32, "Z", (x, y, 0), "Coat")
    builder.ball((x - 0.04, y - 0.01, 1.44), (0.12, 0.105, 0.155), "Skin", segments=32)
    builder.ball((x - 0.16, y - 0.03, 1.43), (0.035, 0.025, 0.03), "Skin")
    builder.lathe(
        [(0.19, 1.53), (0.2, 1.545), (0.125, 1.555), (0.12, 1.66), (0.0, 1.68)],
        32,
        "Z",
        (x - 0.02, y, 0),
        "Dark tile",
    )
    for side in (-1, 1):
        shoulder, elbow = np.array([x, y + 0.24 * side, 1.06]), np.array([x - 0.22, y + 0.3 * side, 0.80])
        hand = np.array([x - 0.56, y + 0.12 * side, 0.78])
        for start, end, wide in ((shoulder, elbow, 0.075), (elbow, hand, 0.06)):
            for share in np.linspace(0, 1, 14):
                middle = start + share * (end - start)
                builder.ball(middle, (wide, wide, wide), "Coat", segments=16)
        builder.ball(hand, (0.07, 0.045, 0.04), "Skin", segments=16)
        knee = np.array([x - 0.42, y + 0.13 * side, 0.52])
        for share in np.linspace(0, 1, 12):
            hip = np.array([x, y + 0.12 * side, 0.53])
            builder.ball(hip + share * (knee - hip), (0.09, 0.09, 0.09), "Steel", segments=16)
            builder.ball(knee - (0.02, 0, 0.46 * share), (0.075, 0.075, 0.075), "Steel", segments=16)


def _lights(scene) -> None:
    import bpy

    daylight(scene, group(scene, "Lights"), (58.0, 0.0, -75.0))
    scene.objects["Sun"].data.energy = 0.0
    for number, (x, y) in enumerate((x, y) for x in (-2.0, 0.9) for y in (-1.6, 1.0, 3.2)):
        data = bpy.data.lights.new(f"Bulb {number}", "POINT")
        data.energy, data.color, data.shadow_soft_size = 75.0, (1.0, 0.80, 0.56), 0.12
        lamp = bpy.data.objects.new(data.name, data)
        lamp.location = (x, y, 2.2)
        scene.collection.objects.link(lamp)
    for number, y in enumerate((-2.2, 0.4, 3.0)):
        data = bpy.data.lights.new(f"Window {number}", "AREA")
        data.energy, data.color, data.shape, data.size, data.size_y = (
            70.0,
            (0.72, 0.86, 1.0),
            "RECTANGLE",
            1.4,
            1.4,
        )
        lamp = bpy.data.objects.new(data.name, data)
        lamp.location, lamp.rotation_euler = (-WIDE + 0.12, y, 2.0), (0.0, -np.pi / 2, 0.0)
        scene.collection.objects.link(lamp)
    scene.view_settings.exposure = 0.1
