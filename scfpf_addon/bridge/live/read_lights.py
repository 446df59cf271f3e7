# SPDX-License-Identifier: GPL-3.0-or-later
"""The lights of a viewport's Solid shading: studio lights as lamps, matcaps as images."""

from __future__ import annotations

import pathlib
import tempfile

import bpy
import gpu
import numpy as np

from ...shading.live.matcap import Matcap
from ...shading.live.studio_light import StudioLight
from ...shading.typing import Single

# The passes of a matcap's file, and names of the same lengths by which Blender puts the second pass first. A
# file lists its channels by name, so that the first name must remain the smaller one.
PASSES = (b"diffuse.", b"specular.")
SWAPPED = (b"Another.", b"Combined.")
# Bytes of a file in which its list of channels ends.
HEADER = 4096

# The images of a matcap: diffuse and specular.
Images = tuple[Single, Single | None]


def read_studio_light(found, in_world: bool, rotation: float) -> StudioLight:
    """Read a bpy.types.StudioLight. rotation: radians, of lights that stand in the world."""
    lamps = [lamp for lamp in found.solid_lights if lamp.use]
    direction = np.array([lamp.direction for lamp in lamps], np.float32).reshape(-1, 3).T
    if in_world:
        # Blender turns the studio's up, y, to the world's, z, and the studio about it.
        x, y, z = direction
        cosine, sine = np.cos(-rotation), np.sin(-rotation)
        direction = np.stack([cosine * x + sine * z, sine * x - cosine * z, y]).astype(np.float32)

    def columns(name: str) -> Single:
        return np.array([getattr(lamp, name) for lamp in lamps], np.float32).reshape(-1, 3).T.copy()

    return StudioLight(
        direction=direction,
        diffuse=columns("diffuse_color"),
        specular=columns("specular_color"),
        wrap=np.array([lamp.smooth for lamp in lamps], np.float32),
        ambient=np.array(found.light_ambient, np.float32),
        in_world=in_world,
    )


class MatcapCache:
    """The images of matcaps by the path of their file.

    Blender reads a file only as an image datablock. That must not be made while a viewport is drawn: a timer
    makes it, copies its pixels from the graphics card and removes it again.
    """

    def __init__(self) -> None:
        self._known: dict[str, Images | None] = {}
        self._wanted: set[str] = set()

    def matcap(self, path: str) -> Matcap | None:
        """The matcap of a file; None while it is not read, or if it cannot be.

        Whether Blender shows it flipped is not to be known from Python.
        """
        if path not in self._known and path not in self._wanted:
            self._wanted.add(path)
            bpy.app.timers.register(self._read_wanted, first_interval=0.0)
        found = self._known.get(path)
        return None if found is None else Matcap(*found)

    @property
    def is_waiting(self) -> bool:
        """Return whether a matcap is still to be read."""
        return bool(self._wanted)

    def _read_wanted(self) -> None:
        for path in self._wanted:
            self._known[path] = read_matcap(path)
        self._wanted.clear()
        for window in bpy.context.window_manager.windows:
            for area in window.screen.areas:
                if area.type == "VIEW_3D":
                    area.tag_redraw()


def read_matcap(path: str) -> Images | None:
    """The images of a matcap's file, through the graphics card; None if it cannot be read.

    Of a file of several passes Python gets the first one only: a copy has their order changed.
    """
    try:
        data = pathlib.Path(path).read_bytes()
        diffuse, specular = _first_pass(path), None
        if diffuse is not None and all(name in data[:HEADER] for name in PASSES):
            header = data[:HEADER]
            for name, other in zip(PASSES, SWAPPED, strict=True):
                header = header.replace(b"\0" + name, b"\0" + other)
            with tempfile.TemporaryDirectory() as folder:
                copy = pathlib.Path(folder, "matcap.exr")
                copy.write_bytes(header + data[HEADER:])
                specular = _first_pass(str(copy))
    except OSError:
        return None
    return None if diffuse is None else (diffuse, specular)


def _first_pass(path: str) -> Single | None:
    """The first pass of an image file, (H, W, 3) float32, linear; None if Blender cannot read it."""
    image = None
    try:
        image = bpy.data.images.load(path)
        texture = gpu.texture.from_image(image)
        values = texture.read()
        values.dimensions = texture.width * texture.height * 4
        pixels = np.array(values, np.float32).reshape(texture.height, texture.width, 4)
        return pixels[:, :, :3].copy()
    except (RuntimeError, SystemError, ValueError):
        return None
    finally:
        if image is not None:
            bpy.data.images.remove(image)
