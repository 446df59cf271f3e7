# SPDX-License-Identifier: GPL-3.0-or-later
"""The world → a colour, or a graph of the light by direction where that differs."""

from __future__ import annotations

import numpy as np

from ..projection.typing import Array
from ..shading.scene import Scene
from ..shading.world import World
from . import versions
from .read_graph import read_graph


def read_world(scene) -> tuple[Array, World | None, tuple[str, ...]]:
    """Radiance (3,) of an evaluated scene's world, what is in its place where it is not the same all around,
    and warnings. Black without a world.
    """
    world = scene.world
    if world is None:
        return np.zeros(3), None, ()
    if not versions.uses_nodes(world):
        return np.array(world.color, np.float64), None, ()
    reading = read_graph(world.node_tree)
    warnings = tuple(f"Not shown as it is: {note} (in the world '{world.name}')" for note in reading.notes)
    if reading.graph is None:
        return np.zeros(3), None, warnings
    made = World(reading.graph)
    if made.uniform:
        return made.radiance(np.array([[0.0], [0.0], [1.0]]))[:, 0], None, warnings
    return np.zeros(3), made, warnings


def shows_world(scene: Scene) -> bool:
    """Whether any surface is lit or mirrors, so that the world counts where it is not seen itself."""
    materials, triangles = scene.materials, scene.geometry.material
    for number in np.unique(triangles).tolist():
        graph = materials.graphs.get(number)
        if graph is None:
            if materials.base_color[number].any():
                return True
        elif any(closure.kind not in {"EMISSION", "TRANSPARENT"} for closure in graph.closures):
            return True
    return False
