# SPDX-License-Identifier: GPL-3.0-or-later
"""Pictures by Cycles, with all of its light."""

from __future__ import annotations

import sys
from pathlib import Path

import bpy

# The pixel error of the projectors; a smaller one takes more chords without a visible difference.
PIXEL_ERROR = 0.5


def path_traced(scene, path: Path, samples: int) -> None:
    """Render a scene's flexible camera with Cycles, denoised, into a PNG file. samples: of each pixel."""
    scene.render.engine = "CYCLES"
    scene.cycles.samples, scene.cycles.use_denoising, scene.cycles.max_bounces = samples, True, 6
    camera = scene.camera
    camera.scfpf.pixel_error = PIXEL_ERROR
    scene.view_layers[0].objects.active = camera
    bpy.context.view_layer.update()
    if camera.scfpf.layers:
        done = bpy.ops.scfpf.layers_render(camera=camera.name, filepath=str(path))
    else:
        done = bpy.ops.scfpf.cycles_rig()
    if done != {"FINISHED"}:
        sys.exit(f"{scene.name} was not rendered with Cycles; the lines above say why.")
    if not camera.scfpf.layers:
        scene.render.filepath, scene.render.image_settings.file_format = str(path), "PNG"
        bpy.ops.render.render(write_still=True)
