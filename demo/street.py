# SPDX-License-Identifier: GPL-3.0-or-later
"""The demo's scene: a car on the crossing of two streets, with houses, trees, lamps, a sky and a sun.

Everything is built in code, in metres. The middle of the crossing is the origin; the main street runs
along y, the side street along x. Only the car, the road and its markings are in FREE_ZONE, through which the
projectors of the around-the-car volume run.
"""

from __future__ import annotations

from itertools import cycle

import bmesh
import bpy
import numpy as np

from .buildings import House, RoofKind, build_clock_tower, build_house, building_materials
from .car import build_car, copy_car
from .mesh import Array, MeshBuilder, material, place

# The corners (x, y, z) of the box around the car that is kept free.
FREE_ZONE = ((-6.6, -10.6, 0.02), (6.6, 5.0, 4.0))

# Distances of houses and kerbs from a street's middle, the start of the raised pavements, and their height.
HALF_STREET, HALF_ROAD, CORNER, KERB = 9.0, 5.0, 10.6, 0.13
# The ends of the streets' markings.
MAIN_END, SIDE_END = 58.0, 44.0
TREE_SEED = 7

# (name, paint, x, y, turn): two more cars at the kerb of the main street.
PARKED = (
    ("Red car", (0.38, 0.012, 0.010), 3.75, 18.5, 0.0),
    ("Cream car", (0.60, 0.48, 0.28), -3.75, -21.0, np.pi),
)

SKY, SKY_STRENGTH = (0.30, 0.50, 0.86), 0.85
# From the front right of the car, steep enough to reach the crossing between the houses; degrees.
SUN_STRENGTH, SUN_ANGLES = 4.2, (46.0, 0.0, -20.0)
EXPOSURE = 0.5


def street_materials() -> dict[str, bpy.types.Material]:
    """The palette of the ground, the trees and the lamps by name."""
    return {
        "Asphalt": material("Asphalt", (0.075, 0.077, 0.082), 0.85),
        "Paving": material("Paving", (0.30, 0.28, 0.25), 0.85),
        "Paving light": material("Paving light", (0.38, 0.36, 0.32), 0.85),
        "Kerb": material("Kerb", (0.48, 0.47, 0.44), 0.8),
        "White line": material("White line", (0.78, 0.78, 0.75), 0.7),
        "Yellow line": material("Yellow line", (0.78, 0.48, 0.03), 0.7),
        "Bark": material("Bark", (0.11, 0.065, 0.035), 0.9),
        "Leaves": material("Leaves", (0.085, 0.19, 0.03), 0.8),
        "Leaves light": material("Leaves light", (0.15, 0.26, 0.04), 0.8),
        "Soil": material("Soil", (0.06, 0.04, 0.025), 0.95),
        "Iron": material("Iron", (0.02, 0.028, 0.025), 0.4),
        "Lantern": material("Lantern", (1.0, 0.78, 0.45), 0.3, 0.0, 2.0),
        "Post box": material("Post box", (0.50, 0.012, 0.012), 0.3),
        "Wood": material("Wood", (0.25, 0.12, 0.05), 0.6),
    }


def _rectangle(
    builder: MeshBuilder, low: tuple[float, float], high: tuple[float, float], z: float, name: str
) -> None:
    (x0, y0), (x1, y1) = low, high
    builder.add([(x0, y0, z), (x1, y0, z), (x1, y1, z), (x0, y1, z)], [(0, 1, 2, 3)], name)


def _line(builder: MeshBuilder, start: Array, end: Array, width: float, z: float, name: str) -> None:
    along = (end - start) / np.linalg.norm(end - start)
    side = width / 2 * np.array([-along[1], along[0]])
    corners = [start - side, end - side, end + side, start + side]
    builder.add([(*corner, z) for corner in corners], [(0, 1, 2, 3)], name)


