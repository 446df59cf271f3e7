# SPDX-License-Identifier: GPL-3.0-or-later
"""Twisted streets: a film of one volume by shape keys of its three surfaces, and an impossible street."""

from __future__ import annotations

import importlib

import numpy as np

from ..mesh import Array

# Rows and columns of the surfaces' points.
ROWS, COLUMNS = 13, 25
EYE = np.array([0.0, -17.0, 2.0])
# Distances of the three surfaces from the eye, the half width of the image at distance 1, and its aspect.
DEPTHS, HALF_WIDTH, ASPECT = (0.6, 30.0, 130.0), 0.72, 2.0
# Where the image's middle looks to, above the horizon, at distance 1.
LIFT = 0.09
# Turns of the surfaces about the line of sight, in degrees, when the volume is twisted.
TWIST = (0.0, 0.0, 150.0)
# The unrolled street: y of its left and right end, z of its lower and upper one, and x of the three surfaces.
LEFT, RIGHT, LOW, HIGH, ACROSS = 46.0, -14.0, -3.0, 23.0, (0.0, 20.0, 70.0)
# How far its projectors fall on each metre, and x of the fronts: the pavement is seen from above.
DOWN, FRONT = 0.3, 14.0
# The impossible street: its eye, how far it looks up at distance 1, and the turns of its surfaces in degrees.
HIGH_EYE, HIGH_LIFT, IMPOSSIBLE = np.array([0.0, -22.0, 8.0]), -0.1, (0.0, 20.0, 120.0)
# Frames at which the shapes Twist and Unrolled are fully there or gone: (frame, twist, unrolled).
KEYS = ((1, 0, 0), (6, 0, 0), (33, 1, 0), (38, 1, 0), (66, 0, 1), (72, 0, 1), (100, 0, 0))
LENGTH = KEYS[-1][0]


def image_points() -> tuple[Array, Array]:
    """Places in the image from -1 to 1, (ROWS, COLUMNS) each, row 0 at the bottom."""
    x, y = np.meshgrid(np.linspace(-1, 1, COLUMNS), np.linspace(-1, 1, ROWS))
    return x, y


def perspective(number: int, degrees: float = 0.0, eye: Array = EYE, lift: float = LIFT) -> Array:
    """Points (ROWS, COLUMNS, 3) of a surface of the frustum, turned about the line of sight."""
    x, y = image_points()
    turn, reach = np.radians(degrees), DEPTHS[number]
    x, y = x * HALF_WIDTH, y * HALF_WIDTH / ASPECT
    x, y = x * np.cos(turn) - y * np.sin(turn), x * np.sin(turn) + y * np.cos(turn)
    return eye + reach * np.stack([x, np.ones_like(x), y + lift], axis=-1)


def unrolled(number: int) -> Array:
    """Points of a surface that looks at the fronts of the street's right side, each squarely."""
    x, y = image_points()
    along = LEFT + (x + 1) / 2 * (RIGHT - LEFT)
    up = LOW + (y + 1) / 2 * (HIGH - LOW) + DOWN * (FRONT - ACROSS[number])
    return np.stack([np.full_like(x, ACROSS[number]), along, up], axis=-1)


def camera_of(scene, module: str, surfaces: list[Array], name: str = "Twisted"):
    """Add a flexible camera with two or three grids, and make it the scene's.

    module: the extension's package.
    """
    import bpy

    flexible = importlib.import_module(f"{module}.scfpf_addon.bridge.camera.flexible_camera")
    camera = bpy.data.objects.new(name, bpy.data.cameras.new(name))
    scene.collection.objects.link(camera)
    bpy.context.view_layer.update()
    names = ("Near", *(("Middle",) * (len(surfaces) - 2)), "Far")
    made = [
        flexible.NewSurface(title, "GRID", np.eye(4), points=points)
        for title, points in zip(names, surfaces, strict=True)
    ]
    flexible.replace_surfaces(camera, made)
    flexible.make_flexible(camera)
    scene.camera = camera
    return camera


def impossible_street():
    """The street through a volume that turns as it goes: the far end hangs head down. Returns the scene."""
    from .. import render_demo

    scene = render_demo.build_street()
    surfaces = [perspective(number, turn, HIGH_EYE, HIGH_LIFT) for number, turn in enumerate(IMPOSSIBLE)]
    camera_of(scene, render_demo.MODULE, surfaces)
    return scene


def add_camera(scene, module: str):
    """Add the flexible camera of the film to the street. module: the extension's package."""
    camera = camera_of(scene, module, [perspective(number) for number in range(3)])
    for number, slot in enumerate(camera.scfpf.surfaces):
        for name, points in (("Twist", perspective(number, TWIST[number])), ("Unrolled", unrolled(number))):
            _add_shape(slot.object, name, points - perspective(number))
    scene.frame_start, scene.frame_end = KEYS[0][0], LENGTH
    return camera


def _add_shape(surface, name: str, moved: Array) -> None:
    """Add a shape key that moves each point of a grid, and its keyframes."""
    if surface.data.shape_keys is None:
        surface.shape_key_add(name="Basis")
    shape = surface.shape_key_add(name=name)
    at = np.empty(3 * len(shape.data), np.float32)
    shape.data.foreach_get("co", at)
    shape.data.foreach_set("co", (at + moved.reshape(-1)).astype(np.float32))
    for frame, twist, unroll in KEYS:
        shape.value = twist if name == "Twist" else unroll
        shape.keyframe_insert("value", frame=frame)
