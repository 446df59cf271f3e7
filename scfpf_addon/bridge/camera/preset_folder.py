# SPDX-License-Identifier: GPL-3.0-or-later
"""The folder in which an artist's own presets are kept, with a thumbnail of each."""

from __future__ import annotations

import itertools
import pathlib
import re

import bpy

from ...projection.file_limits import read_bytes
from ...projection.presets.preset import Preset, PresetError, preset_to_json, read_preset
from ...projection.presets.thumbnail import png, png_size, volume_thumbnail
from ..blender.atomic_files import replacing

# The extension's package: bl_ext.<repository>.scfpf.
PACKAGE = __package__.partition(".scfpf_addon")[0]
FOLDER_NAME = "presets"
# Characters that some systems do not allow in file names, and the most letters of a stem.
UNSAFE, LONGEST_STEM = re.compile(r"[^a-z0-9]+"), 60
# Names of devices in Windows.
RESERVED = re.compile(r"con|prn|aux|nul|(com|lpt)[0-9]")
# Limits of thumbnails, which may come from elsewhere: pixels along a side, and bytes.
LARGEST_THUMBNAIL, MOST_THUMBNAIL_BYTES = 256, 2**18
# At most so many files are listed.
MOST_PRESETS = 500


def own_folder(create: bool = False) -> pathlib.Path:
    """The folder of an artist's own presets, in the extension's folder for user files. Raises PresetError."""
    try:
        return pathlib.Path(bpy.utils.extension_path_user(PACKAGE, path=FOLDER_NAME, create=create))
    except (OSError, ValueError) as error:
        raise PresetError("There is no folder for presets: {0}", error) from error


def own_files() -> list[pathlib.Path]:
    """The artist's own preset files, by name."""
    try:
        folder = own_folder()
    except PresetError:
        return []
    return sorted(folder.glob("*.json"))[:MOST_PRESETS] if folder.is_dir() else []


def own_file(stem: str) -> pathlib.Path:
    """The file of an own preset by its stem. Raises PresetError if it does not exist."""
    found = next((path for path in own_files() if path.stem == stem), None)
    if found is None:
        raise PresetError("There is no preset '{0}' of your own: choose another one", stem)
    return found


def stem_of(name: str) -> str:
    """The stem of the file for a preset's name."""
    stem = UNSAFE.sub("_", name.lower()).strip("_")[:LONGEST_STEM] or "preset"
    return f"{stem}_preset" if RESERVED.fullmatch(stem) else stem


def store_own(preset: Preset, replace: bool) -> pathlib.Path:
    """Write a preset into the folder of own ones.

    Raises PresetError if a preset of that name exists and ``replace`` is false.
    """
    path, is_taken = _own_place(preset.name)
    if is_taken and not replace:
        raise PresetError(
            "You have a preset '{0}' already: choose another name, or tick Replace", preset.name
        )
    write_preset(preset, path)
    return path


def _own_place(name: str) -> tuple[pathlib.Path, bool]:
    """The file for an own preset of a name, and whether it exists.

    Names of files hold few letters, so that different names may have the same stem: a number then follows.
    """
    folder, stem = own_folder(create=True), stem_of(name)
    for number in itertools.count(1):
        path = folder / (f"{stem}.json" if number == 1 else f"{stem}_{number}.json")
        if not path.exists():
            return path, False
        if _name_in(path).casefold() == name.casefold():
            return path, True


def _name_in(path: pathlib.Path) -> str:
    """The name of the preset in a file, "" if the file cannot be read."""
    try:
        return read_preset(path).name
    except PresetError:
        return ""


def write_preset(preset: Preset, path: pathlib.Path) -> None:
    """Write a preset file completely or not at all. Raises PresetError."""
    _write(preset_to_json(preset).encode(), path)


def store_thumbnail(preset: Preset, path: pathlib.Path) -> None:
    """Write a small image of a preset's volume beside its file, for menus. Raises PresetError."""
    _write(png(volume_thumbnail(preset.projection(preset.aspect))), path.with_suffix(".png"))


def _write(data: bytes, path: pathlib.Path) -> None:
    try:
        with replacing(path) as part:
            part.write_bytes(data)
    except OSError as error:
        raise PresetError("Cannot write {0}: {1}", path, error.strerror or error) from error


def thumbnail_file(stem: str) -> tuple[pathlib.Path, int] | None:
    """The thumbnail of an own preset and its modification time, None without a valid, small image."""
    path = own_folder() / f"{stem}.png"
    try:
        facts = path.stat()
        size = png_size(read_bytes(path, 24))
    except OSError:
        return None
    if size is None or not 0 < max(size) <= LARGEST_THUMBNAIL or facts.st_size > MOST_THUMBNAIL_BYTES:
        return None
    return path, facts.st_mtime_ns


def remove_own(stem: str) -> None:
    """Delete the file and the thumbnail of an own preset. Raises PresetError."""
    path = own_file(stem)
    try:
        path.with_suffix(".png").unlink(missing_ok=True)
        path.unlink()
    except OSError as error:
        raise PresetError("Cannot remove {0}: {1}", path, error.strerror or error) from error
