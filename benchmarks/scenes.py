# SPDX-License-Identifier: GPL-3.0-or-later
"""Scenes and viewing volumes to measure with: seeded, pure NumPy, any number of triangles.

Everything is in camera space: the viewer near the origin looks along -Z, Y is up.
A scene is (vertices (V, 3) float64, triangles (T, 3) int32); it covers
GROUND in x and z and lies between LOW and HIGH in y.
"""

from __future__ import annotations

from collections.abc import Callable

import numpy as np
from numpy.typing import NDArray

from scfpf_addon.projection.surfaces.surface import ControlSurface, Plane
from scfpf_addon.projection.volume.viewing_volume import Projection, ViewingVolume

Mesh = tuple[NDArray[np.float64], NDArray[np.int32]]

GROUND = ((-10.0, 22.0), (-26.0, 2.0))
LOW, HIGH = -3.0, 4.0


def sheet(points: NDArray[np.float64]) -> Mesh:
    """The triangles of a regular grid of points (rows, columns, 3)."""
    rows, columns = points.shape[:2]
    number = np.arange(rows * columns, dtype=np.int32).reshape(rows, columns)
    a, b = number[:-1, :-1].ravel(), number[:-1, 1:].ravel()
    c, d = number[1:, 1:].ravel(), number[1:, :-1].ravel()
    triangles = np.stack([a, b, c, a, c, d], axis=1).reshape(-1, 3)
    return points.reshape(-1, 3), triangles


def joined(meshes: list[Mesh]) -> Mesh:
    """Several meshes as one."""
    offsets = np.cumsum([0] + [len(vertices) for vertices, _ in meshes[:-1]])
    return (
        np.concatenate([vertices for vertices, _ in meshes]),
        np.concatenate([t + o for (_, t), o in zip(meshes, offsets, strict=True)]).astype(np.int32),
    )


def repeated(mesh: Mesh, matrices: NDArray[np.float64]) -> Mesh:
    """A mesh once for each of the affine matrices (M, 3, 4)."""
    vertices, triangles = mesh
    moved = np.einsum("mij,vj->mvi", matrices[:, :, :3], vertices) + matrices[:, None, :, 3]
    offsets = np.arange(len(matrices), dtype=np.int32) * len(vertices)
    return moved.reshape(-1, 3), (triangles[None] + offsets[:, None, None]).reshape(-1, 3)


def floor(cells: int, waves: float = 0.0) -> Mesh:
    """A ground of cells × cells squares, with hills of height ``waves``."""
    x, z = np.meshgrid(np.linspace(*GROUND[0], cells + 1), np.linspace(*GROUND[1], cells + 1))
    hills = np.sin(0.9 * x) * np.cos(0.7 * z) + 0.35 * np.sin(2.3 * x + 1.0) * np.sin(1.9 * z)
    y = LOW + waves * (1.35 + hills + 0.1 * np.sin(9.0 * x) * np.cos(8.0 * z))
    return sheet(np.stack([x, y, z], axis=-1))


def terrain(count: int) -> Mesh:
    """Hills: one connected sheet, few silhouettes."""
    return floor(max(1, round((count / 2) ** 0.5)), 0.9)


def columns(count: int) -> Mesh:
    """A hall of round columns on a floor: long, smooth, connected silhouettes."""
    per_column = max(12, round((count / 60) ** 0.5) * 2)
    angle = np.linspace(0.0, 2 * np.pi, per_column + 1)
    height = np.linspace(LOW, HIGH, max(2, count // 60 // (2 * per_column)) + 1)
    a, y = np.meshgrid(angle, height)
    radius = 0.45 + 0.12 * np.cos(3.0 * y)
    column = sheet(np.stack([radius * np.cos(a), y, radius * np.sin(a)], axis=-1))
    x, z = np.meshgrid(np.linspace(-8.0, 20.0, 10), np.linspace(-24.0, -1.5, 6))
    matrices = np.zeros((x.size, 3, 4))
    matrices[:, :, :3] = np.eye(3)
    matrices[:, 0, 3], matrices[:, 2, 3] = x.ravel(), z.ravel()
    return joined([floor(8), repeated(column, matrices)])


def boxes(count: int) -> Mesh:
    """A cloud of turned boxes: silhouettes everywhere, every edge a fold."""
    corners = np.array([[x, y, z] for x in (-1, 1) for y in (-1, 1) for z in (-1, 1)], float)
    quads = np.array([[0, 1, 3, 2], [4, 6, 7, 5], [0, 4, 5, 1], [2, 3, 7, 6], [0, 2, 6, 4], [1, 5, 7, 3]])
    triangles = np.concatenate([quads[:, [0, 1, 2]], quads[:, [0, 2, 3]]]).astype(np.int32)
    number = max(1, count // 12)
    generator = np.random.default_rng(2)
    turned = np.linalg.qr(generator.normal(size=(number, 3, 3)))[0]
    size = 1.6 * number ** (-1 / 3) * generator.uniform(0.4, 1.0, (number, 1, 3))
    matrices = np.concatenate([turned * size, np.zeros((number, 3, 1))], axis=2)
    for axis, (low, high) in enumerate((GROUND[0], (LOW, HIGH), GROUND[1])):
        matrices[:, axis, 3] = generator.uniform(low, high, number)
    return joined([floor(8), repeated((corners, triangles), matrices)])


SCENES: dict[str, Callable[[int], Mesh]] = {"terrain": terrain, "columns": columns, "boxes": boxes}


def frame_at(position: NDArray[np.float64], turn: float, width: float, height: float) -> ControlSurface:
    """A rectangle whose viewing direction is -Z turned to the right by ``turn`` radians."""
    cos, sin = np.cos(turn), np.sin(turn)
    matrix = np.eye(4)
    matrix[:3, :3] = [[cos, 0, -sin], [0, 1, 0], [sin, 0, cos]]
    matrix[:3, 3] = position
    return Plane(width=width, height=height, matrix=matrix)


def bent_projection(degree: int, angle: float, aspect: float = 16 / 9, length: float = 22.0) -> Projection:
    """A volume whose middle projector turns to the right by ``angle`` radians.

    degree 1 is an ordinary straight view (its angle must be 0). The legs of the
    middle projector's control polygon are equally long and turn in equal steps; it
    descends a little. The view is 20 times as wide at the far end as at the near
    one, 10 times where it turns back, or it would fold on the inside of the bend.
    """
    legs = max(degree - 1, 1)
    turns = np.linspace(0.0, angle, degree + 1)
    far = 12.0 if angle < np.pi / 2 else 6.0
    position = np.array([0.0, 1.5, 0.0])
    surfaces = []
    for index, turn in enumerate(turns):
        height = 0.6 + (far - 0.6) * index / degree
        surfaces.append(frame_at(position, turn, height * aspect, height))
        heading = angle * index / legs
        position = position + length / degree * np.array([np.sin(heading), -0.15, -np.cos(heading)])
    return Projection(ViewingVolume(tuple(surfaces)), aspect=aspect)
