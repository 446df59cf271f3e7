# SPDX-License-Identifier: GPL-3.0-or-later
"""``blender -c scfpf``: its output, and one line on stderr for every error."""

import threading

import bpy
import numpy as np
import pytest


@pytest.fixture
def blend(tmp_path):
    """A file with a flexible camera, an ordinary one and an object that moves."""
    scene = bpy.context.scene
    scene.render.resolution_x, scene.render.resolution_y = 32, 18
    scene.cycles.samples, scene.cycles.use_denoising = 1, False
    bpy.ops.mesh.primitive_cube_add()
    cube = bpy.context.object
    for frame, x in ((1, -1.5), (11, 1.5)):
        cube.location.x = x
        cube.keyframe_insert("location", frame=frame)
    bpy.ops.object.light_add(type="SUN")
    bpy.ops.scfpf.camera_add()
    bpy.context.object.scfpf.samples = 1
    bpy.ops.object.camera_add()
    bpy.context.object.name = "Ordinary"
    path = tmp_path / "scene.blend"
    bpy.ops.wm.save_as_mainfile(filepath=str(path))
    return path


@pytest.fixture
def run(addon):
    return lambda *arguments: addon("bridge.render.command_line").run([str(one) for one in arguments])


def picture(path):
    image = bpy.data.images.load(str(path))
    values = np.empty(len(image.pixels), np.float32)
    image.pixels.foreach_get(values)
    bpy.data.images.remove(image)
    return values


def test_render_writes_the_image_and_says_so(run, blend, tmp_path, capsys):
    output = tmp_path / "out.png"
    assert run("render", blend, "-o", output) == 0
    captured = capsys.readouterr()
    assert "32×18" in captured.out and captured.err == ""
    assert output.read_bytes()[:8] == b"\x89PNG\r\n\x1a\n"
    values = picture(output)
    assert len(values) == 32 * 18 * 4 and np.ptp(values) > 0


@pytest.mark.parametrize(
    ("ending", "form", "intensity"), [("png", "PNG", 0.0), ("png", "PNG", 1.5), ("jpg", "JPEG", 1.5)]
)
def test_files_are_dithered_as_f12_does(run, blend, tmp_path, ending, form, intensity):
    scene = bpy.context.scene
    scene.camera = bpy.data.objects["Flexible Camera"]
    scene.render.engine, scene.render.dither_intensity = "SCFPF", intensity
    scene.render.image_settings.file_format = form
    scene.render.image_settings.color_mode = "RGB"
    bpy.ops.wm.save_mainfile()
    scene.render.filepath = str(tmp_path / "f12")
    bpy.ops.render.render(write_still=True)
    scene.render.dither_intensity = 0.0 if intensity else 1.5
    scene.render.filepath = str(tmp_path / "other")
    bpy.ops.render.render(write_still=True)
    scenes = len(bpy.data.scenes)
    assert run("render", blend, "-o", tmp_path / f"out.{ending}") == 0
    made, f12, other = (picture(tmp_path / f"{name}.{ending}") for name in ("out", "f12", "other"))
    np.testing.assert_array_equal(made, f12)
    assert not np.array_equal(f12, other)
    assert len(bpy.data.scenes) == scenes and not hasattr(bpy.types, "SCFPF_DitheringEngine")
    assert not bpy.data.objects.get("SCFPF Dither")


def test_frame_camera_and_pixel_error_are_obeyed(run, blend, tmp_path):
    pictures = []
    for frame in (1, 11):
        output = tmp_path / f"{frame}.png"
        assert run("render", blend, "-o", output, "--frame", frame, "--camera", "Flexible Camera") == 0
        assert bpy.context.scene.frame_current == frame
        pictures.append(picture(output))
    assert not np.array_equal(*pictures)
    assert run("render", blend, "-o", tmp_path / "exact.png", "--pixel-error", 0) == 0


def test_cycles_writes_frames(run, blend, tmp_path, capsys):
    assert run("render", blend, "--cycles", "--frames", 6, 7, "-o", tmp_path / "at_##.png") == 0
    captured = capsys.readouterr()
    assert "32×18 by Cycles" in captured.out and captured.err == ""
    first, last = (picture(tmp_path / name) for name in ("at_06.png", "at_07.png"))
    assert (first.reshape(-1, 4)[:, :3] > 0).any() and (first != last).any()
    assert run("render", blend, "--frames", 1, 2, "-o", tmp_path / "a.png") == 1
    assert "--frames needs --cycles" in capsys.readouterr().err


