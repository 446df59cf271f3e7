# SPDX-License-Identifier: GPL-3.0-or-later
"""The files that an open .blend file uses: libraries, images, caches and all else that it does not hold."""

from __future__ import annotations

import os

import bpy

from .task_script import absent_paths, digest_of, files_at, files_below, used_paths
from .template import Asset

# Files of these kinds are compared by their content: one that changes in place may keep its size.
COMPARED = (".blend",)
# The folder of a file's particles, cloth and other point caches begins so.
POINT_CACHES = "blendcache_"


def assets_of(scene_file: str) -> tuple[list[Asset], list[str]]:
    """Return the files that the open file uses, sorted, and the paths of those that are absent.

    scene_file: its absolute path.
    """
    folder, found = os.path.dirname(scene_file), set[str]()
    for path in used_paths():
        found |= files_at(path)
    for directory in _cache_folders(scene_file):
        found |= files_below(directory)
    found.discard(scene_file)
    return [_asset(path, folder) for path in sorted(found)], absent_paths()


def _asset(path: str, folder: str) -> Asset:
    near = path.startswith(folder + os.sep)
    name = os.path.relpath(path, folder).replace(os.sep, "/") if near else path
    digest = digest_of(path) if path.endswith(COMPARED) else ""
    return Asset(name, os.path.getsize(path), digest)


def _cache_folders(scene_file: str) -> set[str]:
    """The folders of baked simulations."""
    stem = os.path.splitext(os.path.basename(scene_file))[0]
    found = {os.path.join(os.path.dirname(scene_file), POINT_CACHES + stem)}
    for obj in bpy.data.objects:
        for modifier in obj.modifiers:
            if modifier.type == "FLUID" and modifier.fluid_type == "DOMAIN":
                found.add(_absolute(modifier.domain_settings.cache_directory, obj))
            elif modifier.type == "NODES":
                found |= {_absolute(bake.directory, obj) for bake in modifier.bakes if bake.directory}
                found.add(_absolute(modifier.bake_directory, obj))
    return {path for path in found if path and os.path.isdir(path)}


def _absolute(path: str, obj) -> str:
    return os.path.normpath(bpy.path.abspath(path, library=obj.library)) if path else ""
