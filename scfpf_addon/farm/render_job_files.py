# SPDX-License-Identifier: GPL-3.0-or-later
"""A render job of an open .blend file: planned, priced by one picture, and written as a folder."""

from __future__ import annotations

import os
import shutil
import subprocess
import sys
import tempfile
import time
from argparse import Namespace
from pathlib import Path

import bpy

from ..bridge.blender import versions
from ..bridge.blender.atomic_files import replacing
from ..bridge.render.command_line import frames_of
from ..bridge.render.image_file import FILE_FORMATS
from ..bridge.render.image_size import image_size
from ..cycles.rig_data import CYCLES, rig_of
from ..projection.user_error import Message, UserError
from . import flamenco, task_script
from .archive import found_zip, require_zip
from .assets import assets_of
from .template import WAYS, Asset, RenderPlan, bundle, requirements_text

NOT_SAVED = "Save the file first: a render job names it"
# The memory that a worker needs, as a multiple of the most that the priced picture took.
MARGIN = 1.25


def plan_job(scene, options: Namespace) -> tuple[RenderPlan, list[Message]]:
    """The plan of a job for the open, saved file, and what should be known about it.

    options: way, chunk, tiles, camera, resume and blender as in ``RenderPlan``, chunk None for the usual one;
    frames as of ``command_line.frames_of``; extension: the path of its zip, None for one beside the file, if
    there is one. Raises UserError.
    """
    path = bpy.data.filepath
    if not path:
        raise UserError(NOT_SAVED)
    path = os.path.abspath(path)
    frames = frames_of(scene, options.frames)
    _require_way(scene, options.way)
    warnings = _require_tiles(scene, options)
    assets, absent = assets_of(path)
    warnings += [Message("The file uses '{0}', which is absent", name) for name in absent]
    version = task_script.version_of(task_script.extension()) if WAYS[options.way].extension else ""
    plan = RenderPlan(
        path,
        Asset(path, os.path.getsize(path), task_script.digest_of(path)),
        options.way,
        (frames.start, frames.stop - 1),
        frames.step,
        options.chunk or WAYS[options.way].chunk,
        options.tiles,
        options.camera or "",
        resume=options.resume,
        blender=options.blender,
        version=f"{bpy.app.version[0]}.{bpy.app.version[1]}",
        extension=version,
        archive=_archive(options, path, version),
        skips=tuple(task_script.skips_of_file()) if options.way == "cycles" else (),
        assets=tuple(assets),
        absent=tuple(absent),
    )
    return plan, warnings


def _archive(options: Namespace, scene_file: str, version: str) -> Asset | None:
    """The zip of the extension that a job takes along, None for none. Raises UserError."""
    if not version:
        if options.extension:
            raise UserError("A rig needs no extension: leave its zip out, or choose another way than cycles")
        return None
    path = options.extension or found_zip(os.path.dirname(scene_file), version)
    if not path:
        return None
    path = require_zip(bpy.path.abspath(path), version)
    return Asset(path, os.path.getsize(path), task_script.digest_of(path))


def _require_way(scene, way: str) -> None:
    """Raise UserError if the scene cannot be rendered so."""
    if scene.render.is_movie_format:
        raise UserError("Choose a format of pictures in Output Properties: tasks cannot share a movie")
    if way == "cycles":
        rig = rig_of(scene)
        if rig is None or scene.camera != rig.scfpf_rig.view_camera or scene.render.engine != CYCLES:
            raise UserError("The file has no Cycles rig: press Cycles in the camera's panel and save it")
    elif way in task_script.COMMANDS and scene.render.file_extension not in FILE_FORMATS:
        raise UserError(
            "Cannot write '{0}': use one of {1}", scene.render.file_extension, ", ".join(FILE_FORMATS)
        )


def _require_tiles(scene, options: Namespace) -> list[Message]:
    """Raise UserError if pictures cannot be rendered in tiles; return what tiles change."""
    if options.tiles == (1, 1):
        return []
    render, warnings = scene.render, []
    if not WAYS[options.way].tiles:
        raise UserError(
            "Tiles need the way engine, cycles or layers: '{0}' joins whole pictures", WAYS[options.way].title
        )
    editor = scene.sequence_editor
    if render.use_sequencer and editor is not None and len(versions.strips(editor)):
        raise UserError(
            "Tiles are of the scene: switch the sequencer off in Output Properties > Post Processing"
        )
    if render.use_freestyle and options.way != "layers":
        raise UserError(
            "Freestyle draws its lines over whole pictures: switch it off, or render without tiles"
        )
    width, height = image_size(scene)
    if options.tiles[0] > width or options.tiles[1] > height:
        raise UserError("A picture of {0} × {1} pixels has fewer pixels than tiles", width, height)
    if options.way != "engine" and scene.cycles.use_denoising:
        warnings.append(Message("Each tile is denoised by itself, which may show at their edges"))
    if render.use_border:
        warnings.append(Message("The render region is left out: tiles cover the whole picture"))
    return warnings


