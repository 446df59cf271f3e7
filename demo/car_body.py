# SPDX-License-Identifier: GPL-3.0-or-later
"""The car's shell: a body lofted from profile tables along its length, and a glazed cabin on it.

World axes: the nose points to -Y, the car's right side is at -X, wheels stand on z = 0. Lengths in metres.
"""

from __future__ import annotations

from itertools import pairwise

import numpy as np

from .mesh import Array, MeshBuilder, Surface, smooth_table

NOSE, TAIL = -2.16, 2.16
HALF_WIDTH = 0.9
HUBS = (-1.34, 1.34)
HUB_HEIGHT = 0.33
ARCH_RADIUS = 0.385
FLARE = 0.022
EDGE_RADIUS = 0.08
BOW = 0.11
FASCIA_DEPTH = 0.36
CROWN_EXPONENT = 2.9
UNDERBODY_HALF_WIDTH = 0.45

# Along the length (y, value): the plan, the sill, the top on the centre line, the fall to the shoulder.
HALF_WIDTHS = [
    (-2.16, 0.82),
    (-1.9, 0.855),
    (-1.3, 0.872),
    (-0.5, 0.878),
    (0.6, 0.878),
    (1.4, 0.87),
    (2.16, 0.81),
]
SILLS = [(-2.16, 0.22), (-1.75, 0.21), (0.0, 0.19), (1.75, 0.21), (2.16, 0.19)]
TOPS = [
    (-2.16, 0.76),
    (-1.8, 0.835),
    (-1.2, 0.89),
    (-0.7, 0.92),
    (0.6, 0.93),
    (1.4, 0.945),
    (1.9, 0.935),
    (2.16, 0.90),
]
CROWNS = [(-2.16, 0.07), (-1.3, 0.09), (-0.6, 0.09), (1.0, 0.09), (2.16, 0.10)]
# Across the side (share of the height between sill and shoulder, share of the half-width).
SIDE_PROFILE = [(0, 0.925), (0.12, 0.955), (0.3, 0.985), (0.55, 1), (0.7, 0.998), (0.74, 0.985), (1, 0.955)]
# Up the ends (z, metres behind the foremost point).
NOSE_PROFILE = [(0.25, 0.06), (0.36, 0.01), (0.46, 0.0), (0.6, 0.005), (0.76, 0.05)]
TAIL_PROFILE = [(0.25, 0.09), (0.40, 0.02), (0.52, 0.0), (0.70, 0.01), (0.90, 0.06)]

# The cabin from the belt (0) to the rim of the roof (1).
BELT, RIM, ROOF_RISE = 0.86, 1.375, 0.07
SCREEN_FEET, SCREEN_HEADS = (-0.90, 1.44), (-0.20, 0.93)
SCREEN_BOW = 0.13
CABIN_HALF_WIDTHS = (0.80, 0.60)
CABIN_CORNER = 0.09
PILLAR = (0.20, 0.28)
ROWS = [(0, "Trim"), (0.10, "Trim"), (0.13, "Glass"), (0.9, "Trim"), (0.93, "Roof"), (1, "Roof")]


def _shoulder(y: Array) -> Array:
    return smooth_table(TOPS, y) - smooth_table(CROWNS, y)


def side_x(y: Array, z: Array) -> Array:
    """Half-width of the body at (y, z), with the creases of its side and the flares round its wheels."""
    sill = smooth_table(SILLS, y)
    share = (z - sill) / (_shoulder(y) - sill)
    width = smooth_table(HALF_WIDTHS, y) * smooth_table(SIDE_PROFILE, share)
    for hub in HUBS:
        distance = np.maximum(np.hypot(y - hub, z - HUB_HEIGHT) - ARCH_RADIUS, 0)
        width = width + FLARE * np.exp(-((distance / 0.06) ** 2))
    return np.asarray(width)


def _lower_edge(y: Array) -> Array:
    edge = smooth_table(SILLS, y)
    for hub in HUBS:
        arch = HUB_HEIGHT + np.sqrt(np.maximum(ARCH_RADIUS**2 - (y - hub) ** 2, 0))
        edge = np.where(np.abs(y - hub) <= ARCH_RADIUS, np.maximum(edge, arch), edge)
    return np.asarray(edge)


def nose_y(x: Array, z: Array) -> Array:
    """The front fascia."""
    return NOSE + BOW * (x / 0.82) ** 2 + smooth_table(NOSE_PROFILE, z)


def tail_y(x: Array, z: Array) -> Array:
    """The rear fascia."""
    return TAIL - BOW * (x / 0.81) ** 2 - smooth_table(TAIL_PROFILE, z)


