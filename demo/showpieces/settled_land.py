# SPDX-License-Identifier: GPL-3.0-or-later
"""Woods, a lake with a village, and a sky for the landscape of panorama maps."""

from __future__ import annotations

import bpy
import numpy as np

from ..mesh import Array, material
from ..recipes.terrain import ACROSS, ALONG, SEED, WATER, build_landscape, heights, land_colors, wooded

# Trees stand about so far apart, and are so high at least and at most: far too large, as on painted maps.
SPACING, LOW, HIGH = 0.62, 0.45, 0.95
# Sides of a tree's two cones, and their radii and heights as shares of the tree's.
SIDES, CONES = 6, ((0.30, 0.10, 0.70), (0.21, 0.42, 1.0))
# The village: where its church stands, how far it reaches, how many houses it has and how far apart.
VILLAGE, REACH, HOUSES, APART = (-4.5, 27.0), 5.5, 60, 0.75
PAINTS = ((0.72, 0.66, 0.55), (0.62, 0.48, 0.33), (0.70, 0.70, 0.68), (0.55, 0.36, 0.26))


def settle(scene) -> None:
    """Make a scene's landscape finer, and add woods, a lake, a village and a sky."""
    coarse = bpy.data.objects["Landscape"]
    bpy.data.objects.remove(coarse)
    build_landscape(scene, 1400, 800)
    generator = np.random.default_rng(SEED)
    for name, made in (("Woods", _woods(generator)), ("Village", _village(generator)), ("Lake", _lake())):
        scene.collection.objects.link(bpy.data.objects.new(name, made))
    _sky(scene)


def _woods(generator) -> bpy.types.Mesh:
    """Conifers where the land has the colour of woods."""
    x, y = np.meshgrid(np.arange(*ACROSS, SPACING), np.arange(*ALONG, SPACING))
    z = heights(x, y)
    x, y = (side + generator.uniform(-0.4, 0.4, x.shape) * SPACING for side in (x, y))
    # The map shows what is far away small: every other tree there is enough.
    here = wooded(land_colors(x, y, z)).reshape(x.shape) & (generator.uniform(size=x.shape) < 60 / (40 + y))
    place = np.stack([x[here], y[here], heights(x[here], y[here]) - 0.03], axis=1)
    high = generator.uniform(LOW, HIGH, len(place))[:, None, None]
    turn = np.linspace(0, 2 * np.pi, SIDES, endpoint=False)
    points, faces = [], []
    for radius, low, top in CONES:
        ring = np.stack([radius * np.cos(turn), radius * np.sin(turn), np.full(SIDES, low)], axis=1)
        first = sum(map(len, points))
        points.append(np.concatenate([ring, [[0.0, 0.0, top]]]))
        faces += [(first + k, first + (k + 1) % SIDES, first + SIDES) for k in range(SIDES)]
    tree = np.concatenate(points)
    vertices = (tree * high + place[:, None]).reshape(-1, 3)
    triangles = (np.array(faces) + np.arange(len(place))[:, None, None] * len(tree)).reshape(-1, 3)
    mesh = bpy.data.meshes.new("Woods")
    mesh.from_pydata(vertices.tolist(), [], triangles.tolist())
    shade = np.repeat(generator.uniform(0.6, 1.5, len(place)), len(tree))[:, None]
    colors = np.append(shade * (0.020, 0.055, 0.018), np.ones((len(shade), 1)), axis=1)
    mesh.color_attributes.new("Land", "FLOAT_COLOR", "POINT").data.foreach_set("color", colors.ravel())
    mesh.materials.append(bpy.data.materials["Land"])
    return mesh


