# SPDX-License-Identifier: GPL-3.0-or-later
"""A crowd of chessmen on a board that is seen from above, each of them seen from its best side.

Agrawala, Zorin and Munzner, Artistic Multiprojection Rendering (EGWR 2000): a camera for each thing.
"""

from __future__ import annotations

import numpy as np

from ..mesh import MeshBuilder, material, place
from ..street import daylight
from .parts import add_camera, add_layer, new_scene
from .town import group

SIZE = (960, 720)
LENS, MASTER = 57.0, (0.0, -12.2, 12.6)
# How much larger the men are than the numbers below.
LARGE = 1.18
RADIUS = 0.36 * LARGE
# Radii and heights of the men in thousandths of a square, from the foot.
FOOT = "0 0 360 0 360 60 320 110 330 150 240 190 "
PROFILES = {
    "Pawn": FOOT + "150 260 120 480 220 520 220 550 130 570 190 660 200 740 150 830 60 870 0 875",
    "Rook": FOOT + "190 280 170 720 260 760 260 960 180 960 180 880 0 880",
    "Bishop": FOOT
    + "160 280 110 720 220 760 220 790 130 810 200 900 210 1000 120 1130 50 1190 70 1230 0 1270",
    "Queen": FOOT
    + "180 300 120 880 240 930 240 960 140 990 210 1260 190 1290 120 1270 90 1330 70 1390 0 1400",
    "King": FOOT + "190 300 130 960 250 1010 250 1040 150 1070 210 1330 190 1370 90 1400 0 1410",
    "Knight": FOOT + "270 240 270 270 0 270",
}
# A knight's head from its side: forward and up.
HEAD = """
    230 260 190 420 110 570 140 640 300 590 390 620 410 700 330 800 230 900 160 960 130 1090 60 1010
    -70 980 -200 860 -280 680 -290 480 -250 260
"""
FOOT_POINTS = len(FOOT.split()) // 2
# Each man: kind, whether white, file and rank from 0; nearest ranks come first when they are sorted.
MEN = """
    King w 6 0, Rook w 5 0, Pawn w 7 1, Pawn w 6 1, Queen w 3 1, Pawn w 1 2, Bishop w 4 2, Knight w 2 3,
    Pawn w 4 3, Knight b 5 4, Pawn b 3 4, Bishop b 1 5, Pawn b 6 5, Queen b 3 6, Pawn b 0 6, King b 6 7,
    Rook b 2 7
"""
# From how high and from how far to the right each kind is best seen, degrees.
SIDES = {
    "Pawn": (9, 0),
    "Rook": (24, 20),
    "Bishop": (4, 35),
    "Queen": (16, 0),
    "King": (2, 0),
    "Knight": (4, 90),
}


def build():
    """A board in the middle of a game."""
    import bpy
    from bpy_extras.object_utils import world_to_camera_view
    from mathutils import Vector

    scene = new_scene(*SIZE)
    _board(scene)
    men = sorted((_man(scene, text.split()) for text in MEN.split(",")), key=lambda man: man[1].y)
    daylight(scene, group(scene, "Lights"), (40.0, 0.0, 42.0))
    scene.view_settings.exposure = -0.1
    master = scene.camera = add_camera(scene, "Board", MASTER, (0.0, 0.35, 0.0), LENS)
    bpy.context.view_layer.update()
    for name, foot, (up, right) in men:
        reach = (master.matrix_world.translation - foot).length
        up, right = np.radians((up, right))
        away = Vector((np.sin(right) * np.cos(up), -np.cos(right) * np.cos(up), np.sin(up)))
        eye = add_camera(scene, f"{name} View", foot + reach * away, foot, LENS)
        bpy.context.view_layer.update()
        # The front of its foot stands where the master sees it.
        front = Vector((away.x, away.y, 0.0)).normalized() * RADIUS
        seen = world_to_camera_view(scene, master, foot - Vector((0.0, RADIUS, 0.0)))
        own = world_to_camera_view(scene, eye, foot + front)
        add_layer(master, name, eye, front="ORDER", position=(seen.x, seen.y + 0.5 - own.y))
    return scene


