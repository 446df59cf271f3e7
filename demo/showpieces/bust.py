# SPDX-License-Identifier: GPL-3.0-or-later
"""A portrait bust, and a camera that walks round it: both its sides and its face in one image.

The face looks to -y, z is up. The head is two units high.
"""

from __future__ import annotations

from collections.abc import Sequence

import bpy
import numpy as np
from numpy.typing import ArrayLike

from .. import render_demo
from ..mesh import Array, MeshBuilder, material, place, smooth_table
from .clay import Clay
from .street_film import camera_of
from .walk import walk

STEP = 0.016
SIDES = (-1, 1)
# Where the hair is tied.
BUN = np.array([0.0, 1.05, 0.22])
SKULL, SKULL_RADII = np.array([0.0, 0.12, 0.32]), np.array([0.76, 0.93, 0.82])


def build_bust():
    """Open a new file with the bust and the camera, and return its scene."""
    bpy.ops.wm.read_homefile(use_empty=True, use_factory_startup=True)
    scene = bpy.context.scene
    stone, bronze = marble(), material("Bronze", (0.17, 0.075, 0.035), 0.36, 0.9)
    gold = material("Gold", (0.86, 0.56, 0.20), 0.22, 1.0)
    _sculpture(scene, "Bust", _body(), stone)
    _sculpture(scene, "Hair", _hair(), bronze)
    _ornaments(scene, gold)
    _socle(scene)
    _studio(scene)
    camera_of(scene, render_demo.MODULE, surfaces(), "Walk Round")
    return scene


def marble():
    """White marble with pale veins."""
    made = material("Marble", (0.80, 0.76, 0.71), 0.34)
    tree = made.node_tree
    noise, ramp = tree.nodes.new("ShaderNodeTexNoise"), tree.nodes.new("ShaderNodeValToRGB")
    coordinates = tree.nodes.new("ShaderNodeTexCoord")
    noise.inputs["Scale"].default_value, noise.inputs["Detail"].default_value = 1.4, 8.0
    noise.inputs["Distortion"].default_value = 1.6
    low, high = ramp.color_ramp.elements
    low.position, low.color = 0.44, (0.82, 0.78, 0.73, 1.0)
    high.position, high.color = 0.54, (0.80, 0.755, 0.70, 1.0)
    vein = ramp.color_ramp.elements.new(0.49)
    vein.color = (0.71, 0.66, 0.62, 1.0)
    tree.links.new(coordinates.outputs["Object"], noise.inputs["Vector"])
    tree.links.new(noise.outputs["Fac"], ramp.inputs["Fac"])
    tree.links.new(ramp.outputs["Color"], tree.nodes["Principled BSDF"].inputs["Base Color"])
    return made


def _sculpture(scene, name: str, clay: Clay, look) -> None:
    points, faces = clay.surface()
    mesh = bpy.data.meshes.new(name)
    mesh.from_pydata(points.tolist(), [], faces.tolist())
    mesh.shade_smooth()
    mesh.materials.append(look)
    made = bpy.data.objects.new(name, mesh)
    scene.collection.objects.link(made)
    smooth = made.modifiers.new("Smooth", "SMOOTH")
    smooth.factor, smooth.iterations = 0.5, 3


def curve(points: Sequence[Sequence[float]], count: int = 24) -> Array:
    """Points (count, 3) of the Bézier curve of control points."""
    made = np.asarray(points, float)[:, None]
    share = np.linspace(0, 1, count)[:, None]
    while len(made) > 1:
        made = (1 - share) * made[:-1] + share * made[1:]
    return made[0]


