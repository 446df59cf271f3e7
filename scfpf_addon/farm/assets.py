# SPDX-License-Identifier: GPL-3.0-or-later
"""The files that an open .blend file uses: libraries, images, caches and all else that it does not hold."""

from __future__ import annotations

import os
import re

import bpy

from .task_script import digest_of
from .template import Asset

# The place of a tile's number in the path of a tiled image.
TILE = re.compile(r"<(?:UDIM|UVTILE)>")
# Files of these kinds are compared by their content: one that changes in place may keep its size.
COMPARED = (".blend",)
# The folder of a file's particles, cloth and other point caches begins so.
POINT_CACHES = "blendcache_"


def assets_of(scene_file: str) -> tuple[list[Asset], list[str]]:
    """Return the files that the open file uses, sorted, and the paths of those that are absent.

    scene_file: its absolute path.
    """
    folder, found, absent = os.path.dirname(scene_file), set[str](), []
    for path in sorted(set(bpy.utils.blend_paths(absolute=True, packed=False, local=False))):
        files = _files_at(os.path.normpath(path))
        found |= files
        if not files:
            absent.append(path)
    for directory in _cache_folders(scene_file):
        found |= _files_below(directory)
    found.discard(scene_file)
    return [_asset(path, folder) for path in sorted(found)], absent


def _asset(path: str, folder: str) -> Asset:
    near = path.startswith(folder + os.sep)
    name = os.path.relpath(path, folder).replace(os.sep, "/") if near else path
    digest = digest_of(path) if path.endswith(COMPARED) else ""
    return Asset(name, os.path.getsize(path), digest)


def _files_at(path: str) -> set[str]:
    """The files of a path: itself, the tiles of an image, or the pictures of a sequence that begins there."""
    if os.path.isdir(path):
        return _files_below(path)
    folder, name = os.path.split(path)
    if TILE.search(name):
        pattern = r"(?:\d{4}|u\d+_v\d+)".join(re.escape(part) for part in TILE.split(name))
        return _matching(folder, pattern)
    if not os.path.isfile(path):
        return set()
    if path not in _sequences():
        return {path}
    stem, ending = os.path.splitext(name)
    return _matching(folder, re.escape(stem.rstrip("0123456789")) + r"\d+" + re.escape(ending)) | {path}


def _sequences() -> set[str]:
    """The paths of images and movie clips that are sequences of pictures."""
    clips = [*bpy.data.images, *bpy.data.movieclips]
    return {
        os.path.normpath(bpy.path.abspath(clip.filepath, library=clip.library))
        for clip in clips
        if clip.source == "SEQUENCE"
    }


def _matching(folder: str, pattern: str) -> set[str]:
    if not os.path.isdir(folder):
        return set()
    names = [name for name in os.listdir(folder) if re.fullmatch(pattern, name)]
    return {os.path.join(folder, name) for name in names}


def _files_below(folder: str) -> set[str]:
    return {os.path.join(place, name) for place, _, names in os.walk(folder) for name in names}


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