def test_blend_file_itself_is_left_alone(run, blend, tmp_path):
    before = blend.read_bytes()
    assert run("render", blend, "-o", tmp_path / "out.png") == 0
    assert blend.read_bytes() == before


FAILURES = {
    "no command": ([], "COMMAND"),
    "unknown command": (["paint"], "invalid choice"),
    "no file": (["render", "-o", "OUT"], "required"),
    "no output": (["render", "FILE"], "required"),
    "missing file": (["render", "nowhere.blend", "-o", "OUT"], "no file"),
    "not a blend file": (["render", "NOTE", "-o", "OUT"], "cannot open"),
    "output is a folder": (["render", "FILE", "-o", "FOLDER"], "it is a folder"),
    "no output folder": (["render", "FILE", "-o", "FOLDER/none/out.png"], "no folder"),
    "output in a file": (["render", "FILE", "-o", "NOTE/out.png"], "no folder"),
    "unknown ending": (["render", "FILE", "-o", "FOLDER/out.foo"], "use one of .png"),
    "unwritable": (["render", "FILE", "-o", "FOLDER/" + 300 * "x" + ".png"], "annot write"),
    "unknown camera": (["render", "FILE", "-o", "OUT", "--camera", "Nobody"], 'no object "Nobody"'),
    "ordinary camera": (["render", "FILE", "-o", "OUT", "--camera", "Ordinary"], "not a flexible camera"),
    "not a camera": (["render", "FILE", "-o", "OUT", "--camera", "Cube"], "not a flexible camera"),
    "bad pixel error": (["render", "FILE", "-o", "OUT", "--pixel-error", "fine"], "'fine' is not a number"),
    "negative pixel error": (["render", "FILE", "-o", "OUT", "--pixel-error=-1"], "'-1' is not a number"),
    "infinite pixel error": (
        ["render", "FILE", "-o", "OUT", "--pixel-error", "inf"],
        "'inf' is not a number",
    ),
    "bad frame": (["render", "FILE", "-o", "OUT", "--frame", "1.5"], "'1.5' is not the number of a frame"),
    "frame out of range": (
        ["render", "FILE", "-o", "OUT", "--frame", "2000000"],
        "not the number of a frame",
    ),
    "unknown option": (["render", "FILE", "-o", "OUT", "--fast"], "--fast"),
}


@pytest.mark.parametrize("case", FAILURES)
def test_failure_is_one_line_on_stderr_and_a_code(run, blend, tmp_path, capsys, case):
    arguments, reason = FAILURES[case]
    (tmp_path / "note.txt").write_text("no blend file")
    places = {"FILE": blend, "OUT": tmp_path / "out.png", "NOTE": tmp_path / "note.txt", "FOLDER": tmp_path}
    words = [
        "/".join(str(places.get(part, part)) for part in word.split("/"))
        if word.split("/")[0] in places
        else word
        for word in arguments
    ]
    assert run(*words) != 0
    error = capsys.readouterr().err
    assert reason in error
    assert error.startswith("scfpf: ") and error.count("\n") == 1
    assert not (tmp_path / "out.png").exists()


def test_a_scene_s_own_format_that_is_not_written_is_reported_before_the_render(
    addon, run, blend, tmp_path, capsys, monkeypatch
):
    bpy.context.scene.render.image_settings.file_format = "BMP"
    bpy.ops.wm.save_mainfile()
    monkeypatch.setattr(addon("bridge.render.command_line"), "prepare", None)  # no render begins
    assert run("render", blend, "-o", tmp_path / "out") == 1
    assert "out.bmp': use one of .png" in capsys.readouterr().err


def test_file_without_a_flexible_camera_and_with_too_many(run, blend, tmp_path, capsys):
    bpy.context.scene.camera = bpy.data.objects["Ordinary"]
    bpy.ops.wm.save_mainfile()
    assert run("render", blend, "-o", tmp_path / "one.png") == 0, "the only flexible camera is meant"
    bpy.ops.scfpf.camera_add()
    bpy.ops.wm.save_mainfile()
    assert run("render", blend, "-o", tmp_path / "two.png") == 1
    assert "Flexible Camera, Flexible Camera.001" in capsys.readouterr().err
    for camera in [obj for obj in bpy.data.objects if obj.type == "CAMERA"]:
        camera.scfpf.enabled = False
    bpy.ops.wm.save_mainfile()
    assert run("render", blend, "-o", tmp_path / "none.png") == 1
    assert "no flexible camera" in capsys.readouterr().err