def _village(generator) -> bpy.types.Mesh:
    """Houses with gable roofs round a church, on dry land."""
    centre = np.array(VILLAGE)
    taken: list[Array] = [centre]
    while len(taken) < HOUSES:
        place = centre + generator.normal(size=2) * REACH / 2
        height = float(heights(*place[:, None])[0])
        near = min(float(np.hypot(*(place - other))) for other in taken)
        if WATER + 0.02 < height < 1.2 and near > APART:
            taken.append(place)
    points, faces, paints = [], [], []

    def add(corners: Array, own: list[tuple[int, ...]], paint: int) -> None:
        first = sum(map(len, points))
        points.append(corners)
        faces.extend(tuple(first + k for k in face) for face in own)
        paints.extend([paint] * len(own))

    for number, place in enumerate(taken):
        half = (
            np.array([0.20, 0.20, 1.5])
            if number == 0
            else generator.uniform((0.2, 0.26, 0.3), (0.28, 0.4, 0.5))
        )
        roof = 1.3 if number == 0 else 0.28
        turn = generator.normal(0.4, 0.35)
        ground = float(heights(*place[:, None])[0]) - 0.1
        corner = np.array([(-1, -1, 0), (1, -1, 0), (1, 1, 0), (-1, 1, 0)], float)
        upper = corner + np.array([0.0, 0.0, 1.0])
        walls = np.concatenate([corner, upper]) * half
        ends = [(0, 0)] if number == 0 else [(0, -1), (0, 1)]
        ridge = np.array([(a, b * half[1], half[2] + roof) for a, b in ends])
        eaves = upper * (1.15, 1.15, 1.0) * half
        whole = np.concatenate([walls, eaves, ridge])
        rotation = np.array([[np.cos(turn), np.sin(turn), 0], [-np.sin(turn), np.cos(turn), 0], [0, 0, 1]])
        whole = whole @ rotation + (*place, ground)
        sides = [(0, 1, 5, 4), (1, 2, 6, 5), (2, 3, 7, 6), (3, 0, 4, 7)]
        if number == 0:
            tops = [(8 + k, 8 + (k + 1) % 4, 12) for k in range(4)]
        else:
            tops = [(8, 9, 12), (10, 11, 13), (9, 10, 13, 12), (11, 8, 12, 13)]
        add(whole, sides, 1 + number % len(PAINTS))
        add(whole, tops, 0)
    mesh = bpy.data.meshes.new("Village")
    mesh.from_pydata(np.concatenate(points).tolist(), [], faces)
    mesh.materials.append(material("Roofs", (0.34, 0.075, 0.035), 0.8))
    for number, paint in enumerate(PAINTS, 1):
        mesh.materials.append(material(f"Wall {number}", paint, 0.8))
    mesh.polygons.foreach_set("material_index", paints)
    return mesh


def _lake() -> bpy.types.Mesh:
    """Water over all that is as low as it."""
    mesh = bpy.data.meshes.new("Lake")
    corners = [(x, y, WATER + 0.015) for x, y in ((0, 0), (1, 0), (1, 1), (0, 1))]
    spread = [(ACROSS[round(x)], ALONG[round(y)], z) for x, y, z in corners]
    mesh.from_pydata(spread, [], [(0, 1, 2, 3)])
    mesh.materials.append(material("Water", (0.012, 0.06, 0.09), 0.06))
    return mesh


def _sky(scene) -> None:
    """A sky that pales towards the horizon, and the light of an afternoon."""
    tree = scene.world.node_tree
    background = tree.nodes["Background"]
    place, parts = tree.nodes.new("ShaderNodeTexCoord"), tree.nodes.new("ShaderNodeSeparateXYZ")
    ramp = tree.nodes.new("ShaderNodeValToRGB")
    ramp.color_ramp.elements[0].color = (0.50, 0.66, 0.86, 1.0)
    ramp.color_ramp.elements[1].color = (0.06, 0.19, 0.55, 1.0)
    ramp.color_ramp.elements[1].position = 0.22
    tree.links.new(place.outputs["Generated"], parts.inputs[0])
    tree.links.new(parts.outputs["Z"], ramp.inputs[0])
    tree.links.new(ramp.outputs["Color"], background.inputs["Color"])
    background.inputs["Strength"].default_value = 0.75
    sun = bpy.data.objects["Sun"]
    sun.rotation_euler, sun.data.energy = np.radians((60.0, 0.0, -68.0)), 4.6
    sun.data.color, sun.data.angle = (1.0, 0.86, 0.68), 0.012
    scene.view_settings.view_transform, scene.view_settings.look = "AgX", "AgX - Medium High Contrast"
    scene.view_settings.exposure = 0.35
