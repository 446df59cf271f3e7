# SPDX-License-Identifier: GPL-3.0-or-later
"""Jobs for farms run by ``openjd run`` on this machine, beside the pictures of one Blender."""

import argparse
import io
import json
import platform
import re
import sys
import zipfile

import bpy
import numpy as np
import pytest
from farm_jobs import FRAMES, SIZE, extension_zip, openjd, pixels, requirements_of, set_up_cycles

STAND_IN = "BLENDER_WORKBENCH"


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

    Of EEVEE's way another engine renders the anchors here: without a GPU its shaders take long.
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
    assert ("without Flexible Projection" in told) == (way == "cycles")
    assert told.count("scfpf: render") == -(-3 // chunk)
    made = [pixels(job / "pictures" / f"film_{frame:04d}.png") for frame in FRAMES]
    for mine, one in zip(made, by_one_blender(command, saved, way, tmp_path), strict=True):
        assert len(mine) == SIZE[0] * SIZE[1] * 4 and np.array_equal(mine, one)
    assert not np.array_equal(made[0], made[2])


@pytest.mark.once  # by software EEVEE takes half a minute
def test_three_frames_by_eevee_are_those_of_one_blender(scene, command, saved, blender, tmp_path):
    """EEVEE itself, through a camera's own view, which needs one render a frame."""
    scene.eevee.taa_render_samples = 1
    bpy.ops.wm.save_mainfile()
    job = tmp_path / "job"
    assert command("job", saved, "-o", job, "--way", "eevee", "--chunk", 3, "--no-price") == 0
    told, status = openjd(job, blender)
    assert status == 0 and told.count("scfpf: render") == 1, told
    made = [pixels(job / "pictures" / f"film_{frame:04d}.png") for frame in FRAMES]
    for mine, one in zip(made, by_one_blender(command, saved, "eevee", tmp_path), strict=True):
        np.testing.assert_array_equal(mine, one)
    assert made[0].std() > 0.0 and not np.array_equal(made[0], made[2])


def test_tasks_plan_a_frame_s_renders_as_one_blender_does(
    addon, command, saved, blender, tmp_path, monkeypatch
):
    """A volume that sees from many places, whose renders two tasks plan each for itself."""
    monkeypatch.setattr(addon("bridge.blender.versions"), "EEVEE", STAND_IN)
    numbers = []
    deliver = addon("engines.anchored_render").AnchoredRender._deliver

    def counted(render, *given):
        numbers.append(render.total)
        return deliver(render, *given)

    monkeypatch.setattr(addon("engines.anchored_render").AnchoredRender, "_deliver", counted)
    bpy.ops.mesh.primitive_plane_add(size=12, location=(0, 0, -1))
    bpy.ops.mesh.primitive_cube_add(size=1, location=(2, 2, 0))
    bpy.context.view_layer.objects.active = bpy.context.scene.camera
    assert bpy.ops.scfpf.preset_apply(preset="inverted_perspective") == {"FINISHED"}
    bpy.ops.wm.save_mainfile()
    job = tmp_path / "job"
    assert command("job", saved, "-o", job, "--way", "eevee", "--chunk", 2, "--no-price") == 0
    told, status = openjd(job, blender, environ={"SCFPF_EEVEE": STAND_IN})
    assert status == 0 and told.count("scfpf: render") == 2, told
    made = [pixels(job / "pictures" / f"film_{frame:04d}.png") for frame in FRAMES]
    for mine, one in zip(made, by_one_blender(command, saved, "eevee", tmp_path), strict=True):
        np.testing.assert_array_equal(mine, one)
    assert min(numbers) >= 4 and not np.array_equal(made[0], made[2])


def test_workers_without_the_extension_load_the_job_s_zip(command, saved, blender, tmp_path, capsys):
    """For their task only; a job of a rig has none."""
    job, archive = tmp_path / "job", extension_zip(tmp_path)
    words = ("job", saved, "-o", job, "--frames", 1, 1, "--no-price", "--extension", archive)
    assert command(*words, "--way", "engine") == 0
    assert "Flexible Projection 1.0.0, which comes with the job (scfpf.zip)" in capsys.readouterr().out
    named = json.loads((job / "asset_references.json").read_text(encoding="utf-8"))
    assert str(job / "scfpf.zip") in named["assetReferences"]["inputs"]["filenames"]
    archive.unlink()
    told, status = openjd(job, blender, environ={"SCFPF_WITHOUT": "yes"})
    assert status == 0 and "Flexible Projection 1.0.0" in told, told
    assert "left behind: []" in told, told + "the worker's extensions and Python packages are as before"
    one = by_one_blender(command, saved, "engine", tmp_path)[0]
    assert np.array_equal(pixels(job / "pictures" / "film_0001.png"), one)
    (job / "scfpf.zip").write_bytes(b"something else")
    told, status = openjd(job, blender, environ={"SCFPF_WITHOUT": "yes"})
    assert status != 0 and "scfpf.zip is not the job's zip of the extension" in told


def test_a_zip_beside_the_file_is_found(addon, command, saved, tmp_path, capsys):
    archive = extension_zip(tmp_path)
    archive.rename(saved.parent / "scfpf-1.0.0.zip")
    words = ("job", saved, "-o", tmp_path / "job", "--no-price")
    assert command(*words, "--way", "layers") == 0
    assert (tmp_path / "job" / "scfpf-1.0.0.zip").exists()
    set_up_cycles()
    assert command(*words[:3], tmp_path / "rig", "--no-price", "--way", "cycles") == 0
    assert not list((tmp_path / "rig").glob("*.zip"))
    assert (
        "Extension"
        not in (tmp_path / "rig" / "template.json").read_text(encoding="utf-8").split("scfpf_task.py")[0]
    )


def test_a_zip_s_packages_are_those_for_this_python(addon, tmp_path, monkeypatch):
    """Nothing else of the wheels is left to Blender, which would install them for good."""
    script = addon("farm.task_script")
    monkeypatch.setattr(sys, "path", [*sys.path])
    python = f"cp{sys.version_info[0]}{sys.version_info[1]}"
    systems = (
        "manylinux_2_28_x86_64",
        "manylinux_2_28_aarch64",
        "win_amd64",
        "macosx_13_0_arm64",
        "macosx_13_0_x86_64",
    )
    names = [f"thing-1.0-{tag}-{tag}-{system}.whl" for tag in (python, "cp399") for system in systems]
    path = tmp_path / "given.zip"
    manifest = 'id = "scfpf"\nwheels = [\n  "./wheels/a.whl",\n]\n[build]\nx = 1\n'
    with zipfile.ZipFile(path, "w") as archive:
        archive.writestr("blender_manifest.toml", manifest)
        for name in names:
            content = io.BytesIO()
            with zipfile.ZipFile(content, "w") as wheel:
                wheel.writestr(f"{name}.py", "")
            archive.writestr(f"wheels/{name}", content.getvalue())
    script.unpack(str(path), str(tmp_path / "scfpf"), str(tmp_path / "packages"))
    (unpacked,) = (tmp_path / "packages").iterdir()
    found = unpacked.name.removesuffix(".whl.py")
    assert f"-{python}-" in found and found.endswith(platform.machine().lower())
    assert {"linux": "manylinux", "darwin": "macosx", "win32": "win"}[sys.platform] in found
    assert sys.path[0] == str(tmp_path / "packages") and not (tmp_path / "scfpf" / "wheels").exists()
    assert (tmp_path / "scfpf" / "blender_manifest.toml").read_text() == 'id = "scfpf"\n\n[build]\nx = 1\n'
    with zipfile.ZipFile(path, "w") as archive:
        archive.writestr("blender_manifest.toml", manifest)
        archive.writestr("wheels/thing-1.0-cp399-cp399-win_arm64.whl", b"")
    with pytest.raises(script.Fault, match="made for another system"):
        script.unpack(str(path), str(tmp_path / "other"), str(tmp_path / "none"))


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


def test_a_file_that_writes_no_pictures_by_itself_does_as_a_job(task, saved, tmp_path):
    render = bpy.context.scene.render
    render.use_file_extension = False
    if hasattr(render, "save_output"):
        render.save_output = False
    bpy.ops.wm.save_mainfile()
    assert task(saved, tmp_path, "--way", "engine", last=1) == 0
    assert (tmp_path / "film_0001.png").exists()


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
    "tiles of EEVEE": (["--way", "eevee", "--tiles", "2x2"], "Tiles need the way engine, cycles or layers"),
    "more tiles than pixels": (["--way", "engine", "--tiles", "99x1"], "fewer pixels than tiles"),
    "bad tiles": (["--way", "engine", "--tiles", "4"], "'4' is not a number of columns and rows"),
    "no frames": (["--way", "engine", "--chunk", "0"], "'0' is not a number of frames"),
    "backwards": (["--way", "engine", "--frames", "5", "1"], "The last frame 1 comes before the first one 5"),
    "no way": ([], "--way"),
    "camera of a rig": (["--way", "cycles", "--camera", "x"], "--camera is for the other ways"),
    "a zip that is none": (["--way", "engine", "--extension", "FILE"], "is not the extension's zip"),
    "a zip for a rig": (["--way", "cycles", "--extension", "FILE"], "The file has no Cycles rig"),
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


def test_what_tiles_cannot_be_of_is_refused(command, saved, tmp_path, capsys):
    words = ("job", saved, "-o", tmp_path / "job", "--way", "engine", "--no-price", "--tiles", "2x2")
    scene = bpy.context.scene
    scene.render.use_freestyle = True
    bpy.ops.wm.save_mainfile()
    assert command(*words) == 1
    assert "Freestyle draws its lines over whole pictures" in capsys.readouterr().err
    scene = bpy.context.scene
    scene.render.use_freestyle = False
    editor = scene.sequence_editor_create()
    strips = editor.strips if hasattr(editor, "strips") else editor.sequences
    strips.new_scene(name="Scene", scene=scene, channel=1, frame_start=1)
    bpy.ops.wm.save_mainfile()
    assert command(*words) == 1
    assert "switch the sequencer off" in capsys.readouterr().err
    assert not (tmp_path / "job").exists()


def test_movies_are_refused(command, saved, tmp_path, capsys):
    settings = bpy.context.scene.render.image_settings
    if hasattr(settings, "media_type"):
        settings.media_type = "VIDEO"
    settings.file_format = "FFMPEG"
    bpy.ops.wm.save_mainfile()
    assert command("job", saved, "-o", tmp_path / "job", "--way", "engine", "--no-price") == 1
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


def test_the_button_tells_the_price_of_the_command(addon, command, saved, tmp_path, capsys):
    """Another Blender runs it: its line is one of the command, and what it prints is what the button says."""
    module = addon("operators.image.render_job_export")
    options = argparse.Namespace(
        way="engine", chunk=2, tiles=(2, 1), camera="", resume=True, extension=None, blender="blender"
    )
    program, *words = module.price_command("/blender", str(saved), str(tmp_path / "job"), options)
    assert program == "/blender" and words[:3] == ["--background", "--command", "scfpf"]
    capsys.readouterr()
    assert command(*words[3:]) == 0
    told = capsys.readouterr().out
    needs, price = module.told_lines(told)
    assert re.fullmatch(
        r"6 tiles × [\d.]+ s \+ 4 tasks × [\d.]+ s to begin = .* on one machine as this", price
    )
    assert needs.startswith("A worker needs Blender") and "GB of memory" in needs
    template = (tmp_path / "job" / "template.json").read_text(encoding="utf-8")
    assert '"default": "true"' in template and "amount.worker.memory" in template
    assert module.told_lines("Blender says other things\n") == []


def test_the_button_needs_a_saved_file_and_a_flexible_camera(scene, tmp_path):
    bpy.ops.wm.read_homefile(use_empty=True, use_factory_startup=True)
    with pytest.raises(RuntimeError, match="Make a flexible camera the scene's camera first"):
        bpy.ops.scfpf.render_job_export(directory=str(tmp_path / "job"))
    bpy.ops.scfpf.camera_add()
    with pytest.raises(RuntimeError, match="Save the file first"):
        bpy.ops.scfpf.render_job_export(directory=str(tmp_path / "job"))
    assert not (tmp_path / "job").exists()
