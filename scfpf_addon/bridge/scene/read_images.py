# SPDX-License-Identifier: GPL-3.0-or-later
"""The images that a render can show, as arrays."""

from __future__ import annotations

import os
from collections.abc import Iterable
from dataclasses import replace

import bpy
import numpy as np
from numpy.typing import NDArray

from ...casting.scene.culling import within_projection
from ...projection.colors import srgb_from_linear
from ...projection.user_error import Message
from ...projection.volume.viewing_volume import Projection
from ...shading.nodes.image import ImageData
from ...shading.scene.shading_scene import Scene
from ..blender import versions
from .read_materials import listing
from .read_world import shows_world

# Colour spaces of scene-linear values or data; all other images of bytes are read as sRGB.
LINEAR_SPACES = {"Linear", "Linear Rec.709", "scene_linear", "Raw", "Non-Color"}
MISSING = Message("Missing images, shown in magenta: ")
CUT_OFF = Message("Colors brighter than their alpha are cut off in images of 8 bits set to Premultiplied: ")

Pixels = NDArray[np.float32]
# Images read before, by name, each with its state.
KnownImages = dict[str, tuple[tuple, ImageData]]


def with_images(
    scene: Scene,
    projection: Projection | None = None,
    known: KnownImages | None = None,
    transparent: bool = False,
) -> Scene:
    """Add the images that a scene's materials and world use, and warnings about them.

    projection: images of materials that are only outside its volume are left out, unless anything
    reflects. known: a cache of images, used if they have not changed, and updated. transparent: whether the
    film hides the world.
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
        material = material[within_projection(geometry, projection)]
    shown = np.zeros(max(graphs, default=-1) + 1, bool)
    shown[material[material < len(shown)]] = True
    names = {name for number, graph in graphs.items() if shown[number] for name in graph.images}
    images, warnings = read_images(names, known)
    return replace(scene, images=images, warnings=scene.warnings + warnings)


def read_images(
    names: Iterable[str], known: KnownImages | None = None
) -> tuple[dict[str, ImageData], tuple[str, ...]]:
    """Read images by their full names, without missing ones. Return them, and a line for each warning."""
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
            # Painting changes pixels without changing the state.
            is_unchanged = before is not None and before[0] == state and not image.is_dirty
            data = before[1] if is_unchanged else read_image(image)
            if data is None:
                trouble.setdefault(MISSING, []).append(name)
                continue
            found[name] = data
            if known is not None:
                known[name] = state, data
            for text in _oddities(image, data):
                trouble.setdefault(text, []).append(name)
    trouble.setdefault(MISSING, []).extend(sorted(wanted))
    return found, tuple(
        Message("{0}{1}", text, listing(sorted(which))) for text, which in trouble.items() if which
    )


def _oddities(image, data: ImageData) -> Iterable[str]:
    if image.source == "TILED":
        yield Message("Only the first tile is shown of: ")
    elif image.source in {"SEQUENCE", "MOVIE"}:
        yield Message("Shown as the frame that Blender has loaded: ")
    space = image.colorspace_settings.name
    if not (image.is_float or space == "sRGB" or space in LINEAR_SPACES):
        yield Message("The color space {0} is read as sRGB: ", space)
    if image.alpha_mode == "PREMUL" and not image.is_float and _has_alpha(image) and _is_file(image):
        # Blender divides by alpha when it loads them. A color as bright as alpha may have been brighter.
        color, alpha = data.pixels[:, :, :3], data.pixels[:, :, 3:].astype(np.uint16)
        brightest = alpha * alpha // 255 if versions.multiplies_by_alpha(image, True) else alpha
        if ((color >= brightest) & (alpha > 0) & (alpha < 255)).any():
            yield CUT_OFF


def image_state(image) -> tuple:
    """The state of an image: while it is the same, so are the pixels, unless they are painted on."""
    try:
        file = os.stat(bpy.path.abspath(image.filepath, library=image.library))
        written = file.st_mtime_ns, file.st_size
    except (OSError, ValueError):
        written = ()
    space = image.colorspace_settings.name
    kind = image.alpha_mode, image.source, image.packed_file is None
    return image.filepath, written, tuple(image.size), space, *kind


def read_image(image) -> ImageData | None:
    """The pixels of a bpy.types.Image, loaded if necessary; None if it has none."""
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
        pixels = _rgba(pixels)
    space = image.colorspace_settings
    if image.alpha_mode == "NONE":
        pixels[:, :, 3] = 1.0
    if image.is_float:
        # Cycles converts files itself, and sRGB only after interpolation between texels.
        encoded = space.name == "sRGB" and _is_file(image)
        pixels = _floats(image, pixels, encoded)
    else:
        encoded = space.name not in LINEAR_SPACES and not space.is_data
        pixels = _bytes(image, pixels)
    return ImageData(pixels, encoded, _has_alpha(image))


def _is_file(image) -> bool:
    """Return whether Cycles reads an image's file. It takes the pixels of other images from Blender."""
    return image.source not in {"GENERATED", "MOVIE"} and image.packed_file is None and not image.is_dirty


def _has_alpha(image) -> bool:
    """Return whether alpha applies to an image's colours."""
    return image.alpha_mode in {"STRAIGHT", "PREMUL"} and not image.colorspace_settings.is_data


def _bytes(image, pixels: Pixels) -> NDArray[np.uint8]:
    """The bytes of Cycles' texture. pixels: Blender's, (H, W, 4) float32, straight; changed in place.

    Products are rounded as in Cycles, so that interpolation between texels gives the same.
    """
    pixels *= 255.0
    np.floor(pixels + 0.5, out=pixels)
    color, alpha = pixels[:, :, :3], pixels[:, :, 3:]
    if _has_alpha(image):
        if image.alpha_mode == "PREMUL" and _is_file(image):
            np.floor(color * np.where(alpha == 0.0, 1.0, alpha / 255.0) + 0.5, out=color)
        if versions.multiplies_by_alpha(image, _is_file(image)):
            np.floor(color * alpha / 255.0, out=color)
    return pixels.astype(np.uint8)


def _floats(image, pixels: Pixels, encoded: bool) -> Pixels:
    """The floats of Cycles' texture, in sRGB if ``encoded``.

    pixels: Blender's, (H, W, 4) float32, scene-linear and premultiplied; changed in place.
    """
    color, alpha = pixels[:, :, :3], pixels[:, :, 3:]
    there = np.where(alpha == 0.0, np.float32(1.0), alpha)
    if _has_alpha(image) and _is_file(image):
        color /= there
    if encoded:
        color[:] = srgb_from_linear(color)
    if _has_alpha(image):
        if image.alpha_mode == "PREMUL" and _is_file(image):
            color *= there
        if versions.multiplies_by_alpha(image, _is_file(image)):
            color *= alpha
    return pixels


def _rgba(pixels: Pixels) -> Pixels:
    """Grey, grey with alpha or RGB pixels as RGBA."""
    channels = pixels.shape[2]
    rgba = np.ones((*pixels.shape[:2], 4), np.float32)
    rgba[:, :, :3] = pixels[:, :, : 3 if channels == 3 else 1]
    if channels == 2:
        rgba[:, :, 3] = pixels[:, :, 1]
    return rgba
