# SPDX-License-Identifier: GPL-3.0-or-later
"""Images → arrays: those that a picture can show, and no others."""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import replace

import bpy
import numpy as np

from ..casting.culling import within_volume
from ..projection.volume import Projection
from ..shading.materials.image import ImageData
from ..shading.scene import Scene
from .read_materials import listing

# Colour spaces whose values are scene-linear or no colours; anything else of bytes is taken for sRGB.
LINEAR_SPACES = {"Linear", "Linear Rec.709", "scene_linear", "Raw", "Non-Color"}


def with_images(
    scene: Scene, projection: Projection | None = None, known: dict[str, ImageData] | None = None
) -> Scene:
    """The scene with the images that its materials look up, and warnings about them.

    projection: images of materials that only stand outside its volume are left out, unless something
    reflects. known: images read before, which are taken as they are; those read now are put in.
    """
    graphs = scene.materials.graphs
    if not any(graph.images for graph in graphs.values()):
        return scene
    geometry = scene.geometry
    material = geometry.material
    if projection is not None and not any(graph.reflects for graph in graphs.values()):
        material = material[within_volume(geometry.vertices, geometry.triangles, projection.volume)]
    shown = set(np.unique(material).tolist())
    names = {name for number, graph in graphs.items() if number in shown for name in graph.images}
    images, warnings = read_images(names, known)
    return replace(scene, images=images, warnings=scene.warnings + warnings)


def read_images(
    names: Iterable[str], known: dict[str, ImageData] | None = None
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
            if known is not None and name in known and not image.is_dirty:
                found[name] = known[name]
                continue
            data = read_image(image)
            if data is None:
                trouble.setdefault(MISSING, []).append(name)
                continue
            found[name] = data
            for text in _oddities(image):
                trouble.setdefault(text, []).append(name)
    trouble.setdefault(MISSING, []).extend(sorted(wanted))
    if known is not None:
        known.update(found)
    return found, tuple(text + listing(sorted(which)) for text, which in trouble.items() if which)


MISSING = "Missing images, shown in magenta: "


def _oddities(image) -> Iterable[str]:
    if image.source == "TILED":
        yield "Only the first tile is shown of: "
    elif image.source in {"SEQUENCE", "MOVIE"}:
        yield "Shown as the frame that Blender has loaded: "
    space = image.colorspace_settings.name
    if not (image.is_float or space == "sRGB" or space in LINEAR_SPACES):
        yield f"The colour space {space} is taken for sRGB: "


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