def _body() -> Clay:
    clay = Clay((-1.75, -1.4, -3.35), (1.75, 1.3, 1.3), STEP, felt=0.35)
    clay.ball(SKULL, SKULL_RADII - 0.03)
    clay.ball((0, -0.25, -0.25), (0.57, 0.66, 0.84), 0.25)
    for side in SIDES:
        clay.tube(
            curve([(0.51 * side, 0.05, -0.42), (0.41 * side, -0.35, -0.90), (0, -0.62, -0.98)]), 0.15, 0.2
        )
        clay.ball((0.40 * side, -0.63, -0.24), (0.19, 0.16, 0.15), 0.2)
        clay.ball((0.33 * side, -0.60, -0.46), (0.20, 0.19, 0.22), 0.2)
    clay.ball((0, -0.80, -0.98), (0.17, 0.15, 0.13), 0.14)
    clay.ball((0, -0.70, -0.66), (0.30, 0.22, 0.22), 0.18)
    _torso(clay)
    for side in SIDES:
        _eye(clay, side)
    _nose(clay)
    _mouth(clay)
    for side in SIDES:
        _ear(clay, side)
    return clay


def _torso(clay: Clay) -> None:
    clay.tube([(0, 0.26, -0.55), (0, 0.20, -1.25), (0, 0.26, -2.0)], (0.44, 0.40, 0.52), 0.18)
    for side in SIDES:
        clay.tube(
            curve([(0.50 * side, 0.28, -0.45), (0.42 * side, 0.0, -1.2), (0.10 * side, -0.20, -1.90)]),
            0.09,
            0.16,
        )
        clay.tube([(0.30 * side, 0.36, -1.55), (1.15 * side, 0.26, -2.12)], (0.30, 0.34), 0.35)
        clay.tube(
            curve([(0.12 * side, -0.27, -1.97), (0.5 * side, -0.26, -2.0), (1.1 * side, 0.02, -1.92)]),
            0.075,
            0.14,
        )
    clay.ball((0, 0.12, -2.35), (1.0, 0.52, 0.62), 0.3)
    clay.ball((0, -0.08, -2.75), (0.85, 0.46, 0.7), 0.3)
    # The rim of a bust is round: what is outside of a large ball goes.
    for side in SIDES:
        clay.ball((2.25 * side, 0.1, -3.0), (1.35, 2.0, 1.1), 0.06, cut=True)
    clay.below(-3.1, 0.08)


def _eye(clay: Clay, side: int) -> None:
    middle = np.array([0.32 * side, -0.685, 0.0])
    clay.tube(
        curve([(0.08 * side, -0.88, 0.17), (0.32 * side, -0.95, 0.27), (0.60 * side, -0.62, 0.13)]),
        0.06,
        0.12,
    )
    clay.ball((0.30 * side, -1.0, 0.02), (0.20, 0.165, 0.105), 0.14, cut=True)
    # Lids are a shell with an almond cut out of it.
    lids = Clay(middle - 0.3, middle + 0.3, clay.step)
    lids.ball(middle, 0.212)
    lids.ball(np.add(middle, (0.01 * side, -0.2, -0.008)), (0.168, 0.17, 0.082), 0.012, cut=True)
    clay.add(lids, 0.025)
    clay.ball(np.add(middle, (0, 0.004, 0)), 0.184, 0.008)
    # The iris is a shallow hollow, as in antique heads.
    clay.ball(np.add(middle, (-0.01 * side, -0.19, 0.008)), (0.056, 0.05, 0.058), 0.016, cut=True)
    clay.tube(
        curve([(0.15 * side, -0.815, -0.02), (0.3 * side, -0.96, 0.135), (0.51 * side, -0.74, 0.02)]),
        0.016,
        0.03,
    )


def _nose(clay: Clay) -> None:
    clay.tube([(0, -0.84, 0.22), (0, -0.905, 0.0), (0, -1.04, -0.33)], (0.072, 0.064, 0.076), 0.10)
    clay.ball((0, -1.055, -0.35), (0.085, 0.085, 0.078), 0.05)
    for side in SIDES:
        clay.ball((0.105 * side, -0.95, -0.385), (0.068, 0.105, 0.068), 0.05)
        clay.ball((0.058 * side, -1.0, -0.45), (0.032, 0.06, 0.028), 0.025, cut=True)


