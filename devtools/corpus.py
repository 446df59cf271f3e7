# SPDX-License-Identifier: GPL-3.0-or-later
"""Every .blend file of a folder through every way to an image, beside an ordinary Cycles camera.

    python3 dev.py corpus FOLDER [--output FOLDER] [--width N] [--samples N] [--limit SECONDS] [--only WAY]
                                 [--blender PATH]

The camera of each file's scene becomes flexible, with its own frustum as the volume: each image should be the
camera's. Each way runs in a Blender of its own, which is ended after the limit, so that a crash or an endless
render costs one row. A file whose camera is flexible keeps its volume, and is compared with the engine's
image. The output folder receives the images, the log of each Blender, report.json and
report.md. The files themselves are only read.
"""

from __future__ import annotations

import argparse
import json
import os
import pathlib
import re
import signal
import subprocess
import tempfile
import time
from typing import NamedTuple

from . import environments
from .environments import ROOT, Failure, say

# The ordinary camera comes first: the others are compared with its image.
WAYS = ("camera", "engine", "rig", "live", "nodes")
CASE = ROOT / "devtools" / "corpus_case.py"
# Lines of a log: after the first one warnings are those of the way, not of opening the file.
BEGINS, FIGURES = "@@ begins", "@@ figures "
WARNING = re.compile(r"^\s*(?:Warning|Error): (.+)$")
HEAD = ("file", "way", "seconds", "RMSE", "pixels off by 0.1", "coverage off", "outcome")
SHOWN_WARNINGS = 4


class Program(NamedTuple):
    """A Blender that runs scripts: its title, and the words before a script and before its arguments."""

    title: str
    script: tuple[str, ...]
    arguments: tuple[str, ...] = ()


def options(words: list[str]) -> argparse.Namespace:
    """The command line of `dev.py corpus`."""
    parser = argparse.ArgumentParser(prog="dev.py corpus", description=(__doc__ or "").splitlines()[0])
    parser.add_argument("folder", type=pathlib.Path, help="the folder with .blend files, and its subfolders")
    default = ROOT / "benchmarks" / "output" / "corpus"
    parser.add_argument("--output", type=pathlib.Path, default=default, help="where the report goes")
    parser.add_argument("--width", type=int, default=160, help="width of the images in pixels")
    parser.add_argument("--samples", type=int, default=16, help="samples of each pixel")
    parser.add_argument("--limit", type=float, default=180.0, help="seconds after which a Blender is ended")
    parser.add_argument("--blender", metavar="PATH", help="a Blender of your own instead of the module bpy")
    parser.add_argument("--only", choices=WAYS, action="append", help="only this way, beside the camera")
    return parser.parse_args(words)


def program(blender: str | None) -> Program:
    """The Blender at a path, or the newest supported one as a Python module."""
    if blender is None:
        environment = environments.first()
        return Program(environment.title, (environment.python,))
    words = ("--background", "--factory-startup", "--python-exit-code", "1", "--python")
    return Program(blender, (blender, *words), ("--",))


def run(words: list[str]) -> int:
    """Make the report. Returns 0 if no way crashed, ran out of time or raised an exception, else 1."""
    chosen = options(words)
    files = sorted(chosen.folder.rglob("*.blend"))
    if not files:
        raise Failure(f"{chosen.folder} holds no .blend file")
    rows = render(program(chosen.blender), files, chosen)
    say(f"the report is {chosen.output / 'report.md'}")
    return int(any(row["faults"] for row in rows))


def render(
    blender: Program, files: list[pathlib.Path], chosen: argparse.Namespace
) -> list[dict[str, object]]:
    """Render files in the chosen ways; each row of the result is written to the report at once."""
    ways = [way for way in WAYS if way == "camera" or not chosen.only or way in chosen.only]
    rows = []
    for file in files:
        name = file.relative_to(chosen.folder).as_posix()
        folder = chosen.output / re.sub(r"\W+", "_", name)
        folder.mkdir(parents=True, exist_ok=True)
        for way in ways:
            row = {"file": name, "way": way, **one(blender, file, way, folder, chosen)}
            say(" | ".join(cells(row)))
            rows.append(row)
            write(chosen.output, blender, chosen, rows)
    return rows


