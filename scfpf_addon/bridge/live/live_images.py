# SPDX-License-Identifier: GPL-3.0-or-later
"""The images on surfaces of a live image: read once, at reduced size, and packed for lookups."""

from __future__ import annotations

import time
from typing import NamedTuple

import numpy as np

from ...projection.colors import linear_from_srgb
from ...shading.live.live_textures import EXTENSIONS, LiveTexture, LiveTextures, halved
from ...shading.typing import Single
from ..scene.read_images import image_state, read_image

# Pixels along each side of an image that is kept, at most.
LARGEST = 1024
# Seconds that reading images may take for one live image, beyond the first of them.
PATIENCE = 0.05
IMAGE_NODES = {"TEX_IMAGE", "TEX_ENVIRONMENT"}
# Reading of an image that has no pixels.
MISSING = np.array([1.0, 0.0, 1.0, 1.0], np.float32).reshape(1, 1, 4)


class ImageUse(NamedTuple):
    """An image as a node uses it. image: its session_uid."""

    image: int
    extension: str = "REPEAT"
    is_smooth: bool = True


class ImageCache:
    """The pixels of images by their session_uid, without references to them."""

    def __init__(self) -> None:
        self._known: dict[int, tuple[tuple, Single]] = {}
        self._packed: tuple[tuple, LiveTextures] | None = None
        # Those that have been compared with their sources since the last edit.
        self._checked: set[int] = set()

    def mark_edited(self) -> None:
        """Compare the images with their sources before they are used again."""
        self._checked.clear()

    def textures(
        self, uses: tuple[ImageUse, ...], images
    ) -> tuple[LiveTextures | None, tuple[int, ...], int]:
        """Pack images, those that can be read at once.

        images: bpy.data.images. Returns the packed images, the row of each use in them (-1 while it is not
        read), and the number of images that are still to be read by further calls.
        """
        waiting = self._read({use.image for use in uses}, images) if uses else 0
        ready = tuple(dict.fromkeys(use for use in uses if use.image in self._known))
        key = tuple((use, self._known[use.image][0]) for use in ready)
        if self._packed is None or self._packed[0] != key:
            made = [LiveTexture(self._known[use.image][1], use.extension, use.is_smooth) for use in ready]
            self._packed = key, LiveTextures.of(made)
        number = {use: row for row, use in enumerate(ready)}
        rows = tuple(number.get(use, -1) for use in uses)
        return self._packed[1] if ready else None, rows, waiting

    def _read(self, wanted: set[int], images) -> int:
        """Read images that are new or changed; return how many must wait."""
        if wanted <= self._checked:
            return 0
        end, waiting, count = time.monotonic() + PATIENCE, 0, 0
        for image in images:
            uid = image.session_uid
            if uid not in wanted or uid in self._checked:
                continue
            state, known = image_state(image), self._known.get(uid)
            if known is None or known[0] != state or image.is_dirty:
                if count and time.monotonic() > end:
                    waiting += 1
                    continue
                count += 1
                # Painting changes pixels without changing the state: the time makes it another one.
                painted = (time.monotonic_ns(),) if image.is_dirty else ()
                self._known[uid] = (*state, *painted), live_pixels(image)
            self._checked.add(uid)
        return waiting


def live_pixels(image) -> Single:
    """The pixels (H, W, 4) of an image, linear with straight alpha, halved until they are few enough."""
    data = read_image(image)
    if data is None:
        return MISSING
    pixels = data.pixels
    while max(pixels.shape[:2]) > LARGEST:
        pixels = halved(pixels.astype(np.float32))
    pixels = pixels.astype(np.float32)
    if data.pixels.dtype == np.uint8:
        pixels /= np.float32(255.0)
    color, alpha = pixels[:, :, :3], pixels[:, :, 3:]
    if data.premultiplied:
        color /= np.where(alpha > 0.0, alpha, np.float32(1.0))
    if data.encoded:
        color[:] = linear_from_srgb(color)
    return pixels


def image_use(node) -> ImageUse | None:
    """The image of an Image Texture or Environment Texture node with its settings, or None."""
    if node is None or node.type not in IMAGE_NODES or node.image is None:
        return None
    extension = getattr(node, "extension", "REPEAT")
    return ImageUse(
        node.image.session_uid,
        extension if extension in EXTENSIONS else "EXTEND",
        node.interpolation != "Closest",
    )


def active_image(material) -> ImageUse | None:
    """The image that Solid shading shows of a material: that of its active texture node.

    The last texture node stands for the active one if another kind of node has become active since.
    """
    tree = material.node_tree
    if tree is None:
        return None
    found = image_use(tree.nodes.active)
    if found is not None:
        return found
    shown, number = material.texture_paint_images, material.paint_active_slot
    painted = shown[number] if 0 <= number < len(shown) else None
    used = None
    for node in tree.nodes:
        if node.bl_idname.startswith("ShaderNodeTex") and node.type != "TEX_COORD":
            used = image_use(node)
            if used is not None and painted is not None and node.image == painted:
                break
    return used
