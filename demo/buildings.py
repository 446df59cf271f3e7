# SPDX-License-Identifier: GPL-3.0-or-later
"""Town houses: walls with recessed windows, shop fronts, cornices and roofs, from a few templates."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Literal

import bpy
import numpy as np

from .mesh import BOX_FACES, Array, MeshBuilder, material

RoofKind = Literal["FLAT", "GABLE", "HIP"]

GROUND_FLOOR, STOREY = 3.9, 3.1
BAY = 2.7
REVEAL = 0.22
EAVES = 0.45


def building_materials() -> dict[str, bpy.types.Material]:
    """The palette of all houses by name."""
    walls = {
        "Cream": (0.62, 0.50, 0.33),
        "Ochre": (0.56, 0.31, 0.10),
        "Brick": (0.30, 0.085, 0.05),
        "Rose": (0.55, 0.25, 0.19),
        "Slate blue": (0.20, 0.28, 0.36),
        "Stone": (0.42, 0.39, 0.34),
        "Sage": (0.27, 0.34, 0.21),
        "White wall": (0.68, 0.66, 0.61),
    }
    shops = {"Shop red": (0.35, 0.02, 0.02), "Shop green": (0.02, 0.13, 0.06), "Shop blue": (0.02, 0.06, 0.2)}
    palette = {name: material(name, colour, 0.85) for name, colour in walls.items()}
    palette |= {name: material(name, colour, 0.4) for name, colour in shops.items()}
    palette |= {
        "Window": material("Window glass", (0.03, 0.045, 0.06), 0.08),
        "Shop window": material("Shop window", (0.06, 0.065, 0.06), 0.08),
        "Frame": material("Window frame", (0.72, 0.70, 0.66), 0.5),
        "Dressing": material("Stone dressing", (0.60, 0.56, 0.48), 0.8),
        "Door": material("Door", (0.09, 0.035, 0.015), 0.4),
        "Tiles": material("Roof tiles", (0.26, 0.07, 0.035), 0.8),
        "Slates": material("Roof slates", (0.07, 0.075, 0.09), 0.6),
        "Felt": material("Roof felt", (0.11, 0.115, 0.12), 0.9),
        "Awning": material("Awning", (0.70, 0.62, 0.48), 0.8),
        "Clock": material("Clock face", (0.80, 0.78, 0.70), 0.4),
    }
    return palette


@dataclass(frozen=True)
class House:
    """A house on a rectangle of the ground. windows: its walls with windows, of "SENW" (south is -y)."""

    low: tuple[float, float]
    high: tuple[float, float]
    storeys: int
    wall: str
    shop: str
    roof: RoofKind
    windows: str
    awnings: bool = False

    @property
    def height(self) -> float:
        """The height of the eaves."""
        return GROUND_FLOOR + STOREY * (self.storeys - 1)


class _Template:
    """Quads in the axes of a wall: (along, outward, up), each with a material."""

    def __init__(self) -> None:
        self.vertices: list[tuple[float, float, float]] = []
        self.faces: list[tuple[int, int, int, int]] = []
        self.materials: list[str] = []

    def quad(self, corners: list[tuple[float, float, float]], name: str) -> None:
        start = len(self.vertices)
        self.vertices += corners
        self.faces.append((start, start + 1, start + 2, start + 3))
        self.materials.append(name)

    def panel(self, u: tuple[float, float], z: tuple[float, float], w: float, name: str) -> None:
        """A rectangle in the wall's plane moved outward by w."""
        self.quad([(u[0], w, z[0]), (u[1], w, z[0]), (u[1], w, z[1]), (u[0], w, z[1])], name)

    def box(self, u: tuple[float, float], w: tuple[float, float], z: tuple[float, float], name: str) -> None:
        start = len(self.vertices)
        self.vertices += [(u[i & 1], w[1 - (i >> 1 & 1)], z[i >> 2]) for i in range(8)]
        self.faces += [tuple(start + k for k in face) for face in BOX_FACES]  # type: ignore[misc]
        self.materials += [name] * 6

    def opening(
        self, u: tuple[float, float], z: tuple[float, float], cell: tuple[float, float], wall: str
    ) -> None:
        """The wall of a cell (width, height) round an opening, and the opening's reveals."""
        for strip in (((0.0, u[0]), (0.0, cell[1])), ((u[1], cell[0]), (0.0, cell[1]))):
            self.panel(*strip, 0.0, wall)
        self.panel(u, (0.0, z[0]), 0.0, wall)
        self.panel(u, (z[1], cell[1]), 0.0, wall)
        (a, b), (c, d), w = u, z, -REVEAL
        self.quad([(a, 0, c), (b, 0, c), (b, w, c), (a, w, c)], "Dressing")
        self.quad([(a, w, d), (b, w, d), (b, 0, d), (a, 0, d)], wall)
        self.quad([(a, 0, c), (a, w, c), (a, w, d), (a, 0, d)], wall)
        self.quad([(b, w, c), (b, 0, c), (b, 0, d), (b, w, d)], wall)


