# SPDX-License-Identifier: GPL-3.0-or-later
"""A cathedral's nave: bays of groin vaults on piers, aisles, windows, and the sun through them.

It runs along +y, z is up, lengths are in metres.
"""

from __future__ import annotations

import bpy
import numpy as np

from ..mesh import Array, material, place
from ..people import people

BAYS, BAY, HALF = 9, 5.2, 5.0
# Heights of the arcade's arches, of the vault's springing and of its crown.
ARCADE, SPRING, CROWN = 8.0, 14.0, 21.0
AISLE, ROOF, THICK = 10.5, 10.5, 0.7
# Who gives the nave its scale: x, y, turn in degrees, coat.
VISITORS = (
    (2.35, 15.35, 165.0, "Coat red"),
    (1.7, 15.6, 200.0, "Coat yellow"),
    (-1.5, 24.6, 140.0, "Coat white"),
    (-0.9, 24.9, 205.0, "Coat blue"),
)
# Columns of faces across a bay's wall and its vault.
STEPS = 48
STONE, RIB, GLASS = (
    (0.46, 0.38, 0.28),
    (0.56, 0.48, 0.36),
    ((0.9, 0.2, 0.08), (0.1, 0.25, 0.9), (0.9, 0.6, 0.1)),
)


def pointed(share: Array) -> Array:
    """Heights of a pointed arch over its span: 1 in the middle (share 0), 0 at the ends (-1 and 1).

    Two arcs whose centres are on the springing line, one and a half half-spans away from their ends.
    """
    radius = 1.5
    high = np.sqrt(np.maximum(radius**2 - (np.abs(share) + radius - 1) ** 2, 0.0))
    return high / np.sqrt(radius**2 - (radius - 1) ** 2)


def vault(across: Array, along: Array) -> Array:
    """Heights of a groin vault: across in half widths of the nave, along in half bays."""
    return SPRING + (CROWN - SPRING) * np.maximum(pointed(across), 0.86 * pointed(along))


def build_nave():
    """Open a new file with the nave, and return its scene."""
    bpy.ops.wm.read_homefile(use_empty=True, use_factory_startup=True)
    scene = bpy.context.scene
    stone, rib = material("Stone", STONE, 0.85), material("Rib", RIB, 0.8)
    for bay in range(BAYS):
        middle = (bay + 0.5) * BAY
        _vault_and_ribs(scene, middle, stone, rib)
        for side in (-1, 1):
            _wall(scene, side * HALF, middle, stone, ARCADE, (SPRING - 1.5, 1.15, 18.0), SPRING)
            _wall(scene, side * AISLE, middle, stone, 0.0, (3.0, 1.2, 7.6), None)
            _slab(
                scene,
                "Aisle roof",
                (side * HALF, middle - BAY / 2),
                (side * AISLE, middle + BAY / 2),
                ROOF,
                stone,
            )
    for end in range(BAYS + 1):
        for side in (-1, 1):
            _pier(scene, side * HALF, end * BAY, rib)
    _floor(scene)
    _choir(scene, stone)
    figures = people()
    for number, (x, y, turn, coat) in enumerate(VISITORS):
        place(f"Visitor {number}", figures[coat], scene.collection, (x, y, 0.0), np.radians(turn))
    _light(scene)
    return scene


def _object(scene, name: str, points, faces, look, smooth: bool = False, thick: float = 0.0):
    mesh = bpy.data.meshes.new(name)
    mesh.from_pydata(np.asarray(points, float).tolist(), [], np.asarray(faces).tolist())
    if smooth:
        mesh.shade_smooth()
    mesh.materials.append(look)
    made = bpy.data.objects.new(name, mesh)
    scene.collection.objects.link(made)
    if thick:
        solid = made.modifiers.new("Thickness", "SOLIDIFY")
        solid.thickness, solid.offset = thick, 0.0
    return made


def _grid_faces(rows: int, columns: int) -> Array:
    number = np.arange(rows * columns).reshape(rows, columns)
    corners = number[:-1, :-1], number[:-1, 1:], number[1:, 1:], number[1:, :-1]
    return np.stack(corners, axis=-1).reshape(-1, 4)


def _curve(scene, name: str, points: Array, thick: float, look) -> None:
    """A tube along points (n, 3)."""
    data = bpy.data.curves.new(name, "CURVE")
    data.dimensions, data.bevel_depth, data.bevel_resolution = "3D", thick, 3
    spline = data.splines.new("POLY")
    spline.points.add(len(points) - 1)
    spline.points.foreach_set("co", np.append(points, np.ones((len(points), 1)), axis=1).ravel())
    data.materials.append(look)
    scene.collection.objects.link(bpy.data.objects.new(name, data))


