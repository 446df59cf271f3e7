# SPDX-License-Identifier: GPL-3.0-or-later
"""Operators that fail at any step leave the file, its settings and the handlers as they were."""

import bpy
import pytest
from file_state import called_in, differences, fault_at, file_state
from rig_scenes import bent_camera, keep_groups, start_anew

# Packages with bpy: a fault in the others is one in their callers.
WATCHED = ("/operators/", "/bridge/", "/cycles/", "/scanline/")
# Functions whose faults leave Blender in no other state: they belong to handlers, which only print them.
UNWATCHED = ("_scene_updated", "_frame_changed", "_evaluated", "concerned", "<lambda>", "<genexpr>")
# Functions that call each other, from an operator down. Deeper ones fail in their callers.
DEPTH = 4


@pytest.fixture(autouse=True)
def empty_file(extension):
    """In place of an empty file."""
    start_anew()
    yield
    keep_groups()


def is_meant(code):
    path = code.co_filename.replace("\\", "/")
    return any(part in path for part in WATCHED) and "scfpf" in path and code.co_name not in UNWATCHED


def check_every_step(action, undo):
    """Let an action fail at the first call of every function that it calls, each time from the same state."""
    action()
    keep_groups()  # building them at each step would take most of the time
    undo()
    bpy.context.view_layer.update()
    codes = called_in(action, is_meant, DEPTH)
    undo()
    bpy.context.view_layer.update()
    before, faults = file_state(), []
    for code in codes:
        with fault_at(code):
            try:
                action()
            except Exception as error:
                told = str(error)
            else:
                # Blender prints the faults of handlers and of updates of properties, and goes on.
                undo()
                bpy.context.view_layer.update()
                before = file_state()
                continue
        after = file_state()
        if found := differences(before, after):
            faults.append((code.co_name, told[-80:], found[:4]))
            undo()
            bpy.context.view_layer.update()
            before = file_state()
    return codes, faults


def test_setting_cycles_up(addon):
    camera = bent_camera(addon)
    scene = bpy.context.scene
    scene.render.engine = "BLENDER_WORKBENCH"
    marker = scene.timeline_markers.new("here", frame=3)
    marker.camera = camera
    rig_of = addon("cycles.rig_data").rig_of
    off = addon("cycles.rig").switch_off

    def undo():
        for collection in list(addon("cycles.rig_data").rigs()):
            off(collection)

    codes, faults = check_every_step(bpy.ops.scfpf.cycles_rig, undo)
    assert len(codes) > 30
    assert faults == []
    assert rig_of(scene) is None


def test_the_nodes_preview(addon):
    bent_camera(addon)
    data, preview = addon("scanline.preview.preview_data"), addon("scanline.preview.preview")

    def undo():
        for source in list(data.previews()):
            preview.switch_off(source)

    codes, faults = check_every_step(bpy.ops.scfpf.preview_toggle, undo)
    assert len(codes) > 20
    assert faults == []
