# SPDX-License-Identifier: GPL-3.0-or-later
"""Parts of towns: a street with four side streets, and a square behind a palace."""

from __future__ import annotations

from collections.abc import Sequence
from itertools import cycle

import numpy as np

from ..buildings import House, build_clock_tower, build_house, building_materials
from ..car import build_car, copy_car
from ..mesh import MeshBuilder, material, place
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


def day(scene, angles: tuple[float, float, float]) -> None:
    """Sky and sun, which is turned by angles in degrees."""
    daylight(scene, group(scene, "Lights"), angles)
