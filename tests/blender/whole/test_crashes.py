# SPDX-License-Identifier: GPL-3.0-or-later
"""Steps by which random sessions have crashed Blender, each in a process that may crash."""

import os
import subprocess
from pathlib import Path

import pytest
from interpreters import after, interpreter

BEGIN = """
import importlib, sys, bpy
repository = sys.argv[-1]
bpy.context.preferences.extensions.repos.new(
    name="checkout", module="checkout", custom_directory=repository, remote_url="")
assert bpy.ops.preferences.addon_enable(module="bl_ext.checkout.scfpf") == {"FINISHED"}
bpy.ops.wm.read_homefile(use_empty=True, use_factory_startup=True)
bpy.ops.mesh.primitive_cube_add()
cube = bpy.context.object
bpy.ops.scfpf.camera_add()
camera, scene = bpy.context.object, bpy.context.scene

def drive(obj, other):
    driver = obj.driver_add("location", 0).driver
    variable = driver.variables.new()
    variable.name = driver.expression = "width"
    target = variable.targets[0]
    target.id_type, target.id, target.data_path = "SCENE", other, "render.resolution_x"
"""
END = """
bpy.context.view_layer.update()
print("SURVIVED", flush=True)
"""

# Blender 5.2 evaluates once more after a handler that unlinks something, and follows drivers into the
# other scene, whose view layers it has not brought in step.
# What a handler swapped after the step was stored, a kept object pointed to once that step was gone back to.
CASES = {
    "the volume's node group gets another name, then a thing is moved, undone and redone": """
bpy.ops.ed.undo_push(message="Add")
bpy.data.node_groups["SCFPF Volume 2"].name = "Another"
bpy.ops.ed.undo_push(message="Rename")
name = cube.name
for step in range(2):
    bpy.data.objects[name].location.x += 1.0
    bpy.ops.ed.undo_push(message="Move")
    for move in (bpy.ops.ed.undo, bpy.ops.ed.redo, bpy.ops.ed.undo, bpy.ops.ed.redo):
        move()
        bpy.context.view_layer.update()
assert "SCFPF Volume 2" not in bpy.data.node_groups and "Another" in bpy.data.node_groups
""",
    "a rig is rendered, without the compositor, in a scene with hair that has no bounds": """
scene.collection.objects.link(bpy.data.objects.new("Hair", bpy.data.hair_curves.new("Hair")))
render = scene.render
render.use_compositing = render.use_sequencer = False
render.resolution_x, render.resolution_y, scene.cycles.samples = 16, 9, 1
assert bpy.ops.scfpf.cycles_rig() == {"FINISHED"}
assert bpy.ops.render.render() == {"FINISHED"}
""",
    "a camera is deleted from a linked copy of its scene, which a driver reads": """
drive(cube, scene)
bpy.ops.scene.new(type="LINK_COPY")
bpy.ops.object.delete()
""",
}


@pytest.mark.parametrize("case", CASES)
def test_blender_survives(case, tmp_path, extension):
    script = tmp_path / "session.py"
    script.write_text(BEGIN + CASES[case] + END)
    check_survives(script, tmp_path, extension)


def test_blender_survives_undo_of_what_was_followed(tmp_path, extension):
    check_survives(Path(__file__).parents[1] / "support" / "undo_followed.py", tmp_path, extension)


def test_blender_survives_undo_of_operators_without_a_step(tmp_path, extension):
    check_survives(Path(__file__).parents[1] / "support" / "undo_unstored.py", tmp_path, extension)


def check_survives(script, tmp_path, extension):
    repository = os.path.dirname(os.path.dirname(extension.__file__))
    done = subprocess.run(
        [*interpreter(), str(script), *after(), repository],
        env={**os.environ, "BLENDER_USER_RESOURCES": str(tmp_path)},
        cwd=tmp_path,
        capture_output=True,
        text=True,
        timeout=300,
        check=False,
    )
    assert "SURVIVED" in done.stdout, f"ended with {done.returncode}: {done.stderr[-2000:]}"
    assert "Traceback" not in done.stdout + done.stderr
