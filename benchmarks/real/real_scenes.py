# SPDX-License-Identifier: GPL-3.0-or-later
"""The scenes of ``beside_cycles.py``: the demo's street, a room of many materials, cards with alpha."""

from __future__ import annotations

import itertools
import math
from collections.abc import Callable, Mapping
from functools import partial
from pathlib import Path
from typing import NamedTuple

import bpy
import numpy as np

from demo.render_demo import SHOTS, place_camera, preset_files
from demo.street import build_scene
from scfpf_addon.bridge.camera.flexible_camera import apply_preset, volume_from_camera
from scfpf_addon.projection.presets.preset import read_preset

# The room: half its sides along x and y, and its height, in metres.
SEED, OBJECTS = 20, 400
HALF, HEIGHT = 8.0, 5.0
# The meadow: plants, and the cards of each.
PLANTS, CARDS = 600, 12


def material(name: str) -> bpy.types.Material:
    """A material with the usual nodes."""
    made = bpy.data.materials.new(name)
    if made.node_tree is None:
        made.use_nodes = True
    return made


def room_materials(count: int, generator: np.random.Generator) -> list:
    """Principled materials: a tenth glass, a fifth coated, a quarter metal, the rest plain."""
    kinds = np.array(["glass", "coated", "metal", "plain"])
    shares = np.cumsum([0.1, 0.2, 0.25])
    # Evenly spread numbers: few materials are of all kinds, too.
    chosen = kinds[np.searchsorted(shares, (np.arange(count) + 0.5) / count)]
    made = []
    for number, kind in enumerate(chosen):
        each = material(f"{kind} {number}")
        inputs = each.node_tree.nodes["Principled BSDF"].inputs
        inputs["Base Color"].default_value = (*generator.uniform(0.1, 0.9, 3), 1.0)
        inputs["Roughness"].default_value = generator.uniform(0.05, 0.9)
        if kind == "glass":
            inputs["Transmission Weight"].default_value = 1.0
            inputs["Roughness"].default_value = 0.0
        elif kind == "coated":
            inputs["Coat Weight"].default_value = generator.uniform(0.3, 1.0)
        elif kind == "metal":
            inputs["Metallic"].default_value = 1.0
        made.append(each)
    return made


def room_meshes() -> list:
    """The shapes that objects have: boxes, and round ones with smooth shading."""
    adders = (
        lambda: bpy.ops.mesh.primitive_cube_add(size=1.0),
        lambda: bpy.ops.mesh.primitive_uv_sphere_add(segments=32, ring_count=16, radius=0.6),
        lambda: bpy.ops.mesh.primitive_cylinder_add(vertices=48, radius=0.45, depth=1.1),
        lambda: bpy.ops.mesh.primitive_torus_add(major_segments=40, minor_segments=16, major_radius=0.5),
    )
    made = []
    for number, add in enumerate(adders):
        add()
        thing = bpy.context.object
        if number % 2:
            bpy.ops.object.shade_smooth()
        made.append(thing.data)
        bpy.data.objects.remove(thing)
    return made


def add_objects(materials: list, generator: np.random.Generator) -> None:
    """The things in the room, each with one of the materials in turn."""
    meshes = room_meshes()
    for number in range(OBJECTS):
        mesh = meshes[number % len(meshes)].copy()
        mesh.materials.append(materials[number % len(materials)])
        thing = bpy.data.objects.new(f"Thing {number}", mesh)
        thing.location = generator.uniform((-HALF + 1, -HALF + 1, 0.3), (HALF - 1, HALF - 1, 3.5))
        thing.rotation_euler = generator.uniform(-math.pi, math.pi, 3)
        thing.scale = (generator.uniform(0.4, 1.1),) * 3
        bpy.context.collection.objects.link(thing)


def add_walls() -> None:
    """A floor and three walls of grey; the fourth side and the ceiling are open to the sky."""
    vertices = [(x, y, z) for z in (0.0, HEIGHT) for x, y in ((-1, -1), (1, -1), (1, 1), (-1, 1))]
    vertices = [(x * HALF, y * HALF, z) for x, y, z in vertices]
    mesh = bpy.data.meshes.new("Walls")
    mesh.from_pydata(vertices, [], [(0, 1, 2, 3), (1, 2, 6, 5), (2, 3, 7, 6), (3, 0, 4, 7)])
    bpy.context.collection.objects.link(bpy.data.objects.new("Walls", mesh))