def _build_ground() -> MeshBuilder:
    """Road, square and raised pavements."""
    builder = MeshBuilder()
    _rectangle(builder, (-120, -120), (120, 120), 0.0, "Asphalt")
    tile = 1.0
    edges = np.arange(HALF_ROAD, CORNER - 0.1, tile)
    for sx in (-1, 1):
        for sy in (-1, 1):
            for i, x in enumerate(edges):
                for j, y in enumerate(edges):
                    xs, ys = sorted((sx * x, sx * (x + tile))), sorted((sy * y, sy * (y + tile)))
                    name = "Paving" if (i + j) % 2 else "Paving light"
                    _rectangle(builder, (xs[0], ys[0]), (xs[1], ys[1]), 0.006, name)
            for low, high in (
                ((HALF_ROAD, CORNER), (HALF_STREET, MAIN_END + 20)),
                ((CORNER, HALF_ROAD), (SIDE_END + 20, HALF_STREET)),
            ):
                xs, ys = sorted((sx * low[0], sx * high[0])), sorted((sy * low[1], sy * high[1]))
                builder.box((xs[0], ys[0], -0.05), (xs[1], ys[1], KERB), "Kerb")
                inset = 0.25
                _rectangle(
                    builder,
                    (xs[0] + inset, ys[0] + inset),
                    (xs[1] - inset, ys[1] - inset),
                    KERB + 0.004,
                    "Paving",
                )
    return builder


def _build_markings() -> MeshBuilder:
    """Centre lines, zebra crossings and the yellow box of the crossing."""
    builder = MeshBuilder()
    z, half = 0.006, HALF_ROAD - 0.35
    for turn in range(4):
        cosine, sine = [(1, 0), (0, 1), (-1, 0), (0, -1)][turn]
        turned = np.array([[cosine, -sine], [sine, cosine]])
        reach = MAIN_END if turn % 2 == 0 else SIDE_END
        for x in np.arange(-4.2, 4.3, 1.2):
            _line(builder, turned @ [x, 6.2], turned @ [x, 8.8], 0.6, z, "White line")
        _line(builder, turned @ [-HALF_ROAD + 0.3, 9.7], turned @ [0.0, 9.7], 0.35, z, "White line")
        for y in np.arange(11.0, reach, 4.5):
            _line(builder, turned @ [0, y], turned @ [0, y + 2.5], 0.14, z, "White line")
        for x in (-half, half):
            _line(builder, turned @ [x, 11.0], turned @ [x, reach], 0.10, z, "Yellow line")
        # Crossing lines differ in height: path tracers show black where two are in one plane.
        above = z + (0.004 if turn % 2 else 0.005)
        _line(builder, turned @ [-half, half], turned @ [half, half], 0.16, above, "Yellow line")
    for offset in np.arange(-6.0, 6.1, 2.0):
        low, high = max(-half, offset - half), min(half, offset + half)
        for sign in (1, -1):
            start, end = np.array([low, sign * (offset - low)]), np.array([high, sign * (offset - high)])
            _line(builder, start, end, 0.13, z + (0.002 if sign > 0 else 0.0), "Yellow line")
    return builder


def _icosphere(subdivisions: int) -> tuple[Array, Array]:
    work = bmesh.new()
    bmesh.ops.create_icosphere(work, subdivisions=subdivisions, radius=1.0)
    vertices = np.array([vertex.co[:] for vertex in work.verts])
    faces = np.array([[vertex.index for vertex in face.verts] for face in work.faces])
    work.free()
    return vertices, faces


def build_tree(seed: int) -> MeshBuilder:
    """A trunk with boughs and a crown of lumpy balls, five to six metres high."""
    builder = MeshBuilder()
    random = np.random.default_rng(seed)
    builder.lathe(
        [(0.24, 0.0), (0.17, 0.25), (0.14, 1.2), (0.12, 2.4), (0.08, 3.6), (0.0, 4.2)],
        12,
        "Z",
        (0, 0, 0),
        "Bark",
    )
    sphere, faces = _icosphere(3)
    crowns = [(0.0, 0.0, 4.6, 1.35)]
    for angle in np.radians(np.arange(0, 360, 60) + random.uniform(-15, 15, 6)):
        reach, height = random.uniform(0.85, 1.1), random.uniform(3.2, 4.3)
        crowns.append((reach * np.cos(angle), reach * np.sin(angle), height, random.uniform(0.85, 1.1)))
    crowns.append((random.uniform(-0.3, 0.3), random.uniform(-0.3, 0.3), 5.5, 0.85))
    for i, (x, y, z, radius) in enumerate(crowns):
        waves = np.sin(sphere @ random.normal(0, 4.5, (3, 6)) + random.uniform(0, 6, 6)).sum(axis=1)
        lumps = 1 + 0.05 * waves
        points = sphere * lumps[:, None] * np.array([1, 1, 0.85]) * radius + (x, y, z)
        builder.add(points, faces, "Leaves" if i % 2 else "Leaves light", smooth=True)
    return builder


