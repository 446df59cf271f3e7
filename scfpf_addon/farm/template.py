# SPDX-License-Identifier: GPL-3.0-or-later
"""A render job as an Open Job Description template (2023-09), with the files of a job bundle beside it.

The format is specified at github.com/OpenJobDescription/openjd-specifications; AWS Deadline Cloud and
``openjd run`` take it. This module imports no bpy.
"""

from __future__ import annotations

import json
from pathlib import Path
from typing import Any, NamedTuple

VERSION = "jobtemplate-2023-09"
# Longest name of a job.
NAME_LENGTH = 128
SCRIPT = Path(__file__).with_name("task_script.py")


class Way(NamedTuple):
    """A way to render a flexible camera's film.

    title: for people. extension: whether workers need it. gpu: whether they need a graphics card. tiles:
    whether a picture can be divided. needs: what a worker's memory holds. chunk: usual pictures of a task.
    """

    title: str
    extension: bool
    gpu: bool
    tiles: bool
    needs: str
    chunk: int = 5


WAYS = {
    "engine": Way(
        "Flexible Projection's own engine",
        True,
        False,
        True,
        "the scene, its acceleration structure and a film",
    ),
    "cycles": Way("Cycles through the rig in the file", False, False, True, "the scene and the rig's sheets"),
    "layers": Way("image layers by Cycles", True, False, True, "the scene, and a picture a layer and pass"),
    "eevee": Way(
        "EEVEE through anchors", True, True, False, "the scene, and a picture and depths an anchor", 32
    ),
}


class Asset(NamedTuple):
    """A file that a scene uses. path: relative to the scene's folder if it is below it, else absolute.

    sha256: empty where only the size is compared.
    """

    path: str
    bytes: int
    sha256: str = ""