def _board(scene) -> None:
    builder = MeshBuilder()
    for file in range(8):
        for rank in range(8):
            name = "Maple" if (file + rank) % 2 else "Walnut"
            builder.box((file - 4, rank - 4, -0.1), (file - 3, rank - 3, 0.0), name)
    builder.box((-4.6, -4.6, -0.3), (4.6, 4.6, -0.1), "Frame")
    for low, high in (
        ((-4.6, -4.6), (4.6, -4.02)),
        ((-4.6, 4.02), (4.6, 4.6)),
        ((-4.6, -4.1), (-4.02, 4.1)),
        ((4.02, -4.1), (4.6, 4.1)),
    ):
        builder.box((*low, -0.1), (*high, 0.04), "Frame")
    builder.box((-30, -30, -0.9), (30, 30, -0.3), "Table")
    palette = {
        "Maple": material("Maple", (0.62, 0.42, 0.22), 0.5),
        "Walnut": material("Walnut", (0.15, 0.065, 0.03), 0.5),
        "Frame": material("Frame", (0.10, 0.04, 0.02), 0.4),
        "Table": material("Table", (0.045, 0.085, 0.075), 0.9),
    }
    place("Board", builder.mesh("Board", palette), group(scene, "Board"))


def _cast_without_foot(body, profile, collection) -> None:
    """Let a man without its foot cast the shadow: the board below, which layers reveal, then has light."""
    body.visible_shadow = False
    builder = MeshBuilder()
    above = profile[FOOT_POINTS:]
    builder.lathe(np.concatenate([[[0.0, above[0, 1]]], above]), 24, "Z", (0, 0, 0), "Shadow")
    name, paint = f"{body.name} shadow", body.data.materials[0]
    caster = place(name, builder.mesh(name, {"Shadow": paint}), collection, body.location, 0.0, LARGE)
    for ray in ("camera", "glossy", "diffuse", "transmission"):
        setattr(caster, f"visible_{ray}", False)


def _man(scene, words):
    """A chessman in a collection of its own: its name, its foot, and from where it is best seen."""
    import bpy
    from mathutils import Vector

    kind, colour, file, rank = words[0], words[1], int(words[2]), int(words[3])
    name = f"{'White' if colour == 'w' else 'Black'} {kind} {'abcdefgh'[file]}{rank + 1}"
    own = "Ivory" if colour == "w" else "Ebony"
    paint = bpy.data.materials.get(own) or material(
        own, {"Ivory": (0.72, 0.60, 0.42), "Ebony": (0.035, 0.02, 0.016)}[own], 0.35
    )
    builder = MeshBuilder()
    profile = np.array(PROFILES[kind].split(), float).reshape(-1, 2) / 1000
    builder.lathe(profile, 48, "Z", (0, 0, 0), own)
    parts = [builder.mesh(name, {own: paint}, outward=True, sharp=np.radians(50))]
    more = MeshBuilder()
    if kind == "Rook":
        for angle in np.arange(0, 360, 60):
            turn = np.radians(angle + np.array([-20.0, 20.0]))
            ring = [
                (r * np.cos(a), r * np.sin(a), z) for z in (0.94, 1.07) for r in (0.17, 0.26) for a in turn
            ]
            more.hexahedron(np.array(ring), own)
    elif kind == "King":
        more.box((-0.04, -0.03, 1.38), (0.04, 0.03, 1.72), own)
        more.box((-0.13, -0.03, 1.52), (0.13, 0.03, 1.60), own)
    elif kind == "Queen":
        for angle in np.radians(np.arange(0, 360, 45)):
            more.ball((0.2 * np.cos(angle), 0.2 * np.sin(angle), 1.3), (0.05, 0.05, 0.06), own, segments=12)
    elif kind == "Knight":
        forward, up = np.array(HEAD.split(), float).reshape(-1, 2).T / 1000
        count = len(up)
        for x in (-0.13, 0.13):
            more.add(np.stack([np.full(count, x), forward, up], axis=1), np.zeros((0, 4), int), own)
        number = np.arange(count)
        after = np.roll(number, -1)
        sides = np.stack([number, after, after + count, number + count], axis=1)
        more.add(np.zeros((0, 3)), sides - 2 * count, own)
        for cap in (number[::-1], number + count):
            more.add(np.zeros((0, 3)), cap[None] - 2 * count, own)
    collection = group(scene, name)
    foot = Vector((file - 3.5, rank - 3.5, 0.0))
    turn = 0.0 if colour == "w" else np.pi
    body = place(name, parts[0], collection, foot, turn, LARGE)
    _cast_without_foot(body, profile, collection)
    if more._faces:
        detail = place(
            f"{name} detail",
            more.mesh(f"{name} detail", {own: paint}, outward=True),
            collection,
            foot,
            turn,
            LARGE,
        )
        if kind == "Knight":
            bevel = detail.modifiers.new("Bevel", "BEVEL")
            bevel.width, bevel.segments, bevel.angle_limit = 0.05, 4, np.radians(50)
    up, right = SIDES[kind]
    return name, foot, (up, right if colour == "w" else -right)