def _mouth(clay: Clay) -> None:
    shares = np.linspace(0, 1, 24)
    for side in SIDES:
        upper = curve(
            [
                (0, -0.955, -0.605),
                (0.10 * side, -0.975, -0.555),
                (0.17 * side, -0.92, -0.63),
                (0.265 * side, -0.80, -0.655),
            ]
        )
        clay.tube(upper, 0.058 - 0.046 * shares**1.5, 0.03)
    lower = curve(
        [
            (-0.24, -0.80, -0.665),
            (-0.13, -0.945, -0.735),
            (0, -0.975, -0.72),
            (0.13, -0.945, -0.735),
            (0.24, -0.80, -0.665),
        ],
        40,
    )
    bow = 1 - np.abs(np.linspace(-1, 1, 40)) ** 2
    clay.tube(lower, 0.012 + 0.058 * bow, 0.03)
    line = curve(
        [
            (-0.29, -0.80, -0.66),
            (-0.12, -1.02, -0.64),
            (0, -1.07, -0.685),
            (0.12, -1.02, -0.64),
            (0.29, -0.80, -0.66),
        ],
        40,
    )
    clay.tube(line, 0.004 + 0.009 * bow, 0.025, cut=True)
    clay.tube([(0, -0.985, -0.47), (0, -0.985, -0.555)], 0.016, 0.05, cut=True)
    clay.ball((0, -0.93, -0.83), (0.12, 0.05, 0.035), 0.08, cut=True)


def _ear(clay: Clay, side: int) -> None:
    clay.ball((0.70 * side, 0.07, -0.12), (0.06, 0.17, 0.25), 0.06)
    turn = np.radians(np.linspace(-100, 200, 48))
    rim = np.stack(
        [side * (0.76 + 0.03 * np.sin(turn)), 0.09 + 0.17 * np.sin(turn), -0.07 + 0.24 * np.cos(turn)], axis=1
    )
    clay.tube(rim, 0.034, 0.025)
    turn = np.radians(np.linspace(-10, 190, 32))
    fold = np.stack(
        [np.full(32, side * 0.755), 0.06 + 0.10 * np.sin(turn), -0.08 + 0.15 * np.cos(turn)], axis=1
    )
    clay.tube(fold, 0.026, 0.03)
    clay.ball((0.755 * side, 0.05, -0.13), (0.045, 0.055, 0.075), 0.03, cut=True)
    clay.ball((0.74 * side, -0.02, -0.36), (0.045, 0.06, 0.075), 0.04)
    clay.ball((0.745 * side, -0.07, -0.14), (0.03, 0.035, 0.05), 0.03)


def over_skull(directions: Array, out: ArrayLike) -> Array:
    """Points (n, 3) over the skull in directions from its middle."""
    directions = directions / np.linalg.norm(directions, axis=1, keepdims=True)
    radii = SKULL_RADII + np.asarray(out)[..., None]
    return SKULL + directions / np.linalg.norm(directions / radii, axis=1, keepdims=True)


def _hair() -> Clay:
    """Locks from the parting to a bun, and a plait over one shoulder."""
    clay = Clay((-1.35, -1.2, -2.6), (1.35, 1.75, 1.5), STEP)
    back = (BUN - SKULL) / np.linalg.norm(BUN - SKULL)
    shares = np.linspace(0, 1, 40)
    for side in SIDES:
        for number, angle in enumerate(np.radians(np.linspace(40, 125, 9))):
            start = np.array([0.03 * side, -np.cos(angle), np.sin(angle)])
            middle = np.array([1.35 * side, -0.85 + 0.28 * number, 0.42 + 0.13 * number])
            way = curve(
                [
                    start,
                    middle,
                    np.array([1.1 * side, 0.45 + 0.06 * number, -0.42 + 0.17 * number]),
                    np.add(back, (0.12 * side, 0, 0)),
                ],
                40,
            )
            wave = 0.014 * np.sin(shares * 16.0 + number)
            points = over_skull(way, 0.045 + 0.03 * np.sin(np.pi * shares) + wave)
            thick = 0.062 + 0.035 * np.sin(np.pi * shares)
            clay.tube(points, thick, 0.03)
    clay.ball(np.add(SKULL, (0, 0.14, 0.06)), SKULL_RADII * (1.0, 0.92, 0.98), 0.03)
    for turn in np.linspace(0, 2 * np.pi, 7)[:-1]:
        spin = np.linspace(0, 1, 32)
        angle = turn + 3.6 * spin
        reach = 0.34 * np.sin(np.pi * (0.12 + 0.86 * spin))
        points = BUN + np.stack(
            [reach * np.cos(angle), 0.06 + 0.36 * spin - 0.12, reach * np.sin(angle)], axis=1
        )
        clay.tube(points, 0.10, 0.03)
    clay.ball(np.add(BUN, (0, 0.1, 0)), (0.28, 0.26, 0.28), 0.02)
    _plait(clay)
    return clay


