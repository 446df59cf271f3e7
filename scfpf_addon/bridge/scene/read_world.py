# SPDX-License-Identifier: GPL-3.0-or-later
"""The world → a colour, or a graph of the light by direction where that differs."""

from __future__ import annotations

import numpy as np

from ...projection.typing import Array
from ...shading.scene.shading_scene import Scene
from ...shading.scene.world import World
from ..blender import versions
from ..blender.shader_nodes import output_shaders
from .read_graph import read_graph

DARK = (
    "Nothing lights the scene, as glowing materials light no other objects here: add a light or a world, "
    "or use Cycles through the rig of the Cycles panel"
)


def read_world(scene, view_layer) -> tuple[Array, World | None, tuple[str, ...]]:
    """Radiance (3,) of the world that an evaluated view layer of a scene shows, what is in its place where it
    is not the same all around, and warnings. Black without a world, or where the layer leaves it out.
    """
    world = view_layer.world_override or scene.world
    if world is None or not view_layer.use_sky:
        return np.zeros(3), None, ()
    unshown = _unshown(world)
    if not versions.uses_nodes(world):
        return np.array(world.color, np.float64), None, unshown
    reading = read_graph(world.node_tree)
    warnings = tuple(_warning(note, world) for note in reading.notes) + unshown
    if reading.graph is None:
        return np.zeros(3), None, warnings
    made = World(reading.graph)
    if made.uniform:
        return made.radiance(np.array([[0.0], [0.0], [1.0]]))[:, 0], None, warnings
    return np.zeros(3), made, warnings


def world_seen(scene, view_layer) -> bool:
    """Whether projectors see the world of an evaluated view layer: its Ray Visibility to the camera."""
    rays = getattr(view_layer.world_override or scene.world, "cycles_visibility", None)
    return rays is None or rays.camera


def _unshown(world) -> tuple[str, ...]:
    """Warnings of what an evaluated world has besides the light of its surface."""
    notes = []
    rays = getattr(world, "cycles_visibility", None)
    if rays is not None and not (rays.diffuse and rays.glossy and rays.transmission):
        notes.append("Ray Visibility but for Camera, all other rays see the world")
    if versions.uses_nodes(world) and any(output_shaders(world.node_tree, "Volume")):
        notes.append("Volume")
    return tuple(_warning(note, world) for note in notes)


def _warning(note: str, world) -> str:
    return f"Not shown as it is: {note} (in the world '{world.name}')"


def darkness(scene: Scene) -> tuple[str, ...]:
    """A warning where only other surfaces could light what is shown, which the engine does not do."""
    lit = bool(scene.lights) or scene.world is not None or bool(np.any(scene.world_color))
    return () if lit or not _glows(scene) or not shows_world(scene) else (DARK,)


def _glows(scene: Scene) -> bool:
    """Whether any surface may emit light."""
    materials = scene.materials
    for number in np.unique(scene.geometry.material).tolist():
        graph = materials.graphs.get(number)
        if graph is None:
            if np.any(materials.emission[number] > 0.0):
                return True
            continue
        for closure in graph.closures:
            light = closure.inputs.get({"EMISSION": "color", "PRINCIPLED": "emission"}.get(closure.kind, ""))
            if light is not None and not graph.is_always_black(light):
                return True
    return False


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