def test_scene_that_cannot_be_rendered_is_one_line(run, blend, tmp_path, capsys):
    bpy.data.objects.remove(bpy.data.objects["Cube"])
    bpy.ops.wm.save_mainfile()
    assert run("render", blend, "-o", tmp_path / "out.png") == 1
    assert "nothing to render" in capsys.readouterr().err


@pytest.mark.parametrize("arguments", [["--help"], ["render", "--help"]])
def test_help_is_shown(run, capsys, arguments):
    assert run(*arguments) == 0
    assert "usage: blender -c scfpf" in capsys.readouterr().out


def test_a_full_disk_is_a_line_and_a_code(addon, run, blend, tmp_path, capsys, monkeypatch):
    output = tmp_path / "out.png"
    output.write_bytes(b"an earlier picture")
    module = addon("bridge.render.image_file")
    monkeypatch.setattr(module, "is_complete_image", lambda _path: False)
    assert run("render", blend, "-o", output) == 1
    captured = capsys.readouterr()
    assert "the file is incomplete" in captured.err and captured.err.count("\n") == 1
    assert "32×18" not in captured.out
    assert output.read_bytes() == b"an earlier picture"


def test_a_place_that_cannot_be_written_is_reported_before_the_render(addon, run, blend, capsys, monkeypatch):
    monkeypatch.setattr(addon("bridge.render.command_line"), "prepare", None)  # no render begins
    assert run("render", blend, "-o", blend.parent / f"{300 * 'x'}.png") == 1
    assert "annot write" in capsys.readouterr().err


def test_a_thread_that_cannot_start_is_a_line_and_a_code(run, blend, tmp_path, capsys, monkeypatch):
    def refused(_thread):
        raise RuntimeError("can't start new thread")

    with monkeypatch.context() as patched:
        patched.setattr(threading.Thread, "start", refused)
        assert run("render", blend, "-o", tmp_path / "out.png") == 1
    error = capsys.readouterr().err
    assert error.startswith("scfpf: The system starts no more threads") and error.count("\n") == 1
    with monkeypatch.context() as patched:
        patched.setattr(threading.Thread, "start", refused)
        with pytest.raises(RuntimeError, match="starts no more threads"):
            bpy.ops.scfpf.render()
    assert bpy.ops.scfpf.render() == {"FINISHED"}, "the next one is whole"


def test_frames_have_the_step_of_the_scene_or_of_the_line(run, blend, tmp_path, capsys):
    bpy.context.scene.frame_step = 3
    bpy.ops.wm.save_mainfile()
    words = ("render", blend, "--engine", "workbench", "-o")
    assert run(*words, tmp_path / "a_##.png", "--frames", 2, 9) == 0
    assert run(*words, tmp_path / "b_##.png", "--frames", 2, 6, 2) == 0
    assert sorted(path.name for path in tmp_path.glob("*.png")) == [
        *("a_02.png", "a_05.png", "a_08.png", "b_02.png", "b_04.png", "b_06.png")
    ]
    capsys.readouterr()
    for frames in ((1,), (1, 2, 3, 4), (1, 2, 0)):
        assert run(*words, tmp_path / "c_##.png", "--frames", *frames) == 1
        assert "--frames needs a first frame, a last one" in capsys.readouterr().err
    assert run(*words, tmp_path / "c_##.png", "--frames", 5, 1) == 1
    assert "The last frame 1 comes before the first one 5" in capsys.readouterr().err


def test_another_engine_is_joined_for_one_frame_and_several(run, blend, tmp_path, capsys):
    output = tmp_path / "one.png"
    assert run("render", blend, "-o", output, "--engine", "workbench") == 0
    told = capsys.readouterr()
    assert "32×18 by Workbench" in told.out
    assert len(picture(output)) == 32 * 18 * 4 and np.ptp(picture(output)) > 0
    assert run("render", blend, "-o", tmp_path / "f_##.png", "--engine", "workbench", "--frames", 1, 11) == 0
    frames = [picture(tmp_path / f"f_{frame:02d}.png") for frame in (1, 11)]
    assert np.abs(frames[0] - frames[1]).max() > 0.05


@pytest.mark.parametrize("more", [("--cycles",), ("--style", "ink"), ("--pixel-error", 1)])
def test_options_that_another_engine_does_not_have_are_refused(run, blend, tmp_path, capsys, more):
    assert run("render", blend, "-o", tmp_path / "out.png", "--engine", "eevee", *more) == 1
    assert "--engine" in capsys.readouterr().err
    assert not (tmp_path / "out.png").exists()