def _build_tree_pit() -> MeshBuilder:
    builder = MeshBuilder()
    builder.box((-0.8, -0.8, 0), (0.8, 0.8, 0.06), "Kerb")
    builder.box((-0.65, -0.65, 0), (0.65, 0.65, 0.075), "Soil")
    return builder


def build_lamp() -> MeshBuilder:
    """A street lamp, four and a half metres high."""
    builder = MeshBuilder()
    builder.lathe(
        [
            (0.20, 0.0),
            (0.20, 0.12),
            (0.12, 0.2),
            (0.11, 0.9),
            (0.06, 1.0),
            (0.045, 3.6),
            (0.07, 3.65),
            (0.10, 3.75),
            (0.0, 3.75),
        ],
        16,
        "Z",
        (0, 0, 0),
        "Iron",
    )
    builder.lathe([(0.10, 3.76), (0.20, 4.25)], 6, "Z", (0, 0, 0), "Lantern")
    builder.lathe(
        [(0.24, 4.24), (0.24, 4.28), (0.09, 4.48), (0.05, 4.5), (0.0, 4.62)], 6, "Z", (0, 0, 0), "Iron"
    )
    builder.box((-0.38, -0.02, 3.45), (0.38, 0.02, 3.49), "Iron")
    return builder


def _build_bench() -> MeshBuilder:
    builder = MeshBuilder()
    for y in np.linspace(-0.22, 0.18, 4):
        builder.box((-0.9, y, 0.43), (0.9, y + 0.08, 0.47), "Wood")
    for z in (0.58, 0.72, 0.86):
        builder.box((-0.9, 0.26, z), (0.9, 0.30, z + 0.10), "Wood")
    for x in (-0.75, 0.70):
        builder.box((x, -0.2, 0), (x + 0.05, 0.30, 0.43), "Iron")
        builder.box((x, 0.25, 0.43), (x + 0.05, 0.30, 0.95), "Iron")
    return builder


def _build_post_box() -> MeshBuilder:
    builder = MeshBuilder()
    builder.lathe([(0.24, 0.0), (0.24, 0.18), (0.22, 0.2)], 24, "Z", (0, 0, 0), "Iron")
    builder.lathe(
        [(0.22, 0.2), (0.22, 1.35), (0.27, 1.38), (0.27, 1.46), (0.18, 1.55), (0.0, 1.58)],
        24,
        "Z",
        (0, 0, 0),
        "Post box",
    )
    builder.box((-0.13, -0.24, 1.18), (0.13, -0.2, 1.22), "Iron")
    return builder


