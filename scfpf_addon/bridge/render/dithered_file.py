# SPDX-License-Identifier: GPL-3.0-or-later
"""Files of images with the dither of Blender's output, which it gives to pictures that it has rendered only.

An engine whose picture is already there renders an empty copy of the scene.
"""

from __future__ import annotations

import os
import shutil
import tempfile

import bpy
import numpy as np

from ...shading.typing import Single
from ..blender.rig_mark import PASSING_KEY
from ..blender.versions import switch_writing_on

# Bits a channel from which on Blender does not dither.
FINE = ("16", "32")


class SCFPF_DitheringEngine(bpy.types.RenderEngine):
    """A render engine whose picture is ``pixels``, (H, W, 4) float32."""

    bl_idname = "SCFPF_DITHER"
    bl_label = "SCFPF Dither"
    pixels: Single | None = None

    def render(self, depsgraph):
        assert self.pixels is not None
        height, width = self.pixels.shape[:2]
        result = self.begin_result(0, 0, width, height, layer=depsgraph.view_layer_eval.name)
        try:
            result.layers[0].passes.find_by_name("Combined", "").rect.foreach_set(self.pixels.ravel())
        finally:
            self.end_result(result)


def is_dithered(scene) -> bool:
    """Return whether Blender dithers pictures that it writes with the scene's present output settings."""
    settings = scene.render.image_settings
    return scene.render.dither_intensity > 0.0 and settings.color_depth not in FINE


def save_dithered(image, path: str, scene) -> None:
    """Write an image with the scene's output settings, as F12 does. Raises RuntimeError and OSError."""
    width, height = image.size
    pixels = np.empty(width * height * 4, np.float32)
    image.pixels.foreach_get(pixels)
    copy = scene.copy()
    try:
        copy[PASSING_KEY] = True
        _empty(copy, width, height)
        SCFPF_DitheringEngine.pixels = pixels.reshape(height, width, 4)
        bpy.utils.register_class(SCFPF_DitheringEngine)
        try:
            copy.render.engine = SCFPF_DitheringEngine.bl_idname
            with tempfile.TemporaryDirectory(prefix="scfpf-") as folder:
                copy.render.filepath = os.path.join(folder, "dithered")
                bpy.ops.render.render(write_still=True, scene=copy.name)
                shutil.copyfile(copy.render.filepath, path)
        finally:
            bpy.utils.unregister_class(SCFPF_DitheringEngine)
    finally:
        SCFPF_DitheringEngine.pixels = None
        camera = copy.camera
        bpy.data.scenes.remove(copy)
        if camera is not None:
            bpy.data.cameras.remove(camera.data)


def _empty(copy, width: int, height: int) -> None:
    """Leave nothing but a camera in a copied scene, and a picture of a size in its output."""
    for collection in copy.collection.children[:]:
        copy.collection.children.unlink(collection)
    for obj in copy.collection.objects[:]:
        copy.collection.objects.unlink(obj)
    for layer in copy.view_layers[1:]:
        copy.view_layers.remove(layer)
    copy.view_layers[0].use = True
    copy.timeline_markers.clear()
    copy.camera = bpy.data.objects.new("SCFPF Dither", bpy.data.cameras.new("SCFPF Dither"))
    render = copy.render
    render.resolution_x, render.resolution_y, render.resolution_percentage = width, height, 100
    render.use_border = render.use_multiview = render.use_freestyle = False
    render.use_compositing = render.use_sequencer = render.use_file_extension = False
    render.use_stamp = False
    switch_writing_on(copy)
