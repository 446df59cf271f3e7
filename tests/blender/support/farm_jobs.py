# SPDX-License-Identifier: GPL-3.0-or-later
"""A film for render jobs, jobs run by ``openjd`` on this machine, and their pictures."""

import json
import os
import pathlib
import subprocess
import zipfile

import bpy
import numpy as np

from devtools import farm_tools

WORKER = pathlib.Path(__file__).with_name("worker.py")
ROOT = pathlib.Path(__file__).resolve().parents[3]
SIZE = (24, 16)
FRAMES = (1, 2, 3)


def set_up_cycles():
    """Give the open file a rig, and save it."""
    assert bpy.ops.scfpf.cycles_use() == {"FINISHED"}
    bpy.ops.wm.save_mainfile()


def extension_zip(folder):
    """Make a zip of the checkout's extension, without wheels, and return its path."""
    path = folder / "scfpf.zip"
    with zipfile.ZipFile(path, "w") as archive:
        for name in ("__init__.py", "blender_manifest.toml", "LICENSE"):
            archive.write(ROOT / name, name)
        for place in ("scfpf_addon", "operators", "panels", "presets"):
            for file in sorted((ROOT / place).rglob("*")):
                if file.suffix in (".py", ".json", ".po", ".js"):
                    archive.write(file, file.relative_to(ROOT).as_posix())
    return path


def requirements_of(job):
    """What the tasks of a job check."""
    template = json.loads((job / "template.json").read_text(encoding="utf-8"))
    files = template["steps"][0]["script"]["embeddedFiles"]
    return json.loads(next(file["data"] for file in files if file["name"] == "Require"))


def openjd(job, blender, *more, environ=None):
    """Run a job by openjd, and return what it printed and its status."""
    words = [farm_tools.python(), "-m", "openjd", "run", str(job / "template.json"), "--job-param"]
    words += [f"file://{job / 'parameters.json'}", "--job-param", f"Blender={blender}", *more]
    done = subprocess.run(
        words,
        stdout=subprocess.PIPE,
        stderr=subprocess.STDOUT,
        text=True,
        env={**os.environ, **(environ or {})},
        cwd=job,
    )
    return done.stdout, done.returncode


def pixels(path):
    image = bpy.data.images.load(str(path))
    values = np.empty(len(image.pixels), np.float32)
    image.pixels.foreach_get(values)
    bpy.data.images.remove(image)
    return values
