# SPDX-License-Identifier: GPL-3.0-or-later
"""Scenes like those of other people's files: a bedroom, sugar cubes, an ocean, subdivided heads.

They have what is slow: many bounces off glossy surfaces, glass, bumps at every hit, soft lamps, fine meshes.
"""

from __future__ import annotations

import itertools
import math
from pathlib import Path

import bpy
import numpy as np

from .real_scenes import SEED, RealScene, add_sky, material, place_lamp, save

# Cubes of sugar, and heads along each side of their square.
CUBES, HEADS = 250, 5


def principled(name: str, color: tuple[float, float, float], **inputs: float) -> bpy.types.Material:
    """A Principled material; spaces in the names of inputs are underscores."""
    made = material(name)
    shader = made.node_tree.nodes["Principled BSDF"]
    shader.inputs["Base Color"].default_value = (*color, 1.0)
    for key, value in inputs.items():
        shader.inputs[key.replace("_", " ")].default_value = value
    return made


def bumped(made: bpy.types.Material, scale: float, strength: float) -> bpy.types.Material:
    """The material with a bump of noise."""
    tree = made.node_tree
    noise, bump = (tree.nodes.new(kind) for kind in ("ShaderNodeTexNoise", "ShaderNodeBump"))
    noise.inputs["Scale"].default_value, bump.inputs["Strength"].default_value = scale, strength
    tree.links.new(noise.outputs[0], bump.inputs["Height"])
    tree.links.new(bump.outputs[0], tree.nodes["Principled BSDF"].inputs["Normal"])
    return made


def add_camera(
    place: tuple[float, float, float], turn: tuple[float, float, float], lens: float = 35.0
) -> bpy.types.Object:
    """A camera, not yet in the scene."""
    camera = bpy.data.objects.new("Camera", bpy.data.cameras.new("Camera"))
    camera.location, camera.rotation_euler, camera.data.lens = place, turn, lens
    return camera


def area(energy: float, size: float, place: tuple[float, ...], turn: tuple[float, ...] = (0, 0, 0)) -> None:
    """Add a square area lamp."""
    lamp = bpy.data.lights.new("Lamp", "AREA")
    lamp.energy, lamp.size = energy, size
    place_lamp(lamp, place, turn)


def box(made: bpy.types.Material, place: tuple[float, ...], scale: tuple[float, ...]) -> bpy.types.Object:
    """Add a box with rounded edges."""
    bpy.ops.mesh.primitive_cube_add(size=1.0, location=place)
    thing = bpy.context.object
    thing.scale = scale
    bevel = thing.modifiers.new("Bevel", "BEVEL")
    bevel.width, bevel.segments = 0.02, 3
    thing.data.materials.append(made)
    return thing


def bedroom(path: Path) -> None:
    """Save a closed room with a window, glossy wood, fabrics of a million triangles and four lamps."""
    wall, wood = principled("Wall", (0.7, 0.65, 0.6)), principled("Wood", (0.3, 0.15, 0.07), Roughness=0.25)
    wood = bumped(wood, 12.0, 0.2)
    fabric = bumped(principled("Fabric", (0.5, 0.1, 0.1), Roughness=0.9), 80.0, 0.4)
    metal = principled("Metal", (0.8, 0.8, 0.8), Metallic=1.0, Roughness=0.2)
    glass = principled("Glass", (1.0, 1.0, 1.0), Transmission_Weight=1.0, Roughness=0.0)
    for place, scale in (
        ((0, 0, -0.05), (6, 6, 0.1)),
        ((0, 0, 3.05), (6, 6, 0.1)),
        ((-3.05, 0, 1.5), (0.1, 6, 3)),
        ((0, 3.05, 1.5), (6, 0.1, 3)),
        ((3.05, -2, 1.5), (0.1, 2, 3)),
        ((3.05, 2, 1.5), (0.1, 2, 3)),
    ):
        box(wood if place[2] < 0 else wall, place, scale)
    for number, made in enumerate((wood, wood, metal, wood, fabric, metal, glass, glass)):
        x, y = -2.6 + 0.7 * number, 2.4 - 0.5 * (number % 3)
        box(made, (x, y, 0.5 + 0.1 * number), (0.5, 0.4, 1.0 + 0.2 * number))
    for height, size in ((0.6, 2.2), (0.75, 1.2), (0.3, 2.6)):
        bpy.ops.mesh.primitive_grid_add(
            x_subdivisions=400, y_subdivisions=400, size=size, location=(0, 0.4, height)
        )
        cloth = bpy.context.object
        places = np.empty(len(cloth.data.vertices) * 3)
        cloth.data.vertices.foreach_get("co", places)
        x, y, z = places.reshape(-1, 3).T
        z += 0.03 * np.sin(14 * x + 3 * np.sin(5 * y)) - 0.2 * np.maximum(
            np.abs(x) + np.abs(y) - 0.6 * size, 0
        )
        cloth.data.vertices.foreach_set("co", np.stack([x, y, z], 1).ravel())
        bpy.ops.object.shade_smooth()
        cloth.data.materials.append(fabric)
    for x, y in itertools.product((-1.5, 1.5), repeat=2):
        area(40.0, 0.4, (x, y, 2.9))
    add_sky((0.9, 0.9, 0.0))
    save(add_camera((-0.5, -2.8, 1.5), (math.pi / 2 - 0.12, 0, 0), 22.0), path, (960, 540), 4)