def _houses() -> list[House]:
    """Four corner houses and the rows along both streets."""
    walls = cycle(["Ochre", "White wall", "Brick", "Cream", "Slate blue", "Rose", "Stone", "Sage", "Cream"])
    shops = cycle(["Shop red", "Shop blue", "Shop green", "Door", "Slate blue"])
    roofs: cycle[RoofKind] = cycle(["GABLE", "FLAT", "HIP", "GABLE", "HIP"])
    storeys = cycle([4, 3, 5, 4, 3, 4, 5])
    awnings = cycle([True, False, False])
    houses = []

    def add(
        xs: tuple[float, float], ys: tuple[float, float], windows: str, roof: RoofKind | None = None
    ) -> None:
        (x0, x1), (y0, y1) = sorted(xs), sorted(ys)
        houses.append(
            House(
                (x0, y0),
                (x1, y1),
                next(storeys),
                wall=next(walls),
                shop=next(shops),
                roof=roof or next(roofs),
                windows=windows,
                awnings=next(awnings),
            )
        )

    depth = 12.0
    for sx in (-1, 1):
        for sy in (-1, 1):
            to_main, to_side = ("E" if sx < 0 else "W"), ("N" if sy < 0 else "S")
            near, far = HALF_STREET, HALF_STREET + depth
            add((sx * near, sx * far), (sy * near, sy * far), to_main + to_side, "FLAT")
            start = far
            for width in (9.0, 11.0, 8.5, 11.0):
                add((sx * near, sx * far), (sy * start, sy * (start + width)), to_main)
                start += width
            start = far
            for width in (10.0, 8.5, 11.0):
                add((sx * start, sx * (start + width)), (sy * near, sy * far), to_side)
                start += width
    for sx in (-1, 1):
        x = sx * (SIDE_END + 12)
        add((x, x + sx * depth), (-14.0, 14.0), "E" if sx < 0 else "W", "HIP")
    add((-14.0, 14.0), (-MAIN_END - 14 - depth, -MAIN_END - 14), "N", "HIP")
    add((-26.0, 26.0), (MAIN_END + 16, MAIN_END + 16 + depth), "S", "HIP")
    return houses


def _furnish(collection: bpy.types.Collection, palette: dict[str, bpy.types.Material]) -> None:
    """Trees, lamps, benches and post boxes along the pavements."""
    trees = [build_tree(seed).mesh(f"Tree {seed}", palette, sharp=np.pi) for seed in (1, 2, 3)]
    pit, lamp = (
        _build_tree_pit().mesh("Tree pit", palette),
        build_lamp().mesh("Street lamp", palette, outward=True),
    )
    bench, post_box = (
        _build_bench().mesh("Bench", palette),
        _build_post_box().mesh("Post box", palette, outward=True),
    )
    random = np.random.default_rng(TREE_SEED)
    count = 0
    for sx in (-1, 1):
        for sy in (-1, 1):
            spots = [(6.3, y) for y in (16.5, 26.0, 36.0, 47.0)] + [(x, 6.3) for x in (17.0, 29.0)]
            for x, y in spots:
                location = (sx * x, sy * y, KERB)
                place(
                    f"Tree {count:02}",
                    trees[count % 3],
                    collection,
                    location,
                    random.uniform(0, 6.28),
                    random.uniform(0.9, 1.2),
                )
                place(f"Tree pit {count:02}", pit, collection, location)
                count += 1
            for i, (x, y) in enumerate([(5.7, 12.0), (5.7, 31.0), (12.5, 5.7), (23.0, 5.7)]):
                place(
                    f"Street lamp {sx:+}{sy:+}{i}",
                    lamp,
                    collection,
                    (sx * x, sy * y, KERB),
                    0.0 if i < 2 else np.pi / 2,
                )
            place(f"Bench {sx:+}{sy:+}", bench, collection, (sx * 8.2, sy * 20.0, KERB), -sx * np.pi / 2)
    place("Post box", post_box, collection, (8.3, 11.6, KERB), -np.pi / 2)
    place("Post box 2", post_box, collection, (-8.3, -13.0, KERB), np.pi / 2)


def _light(
    collection: bpy.types.Collection,
    name: str,
    kind: str,
    energy: float,
    colour: tuple[float, float, float],
    *,
    location: tuple[float, float, float],
    rotation: tuple[float, float, float] = (0.0, 0.0, 0.0),
) -> bpy.types.Light:
    """Add a lamp, turned by angles in degrees; returns its data."""
    data = bpy.data.lights.new(name, kind)
    data.energy, data.color = energy, colour
    lamp = bpy.data.objects.new(name, data)
    lamp.location, lamp.rotation_euler = location, np.radians(rotation)
    collection.objects.link(lamp)
    return data