def plait_path(share: Array) -> Array:
    """Points of the plait's middle: from behind the ear over the collar bone to the chest."""
    control = [
        (-0.50, 0.72, -0.15),
        (-0.95, 0.80, -0.9),
        (-0.80, 0.10, -1.35),
        (-0.62, -0.42, -1.6),
        (-0.52, -0.62, -2.45),
    ]
    return curve(control, len(share))


def _plait(clay: Clay) -> None:
    share = np.linspace(0, 1, 220)
    middle = plait_path(share)
    along = np.gradient(middle, axis=0)
    along /= np.linalg.norm(along, axis=1, keepdims=True)
    across = np.cross(along, np.array([-0.5, -0.8, 0.3]))
    across /= np.linalg.norm(across, axis=1, keepdims=True)
    out = np.cross(across, along)
    width = (0.13 - 0.06 * share)[:, None]
    for strand in range(3):
        turn = share[:, None] * 34.0 + strand * 2 * np.pi / 3
        points = middle + width * (across * np.sin(turn) + 0.45 * out * np.sin(2 * turn))
        clay.tube(points, 0.8 * width[:, 0], 0.01)
    clay.ball(middle[-1] + (0, 0, -0.05), (0.05, 0.05, 0.11), 0.02)


def _leaf(builder: MeshBuilder, foot: Array, along: Array, out: Array, long: float, wide: float) -> None:
    """A leaf with a folded middle, that bends outwards."""
    s, t = np.meshgrid(np.linspace(0, 1, 17), np.linspace(-1, 1, 9), indexing="ij")
    along, out = along / np.linalg.norm(along), out / np.linalg.norm(out)
    across = np.cross(along, out)
    half = wide * np.sin(np.pi * s**0.8) ** 0.9
    rise = 0.35 * long * s**2 + 0.35 * half * np.abs(t)
    points = foot + s[..., None] * long * along + (half * t)[..., None] * across + rise[..., None] * out
    for turned in (points, points[::-1] - 0.006 * out):
        builder.grid(turned, "Gold")


def _ornaments(scene, gold) -> None:
    """A wreath of gold leaves, an earring on each side, and a ring round the plait's end."""
    builder = MeshBuilder()
    for side in SIDES:
        for angle in np.radians(np.linspace(8, 112, 12)):
            way = np.array([[side * np.sin(angle), -np.cos(angle), 0.62 + 0.12 * np.sin(angle)]])
            foot = over_skull(way, 0.13)[0]
            ahead = over_skull(
                np.array([[side * np.sin(angle - 0.05), -np.cos(angle - 0.05), 0.62 + 0.12 * np.sin(angle)]]),
                0.13,
            )[0]
            out = foot - SKULL
            for up in (-0.55, 0.55):
                _leaf(
                    builder,
                    foot,
                    (ahead - foot) / np.linalg.norm(ahead - foot) + (0, 0, up),
                    out,
                    0.27,
                    0.062,
                )
        ear = np.array([0.765 * side, -0.03, -0.45])
        builder.ball(ear, (0.035,) * 3, "Gold")
        if side < 0:
            builder.ball(ear - (0, 0, 0.16), (0.06, 0.06, 0.12), "Gold", segments=32)
        else:
            turn, tube = np.meshgrid(
                np.linspace(0, 2 * np.pi, 49), np.linspace(0, 2 * np.pi, 17)[:-1], indexing="ij"
            )
            ring = 0.13 + 0.018 * np.cos(tube)
            points = np.stack([0.018 * np.sin(tube), ring * np.sin(turn), ring * np.cos(turn)], axis=-1)
            builder.grid(ear - (0, 0, 0.15) + points, "Gold", closed=True)
    made = place("Ornaments", builder.mesh("Ornaments", {"Gold": gold}), scene.collection)
    made.data.shade_smooth()


