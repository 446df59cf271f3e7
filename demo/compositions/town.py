# SPDX-License-Identifier: GPL-3.0-or-later
"""Parts of towns: a street with four side streets, and a square behind a palace."""

from __future__ import annotations

from collections.abc import Sequence
from itertools import cycle

import numpy as np

from ..buildings import House, build_clock_tower, build_house, building_materials
from ..car import build_car, copy_car
from ..evening import evening
from ..mesh import MeshBuilder, material, place
from ..people import people
from ..street import build_lamp, build_tree, daylight, street_materials

WALLS = ("Ochre", "White wall", "Brick", "Cream", "Slate blue", "Rose", "Sage")
SHOPS = ("Shop red", "Shop blue", "Shop green", "Door")
ROOFS = ("FLAT", "GABLE", "HIP")


def group(scene, name: str):
    """A new collection of a scene."""
    import bpy

    made = bpy.data.collections.new(name)
    scene.collection.children.link(made)
    return made


def houses(scene, plots: Sequence[tuple[tuple[float, float], tuple[float, float], str, int]], name="Houses"):
    """Houses on plots: the corners of each, its walls with windows, and its storeys."""
    collection, palette = group(scene, name), building_materials()
    choices = zip(cycle(WALLS), cycle(SHOPS), cycle(ROOFS), strict=False)
    for number, ((low, high, windows, storeys), (wall, shop, roof)) in enumerate(
        zip(plots, choices, strict=False)
    ):
        own = House(low, high, storeys, wall=wall, shop=shop, roof=roof, windows=windows)
        place(f"{name} {number:02}", build_house(own).mesh(f"{name} {number:02}", palette), collection)
    return collection


def ground(scene, half: float, pavements: Sequence[tuple[float, float, float, float]]) -> None:
    """Asphalt as far as ``half``, and raised pavements: low x, low y, high x, high y."""
    builder = MeshBuilder()
    builder.add(
        [(-half, -half, 0), (half, -half, 0), (half, half, 0), (-half, half, 0)], [(0, 1, 2, 3)], "Asphalt"
    )
    for x0, y0, x1, y1 in pavements:
        builder.box((x0, y0, 0.0), (x1, y1, 0.14), "Kerb")
        builder.box((x0 + 0.2, y0 + 0.2, 0.14), (x1 - 0.2, y1 - 0.2, 0.15), "Paving")
    place("Ground", builder.mesh("Ground", street_materials()), group(scene, "Ground"))


def furnish(scene, trees: Sequence[tuple[float, float]], lamps: Sequence[tuple[float, float]]) -> None:
    """Trees and street lamps at places."""
    collection, palette = group(scene, "Furniture"), street_materials()
    shapes = [build_tree(seed).mesh(f"Tree {seed}", palette, sharp=np.pi) for seed in (1, 2, 3)]
    lamp = build_lamp().mesh("Street lamp", palette, outward=True)
    for number, (x, y) in enumerate(trees):
        place(
            f"Tree {number:02}",
            shapes[number % 3],
            collection,
            (x, y, 0.14),
            1.7 * number,
            0.85 + 0.1 * (number % 3),
        )
    for number, (x, y) in enumerate(lamps):
        place(f"Street lamp {number:02}", lamp, collection, (x, y, 0.14))


def cars(scene, parked: Sequence[tuple[str, tuple[float, float, float], float, float, float]]) -> None:
    """Cars: names, paints, places and turns; the first has the paint of the demo's."""
    collection = group(scene, "Cars")
    first = None
    for name, paint, x, y, turn in parked:
        if first is None:
            first = build_car(collection)
            first.location, first.rotation_euler.z = (x, y, 0.0), turn
            continue
        copy_car(first, name, material(f"{name} paint", paint, 0.25), collection, (x, y, 0.0), turn)


def clock_tower(scene, at: tuple[float, float], facing: float) -> None:
    """A tower with a clock, that faces south (-1) or north (1)."""
    tower = build_clock_tower(at, facing)
    place("Clock tower", tower.mesh("Clock tower", building_materials(), outward=True), group(scene, "Tower"))


def walkers(scene, spots: Sequence[tuple[float, float, float]], height: float = 0.0) -> None:
    """People at places, x and y, turned by degrees; they stand at a height."""
    collection, figures = group(scene, "People"), people()
    for number, ((x, y, turn), coat) in enumerate(zip(spots, cycle(figures), strict=False)):
        place(f"Person {number:02}", figures[coat], collection, (x, y, height), np.radians(turn))


def stripes(scene, rectangles: Sequence[tuple[float, float, float, float]]) -> None:
    """White lines on the road: low x, low y, high x, high y."""
    builder = MeshBuilder()
    for x0, y0, x1, y1 in rectangles:
        corners = [(x0, y0, 0.012), (x1, y0, 0.012), (x1, y1, 0.012), (x0, y1, 0.012)]
        builder.add(corners, [(0, 1, 2, 3)], "White line")
    place("Lines", builder.mesh("Lines", street_materials()), group(scene, "Lines"))


def hills(scene, radius: float, height: float, middle: tuple[float, float]) -> None:
    """A ring of hills round a town, that hides the end of its ground."""
    turn = np.linspace(0, 2 * np.pi, 181)
    rise = 0.55 + 0.2 * np.sin(3 * turn + 0.6) + 0.15 * np.sin(7 * turn + 2.0) + 0.07 * np.sin(17 * turn)
    rings = [
        np.stack(
            [
                middle[0] + out * radius * np.sin(turn),
                middle[1] + out * radius * np.cos(turn),
                share * height * rise - 0.1,
            ],
            axis=1,
        )
        for out, share in ((0.86, 0.0), (0.94, 0.6), (1.0, 0.9), (1.06, 1.0))
    ]
    builder = MeshBuilder()
    builder.grid(np.stack(rings), "Hills")
    palette = {"Hills": material("Hills", (0.12, 0.17, 0.13), 0.95)}
    place("Hills", builder.mesh("Hills", palette, sharp=np.pi), group(scene, "Hills"))


def dusk(scene, sun: tuple[float, float, float], **look) -> None:
    """The evening of the large pictures. sun: its angles in degrees. look: see ``evening``."""
    daylight(scene, group(scene, "Lights"), sun)
    evening(scene, sun, **look)