def _window(width: float, wall: str) -> _Template:
    """A storey's bay: a casement of six panes, a sill and a lintel."""
    cell = _Template()
    half, low, high = 0.58, 0.85, 2.55
    u = (width / 2 - half, width / 2 + half)
    cell.opening(u, (low, high), (width, STOREY), wall)
    cell.panel(u, (low, high), -REVEAL, "Window")
    bar = 0.045
    for at in (u[0] + bar, width / 2, u[1] - bar):
        cell.panel((at - bar, at + bar), (low, high), -REVEAL + 0.03, "Frame")
    for at in (low + bar, low + 1.1, high - bar):
        cell.panel(u, (at - bar, at + bar), -REVEAL + 0.035, "Frame")
    cell.box((u[0] - 0.12, u[1] + 0.12), (-0.01, 0.14), (low - 0.12, low), "Dressing")
    cell.box((u[0] - 0.12, u[1] + 0.12), (-0.01, 0.06), (high, high + 0.2), "Dressing")
    return cell


def _shop(width: float, house: House) -> _Template:
    """A bay of the ground floor: a shop window, its fascia board, sometimes an awning."""
    cell = _Template()
    u, z = (0.18, width - 0.18), (0.6, 2.85)
    cell.opening(u, z, (width, GROUND_FLOOR), house.shop)
    cell.panel(u, z, -REVEAL, "Shop window")
    for at in (u[0] + 0.05, width / 2, u[1] - 0.05):
        cell.panel((at - 0.05, at + 0.05), z, -REVEAL + 0.03, house.shop)
    cell.box((0.0, width), (-0.01, 0.12), (3.0, 3.5), house.shop)
    cell.box((0.0, width), (-0.01, 0.24), (3.5, 3.62), "Dressing")
    if house.awnings:
        stripes = 6
        for i in range(stripes):
            a, b = (u[0] + (u[1] - u[0]) * k / stripes for k in (i, i + 1))
            name = "Awning" if i % 2 else house.shop
            cell.quad([(a, 1.25, 2.35), (b, 1.25, 2.35), (b, 0.13, 2.98), (a, 0.13, 2.98)], name)
            cell.quad([(a, 1.25, 2.15), (b, 1.25, 2.15), (b, 1.25, 2.35), (a, 1.25, 2.35)], name)
    return cell


def _doorway(width: float, house: House) -> _Template:
    """A bay of the ground floor with a panelled door up two steps."""
    cell = _Template()
    half = 0.62
    u, z = (width / 2 - half, width / 2 + half), (0.3, 2.85)
    cell.opening(u, z, (width, GROUND_FLOOR), house.wall)
    cell.panel(u, (z[0], 2.35), -REVEAL, "Door")
    cell.panel(u, (2.35, z[1]), -REVEAL, "Window")
    cell.panel(u, (2.31, 2.39), -REVEAL + 0.03, "Frame")
    for row in ((0.5, 1.1), (1.25, 2.2)):
        for middle in (width / 2 - 0.3, width / 2 + 0.3):
            cell.box((middle - 0.2, middle + 0.2), (-REVEAL - 0.01, -REVEAL + 0.03), row, "Door")
    for edge in (u[0] - 0.2, u[1]):
        cell.box((edge, edge + 0.2), (-0.01, 0.09), (0.0, 2.95), "Dressing")
    cell.box((u[0] - 0.3, u[1] + 0.3), (-0.01, 0.25), (2.95, 3.15), "Dressing")
    cell.box((u[0] - 0.1, u[1] + 0.1), (-0.3, 0.35), (0.0, 0.15), "Dressing")
    cell.box((u[0] - 0.1, u[1] + 0.1), (-0.3, 0.05), (0.15, 0.3), "Dressing")
    return cell


def _walls(house: House) -> list[tuple[str, Array, Array, Array, float]]:
    """(side, its first corner, direction along it seen from outside, outward normal, length)."""
    (x0, y0), (x1, y1) = house.low, house.high
    east, north = np.array([1.0, 0, 0]), np.array([0, 1.0, 0])
    return [
        ("S", np.array([x0, y0, 0.0]), east, -north, x1 - x0),
        ("E", np.array([x1, y0, 0.0]), north, east, y1 - y0),
        ("N", np.array([x1, y1, 0.0]), -east, north, x1 - x0),
        ("W", np.array([x0, y1, 0.0]), -north, -east, y1 - y0),
    ]


