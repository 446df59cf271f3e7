# SPDX-License-Identifier: GPL-3.0-or-later
"""A small film, Blenders that render it, and tasks of its jobs."""

import json
import os
import sys

import bpy
import pytest
from farm_jobs import FRAMES, SIZE, WORKER


@pytest.fixture
def scene():
    """A cube that moves past a flexible camera, small and quick for every engine."""
    scene = bpy.context.scene
    render = scene.render
    render.resolution_x, render.resolution_y, render.resolution_percentage = *SIZE, 100
    render.engine, render.threads_mode, render.threads = "CYCLES", "FIXED", 2
    scene.cycles.samples, scene.cycles.use_denoising, scene.cycles.use_adaptive_sampling = 2, False, False
    scene.frame_start, scene.frame_end = FRAMES[0], FRAMES[-1]
    bpy.ops.mesh.primitive_cube_add(size=2)
    cube = bpy.context.object
    for frame, x in ((1, -1.5), (3, 1.5)):
        cube.location.x = x
        cube.keyframe_insert("location", frame=frame)
    bpy.ops.object.light_add(type="SUN", rotation=(0.4, 0.3, 0))
    bpy.ops.scfpf.camera_add()
    bpy.context.object.scfpf.samples = 1
    scene.camera = bpy.context.object
    return scene


@pytest.fixture
def saved(scene, tmp_path):
    """The scene's file in a folder of its own."""
    (tmp_path / "film").mkdir()
    path = tmp_path / "film" / "film.blend"
    bpy.ops.wm.save_as_mainfile(filepath=str(path))
    return path


@pytest.fixture
def command(addon):
    return lambda *arguments: addon("bridge.render.command_line").run([str(one) for one in arguments])


@pytest.fixture
def blender(tmp_path):
    """The command of a worker's Blender."""
    if bpy.app.binary_path:
        return bpy.app.binary_path
    path = tmp_path / ("blender.bat" if os.name == "nt" else "blender")
    line = f'"{sys.executable}" "{WORKER}"'
    path.write_text(f"@{line} %*\n" if os.name == "nt" else f'#!/bin/sh\nexec {line} "$@"\n')
    path.chmod(0o755)
    return str(path)


@pytest.fixture
def task(addon):
    """Run a task in this Blender, of the frames from 1 on, and return its status."""

    def run(saved, output, *words, action="render", last=3, require=None):
        given = [action, "--scene", saved, "--output", output, "--name", "film_####", "--first", 1]
        given += ["--last", last, "--count", last, "--require", json.dumps(require or {}), *words]
        return addon("farm.task_script").run([str(word) for word in given])

    return run
