# SPDX-License-Identifier: GPL-3.0-or-later
"""A saloon car built in code, with a 7 on its left doors and a 4 on its right.

The around-the-car preset is made for a car centred on the origin of a frame with x to the right, y up and z
towards a viewer who faces the nose. CAR_TO_WORLD takes it to Blender's world: (x, y, z) -> (x, -z, y). There
the nose is at y = -2.2 and the tail at y = 2.2, the half-width without mirrors is 0.9, and the wheels stand
on z = 0.
"""

from __future__ import annotations

from collections.abc import Callable
from itertools import pairwise

import bpy
import numpy as np

from . import car_body
from .car_body import front_surface, rear_surface, side_surface, top_surface
from .mesh import Array, MeshBuilder, Surface, ellipse, material, place, rounded_rectangle, subdivided

CAR_TO_WORLD = np.array([[1.0, 0, 0, 0], [0, 0, -1, 0], [0, 1, 0, 0], [0, 0, 0, 1]])

LEFT_NUMBER, RIGHT_NUMBER = "7", "4"
NUMBER_PLATE = "SCF 26PF"
WHEEL_RADIUS, WHEEL_CENTRE = car_body.HUB_HEIGHT, 0.775
BUMPER_REACH, BUMPER_HALF_WIDTH = 2.2, 0.895

PAINT = (0.0, 0.26, 0.28)
# The parts that parked cars lack: the numbers, and with them the doors' lines.
UNSHARED_PARTS = ("Car left side", "Car right side")


def car_materials() -> dict[str, bpy.types.Material]:
    """The palette of the car by name."""
    return {
        "Paint": material("Car paint", PAINT, 0.22),
        "Roof": material("Car roof", (0.78, 0.74, 0.62), 0.28),
        "Glass": material("Car glass", (0.014, 0.022, 0.027), 0.06),
        "Trim": material("Car trim", (0.012, 0.012, 0.013), 0.5),
        "Underbody": material("Car underbody", (0.008, 0.008, 0.008), 0.9),
        "Chrome": material("Chrome", (0.80, 0.81, 0.83), 0.12, 1.0),
        "Rubber": material("Tyre", (0.014, 0.014, 0.015), 0.75),
        "Rim": material("Wheel rim", (0.60, 0.61, 0.63), 0.3, 0.9),
        "Headlight": material("Headlight", (0.95, 0.93, 0.84), 0.1, 0.0, 0.5),
        "Tail-light": material("Tail-light", (0.62, 0.006, 0.008), 0.15, 0.0, 0.6),
        "Indicator": material("Indicator", (0.85, 0.24, 0.01), 0.15, 0.0, 0.25),
        "White": material("Sign white", (0.82, 0.82, 0.80), 0.5),
        "Black": material("Sign black", (0.012, 0.012, 0.012), 0.5),
        "Yellow": material("Plate yellow", (0.82, 0.56, 0.02), 0.5),
    }


def _text(
    builder: MeshBuilder, body: str, size: float, surface: Surface, height: float, name: str, fine: int = 0
) -> None:
    """Letters centred on the origin of a surface; fine: the number of times their triangles are split."""
    curve = bpy.data.curves.new("Lettering", "FONT")
    curve.body, curve.size, curve.align_x, curve.align_y = body, size, "CENTER", "CENTER"
    letters = bpy.data.objects.new("Lettering", curve)
    mesh = letters.to_mesh()
    corners = np.empty(len(mesh.vertices) * 3)
    mesh.vertices.foreach_get("co", corners)
    mesh.calc_loop_triangles()
    triangles = np.empty(len(mesh.loop_triangles) * 3, np.int32)
    mesh.loop_triangles.foreach_get("vertices", triangles)
    letters.to_mesh_clear()
    bpy.data.objects.remove(letters)
    bpy.data.curves.remove(curve)
    flat, faces = subdivided(corners.reshape(-1, 3), triangles.reshape(-1, 3), fine)
    points = surface(flat[:, 0], flat[:, 1], np.full(len(flat), height))
    builder.add(points, faces, name)


def _shifted(surface: Surface, p: float, q: float, mirror: float = 1.0) -> Surface:
    """The surface with its origin at (p, q); mirror -1 reverses its first parameter."""
    return lambda a, b, height: surface(p + mirror * a, q + b, height)


