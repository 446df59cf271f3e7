# SPDX-License-Identifier: GPL-3.0-or-later
"""`dev.py corpus`: what its table says of images, warnings, crashes, exceptions and a time that is over."""

import bpy
import pytest
from interpreters import after, interpreter

from devtools import corpus

TRACEBACK = "Traceback (most recent call last):\n  File 'x.py', line 1\nbpy.SomeError: no such thing"


@pytest.mark.parametrize(
    "log, status, faults, warnings",
    [
        ('@@ begins\nWarning: Too dark\n@@ figures {"seconds": 1.0}', 0, [], ["Too dark"]),
        ('Warning: Old file\n@@ begins\n@@ figures {"seconds": 1.0}', 0, [], []),
        ('@@ begins\nWarning: Twice\nWarning: Twice\n@@ figures {"seconds": 1.0}', 0, [], ["Twice"]),
        ("@@ begins", -11, ["CRASH: SIGSEGV"], []),
        ("@@ begins", None, ["not done after 9 s"], []),
        (f"@@ begins\n{TRACEBACK}", 1, ["exit code 1", "TRACEBACK: bpy.SomeError: no such thing"], []),
        (
            f'@@ begins\n{TRACEBACK}\n@@ figures {{"seconds": 1.0}}',
            0,
            ["TRACEBACK: bpy.SomeError: no such thing"],
            [],
        ),
    ],
)
def test_a_log_tells_what_went_wrong(log, status, faults, warnings):
    row = {"file": "a|b.blend", "way": "rig", **corpus.read_log(log, status, 9.0)}
    assert row["faults"] == faults and row["warnings"] == warnings
    shown = corpus.cells(row)
    assert len(shown) == len(corpus.HEAD)
    assert all(text in shown[-1] for text in (*faults, *warnings))


def test_a_file_is_rendered_beside_an_ordinary_camera(tmp_path):
    """A ball before an ordinary camera, in Live View."""
    scene = bpy.context.scene
    camera = bpy.data.objects.new("Camera", bpy.data.cameras.new("Camera"))
    scene.collection.objects.link(camera)
    scene.camera = camera
    bpy.ops.mesh.primitive_uv_sphere_add(location=(0.0, 0.0, -5.0))
    scene.world = bpy.data.worlds.new("World")
    bpy.ops.wm.save_as_mainfile(filepath=str(tmp_path / "ball.blend"), copy=True)
    words = [str(tmp_path), "--output", str(tmp_path / "out"), "--width", "48", "--samples", "4"]
    chosen = corpus.options([*words, "--only", "live"])
    blender = corpus.Program("this Blender", tuple(interpreter()), tuple(after()))
    rows = corpus.render(blender, [tmp_path / "ball.blend"], chosen)
    assert [row["way"] for row in rows] == ["camera", "live"]
    assert not any(row["faults"] for row in rows)
    assert rows[0]["figures"]["rmse"] < 0.05 and rows[1]["figures"]["coverage"] < 0.02
    assert (tmp_path / "out" / "ball_blend" / "camera.png").is_file()
    report = (tmp_path / "out" / "report.md").read_text(encoding="utf-8")
    assert report.count("| ball.blend |") == 2
