# SPDX-License-Identifier: GPL-3.0-or-later
"""The parts of compositions: cameras, blends with maps, and volumes of tiles."""

from __future__ import annotations

import importlib
from collections.abc import Sequence
from typing import NamedTuple

import numpy as np
from numpy.typing import ArrayLike, NDArray

from .. import render_demo
from ..recipes.layer_pictures import add_camera, add_layer, select_only

__all__ = [
    "Tile",
    "add_camera",
    "add_layer",
    "blended",
    "frame_rays",
    "module",
    "new_scene",
    "pinned",
    "tiled",
]

Array = NDArray[np.float64]


class Tile(NamedTuple):
    """A part of an image with projectors of its own.

    places: (R, C, 2) in the image, as shares of its width and height. layers: (R, C, 3) points in camera
    space each, from near to far.
    """

    places: Array
    layers: Sequence[Array]


def module(name: str):
    """A module of the extension."""
    return importlib.import_module(f"{render_demo.MODULE}.scfpf_addon.{name}")


def new_scene(width: int, height: int):
    """Open an empty file, and return its scene."""
    import bpy

    bpy.ops.wm.read_homefile(use_empty=True, use_factory_startup=True)
    return sized(bpy.context.scene, width, height)


def sized(scene, width: int, height: int):
    """Set the size of a scene's image and its engine."""
    scene.render.engine = render_demo.ENGINE
    scene.render.resolution_x, scene.render.resolution_y = width, height
    scene.render.resolution_percentage = 100
    return scene


def pinned(scene, name: str, place, thing, at, lens: float):
    """Add an ordinary camera whose image shows a point at a position.

    place: of the camera, world. thing: the point, world. at: shares of the image's width and height.
    """
    import bpy
    from mathutils import Matrix, Vector

    camera = add_camera(scene, name, place, thing, lens)
    render = scene.render
    across, up = (at[0] - 0.5) * 36.0 / lens, (at[1] - 0.5) * 36.0 / lens
    up *= render.resolution_y / render.resolution_x
    # The camera is level: it is turned by angles that lead the view axis away from the point.
    away = Vector(thing) - Vector(place)
    flat = np.hypot(away.x, away.y)
    pitch = np.arctan2(away.z, flat) - np.arctan2(up, np.hypot(1.0, across))
    for _ in range(20):
        heading = np.arctan2(away.x, away.y) - np.arctan2(across, np.cos(pitch) - up * np.sin(pitch))
        turned = Matrix.Rotation(-heading, 3, "Z") @ Matrix.Rotation(np.pi / 2 + pitch, 3, "X")
        own = turned.inverted() @ away
        pitch -= np.arctan(up) - np.arctan(own.y / -own.z)
    camera.rotation_euler = turned.to_euler()
    bpy.context.view_layer.update()
    return camera


def blended(first, second, kind: str, name: str, **field):
    """Blend two cameras by a map, and return the blend.

    first, second: ordinary ones become flexible, and show what they did. field: settings of the map.
    """
    import bpy

    for camera in (first, second):
        select_only(camera)
        if not camera.scfpf.enabled:
            bpy.ops.scfpf.camera_from_camera()
    select_only(first, second)
    bpy.ops.scfpf.camera_blend()
    made = bpy.context.object
    made.name = name
    for key, value in field.items():
        setattr(made.scfpf.blend_field, key, value)
    bpy.ops.scfpf.blend_map(kind=kind)
    return made


def frame_rays(places: ArrayLike, lens: float, aspect: float) -> Array:
    """Directions (..., 3), in camera space and of depth 1, that an ordinary camera has at image positions."""
    places = np.asarray(places, float)
    wide = 36.0 / lens
    across, up = (places[..., 0] - 0.5) * wide, (places[..., 1] - 0.5) * wide / aspect
    return np.stack([across, up, -np.ones_like(across)], axis=-1)


def tiled(camera, tiles: Sequence[Tile], names: Sequence[str]) -> None:
    """Give a camera a volume of tiles, each an island of its control surfaces' UV maps.

    Where tiles overlap, the first counts. names: of the control surfaces.
    """
    mesh, chart = module("projection.surfaces.uv_mesh").UVMesh, module("projection.surfaces.uv_chart").UVChart
    flexible = module("bridge.camera.flexible_camera")
    corners, uv, count = [], [], 0
    for tile in tiles:
        rows, columns = tile.places.shape[:2]
        number = np.arange(rows * columns).reshape(rows, columns)
        a, b, c, d = number[:-1, :-1], number[:-1, 1:], number[1:, 1:], number[1:, :-1]
        own = np.concatenate([np.stack(each, axis=-1).reshape(-1, 3) for each in ((a, b, c), (a, c, d))])
        uv.append(tile.places.reshape(-1, 2)[own])
        corners.append(own + count)
        count += rows * columns
    shared = chart(np.concatenate(uv), np.concatenate(corners))
    surfaces = []
    for number, name in enumerate(names):
        points = np.concatenate([np.asarray(tile.layers[number]).reshape(-1, 3) for tile in tiles])
        surfaces.append(flexible.NewSurface(name, "UV_MESH", np.eye(4), points=mesh(points, shared)))
    flexible.replace_surfaces(camera, surfaces)
    camera.scfpf.basis = "POLYLINE" if len(names) > 2 else "BEZIER"
    camera.scfpf.reparameterisation = "RECTANGLE"
    flexible.make_flexible(camera)
