# SPDX-License-Identifier: GPL-3.0-or-later
"""Look Behind pressed in the sidebar: its list, a view by one press, undo, and a file opened again."""

import math
import pathlib
import tempfile
import time

import bpy
from driver import DRAW, PATIENCE
from scenarios_aim import block
from scenarios_clicks import select_only
from scenarios_live import settled
from scenarios_panels import opened

# Where rows of the list have their buttons, as a share of the sidebar's width.
AT_END = 0.78


def prepare(driver):
    """Generator: a head and a smaller ball behind a wall, and a viewport that looks at the picture."""
    for obj in list(bpy.data.objects):
        bpy.data.objects.remove(obj)
    bpy.ops.mesh.primitive_plane_add(size=60)
    bpy.context.object.name = "Ground"
    block("Wall", (0.0, 0.0, 1.5), (3.4, 0.2, 3.0), (0.5, 0.2, 0.1))
    bpy.ops.mesh.primitive_monkey_add(size=3.0, location=(0.3, 4.0, 1.5))
    bpy.context.object.name = "Head"
    bpy.ops.mesh.primitive_uv_sphere_add(radius=0.6, location=(-0.7, 1.5, 1.0))
    bpy.context.object.name = "Ball"
    bpy.ops.object.camera_add(location=(0, -9, 2), rotation=(math.radians(86), 0, 0))
    scene, camera = bpy.context.scene, bpy.context.object
    scene.camera = camera
    scene.render.resolution_x, scene.render.resolution_y, scene.render.resolution_percentage = 640, 360, 50
    select_only(camera.name)
    with driver.override():
        assert bpy.ops.scfpf.camera_toggle("INVOKE_DEFAULT", True) == {"FINISHED"}
        bpy.ops.view3d.view_camera()
        bpy.ops.view3d.view_center_camera()
    driver.area("VIEW_3D").spaces.active.shading.color_type = "MATERIAL"
    opened("SCFPF_PT_view_look_behind")
    yield from driver.show_sidebar()
    yield from settled()


def rows():
    """The list: names, and shares of the picture."""
    return [(row.name, row.share, row.hidden) for row in bpy.context.scene.camera.scfpf.hidden_things]


def until_found(driver):
    """Generator: wait until Look Behind has ended."""
    end = time.monotonic() + PATIENCE
    while any("look_behind" in one.bl_idname for one in driver.window.modal_operators):
        assert time.monotonic() < end, "Look Behind hangs"
        yield 0.1
    yield DRAW


def views():
    return [target.object.name for target in bpy.context.scene.camera.scfpf.aim_targets]


def objects():
    return {obj.name for obj in bpy.data.objects}


def a_hidden_thing_is_shown(driver):
    """What a wall hides is listed, one press on a row adds a view, and Ctrl-Z removes it in one step."""
    yield from prepare(driver)
    before = objects()
    yield from driver.press("scfpf.look_behind")
    yield from until_found(driver)
    driver.shot("list")
    found = rows()
    assert [row[0] for row in found] == ["Head", "Ball"], found
    yield from driver.press("index=1", across=AT_END)
    yield 2 * DRAW
    driver.shot("view")
    assert views() == ["Ball"] and len(objects()) > len(before), views()
    driver.key("Z", ctrl=True)
    yield 2 * DRAW
    driver.shot("undone")
    assert not views() and objects() == before and rows() == found, (views(), objects(), rows())
    path = pathlib.Path(tempfile.mkdtemp(prefix="scfpf-")) / "hidden.blend"
    bpy.ops.wm.save_as_mainfile(filepath=str(path))
    bpy.ops.wm.open_mainfile(filepath=str(path))
    yield from settled()
    assert rows() == found, rows()
    bpy.data.objects.remove(bpy.data.objects["Head"])
    yield from driver.show_sidebar()
    driver.shot("deleted")
    driver.area("DOPESHEET_EDITOR").ui_type = "INFO"
    yield from driver.press("index=0", across=AT_END)
    driver.shot("refused")
    with driver.override("INFO"):
        bpy.ops.info.select_all(action="SELECT")
        bpy.ops.info.report_copy()
    said = bpy.context.window_manager.clipboard
    assert "'Head' is not in the view layer any more: press Look Behind again" in said, said
    # The message is a popup, which takes what is pressed.
    driver.key("ESC")
    yield DRAW
    yield from driver.press("scfpf.look_behind")
    yield from until_found(driver)
    driver.shot("again")
    assert [row[0] for row in rows()] == ["Ball"], rows()


SCENARIOS = (a_hidden_thing_is_shown,)
