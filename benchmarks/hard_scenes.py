# SPDX-License-Identifier: GPL-3.0-or-later
"""Meshes that are hard to cast at, and curves that are aimed where casting goes wrong."""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import NDArray

from benchmarks.scenes import Mesh, boxes, joined, sheet
from scfpf_addon.projection.typing import Array
from scfpf_addon.projection.volume.bezier import bernstein


def welded(mesh: Mesh) -> Mesh:
    """The mesh with vertices at one place made one, and without triangles that have two there."""
    vertices, triangles = mesh
    places, number = np.unique(np.round(vertices, 12), axis=0, return_inverse=True)
    faces = number.reshape(-1)[triangles]
    a, b, c = faces.T
    return places, faces[(a != b) & (b != c) & (c != a)].astype(np.int32)


def loose(mesh: Mesh) -> Mesh:
    """The mesh with three vertices of its own for every triangle."""
    vertices, triangles = mesh
    return vertices[triangles].reshape(-1, 3), np.arange(triangles.size, dtype=np.int32).reshape(-1, 3)


def sphere(rings: int) -> Mesh:
    """A closed unit sphere of about 4 rings² triangles, its poles vertices."""
    around, down = np.meshgrid(np.linspace(0, 2 * np.pi, 2 * rings + 1), np.linspace(0, np.pi, rings + 1))
    x, y = np.cos(around) * np.sin(down), np.sin(around) * np.sin(down)
    return welded(sheet(np.stack([x, y, np.cos(down)], axis=-1)))


def cube(cells: int) -> Mesh:
    """A closed cube from -1 to 1 of 12 cells² triangles on a grid."""
    x, y = np.meshgrid(*[np.linspace(-1.0, 1.0, cells + 1)] * 2)
    sides = []
    for axis in range(3):
        for end in (-1.0, 1.0):
            sides.append(sheet(np.roll(np.stack([np.full_like(x, end), x, y], axis=-1), axis, axis=-1)))
    return welded(joined(sides))


def stacked_sheets(cells: int, gap: float) -> Mesh:
    """Two unconnected wavy sheets, the lower one ``gap`` below the upper."""
    x, z = np.meshgrid(np.linspace(-8, 14, cells + 1), np.linspace(-24, -1, cells + 1))
    y = -2 + 0.5 * np.sin(x) * np.cos(z)
    return joined([sheet(np.stack([x, y - gap * k, z], axis=-1)) for k in range(2)])


def doubled(count: int) -> Mesh:
    """Boxes whose every triangle is there three times, twice turned or reversed."""
    vertices, triangles = boxes(count)
    return vertices, np.concatenate([triangles, triangles[::-1, [1, 2, 0]], triangles[:, ::-1]])


def soup(count: int) -> Mesh:
    """Large triangles that cross each other in all directions."""
    generator = np.random.default_rng(1)
    corners = generator.normal(size=(count, 3, 3)) * 2 + generator.uniform(-6, 6, (count, 1, 3))
    return loose((corners.reshape(-1, 3) + np.array([4, 0, -10]), np.arange(3 * count).reshape(-1, 3)))


def slivers(count: int) -> Mesh:
    """Needles a hundredth to a thousand-millionth as wide as they are long, and boxes behind."""
    generator = np.random.default_rng(2)
    start = generator.uniform(-6, 6, (count, 3)) + np.array([4, 0, -8])
    along = 3 * generator.normal(size=(count, 3))
    width = generator.normal(size=(count, 3)) * 10 ** generator.uniform(-9, -1, (count, 1))
    third = start + along * generator.uniform(0, 1, (count, 1)) + width
    corners = np.stack([start, start + along, third], axis=1)
    needles = corners.reshape(-1, 3), np.arange(3 * count, dtype=np.int32).reshape(-1, 3)
    return joined([needles, boxes(count)])


def dust(count: int) -> Mesh:
    """Boxes, and among them slivers a thousandth of their size."""
    vertices, triangles = slivers(count)
    return joined([boxes(count), (0.001 * vertices + [2.0, 0.0, -8.0], triangles)])