def _bumper(builder: MeshBuilder, end: float, height: float) -> None:
    """A chrome bar that wraps an end of the car, -1 the nose, +1 the tail."""
    turn = np.linspace(0, np.pi, 49)
    cosine, sine = np.cos(turn), np.sin(turn)
    reach, depth = BUMPER_REACH - 1.84, 0.035
    x = (BUMPER_HALF_WIDTH - depth) * np.sign(cosine) * np.abs(cosine) ** 0.42
    y = end * (1.84 + (reach - depth) * np.abs(sine) ** 0.42)
    path = np.stack([x, y, np.full(49, height)], axis=-1)
    along = np.gradient(path, axis=0)
    outward = np.cross(along, [0.0, 0.0, 1.0]) * -end
    outward /= np.linalg.norm(outward, axis=1, keepdims=True)
    section = rounded_rectangle(2 * depth, 0.115, 0.034)
    builder.sweep(path, outward, section, "Chrome")
    builder.sweep(path + outward * 0.026, outward, rounded_rectangle(0.028, 0.03, 0.009), "Trim")


def _lamp(builder: MeshBuilder, surface: Surface, outline: Array, lens: str, height: float = 0.03) -> None:
    """A lens in a chrome bezel."""
    builder.badge(
        surface,
        outline,
        [
            (1.1, -0.03, "Chrome"),
            (1.1, height, "Chrome"),
            (0.97, height, "Chrome"),
            (0.92, 0.4 * height, lens),
            (0.75, 0.8 * height, lens),
            (0.4, height, lens),
        ],
    )


def _front() -> MeshBuilder:
    builder = MeshBuilder()
    _bumper(builder, -1.0, 0.415)
    builder.badge(
        front_surface,
        rounded_rectangle(0.64, 0.17, 0.03, (0.0, 0.585)),
        [(1.0, -0.03, "Chrome"), (1.0, 0.03, "Chrome"), (0.955, 0.03, "Chrome"), (0.94, 0.004, "Black")],
    )
    for z in np.linspace(0.53, 0.64, 5):
        builder.badge(
            front_surface,
            rounded_rectangle(0.60, 0.011, 0.004, (0.0, z)),
            [(1, 0.0, "Chrome"), (1, 0.02, "Chrome")],
        )
    _lamp(builder, front_surface, ellipse(0.10, 0.13, (0.0, 0.585)), "Yellow", 0.045)
    for side in (-1.0, 1.0):
        _lamp(builder, front_surface, ellipse(0.19, 0.19, (side * 0.615, 0.585)), "Headlight", 0.035)
        _lamp(builder, front_surface, ellipse(0.135, 0.135, (side * 0.42, 0.585)), "Headlight", 0.03)
        _lamp(
            builder,
            front_surface,
            rounded_rectangle(0.19, 0.055, 0.02, (side * 0.60, 0.315)),
            "Indicator",
            0.02,
        )
    builder.badge(
        front_surface,
        rounded_rectangle(0.72, 0.075, 0.02, (0.0, 0.312)),
        [(1.0, -0.02, "Trim"), (1.0, 0.006, "Trim"), (0.93, 0.006, "Black")],
    )
    _plate(builder, front_surface, 0.415, 1.0, "White")
    return builder


def _plate(
    builder: MeshBuilder, surface: Surface, z: float, mirror: float, colour: str, height: float = 0.055
) -> None:
    builder.badge(
        surface,
        rounded_rectangle(0.52, 0.118, 0.012, (0.0, z)),
        [(1, -0.02, "Trim"), (1, height, "Trim"), (0.97, height + 0.002, colour)],
    )
    _text(builder, NUMBER_PLATE, 0.105, _shifted(surface, 0.0, z, mirror), height + 0.005, "Black")


def _rear() -> MeshBuilder:
    builder = MeshBuilder()
    _bumper(builder, 1.0, 0.43)
    for side in (-1.0, 1.0):
        _lamp(
            builder,
            rear_surface,
            rounded_rectangle(0.30, 0.185, 0.03, (side * 0.575, 0.655)),
            "Tail-light",
            0.025,
        )
        for x, z, width, lens in ((0.575, 0.592, 0.26, "Indicator"), (0.37, 0.615, 0.065, "White")):
            builder.badge(
                rear_surface,
                rounded_rectangle(width, 0.05, 0.012, (side * x, z)),
                [(1, -0.01, lens), (1, 0.032, lens), (0.9, 0.036, lens)],
            )
        builder.lathe(
            [(0.0, 0.10), (0.032, 0.10), (0.032, 0.0), (0.038, 0.0), (0.038, 0.25)],
            20,
            "Y",
            (side * 0.47, 2.13 - 0.25 + 0.02, 0.265),
            ["Black", "Black", "Chrome", "Chrome"],
        )
    for z, width in ((0.80, 1.45), (0.545, 0.62)):
        builder.strip(
            rear_surface,
            np.stack([np.linspace(-width / 2, width / 2, 40), np.full(40, z)], axis=-1),
            0.014,
            0.003,
            "Black",
        )
    builder.badge(
        rear_surface,
        rounded_rectangle(0.62, 0.03, 0.01, (0.0, 0.745)),
        [(1, -0.01, "Chrome"), (1, 0.02, "Chrome"), (0.9, 0.026, "Chrome")],
    )
    _plate(builder, rear_surface, 0.655, -1.0, "Yellow", 0.02)
    return builder


