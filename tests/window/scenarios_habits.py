# SPDX-License-Identifier: GPL-3.0-or-later
"""Blender's habits with its own keys and areas."""

import tempfile

import bpy
from driver import DRAW

KEY = 0.5


def _select(*objects):
    for obj in bpy.context.view_layer.objects:
        obj.select_set(obj in objects)
    bpy.context.view_layer.objects.active = objects[-1]


def _surfaces(camera):
    return [slot.object for slot in camera.scfpf.surfaces]


def _volumes():
    """Names of the volume objects, and of the cameras that they serve."""
    cameras = [o for o in bpy.data.objects if o.type == "CAMERA" and o.scfpf.enabled]
    serving = {c.scfpf.volume_object.name: c.name for c in cameras if c.scfpf.volume_object}
    return {o.name: serving.get(o.name) for o in bpy.data.objects if o.scfpf_surface.is_volume}


def _hide(camera):
    for surface in _surfaces(camera):
        surface.hide_set(True)


def _undo(driver, times, key="ed.undo"):
    operator = bpy.ops.ed.undo if key == "ed.undo" else bpy.ops.ed.redo
    for _ in range(times):
        with driver.override():
            if not operator.poll():
                return
            operator()
        yield 0.1


def duplicates(driver):
    """Shift-D of a camera with its surfaces, hidden afterwards; many undos; X on the camera."""
    driver.add_camera("cylindrical_panorama")
    camera = bpy.context.scene.camera
    yield DRAW
    _select(*_surfaces(camera), camera)
    driver.key("D", shift=True)
    yield KEY
    driver.key("RET")
    yield DRAW
    copy = bpy.context.view_layer.objects.active
    assert copy != camera and copy.type == "CAMERA"
    assert _volumes() == {
        camera.scfpf.volume_object.name: camera.name,
        copy.scfpf.volume_object.name: copy.name,
    }
    copy.location.x += 12
    _hide(copy)
    with driver.override():
        bpy.ops.ed.undo_push(message="Hide")
        bpy.ops.view3d.view_all()
    yield 2 * DRAW
    driver.shot("duplicate-hidden")
    for _step in range(8):
        _select(copy)
        copy.location.z += 1
        with driver.override():
            bpy.ops.ed.undo_push(message="Move")
        driver.key("D", shift=True)
        yield 0.2
        driver.key("RET")
        yield 0.2
        with driver.override():
            bpy.ops.object.delete("EXEC_DEFAULT", True)
        yield 0.2
        copy = bpy.data.objects[copy.name]
    whole = _volumes()
    assert len(whole) == 2, whole
    yield from _undo(driver, 16)
    yield DRAW
    yield from _undo(driver, 16, "redo")
    yield DRAW
    assert _volumes() == whole, _volumes()
    copy = bpy.data.objects["Flexible Camera.001"]
    _select(copy)
    with driver.override():
        bpy.ops.object.delete("EXEC_DEFAULT", True)
    yield DRAW
    assert "Flexible Camera.001" not in bpy.data.objects and len(_volumes()) == 1, _volumes()
    driver.shot("camera-deleted")
    yield from _undo(driver, 1)
    yield DRAW
    assert _volumes() == whole, _volumes()


