# SPDX-License-Identifier: GPL-3.0-or-later
"""Registration of the types that Blender's render job may be reading in its thread.

Python cannot end a job of another engine. Types stay registered until the job has ended, or Blender would
crash when it evaluates a driver or calls the engine.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from types import ModuleType

import bpy

from . import render_engine

# Seconds between two checks of the job.
TICK = 0.2

# The modules whose types are to be unregistered when the job ends, and functions to be called before.
_waiting: list[ModuleType] = []
_closing: list[Callable[[], None]] = []


def when_idle(function: Callable[[], None]) -> None:
    """Call a function once no render job runs: at once, or later, while the types are still registered."""
    _closing.append(function)
    if not bpy.app.is_job_running("RENDER"):
        _close()
    elif not bpy.app.timers.is_registered(_finish):
        bpy.app.timers.register(_finish, first_interval=TICK, persistent=True)


def _close() -> None:
    while _closing:
        _closing.pop()()


def register_types(modules: Sequence[ModuleType]) -> None:
    """Register modules in this order, unless they still wait for a job and are registered."""
    if _waiting:
        _waiting.clear()
        return
    for module in modules:
        module.register()


def unregister_types(modules: Sequence[ModuleType]) -> None:
    """Unregister modules in reverse order, after a running render job; a job of this engine is cancelled."""
    _waiting[:] = modules
    if not bpy.app.is_job_running("RENDER"):
        _finish()
        return
    render_engine.give_up()
    if not bpy.app.timers.is_registered(_finish):
        bpy.app.timers.register(_finish, first_interval=TICK, persistent=True)


def _finish() -> float | None:
    """Unregister the waiting modules once no job runs; a timer's function."""
    if bpy.app.is_job_running("RENDER"):
        return TICK
    render_engine.go_on()
    _close()
    while _waiting:
        _waiting.pop().unregister()
    return None
