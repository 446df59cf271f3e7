# SPDX-License-Identifier: GPL-3.0-or-later
"""Registering and unregistering the types that Blender's render job may be reading in its thread.

Python cannot end a job of another engine. Types stay registered until it has ended; Blender would crash
where a driver or the engine itself is read meanwhile.
"""

from __future__ import annotations

from collections.abc import Sequence
from types import ModuleType

import bpy

from . import render_engine

# Seconds between two looks at the job.
TICK = 0.2

# The modules whose types wait for the end of a job to be unregistered.
_waiting: list[ModuleType] = []


def register_types(modules: Sequence[ModuleType]) -> None:
    """Register modules in this order; those that still wait for a job are registered already."""
    if _waiting:
        _waiting.clear()
        return
    for module in modules:
        module.register()


def unregister_types(modules: Sequence[ModuleType]) -> None:
    """Unregister modules in the reverse order, after the render job if one runs; SCFPF's own is ended."""
    _waiting[:] = modules
    if not bpy.app.is_job_running("RENDER"):
        _finish()
        return
    render_engine.give_up()
    if not bpy.app.timers.is_registered(_finish):
        bpy.app.timers.register(_finish, first_interval=TICK, persistent=True)


def _finish() -> float | None:
    """Unregister what waits once no job runs; a timer's function."""
    if bpy.app.is_job_running("RENDER"):
        return TICK
    render_engine.go_on()
    while _waiting:
        _waiting.pop().unregister()
    return None