def sugar(path: Path) -> None:
    """Save a heap of rough white cubes, subdivided and bumped, on a glossy table under two lamps."""
    generator = np.random.default_rng(SEED)
    white = bumped(principled("Sugar", (0.9, 0.9, 0.88), Roughness=0.4, Specular_IOR_Level=0.6), 40.0, 0.5)
    cube = box(white, (0, 0, -9), (1, 1, 1))
    subsurf = cube.modifiers.new("Subdivision", "SUBSURF")
    subsurf.levels = subsurf.render_levels = 3
    for _ in range(CUBES):
        copy = cube.copy()
        copy.location = generator.normal((0, 0, 1.0), (2.0, 2.0, 0.6))
        copy.rotation_euler, copy.scale = generator.uniform(0, 6, 3), (0.5, 0.5, 0.5)
        bpy.context.collection.objects.link(copy)
    bpy.data.objects.remove(cube)
    bpy.ops.mesh.primitive_plane_add(size=40.0)
    bpy.context.object.data.materials.append(principled("Table", (0.1, 0.05, 0.03), Roughness=0.15))
    area(600.0, 3.0, (4, -4, 6), (0.7, 0, 0.8))
    area(200.0, 2.0, (-5, -2, 4), (0.8, 0, -1.1))
    save(add_camera((0, -9, 4.5), (1.15, 0, 0)), path, (960, 540), 4)


def ocean(path: Path) -> None:
    """Save waves of two million triangles, glossy and bumped, below a sky."""
    bpy.ops.mesh.primitive_plane_add(size=1.0)
    sea = bpy.context.object
    waves = sea.modifiers.new("Ocean", "OCEAN")
    waves.geometry_mode, waves.repeat_x, waves.repeat_y = "GENERATE", 4, 4
    waves.resolution = waves.viewport_resolution = 16
    waves.wave_scale = 1.2
    water = principled("Water", (0.01, 0.05, 0.08), Roughness=0.05, IOR=1.33)
    sea.data.materials.append(bumped(water, 3.0, 0.1))
    bpy.ops.object.shade_smooth()
    add_sky((1.2, 0.0, 0.6))
    save(add_camera((100, -40, 9), (1.45, 0, 0.0), 28.0), path, (960, 540), 4)


def heads(path: Path) -> None:
    """Save subdivided monkeys of metals, coats and glass on a floor."""
    made = [
        principled("Paint", (0.7, 0.05, 0.03), Roughness=0.2, Coat_Weight=1.0),
        principled("Gold", (0.9, 0.6, 0.2), Metallic=1.0, Roughness=0.15),
        principled("Plastic", (0.1, 0.3, 0.7), Roughness=0.3),
        principled("Glass", (1.0, 1.0, 1.0), Transmission_Weight=1.0, Roughness=0.0),
        principled("Clay", (0.6, 0.5, 0.4), Roughness=0.9),
    ]
    bpy.ops.mesh.primitive_monkey_add()
    first = bpy.context.object
    bpy.ops.object.shade_smooth()
    subsurf = first.modifiers.new("Subdivision", "SUBSURF")
    subsurf.levels = subsurf.render_levels = 3
    for number in range(HEADS * HEADS):
        head = first.copy()
        head.data = first.data.copy()
        head.data.materials.append(made[number % len(made)])
        head.location = (2.4 * (number % HEADS - 2), 2.4 * (number // HEADS - 2), 0.9)
        bpy.context.collection.objects.link(head)
    bpy.data.objects.remove(first)
    bpy.ops.mesh.primitive_plane_add(size=60.0)
    bpy.context.object.data.materials.append(principled("Floor", (0.5, 0.5, 0.5), Roughness=0.4))
    area(800.0, 4.0, (4, -6, 7), (0.7, 0, 0.6))
    add_sky((0.8, 0.3, 0.0))
    save(add_camera((0, -11, 5.5), (1.1, 0, 0)), path, (960, 540), 4)


FOREIGN = {
    "bedroom": RealScene(bedroom, True, (None, None)),
    "sugar cubes": RealScene(sugar, True, (None, None)),
    "ocean": RealScene(ocean, True, (None, None)),
    "subdivided heads": RealScene(heads, True, (None, None)),
}