def place_lamp(lamp: bpy.types.Light, place: tuple[float, ...], turn: tuple[float, ...] = (0, 0, 0)) -> None:
    """Add a lamp to the scene."""
    placed = bpy.data.objects.new(lamp.name, lamp)
    placed.location, placed.rotation_euler = place, turn
    bpy.context.collection.objects.link(placed)


def add_lamps() -> None:
    """Four area lamps below the ceiling of the room."""
    for x, y in itertools.product((-4.0, 4.0), repeat=2):
        lamp = bpy.data.lights.new("Lamp", "AREA")
        lamp.energy, lamp.size = 150.0, 1.5
        place_lamp(lamp, (x, y, HEIGHT - 0.2))


def add_sky(turn: tuple[float, float, float]) -> None:
    """A sun, turned, and a sky."""
    sun = bpy.data.lights.new("Sun", "SUN")
    sun.energy, sun.angle = 2.0, 0.02
    place_lamp(sun, (0.0, 0.0, HEIGHT + 5.0), turn)
    world = bpy.context.scene.world = bpy.data.worlds.new("Sky")
    if world.node_tree is None:
        world.use_nodes = True
    tree = world.node_tree
    sky = tree.nodes.new("ShaderNodeTexSky")
    sky.sky_type = "PREETHAM"
    tree.nodes["Background"].inputs["Strength"].default_value = 0.3
    tree.links.new(sky.outputs["Color"], tree.nodes["Background"].inputs["Color"])


def leaf_material() -> bpy.types.Material:
    """A leaf: an image whose alpha cuts its outline out of a card."""
    size = 128
    y, x = np.mgrid[:size, :size] / (size - 1) * 2.0 - 1.0
    width = 0.55 * np.sqrt(np.maximum(1.0 - y**2, 0.0)) * (1.0 + 0.15 * np.sin(24.0 * y))
    pixels = np.empty((size, size, 4), np.float32)
    pixels[..., 0], pixels[..., 1], pixels[..., 2] = 0.15 + 0.05 * y, 0.35 + 0.1 * np.cos(9.0 * x), 0.06
    pixels[..., 3] = np.abs(x) < width
    image = bpy.data.images.new("Leaf", size, size, alpha=True)
    image.pixels.foreach_set(pixels.ravel())
    image.pack()
    made = material("Leaf")
    tree = made.node_tree
    texture = tree.nodes.new("ShaderNodeTexImage")
    texture.image = image
    shader = tree.nodes["Principled BSDF"]
    tree.links.new(texture.outputs["Color"], shader.inputs["Base Color"])
    tree.links.new(texture.outputs["Alpha"], shader.inputs["Alpha"])
    return made


def plant(generator: np.random.Generator) -> bpy.types.Mesh:
    """Cards that lean out of one root in all directions."""
    around = generator.uniform(0.0, 2.0 * np.pi, CARDS)
    lean, length = generator.uniform(0.2, 1.0, CARDS), generator.uniform(0.4, 0.9, CARDS)
    along = np.stack([np.sin(lean) * np.cos(around), np.sin(lean) * np.sin(around), np.cos(lean)], 1)
    across = np.stack([-np.sin(around), np.cos(around), np.zeros(CARDS)], 1) * (0.3 * length)[:, None]
    tip = along * length[:, None]
    corners = np.stack([-across, across, tip + across, tip - across], axis=1)
    mesh = bpy.data.meshes.new("Plant")
    mesh.from_pydata(corners.reshape(-1, 3), [], np.arange(4 * CARDS).reshape(-1, 4))
    square = np.tile([0, 0, 1, 0, 1, 1, 0, 1], CARDS).astype(np.float32)
    mesh.uv_layers.new().data.foreach_set("uv", square)
    return mesh