def _pull(y: Array, x: Array, z: Array) -> Array:
    """Stations near the ends take the shape of the fascias."""

    def weight(distance: Array) -> Array:
        s = np.clip((FASCIA_DEPTH - distance) / (FASCIA_DEPTH - EDGE_RADIUS), 0, 1)
        return np.asarray(s * s * (3 - 2 * s))

    front = weight(y - NOSE) * (nose_y(x, z) - NOSE)
    return np.asarray(y + front + weight(TAIL - y) * (tail_y(x, z) - TAIL))


def _stations() -> Array:
    turn = np.radians(np.linspace(0, 90, 6))
    rounding = EDGE_RADIUS * (1 - np.cos(turn))
    arch = np.radians(np.linspace(0, 180, 27))
    arches = [
        hub + np.concatenate([ARCH_RADIUS * np.cos(arch), [-ARCH_RADIUS - 2e-3, ARCH_RADIUS + 2e-3]])
        for hub in HUBS
    ]
    return np.unique(
        np.concatenate([NOSE + rounding, TAIL - rounding, *arches, np.linspace(-2.05, 2.05, 44)])
    )


def _sections(y: Array) -> Array:
    """Half sections (stations, points, xz) from the underbody round the side to the middle of the top."""
    depth = np.minimum(y - NOSE, TAIL - y)
    inset = EDGE_RADIUS - np.sqrt(np.maximum(EDGE_RADIUS**2 - np.maximum(EDGE_RADIUS - depth, 0) ** 2, 0))
    low, shoulder, top = _lower_edge(y) + 0.3 * inset, _shoulder(y) - inset, smooth_table(TOPS, y) - inset
    low = np.minimum(low, shoulder - 0.02)
    share = np.linspace(0, 1, 14)
    side_z = low[:, None] + share * (shoulder - low)[:, None]
    side = np.stack([side_x(y[:, None], side_z) - inset[:, None], side_z], axis=-1)
    corner = np.radians(np.linspace(0, 90, 12)[1:])
    curve = np.stack(
        [np.cos(corner) ** (2 / CROWN_EXPONENT), np.sin(corner) ** (2 / CROWN_EXPONENT)], axis=-1
    )
    curve[-1, 0] = 0.0
    crown = np.stack(
        [side[:, -1:, 0] * curve[:, 0], shoulder[:, None] + (top - shoulder)[:, None] * curve[:, 1]], axis=-1
    )
    floor = np.stack([np.full((len(y), 1), UNDERBODY_HALF_WIDTH), low[:, None]], axis=-1)
    lip = side[:, :1] - np.array([0.025, 0.0])
    return np.concatenate([floor, lip, side, crown], axis=1)


def build_body() -> MeshBuilder:
    """Bonnet, sides, boot and fascias in "Paint", wheel wells and floor in "Underbody"."""
    y = _stations()
    half = _sections(y)
    mirrored = half[:, -2::-1] * np.array([-1.0, 1.0])
    ring = np.concatenate([half, mirrored], axis=1)
    x, z = ring[..., 0], ring[..., 1]
    points = np.stack([x, _pull(y[:, None], x, z), z], axis=-1)
    across = np.full(ring.shape[1] - 1, "Paint", dtype=object)
    across[[0, 1, -2, -1]] = "Underbody"
    builder = MeshBuilder()
    builder.grid(points, list(np.tile(across, len(y) - 1)))
    for end, fascia in ((0, nose_y), (-1, tail_y)):
        contour = half[end, 2:]
        reach = np.linspace(-1, 1, 25)
        cap_x = contour[:, :1] * reach
        cap_z = np.broadcast_to(contour[:, 1:], cap_x.shape)
        builder.grid(np.stack([cap_x, fascia(cap_x, cap_z), cap_z], axis=-1), "Paint")
    inner = UNDERBODY_HALF_WIDTH + 0.01
    builder.box((-inner, -1.85, 0.26), (inner, 1.85, 0.72), "Underbody")
    builder.box((-0.42, -1.8, 0.10), (0.42, 1.8, 0.3), "Underbody")
    return builder