def _vault_and_ribs(scene, middle: float, stone, rib) -> None:
    s = np.linspace(-1, 1, STEPS + 1)
    across, along = np.meshgrid(s, s, indexing="ij")
    z = vault(across, along)
    points = np.stack([HALF * across, middle + BAY / 2 * along, z], axis=-1).reshape(-1, 3)
    _object(scene, "Vault", points, _grid_faces(STEPS + 1, STEPS + 1), stone)
    low = -0.08
    for turn in (-1, 1):
        diagonal = np.stack([HALF * s, middle + turn * BAY / 2 * s, vault(s, s) + low], axis=1)
        _curve(scene, "Diagonal rib", diagonal, 0.13, rib)
    end = np.full_like(s, middle - BAY / 2)
    _curve(
        scene, "Transverse rib", np.stack([HALF * s, end, vault(s, np.ones_like(s)) + low], axis=1), 0.2, rib
    )


def _wall(scene, x: float, middle: float, stone, arch: float, window, spring) -> None:
    """A wall of a bay, with an arch below (0: none) and a window, and the vault's or an aisle's top.

    window: its sill, half its width, its top.
    """
    s = np.linspace(-1, 1, 2 * STEPS + 1)
    y = s * BAY / 2
    top = np.full_like(y, ROOF) if spring is None else vault(np.ones_like(s), s)
    opening = np.clip(y / (BAY / 2 - 0.75), -1, 1)
    inside = np.abs(y) < BAY / 2 - 0.75
    below = np.where(inside & (arch > 0), arch * (0.55 + 0.45 * pointed(opening)), 0.0)
    sill, half, high = window
    open_here = np.abs(y) < half
    pane = pointed(np.clip(y / half, -1, 1))
    middle_z = 0.5 * (sill + high)
    low_edge = np.where(open_here, sill, middle_z)
    high_edge = np.where(open_here, high - 2.2 + 2.2 * pane, middle_z)
    high_edge, low_edge = np.minimum(high_edge, top), np.minimum(low_edge, top)
    for lower, upper in ((below, low_edge), (high_edge, top)):
        points = np.concatenate(
            [np.stack([np.full_like(y, x), middle + y, edge], axis=1) for edge in (lower, upper)]
        )
        _object(scene, "Wall", points, _grid_faces(2, len(y)), stone, thick=THICK)
    frame = np.stack([y[open_here], (high - 2.2 + 2.2 * pane)[open_here]], axis=1)
    frame = np.concatenate([[(-half, sill)], frame, [(half, sill), (-half, sill)]])
    path = np.stack([np.full(len(frame), x - 0.36 * np.sign(x)), middle + frame[:, 0], frame[:, 1]], axis=1)
    _curve(scene, "Moulding", path, 0.1, stone)
    bar = np.array([(x, middle, sill), (x, middle, high - 0.2)])
    _curve(scene, "Mullion", bar, 0.06, stone)
    if arch:
        arc = np.stack(
            [np.full(inside.sum(), x - 0.36 * np.sign(x)), middle + y[inside], below[inside]], axis=1
        )
        _curve(scene, "Arch", arc, 0.17, stone)


def _slab(scene, name: str, low, high, z: float, look) -> None:
    points = [(low[0], low[1], z), (high[0], low[1], z), (high[0], high[1], z), (low[0], high[1], z)]
    _object(scene, name, points, [(0, 1, 2, 3)], look)


def _pier(scene, x: float, y: float, rib) -> None:
    """A round pier with shafts, one of which runs up to the vault, on a foot."""
    side = np.sign(x)
    shafts = [(0.0, 0.0, 0.55, ARCADE * 0.62), (-0.62 * side, 0.0, 0.2, SPRING + 0.1)]
    shafts += [
        (0.0, 0.6, 0.18, ARCADE * 0.6),
        (0.0, -0.6, 0.18, ARCADE * 0.6),
        (0.62 * side, 0, 0.18, ARCADE * 0.6),
    ]
    for across, along, radius, high in shafts:
        bpy.ops.mesh.primitive_cylinder_add(
            vertices=32, radius=radius, depth=high, location=(x + across, y + along, high / 2)
        )
        bpy.context.object.data.shade_smooth()
        bpy.context.object.data.materials.append(rib)
        for height, wide in ((0.25, 1.5), (high - 0.2, 1.4)):
            bpy.ops.mesh.primitive_cylinder_add(
                vertices=16, radius=radius * wide, depth=0.4, location=(x + across, y + along, height)
            )
            bpy.context.object.data.materials.append(rib)