def vegetation(path: Path) -> None:
    """Save a meadow of cards with alpha on a lawn, in the sun and below a sky."""
    generator = np.random.default_rng(SEED)
    leaf, scene = leaf_material(), bpy.context.scene
    meshes = [plant(generator) for _ in range(8)]
    for mesh in meshes:
        mesh.materials.append(leaf)
    for number in range(PLANTS):
        placed = bpy.data.objects.new("Plant", meshes[number % len(meshes)])
        placed.location = (*generator.uniform((-9.0, -2.0), (9.0, 16.0)), 0.0)
        placed.rotation_euler.z, placed.scale = number, (generator.uniform(0.7, 1.6),) * 3
        scene.collection.objects.link(placed)
    bpy.ops.mesh.primitive_plane_add(size=80.0)
    bpy.context.object.data.materials.append(material("Lawn"))
    add_sky((0.8, 0.3, 0.0))
    camera = bpy.data.objects.new("Camera", bpy.data.cameras.new("Camera"))
    camera.location, camera.rotation_euler = (0.0, -6.0, 1.6), (math.pi / 2 - 0.12, 0.0, 0.0)
    save(camera, path, (960, 540), 4)


def street(stem: str, path: Path) -> None:
    """Save the demo's street before the camera of one of its shots."""
    scene, shot = bpy.context.scene, SHOTS[stem]
    build_scene(scene)
    camera = bpy.data.objects.new("Camera", bpy.data.cameras.new("Camera"))
    place_camera(camera, shot)
    save(camera, path, shot.size, 8, None if stem == "perspective" else stem, shot.scale)


def room(materials: int, path: Path) -> None:
    """Save the room of so many materials."""
    add_objects(room_materials(materials, np.random.default_rng(SEED)), np.random.default_rng(SEED + 1))
    add_walls()
    add_lamps()
    add_sky((0.6, 0.3, 0.0))
    camera = bpy.data.objects.new("Camera", bpy.data.cameras.new("Camera"))
    camera.location, camera.rotation_euler = (0.0, -HALF - 3.0, 2.6), (math.pi / 2 - 0.05, 0.0, 0.0)
    camera.data.lens = 24.0
    save(camera, path, (960, 540), 4)


def save(
    camera: bpy.types.Object,
    path: Path,
    size: tuple[int, int],
    samples: int,
    preset: str | None = None,
    scale: float = 1.0,
) -> None:
    """Save the scene before a flexible camera: a preset's, or one that sees as an ordinary one does."""
    scene = bpy.context.scene
    scene.collection.objects.link(camera)
    scene.camera = camera
    (scene.render.resolution_x, scene.render.resolution_y), scene.render.resolution_percentage = size, 100
    scene.cycles.samples, scene.cycles.device = samples, "CPU"
    scene.cycles.use_denoising = scene.cycles.use_adaptive_sampling = False
    bpy.context.view_layer.update()
    if preset:
        apply_preset(camera, read_preset(preset_files()[preset]), size[0] / size[1], scale)
    else:
        volume_from_camera(camera, scene)
    camera.scfpf.samples, scene.scfpf_sampling.use_adaptive = samples, False
    scene.scfpf_sampling.world_shadows = True
    bpy.ops.wm.save_as_mainfile(filepath=str(path))


class RealScene(NamedTuple):
    """A scene: what saves it; whether Cycles can show it without the rig; the goals of both bounces.

    goals: Cycles' time as a multiple of the engine's, None for none.
    """

    write: Callable[[Path], None]
    ordinary: bool
    goals: tuple[float | None, float | None]


SCENES = {
    f"street, {stem.replace('_', ' ')}": RealScene(partial(street, stem), False, (None, None))
    for stem in SHOTS
} | {
    "street, perspective": RealScene(partial(street, "perspective"), True, (2.0, 2.0)),
    "room, 200 materials": RealScene(partial(room, 200), True, (1.0, 1.5)),
    "room, 5 materials": RealScene(partial(room, 5), True, (None, None)),
    "meadow of cards": RealScene(vegetation, True, (1.0, 1.0)),
}


def write(name: str, path: Path, scenes: Mapping[str, RealScene] = SCENES) -> None:
    """Save one of the scenes."""
    bpy.ops.wm.read_homefile(use_empty=True, use_factory_startup=True)
    scenes[name].write(path)
