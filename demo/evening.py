# SPDX-License-Identifier: GPL-3.0-or-later
"""The evening of the large pictures: a low warm sun, a deep sky, street lamps and lit windows."""

from __future__ import annotations

import bpy
import numpy as np

Color = tuple[float, float, float, float]

# The sun's angles in degrees.
SUN = (71.0, 0.0, -52.0)
SKY: Color = (0.14, 0.25, 0.55, 1.0)
# The sky at the horizon, a little above it, and at the zenith, and the heights (sines) of each.
DUSK: tuple[tuple[float, Color], ...] = (
    (0.0, (0.90, 0.44, 0.20, 1.0)),
    (0.07, (0.60, 0.38, 0.34, 1.0)),
    (0.24, (0.20, 0.28, 0.52, 1.0)),
    (0.8, (0.07, 0.15, 0.42, 1.0)),
)


def evening(scene, sun: tuple[float, float, float] = SUN, dusk: bool = False, exposure: float = 0.55) -> None:
    """Turn the day of a street of this demo into an evening.

    sun: its angles in degrees. dusk: the sky glows at the horizon; else it has one color. exposure: of the
    scene's view.
    """
    lamp = bpy.data.objects["Sun"]
    lamp.rotation_euler = np.radians(sun)
    lamp.data.energy, lamp.data.color, lamp.data.angle = 7.0, (1.0, 0.55, 0.28), np.radians(1.2)
    background = scene.world.node_tree.nodes["Background"].inputs
    background["Color"].default_value, background["Strength"].default_value = SKY, 0.85
    if dusk:
        _glow_at_the_horizon(scene.world.node_tree)
    glow = bpy.data.lights.new("Evening glow", "POINT")
    glow.energy, glow.color, glow.shadow_soft_size = 330.0, (1.0, 0.62, 0.28), 0.2
    for post in [obj for obj in scene.objects if obj.name.startswith("Street lamp")]:
        light = bpy.data.objects.new("Evening glow", glow)
        light.location = post.matrix_world.translation
        # Below the lantern, which is opaque.
        light.location.z += 4.0
        scene.collection.objects.link(light)
    for name, share, strength in (("Window glass", 0.38, 0.75), ("Shop window", 1.0, 0.6)):
        _light_windows(bpy.data.materials[name], share, strength)
    headlight = bpy.data.materials["Headlight"].node_tree.nodes["Principled BSDF"].inputs
    headlight["Emission Color"].default_value = (1.0, 0.86, 0.6, 1.0)
    headlight["Emission Strength"].default_value = 6.0
    scene.view_settings.exposure = exposure


def _glow_at_the_horizon(tree) -> None:
    """Color a world by the height that it is seen at."""
    place = tree.nodes.new("ShaderNodeTexCoord")
    height = tree.nodes.new("ShaderNodeSeparateXYZ")
    ramp = tree.nodes.new("ShaderNodeValToRGB")
    stops = ramp.color_ramp.elements
    while len(stops) < len(DUSK):
        stops.new(0.5)
    for stop, (at, color) in zip(stops, DUSK, strict=True):
        stop.position, stop.color = at, color
    tree.links.new(place.outputs["Generated"], height.inputs["Vector"])
    tree.links.new(height.outputs["Z"], ramp.inputs["Fac"])
    tree.links.new(ramp.outputs["Color"], tree.nodes["Background"].inputs["Color"])


def _light_windows(material, share: float, strength: float) -> None:
    """Light a share of the windows of a material, by their places."""
    tree = material.node_tree
    shader = tree.nodes["Principled BSDF"]
    place = tree.nodes.new("ShaderNodeNewGeometry")
    cell = tree.nodes.new("ShaderNodeVectorMath")
    cell.operation = "SNAP"
    cell.inputs[1].default_value = (2.3, 2.3, 3.0)
    chance = tree.nodes.new("ShaderNodeTexWhiteNoise")
    lit = tree.nodes.new("ShaderNodeMath")
    lit.operation = "LESS_THAN"
    lit.inputs[1].default_value = share
    glow = tree.nodes.new("ShaderNodeMath")
    glow.operation = "MULTIPLY"
    glow.inputs[1].default_value = strength
    for source, target in (
        (place.outputs["Position"], cell.inputs[0]),
        (cell.outputs["Vector"], chance.inputs["Vector"]),
        (chance.outputs["Value"], lit.inputs[0]),
        (lit.outputs["Value"], glow.inputs[0]),
        (glow.outputs["Value"], shader.inputs["Emission Strength"]),
    ):
        tree.links.new(source, target)
    shader.inputs["Emission Color"].default_value = (1.0, 0.46, 0.13, 1.0)