def _floor(scene) -> None:
    """Tiles of two colours, polished."""
    tile = BAY / 4
    pale, dark = (
        material("Pale tile", (0.55, 0.50, 0.42), 0.22),
        material("Dark tile", (0.10, 0.085, 0.075), 0.18),
    )
    across, along = np.meshgrid(np.arange(-8, 8), np.arange(-8, BAYS * 4 + 8))
    corner = np.array([(0, 0), (1, 0), (1, 1), (0, 1)])
    places = np.stack([across, along], axis=-1).reshape(-1, 1, 2) + corner
    points = np.append(places * tile, np.zeros((*places.shape[:2], 1)), axis=2).reshape(-1, 3)
    made = _object(scene, "Floor", points, np.arange(len(points)).reshape(-1, 4), pale)
    made.data.materials.append(dark)
    made.data.polygons.foreach_set("material_index", ((across + along) % 2).ravel().astype(np.int32))


def _choir(scene, stone) -> None:
    """The end of the nave: a wall with three lancets and a round window, of coloured glass."""
    end = BAYS * BAY
    s = np.linspace(-1, 1, 2 * STEPS + 1)
    edges = [np.zeros_like(s), vault(s, np.ones_like(s))]
    points = np.concatenate(
        [np.stack([HALF * s, np.full_like(s, end + 0.4), edge], axis=1) for edge in edges]
    )
    _object(scene, "End", points, _grid_faces(2, len(s)), stone)
    glass = [material(f"Glass {number}", color, 0.4, 0.0, 1.6) for number, color in enumerate(GLASS)]
    for number, x in enumerate((-2.6, 0.0, 2.6)):
        half, sill, high = 0.85, 3.2, 11.0 if x == 0 else 9.8
        y = np.linspace(-half, half, 25)
        top = high - 1.8 + 1.8 * pointed(y / half)
        rows = np.linspace(0, 1, 33)[:, None] * (top - sill) + sill
        grid = np.stack([np.broadcast_to(x + y, rows.shape), np.full(rows.shape, end + 0.3), rows], axis=-1)
        made = _object(scene, "Lancet", grid.reshape(-1, 3), _grid_faces(33, 25), glass[0])
        for pane in glass[1:]:
            made.data.materials.append(pane)
        cells = np.arange(32)[:, None] // 2 * 7 + np.arange(24)[None] // 3 * 3 + number
        made.data.polygons.foreach_set("material_index", (cells % 5 % 3).ravel().astype(np.int32))
    turn, radius = np.meshgrid(np.linspace(0, 2 * np.pi, 49), np.linspace(0.15, 2.1, 8))
    grid = np.stack(
        [radius * np.cos(turn), np.full(turn.shape, end + 0.3), 15.2 + radius * np.sin(turn)], axis=-1
    )
    rose = _object(scene, "Rose", grid.reshape(-1, 3), _grid_faces(8, 49), glass[0])
    for pane in glass[1:]:
        rose.data.materials.append(pane)
    cells = np.arange(7)[:, None] * 2 + np.arange(48)[None] // 2
    rose.data.polygons.foreach_set("material_index", (cells % 3).ravel().astype(np.int32))
    for reach in (0.75, 1.45, 2.15):
        ring = np.stack(
            [reach * np.cos(turn[0]), np.full(49, end + 0.22), 15.2 + reach * np.sin(turn[0])], axis=1
        )
        _curve(scene, "Tracery", ring, 0.07, stone)
    for spoke in np.linspace(0, 2 * np.pi, 13)[:-1]:
        way = np.array([np.cos(spoke), 0, np.sin(spoke)])
        _curve(scene, "Tracery", np.array([0.15, 2.1])[:, None] * way + (0, end + 0.22, 15.2), 0.06, stone)


def _light(scene) -> None:
    """The sun through the clerestory, and a sky."""
    scene.world = bpy.data.worlds.new("Sky")
    if scene.world.node_tree is None:
        scene.world.use_nodes = True
    background = scene.world.node_tree.nodes["Background"].inputs
    background["Color"].default_value, background["Strength"].default_value = (0.45, 0.66, 1.0, 1.0), 1.5
    sun = bpy.data.objects.new("Sun", bpy.data.lights.new("Sun", "SUN"))
    sun.data.energy, sun.data.color, sun.data.angle = 17.0, (1.0, 0.76, 0.48), 0.012
    sun.rotation_euler = np.radians((38.0, 42.0, 20.0))
    scene.collection.objects.link(sun)
    scene.view_settings.view_transform, scene.view_settings.look = "AgX", "AgX - Medium High Contrast"
    scene.view_settings.exposure = 0.5
