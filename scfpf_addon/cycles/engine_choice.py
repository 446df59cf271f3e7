# SPDX-License-Identifier: GPL-3.0-or-later
"""Whether F12 shows what the scene's flexible camera sees: by SCFPF, or by Cycles through the rig."""

from __future__ import annotations

import bpy

from ..bridge.render_engine import ENGINE
from ..bridge.rig_mark import camera_behind
from .rig_data import CYCLES, rig_of


def engine_name(scene) -> str:
    """The name of a scene's render engine as the interface shows it."""
    render = scene.render
    return bpy.types.UILayout.enum_item_name(render, "engine", render.engine) or render.engine


def ignored_camera(scene):
    """The flexible camera that is a scene's camera while its render engine ignores the volume; else None."""
    camera = camera_behind(scene.camera)
    if camera is None or not camera.scfpf.enabled or scene.render.engine == ENGINE:
        return None
    rig = rig_of(scene)
    if scene.render.engine == CYCLES and rig is not None and rig.scfpf_rig.view_camera == scene.camera:
        return None
    return camera


def ignored_text(scene) -> str:
    """The message about ``ignored_camera``, "" if there is none."""
    camera = ignored_camera(scene)
    if camera is None:
        return ""
    return (
        f"{engine_name(scene)} ignores the volume of '{camera.name}': choose SCFPF as render engine, "
        "or press Render with Cycles in the camera's panel"
    )