def _socle(scene) -> None:
    builder = MeshBuilder()
    profile = [
        (0.0, -3.0),
        (0.46, -3.02),
        (0.40, -3.2),
        (0.34, -3.4),
        (0.42, -3.55),
        (0.62, -3.62),
        (0.62, -3.75),
        (0.8, -3.8),
        (0.8, -5.5),
    ]
    builder.lathe(profile[::-1], 96, "Z", (0, 0.1, 0), "Socle")
    look = material("Socle", (0.03, 0.035, 0.04), 0.16)
    place("Socle", builder.mesh("Socle", {"Socle": look}), scene.collection)


def _area(scene, name: str, at: Sequence[float], size: float, energy: float, color: Sequence[float]) -> None:
    from mathutils import Vector

    light = bpy.data.objects.new(name, bpy.data.lights.new(name, "AREA"))
    light.data.energy, light.data.size, light.data.color = energy, size, color
    light.location = at
    light.rotation_euler = (Vector((0, 0, -0.4)) - light.location).to_track_quat("-Z", "Y").to_euler()
    scene.collection.objects.link(light)


def _studio(scene) -> None:
    """A large warm light on the left, a cool one on the right, one from behind, and a dark ground."""
    _area(scene, "Key", (-6.0, -5.0, 5.0), 2.4, 1150.0, (1.0, 0.85, 0.68))
    _area(scene, "Fill", (6.5, -2.5, 1.0), 4.0, 170.0, (0.50, 0.70, 1.0))
    _area(scene, "Back", (1.5, 6.0, 4.5), 3.0, 900.0, (1.0, 0.92, 0.82))
    scene.world = bpy.data.worlds.new("Ground")
    if scene.world.node_tree is None:
        scene.world.use_nodes = True
    tree = scene.world.node_tree
    coordinates, parts = tree.nodes.new("ShaderNodeTexCoord"), tree.nodes.new("ShaderNodeSeparateXYZ")
    ramp = tree.nodes.new("ShaderNodeValToRGB")
    low, high = ramp.color_ramp.elements
    low.position, low.color = 0.0, (0.006, 0.014, 0.020, 1.0)
    high.position, high.color = 1.0, (0.055, 0.105, 0.115, 1.0)
    tree.links.new(coordinates.outputs["Generated"], parts.inputs[0])
    tree.links.new(parts.outputs["Y"], ramp.inputs[0])
    tree.links.new(ramp.outputs["Color"], tree.nodes["Background"].inputs["Color"])
    tree.nodes["Background"].inputs["Strength"].default_value = 1.0
    scene.view_settings.view_transform, scene.view_settings.look = "AgX", "AgX - Medium High Contrast"


# Distances of the surfaces from the line at which projectors end.
REACH = (6.0, 0.03)
# The line runs from the middle of the face backwards. RADIUS: where the picture keeps the widths of things.
START, RADIUS = 0.05, 0.9
# The most degrees by which projectors turn to each side, by height: ears are seen from the side, shoulders
# and crown nearly from the front, as their outlines would be wide and flat otherwise.
TURNS = ((-1.9, 27.0), (-0.65, 62.0), (0.40, 62.0), (1.5, 20.0))
# Half the width that the picture shows, its lowest and its highest point, and its aspect, which makes it
# narrower than things are.
HALF, LOW, HIGH, ASPECT = 2.1, -3.5, 1.75, 0.64
# How fast the picture's middle passes over things: below 1, the face is larger than what is beside it.
FACE = 0.9
ROWS, COLUMNS = 41, 121


def surfaces() -> list[Array]:
    """Points of the near and the far surface."""
    across, heights = np.linspace(-1, 1, COLUMNS), np.linspace(LOW, HIGH, ROWS)
    along = HALF * across * (FACE + (1 - FACE) * across**2)
    turns = np.radians(smooth_table(TURNS, heights))
    return [walk(reach, heights, along, turns, radius=RADIUS, start=START) for reach in REACH]