def _facade(
    builder: MeshBuilder, house: House, corner: Array, along: Array, normal: Array, length: float
) -> None:
    bays = max(2, round(length / BAY))
    width = length / bays
    axes = np.stack([along, normal, np.array([0.0, 0.0, 1.0])])

    def tile(cell: _Template, columns: Array, floors: Array) -> None:
        across, up = (grid.ravel() for grid in np.meshgrid(columns * width, floors))
        offsets = corner + across[:, None] * along + up[:, None] * axes[2]
        builder.add_copies(np.array(cell.vertices) @ axes, cell.faces, offsets, cell.materials)

    door = np.array([bays - 1 if bays % 2 else 0])
    tile(_doorway(width, house), door, np.zeros(1))
    tile(_shop(width, house), np.setdiff1d(np.arange(bays), door), np.zeros(1))
    tile(_window(width, house.wall), np.arange(bays), GROUND_FLOOR + STOREY * np.arange(house.storeys - 1))


def _flat_roof(builder: MeshBuilder, house: House) -> None:
    """Felt behind a parapet, with roof lights and a chimney stack."""
    (x0, y0), (x1, y1) = house.low, house.high
    top, thick = house.height, 0.35
    builder.box((x0 - 0.3, y0 - 0.3, top - 0.35), (x1 + 0.3, y1 + 0.3, top), "Dressing")
    builder.box((x0, y0, top), (x1, y1, top + 0.15), "Felt")
    for low, high in (
        ((x0, y0), (x1, y0 + thick)),
        ((x0, y1 - thick), (x1, y1)),
        ((x0, y0 + thick), (x0 + thick, y1 - thick)),
        ((x1 - thick, y0 + thick), (x1, y1 - thick)),
    ):
        builder.box((*low, top), (*high, top + 0.8), house.wall)
        builder.box(
            (low[0] - 0.07, low[1] - 0.07, top + 0.8),
            (high[0] + 0.07, high[1] + 0.07, top + 0.92),
            "Dressing",
        )
    for x_share, y_share in ((0.3, 0.3), (0.3, 0.7), (0.62, 0.5)):
        x, y = x0 + x_share * (x1 - x0), y0 + y_share * (y1 - y0)
        builder.box((x - 0.9, y - 0.6, top), (x + 0.9, y + 0.6, top + 0.5), "Frame")
        builder.box((x - 0.8, y - 0.5, top + 0.5), (x + 0.8, y + 0.5, top + 0.56), "Window")
    stack = np.array([x0 + 0.86 * (x1 - x0), y0 + 0.78 * (y1 - y0)])
    _chimney(builder, stack, top, top + 2.3)


def _chimney(builder: MeshBuilder, at: Array, low: float, high: float) -> None:
    builder.box((*(at - 0.45), low), (*(at + 0.45), high), "Brick")
    for shift in (-0.2, 0.2):
        builder.lathe([(0.13, 0), (0.10, 0.45), (0.0, 0.45)], 8, "Z", (at[0] + shift, at[1], high), "Tiles")


def _roof(builder: MeshBuilder, house: House) -> None:
    (x0, y0), (x1, y1) = np.array(house.low), np.array(house.high)
    top = house.height
    if house.roof == "FLAT":
        _flat_roof(builder, house)
        return
    builder.box((x0 - 0.2, y0 - 0.2, top - 0.3), (x1 + 0.2, y1 + 0.2, top), "Dressing")
    name = "Tiles" if house.roof == "GABLE" else "Slates"
    low, high = np.array([x0, y0]) - EAVES, np.array([x1, y1]) + EAVES
    middle = (low + high) / 2
    lengthwise = 1 if "E" in house.windows or "W" in house.windows else 0
    across = 1 - lengthwise
    rise = 0.42 * (high[across] - low[across])
    pull = 0.0 if house.roof == "GABLE" else 0.32 * (high[lengthwise] - low[lengthwise])
    ridge = np.array([middle, middle])
    ridge[0, lengthwise], ridge[1, lengthwise] = low[lengthwise] + pull, high[lengthwise] - pull
    points = np.array(
        [(*low, top), (high[0], low[1], top), (*high, top), (low[0], high[1], top)]
        + [(*point, top + rise) for point in ridge]
    )
    slopes = [(0, 1, 5, 4), (2, 3, 4, 5)] if lengthwise == 0 else [(1, 2, 5, 4), (3, 0, 4, 5)]
    ends = [(1, 2, 5), (3, 0, 4)] if lengthwise == 0 else [(2, 3, 5), (0, 1, 4)]
    builder.add(points, slopes, name)
    builder.add(points, ends, name if house.roof == "HIP" else house.wall)
    builder.add(points, [(3, 2, 1, 0)], "Dressing")
    for share in (0.18, 0.80):
        at = low + share * (high - low)
        at[across] = middle[across] + 0.8
        _chimney(builder, at, top + 0.3 * rise, top + rise + 0.9)


