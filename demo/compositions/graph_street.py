# SPDX-License-Identifier: GPL-3.0-or-later
"""A street with four side streets, of which one picture shows the ends: a graph camera as one volume.

Popescu, Rosen and Adamo-Villani, The Graph Camera (SIGGRAPH Asia 2009): frusta that bend and split.
"""

from __future__ import annotations

import numpy as np

from . import town
from .parts import Tile, add_camera, frame_rays, new_scene, tiled

SIZE = (1240, 480)
LENS, EYE = 21.5, np.array([0.0, 0.0, 2.9])
# Half the width of the street, and where the side streets begin and end.
HALF = 7.0
SIDES = ((9.5, 20.0), (24.0, 56.0))
END, REACH = 98.0, 62.0
# How far before a side street's mouth its own eye is, in widths of the mouth; how far the image looks up.
BACK, RISE = 0.8, 0.15
NEAR, FAR = 0.2, 160.0
# Who walks in the street: x, y, turn in degrees.
PEOPLE = (
    (-2.6, 22.2, 80.0),
    (0.2, 21.6, -95.0),
    (5.9, 21.6, -30.0),
    (-5.8, 22.2, 170.0),
    (-3.6, 14.2, 150.0),
    (-2.9, 14.0, 200.0),
    (4.4, 15.5, -60.0),
    (-24.0, 24.0, 90.0),
    (22.0, 23.6, 90.0),
)
COLUMNS, ROWS = 48, 12


def build():
    """A street along y with two crossings, and its camera."""
    scene = new_scene(*SIZE)
    _build_town(scene)
    camera = scene.camera = add_camera(scene, "Graph Camera", EYE, EYE + np.array([0.0, 1.0, 0.0]), LENS)
    tiled(camera, _tiles(), ("Eye", "Mouths", "Far"))
    return scene


def edges() -> list[tuple[float, float, int]]:
    """Parts of the image from left to right: their borders, and the side street: ±1, ±2, 0 for none."""
    places = {
        -number: tuple(0.5 - HALF / y * LENS / 36.0 for y in mouth) for number, mouth in enumerate(SIDES, 1)
    }
    places |= {-number: (1.0 - high, 1.0 - low) for number, (low, high) in places.items()}
    parts, x = [], 0.0
    for number, (low, high) in sorted(places.items(), key=lambda item: item[1]):
        parts += [(x, low, 0), (low, high, number)]
        x = high
    return [*parts, (x, 1.0, 0)]


def _tiles() -> list[Tile]:
    """Straight parts, and parts whose projectors bend in the mouth of a side street."""
    tiles, aspect = [], SIZE[0] / SIZE[1]
    for low, high, number in edges():
        x, y = np.meshgrid(np.linspace(low, high, COLUMNS + 1), np.linspace(0, 1, ROWS + 1))
        places = np.stack([x, y], axis=-1)
        rays = frame_rays(places + np.array([0.0, RISE]), LENS, aspect)
        if number == 0:
            tiles.append(Tile(places, [NEAR * rays, 0.5 * FAR * rays, FAR * rays]))
            continue
        # Camera space: x to the right, -z along the street.
        side, (begin, end) = np.sign(number), SIDES[abs(number) - 1]
        mouth = HALF / np.abs(rays[..., :1]) * rays
        back = BACK * (end - begin)
        eye = np.array([side * (HALF - back), 0.0, -(begin + end) / 2])
        tiles.append(Tile(places, [NEAR * rays, mouth, mouth + FAR / back * (mouth - eye)]))
    return tiles


def _build_town(scene) -> None:
    plots, trees, lamps = [], [], []
    runs = [(-14.0, SIDES[0][0]), (SIDES[0][1], SIDES[1][0]), (SIDES[1][1], END)]
    storeys = iter([3, 2, 3, 4, 3, 2, 3, 3, 2, 4, 3, 3, 2, 3, 4, 2] * 20)
    for side, front in ((-1, "E"), (1, "W")):
        for low, high in runs:
            count = max(1, round((high - low) / 9.0))
            for y0, y1 in zip(
                *(np.linspace(low, high, count + 1)[k : k + count] for k in (0, 1)), strict=True
            ):
                walls = front + ("S" if y0 == low else "") + ("N" if y1 == high else "")
                xs = sorted((side * HALF, side * (HALF + 10.0)))
                plots.append(((xs[0], y0), (xs[1], y1), walls, next(storeys)))
            # The sides of the side streets.
            for x in np.arange(HALF + 10.0, REACH, 10.0):
                xs = sorted((side * x, side * (x + 10.0)))
                for y0, y1, wall in ((low, min(low + 9.0, high), "S"), (max(high - 9.0, low), high, "N")):
                    if high - low < 14.0:
                        y0, y1, wall = low, high, "SN"
                    plots.append(((xs[0], y0), (xs[1], y1), wall, next(storeys)))
        for number, (low, high) in enumerate(SIDES):
            xs = sorted((side * (REACH + 2.0), side * (REACH + 14.0)))
            plots.append(((xs[0], low - 6.0), (xs[1], high + 6.0), front, 4))
            for x in np.arange(HALF + 7.0, REACH - 6.0, 9.0):
                trees += [(side * x, high - 5.0)] if number else [(side * x, high - 1.4)]
                lamps += [(side * (x + 4.5), high - 1.2 if number else low + 1.2)]
    plots.append(((-12.0, END + 16.0), (12.0, END + 26.0), "S", 4))
    town.houses(scene, plots)
    pavements = []
    for side in (-1, 1):
        for low, high in runs:
            xs = sorted((side * (HALF - 2.0), side * (REACH + 2.0)))
            pavements.append((xs[0], low - 1.8, xs[1], high + 1.8))
    town.ground(scene, 130.0, pavements)
    trees += [(side * (HALF - 1.2), y) for side in (-1, 1) for y in (52.0, 61.0, 70.0, 79.0)]
    town.furnish(scene, trees, lamps)
    town.clock_tower(scene, (0.0, END + 8.0), -1.0)
    mouths = [(low + high) / 2 for low, high in SIDES]
    town.cars(
        scene,
        (
            ("Car", (0, 0, 0), -HALF - 7.0, mouths[0] - 1.2, -np.pi / 2),
            ("Red car", (0.38, 0.012, 0.010), HALF + 6.0, mouths[0] + 0.6, np.pi / 2),
            ("Cream car", (0.60, 0.48, 0.28), -HALF - 12.0, mouths[1] + 2.6, np.pi / 2),
            ("Blue car", (0.03, 0.08, 0.34), HALF + 12.0, mouths[1], -np.pi / 2),
            ("White car", (0.62, 0.62, 0.60), 2.6, 29.0, 0.0),
        ),
    )
    zebra = [(x, 20.8, x + 0.6, 23.4) for x in np.arange(2.3 - HALF, HALF - 2.3, 1.25)]
    middle = [(-0.09, y, 0.09, y + 2.0) for y in np.arange(26.0, END, 4.5)]
    town.stripes(scene, [*zebra, *middle])
    town.walkers(scene, PEOPLE)
    # Each part of the image has a sky of its own, so that it has one color.
    town.dusk(scene, (66.0, 0.0, -24.0), exposure=0.75)
