# SPDX-License-Identifier: GPL-3.0-or-later
"""``blender -c scfpf render FILE.blend -o OUT.png``: a render without a window."""

from __future__ import annotations

import argparse
import math
import os
import sys
import traceback
from collections.abc import Callable, Sequence
from pathlib import Path
from typing import NamedTuple

import bpy

from ...projection.user_error import UserError
from ..blender import versions
from ..blender.rig_mark import camera_behind
from ..blender.user_errors import USER_ERRORS, reason
from ..settings.stylised_styles import STYLES, apply_style
from .image_file import require_place, save_result, with_ending
from .render_inputs import prepare
from .render_job import RenderJob
from .result_image import write_result

# Blender's own limit, positive and negative.
LAST_FRAME = 1_048_574
# The exit status after an error that is not the user's.
BUG = 2


# The function that renders by Cycles, which is in a layer above: (camera, frames, path) to warnings, outcome.
CYCLES_RENDERS: list[Callable[..., tuple[list[str], str]]] = []
# The same by other engines: (engine, camera, frames, path).
ENGINE_RENDERS: list[Callable[..., tuple[list[str], str]]] = []


class Command(NamedTuple):
    """A command of a layer above. declare: adds its grammar, given the commands. execute: takes options."""

    declare: Callable[..., None]
    execute: Callable[..., None]


# Further commands by their names.
COMMANDS: dict[str, Command] = {}


class _Parser(argparse.ArgumentParser):
    def error(self, message):
        raise UserError(f"{message} (see {self.prog} --help)")


def _pixel_error(text: str) -> float:
    try:
        value = float(text)
    except ValueError:
        value = math.nan
    if not (math.isfinite(value) and value >= 0):
        raise argparse.ArgumentTypeError(f"{text!r} is not a number of pixels, 0 or more")
    return value


def frame_number(text: str) -> int:
    try:
        value = int(text)
    except ValueError:
        value = LAST_FRAME + 1
    if abs(value) > LAST_FRAME:
        raise argparse.ArgumentTypeError(f"{text!r} is not the number of a frame")
    return value


class _Frames(argparse.Action):
    """The first frame, the last one and, if given, the step."""

    def __call__(self, _parser, namespace, values, option_string=None):
        if len(values) not in (2, 3) or (len(values) == 3 and values[2] < 1):
            raise UserError(
                f"{option_string} needs a first frame, a last one, and at most a step of 1 or more"
            )
        setattr(namespace, self.dest, (*values, None)[:3])


def add_film_arguments(command: argparse.ArgumentParser, frames: str) -> None:
    """Declare what commands that render films have in common. frames: the help of --frames."""
    command.add_argument("file", metavar="FILE.blend", type=Path, help="the file to render")
    command.add_argument(
        "--frames",
        metavar="N",
        nargs="+",
        type=frame_number,
        action=_Frames,
        help=f"{frames}: the first, the last and the step (default: the scene's)",
    )
    command.add_argument(
        "--resume",
        action="store_true",
        help="keep pictures of --frames that exist, whatever the file says",
    )
    command.add_argument("--camera", metavar="NAME", help="the flexible camera (default: the scene's camera)")


def frames_of(scene, frames: tuple[int, int, int | None] | None) -> range:
    """The frames of a film. frames: those of --frames, None for the scene's. Raises UserError without any."""
    first, last, step = frames or (scene.frame_start, scene.frame_end, None)
    if last < first:
        raise UserError("The last frame {0} comes before the first one {1}", last, first)
    return range(first, last + 1, step or scene.frame_step)


def parser() -> argparse.ArgumentParser:
    """The grammar of the command."""
    top = _Parser(
        prog="blender -c scfpf", description="Flexible projection: pictures through modeled viewing volumes."
    )
    commands = top.add_subparsers(dest="command", required=True, metavar="COMMAND", parser_class=_Parser)
    render = commands.add_parser(
        "render",
        help="render a picture through a flexible camera",
        description="Render a picture through a flexible camera of a .blend file.",
    )
    add_film_arguments(
        render, "the frames of an animation, with --cycles or --engine; # in OUT stands for their digits"
    )
    render.add_argument(
        "-o",
        "--output",
        metavar="OUT.png",
        type=Path,
        required=True,
        help="the picture to write; its ending names the format",
    )
    render.add_argument(
        "--cycles",
        action="store_true",
        help="path-trace the picture and its layers by Cycles, with the file's settings of that",
    )
    render.add_argument(
        "--engine",
        choices=["eevee", "workbench", "scene"],
        help="join the picture from ordinary ones by this engine, or by that of the file's scene",
    )
    render.add_argument(
        "--frame", metavar="N", type=frame_number, help="the frame (default: the file's current one)"
    )
    render.add_argument(
        "--pixel-error",
        metavar="E",
        type=_pixel_error,
        help="how far a projector may be off, in pixels (default: the camera's own)",
    )
    render.add_argument(
        "--style",
        choices=[*(name.lower() for name in STYLES), "none"],
        help="draw the picture in a style, or not at all (default: as the file's scene says)",
    )
    for command in COMMANDS.values():
        command.declare(commands)
    return top


