# SPDX-License-Identifier: GPL-3.0-or-later
"""Images → arrays: those that a picture can show, and no others."""

from __future__ import annotations

import os
from collections.abc import Iterable
from dataclasses import replace

import bpy
import numpy as np

from ..casting.culling import within_volume
from ..projection.volume import Projection
from ..shading.materials.image import ImageData
from ..shading.scene import Scene
from .read_materials import listing
from .read_world import shows_world

# Colour spaces whose values are scene-linear or no colours; anything else of bytes is taken for sRGB.
LINEAR_SPACES = {"Linear", "Linear Rec.709", "scene_linear", "Raw", "Non-Color"}


# Images read before, by name, each with what it was made of.
KnownImages = dict[str, tuple[tuple, ImageData]]


def with_images(
    scene: Scene,
    projection: Projection | None = None,
    known: KnownImages | None = None,
    transparent: bool = False,
) -> Scene:
    """The scene with the images that its materials look up, and warnings about them.

    projection: images of materials that only stand outside its volume are left out, unless something
    reflects. known: images read before, which are taken if nothing of them has changed; what is
    read now is put in. transparent: the world is not seen behind things.
    """
    graphs = scene.materials.graphs
    if scene.world is not None and transparent and not shows_world(scene):
        scene = replace(scene, world=None)
    if scene.world is not None and scene.world.graph.images:
        images, warnings = read_images(scene.world.graph.images, known)
        scene = replace(scene, world=replace(scene.world, images=images), warnings=scene.warnings + warnings)
    if not any(graph.images for graph in graphs.values()):
        return scene
    geometry = scene.geometry
    material = geometry.material
    if projection is not None and not any(graph.reflects for graph in graphs.values()):
        material = material[within_volume(geometry.vertices, geometry.triangles, projection.volume)]
    shown = np.zeros(max(graphs, default=-1) + 1, bool)
    shown[material[material < len(shown)]] = True
    names = {name for number, graph in graphs.items() if shown[number] for name in graph.images}
    images, warnings = read_images(names, known)
    return replace(scene, images=images, warnings=scene.warnings + warnings)


def read_images(
    names: Iterable[str], known: KnownImages | None = None
) -> tuple[dict[str, ImageData], tuple[str, ...]]:
    """Images by their full names, without those that are missing, and a line for each kind of trouble."""
    found: dict[str, ImageData] = {}
    trouble: dict[str, list[str]] = {}
    wanted = set(names) - {""}
    if wanted:
        for image in bpy.data.images:
            name = image.name_full
            if name not in wanted:
                continue
            wanted.discard(name)
            state = image_state(image)
            before = known.get(name) if known is not None else None
            # What is painted on changes without a sign.
            kept = before is not None and before[0] == state and not image.is_dirty
            data = before[1] if kept else read_image(image)
            if data is None:
                trouble.setdefault(MISSING, []).append(name)
                continue
            found[name] = data
            if known is not None:
                known[name] = state, data
            for text in _oddities(image):
                trouble.setdefault(text, []).append(name)
    trouble.setdefault(MISSING, []).extend(sorted(wanted))
    return found, tuple(text + listing(sorted(which)) for text, which in trouble.items() if which)


MISSING = "Missing images, shown in magenta: "


def _oddities(image) -> Iterable[str]:
    if image.source == "TILED":
        yield "Only the first tile is shown of: "
    elif image.source in {"SEQUENCE", "MOVIE"}:
        yield "Shown as the frame that Blender has loaded: "
    space = image.colorspace_settings.name
    if not (image.is_float or space == "sRGB" or space in LINEAR_SPACES):
        yield f"The color space {space} is taken for sRGB: "


def image_state(image) -> tuple:
    """What an image's pixels are made of: if it is the same they are, unless someone paints."""
    try:
        file = os.stat(bpy.path.abspath(image.filepath, library=image.library))
        written = file.st_mtime_ns, file.st_size
    except (OSError, ValueError):
        written = ()
    space = image.colorspace_settings.name
    return image.filepath, written, tuple(image.size), space, image.alpha_mode, image.source


def read_image(image) -> ImageData | None:
    """The pixels of a bpy.types.Image, loaded if need be; None if there are none."""
    width, height = image.size
    channels = image.channels
    if width * height == 0 or channels == 0:
        return None
    flat = np.empty(width * height * channels, np.float32)
    if len(image.pixels) != len(flat):
        return None
    image.pixels.foreach_get(flat)
    pixels = flat.reshape(height, width, channels)
    if channels != 4:
        pixels = _four(pixels)
    space = image.colorspace_settings
    premultiplied = image.alpha_mode in {"STRAIGHT", "PREMUL"} and not space.is_data
    if image.alpha_mode == "NONE":
        pixels[:, :, 3] = 1.0
    # Blender holds floats premultiplied, bytes straight. Bytes are multiplied as Cycles does it, so
    # that what lies between texels is the same.
    if image.is_float:
        return ImageData(pixels, False, premultiplied)
    whole = np.floor(pixels * 255.0 + 0.5)
    if premultiplied:
        whole[:, :, :3] = np.floor(whole[:, :, :3] * whole[:, :, 3:] / 255.0)
    encoded = space.name not in LINEAR_SPACES and not space.is_data
    return ImageData(whole.astype(np.uint8), encoded, premultiplied)


def _four(pixels):
    """Grey, grey with alpha or RGB as RGBA."""
    channels = pixels.shape[2]
    whole = np.ones((*pixels.shape[:2], 4), np.float32)
    whole[:, :, :3] = pixels[:, :, : 3 if channels == 3 else 1]
    if channels == 2:
        whole[:, :, 3] = pixels[:, :, 1]
    return whole