def daylight(
    scene: bpy.types.Scene,
    collection: bpy.types.Collection,
    angles: tuple[float, float, float] = SUN_ANGLES,
) -> None:
    """Sky, sun (turned by angles in degrees), and the view transform of the scene."""
    world = bpy.data.worlds.new("Sky")
    if world.node_tree is None:
        world.use_nodes = True
    background = world.node_tree.nodes["Background"]
    background.inputs["Color"].default_value = (*SKY, 1.0)
    background.inputs["Strength"].default_value = SKY_STRENGTH
    world.color = tuple(SKY_STRENGTH * channel for channel in SKY)
    scene.world = world
    sun = _light(
        collection, "Sun", "SUN", SUN_STRENGTH, (1.0, 0.93, 0.82), location=(-20, -30, 40), rotation=angles
    )
    sun.angle = np.radians(0.5)
    set_view(scene)


def _lamplight(collection: bpy.types.Collection) -> None:
    """The glow of two street lamps and a fill light for the shaded side."""
    fill = _light(
        collection,
        "Fill",
        "AREA",
        260.0,
        (0.85, 0.92, 1.0),
        location=(6.0, 7.5, 5.0),
        rotation=(-60.0, 0.0, -38.7),
    )
    fill.shape, fill.size, fill.size_y = "RECTANGLE", 4.0, 2.5
    for name, x, y in (("Lamp glow left", -5.7, 12.0), ("Lamp glow right", 5.7, 12.0)):
        glow = _light(collection, name, "POINT", 220.0, (1.0, 0.72, 0.40), location=(x, y, 4.75 + KERB))
        glow.shadow_soft_size = 0.2


def _build_signs(collection: bpy.types.Collection, lettering: bpy.types.Material) -> None:
    """Names over the corner shops, as text objects."""
    names = iter(("BOOKS", "BAKERY", "CAFE", "FLOWERS", "TEA ROOM", "TAILOR", "RECORDS", "CLOCKS"))
    for sx in (-1, 1):
        for sy in (-1, 1):
            front, middle = HALF_STREET - 0.13, HALF_STREET + 6.0
            for location, turn in (
                ((sx * front, sy * middle), -sx * np.pi / 2),
                ((sx * middle, sy * front), (sy > 0) * np.pi + np.pi),
            ):
                name = next(names)
                curve = bpy.data.curves.new(f"Sign {name}", "FONT")
                curve.body, curve.size, curve.extrude, curve.space_character = name, 0.46, 0.012, 1.2
                curve.align_x, curve.align_y = "CENTER", "CENTER"
                curve.materials.append(lettering)
                sign = bpy.data.objects.new(f"Sign {name}", curve)
                sign.location, sign.rotation_euler = (*location, 3.25), (np.pi / 2, 0.0, turn)
                collection.objects.link(sign)


def build_scene(scene: bpy.types.Scene) -> bpy.types.Object:
    """Fill a scene; returns the car's root."""

    def group(name: str) -> bpy.types.Collection:
        result = bpy.data.collections.new(name)
        scene.collection.children.link(result)
        return result

    palette = street_materials()
    ground = group("Ground")
    for name, build in (("Ground", _build_ground), ("Road markings", _build_markings)):
        place(name, build().mesh(name, palette), ground)
    houses, house_palette = group("Houses"), building_materials()
    for i, house in enumerate(_houses()):
        place(f"House {i:02}", build_house(house).mesh(f"House {i:02}", house_palette), houses)
    tower = build_clock_tower((0.0, MAIN_END + 8), -1.0)
    place("Clock tower", tower.mesh("Clock tower", house_palette, outward=True), houses)
    _furnish(group("Street furniture"), palette)
    _build_signs(houses, palette["White line"])
    car = build_car(group("Car"))
    parked = group("Parked cars")
    for name, colour, x, y, turn in PARKED:
        copy_car(car, name, material(f"{name} paint", colour, 0.25), parked, (x, y, 0.0), turn)
    lights = group("Lights")
    daylight(scene, lights)
    _lamplight(lights)
    return car


def set_view(scene: bpy.types.Scene) -> None:
    """The view transform that the lights are made for."""
    scene.view_settings.view_transform = "AgX"
    scene.view_settings.look = "AgX - Medium High Contrast"
    scene.view_settings.exposure = EXPOSURE
