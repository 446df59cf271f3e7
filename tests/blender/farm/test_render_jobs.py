# SPDX-License-Identifier: GPL-3.0-or-later
"""Jobs for farms run by ``openjd run`` on this machine, beside the pictures of one Blender."""

import json
import os
import pathlib
import re
import subprocess
import sys
import time

import bpy
import numpy as np
import pytest

from devtools import farm_tools

WORKER = pathlib.Path(__file__).parents[1] / "support" / "worker.py"
SIZE = (24, 16)
FRAMES = (1, 2, 3)
STAND_IN = "BLENDER_WORKBENCH"


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


def set_up_cycles():
    """Give the open file a rig, and save it."""
    assert bpy.ops.scfpf.cycles_use() == {"FINISHED"}
    bpy.ops.wm.save_mainfile()


@pytest.fixture
def task(addon):
    """Run a task in this Blender, of the frames from 1 on, and return its status."""

    def run(saved, output, *words, action="render", last=3, require=None):
        given = [action, "--scene", saved, "--output", output, "--name", "film_####", "--first", 1]
        given += ["--last", last, "--count", last, "--require", json.dumps(require or {}), *words]
        return addon("farm.task_script").run([str(word) for word in given])

    return run


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


def by_one_blender(command, saved, way, folder):
    """Render the frames of a file as an artist would, and return their pixels."""
    if way in ("layers", "eevee"):
        flags = ["--cycles"] if way == "layers" else ["--engine", "eevee"]
        assert command("render", saved, "-o", folder / "one_####.png", "--frames", 1, 3, *flags) == 0
    else:
        bpy.ops.wm.open_mainfile(filepath=str(saved))
        render = bpy.context.scene.render
        render.engine = {"engine": "SCFPF", "cycles": "CYCLES"}[way]
        render.filepath = str(folder / "one_####")
        bpy.ops.render.render(animation=True)
    return [pixels(folder / f"one_{frame:04d}.png") for frame in FRAMES]


