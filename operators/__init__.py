# SPDX-License-Identifier: GPL-3.0-or-later
"""The operators ``bpy.ops.scfpf``, in modules by task."""

from .aim import drag, pin_click, solve, targets
from .camera import (
    blend,
    blend_maps,
    calibration,
    camera,
    cycles,
    dimetric,
    duplicate,
    engine,
    live_select,
    own_presets,
    presets,
    preview,
    screen,
    stylised,
    tutorial,
    vr_pair,
    ways,
)
from .common import modal_job
from .image import find, pick, quilt, render, render_job_export, time_render, video_projector
from .layers import layer_check, layer_drag, layer_list, layer_render, look_behind, tiles_render
from .volume import attention, by_distance, framing, mappings, surface_tools, surfaces, volume_tools

# Registered in this order, unregistered in the reverse.
MODULES = (
    camera,
    presets,
    own_presets,
    dimetric,
    surfaces,
    volume_tools,
    surface_tools,
    by_distance,
    framing,
    duplicate,
    blend,
    blend_maps,
    screen,
    vr_pair,
    calibration,
    render,
    quilt,
    time_render,
    engine,
    pick,
    find,
    video_projector,
    mappings,
    attention,
    preview,
    live_select,
    cycles,
    ways,
    stylised,
    tutorial,
    targets,
    pin_click,
    solve,
    drag,
    layer_list,
    layer_drag,
    layer_check,
    layer_render,
    tiles_render,
    look_behind,
    render_job_export,
)


def register():
    for module in MODULES:
        module.register()


def unregister():
    # While the classes still have their properties.
    modal_job.disable_all()
    for module in reversed(MODULES):
        module.unregister()