def priced(plan: RenderPlan) -> tuple[RenderPlan, float, float]:
    """Render a picture of the middle of a job, or a tile of one, as a task would.

    Return the plan with the memory that it took, the seconds until it began, and those of the picture. The
    open file is read again. Raises UserError.
    """
    middle = sum(plan.frames) // 2
    with tempfile.TemporaryDirectory(ignore_cleanup_errors=True) as folder:
        require = Path(folder, "require.json")
        require.write_text(requirements_text(plan), encoding="utf-8")
        words = ["render", f"--way={plan.way}", f"--scene={plan.scene}", f"--output={folder}"]
        words += ["--name=price", f"--first={middle}", f"--last={middle}", f"--require={require}"]
        words += [f"--tiles={plan.tiles[0]}x{plan.tiles[1]}"]
        words += [f"--tile={plan.tiles[0] * plan.tiles[1] // 2}"]
        opening = _opened(plan.scene)
        begun = time.monotonic()
        if task_script.run(words) != 0:
            raise UserError("The picture that tells the price cannot be rendered: see above")
        # The task has opened the file, too; the first time may read it from a slow disk.
        seconds = max(time.monotonic() - begun - min(opening, _opened(plan.scene)), 0.0)
    return plan._replace(memory=int(MARGIN * _peak())), opening + _starting(), seconds


def _starting() -> float:
    """The seconds that Blender takes to start, 0 if Blender is a module of Python."""
    if not bpy.app.binary_path:
        return 0.0
    begun = time.monotonic()
    subprocess.run(
        [bpy.app.binary_path, "--background", "--python-expr", "pass"],
        stdout=subprocess.DEVNULL,
        stderr=subprocess.DEVNULL,
        check=False,
    )
    return time.monotonic() - begun


def _opened(scene_file: str) -> float:
    """Open a file, and return the seconds that it took."""
    begun = time.monotonic()
    bpy.ops.wm.open_mainfile(filepath=scene_file, load_ui=False)
    return time.monotonic() - begun


def _peak() -> int:
    """The most bytes that this process has held in memory, 0 where the system does not say."""
    try:
        import resource
    except ImportError:
        return 0
    most = resource.getrusage(resource.RUSAGE_SELF).ru_maxrss
    return most if sys.platform == "darwin" else 1024 * most


def write_job(plan: RenderPlan, folder: str) -> list[str]:
    """Write the files of a job into a folder, made if it is absent; return their paths. Raises UserError."""
    copied = [] if plan.archive is None else [_copy(plan.archive.path, folder)]
    return copied + _write(bundle(plan, os.path.abspath(folder)), folder)


def _copy(path: str, folder: str) -> str:
    """Copy a file into a folder, made if it is absent; return its path there. Raises UserError."""
    copy = Path(folder, os.path.basename(path))
    try:
        os.makedirs(folder, exist_ok=True)
        if not (copy.exists() and os.path.samefile(path, copy)):
            with replacing(copy) as part:
                shutil.copyfile(path, part)
    except OSError as error:
        raise UserError("Cannot write '{0}': {1}", folder, error.strerror or error) from error
    return str(copy)


def write_job_type(folder: str) -> str:
    """Write Flamenco's job type into a folder, made if it is absent; return its path. Raises UserError."""
    return _write({flamenco.NAME: flamenco.job_type()}, folder)[0]


def _write(files: dict[str, str], folder: str) -> list[str]:
    """Write texts into files of a folder; return their paths. Raises UserError."""
    written = []
    try:
        os.makedirs(folder, exist_ok=True)
        for name, text in files.items():
            path = Path(folder, name)
            with replacing(path) as part:
                part.write_text(text, encoding="utf-8")
            written.append(str(path))
    except OSError as error:
        raise UserError("Cannot write '{0}': {1}", folder, error.strerror or error) from error
    return written