def open_fan(count: int) -> Mesh:
    """Non-manifold: ``count`` leaves that share one edge, and doors in a row whose edges only touch."""
    angle = np.linspace(0.0, 2 * np.pi, count, endpoint=False)
    foot, head = np.array([4.0, -3.0, -10.0]), np.array([4.0, 4.0, -10.0])
    tips = foot + np.stack([6 * np.cos(angle), 3 + 0 * angle, 6 * np.sin(angle)], axis=1)
    leaves = np.stack([0 * angle, 0 * angle + 1, np.arange(count) + 2], axis=1).astype(np.int32)
    return joined([(np.concatenate([[foot, head], tips]), leaves), loose(cube(6))])


def fins(cells: int) -> Mesh:
    """Non-manifold: a wavy sheet with fins a tenth of a triangle high on a side of every third."""
    vertices, triangles = stacked_sheets(cells, 0.0)
    vertices, triangles = vertices[: len(vertices) // 2], triangles[: len(triangles) // 2]
    feet = triangles[::3, :2]
    tips = vertices[feet].mean(axis=1) + np.array([0.0, 2.2 / cells, 0.0])
    number = np.arange(len(feet), dtype=np.int32) + len(vertices)
    return np.concatenate([vertices, tips]), np.concatenate([triangles, np.column_stack([feet, number])])


def flakes(cells: int) -> Mesh:
    """A wavy sheet with a loose flake over every triangle, a millionth to a hundredth above it."""
    generator = np.random.default_rng(4)
    vertices, triangles = stacked_sheets(cells, 0.0)
    ground = vertices[: len(vertices) // 2], triangles[: len(triangles) // 2]
    corners = ground[0][ground[1]]
    normal = np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0])
    normal /= np.linalg.norm(normal, axis=1, keepdims=True)
    middle = corners.mean(axis=1, keepdims=True)
    size, height = (
        generator.uniform(0.2, 0.8, (len(corners), 1, 1)),
        10 ** generator.uniform(-6, -2, len(corners)),
    )
    small = middle + (corners - middle) * size + (normal * height[:, None])[:, None]
    return joined([ground, (small.reshape(-1, 3), np.arange(small.size // 3, dtype=np.int32).reshape(-1, 3))])


HARD_SCENES: dict[str, Any] = {
    "unwelded": lambda: loose(boxes(1000)),
    "doubled": lambda: doubled(600),
    "soup": lambda: soup(700),
    "slivers": lambda: slivers(500),
    "dust": lambda: dust(500),
    "fan": lambda: open_fan(40),
    "fins": lambda: fins(16),
    "flakes": lambda: flakes(24),
} | {
    f"sheets {gap:g}": (lambda gap=gap: stacked_sheets(16, gap))
    for gap in (0.0, 1e-7, 1e-6, 1e-5, 1e-4, 1e-3, 1e-2)
}

AIMS = ("vertex", "edge", "middle", "axis")


def aimed_curves(
    vertices: Array, triangles: NDArray[np.int32], degree: int, count: int, aim: str, seed: int = 0
) -> tuple[Array, Array]:
    """Curves that pass through a mesh's vertices or edges, as exactly as float64 can.

    vertices: (3, V), a closed mesh within the unit cube; the curves begin and end outside. aim: one of
    AIMS; middle: of an edge; axis: along a coordinate axis through a vertex.
    Returns control points (degree+1, 3, N) and the t (N,) of the passage.
    """
    generator = np.random.default_rng(seed)
    corners = vertices[:, triangles[generator.integers(0, len(triangles), count)].T]
    share = generator.random(count) if aim == "edge" else np.full(count, 0.5 if aim == "middle" else 0.0)
    target = corners[:, 0] * (1 - share) + corners[:, 1] * share
    start = generator.normal(size=(3, count))
    start *= 3 / np.linalg.norm(start, axis=0)
    inner = 1.5 * generator.normal(size=(degree - 1, 3, count))
    controls = np.concatenate([start[None], inner, -start[None] + 0.3 * generator.normal(size=(1, 3, count))])
    if aim == "axis":
        way = np.eye(3)[:, generator.integers(0, 3, count)]
        steps = 3 - 6 * np.arange(degree + 1) / degree
        return target + steps[:, None, None] * way, np.full(count, 0.5)
    t = generator.uniform(0.2, 0.8, count)
    weights = bernstein(degree, t)
    moved = degree // 2
    others = np.einsum("kn,kcn->cn", weights, controls) - weights[moved] * controls[moved]
    controls[moved] = (target - others) / weights[moved]
    return controls, t
