# SPDX-License-Identifier: GPL-3.0-or-later
"""A session for test_crashes.py: every operator of ours, called as scripts call it, then undone and redone.

Scripts store no step of undo by default. Undo then goes from the last stored step to the one before it, and
datablocks on which both agree would stay in memory as the operator has left them.
"""

import os
import pathlib
import sys
import traceback

import bpy

sys.path.append(str(pathlib.Path(__file__).parent))

from stored_edit import dangling

EXTENSION = "bl_ext.checkout.scfpf"
# Steps that agree on everything: Blender writes a datablock anew in the first one after an edit.
STEPS = 3
# Options of operators whose defaults do nothing here.
OPTIONS = {"preset_apply": {"preset": "curved_convergence"}, "camera_blend_preset": {"preset": "telephoto"}}
# Operators that take seconds and are tested by random sessions: they look for pins, or write files.
LEFT_OUT = {"aim_solve", "aim_drag", "preset_load", "preset_apply_own", "st_map_write"}
CALLED = []


def _scene():
    bpy.ops.wm.read_homefile(use_empty=True, use_factory_startup=True)
    bpy.context.scene.render.resolution_x, bpy.context.scene.render.resolution_y = 32, 18
    bpy.ops.mesh.primitive_cube_add(location=(0, 0, -3))
    bpy.ops.scfpf.camera_add()
    other = bpy.context.object
    bpy.ops.scfpf.camera_add()
    camera = bpy.context.object
    bpy.context.scene.camera = camera
    camera.scfpf.pixel_error = 2.0
    bpy.ops.scfpf.mapping_add()
    other.select_set(True)
    bpy.data.objects["Cube"].select_set(True)
    bpy.ops.scfpf.aim_view_add()
    bpy.context.view_layer.update()
    for number in range(STEPS):
        bpy.ops.ed.undo_push(message=f"step {number}")
    return camera.name


def _facts():
    """Names of objects, their parents, and what cameras list."""
    objects = sorted((o.name, o.parent and o.parent.name, len(o.users_collection)) for o in bpy.data.objects)
    cameras = [o for o in bpy.data.objects if o.type == "CAMERA"]
    listed = [[s.object and s.object.name for s in c.scfpf.surfaces] for c in cameras]
    return objects, listed


class SCENE_OT_foreign_edit(bpy.types.Operator):
    """An operator of another extension, which stores a step and calls ours without one."""

    bl_idname = "scene.foreign_edit"
    bl_label = "Foreign Edit"
    bl_options = {"REGISTER", "UNDO"}  # noqa: RUF012

    def execute(self, _context):
        return bpy.ops.scfpf.camera_add()


def _with_a_step():
    bpy.ops.scfpf.camera_add("EXEC_DEFAULT", True)


def _pushed_after():
    bpy.ops.scfpf.camera_add()
    bpy.ops.ed.undo_push(message="by the script")


def _in_another_operator():
    bpy.ops.scene.foreign_edit("EXEC_DEFAULT", True)


def _twice():
    bpy.ops.scfpf.camera_add()
    bpy.ops.scfpf.camera_add()


# Ways of scripts to edit, each of which one undo takes back.
WAYS = (_with_a_step, _pushed_after, _in_another_operator, _twice)


def _ways():
    bpy.utils.register_class(SCENE_OT_foreign_edit)
    for way in WAYS:
        _scene()
        CALLED.append(way.__name__)
        before = _facts()
        way()
        after = _facts()
        bpy.ops.ed.undo()
        assert _facts() == before, way
        bpy.ops.ed.redo()
        assert _facts() == after, way
    # A step that is stored later holds both edits, and undo takes back both.
    bpy.ops.scfpf.camera_add()
    bpy.ops.mesh.primitive_cube_add("EXEC_DEFAULT", True)
    bpy.ops.ed.undo()
    assert _facts() == after, "later"


def _disabled():
    """The extension is disabled after an edit, and then nothing of ours stores a step before undo."""
    for operator in (bpy.ops.scfpf.cycles_rig, bpy.ops.scfpf.camera_from_camera, bpy.ops.scfpf.surface_add):
        _scene()
        CALLED.append("disabled")
        operator()
        assert bpy.ops.preferences.addon_disable(module=EXTENSION) == {"FINISHED"}
        bpy.context.view_layer.update()
        for move in (bpy.ops.ed.undo, bpy.ops.ed.undo, bpy.ops.ed.redo):
            move()
            bpy.context.view_layer.update()
        assert bpy.ops.preferences.addon_enable(module=EXTENSION) == {"FINISHED"}


@bpy.app.handlers.persistent
def _look(*_):
    """Right after Blender has gone back, before anything follows a pointer."""
    if lost := dangling():
        print(f"After {CALLED[-1]} these point to what is gone: {lost}", file=sys.stderr, flush=True)
        os._exit(1)


def main() -> None:
    bpy.context.preferences.extensions.repos.new(
        name="checkout", module="checkout", custom_directory=sys.argv[-1], remote_url=""
    )
    assert bpy.ops.preferences.addon_enable(module=EXTENSION) == {"FINISHED"}
    for handlers in (bpy.app.handlers.undo_post, bpy.app.handlers.redo_post):
        handlers.insert(0, _look)
    for name in sorted(set(dir(bpy.ops.scfpf)) - LEFT_OUT):
        operator = getattr(bpy.ops.scfpf, name)
        if "UNDO" not in operator.bl_options:
            continue
        _scene()
        if not operator.poll():
            continue
        CALLED.append(name)
        print(name, flush=True)
        before, edits = _facts(), sum(scene.scfpf_edits for scene in bpy.data.scenes)
        try:
            operator(**OPTIONS.get(name, {}))
        except RuntimeError as error:
            print(f"{name}: {error}")
            continue
        assert sum(scene.scfpf_edits for scene in bpy.data.scenes) > edits, f"{name} does not note its edit"
        after = _facts()
        bpy.ops.ed.undo()
        bpy.context.view_layer.update()
        assert _facts() == before, name
        bpy.ops.ed.redo()
        bpy.context.view_layer.update()
        assert _facts() == after, name
    _ways()
    _disabled()
    print("SURVIVED", len(CALLED), flush=True)


try:
    main()
except Exception:
    traceback.print_exc()
sys.stderr.flush()
os._exit(0)  # Blender 4.5's module may wait for itself at its own end