class RenderPlan(NamedTuple):
    """What a render job is to do.

    scene: the absolute path of the .blend file. camera: empty for that of the file. frames: the first and the
    last. step: from a picture's frame to the next one. chunk: pictures of a task. tiles: columns and rows.
    blender: the command on workers. version: of Blender, such as "5.2". extension: the version of ours that
    workers must have, empty if they need none. archive: the zip of it that the job takes along, empty for
    none. skips: see ``task_script.skips_of_file``. absent: paths that the file uses and that were absent when
    the job was written. memory: bytes that a worker needs, 0 if unknown.
    """

    scene: str
    digest: Asset
    way: str
    frames: tuple[int, int]
    step: int = 1
    chunk: int = 5
    tiles: tuple[int, int] = (1, 1)
    camera: str = ""
    name: str = ""
    resume: bool = False
    blender: str = "blender"
    version: str = ""
    extension: str = ""
    skips: tuple[str, ...] = ()
    archive: Asset | None = None
    assets: tuple[Asset, ...] = ()
    absent: tuple[str, ...] = ()
    memory: int = 0

    @property
    def has_tiles(self) -> bool:
        """Whether pictures are divided."""
        return self.tiles != (1, 1)

    @property
    def frame_count(self) -> int:
        """The number of frames that are rendered."""
        return len(range(self.frames[0], self.frames[1] + 1, self.step))

    @property
    def task_count(self) -> int:
        """The number of tasks that render."""
        return -(-self.frame_count // self.chunk) * self.tiles[0] * self.tiles[1]


def requirements(plan: RenderPlan) -> dict[str, Any]:
    """What a task checks before it renders: see ``task_script.check_worker`` and ``check_files``."""
    found: dict[str, Any] = {
        "blender": plan.version,
        "extension": plan.extension,
        "camera": plan.camera,
        "scene": {"bytes": plan.digest.bytes, "sha256": plan.digest.sha256},
        "assets": [asset._asdict() for asset in plan.assets],
        "absent": list(plan.absent),
    }
    if plan.archive is not None:
        found["archive"] = plan.archive.sha256
    if plan.way == "cycles":
        found["skips"] = list(plan.skips)
    return found


def job_template(plan: RenderPlan) -> dict[str, Any]:
    """The template of a job, as a JSON object."""
    steps = [_step(plan, "Render", "render")]
    if plan.has_tiles:
        steps.append({**_step(plan, "Join", "join"), "dependencies": [{"dependsOn": "Render"}]})
    return {
        "specificationVersion": VERSION,
        "name": plain_text(f"{Path(plan.scene).stem} by {plan.way}")[:NAME_LENGTH],
        "description": f"A flexible film by {WAYS[plan.way].title}, written by Flexible Projection.",
        "parameterDefinitions": _parameters(plan),
        "steps": steps,
    }


def parameter_values(plan: RenderPlan) -> dict[str, str]:
    """The values of parameters without a default."""
    return {"SceneFile": plan.scene}


def bundle(plan: RenderPlan, folder: str) -> dict[str, str]:
    """The files of a job by their names: texts in JSON.

    folder: the absolute one of the job. ``parameters.json`` is for ``openjd run``, ``parameter_values.json``
    and ``asset_references.json`` for ``deadline bundle submit``.
    """
    scene = Path(plan.scene)
    values = parameter_values(plan)
    inputs = [plan.scene, *(str(scene.parent / asset.path) for asset in plan.assets)]
    if plan.archive is not None:
        inputs.append(str(Path(folder) / Path(plan.archive.path).name))
    files = {
        "template.json": job_template(plan),
        "parameters.json": values,
        "parameter_values.json": {
            "parameterValues": [{"name": name, "value": value} for name, value in values.items()]
        },
        "asset_references.json": {
            "assetReferences": {
                "inputs": {"filenames": inputs, "directories": []},
                "outputs": {"directories": [str(Path(folder) / "pictures")]},
                "referencedPaths": [],
            }
        },
    }
    return {name: json.dumps(value, indent=1, ensure_ascii=False) + "\n" for name, value in files.items()}


def _parameters(plan: RenderPlan) -> list[dict[str, Any]]:
    first, last = plan.frames
    return [
        *_archive_parameter(plan),
        {
            "name": "SceneFile",
            "type": "PATH",
            "objectType": "FILE",
            "dataFlow": "IN",
            "description": "The .blend file. What it uses must lie beside it as on the machine of the job.",
        },
        {
            "name": "OutputFolder",
            "type": "PATH",
            "objectType": "DIRECTORY",
            "dataFlow": "OUT",
            "default": "pictures",
            "description": "The folder of the pictures.",
        },
        {
            "name": "OutputName",
            "type": "STRING",
            "default": plan.name or f"{Path(plan.scene).stem}_####",
            "minLength": 1,
            "description": "The name of a picture without its ending; # stands for a digit of the frame.",
        },
        {"name": "FirstFrame", "type": "INT", "default": first},
        {"name": "LastFrame", "type": "INT", "default": last},
        {
            "name": "FramesPerTask",
            "type": "INT",
            "default": plan.chunk * plan.step,
            "minValue": 1,
            "description": "Frames that a task covers, those between steps too. A task opens the file once.",
        },
        {
            "name": "FrameStep",
            "type": "INT",
            "default": plan.step,
            "minValue": 1,
            "description": "From one frame that is rendered to the next one.",
        },
        {
            "name": "Resume",
            "type": "STRING",
            "default": "true" if plan.resume else "false",
            "allowedValues": ["true", "false"],
            "userInterface": {"control": "CHECK_BOX", "label": "Keep pictures that exist"},
        },
        {
            "name": "Blender",
            "type": "STRING",
            "default": plan.blender,
            "minLength": 1,
            "description": f"The command or the path of Blender {plan.version} on workers.",
        },
    ]


def _archive_parameter(plan: RenderPlan) -> list[dict[str, Any]]:
    if plan.archive is None:
        return []
    return [
        {
            "name": "Extension",
            "type": "PATH",
            "objectType": "FILE",
            "dataFlow": "IN",
            "default": Path(plan.archive.path).name,
            "description": f"The zip of Flexible Projection {plan.extension}, "
            "which workers without it load for their task.",
        }
    ]


def _step(plan: RenderPlan, name: str, action: str) -> dict[str, Any]:
    frames = "{{Param.FirstFrame}}-{{Param.LastFrame}}:{{Param.FramesPerTask}}"
    space = [{"name": "First", "type": "INT", "range": frames}]
    arguments = _arguments(plan, action)
    if action == "render" and plan.has_tiles:
        space.append({"name": "Tile", "type": "INT", "range": f"0-{plan.tiles[0] * plan.tiles[1] - 1}"})
        arguments += ["--tile", "{{Task.Param.Tile}}"]
    step: dict[str, Any] = {
        "name": name,
        "parameterSpace": {"taskParameterDefinitions": space},
        "script": {
            "actions": {"onRun": {"command": "{{Param.Blender}}", "args": arguments}},
            "embeddedFiles": [
                _embedded("Run", "scfpf_task.py", SCRIPT.read_text(encoding="utf-8")),
                _embedded("Require", "scfpf_require.json", requirements_text(plan)),
            ],
        },
    }
    if amounts := _amounts(plan):
        step["hostRequirements"] = {"amounts": amounts}
    return step


def _arguments(plan: RenderPlan, action: str) -> list[str]:
    words = ["--background", "--enable-autoexec", "--python-exit-code", "1"]
    words += ["--python", "{{Task.File.Run}}", "--", action, "--way", plan.way]
    values = {
        "scene": "{{Param.SceneFile}}",
        "output": "{{Param.OutputFolder}}",
        "name": "{{Param.OutputName}}",
        "first": "{{Task.Param.First}}",
        "last": "{{Param.LastFrame}}",
        "count": "{{Param.FramesPerTask}}",
        "step": "{{Param.FrameStep}}",
        "origin": "{{Param.FirstFrame}}",
        "resume": "{{Param.Resume}}",
        "require": "{{Task.File.Require}}",
        "tiles": f"{plan.tiles[0]}x{plan.tiles[1]}",
    }
    if plan.archive is not None:
        values["extension"] = "{{Param.Extension}}"
    # Frames may be negative: as one word they are no options.
    return words + [f"--{name}={value}" for name, value in values.items()]


def _amounts(plan: RenderPlan) -> list[dict[str, Any]]:
    found: list[dict[str, Any]] = []
    if plan.memory:
        found.append({"name": "amount.worker.memory", "min": -(-plan.memory // 2**20)})
    if WAYS[plan.way].gpu:
        found.append({"name": "amount.worker.gpu", "min": 1})
    return found


def _embedded(name: str, filename: str, data: str) -> dict[str, Any]:
    return {"name": name, "type": "TEXT", "filename": filename, "data": data}


def requirements_text(plan: RenderPlan) -> str:
    """``requirements`` in JSON without double braces, which names of files may contain."""
    text = json.dumps(requirements(plan), indent=1)
    return text.replace("{{", "\\u007b\\u007b").replace("}}", "\\u007d\\u007d")


def plain_text(text: str) -> str:
    """A text without control characters, and without the braces of format strings."""
    return "".join(each for each in text if each.isprintable() and each not in "{}") or "Film"


def duration(seconds: float) -> str:
    """A duration in words: "8.3 s", "12 min", "3 h 20 min"."""
    if seconds < 99.95:
        return f"{seconds:.1f} s"
    minutes = round(seconds / 60)
    return f"{minutes} min" if minutes < 100 else f"{minutes // 60} h {minutes % 60} min"


def counted(count: int, unit: str) -> str:
    """A number with its unit in English: "1 task", "2 tasks"."""
    return f"{count} {unit}" if count == 1 else f"{count} {unit}s"


def price_text(plan: RenderPlan, opening: float, seconds: float) -> str:
    """The price of a job in a sentence.

    opening: seconds of Blender and the file, once a task. seconds: of a frame, or of a tile of one.
    """
    pieces = plan.frame_count * plan.tiles[0] * plan.tiles[1]
    unit = "tile" if plan.has_tiles else "frame"
    total = pieces * seconds + plan.task_count * opening
    return (
        f"{counted(pieces, unit)} × {duration(seconds)} + {counted(plan.task_count, 'task')} × "
        f"{duration(opening)} to begin = "
        f"{duration(total)} on one machine as this"
    )


def needs_text(plan: RenderPlan) -> str:
    """What a worker needs, in a sentence."""
    way = WAYS[plan.way]
    extension = f"Flexible Projection {plan.extension}"
    if plan.archive is not None:
        extension += f", which comes with the job ({Path(plan.archive.path).name})"
    parts = [f"Blender {plan.version}", extension if way.extension else "no extension"]
    parts.append("a GPU or a software renderer of OpenGL" if way.gpu else "no GPU")
    if plan.memory:
        parts.append(f"{plan.memory / 1e9:.1f} GB of memory ({way.needs})")
    return f"A worker needs {', '.join(parts)}"
