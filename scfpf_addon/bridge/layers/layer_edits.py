# SPDX-License-Identifier: GPL-3.0-or-later
"""New layers of a flexible camera: the cameras that see them, their colours, and the image of these."""

from __future__ import annotations

import bpy
import numpy as np

from ...projection.diagrams.line_colors import LAYERS
from ...shading.typing import Single
from ..blender.scene_objects import link_beside
from ..blender.slot_animation import LAYERS as LAYER_SLOTS
from ..blender.slot_animation import move_slot

IMAGE_NAME = "Layers of {}"


def add_layer(camera, collection, aspect: float, eye=None):
    """Append a layer that shows a collection to a camera's list, and make it active. Returns the layer.

    aspect: of the camera's image. eye: the camera that sees the collection; by default a new ordinary one in
    the place of ``camera``, which the artist then moves. The layer has the shape that the volume of a
    flexible eye was made for, as large as the image holds.
    """
    settings = camera.scfpf
    taken = {layer.name for layer in settings.layers}
    names = (collection.name, *(f"{collection.name} {number}" for number in range(2, len(taken) + 2)))
    layer = settings.layers.add()
    layer.name = next(free for free in names if free not in taken)
    layer.collection, layer.camera = collection, eye or _new_eye(camera, layer.name)
    if layer.camera.scfpf.enabled and layer.camera.scfpf.fit != "NONE":
        wide = layer.camera.scfpf.fitted_aspect / aspect
        layer.size = min(wide, 1.0), min(1.0 / wide, 1.0)
    color_layers(settings.layers)
    settings.active_layer = len(settings.layers) - 1
    return layer


def _new_eye(camera, name: str):
    """An ordinary camera with the place and the lens of a flexible one."""
    data = camera.data.copy()
    data.name = f"{name} Layer"
    data.animation_data_clear()
    eye = bpy.data.objects.new(data.name, data)
    eye.matrix_world = camera.matrix_world
    link_beside(eye, camera)
    return eye


def add_layer_in_front(camera, collection, eye, position: tuple[float, float], size: float):
    """Add a layer whose collection is seen in front of everything else, by a camera of the image's shape.

    position: of its middle, shares of the image. size: its width and height as shares of the image's. Returns
    the layer. Raises UserError.
    """
    add_layer(camera, collection, 1.0, eye)
    move_slot(camera.scfpf, len(camera.scfpf.layers) - 1, 0, LAYER_SLOTS)
    layer = camera.scfpf.layers[0]
    layer.front, layer.position, layer.size = "ORDER", position, (size, size)
    return layer


def color_layers(layers) -> None:
    """Give each layer that has none, black, the first of the colors that the fewest others have."""
    for layer in layers:
        if not any(layer.color):
            taken = [tuple(round(part, 2) for part in other.color) for other in layers]
            layer.color = min(LAYERS, key=taken.count)


def write_picture(camera, pixels: Single):
    """Keep an image of a camera's layers in its property ``layer_image``; return the image.

    pixels: (H, W, 4) display colours, row 0 at the bottom. The image is new, so that undo brings back the one
    before, and editors go on with it.
    """
    height, width = pixels.shape[:2]
    made = bpy.data.images.new(IMAGE_NAME.format(camera.name), width, height)
    made.pixels.foreach_set(np.ascontiguousarray(pixels, np.float32).reshape(-1))
    made.update()
    made.pack()
    before = camera.scfpf.layer_image
    camera.scfpf.layer_image = made
    if before is not None and before.is_editable:
        name = before.name
        before.user_remap(made)
        bpy.data.images.remove(before)
        made.name = name
    return made
