# SPDX-License-Identifier: GPL-3.0-or-later
"""A camera's volume as a preset, and the folder in which an artist's own presets are kept."""

from __future__ import annotations

import itertools
import pathlib
import re

import bpy
import numpy as np

from ...projection.editing.volume_edits import EditingError
from ...projection.file_limits import read_bytes
from ...projection.presets.preset import Preset, PresetError, load_preset, preset_to_json, read_preset
from ...projection.presets.thumbnail import png, png_size, volume_picture
from ...projection.presets.writing import stored_surface
from ...projection.surfaces.kinds import FILE_KINDS, SURFACE_KINDS
from ...projection.volume.viewing_volume import Projection
from ..blender.atomic_files import replacing
from ..blender.mesh_grid import SurfaceError
from ..mappings.read_mappings import stored_mappings
from ..surfaces.surface_object import surface_parameters
from .read_projection import read_projection

# The extension's package: bl_ext.<repository>.scfpf.
PACKAGE = __package__.partition(".scfpf_addon")[0]
FOLDER_NAME = "presets"
# What Blender adds to the names of copies.
NUMBERED = re.compile(r"\.\d{3}$")
# Parameters that are angles, radians.
ANGLES = {one.name for kind in SURFACE_KINDS.values() for one in kind.parameters if one.is_angle}
# Of the names of files: what every system takes, and no more than so many letters.
UNSAFE, LONGEST_STEM = re.compile(r"[^a-z0-9]+"), 60
# Windows has devices of these names.
RESERVED = re.compile(r"con|prn|aux|nul|(com|lpt)[0-9]")
# Of pictures beside presets, which may come from elsewhere: pixels along a side, and bytes.
LARGEST_PICTURE, MOST_PICTURE_BYTES = 256, 2**18
# More files than this are not listed.
MOST_PRESETS = 500


def preset_of(camera, depsgraph, aspect: float, name: str, description: str = "", group: str = "") -> Preset:
    """The camera's present volume and mappings as a preset, as evaluated.

    aspect: of the picture. What a file cannot hold as it is becomes a grid. Raises PresetError,
    ProjectionError or MappingError.
    """
    projection = read_projection(camera, depsgraph, aspect)
    settings = camera.evaluated_get(depsgraph).scfpf
    world = np.array(camera.evaluated_get(depsgraph).matrix_world, np.float64)
    try:
        inward = np.linalg.inv(world)
    except np.linalg.LinAlgError as error:
        raise PresetError(f"'{camera.name}' has a scale of 0: clear it with Alt-S") from error
    try:
        surfaces = _surfaces(camera, depsgraph, projection.transformed(inward), inward)
    except EditingError as error:
        raise PresetError(f"The volume cannot be saved: {error}") from error
    preset = Preset(
        name=name.strip(),
        description=description.strip(),
        source="",
        basis=projection.volume.basis,
        reparameterisation=settings.reparameterisation,
        u_range=projection.u_range,
        v_range=projection.v_range,
        aspect=aspect,
        fit=settings.fit,
        surfaces=surfaces,
        group=group.strip(),
        mappings=stored_mappings(camera, depsgraph),
    )
    # Read back, so that what is written is what every reader takes.
    return load_preset(preset_to_json(preset))


def _surfaces(camera, depsgraph, projection: Projection, inward):
    slots = camera.original.scfpf.surfaces
    volume = projection.volume
    if len(slots) != len(volume.surfaces):
        # Layers of lattices.
        names = [f"Layer {number}" for number in range(1, len(volume.surfaces) + 1)]
        weights = volume.weights or [1.0] * len(names)
        return tuple(
            stored_surface(name, surface, weight)
            for name, surface, weight in zip(names, volume.surfaces, weights, strict=True)
        )
    stored = []
    evaluated = camera.evaluated_get(depsgraph).scfpf.surfaces
    for slot, now, surface in zip(slots, evaluated, volume.surfaces, strict=True):
        obj = slot.object
        kind, described = obj.scfpf_surface.kind, {}
        if kind == "UV_MESH":
            described = {"kind": kind}
        elif kind in FILE_KINDS:
            seen = obj.evaluated_get(depsgraph)
            try:
                parameters = surface_parameters(seen)
            except SurfaceError:
                parameters = None
            if parameters is not None:
                points = parameters.pop("points", None)
                matrix = inward @ np.array(seen.matrix_world, np.float64)
                parameters = {key: _short(key, value) for key, value in parameters.items()}
                described = {"kind": kind, "parameters": parameters, "points": points, "matrix": matrix}
        stored.append(stored_surface(NUMBERED.sub("", obj.name), surface, now.weight, **described))
    return tuple(stored)


