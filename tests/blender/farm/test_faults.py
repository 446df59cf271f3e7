# SPDX-License-Identifier: GPL-3.0-or-later
"""Faults of workers: what each says in its first line, with status 1, and what it leaves behind."""

import os
import subprocess
import time

import bpy
import numpy as np
import pytest
from farm_jobs import FRAMES, pixels, requirements_of, set_up_cycles


def add_image(saved):
    """Give the cube a texture from a file beside the scene's."""
    image = bpy.data.images.new("Wood", 4, 4)
    image.filepath_raw, image.file_format = str(saved.parent / "wood.png"), "PNG"
    image.save()
    material = bpy.data.materials.new("Wood")
    if material.node_tree is None:  # Blender 4.5; 5 makes them at once
        material.use_nodes = True
    material.node_tree.nodes.new("ShaderNodeTexImage").image = image
    bpy.data.objects["Cube"].data.materials.append(material)
    bpy.ops.wm.save_mainfile()
    return saved.parent / "wood.png"


def add_library(saved):
    """Link a lamp from another file."""
    path = saved.parent / "library.blend"
    lamp = bpy.data.lights.new("Lamp", "POINT")
    bpy.data.libraries.write(str(path), {lamp})
    bpy.data.lights.remove(lamp)
    with bpy.data.libraries.load(str(path), link=True) as (_, wanted):
        wanted.lights = ["Lamp"]
    bpy.context.scene.collection.objects.link(bpy.data.objects.new("Lamp", bpy.data.lights["Lamp"]))
    bpy.ops.wm.save_mainfile()
    return path


def other_blender(_saved, _addon):
    return "engine", {"blender": "2.79"}


def changed_file(saved, _addon):
    needs = {"scene": {"bytes": saved.stat().st_size}}
    bpy.ops.mesh.primitive_cube_add()
    bpy.ops.wm.save_mainfile()
    return "engine", needs


def absent_file(saved, _addon):
    saved.unlink()
    return "engine", {}


def absent_image(saved, _addon):
    add_image(saved).unlink()
    return "engine", {}


def absent_library(saved, _addon):
    add_library(saved).unlink()
    return "layers", {}


def changed_library(saved, _addon):
    path = add_library(saved)
    needs = {"assets": [{"path": path.name, "bytes": path.stat().st_size, "sha256": "0" * 64}]}
    return "eevee", needs


def no_rig(_saved, _addon):
    bpy.context.scene.render.engine = "SCFPF"
    bpy.ops.wm.save_mainfile()
    return "cycles", {}


def other_chords(_saved, addon):
    set_up_cycles()
    key = addon("cycles.skipping.refresh").TEXT_KEY
    (portals,) = (obj for obj in bpy.data.objects if key in obj)
    needs = {"skips": [portals[key]]}
    portals[key] = "made for something else"
    bpy.ops.wm.save_mainfile()
    return "cycles", needs


def no_skipped_chords(_saved, _addon):
    return "cycles", {"skips": ["Rays skip chords"]}


FAULTS = {
    other_blender: "the job was made by Blender 2.79 and this worker has",
    changed_file: "film.blend has changed after the job was written: write the job again",
    absent_file: "there is no file",
    absent_image: "wood.png, which the file uses: copy them there",
    absent_library: "library.blend, which the file uses: copy them there",
    changed_library: "library.blend has changed after the job was written",
    no_rig: "the file does not render with Cycles: press Cycles in the camera's panel and save it",
    other_chords: "the rig in this file was made for another scene than the job's: press Update Chords",
    no_skipped_chords: "the rig in this file was made for another scene than the job's",
}


@pytest.mark.parametrize("prepare", FAULTS, ids=lambda prepare: prepare.__name__)
def test_a_task_that_cannot_be_says_why_first(addon, task, saved, tmp_path, capsys, prepare):
    way, needs = prepare(saved, addon)
    capsys.readouterr()
    assert task(saved, tmp_path / "out", "--way", way, require=needs) == 1
    told = capsys.readouterr()
    assert told.err.startswith("scfpf: ") and FAULTS[prepare] in told.err and told.err.count("\n") == 1
    assert "scfpf: render" not in told.out
    assert not (tmp_path / "out").exists()