def one(
    blender: Program, file: pathlib.Path, way: str, folder: pathlib.Path, chosen: argparse.Namespace
) -> dict[str, object]:
    """The figures, warnings and faults of one way to an image of a file, in a process of its own.

    Faults are crashes, exceptions with a traceback, and a time that is over. Messages to the user are not.
    """
    arguments = [str(file.resolve()), way, str(folder.resolve()), str(chosen.width), str(chosen.samples)]
    command = [*blender.script, str(CASE), *blender.arguments, *arguments]
    log = folder / f"{way}.log"
    started = time.monotonic()
    with tempfile.TemporaryDirectory(prefix="scfpf-corpus-", ignore_cleanup_errors=True) as scratch:
        profile = pathlib.Path(scratch, "profile")
        profile.mkdir()  # Blender ignores a folder that does not exist.
        environ = {**os.environ, "BLENDER_USER_RESOURCES": str(profile)}
        with log.open("w", errors="replace") as output:
            streams = {"stdout": output, "stderr": subprocess.STDOUT}
            try:
                status = subprocess.call(command, cwd=ROOT, env=environ, timeout=chosen.limit, **streams)
            except subprocess.TimeoutExpired:
                status = None
    seconds = time.monotonic() - started
    return {**read_log(log.read_text(errors="replace"), status, chosen.limit), "process seconds": seconds}


def read_log(text: str, status: int | None, limit: float) -> dict[str, object]:
    """The figures, warnings and faults in a log. status: the process's exit code, None if it was ended."""
    _, _, said = text.partition(BEGINS)
    lines = said.splitlines()
    figures = next((json.loads(line[len(FIGURES) :]) for line in lines if line.startswith(FIGURES)), {})
    found = [match[1] for match in map(WARNING.match, lines) if match and "Traceback" not in match[1]]
    faults = []
    if status is None:
        faults.append(f"not done after {limit:.0f} s")
    elif status < 0:
        faults.append(f"CRASH: {signal.Signals(-status).name}")
    elif not figures:
        faults.append(f"exit code {status}")
    if "Traceback (most recent call last)" in text:
        ends = re.findall(r"^(?:\w+\.)*\w*(?:Error|Exception|Interrupt)\b.*$", text, re.MULTILINE)
        faults.append(f"TRACEBACK: {ends[-1] if ends else 'see the log'}")
    return {"figures": figures, "warnings": list(dict.fromkeys(found)), "faults": faults}


def cells(row: dict[str, object]) -> list[str]:
    """The cells of a row of the table, as in HEAD."""
    figures = row["figures"]
    outcome = [*row["faults"], *([figures["outcome"]] if figures.get("outcome") else [])]
    warnings = row["warnings"]
    outcome += warnings[:SHOWN_WARNINGS]
    if len(warnings) > SHOWN_WARNINGS:
        outcome.append(f"{len(warnings) - SHOWN_WARNINGS} more warnings")
    numbers = (("seconds", "{:.2f}"), ("rmse", "{:.4f}"), ("off", "{:.2%}"), ("coverage", "{:.2%}"))
    shown = [form.format(figures[key]) if figures.get(key) is not None else "" for key, form in numbers]
    return [row["file"], row["way"], *shown, "; ".join(outcome).replace("|", "/")]


def write(
    folder: pathlib.Path, blender: Program, chosen: argparse.Namespace, rows: list[dict[str, object]]
) -> None:
    """Write report.json and report.md."""
    (folder / "report.json").write_text(json.dumps(rows, indent=1), encoding="utf-8")
    size = f"{chosen.width} pixels wide, {chosen.samples} samples"
    text = [f"# {blender.title}: {size}", ""]
    text += [
        "The camera's row has the noise between two of its renders. The others differ from its image.",
        "",
    ]
    text += [f"| {' | '.join(HEAD)} |", f"|{' --- |' * len(HEAD)}"]
    text += [f"| {' | '.join(cells(row))} |" for row in rows]
    (folder / "report.md").write_text("\n".join(text) + "\n", encoding="utf-8")