def _cabin_columns(level: float) -> tuple[Array, list[str]]:
    """Half outline (n, 2) in plan at a level, front to rear, and the kind of each step to the next point."""
    bulge = np.sin(np.pi * level)
    width = CABIN_HALF_WIDTHS[0] + (CABIN_HALF_WIDTHS[1] - CABIN_HALF_WIDTHS[0]) * level + 0.022 * bulge
    front = SCREEN_FEET[0] + (SCREEN_HEADS[0] - SCREEN_FEET[0]) * level - 0.025 * bulge
    rear = SCREEN_FEET[1] + (SCREEN_HEADS[1] - SCREEN_FEET[1]) * level + 0.025 * bulge
    r, arc = CABIN_CORNER, np.radians(np.linspace(0, 90, 6))
    share = np.append(np.linspace(0, 0.955, 12), 1.0)
    screen_x = share * (width - r)
    side_start, side_end = front + SCREEN_BOW + r, rear - SCREEN_BOW - r
    first, second = side_start + 0.02, side_end - 0.05
    side_y = np.concatenate([np.linspace(first, PILLAR[0], 10), np.linspace(PILLAR[1], second, 10)])
    parts = [
        (np.stack([screen_x, front + SCREEN_BOW * share**2], axis=-1), ["Glass"] * 11 + ["Trim"]),
        (
            np.stack([width - r + r * np.sin(arc), side_start - r * np.cos(arc)], axis=-1)[1:],
            ["Paint"] * 5,
        ),
        (
            np.stack([np.full(20, width), side_y], axis=-1),
            ["Trim"] + ["Glass"] * 9 + ["Trim"] + ["Glass"] * 9,
        ),
        (
            np.stack([width - r + r * np.cos(arc), side_end + r * np.sin(arc)], axis=-1),
            ["Trim"] + ["Paint"] * 5,
        ),
        (
            np.stack([screen_x, rear - SCREEN_BOW * share**2], axis=-1)[-2::-1],
            ["Trim"] + ["Glass"] * 11,
        ),
    ]
    return np.concatenate([points for points, _ in parts]), [kind for _, kinds in parts for kind in kinds]


def build_cabin() -> MeshBuilder:
    """Pillars, windows and roof in "Paint", "Trim", "Glass" and "Roof"."""
    levels, bands = [], []
    for (start, kind), (end, _) in pairwise(ROWS):
        steps = 7 if kind == "Glass" else 1
        levels += list(np.linspace(start, end, steps, endpoint=False))
        bands += [kind] * steps
    levels.append(1.0)
    kinds = _cabin_columns(0.0)[1]
    rows, names = [], []
    for level in levels:
        outline = _cabin_columns(level)[0]
        rows.append(np.column_stack([outline, np.full(len(outline), BELT + (RIM - BELT) * level)]))
    for band in bands:
        names += [
            column if band == "Glass" else "Paint" if column == "Paint" and band == "Trim" else band
            for column in kinds
        ]
    rim = rows[-1]
    middle = np.array([0.0, (SCREEN_HEADS[0] + SCREEN_HEADS[1]) / 2])
    for factor in (0.985, 0.95, 0.88, 0.75, 0.55, 0.3, 0.0):
        plan = middle + factor * (rim[:, :2] - middle)
        rows.append(np.column_stack([plan, np.full(len(rim), RIM + ROOF_RISE * (1 - factor**4))]))
        names += ["Roof"] * len(kinds)
    half = np.stack(rows)
    builder = MeshBuilder()
    for side in (1.0, -1.0):
        builder.grid(half * np.array([side, 1.0, 1.0]), names)
    return builder


def side_surface(side: float) -> Surface:
    """(y, z, height) -> points of the body's side, +1 the car's left, -1 its right."""

    def surface(y: Array, z: Array, height: Array) -> Array:
        return np.stack([side * (side_x(y, z) + height), y + 0 * z, z + 0 * y], axis=-1)

    return surface


def top_surface(x: Array, y: Array, height: Array) -> Array:
    """(x, y, height) -> points of the bonnet and the boot lid, away from the fascias."""
    shoulder = _shoulder(y)
    share = np.minimum(np.abs(x) / side_x(y, shoulder), 1)
    z = shoulder + (smooth_table(TOPS, y) - shoulder) * (1 - share**CROWN_EXPONENT) ** (1 / CROWN_EXPONENT)
    return np.stack([x + 0 * y, _pull(y, x, z), z + height], axis=-1)


def front_surface(x: Array, z: Array, height: Array) -> Array:
    """(x, z, height) -> points of the front fascia."""
    return np.stack([x + 0 * z, nose_y(x, z) - height, z + 0 * x], axis=-1)


def rear_surface(x: Array, z: Array, height: Array) -> Array:
    """(x, z, height) -> points of the rear fascia."""
    return np.stack([x + 0 * z, tail_y(x, z) + height, z + 0 * x], axis=-1)