def build_house(house: House) -> MeshBuilder:
    """The mesh of a house in world coordinates."""
    builder = MeshBuilder()
    for side, corner, along, normal, length in _walls(house):
        if side in house.windows:
            _facade(builder, house, corner, along, normal, length)
        else:
            up = np.array([0, 0, house.height])
            end = corner + length * along
            builder.add([corner, end, end + up, corner + up], [(0, 1, 2, 3)], house.wall)
    _roof(builder, house)
    return builder


def _lancet(
    builder: MeshBuilder,
    foot: tuple[float, float],
    facing: float,
    half: float,
    low: float,
    height: float,
    pane: str = "Window",
) -> None:
    """A pointed opening in a dressed frame on a wall at foot = (x, y), from low up."""
    spring = np.radians(np.linspace(0, 60, 7))
    right = np.stack([2 * half * np.cos(spring) - half, 2 * half * np.sin(spring) + height], axis=-1)
    outline = np.concatenate([[[-half, 0.0], [half, 0.0]], right, (right * [-1, 1])[-2::-1]])

    def wall(p: Array, q: Array, out: Array) -> Array:
        return np.stack([foot[0] + p, foot[1] + facing * out + 0 * p, low + q], axis=-1)

    builder.badge(
        wall,
        outline,
        [(1.25, -0.05, "Dressing"), (1.25, 0.12, "Dressing"), (1.0, 0.12, "Dressing"), (0.96, 0.03, pane)],
    )


def build_clock_tower(centre: tuple[float, float], facing: float) -> MeshBuilder:
    """A church tower that closes a street; facing: -1 looks to -y, +1 to +y."""
    builder = MeshBuilder()
    x, y = centre
    for half, low, high in ((3.4, 0, 9), (3.1, 9, 17), (2.8, 17, 23)):
        builder.box((x - half, y - half, low), (x + half, y + half, high), "Stone")
        builder.box(
            (x - half - 0.3, y - half - 0.3, high - 0.4), (x + half + 0.3, y + half + 0.3, high), "Dressing"
        )
    spire = np.array(
        [(x - 3, y - 3, 23), (x + 3, y - 3, 23), (x + 3, y + 3, 23), (x - 3, y + 3, 23), (x, y, 33)]
    )
    builder.add(spire, [(0, 1, 4), (1, 2, 4), (2, 3, 4), (3, 0, 4)], "Slates")
    front = y + facing * 2.8
    builder.lathe(
        [(1.7, 0), (1.7, 0.2 * facing), (1.5, 0.24 * facing), (0, 0.24 * facing)],
        40,
        "Y",
        (x, front, 20),
        ["Dressing", "Dressing", "Clock"],
    )
    for width, length, angle in ((0.09, 1.2, 0.3), (0.07, 1.35, -1.9)):
        tip = np.array([np.sin(angle), np.cos(angle)]) * length
        side = np.array([np.cos(angle), -np.sin(angle)]) * width
        plan = np.array([side, -side, tip])
        points = np.column_stack([x + plan[:, 0], np.full(3, front + 0.3 * facing), 20 + plan[:, 1]])
        builder.add(points, [(0, 1, 2)], "Shop blue")
    for low, wall, half in ((11.0, 3.1, 0.55), (13.8, 3.1, 0.55), (5.5, 3.4, 0.7)):
        _lancet(builder, (x, y + facing * wall), facing, half, low, 2.6 * half)
    _lancet(builder, (x, y + facing * 3.4), facing, 1.1, 0.0, 2.6, "Door")
    for corner in (-3.4, 3.4):
        for low, high, depth in ((0.0, 4.5, 0.9), (4.5, 8.0, 0.55)):
            front, back = sorted((y + facing * (3.4 + depth), y))
            builder.box((x + corner - 0.45, front, low), (x + corner + 0.45, back, high), "Dressing")
    return builder
