# SPDX-License-Identifier: GPL-3.0-or-later
"""The cameras of the file, and the objects that their volumes and image mappings consist of."""

from __future__ import annotations

from collections.abc import Callable

import bpy


def all_cameras() -> list:
    """The camera objects of the file."""
    return [obj for obj in bpy.data.objects if obj.type == "CAMERA"]


def surfaces_of(camera) -> list:
    """The control surfaces of a camera from near to far, without empty places."""
    return [slot.object for slot in camera.scfpf.surfaces if slot.object is not None]


def grids_of(camera) -> list:
    """The meshes of a camera's deformed grids."""
    mappings = camera.scfpf.mappings
    return [mapping.grid for mapping in mappings if mapping.kind == "GRID" and mapping.grid is not None]


def cameras_with(obj, members_of: Callable = surfaces_of, cameras: list | None = None) -> list:
    """The cameras that have an object as a control surface, or as another kind of member.

    members_of: ``surfaces_of`` or ``grids_of``. cameras: those to search, None for all of the file.
    """
    return [camera for camera in (all_cameras() if cameras is None else cameras) if obj in members_of(camera)]