@pytest.mark.parametrize(("way", "chunk"), [("engine", 2), ("cycles", 3), ("layers", 3), ("eevee", 3)])
def test_three_frames_are_those_of_one_blender(
    addon, command, saved, blender, tmp_path, monkeypatch, way, chunk
):
    """A file with a rig is rendered without the extension.

    Of EEVEE's way another engine renders the anchors: without a GPU its shaders take minutes.
    """
    monkeypatch.setattr(addon("bridge.blender.versions"), "EEVEE", STAND_IN)
    environ = {"SCFPF_EEVEE": STAND_IN}
    if way == "cycles":
        set_up_cycles()
        environ = {"SCFPF_WITHOUT": "yes"}
    job = tmp_path / "job"
    assert command("job", saved, "-o", job, "--way", way, "--chunk", chunk, "--no-price") == 0
    told, status = openjd(job, blender, environ=environ)
    assert status == 0, told
    assert ("without SCFPF" in told) == (way == "cycles") and told.count("scfpf: render") == -(-3 // chunk)
    made = [pixels(job / "pictures" / f"film_{frame:04d}.png") for frame in FRAMES]
    for mine, one in zip(made, by_one_blender(command, saved, way, tmp_path), strict=True):
        assert len(mine) == SIZE[0] * SIZE[1] * 4 and np.array_equal(mine, one)
    assert not np.array_equal(made[0], made[2])


def test_tiles_are_joined_to_the_picture_of_one_blender(command, saved, blender, tmp_path):
    job = tmp_path / "job"
    words = ("--way", "engine", "--frames", 2, 2, "--tiles", "2x2", "--no-price")
    assert command("job", saved, "-o", job, *words) == 0
    told, status = openjd(job, blender, "--step", "Join", "--run-dependencies")
    assert status == 0, told
    one = by_one_blender(command, saved, "engine", tmp_path)[1]
    assert np.array_equal(pixels(job / "pictures" / "film_0002.png"), one)
    assert not list((job / "pictures" / "tiles").iterdir())


def test_tiles_of_cycles_and_their_join(task, saved, tmp_path):
    """Tiles do not divide evenly, and lie at all edges of the picture."""
    set_up_cycles()
    for tile in range(6):
        assert task(saved, tmp_path, "--way", "cycles", "--tiles", "3x2", "--tile", tile, last=1) == 0
    assert task(saved, tmp_path, "--way", "cycles", "--tiles", "3x2", action="join", last=1) == 0
    bpy.ops.wm.open_mainfile(filepath=str(saved))
    bpy.context.scene.render.filepath = str(tmp_path / "one.png")
    bpy.ops.render.render(write_still=True)
    assert np.array_equal(pixels(tmp_path / "film_0001.png"), pixels(tmp_path / "one.png"))


def test_a_task_without_its_tiles_fails(task, saved, tmp_path, capsys):
    words = ("--way", "engine", "--tiles", "2x2")
    for tile in range(3):
        assert task(saved, tmp_path, *words, "--tile", tile, last=1) == 0
    capsys.readouterr()
    assert task(saved, tmp_path, *words, action="join", last=1) == 1
    assert "run the tasks that render tiles first" in capsys.readouterr().err
    assert not (tmp_path / "film_0001.png").exists()
    assert len(list((tmp_path / "tiles").iterdir())) == 3, "tiles stay until they are joined"


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


def test_a_file_that_writes_no_pictures_by_itself_does_as_a_job(task, saved, tmp_path):
    render = bpy.context.scene.render
    render.use_file_extension = False
    if hasattr(render, "save_output"):
        render.save_output = False
    bpy.ops.wm.save_mainfile()
    assert task(saved, tmp_path, "--way", "engine", last=1) == 0
    assert (tmp_path / "film_0001.png").exists()


def test_a_worker_without_the_extension_says_so_first(saved, blender, addon, tmp_path):
    script = addon("farm.task_script").__file__
    words = [blender, "--background", "--python", script, "--", "render", "--way", "engine"]
    words += ["--scene", saved, "--output", tmp_path / "out", "--name", "film", "--first", 1, "--last", 1]
    environ = {**os.environ, "SCFPF_WITHOUT": "yes"}
    done = subprocess.run([str(word) for word in words], capture_output=True, text=True, env=environ)
    assert done.returncode == 1
    assert "has no SCFPF extension: install it there" in done.stderr.splitlines()[0]
    assert not (tmp_path / "out").exists()


def test_a_worker_of_another_blender_is_refused_and_another_extension_named(task, saved, tmp_path, capsys):
    assert task(saved, tmp_path, "--way", "engine", require={"blender": "2.79"}) == 1
    told = capsys.readouterr()
    assert told.err.count("\n") == 1 and "made by Blender 2.79 and this worker has" in told.err
    assert not list(tmp_path.glob("*.png"))
    assert task(saved, tmp_path, "--way", "engine", require={"extension": "0.0.1"}, last=1) == 0
    assert "warning: the job was made with SCFPF 0.0.1" in capsys.readouterr().out


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
    (portals,) = (obj for obj in bpy.data.objects if key in obj)
    portals[key] = "made for something else"
    bpy.ops.wm.save_mainfile()
    assert task(saved, tmp_path, "--way", "cycles", require={"skips": needs["skips"]}) == 1
    assert "the rig in this file was made for another scene" in capsys.readouterr().err
    assert task(saved, tmp_path, "--way", "cycles", require=needs) == 1
    assert "has changed after the job was written" in capsys.readouterr().err


def test_files_that_a_scene_uses_are_named_and_checked(command, task, saved, tmp_path, capsys):
    folder = saved.parent
    image = bpy.data.images.new("Wood", 4, 4)
    image.filepath_raw, image.file_format = str(folder / "wood {{1}}.png"), "PNG"
    image.save()
    material = bpy.data.materials.new("Wood")
    if material.node_tree is None:  # Blender 4.5; 5 makes them at once
        material.use_nodes = True
    node = material.node_tree.nodes.new("ShaderNodeTexImage")
    node.image = image
    bpy.data.objects["Cube"].data.materials.append(material)
    library = tmp_path / "library.blend"
    lamp = bpy.data.lights.new("Lamp", "POINT")
    bpy.data.libraries.write(str(library), {lamp})
    bpy.data.lights.remove(lamp)
    with bpy.data.libraries.load(str(library), link=True) as (_, wanted):
        wanted.lights = ["Lamp"]
    bpy.context.scene.collection.objects.link(bpy.data.objects.new("Lamp", bpy.data.lights["Lamp"]))
    bpy.ops.file.make_paths_relative()
    bpy.ops.wm.save_mainfile()
    assert command("job", saved, "-o", tmp_path / "job", "--way", "engine", "--no-price") == 0
    needs = requirements_of(tmp_path / "job")
    assert [asset["path"] for asset in needs["assets"]] == ["wood {{1}}.png", str(library)]
    assert needs["assets"][0]["bytes"] > 0 and needs["assets"][1]["sha256"]
    named = json.loads((tmp_path / "job" / "asset_references.json").read_text(encoding="utf-8"))
    inputs = named["assetReferences"]["inputs"]["filenames"]
    assert inputs == [str(saved), str(folder / "wood {{1}}.png"), str(library)]
    assert task(saved, tmp_path, "--way", "engine", require=needs, last=1) == 0
    (folder / "wood {{1}}.png").unlink()
    assert task(saved, tmp_path, "--way", "engine", require=needs, last=1) == 1
    assert "this worker lacks wood {{1}}.png" in capsys.readouterr().err
    assert command("job", saved, "-o", tmp_path / "job", "--way", "engine", "--no-price") == 0
    assert "which is absent" in capsys.readouterr().err


def test_the_price_is_told_and_the_memory_asked_for(command, saved, tmp_path, capsys):
    assert command("job", saved, "-o", tmp_path / "job", "--way", "engine", "--frames", 1, 250) == 0
    told = capsys.readouterr().out
    found = re.search(
        r"250 frames × ([\d.]+) s \+ 50 tasks × ([\d.]+) s to begin = (.+) on one machine", told
    )
    assert found and 0.0 <= float(found[1]) < 60.0 and float(found[2]) < 60.0
    assert "A worker needs Blender" in told and "GB of memory" in told
    template = json.loads((tmp_path / "job" / "template.json").read_text(encoding="utf-8"))
    (amount,) = template["steps"][0]["hostRequirements"]["amounts"]
    assert amount["name"] == "amount.worker.memory" and 100 < amount["min"] < 100_000
    assert not list((tmp_path / "job").glob("**/*.png")), "the picture that told the price is gone"


FAILURES = {
    "no rig": (["--way", "cycles"], "The file has no Cycles rig"),
    "tiles of layers": (["--way", "layers", "--tiles", "2x2"], "Tiles need the way engine or cycles"),
    "more tiles than pixels": (["--way", "engine", "--tiles", "99x1"], "fewer pixels than tiles"),
    "bad tiles": (["--way", "engine", "--tiles", "4"], "'4' is not a number of columns and rows"),
    "no frames": (["--way", "engine", "--chunk", "0"], "'0' is not a number of frames"),
    "backwards": (["--way", "engine", "--frames", "5", "1"], "The last frame 1 comes before the first one 5"),
    "no way": ([], "--way"),
    "camera of a rig": (["--way", "cycles", "--camera", "x"], "--camera is for the other ways"),
    "a place that is a file": (["--way", "engine", "-o", "FILE"], "it is a file"),
}


@pytest.mark.parametrize("case", FAILURES)
def test_a_job_that_cannot_be_is_one_line_and_writes_nothing(command, saved, tmp_path, capsys, case):
    words, reason = FAILURES[case]
    words = [str(saved) if word == "FILE" else word for word in words]
    assert command("job", saved, "-o", tmp_path / "job", *words, "--no-price") == 1
    error = capsys.readouterr().err
    assert reason in error and error.startswith("scfpf: ") and error.count("\n") == 1
    assert not (tmp_path / "job").exists()


def test_movies_and_layered_files_are_refused_where_they_cannot_be(command, saved, tmp_path, capsys):
    settings = bpy.context.scene.render.image_settings
    if hasattr(settings, "media_type"):
        settings.media_type = "MULTI_LAYER_IMAGE"
    settings.file_format = "OPEN_EXR_MULTILAYER"
    bpy.ops.wm.save_mainfile()
    words = ("-o", tmp_path / "job", "--way", "engine", "--no-price")
    assert command("job", saved, *words, "--tiles", "2x2") == 1
    assert "Tiles join one picture" in capsys.readouterr().err
    assert command("job", saved, *words) == 0
    settings = bpy.context.scene.render.image_settings
    if hasattr(settings, "media_type"):
        settings.media_type = "VIDEO"
    settings.file_format = "FFMPEG"
    bpy.ops.wm.save_mainfile()
    capsys.readouterr()
    assert command("job", saved, *words) == 1
    assert "tasks cannot share a movie" in capsys.readouterr().err


def test_flamenco_s_job_type_is_written(addon, command, tmp_path, capsys):
    assert command("flamenco", "-o", tmp_path / "scripts") == 0
    assert "scfpf_render.js" in capsys.readouterr().out
    text = (tmp_path / "scripts" / "scfpf_render.js").read_text(encoding="utf-8")
    assert text == addon("farm.flamenco").job_type()


def test_the_button_writes_the_job_of_the_command(command, saved, tmp_path):
    assert command("job", saved, "-o", tmp_path / "one", "--way", "engine", "--no-price") == 0
    bpy.ops.wm.open_mainfile(filepath=str(saved))
    done = bpy.ops.scfpf.render_job_export(directory=str(tmp_path / "two"), way="ENGINE")
    assert done == {"FINISHED"}
    one, two = (
        (tmp_path / folder / "template.json").read_text(encoding="utf-8") for folder in ("one", "two")
    )
    assert one == two
    assert (tmp_path / "two" / "scfpf_render.js").exists()


def test_the_button_needs_a_saved_file_and_a_flexible_camera(scene, tmp_path):
    bpy.ops.wm.read_homefile(use_empty=True, use_factory_startup=True)
    with pytest.raises(RuntimeError, match="Make a flexible camera the scene's camera first"):
        bpy.ops.scfpf.render_job_export(directory=str(tmp_path / "job"))
    bpy.ops.scfpf.camera_add()
    with pytest.raises(RuntimeError, match="Save the file first"):
        bpy.ops.scfpf.render_job_export(directory=str(tmp_path / "job"))
    assert not (tmp_path / "job").exists()
