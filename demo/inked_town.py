# SPDX-License-Identifier: GPL-3.0-or-later
"""A town to be drawn in ink: towers along a street, of few faces, before a sky of dots.

All is built in code, in metres. The street runs along y and the ground is at z = 0. What shall have a line
around it stands a little before what it hangs on, so that the far side of its hull is seen.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import NamedTuple

import bpy
import numpy as np

from .mesh import Colour, MeshBuilder, material, place

# Distances from the street's middle of the fronts and the kerb; depth of the towers; height of the pavement.
FRONT, KERB, DEPTH, RAISED = 8.0, 5.2, 12.0, 0.16
STOREY, BAY = 3.2, 2.4
# How far before a wall begins what hangs on it: more than a hull is thick.
GAP = 0.2
# The sun: from the right, so that fronts on the right are dark; degrees.
SUN_ANGLES, SUN_STRENGTH = (53.0, 0.0, 52.0), 3.0


class Tower(NamedTuple):
    """A tower. side: -1 on the left of the street, 1 on the right. y: of its ends. storeys: its height."""

    side: int
    y: tuple[float, float]
    storeys: int


TOWERS = (
    Tower(-1, (-19.0, -9.5), 7),
    Tower(-1, (-9.0, -1.0), 10),
    Tower(-1, (-0.5, 7.0), 6),
    Tower(-1, (13.0, 21.5), 9),
    Tower(-1, (22.0, 33.0), 13),
    Tower(-1, (33.5, 42.0), 8),
    Tower(-1, (48.0, 58.0), 12),
    Tower(1, (-18.0, -7.0), 9),
    Tower(1, (-6.5, 0.0), 6),
    Tower(1, (0.5, 8.0), 11),
    Tower(1, (13.0, 24.0), 7),
    Tower(1, (24.5, 32.0), 10),
    Tower(1, (32.5, 43.0), 14),
    Tower(1, (48.0, 57.0), 9),
)


class Colors(NamedTuple):
    """The colors of a town. walls: of its towers in turn."""

    walls: Sequence[Colour] = ((1.0, 1.0, 1.0),)
    pavement: Colour = (1.0, 1.0, 1.0)
    road: Colour = (0.5, 0.5, 0.5)
    dark: Colour = (0.0, 0.0, 0.0)
    light: Colour = (1.0, 1.0, 1.0)
    sky: Colour = (1.0, 1.0, 1.0)


PAPER = Colors()


def build_town(colors: Colors = PAPER):
    """Open a new file with the town, and return its scene."""
    bpy.ops.wm.read_homefile(use_empty=True, use_factory_startup=True)
    scene = bpy.context.scene
    group = bpy.data.collections.new("Town")
    scene.collection.children.link(group)
    walls = [material(f"Wall {number}", color) for number, color in enumerate(colors.walls)]
    palette = {
        "Wall": material("Pavement", colors.pavement),
        "Road": material("Road", colors.road),
        "Dark": material("Dark", colors.dark),
        "Light": _glow("Light", colors.light),
    }
    place("Ground", _ground().mesh("Ground", palette), group)
    for number, tower in enumerate(TOWERS):
        name = f"Tower {number:02}"
        own = palette | {"Wall": walls[number % len(walls)]}
        place(name, _tower(tower, number).mesh(name, own), group)
    place("End", _end().mesh("End", palette | {"Wall": walls[-1]}), group)
    sun = bpy.data.objects.new("Sun", bpy.data.lights.new("Sun", "SUN"))
    sun.data.energy, sun.data.use_shadow, sun.rotation_euler = SUN_STRENGTH, False, np.radians(SUN_ANGLES)
    scene.collection.objects.link(sun)
    scene.world = bpy.data.worlds.new("Sky")
    scene.world.use_nodes = True
    _see_only(scene.world.node_tree, colors.sky)
    # A picture takes many renders, and nothing is lit by the world: what each of them prepares is small.
    scene.world.probe_resolution, scene.eevee.use_shadows = "128", False
    scene.eevee.shadow_pool_size = scene.eevee.gi_irradiance_pool_size = "16"
    return scene


def _see_only(tree, color: Colour) -> None:
    """Let a world be seen by cameras in a color, and light nothing."""
    background, ray = tree.nodes["Background"], tree.nodes.new("ShaderNodeLightPath")
    background.inputs["Color"].default_value = (*color, 1.0)
    tree.links.new(ray.outputs["Is Camera Ray"], background.inputs["Strength"])


# Dots across the half circle of a sky, their largest radius, and how fast they grow with the height.
DOTS, LARGEST, GROWTH = 64.0, 0.72, 1.1


def dot_sky(world, right, up, ahead) -> None:
    """Give a world dots that grow away from the direction ahead, on a plane that a stereographic camera shows
    as it is. right, up, ahead: unit vectors."""
    tree = world.node_tree
    new, link = tree.nodes.new, tree.links.new

    def value(operation: str, *inputs, kind: str = "ShaderNodeMath"):
        node = new(kind)
        node.operation = operation
        for socket, given in zip(node.inputs, inputs, strict=False):
            if isinstance(given, bpy.types.NodeSocket):
                link(given, socket)
            else:
                socket.default_value = given
        return node.outputs[
            "Value" if kind == "ShaderNodeMath" or operation in ("DOT_PRODUCT", "LENGTH") else "Vector"
        ]

    way = new("ShaderNodeTexCoord").outputs["Generated"]
    across, high, depth = (
        value("DOT_PRODUCT", way, axis, kind="ShaderNodeVectorMath") for axis in (right, up, ahead)
    )
    scale = value("DIVIDE", 1.0, value("MAXIMUM", value("ADD", depth, 1.0), 0.05))
    x, y = (value("MULTIPLY", each, scale) for each in (across, high))
    # A lattice turned by 45 degrees, as screens are.
    first, second = (value(operation, x, y) for operation in ("ADD", "SUBTRACT"))
    offsets = [
        value("SUBTRACT", value("FRACT", value("MULTIPLY", each, DOTS / 2)), 0.5) for each in (first, second)
    ]
    far = value("SQRT", value("ADD", *(value("POWER", value("ABSOLUTE", each), 2.0) for each in offsets)))
    gone = value("SQRT", value("ADD", *(value("POWER", value("ABSOLUTE", each), 2.0) for each in (x, y))))
    radius = value("MINIMUM", value("MULTIPLY", gone, GROWTH), LARGEST)
    link(value("GREATER_THAN", far, radius), tree.nodes["Background"].inputs["Color"])


def _glow(name: str, color: Colour) -> bpy.types.Material:
    """A material that has its color in the shade, too."""
    result = bpy.data.materials.new(name)
    result.use_nodes = True
    tree = result.node_tree
    tree.nodes.clear()
    glow, output = (tree.nodes.new(f"ShaderNode{kind}") for kind in ("Emission", "OutputMaterial"))
    glow.inputs[0].default_value = (*color, 1.0)
    tree.links.new(glow.outputs[0], output.inputs["Surface"])
    return result


def _flat(builder: MeshBuilder, low, high, z: float, name: str) -> None:
    """A level rectangle."""
    (x0, y0), (x1, y1) = low, high
    builder.add([(x0, y0, z), (x1, y0, z), (x1, y1, z), (x0, y1, z)], [(0, 1, 2, 3)], name)


def _ground() -> MeshBuilder:
    builder = MeshBuilder()
    _flat(builder, (-90.0, -60.0), (90.0, 140.0), 0.0, "Road")
    for y in (*np.arange(-23.0, -8.0, 5.0), 2.6, *np.arange(13.5, 60.0, 5.0)):
        _flat(builder, (-0.12, y), (0.12, y + 2.8), 0.01, "Wall")
    for x in np.arange(-4.5, 4.6, 1.0):
        for y in (-4.6, 8.6):
            _flat(builder, (x - 0.27, y), (x + 0.27, y + 3.2 + (y < 0.0) * 2.4), 0.01, "Wall")
    for side in (-1, 1):
        for y in ((-24.0, 8.0), (12.5, 43.5), (47.5, 62.0)):
            xs = sorted((side * KERB, side * 30.0))
            builder.box((xs[0], y[0], -0.3), (xs[1], y[1], RAISED), "Wall")
            line = sorted((side * (KERB + 0.3), side * (KERB + 0.42)))
            _flat(builder, (line[0], y[0]), (line[1], y[1]), RAISED + 0.01, "Dark")
    return builder


def _tower(tower: Tower, number: int) -> MeshBuilder:
    builder, side = MeshBuilder(), tower.side
    height = tower.storeys * STOREY + 1.2
    xs = sorted((side * FRONT, side * (FRONT + DEPTH)))
    builder.box((xs[0], tower.y[0], 0.0), (xs[1], tower.y[1], height), "Wall")
    _roof(builder, xs, tower.y, height, number)
    glass = "Dark" if side < 0 else "Light"

    def hang(low, high, out: tuple[float, float], name: str) -> None:
        """Add a box before the front. low, high: y and z of it. out: its begin and end before the front."""
        across = sorted(side * (FRONT - distance) for distance in out)
        builder.box((across[0], low[0], low[1]), (across[1], high[0], high[1]), name)

    count = int((tower.y[1] - tower.y[0] - 0.6) // BAY)
    start = (tower.y[0] + tower.y[1] - count * BAY) / 2
    for bay in range(count):
        middle = start + (bay + 0.5) * BAY
        for storey in range(1, tower.storeys):
            z = storey * STOREY + 0.8
            hang((middle - 0.8, z), (middle + 0.8, z + 1.9), (GAP, 0.36), "Wall")
            for low, high in ((-0.62, -0.06), (0.06, 0.62)):
                hang((middle + low, z + 0.2), (middle + high, z + 1.7), (0.26, 0.38), glass)
    # The shop: a dark front below a board.
    y0, y1 = tower.y
    hang((y0 + 0.5, 0.3), (y1 - 0.5, 2.6), (0.0, 0.06), "Dark")
    hang((y0 + 0.2, 2.7), (y1 - 0.2, 3.7), (GAP, 0.7), "Wall")
    hang((y0 - 0.1, height - 0.7), (y1 + 0.1, height - 0.1), (GAP, 0.5), "Wall")
    _sign(builder, tower, number)
    # The wall that looks back along the street.
    if tower.side:
        count = int((DEPTH - 1.0) // BAY)
        for bay in range(count):
            x = side * (FRONT + 0.9 + (bay + 0.5) * BAY)
            for storey in range(1, tower.storeys):
                z = storey * STOREY + 0.8
                builder.box((x - 0.7, y0 - 0.3, z), (x + 0.7, y0 - GAP, z + 1.8), "Dark")
    return builder


def _sign(builder: MeshBuilder, tower: Tower, number: int) -> None:
    """An upright sign that stands out from a front, with bars for letters on the side that looks back."""
    side, along = tower.side, tower.y[0] + (0.9 if number % 2 else 2.6)
    low = 4.2 + (number * 1.7) % 2.4
    letters = 3 + number % 3
    high = low + 0.4 + letters * 1.15
    dark, light = ("Dark", "Light") if number % 3 else ("Light", "Dark")
    if dark == "Dark":
        light = "Light"
    near, far = FRONT - 0.5, FRONT - 1.8
    xs = sorted((side * near, side * far))
    builder.box((xs[0], along, low), (xs[1], along + 0.35, high), dark if dark == "Dark" else "Wall")
    x = side * (near + far) / 2
    random = np.random.default_rng(number)
    for letter in range(letters):
        z = high - 0.3 - letter * 1.15
        ink = light if dark == "Dark" else "Dark"
        bars = [((-0.4, 0.4), (-0.2, -0.06)), ((-0.07, 0.07), (-0.9, -0.06))]
        bars += [((-0.4, 0.4), (-0.62, -0.48))] if random.random() < 0.7 else [((-0.4, -0.26), (-0.9, -0.3))]
        bars += [((-0.4, 0.4), (-0.9, -0.78))] if random.random() < 0.5 else [((0.26, 0.4), (-0.9, -0.3))]
        for (a, b), (c, d) in bars:
            corners = [(x + a, z + c), (x + b, z + c), (x + b, z + d), (x + a, z + d)]
            builder.add([(u, along - 0.02, v) for u, v in corners], [(0, 1, 2, 3)], ink)


def add_cars(collection, spots: Sequence[tuple[float, float]], paints: Sequence[Colour]) -> None:
    """Add plain cars. spots: x and y of their middles, in the direction of the street. paints: in turn."""
    palette = {"Dark": bpy.data.materials["Dark"]}
    for number, (x, y) in enumerate(spots):
        name = f"Car {number}"
        palette["Paint"] = material(name, paints[number % len(paints)])
        car = MeshBuilder()
        car.box((-0.9, -2.1, 0.35), (0.9, 2.1, 0.95), "Paint")
        car.box((-0.75, -1.3, 0.95), (0.75, 1.2, 1.5), "Dark")
        car.box((-0.8, -1.1, 1.5), (0.8, 1.0, 1.62), "Paint")
        for side in (-0.85, 0.85):
            for along in (-1.3, 1.3):
                car.lathe(
                    [(0.0, side - 0.15), (0.4, side - 0.15), (0.4, side + 0.15), (0.0, side + 0.15)],
                    16,
                    "X",
                    (0.0, along, 0.4),
                    "Dark",
                )
        place(name, car.mesh(name, palette, outward=True), collection, (x, y, 0.0))


def _roof(builder: MeshBuilder, xs, ys, height: float, number: int) -> None:
    """A parapet's inside, and on each second roof a tank or a hut."""
    low, high = (xs[0] + 0.5, ys[0] + 0.5), (xs[1] - 0.5, ys[1] - 0.5)
    _flat(builder, low, high, height + 0.01, "Road")
    middle = np.array([(xs[0] + xs[1]) / 2, (ys[0] + ys[1]) / 2])
    if number % 2:
        centre = (middle[0], middle[1], 0.0)
        profile = [(0.0, height + GAP), (1.6, height + GAP), (1.6, height + 3.0), (0.0, height + 4.2)]
        builder.lathe(profile[::-1], 12, "Z", centre, "Wall")
    else:
        x, y = middle[0] - 1.0, middle[1] + 0.8
        builder.box((x - 2.0, y - 1.6, height + GAP), (x + 2.0, y + 1.6, height + 2.6), "Wall")
        builder.box((x - 0.6, y - 1.9, height + GAP), (x + 0.6, y - 1.6 - GAP, height + 2.1), "Dark")


def _end() -> MeshBuilder:
    """The tower that closes the street, in three steps."""
    builder = MeshBuilder()
    for half, y, low, high in ((9.0, 84.0, 0.0, 17.0), (6.0, 86.0, 17.0, 29.0), (3.2, 88.0, 29.0, 38.0)):
        builder.box((-half, y, low), (half, y + 2.0 * half, high), "Wall")
        for x in np.arange(-half + 1.4, half - 0.4, 2.6):
            for z in np.arange(low + 2.4, high - 2.5, 3.4):
                builder.box((x - 0.1, y - 0.4, z), (x + 1.3, y - GAP, z + 2.1), "Dark")
        builder.box((-half - 0.4, y - 0.7, high - 1.0), (half + 0.4, y - GAP, high), "Wall")
    builder.lathe([(0.8, 38.0), (0.4, 44.0), (0.0, 50.0)][::-1], 8, "Z", (0.0, 91.0, 0.0), "Dark")
    return builder
