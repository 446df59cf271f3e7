# SPDX-License-Identifier: GPL-3.0-or-later
"""The scenes of the gallery beside the demo's street: a square, a hall, frames, a long street, a shaft.

Each function fills a scene; cameras look along +y, z is up, lengths are in metres.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace
from itertools import cycle, pairwise

import bpy
import numpy as np

from .buildings import House, RoofKind, build_house, building_materials
from .car import build_car, copy_car
from .mesh import MeshBuilder, material, place
from .street import build_lamp, build_tree, daylight, street_materials

# A side street of the long street: its middle, half its width; where the houses stand and end.
SIDE_STREETS, HALF_SIDE, FRONTS, STREET_END = (-24.0, 24.0), 6.0, 10.0, 54.0


def _palette() -> dict[str, bpy.types.Material]:
    colours = {
        "Light": (0.72, 0.70, 0.64),
        "Dark": (0.10, 0.11, 0.14),
        "Red": (0.56, 0.06, 0.04),
        "Orange": (0.72, 0.26, 0.03),
        "Yellow": (0.72, 0.52, 0.06),
        "Green": (0.10, 0.34, 0.12),
        "Blue": (0.05, 0.16, 0.46),
        "Violet": (0.26, 0.09, 0.36),
        "Stone": (0.48, 0.44, 0.38),
        "Pale stone": (0.64, 0.60, 0.53),
        "Brown": (0.27, 0.13, 0.06),
    }
    return {name: material(name, colour, 0.8) for name, colour in colours.items()}


def _group(scene: bpy.types.Scene, name: str) -> bpy.types.Collection:
    result = bpy.data.collections.new(name)
    scene.collection.children.link(result)
    return result


def _checkered(
    builder: MeshBuilder, low: tuple[float, float], high: tuple[float, float], z: float, tile: float
) -> None:
    """Tiles of two colours between two corners."""
    xs, ys = (np.arange(a, b - tile / 2, tile) for a, b in zip(low, high, strict=True))
    corner = np.array([(0, 0, 0), (tile, 0, 0), (tile, tile, 0), (0, tile, 0)])
    offsets = np.stack([*np.meshgrid(xs, ys, indexing="ij"), np.full((len(xs), len(ys)), z)], axis=-1)
    odd = np.add.outer(np.arange(len(xs)), np.arange(len(ys))) % 2 == 1
    for chosen, name in ((odd, "Light"), (~odd, "Stone")):
        builder.add_copies(corner, [(0, 1, 2, 3)], offsets[chosen], [name])


def _column(builder: MeshBuilder, x: float, y: float, radius: float, height: float, name: str) -> None:
    """A round column on a square foot, with a square capital."""
    wide = 1.35 * radius
    profile = [(radius * 1.15, 0.25), (radius, 0.45), (radius * 0.88, height - 0.5), (wide, height - 0.25)]
    builder.lathe(profile, 32, "Z", (x, y, 0), name)
    for low, high in ((0.0, 0.25), (height - 0.25, height)):
        builder.box((x - wide, y - wide, low), (x + wide, y + wide, high), "Pale stone")


def square(scene: bpy.types.Scene) -> None:
    """Blocks of many heights in rows on a checkered square: equal ones stand one behind the other."""
    builder = MeshBuilder()
    _checkered(builder, (-40, -14), (40, 60), 0.0, 2.0)
    colours = cycle(["Red", "Yellow", "Blue", "Orange", "Green", "Violet"])
    for row, y in enumerate(range(4, 56, 6)):
        name = next(colours)
        for column in range(-4, 5):
            height = (3.4, 1.6, 2.6, 1.0, 4.4)[abs(column)]
            x = 4.0 * column
            builder.box((x - 0.9, y - 0.9, 0.0), (x + 0.9, y + 0.9, height), name)
            builder.box((x - 0.6, y - 0.6, height), (x + 0.6, y + 0.6, height + 0.35), "Light")
            if row % 2 and column % 2:
                builder.ball((x, y, height + 0.95), (0.6, 0.6, 0.6), "Light")
    place("Square", builder.mesh("Square", _palette(), outward=True), _group(scene, "Square"))
    daylight(scene, _group(scene, "Lights"))


def house(scene: bpy.types.Scene) -> None:
    """One house on a checkered square, which shows the effect of a projection on its sides."""
    builder = MeshBuilder()
    _checkered(builder, (-30, -14), (30, 40), 0.0, 2.0)
    place("Square", builder.mesh("Square", _palette()), _group(scene, "Square"))
    houses, trees = _group(scene, "Houses"), _group(scene, "Trees")
    own = build_house(
        House((-5, -6), (5, 8), 2, wall="White wall", shop="Shop red", roof="GABLE", windows="SEWN")
    )
    place("House", own.mesh("House", building_materials()), houses)
    tree = build_tree(1).mesh("Tree", street_materials(), sharp=np.pi)
    for x, y in ((-10, -8), (-10, 4), (-10, 16), (10, -8), (10, 4), (10, 16)):
        place("Tree", tree, trees, (x, y, 0.0), x + y)
    daylight(scene, _group(scene, "Lights"), (42.0, 0.0, -30.0))


def hall(scene: bpy.types.Scene) -> None:
    """Three rows of columns under beams, square to the view, before a wall."""
    builder = MeshBuilder()
    _checkered(builder, (-42, -2), (42, 20), 0.0, 1.0)
    for y, name in ((5.0, "Red"), (10.0, "Yellow"), (15.0, "Blue")):
        for x in np.arange(-36.0, 36.1, 3.0):
            _column(builder, x, y, 0.45, 6.0, name)
        builder.box((-42, y - 0.6, 6.0), (42, y + 0.6, 6.9), "Pale stone")
    builder.box((-42, 20.0, 0.0), (42, 20.6, 12.0), "Stone")
    for x in np.arange(-37.5, 37.6, 3.0):
        builder.box((x - 0.6, 19.9, 1.0), (x + 0.6, 20.0, 4.0), "Dark")
    place("Hall", builder.mesh("Hall", _palette(), outward=True), _group(scene, "Hall"))
    daylight(scene, _group(scene, "Lights"), (52.0, 0.0, -35.0))


def frames(scene: bpy.types.Scene) -> None:
    """Square frames one behind the other, each smaller than the one before; an arrow upwards on a wall."""
    builder = MeshBuilder()
    rows = zip((3.0, 6.5, 10.0, 13.5, 17.0), (1.7, 1.42, 1.2, 1.02, 0.88), strict=True)
    for (y, half), name in zip(rows, ("Red", "Orange", "Yellow", "Green", "Blue"), strict=True):
        for side in (-1, 1):
            low, high = sorted((side * half, side * (half - 0.08)))
            builder.box((low, y, -half), (high, y + 0.25, half), name)
            builder.box((-half, y, low), (half, y + 0.25, high), name)
    edges = np.arange(-4.0, 4.0, 0.5)
    for i, x in enumerate(edges):
        for j, z in enumerate(edges):
            builder.box((x, 21.0, z), (x + 0.5, 21.2, z + 0.5), "Stone" if (i + j) % 2 else "Light")
    builder.box((-0.12, 20.9, -0.6), (0.12, 21.0, 0.2), "Violet")
    arrow = [(-0.35, 20.9, 0.2), (0.35, 20.9, 0.2), (0.0, 20.9, 0.7)]
    builder.add(arrow, [(0, 1, 2)], "Violet")
    place("Frames", builder.mesh("Frames", _palette()), _group(scene, "Frames"))
    daylight(scene, _group(scene, "Lights"), (70.0, 0.0, -25.0))


def colonnade(scene: bpy.types.Scene) -> None:
    """A passage between columns and rails that all run straight away from the viewer."""
    builder = MeshBuilder()
    for number, x in enumerate(np.arange(-7.0, 7.0, 0.5)):  # boards, for every edge is a line into depth
        builder.box(
            (x, 0.0, -0.1), (x + 0.5, 42.0, 0.0), ("Light", "Stone", "Pale stone", "Brown")[number % 4]
        )
    for side in (-1, 1):
        for y in np.arange(2.0, 42.0, 4.0):
            _column(builder, side * 4.5, y, 0.35, 5.5, "Yellow")
        builder.box((side * 4.5 - 0.45, 0, 5.5), (side * 4.5 + 0.45, 42, 6.1), "Pale stone")
        for z in (0.9, 1.8, 2.7, 3.6, 4.5):
            builder.box((side * 6.6 - 0.08, 0, z), (side * 6.6 + 0.08, 42, z + 0.16), "Red")
    for x in (-2.0, 2.0):
        builder.box((x - 0.12, 0, 0.0), (x + 0.12, 42, 0.04), "Blue")
    for x in (-3.2, 3.2):
        builder.box((x - 0.07, 0, 1.0), (x + 0.07, 42, 1.12), "Green")
        for y in np.arange(1.0, 42.0, 2.0):
            builder.box((x - 0.05, y - 0.05, 0.0), (x + 0.05, y + 0.05, 1.0), "Green")
    for x in range(-9, 9):
        for z in range(12):
            builder.box((x, 37.5, z), (x + 1, 37.7, z + 1), "Stone" if (x + z) % 2 else "Light")
    for y in np.arange(2.0, 42.0, 4.0):
        builder.box((-4.9, y - 0.12, 6.1), (4.9, y + 0.12, 6.4), "Brown")
    place("Colonnade", builder.mesh("Colonnade", _palette(), outward=True), _group(scene, "Colonnade"))
    daylight(scene, _group(scene, "Lights"))


def long_street(scene: bpy.types.Scene) -> None:
    """A row of fronts with two side streets, A and B, that run away from the viewer."""
    street = street_materials()
    ground = MeshBuilder()
    ground.add([(-90, -20, 0), (90, -20, 0), (90, 70, 0), (-90, 70, 0)], [(0, 1, 2, 3)], "Asphalt")
    for x in np.arange(-60.0, 60.0, 4.0):
        ground.box((x, 4.0, 0.0), (x + 2.0, 4.15, 0.01), "White line")
    edges = [-64.0, *(middle + side * HALF_SIDE for middle in SIDE_STREETS for side in (-1, 1)), 64.0]
    runs = list(zip(edges[::2], edges[1::2], strict=True))
    for start, end in runs:
        ground.box((start - 1.0, FRONTS - 2.5, 0.0), (end + 1.0, STREET_END, 0.14), "Kerb")
        ground.box((start - 0.8, FRONTS - 2.3, 0.14), (end + 0.8, STREET_END, 0.15), "Paving")
    for middle in SIDE_STREETS:
        for y in np.arange(9.0, STREET_END, 4.0):
            ground.box((middle - 0.1, y, 0.0), (middle + 0.1, y + 2.0, 0.01), "White line")
        for x in np.arange(middle - 4.0, middle + 4.1, 1.1):
            ground.box((x, 7.0, 0.0), (x + 0.55, 9.5, 0.01), "White line")
    place("Ground", ground.mesh("Ground", street), _group(scene, "Ground"))
    houses = _group(scene, "Houses")
    palette = building_materials()
    for number, house in enumerate(_long_street_houses(runs)):
        place(f"House {number:02}", build_house(house).mesh(f"House {number:02}", palette), houses)
    _furnish_side_streets(_group(scene, "Furniture"), street)
    daylight(scene, _group(scene, "Lights"), (50.0, 0.0, -22.0))
    letters = _group(scene, "Letters")
    for letter, middle in zip("AB", SIDE_STREETS, strict=True):
        curve = bpy.data.curves.new(letter, "FONT")
        curve.body, curve.size, curve.extrude, curve.align_x = letter, 3.0, 0.1, "CENTER"
        curve.materials.append(street["Post box"])
        text = bpy.data.objects.new(letter, curve)
        text.location, text.rotation_euler = (middle, FRONTS, 7.0), (np.pi / 2, 0.0, 0.0)
        letters.objects.link(text)


def _long_street_houses(runs: list[tuple[float, float]]) -> list[House]:
    """Fronts along the street, the sides of the side streets, and a house that closes each of these."""
    walls = cycle(["Ochre", "White wall", "Brick", "Cream", "Slate blue", "Rose", "Sage"])
    shops = cycle(["Shop red", "Shop blue", "Shop green", "Door"])
    roofs: cycle[RoofKind] = cycle(["FLAT", "GABLE", "HIP"])
    storeys = cycle([3, 2, 3, 3, 2])
    first = House((0, 0), (0, 0), 3, wall="", shop="", roof="FLAT", windows="")

    def house(low: tuple[float, float], high: tuple[float, float], windows: str, height: int) -> House:
        own = next(walls), next(shops), next(roofs)
        return replace(
            first, low=low, high=high, storeys=height, wall=own[0], shop=own[1], roof=own[2], windows=windows
        )

    result = []
    for start, end in runs:
        count = round((end - start) / 9.0)
        xs = np.linspace(start, end, count + 1)
        for i, (x0, x1) in enumerate(pairwise(xs)):
            windows = "S" + "W" * (i == 0) + "E" * (i == count - 1)
            result.append(house((x0, FRONTS), (x1, FRONTS + 11.0), windows, next(storeys)))
        for y in np.arange(FRONTS + 11.0, STREET_END - 5.0, 11.0):
            result.append(house((start, y), (start + 9.0, y + 11.0), "W", next(storeys)))
            result.append(house((end - 9.0, y), (end, y + 11.0), "E", next(storeys)))
    for middle in SIDE_STREETS:
        result.append(house((middle - 9.0, STREET_END), (middle + 9.0, STREET_END + 5.0), "S", 4))
    return result


def _furnish_side_streets(collection: bpy.types.Collection, palette: dict[str, bpy.types.Material]) -> None:
    tree = build_tree(1).mesh("Tree", palette, sharp=np.pi)
    lamp = build_lamp().mesh("Street lamp", palette, outward=True)
    for middle in SIDE_STREETS:
        for number, y in enumerate(np.arange(13.0, STREET_END - 3.0, 6.5)):
            for side in (-1, 1):
                mesh = (tree, lamp)[number % 2]
                place(mesh.name, mesh, collection, (middle + side * 4.6, y, 0.14), y, (0.75, 1.0)[number % 2])
    car = build_car(collection)
    car.location, car.rotation_euler.z = (-25.8, 22.0, 0.0), np.pi
    for name, colour, x, y in (
        ("Red car", (0.38, 0.012, 0.010), 26.2, 18.0),
        ("Cream car", (0.60, 0.48, 0.28), -4.0, 5.6),
    ):
        copy_car(
            car, name, material(f"{name} paint", colour, 0.25), collection, (x, y, 0.0), np.pi / 2 * (x < 0)
        )


def shaft(scene: bpy.types.Scene) -> None:
    """A deep shaft with stairs from landing to landing, seen from the middle of its height."""
    half, front, back, bottom, top, storey, steps = 4.6, -6.0, 6.0, -28.0, 28.0, 4.0, 12
    builder, sides = MeshBuilder(), MeshBuilder()
    builder.box((-half, back, bottom), (half, back + 0.4, top), "Pale stone")
    builder.box((-half, front, bottom - 0.4), (half, back, bottom), "Blue")
    builder.box((-half, front, top), (half, back, top + 0.4), "Yellow")
    for x in (-4.3, -1.45, 1.45, 4.3):
        builder.box((x - 0.2, back - 0.4, bottom), (x + 0.2, back, top), "Blue")
    for x in (-half, half - 0.3):
        sides.box((x, front, bottom), (x + 0.3, back, top), "Stone")
    for level in np.arange(bottom, top - storey / 2, storey):
        turn = 1 if round(level / storey) % 2 else -1
        builder.box((-half, back - 0.5, level - 0.25), (half, back, level), "Brown")
        for x in (-2.9, 0.0, 2.9):  # dark doorways behind the landings
            builder.box((x - 0.6, back - 0.02, level), (x + 0.6, back, level + 2.2), "Dark")
        for low, high in ((-half, -3.3), (3.3, half)):
            builder.box((low, 3.6, level - 0.25), (high, back, level), "Brown")
        for step in range(steps):
            low, high = sorted(turn * (-3.3 + 6.6 * (step + k) / steps) for k in (0, 1))
            z = level + storey * (step + 1) / steps
            builder.box((low, 3.6, z - 0.33), (high, 4.9, z), "Orange" if step % 2 else "Red")
        for side in (-1, 1):  # openings in the side walls
            low, high = sorted((side * (half - 0.3), side * (half - 0.32)))
            for y in (-2.5, 0.5):
                sides.box((low, y - 0.8, level + 0.8), (high, y + 0.8, level + 3.0), "Dark")
    palette = _palette()
    place("Shaft", builder.mesh("Shaft", palette), _group(scene, "Shaft"))
    place("Side walls", sides.mesh("Side walls", palette), _group(scene, "Side walls"))
    lights = _group(scene, "Lights")
    daylight(scene, lights, (24.0, 0.0, -20.0))
    for number, z in enumerate(np.arange(-24.0, 25.0, 12.0)):
        data = bpy.data.lights.new(f"Lantern {number}", "POINT")
        data.energy, data.color = 2200.0, (1.0, 0.86, 0.68)
        lamp = bpy.data.objects.new(data.name, data)
        lamp.location = (1.5, -4.0, z)
        lights.objects.link(lamp)


SCENES: dict[str, Callable[[bpy.types.Scene], object]] = {
    "square": square,
    "house": house,
    "hall": hall,
    "frames": frames,
    "colonnade": colonnade,
    "long street": long_street,
    "shaft": shaft,
}
