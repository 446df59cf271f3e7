# SPDX-License-Identifier: GPL-3.0-or-later
"""``blender -c scfpf job FILE.blend -o DIR --way WAY``: a job for a render farm."""

from __future__ import annotations

import argparse
import os
import re
import sys
from pathlib import Path

from ..bridge.render.command_line import COMMANDS, Command, add_film_arguments, named_camera, open_file
from ..projection.user_error import UserError
from .render_job_files import plan_job, priced, write_job, write_job_type
from .template import WAYS, counted, needs_text, price_text


def _tiles(text: str) -> tuple[int, int]:
    found = re.fullmatch(r"([1-9]\d{0,2})x([1-9]\d{0,2})", text.lower())
    if found is None:
        raise argparse.ArgumentTypeError(f"{text!r} is not a number of columns and rows, such as 4x2")
    return int(found[1]), int(found[2])


def _chunk(text: str) -> int:
    if not re.fullmatch(r"[1-9]\d{0,5}", text):
        raise argparse.ArgumentTypeError(f"{text!r} is not a number of frames, 1 or more")
    return int(text)


def _declare_job(commands) -> None:
    job = commands.add_parser(
        "job",
        help="write a job for a render farm",
        description="Write a render job in the format of Open Job Description, and tell its price.",
    )
    add_film_arguments(job, "the frames of the film")
    job.add_argument(
        "-o",
        "--output",
        metavar="DIR",
        type=Path,
        required=True,
        help="the folder of the job, made if absent",
    )
    job.add_argument("--way", choices=list(WAYS), required=True, help="how pictures are rendered")
    job.add_argument(
        "--chunk", metavar="N", type=_chunk, help="pictures of a task (default: 5, or 32 with the way eevee)"
    )
    job.add_argument(
        "--tiles",
        metavar="CxR",
        type=_tiles,
        default=(1, 1),
        help="columns and rows of tiles that a huge picture is rendered in",
    )
    job.add_argument(
        "--extension",
        metavar="ZIP",
        help="the extension's zip, which workers without it load for their task (default: one of this "
        "version beside the file, if there is one)",
    )
    job.add_argument(
        "--blender", metavar="COMMAND", default="blender", help="Blender on workers (default: blender)"
    )
    job.add_argument(
        "--no-price", action="store_true", help="render no picture to tell the price and the memory"
    )


def _execute_job(options) -> None:
    """Write a job. Raises UserError."""
    if options.output.exists() and not options.output.is_dir():
        raise UserError(f"cannot write {options.output}: it is a file")
    scene = open_file(options.file)
    if options.way == "cycles" and options.camera:
        raise UserError("--camera is for the other ways: a rig belongs to its camera")
    if options.way != "cycles":
        camera = named_camera(scene, options.camera)
        options.camera = camera.name if camera != scene.camera else ""
    plan, warnings = plan_job(scene, options)
    for warning in warnings:
        print(f"scfpf: warning: {warning}", file=sys.stderr)
    price = ""
    if not options.no_price:
        plan, opening, seconds = priced(plan)
        price = price_text(plan, opening, seconds)
    folder = str(options.output)
    write_job(plan, folder)
    frames, tasks = counted(plan.frame_count, "frame"), counted(plan.task_count, "task")
    print(f"scfpf: {folder}: {frames} in {tasks} by {plan.way}")
    if plan.way == "cycles":
        for text in plan.skips or ("Rays travel all chords.",):
            print(f"scfpf: {text}")
    print(f"scfpf: {needs_text(plan)}")
    print(f"scfpf: {price}" if price else "scfpf: no picture was rendered to tell the price")
    template, values = (os.path.join(folder, name) for name in ("template.json", "parameters.json"))
    print(f"scfpf: try it: openjd run {template} --job-param file://{values}")


def _declare_flamenco(commands) -> None:
    flamenco = commands.add_parser(
        "flamenco",
        help="write a job type for Flamenco",
        description="Write the job type that Flamenco's manager loads from its folder scripts.",
    )
    flamenco.add_argument("-o", "--output", metavar="DIR", type=Path, required=True, help="the folder")


def _execute_flamenco(options) -> None:
    print(f"scfpf: {write_job_type(str(options.output))}: put it into Flamenco's folder scripts")


def register():
    COMMANDS["job"] = Command(_declare_job, _execute_job)
    COMMANDS["flamenco"] = Command(_declare_flamenco, _execute_flamenco)


def unregister():
    for name in ("job", "flamenco"):
        del COMMANDS[name]
