# SPDX-License-Identifier: GPL-3.0-or-later
"""The light of the world: a colour if it is uniform and faint, else a graph by direction."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import replace

import numpy as np

from ...projection.typing import Array
from ...projection.user_error import Message
from ...projection.volume.viewing_volume import Projection
from ...shading.missing_light import missing_light
from ...shading.nodes.graph import MaterialGraph
from ...shading.scene.shading_scene import Scene
from ...shading.scene.world import UP, World
from ..blender import versions
from ..blender.shader_nodes import output_shaders
from .light_paths import ends_early
from .read_graph import read_graph

DARK = Message(
    "Nothing lights the scene, as glowing materials light no other objects here: add a light or a world, or "
    "use Cycles through the rig of the Cycles panel"
)

EVEN = Message(
    "The world is one color, whose light has no shadows here: switch on World Shadows in the panel Sampling "
    "of Render Properties, or use Cycles through the rig of the Cycles panel"
)
GLOW = Message(
    "Glowing materials light no other objects here, and much of this picture's light would be theirs: add "
    "lights in their places, or use Cycles through the rig of the Cycles panel"
)

INDOORS = Message(
    "Light does not bounce here, so that rooms and other enclosed places come out too dark: add lights, or "
    "use Cycles through the rig of the Cycles panel"
)
# The shares from which the light that an image lacks is named: of glowing things in all light, and of the
# directions in which places meet other things. Streets and courtyards have up to two thirds of the latter.
MUCH_GLOW, ENCLOSED = 0.1, 0.8

# The world of a new file. Beside lamps, the shadows of such a faint one hardly show.
FAINT = 0.051


def read_world(scene, view_layer) -> tuple[Array, World | None, tuple[str, ...]]:
    """The radiance (3,) of the scene's uniform world, or the world if it is not uniform, and warnings.

    scene, view_layer: evaluated. Black without a world, and if the layer leaves it out.
    """
    world = view_layer.world_override or scene.world
    if world is None or not view_layer.use_sky:
        return np.zeros(3), None, ()
    unshown = _unshown(world, scene)
    if not versions.uses_nodes(world):
        return np.array(world.color, np.float64), None, unshown
    reading = read_graph(world.node_tree)
    warnings = tuple(_warning(note, world) for note in reading.notes) + unshown
    if reading.graph is None:
        return np.zeros(3), None, warnings
    radiance = uniform_radiance(reading.graph)
    if radiance is None:
        return np.zeros(3), World(reading.graph), warnings
    return radiance, None, warnings


def uniform_radiance(graph: MaterialGraph, rays: Array | None = None) -> Array | None:
    """The radiance (3,) of a graph's light, None if it depends on the direction.

    rays: the only ones that meet it, see ``shading.nodes.light_path``; for None it is the same for all rays.
    """
    light = World(graph)
    if rays is None:
        return light.radiance(UP)[:, 0] if light.uniform else None
    return light.radiance(UP, rays)[:, 0] if light.lights_evenly else None


def with_shadows(scene: Scene, wanted: bool) -> Scene:
    """The scene whose uniform world casts shadows, or else is named, unless these would hardly show."""
    faint = FAINT if scene.lights else 0.0
    if scene.world is not None or np.max(scene.world_color) <= faint or not shows_world(scene):
        return scene
    if not wanted:
        return replace(scene, warnings=(*scene.warnings, EVEN))
    return replace(scene, world=World.of_color(scene.world_color), world_color=np.zeros(3))


def world_seen(scene, view_layer) -> bool:
    """Return whether projectors see the world of an evaluated view layer, by its Ray Visibility."""
    rays = getattr(view_layer.world_override or scene.world, "cycles_visibility", None)
    return rays is None or rays.camera


def _unshown(world, scene) -> tuple[str, ...]:
    """Warnings about an evaluated world's settings besides its surface."""
    notes = []
    cycles = getattr(world, "cycles", None)
    if cycles is not None and not getattr(cycles, "use_shadows", True):
        notes.append("Cast Shadow, which is off")
    if cycles is not None and cycles.is_caustics_light:
        notes.append("Shadow Caustics")
    if ends_early(world, scene):
        notes.append("Max Bounces")
    rays = getattr(world, "cycles_visibility", None)
    if rays is not None and not (rays.diffuse and rays.glossy and rays.transmission):
        notes.append("Ray Visibility but for Camera, all other rays see the world")
    if versions.uses_nodes(world) and any(output_shaders(world.node_tree, "Volume")):
        notes.append("Volume")
    return tuple(_warning(note, world) for note in notes)


def _warning(note: str, world) -> str:
    return Message("Not shown as it is: {0} (in the world '{1}')", Message(note), world.name)


def light_warnings(scene: Scene) -> tuple[str, ...]:
    """A warning about a scene that only glowing surfaces light: they light no others here."""
    lit = scene.world is not None or scene.lights or np.any(scene.world_color)
    return () if lit or not shows_world(scene) or not _glows(scene) else (DARK,)


def missing_light_warnings(scene: Scene, projection: Projection, evaluated) -> tuple[str, ...]:
    """Warnings about light that the image of a scene lacks beside Cycles'.

    projection: in world space. evaluated: the scene's datablock, whose bounces count.
    """
    if DARK in scene.warnings or not shows_world(scene):
        return ()
    lacks = missing_light(scene, projection)
    cycles = getattr(evaluated, "cycles", None)
    bounces = cycles is None or min(cycles.max_bounces, cycles.diffuse_bounces) > 0
    named = {GLOW: lacks.glow > MUCH_GLOW, INDOORS: bounces and lacks.is_lit and lacks.enclosed > ENCLOSED}
    return tuple(text for text, is_named in named.items() if is_named)


def _glows(scene: Scene) -> bool:
    """Return whether any surface may emit light."""
    for number, graph in _used_materials(scene):
        if graph is None:
            if np.any(scene.materials.emission[number] > 0.0):
                return True
            continue
        for closure in graph.closures:
            light = closure.inputs.get({"EMISSION": "color", "PRINCIPLED": "emission"}.get(closure.kind, ""))
            if light is not None and not graph.is_always_black(light):
                return True
    return False


def shows_world(scene: Scene) -> bool:
    """Return whether any surface is lit or reflects, so that the world counts even where it is hidden."""
    for number, graph in _used_materials(scene):
        if graph is None:
            if scene.materials.base_color[number].any():
                return True
        elif any(closure.kind not in {"EMISSION", "TRANSPARENT"} for closure in graph.closures):
            return True
    return False


def _used_materials(scene: Scene) -> Iterator[tuple[int, MaterialGraph | None]]:
    """The numbers and graphs of the materials that triangles have."""
    for number in np.unique(scene.geometry.material).tolist():
        yield number, scene.materials.graphs.get(number)
