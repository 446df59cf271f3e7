# SPDX-License-Identifier: GPL-3.0-or-later
"""The choice of the render engine: whether F12 renders the volume, by itself or through the rig."""

from __future__ import annotations

import sys
from collections import deque

import bpy

from ..bridge.blender.rig_mark import camera_behind
from ..bridge.blender.user_errors import translated_report
from ..bridge.render.render_engine import ENGINE
from ..projection.user_error import Message
from .rig_data import CYCLES, rig_of

# Warnings that the main thread is to report: Blender tells of a render in the thread of its job.
warnings: deque[str] = deque()

# The warning about F12 through a rig in a stereoscopic scene.
ALIKE = Message(
    "The Cycles rig renders all views alike: press Render Both Eyes, render with Flexible Projection, or "
    "switch off Stereoscopy"
)


def engine_name(scene) -> str:
    """The name of a scene's render engine as the interface shows it."""
    render = scene.render
    return bpy.types.UILayout.enum_item_name(render, "engine", render.engine) or render.engine


def _is_rigged(scene) -> bool:
    """Return whether F12 renders a scene with Cycles through its rig."""
    rig = rig_of(scene)
    return scene.render.engine == CYCLES and rig is not None and rig.scfpf_rig.view_camera == scene.camera


def renders_by_cycles(scene, camera) -> bool:
    """Return whether F12 renders a flexible camera of a scene with Cycles through its rig."""
    return _is_rigged(scene) and camera_behind(scene.camera) == camera


def ignored_camera(scene):
    """The scene's flexible camera if the render engine ignores its volume, else None."""
    camera = camera_behind(scene.camera)
    if camera is None or not camera.scfpf.enabled or scene.render.engine == ENGINE:
        return None
    return None if _is_rigged(scene) else camera


def f12_warning(scene) -> str:
    """The message about what F12 ignores of a scene's flexible camera, its volume or its eyes; or empty."""
    camera = ignored_camera(scene)
    if camera is None:
        return ALIKE if scene.render.use_multiview and _is_rigged(scene) else ""
    return Message(
        "{0} ignores the volume of '{1}': choose Flexible Projection as render engine, "
        "or press Cycles or Render with EEVEE in the camera's panel",
        engine_name(scene),
        camera.name,
    )


def render_begins(scene) -> None:
    """Warn of what the render that begins ignores: in the background at once, else by ``warnings``."""
    message = f12_warning(scene)
    if not message:
        return
    if bpy.app.background:
        print(f"Flexible Projection: warning: {message}", file=sys.stderr)
    else:
        warnings.append(translated_report(message))