def test_a_worker_without_the_extension_says_so_first(saved, blender, addon, tmp_path):
    script = addon("farm.task_script").__file__
    words = [blender, "--background", "--python", script, "--", "render", "--way", "engine"]
    words += ["--scene", saved, "--output", tmp_path / "out", "--name", "film", "--first", 1, "--last", 1]
    environ = {**os.environ, "SCFPF_WITHOUT": "yes"}
    done = subprocess.run([str(word) for word in words], capture_output=True, text=True, env=environ)
    assert done.returncode == 1
    assert "has no extension Flexible Projection: install it there" in done.stderr.splitlines()[0]
    assert not (tmp_path / "out").exists()


def test_another_version_of_the_extension_is_named(task, saved, tmp_path, capsys):
    assert task(saved, tmp_path, "--way", "engine", require={"extension": "0.0.1"}, last=1) == 0
    assert "warning: the job was made with Flexible Projection 0.0.1" in capsys.readouterr().out


def test_files_that_were_absent_before_are_no_fault(command, task, saved, tmp_path, capsys):
    add_image(saved).unlink()
    assert command("job", saved, "-o", tmp_path / "job", "--way", "engine", "--no-price") == 0
    assert "wood.png', which is absent" in capsys.readouterr().err
    needs = requirements_of(tmp_path / "job")
    assert task(saved, tmp_path / "out", "--way", "engine", require=needs, last=1) == 0


def test_a_task_that_is_killed_leaves_whole_pictures_and_runs_again(addon, task, saved, blender, tmp_path):
    script = addon("farm.task_script").__file__
    words = [blender, "--background", "--python", script, "--", "render", "--way", "engine"]
    words += ["--scene", saved, "--output", tmp_path, "--name", "film_####"]
    words += ["--first", 1, "--last", 5000, "--count", 5000]
    worker = subprocess.Popen([str(word) for word in words], stdout=subprocess.DEVNULL)
    limit = time.monotonic() + 120
    while not (tmp_path / "film_0003.png").exists():
        assert worker.poll() is None and time.monotonic() < limit
        time.sleep(0.005)
    worker.kill()
    worker.wait()
    left = sorted(tmp_path.glob("film_*.png"))
    is_complete = addon("bridge.blender.atomic_files").is_complete_image
    assert 3 <= len(left) < 5000 and all(is_complete(path) for path in left)
    before = pixels(left[2])
    assert task(saved, tmp_path, "--way", "engine", last=len(left) + 1) == 0
    assert np.array_equal(pixels(left[2]), before)
    assert not [path for path in tmp_path.iterdir() if path.name.startswith(".film")]


@pytest.mark.parametrize("way", ["engine", "layers"])
def test_pictures_that_exist_are_kept_on_request(task, saved, tmp_path, way):
    path = tmp_path / "film_0002.png"
    path.write_bytes(b"a picture")
    assert task(saved, tmp_path, "--way", way, "--resume", "true") == 0
    assert path.read_bytes() == b"a picture"
    assert all((tmp_path / f"film_{frame:04d}.png").exists() for frame in FRAMES)
    assert task(saved, tmp_path, "--way", way, last=2) == 0
    assert path.read_bytes() != b"a picture"


def test_what_chords_are_skipped_for_travels_with_the_job(addon, command, task, saved, tmp_path, capsys):
    set_up_cycles()
    key = addon("cycles.skipping.refresh").TEXT_KEY
    assert command("job", saved, "-o", tmp_path / "job", "--way", "cycles", "--no-price") == 0
    assert "Rays skip the chords of 'Flexible Camera'" in capsys.readouterr().out
    needs = requirements_of(tmp_path / "job")
    (portals,) = (obj for obj in bpy.data.objects if key in obj)
    assert needs["skips"] == [portals[key]] and "at frames 1 to 3" in portals[key]
    assert task(saved, tmp_path, "--way", "cycles", require=needs, last=1) == 0