def run(argv: list[str]) -> int:
    """Execute a command line. Return 0, 1 after a one-line reason on stderr, or BUG after a traceback."""
    try:
        options = parser().parse_args(argv)
        if options.command in COMMANDS:
            COMMANDS[options.command].execute(options)
        else:
            _render(options)
    except SystemExit as left:  # argparse has shown its help.
        return int(left.code or 0)
    except USER_ERRORS as error:
        print(f"scfpf: {' '.join(reason(error).split())}", file=sys.stderr)
        return 1
    except Exception:
        traceback.print_exc()
        return BUG
    return 0


def _render(options) -> None:
    if os.path.isdir(options.output):
        raise UserError(f"cannot write {options.output}: it is a folder")
    scene = open_file(options.file)
    if options.engine and (options.style or options.pixel_error is not None):
        raise UserError(
            "--style and --pixel-error are for Flexible Projection's own engine, not for --engine"
        )
    if options.cycles and options.engine:
        raise UserError("--cycles and --engine exclude each other")
    if options.frames and not (options.cycles or options.engine):
        raise UserError(
            "--frames needs --cycles or --engine: for Flexible Projection's own engine use "
            "blender -b FILE -E SCFPF -a"
        )
    # A path that cannot be written is reported before the render.
    output = with_ending(str(options.output.absolute()), scene)
    require_place(output)
    if options.frame is not None:
        scene.frame_set(options.frame)
    if options.style == "none":
        scene.scfpf_drawn.use_drawn = False
    elif options.style:
        apply_style(scene, options.style.upper())
    if options.resume:
        scene.render.use_overwrite = False
    if options.cycles or options.engine:
        frames = frames_of(scene, options.frames) if options.frames else ()
        render_by_others(scene, options.camera, options.engine or "cycles", frames, output)
        return
    inputs = prepare(scene, bpy.context.view_layer, named_camera(scene, options.camera), options.pixel_error)
    for warning in inputs.scene.warnings:
        print(f"scfpf: warning: {warning}", file=sys.stderr)
    job = RenderJob(inputs)
    job.start()
    frame = job.result()
    path = save_result(write_result(frame.pixels), output, scene)
    print(f"scfpf: {path}: {frame.report.summary()}")


def render_by_others(scene, camera_name: str | None, engine: str, frames: Sequence[int], output: str) -> None:
    """Render files by Cycles, layers included, or by joining renders of another engine; print the outcome.

    camera_name: None for the camera of the scene. engine: "cycles", "eevee", "workbench", or "scene" for that
    of the scene. frames: none for the present one. output: the absolute path, # for digits. Raises UserError.
    """
    output = with_ending(output, scene)
    camera = named_camera(scene, camera_name)
    if engine == "cycles":
        warnings, outcome = CYCLES_RENDERS[0](camera, frames, output)
    else:
        engines = {"eevee": versions.EEVEE, "workbench": "BLENDER_WORKBENCH", "scene": ""}
        warnings, outcome = ENGINE_RENDERS[0](engines[engine], camera, frames, output)
    for warning in warnings:
        print(f"scfpf: warning: {warning}", file=sys.stderr)
    print(f"scfpf: {output}: {outcome}")


def open_file(path: Path):
    """Open a .blend file and return its scene. Raises UserError."""
    # os.path returns False where pathlib raises: a name that is too long, no permission.
    if not os.path.isfile(path):
        raise UserError(f"there is no file {path}")
    try:
        bpy.ops.wm.open_mainfile(filepath=str(path.absolute()), load_ui=False)
    except RuntimeError as error:
        why = str(error).removeprefix("Error: ").split(" in file ")[0]
        raise UserError(f"cannot open {path}: {why}") from error
    return bpy.context.scene


def named_camera(scene, name: str | None):
    """The flexible camera of a name; without one the scene's camera, or its only flexible one."""
    if name is not None:
        camera = scene.objects.get(name)
        if camera is None:
            raise UserError(f'the scene "{scene.name}" has no object "{name}"')
        if camera.type != "CAMERA" or not camera.scfpf.enabled:
            raise UserError(f'"{name}" is not a flexible camera')
        return camera
    flexible = [obj for obj in scene.objects if obj.type == "CAMERA" and obj.scfpf.enabled]
    camera = camera_behind(scene.camera)
    if camera in flexible:
        return camera
    if not flexible:
        raise UserError(f'the scene "{scene.name}" has no flexible camera')
    if len(flexible) > 1:
        names = ", ".join(each.name for each in flexible)
        raise UserError(f"the scene's camera is not flexible: name one with --camera ({names})")
    return flexible[0]


_handle = None


def register():
    global _handle
    _handle = bpy.utils.register_cli_command("scfpf", run)


def unregister():
    bpy.utils.unregister_cli_command(_handle)
