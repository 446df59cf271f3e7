# SPDX-License-Identifier: GPL-3.0-or-later
"""Files of images, written through the scene's view transform. Incomplete files replace no others."""

from __future__ import annotations

import os
import re
from contextlib import contextmanager
from pathlib import Path

import bpy

from ...projection.user_error import UserError
from ..blender import versions
from ..blender.atomic_files import is_complete_image, replacing, require_writable, reserve
from .dithered_file import is_dithered, save_dithered

# Extension → Blender's file format, colour channels and bits a channel.
FILE_FORMATS = {
    ".png": ("PNG", "RGBA", "8"),
    ".exr": ("OPEN_EXR", "RGBA", "32"),
    ".jpg": ("JPEG", "RGB", "8"),
    ".jpeg": ("JPEG", "RGB", "8"),
    ".tif": ("TIFF", "RGBA", "16"),
    ".tiff": ("TIFF", "RGBA", "16"),
    ".webp": ("WEBP", "RGBA", "8"),
}
# The file format of pictures with their passes.
MULTILAYER = "OPEN_EXR_MULTILAYER"

# Bytes of a WebP per pixel, at most, with a margin. Blender 5.2 crashes if the disk has no room for them.
WEBP_BYTES = 5
CUT_OFF = "the file is incomplete, as on a full disk: free some space, or write to another disk"


def with_ending(path: str, scene) -> str:
    """A path with the ending that names its format: its own, else that of the scene's output.

    Raises UserError for an unknown ending.
    """
    if not os.path.splitext(path)[1]:
        path += scene.render.file_extension
    if os.path.splitext(path)[1].lower() not in FILE_FORMATS:
        raise UserError("Cannot write '{0}': use one of {1}", path, ", ".join(FILE_FORMATS))
    return path


def frame_file(path: str, scene, frame: int, is_animation: bool) -> str:
    """The file of a frame, absolute and with its ending.

    path: its digits # stand for the frame; without any an animation's come at the end, as in Blender. Raises
    UserError for an unknown ending.
    """
    folder, name = os.path.split(bpy.path.abspath(path))
    stem, ending = os.path.splitext(name)
    if is_animation and "#" not in stem:
        stem += "####"
    stem = re.sub("#+", lambda found: f"{frame:0{len(found.group())}d}", stem, count=1)
    return with_ending(os.path.join(folder, stem + ending), scene)


def require_place(path: str) -> None:
    """Raise UserError if no image can be written to a path, absolute and with its ending."""
    folder = os.path.dirname(path) or "."
    if not os.path.isdir(folder):
        raise UserError("Cannot write '{0}': there is no folder '{1}'", path, folder)
    if os.path.isdir(path):
        raise UserError("Cannot write '{0}': it is a folder", path)
    try:
        require_writable(Path(path))
    except OSError as error:
        raise UserError("Cannot write '{0}': {1}", path, error.strerror or error) from error


def is_multilayer(path: str, scene) -> bool:
    """Return whether a file, with its ending, is to have the passes of a render, as the scene's output."""
    wanted = scene.render.image_settings.file_format == MULTILAYER
    return wanted and os.path.splitext(path)[1].lower() == ".exr"


def save_result(image, path: str, scene, with_passes: bool = False) -> str:
    """Write an image to a file through the scene's view transform, dithered as F12; return the path written.

    with_passes: write all passes of a multilayer image. The ending of ``path`` chooses the format. The
    scene's output settings apply if they are of that format; a path without an ending gets theirs. EXR keeps
    scene-linear values. A symbolic link stays one. Raises UserError for an unknown ending, a path that
    cannot be written, and an incomplete file, as on a full disk; then an earlier file at that path is
    unchanged.
    """
    path = with_ending(bpy.path.abspath(path), scene)
    require_place(path)
    extension = os.path.splitext(path)[1].lower()
    wanted = (MULTILAYER, "RGBA", "32") if with_passes else FILE_FORMATS[extension]
    try:
        with (
            replacing(Path(os.path.realpath(path))) as part,
            _output_format(scene.render.image_settings, *wanted),
        ):
            if extension == ".webp":
                reserve(part, image.size[0] * image.size[1] * WEBP_BYTES)
            if is_dithered(scene) and not with_passes:
                save_dithered(image, str(part), scene)
            else:
                image.save_render(str(part), scene=scene)
            # Blender reports no error for a PNG, a TIFF or a WebP that it could not write to the end.
            if not is_complete_image(part):
                raise UserError("Cannot write '{0}': {1}", path, CUT_OFF)
    except RuntimeError as error:
        reason = str(error).splitlines()[0].removeprefix("Error: ")
        raise UserError("Cannot write '{0}': {1}", path, reason) from error
    except OSError as error:
        raise UserError("Cannot write '{0}': {1}", path, error.strerror or error) from error
    return path


@contextmanager
def _output_format(settings, file_format: str, color_mode: str, color_depth: str):
    """Set the scene's output settings to a format, unless they have it already, and restore them."""
    if settings.file_format == file_format:
        yield
        return
    wanted = {
        "media_type": "IMAGE",
        "file_format": file_format,
        "color_mode": color_mode,
        "color_depth": color_depth,
    }
    names = versions.image_format_properties()
    before = {name: getattr(settings, name) for name in names}
    try:
        for name in names:
            setattr(settings, name, wanted[name])
        yield
    finally:
        for name in names:
            setattr(settings, name, before[name])
