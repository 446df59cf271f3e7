# SPDX-License-Identifier: GPL-3.0-or-later
"""The picture as an image datablock, and as a file.

The datablock is float, scene-linear and premultiplied, shown through the scene's
view transform like a render. ``write_result`` packs it, which keeps it bit for bit
through save, reload and undo, up to 2 GB; whoever calls it makes one undo push afterwards, or
undoing something else takes the picture away.
``result_undo`` shows what undo brings back.
"""

from __future__ import annotations

import os
from contextlib import contextmanager
from pathlib import Path

import bpy
import numpy as np
from numpy.typing import NDArray

from ..blender import versions
from ..blender.atomic_files import is_whole_picture, replacing, require_writable, reserve
from ..blender.packing import pack

IMAGE_NAME = "SCFPF Render"

# Image.depth of four float32 channels.
FLOAT_RGBA_BITS = 128

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

# Bytes a pixel that a WebP takes at most, with room to spare. Blender 5.2 crashes where it finds no room.
WEBP_BYTES = 5
CUT_OFF = "the file is incomplete, as on a full disk: free some space, or write to another disk"


class ResultError(ValueError):
    """A picture cannot be written; the message says why."""


def result_image():
    """The image datablock of the last render, or None."""
    return bpy.data.images.get((IMAGE_NAME, None))


def write_result(pixels: NDArray[np.float32]):
    """Make the finished picture the image datablock's content; returns the datablock.

    pixels: (H, W, 4) float32, scene-linear, premultiplied, row 0 at the bottom. An
    existing datablock is kept and resized, so that editors go on showing it.
    """
    show_progress(pixels)
    keep_result()
    return result_image()


def keep_result() -> str:
    """Pack what ``show_progress`` showed last; what to tell the user where it is too large for that, else ''.

    The file is as large as the picture: whoever can lets go of the pixels before.
    """
    return pack(result_image())


def show_progress(pixels: NDArray[np.float32]):
    """As ``write_result``, for a picture in the making: quicker, and lost on reload and undo."""
    height, width = pixels.shape[:2]
    image = _prepared_image(width, height)
    image.pixels.foreach_set(np.ascontiguousarray(pixels, np.float32).reshape(-1))
    image.update()
    redraw_image_editors()
    return image


def discard_progress() -> None:
    """Take back what ``show_progress`` showed: the last finished picture, or none."""
    image = result_image()
    if image is None:
        return
    if image.packed_file or image.filepath:
        image.buffers_free()
    else:
        bpy.data.images.remove(image)
    redraw_image_editors()


def redraw_image_editors() -> None:
    """Have every open Image Editor draw again."""
    for window in bpy.context.window_manager.windows:
        for area in window.screen.areas:
            if area.type == "IMAGE_EDITOR":
                area.tag_redraw()


def _prepared_image(width: int, height: int):
    """The datablock, as float buffer of the size wanted, with the settings of a render."""
    image = result_image()
    if image is not None and not (image.is_float and image.depth == FLOAT_RGBA_BITS):
        # Somebody's picture by this name, or one whose file is gone: it cannot hold ours.
        image.name = f"{IMAGE_NAME} (other)"
        image = None
    if image is None:
        image = bpy.data.images.new(IMAGE_NAME, width, height, alpha=True, float_buffer=True)
    _set(image, "alpha_mode", "PREMUL")
    _set(image, "colorspace_settings.name", _scene_linear())
    if tuple(image.size) != (width, height):
        image.scale(width, height)
    image.use_view_as_render = True
    # Without a user the datablock would be dropped when the file is saved.
    image.use_fake_user = True
    return image


def _set(image, path: str, value: str) -> None:
    """Set a property if it differs: Blender reloads the image's buffer whenever it is set."""
    if image.path_resolve(path) != value:
        owner, _, name = path.rpartition(".")
        setattr(image.path_resolve(owner) if owner else image, name, value)


def _scene_linear() -> str:
    """The name of the file's working colour space: what Blender gives a new float image."""
    probe = bpy.data.images.new(IMAGE_NAME, 1, 1, float_buffer=True)
    name = probe.colorspace_settings.name
    bpy.data.images.remove(probe)
    return name


def with_ending(path: str, scene) -> str:
    """A path with the ending that names its format: its own, else that of the scene's output.

    Raises ResultError for one that is not known.
    """
    if not os.path.splitext(path)[1]:
        path += scene.render.file_extension
    if os.path.splitext(path)[1].lower() not in FILE_FORMATS:
        raise ResultError(f"Cannot write '{path}': use one of {', '.join(FILE_FORMATS)}")
    return path


def require_place(path: str) -> None:
    """Raise ResultError if no picture can be written to a path, absolute and with its ending."""
    folder = os.path.dirname(path) or "."
    if not os.path.isdir(folder):
        raise ResultError(f"Cannot write '{path}': there is no folder '{folder}'")
    if os.path.isdir(path):
        raise ResultError(f"Cannot write '{path}': it is a folder")
    try:
        require_writable(Path(path))
    except OSError as error:
        raise ResultError(f"Cannot write '{path}': {error.strerror or error}") from error


def save_result(image, path: str, scene) -> str:
    """Write the picture to a file through the scene's view transform; returns the path written.

    The extension of ``path`` chooses the format; the scene's own output settings
    count where they are of that format, and where there is no extension (theirs is
    added). EXR keeps scene-linear values. Raises ResultError for an extension that
    is not known or a path that cannot be written, and if the written file is not whole, as on a full
    disk; the earlier file at that path stays as it was then. A symbolic link there keeps its target's place.
    """
    path = with_ending(bpy.path.abspath(path), scene)
    require_place(path)
    extension = os.path.splitext(path)[1].lower()
    try:
        with (
            replacing(Path(os.path.realpath(path))) as part,
            _output_format(scene.render.image_settings, *FILE_FORMATS[extension]),
        ):
            if extension == ".webp":
                reserve(part, image.size[0] * image.size[1] * WEBP_BYTES)
            image.save_render(str(part), scene=scene)
            # Blender says nothing of a PNG, a TIFF or a WebP that it could not write to the end.
            if not is_whole_picture(part):
                raise ResultError(f"Cannot write '{path}': {CUT_OFF}")
    except RuntimeError as error:
        reason = str(error).splitlines()[0].removeprefix("Error: ")
        raise ResultError(f"Cannot write '{path}': {reason}") from error
    except OSError as error:
        raise ResultError(f"Cannot write '{path}': {error.strerror or error}") from error
    return path


@contextmanager
def _output_format(settings, file_format: str, color_mode: str, color_depth: str):
    """The scene's output settings changed to a format, unless they are of it already."""
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
