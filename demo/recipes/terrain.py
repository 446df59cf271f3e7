# SPDX-License-Identifier: GPL-3.0-or-later
"""A landscape of ridges and valleys, coloured by height and slope, for panorama maps."""

from __future__ import annotations

import bpy
import numpy as np

from ..mesh import Array

SEED, OCTAVES = 11, 7
ACROSS, ALONG = (-150.0, 150.0), (0.0, 130.0)
# Colours (linear) of the lake, meadows, woods, rock and snow.
LAKE, MEADOW, WOOD, ROCK, SNOW = (
    (0.03, 0.11, 0.16),
    (0.22, 0.27, 0.07),
    (0.03, 0.075, 0.03),
    (0.17, 0.145, 0.125),
    (0.80, 0.82, 0.85),
)
# Heights of the lake, of the tree line and of the snow.
WATER, TREES, SNOWS = 0.0, 3.0, 4.6


def noise(x: Array, y: Array, generator) -> Array:
    """Value noise of random heights on the integers, interpolated with continuous slopes, from -1 to 1."""
    values = generator.uniform(-1, 1, (64, 64))
    i, j = np.floor(x).astype(int), np.floor(y).astype(int)
    p, q = ((t * t * (3 - 2 * t)) for t in (x - i, y - j))
    corner = [[values[(i + a) % 64, (j + b) % 64] for b in (0, 1)] for a in (0, 1)]
    low, high = (corner[a][0] * (1 - q) + corner[a][1] * q for a in (0, 1))
    return low * (1 - p) + high * p


def heights(x: Array, y: Array) -> Array:
    """Heights of the land: ridged noise, higher towards the back and away from the valley."""
    generator = np.random.default_rng(SEED)
    valley = 14 * np.sin(y / 26) + 6 * np.sin(y / 11)
    aside = np.clip(np.abs(x - valley) / 34, 0, 1) ** 1.5
    back = np.clip((y - 15) / 90, 0, 1)
    rise = aside * (1.2 + 3.6 * back) + 5.0 * back**5
    ridges, size, weight = np.zeros_like(x), 22.0, 1.0
    for _ in range(OCTAVES):
        octave = 1 - np.abs(noise(x / size + 31, y / size + 17, generator))
        ridges += weight * (octave**2 - 0.4)
        size, weight = size / 1.9, weight * 0.52
    return np.maximum(rise * (0.55 + 0.75 * ridges) - 0.25 + 0.12 * ridges, WATER)


def build_landscape(scene, across: int = 700, along: int = 400):
    """Add the landscape to a scene as one object, and return it."""
    x, y = np.meshgrid(np.linspace(*ACROSS, across), np.linspace(*ALONG, along))
    z = heights(x, y)
    number = np.arange(x.size).reshape(x.shape)
    corners = number[:-1, :-1], number[:-1, 1:], number[1:, 1:], number[1:, :-1]
    mesh = bpy.data.meshes.new("Landscape")
    mesh.from_pydata(
        np.stack([x, y, z], axis=-1).reshape(-1, 3).tolist(),
        [],
        np.stack(corners, axis=-1).reshape(-1, 4).tolist(),
    )
    mesh.shade_smooth()
    colors = mesh.color_attributes.new("Land", "FLOAT_COLOR", "POINT")
    colors.data.foreach_set("color", np.append(land_colors(x, y, z), np.ones((z.size, 1)), axis=1).ravel())
    mesh.materials.append(_material())
    landscape = bpy.data.objects.new("Landscape", mesh)
    scene.collection.objects.link(landscape)
    return landscape


def land_colors(x: Array, y: Array, z: Array) -> Array:
    """Colours (n, 3) of a grid of heights, by height, slope and noise."""
    slope = np.hypot(*np.gradient(z, (ALONG[1] - ALONG[0]) / (len(z) - 1)))
    generator = np.random.default_rng(SEED + 1)
    ragged = sum(noise(x * size, y * size, generator) for size in (0.21, 0.55, 1.3)) / 2

    def over(below: Array, color, share: Array) -> Array:
        share = np.clip(share, 0, 1).reshape(-1, 1)
        return below * (1 - share) + np.array(color) * share

    colors = np.broadcast_to(MEADOW, (z.size, 3))
    colors = over(colors, WOOD, 3 * (z - 0.55 - 0.9 * ragged))
    colors = over(colors, ROCK, 2 * (z - TREES - 1.2 * ragged) + 2 * np.clip(slope - 1.0, 0, 1))
    colors = over(colors, SNOW, 2 * (z - SNOWS - 1.2 * ragged) - 2.5 * np.clip(slope - 1.1, 0, 1))
    return over(colors, LAKE, (z <= WATER + 1e-6).astype(float))


def wooded(colors: Array) -> Array:
    """Which of ``land_colors`` are those of woods, (n,)."""
    return np.abs(colors - np.array(WOOD)).max(axis=1) < 0.02


def _material():
    result = bpy.data.materials.new("Land")
    if result.node_tree is None:
        result.use_nodes = True
    nodes, links = result.node_tree.nodes, result.node_tree.links
    color, shader = nodes.new("ShaderNodeVertexColor"), nodes["Principled BSDF"]
    color.layer_name = "Land"
    shader.inputs["Roughness"].default_value = 0.9
    links.new(color.outputs["Color"], shader.inputs["Base Color"])
    return result


def build_scene(scene) -> None:
    """Add the landscape, a low sun and a sky to a scene."""
    build_landscape(scene)
    sun = bpy.data.objects.new("Sun", bpy.data.lights.new("Sun", "SUN"))
    sun.data.energy, sun.rotation_euler = 3.4, np.radians((58.0, 0.0, -72.0))
    sun.data.angle = 0.02
    scene.collection.objects.link(sun)
    scene.world = bpy.data.worlds.new("Sky")
    scene.world.color = (0.45, 0.62, 0.85)
    if scene.world.node_tree is None:
        scene.world.use_nodes = True
    background = scene.world.node_tree.nodes["Background"].inputs
    background["Color"].default_value, background["Strength"].default_value = (0.30, 0.48, 0.80, 1.0), 0.42
    scene.view_settings.view_transform = "Standard"