def outliner_duplicate(driver):
    """The Outliner's Duplicate Collection, with hidden surfaces."""
    rig = bpy.data.collections.new("Rig")
    bpy.context.scene.collection.children.link(rig)
    layer = bpy.context.view_layer.layer_collection.children["Rig"]
    bpy.context.view_layer.active_layer_collection = layer
    driver.add_camera()
    camera = bpy.context.scene.camera
    assert camera.name in rig.objects
    _hide(camera)
    yield DRAW
    # The Outliner's own area has four lines.
    area = driver.area("PROPERTIES")
    area.ui_type = "OUTLINER"
    yield DRAW
    region = next(region for region in area.regions if region.type == "WINDOW")
    # The collection's row is selected with a click: its place is that of the third line.
    for line in range(2, 14):
        x, y = area.x + 90, area.y + area.height - 28 - 20 * line
        driver.window.event_simulate("MOUSEMOVE", "NOTHING", x=x, y=y)
        driver.window.event_simulate("LEFTMOUSE", "PRESS", x=x, y=y)
        driver.window.event_simulate("LEFTMOUSE", "RELEASE", x=x, y=y)
        yield KEY
        with bpy.context.temp_override(window=driver.window, area=area, region=region):
            if [i.name for i in bpy.context.selected_ids if i.id_type == "COLLECTION"] == ["Rig"]:
                bpy.ops.outliner.collection_duplicate()
                break
    else:
        raise AssertionError("the collection's row was not found")
    yield DRAW
    assert len(_volumes()) == 2 and None not in _volumes().values(), _volumes()
    copy = next(o for o in bpy.data.objects if o.type == "CAMERA" and o.scfpf.enabled and o != camera)
    assert not set(_surfaces(copy)) & set(_surfaces(camera))
    copy.location.x += 10
    with driver.override():
        bpy.ops.view3d.view_all()
    yield DRAW
    driver.shot("outliner-duplicate")


def paste(driver):
    """Ctrl-C in one file, Ctrl-V in another, of the camera alone and with its surfaces."""
    for everything in (False, True):
        bpy.ops.wm.read_homefile(use_factory_startup=False, use_splash=False)
        yield DRAW
        driver.add_camera("angular_fisheye")
        camera = bpy.context.scene.camera
        yield DRAW
        _select(*(_surfaces(camera) if everything else ()), camera)
        driver.key("C", ctrl=True)
        yield DRAW
        bpy.ops.wm.read_homefile(use_factory_startup=False, use_splash=False)
        yield DRAW
        driver.key("V", ctrl=True)
        yield DRAW
        (pasted,) = [o for o in bpy.context.scene.objects if o.type == "CAMERA" and o.scfpf.enabled]
        assert len(_surfaces(pasted)) == 2 and {o.parent for o in _surfaces(pasted)} == {pasted}
        assert _volumes() == {pasted.scfpf.volume_object.name: pasted.name}
        _hide(pasted)
        with driver.override():
            bpy.ops.view3d.view_all()
        yield DRAW
        driver.shot(f"pasted-{'all' if everything else 'camera'}")
        bpy.context.scene.camera = pasted
        bpy.context.scene.render.resolution_percentage = 20
        driver.start_render()
        yield from driver.finished()
        assert pasted.scfpf.report
        path = tempfile.mktemp(suffix=".blend")
        bpy.ops.wm.save_as_mainfile(filepath=path)
        bpy.ops.wm.open_mainfile(filepath=path)
        yield DRAW
        assert len(_volumes()) == 1


def snap(driver):
    """Near Surface to View in a viewport, undone and redone."""
    driver.add_camera()
    yield DRAW
    near = _surfaces(bpy.context.scene.camera)[0].name
    before = bpy.data.objects[near].matrix_world.copy()
    with driver.override():
        bpy.ops.view3d.view_orbit(angle=0.5, type="ORBITLEFT")
    yield DRAW
    with driver.override():
        assert bpy.ops.scfpf.surface_snap_to_view("EXEC_DEFAULT", True) == {"FINISHED"}
    yield DRAW
    after = bpy.data.objects[near].matrix_world.copy()
    assert (
        max(
            abs(a - b)
            for row, other in zip(before, after, strict=True)
            for a, b in zip(row, other, strict=True)
        )
        > 0.01
    )
    yield from _undo(driver, 1)
    yield KEY
    assert bpy.data.objects[near].matrix_world == before
    yield from _undo(driver, 1, "redo")
    yield KEY
    assert bpy.data.objects[near].matrix_world == after
    driver.shot("snap")


SCENARIOS = (duplicates, outliner_duplicate, paste, snap)