def _side(side: float, number: str) -> MeshBuilder:
    """Door lines, handles, mouldings, mirror and number of one side: +1 left, -1 right."""
    builder = MeshBuilder()
    surface = side_surface(side)
    arch = np.radians(np.linspace(190, 108, 12))
    around = np.stack([1.34 + 0.47 * np.cos(arch), car_body.HUB_HEIGHT + 0.47 * np.sin(arch)], axis=-1)
    low = 0.235
    front_door = _dense([(-0.74, 0.83), (-0.76, 0.5), (-0.72, low), (0.24, low)])
    middle = _dense([(0.24, low), (0.24, 0.84)])
    rear_door = _dense([(0.24, low), (0.86, low), *around.tolist(), (1.20, 0.845)])
    for path in (front_door, middle, rear_door):
        builder.strip(surface, path, 0.011, 0.002, "Black")
    for start, end in ((-1.99, -1.76), (-0.92, 0.92), (1.76, 1.99)):
        builder.strip(surface, _dense([(start, 0.435), (end, 0.435)]), 0.032, 0.007, "Trim")
        builder.strip(surface, _dense([(start, 0.452), (end, 0.452)]), 0.009, 0.009, "Chrome")
    builder.strip(surface, _dense([(-1.86, 0.695), (1.92, 0.735)]), 0.010, 0.005, "Chrome")
    for y in (0.12, 1.04):
        builder.badge(
            surface,
            rounded_rectangle(0.16, 0.026, 0.011, (y, 0.775)),
            [(1, -0.01, "Chrome"), (1, 0.028, "Chrome"), (0.85, 0.034, "Chrome")],
        )
    builder.badge(
        surface,
        ellipse(0.42, 0.42, (-0.25, 0.545), 48),
        [(1, -0.004, "Black"), (1, 0.008, "Black"), (0.94, 0.010, "White")],
    )
    _text(builder, number, 0.40, _shifted(surface, -0.25, 0.545, side), 0.016, "Black", fine=3)
    for y in (-1.98, 1.99):
        lens = "Indicator" if y < 0 else "Tail-light"
        builder.badge(
            surface,
            rounded_rectangle(0.09, 0.035, 0.012, (y, 0.60)),
            [(1, -0.03, lens), (1, 0.012, lens), (0.8, 0.018, lens)],
        )
    builder.ball((side * 0.965, -0.60, 0.955), (0.10, 0.055, 0.062), "Paint", 0.7)
    builder.badge(
        lambda x, z, h: np.stack([x, -0.545 + h + 0 * x, z], axis=-1),
        rounded_rectangle(0.17, 0.10, 0.03, (side * 0.965, 0.955)),
        [(1, -0.02, "Trim"), (1, 0.0, "Trim"), (0.9, 0.0, "Chrome")],
    )
    builder.box((side * 0.87 - 0.05, -0.625, 0.875), (side * 0.87 + 0.05, -0.565, 0.925), "Trim")
    return builder


def _dense(corners: list[tuple[float, float]]) -> Array:
    """The polyline with a point at least every four centimetres."""
    points = np.array(corners)
    pieces = [points[:1]]
    for start, end in pairwise(points):
        count = max(1, int(np.ceil(np.linalg.norm(end - start) / 0.04)))
        pieces.append(start + np.linspace(0, 1, count + 1)[1:, None] * (end - start))
    return np.concatenate(pieces)


def _top() -> MeshBuilder:
    """Bonnet and boot lines, the scuttle, the aerial."""
    builder = MeshBuilder()
    for side in (-1.0, 1.0):
        for start, end, inner, outer in ((-2.02, -0.82, 0.70, 0.74), (1.36, 2.08, 0.72, 0.70)):
            y = np.linspace(start, end, 30)
            builder.strip(
                top_surface,
                np.stack([side * np.linspace(inner, outer, 30), y], axis=-1),
                0.011,
                0.003,
                "Black",
            )
    x = np.linspace(-0.74, 0.74, 40)
    builder.strip(
        top_surface, np.stack([x, np.full(40, -0.94) + 0.13 * (x / 0.74) ** 2], axis=-1), 0.05, 0.004, "Trim"
    )
    builder.lathe([(0.004, 0.0), (0.003, 0.55), (0.0, 0.56)], 8, "Z", (-0.78, -1.0, 0.84), "Chrome")
    return builder


