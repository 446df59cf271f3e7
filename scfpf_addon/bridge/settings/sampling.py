# SPDX-License-Identifier: GPL-3.0-or-later
"""``Scene.scfpf_sampling``: the settings of sampling, as properties and as a frame takes them."""

from __future__ import annotations

import bpy
from bpy.props import PointerProperty

from ...shading.sampling.adaptive import Adaptive
from ...shading.sampling.pixel_filter import PixelFilter
from ..scene.light_paths import read_exposure
from .property_options import choice, integer, number, switch

# Blender allows a filter width of 0.
SMALLEST_WIDTH = 0.01


class SCFPF_Sampling(bpy.types.PropertyGroup):
    """Sampling settings of the engine and the Render button, apart from the number of samples."""

    pixel_filter: choice(
        "Pixel Filter",
        "Weights of the samples around a pixel's center",
        items=(
            ("BOX", "Box", "Equal weights all over the pixel"),
            ("GAUSSIAN", "Gaussian", "Soft; width as the scene's filter size"),
            (
                "BLACKMAN_HARRIS",
                "Blackman-Harris",
                "Soft, with steeper sides; width as the scene's filter size",
            ),
        ),
        default="BLACKMAN_HARRIS",
    )
    pattern: choice(
        "Pattern",
        "Placement of the samples of neighboring pixels, which Adaptive Sampling always scrambles",
        items=(
            ("SAME", "Same in All Pixels", "Edges without noise, in as many steps as there are samples"),
            (
                "SCRAMBLED",
                "Scrambled",
                "Sobol points, in another order in each pixel: fine noise at edges, no steps",
            ),
        ),
        default="SAME",
    )
    use_adaptive: switch(
        "Adaptive Sampling",
        "Take fewer samples where those of a pixel hardly differ, and all of them where they do",
    )
    adaptive_threshold: number(
        "Noise Threshold",
        "The error of a pixel at which it gets no more samples: lower is finer and slower",
        0.01,
        1e-4,
        1.0,
        soft_min=1e-3,
        precision=4,
        step=0.1,
    )
    adaptive_least: integer(
        "Min Samples",
        "Samples that every pixel gets: details that all of them miss are lost",
        8,
        2,
        1024,
        soft_max=64,
    )
    motion_steps: integer(
        "Motion Steps",
        "Number of times at which the scene is read while the shutter is open: if anything moves, each is "
        "kept in memory",
        8,
        2,
        256,
        soft_max=32,
    )
    world_shadows: switch(
        "World Shadows",
        "Let the light of a world of one color cast shadows, as skies do, and as in Cycles, for up to half "
        "as much time again, instead of lighting everything alike; on in new scenes",
    )


def sampling_of(scene) -> dict[str, object]:
    """Return the fields of ``FrameSettings`` that depend on an evaluated scene's sampling and film."""
    options = scene.scfpf_sampling
    adaptive = Adaptive(options.adaptive_threshold, options.adaptive_least) if options.use_adaptive else None
    return {
        "pixel_filter": PixelFilter(options.pixel_filter, max(scene.render.filter_size, SMALLEST_WIDTH)),
        "exposure": read_exposure(scene),
        "scrambled": options.pattern == "SCRAMBLED",
        "adaptive": adaptive,
    }


def register():
    bpy.utils.register_class(SCFPF_Sampling)
    bpy.types.Scene.scfpf_sampling = PointerProperty(name="SCFPF Sampling", type=SCFPF_Sampling)


def unregister():
    del bpy.types.Scene.scfpf_sampling
    bpy.utils.unregister_class(SCFPF_Sampling)