def _short(key: str, value: float) -> float:
    """A float32 as the number that it stands for: a full turn is not 360.00001 degrees."""
    if key in ANGLES:
        return float(np.radians(float(f"{np.degrees(value):.7g}")))
    return float(f"{value:.7g}")


def own_folder(create: bool = False) -> pathlib.Path:
    """The folder of an artist's own presets: the extension's folder for user files. Raises PresetError."""
    try:
        return pathlib.Path(bpy.utils.extension_path_user(PACKAGE, path=FOLDER_NAME, create=create))
    except (OSError, ValueError) as error:
        raise PresetError(f"There is no folder for presets: {error}") from error


def own_files() -> list[pathlib.Path]:
    """The artist's own preset files, by name."""
    try:
        folder = own_folder()
    except PresetError:
        return []
    return sorted(folder.glob("*.json"))[:MOST_PRESETS] if folder.is_dir() else []


def own_file(stem: str) -> pathlib.Path:
    """An own preset by the name of its file without its ending. Raises PresetError if there is none."""
    found = next((path for path in own_files() if path.stem == stem), None)
    if found is None:
        raise PresetError(f"There is no preset '{stem}' of your own: choose another one")
    return found


def stem_of(name: str) -> str:
    """The file's name for a preset's name."""
    stem = UNSAFE.sub("_", name.lower()).strip("_")[:LONGEST_STEM] or "preset"
    return f"{stem}_preset" if RESERVED.fullmatch(stem) else stem


def store_own(preset: Preset, replace: bool) -> pathlib.Path:
    """Write a preset into the folder of own ones. Raises PresetError where another must stay."""
    path, is_taken = _own_place(preset.name)
    if is_taken and not replace:
        raise PresetError(f"You have a preset '{preset.name}' already: choose another name, or tick Replace")
    write_preset(preset, path)
    return path


def _own_place(name: str) -> tuple[pathlib.Path, bool]:
    """The file for an own preset of a name, and whether that is there; others of the same letters stay.

    Names of files hold few letters: all that is written in Chinese, say, begins with the same one.
    """
    folder, stem = own_folder(create=True), stem_of(name)
    for number in itertools.count(1):
        path = folder / (f"{stem}.json" if number == 1 else f"{stem}_{number}.json")
        if not path.exists():
            return path, False
        if _name_in(path).casefold() == name.casefold():
            return path, True


def _name_in(path: pathlib.Path) -> str:
    """The name of the preset in a file; of one that cannot be read, none."""
    try:
        return read_preset(path).name
    except PresetError:
        return ""


def write_preset(preset: Preset, path: pathlib.Path) -> None:
    """Write a preset file, whole or not at all. Raises PresetError."""
    _write(preset_to_json(preset).encode(), path)


def store_picture(preset: Preset, path: pathlib.Path) -> None:
    """Write a small picture of a preset's volume beside its file, for menus. Raises PresetError."""
    _write(png(volume_picture(preset.projection(preset.aspect))), path.with_suffix(".png"))


def _write(data: bytes, path: pathlib.Path) -> None:
    try:
        with replacing(path) as part:
            part.write_bytes(data)
    except OSError as error:
        raise PresetError(f"Cannot write {path}: {error.strerror or error}") from error


def own_picture(stem: str) -> tuple[pathlib.Path, int] | None:
    """An own preset's picture and its time, None where there is none that is one and small."""
    path = own_folder() / f"{stem}.png"
    try:
        facts = path.stat()
        size = png_size(read_bytes(path, 24))
    except OSError:
        return None
    if size is None or not 0 < max(size) <= LARGEST_PICTURE or facts.st_size > MOST_PICTURE_BYTES:
        return None
    return path, facts.st_mtime_ns


def remove_own(stem: str) -> None:
    """Delete an own preset's file and its picture. Raises PresetError."""
    path = own_file(stem)
    try:
        path.with_suffix(".png").unlink(missing_ok=True)
        path.unlink()
    except OSError as error:
        raise PresetError(f"Cannot remove {path}: {error.strerror or error}") from error