def _wheel() -> MeshBuilder:
    """A wheel about the x axis at the origin, its face towards +x."""
    builder = MeshBuilder()
    r = WHEEL_RADIUS
    shoulder = [
        (0.205, 0.080),
        (0.235, 0.098),
        (0.275, 0.102),
        (0.305, 0.094),
        (r - 0.004, 0.078),
        (r, 0.062),
    ]
    grooves = [(r, 0.040), (r - 0.009, 0.036), (r - 0.009, 0.026), (r, 0.022)]
    half = shoulder + grooves
    profile = half + [(radius, -along) for radius, along in half[::-1]]
    builder.lathe(profile, 36, "X", (0, 0, 0), "Rubber")
    builder.lathe(
        [
            (0.212, 0.078),
            (0.214, 0.094),
            (0.200, 0.098),
            (0.192, 0.085),
            (0.190, 0.02),
            (0.185, -0.08),
            (0.21, -0.085),
        ],
        36,
        "X",
        (0, 0, 0),
        ["Chrome", "Chrome", "Rim", "Rim", "Rim", "Rim"],
    )
    builder.lathe([(0.190, 0.012), (0.15, 0.014), (0.0, 0.014)], 36, "X", (0, 0, 0), "Black")
    builder.lathe([(0.145, 0.016), (0.145, 0.024), (0.06, 0.024)], 40, "X", (0, 0, 0), "Rim")
    builder.lathe(
        [(0.062, 0.02), (0.060, 0.076), (0.045, 0.084), (0.040, 0.098), (0.028, 0.104), (0.0, 0.105)],
        32,
        "X",
        (0, 0, 0),
        ["Rim", "Rim", "Chrome", "Chrome", "Chrome"],
    )
    for angle in np.radians(np.arange(0, 360, 45)):
        along, across = (
            np.array([0, np.cos(angle), np.sin(angle)]),
            np.array([0, -np.sin(angle), np.cos(angle)]),
        )
        corners = [
            np.array([depth, 0, 0]) + radius * along + sign * width * across
            for radius, width, back, front in ((0.05, 0.026, 0.03, 0.078), (0.194, 0.019, 0.03, 0.088))
            for depth in (back, front)
            for sign in (-1, 1)
        ]
        builder.hexahedron(np.array(corners), "Rim")
    return builder


def copy_car(
    car: bpy.types.Object,
    name: str,
    paint: bpy.types.Material,
    collection: bpy.types.Collection,
    location: tuple[float, float, float],
    turn: float,
) -> bpy.types.Object:
    """Another car that shares the first one's meshes; its paint is overridden on the objects."""
    root = bpy.data.objects.new(name, None)
    root.location, root.rotation_euler = location, (0.0, 0.0, turn)
    collection.objects.link(root)
    for part in car.children:
        if part.name in UNSHARED_PARTS:
            continue
        copy = part.copy()
        copy.name = part.name.replace("Car", name, 1)
        copy.parent = root
        collection.objects.link(copy)
        for slot in copy.material_slots:
            if slot.material.name == "Car paint":
                slot.link = "OBJECT"
                slot.material = paint
    return root


def build_car(collection: bpy.types.Collection) -> bpy.types.Object:
    """The car in a collection; its parts are children of the returned empty."""
    palette = car_materials()
    root = bpy.data.objects.new("Car", None)
    root.empty_display_size = 0.5
    collection.objects.link(root)
    parts: dict[str, Callable[[], MeshBuilder]] = {
        "Car body": car_body.build_body,
        "Car cabin": car_body.build_cabin,
        "Car front": _front,
        "Car rear": _rear,
        "Car left side": lambda: _side(1.0, LEFT_NUMBER),
        "Car right side": lambda: _side(-1.0, RIGHT_NUMBER),
        "Car top": _top,
    }
    for name, build in parts.items():
        place(name, build().mesh(name, palette, outward=True), collection, parent=root)
    wheel = _wheel().mesh("Car wheel", palette, outward=True)
    for name, side, hub in (
        ("front left", 1, 0),
        ("front right", -1, 0),
        ("rear left", 1, 1),
        ("rear right", -1, 1),
    ):
        location = (side * WHEEL_CENTRE, car_body.HUBS[hub], WHEEL_RADIUS)
        place(f"Car wheel {name}", wheel, collection, location, 0.0 if side > 0 else np.pi, parent=root)
    return root
