# SPDX-License-Identifier: GPL-3.0-or-later
"""The scene of the tutorial in README.md: towers in rows on a lawn, in the sun."""

from __future__ import annotations

import math
from itertools import product

import bpy

from .render_engine import ENGINE

NAME = "Towers"
# Middle of the first tower of each kind, in metres from the corner of its block; height; colour.
TOWERS = (
    ("Red Tower", (0.0, 0.0), 2.0, (0.80, 0.20, 0.06, 1.0)),
    ("White Tower", (3.0, 0.0), 4.0, (0.85, 0.75, 0.55, 1.0)),
    ("Blue Tower", (0.0, 3.0), 3.0, (0.08, 0.35, 0.45, 1.0)),
    ("Yellow Tower", (3.0, 3.0), 5.5, (0.75, 0.42, 0.08, 1.0)),
)
# Blocks along each side of the town, and metres from one to the next.
BLOCKS, BLOCK_SIZE = 8, 6.0
TOWER_WIDTH, LAWN_WIDTH = 1.6, 60.0
LAWN_COLOR, SKY_COLOR, SKY_STRENGTH = (0.25, 0.40, 0.18, 1.0), (0.35, 0.60, 1.0, 1.0), 0.6
# The real sun's size in the sky: shadows are crisp with few samples. Degrees.
SUN_STRENGTH, SUN_SIZE, SUN_ANGLES = 4.0, 0.5, (50.0, 0.0, 30.0)


def new_tutorial_scene():
    """Create the scene without a camera and return it; no window shows it yet."""
    scene = bpy.data.scenes.new(NAME)
    scene.render.engine = ENGINE
    scene.world = _sky()
    corner = -BLOCK_SIZE * (BLOCKS - 0.5) / 2
    for name, (x, y), height, color in TOWERS:
        half = TOWER_WIDTH / 2
        tower = _object(scene, name, color, _box(half, half, height))
        tower.location = corner + x, corner + y, 0.0
        for axis, label in enumerate("XY"):
            rows = tower.modifiers.new(f"Rows along {label}", "ARRAY")
            rows.count, rows.use_relative_offset, rows.use_constant_offset = BLOCKS, False, True
            rows.constant_offset_displace = [BLOCK_SIZE if axis == i else 0.0 for i in range(3)]
    half = LAWN_WIDTH / 2
    lawn = [(-half, -half, 0.0), (half, -half, 0.0), (half, half, 0.0), (-half, half, 0.0)]
    _object(scene, "Lawn", LAWN_COLOR, (lawn, [(0, 1, 2, 3)]))
    light = bpy.data.lights.new("Sun", "SUN")
    light.energy, light.angle = SUN_STRENGTH, math.radians(SUN_SIZE)
    sun = bpy.data.objects.new("Sun", light)
    sun.location = 0.0, 0.0, 2 * BLOCK_SIZE
    sun.rotation_euler = [math.radians(angle) for angle in SUN_ANGLES]
    scene.collection.objects.link(sun)
    return scene


def _box(x: float, y: float, height: float):
    """Vertices and faces of a box on the ground, its middle at the origin."""
    corners = list(product((-x, x), (-y, y), (0.0, height)))
    faces = [(0, 1, 3, 2), (4, 6, 7, 5), (0, 4, 5, 1), (2, 3, 7, 6), (0, 2, 6, 4), (1, 5, 7, 3)]
    return corners, faces


def _object(scene, name: str, color, shape):
    """A mesh object of one colour in a scene."""
    mesh = bpy.data.meshes.new(name)
    mesh.from_pydata(shape[0], [], shape[1])
    material = bpy.data.materials.new(name)
    _tree(material).nodes["Principled BSDF"].inputs["Base Color"].default_value = color
    material.diffuse_color = color
    mesh.materials.append(material)
    obj = bpy.data.objects.new(name, mesh)
    scene.collection.objects.link(obj)
    return obj


def _sky():
    world = bpy.data.worlds.new("Blue Sky")
    sky = _tree(world).nodes["Background"].inputs
    sky["Color"].default_value, sky["Strength"].default_value = SKY_COLOR, SKY_STRENGTH
    return world


def _tree(owner):
    """The nodes of a new material or world; newer versions create them with it."""
    if owner.node_tree is None:
        owner.use_nodes = True
    return owner.node_tree
