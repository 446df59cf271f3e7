# SPDX-License-Identifier: GPL-3.0-or-later
"""The nodes preview beside the artist's work: switching on, drags, other workspaces, edit and sculpt mode."""

import sys
import time

import bpy
import numpy as np
from driver import DRAW, PATIENCE, build_scene
from scenarios_preview import (
    SAME,
    SETTLE,
    artist_area,
    look,
    middle,
    prepare,
    preview_areas,
    source_of,
    toggle,
    until_shown,
)


def pictures(source):
    return [part.picture for part in source.scfpf_preview.parts]


def works(source):
    return [modifier.show_viewport for picture in pictures(source) for modifier in picture.modifiers]


def preview_sleeps(driver):
    """A preview in no viewport computes nothing, also of heavy objects; visible again, it has followed."""
    yield from prepare(driver)
    (shown,) = preview_areas(driver)
    source = source_of(bpy.context.scene.camera)
    assert all(works(source))
    before = look(driver, shown, "before")
    bpy.ops.mesh.primitive_grid_add(x_subdivisions=300, y_subdivisions=300, size=3, location=(0, 0, 3))
    yield 2 * SETTLE
    heavy = look(driver, shown, "heavy")
    assert len(pictures(source)) == 2 and np.abs(heavy - before).max() > 0.05
    assert all(picture.local_view_get(shown.spaces.active) for picture in pictures(source))
    own = driver.window.workspace
    driver.window.workspace = bpy.data.workspaces["Modeling"]
    yield SETTLE
    bpy.data.objects["Cube"].location.z += 1.5
    yield SETTLE
    assert not any(works(source)), "it works while nothing shows it"
    driver.shot("elsewhere")
    driver.window.workspace = own
    yield 2 * SETTLE
    assert all(works(source))
    (shown,) = preview_areas(driver)
    assert np.abs(look(driver, shown, "again") - heavy).max() > 0.05


def preview_in_other_modes(driver):
    """It can be switched on and off in edit and sculpt mode, follows there, and undo can be trusted."""
    build_scene()
    driver.add_camera()
    cube, camera = bpy.data.objects["Cube"], bpy.context.scene.camera
    bpy.context.view_layer.objects.active = cube
    cube.select_set(True)
    yield DRAW
    bpy.ops.ed.undo_push(message="ready")
    with driver.override():
        bpy.ops.object.mode_set("EXEC_DEFAULT", True, mode="EDIT")
    toggle(driver)
    yield from until_shown(driver, 1)
    (shown,) = preview_areas(driver)
    before = look(driver, shown, "edit")
    assert bpy.context.mode == "EDIT_MESH" and before.std() > 0.01
    assert not cube.local_view_get(shown.spaces.active)
    with driver.override():
        bpy.ops.mesh.select_all("EXEC_DEFAULT", True, action="SELECT")
        bpy.ops.transform.translate("EXEC_DEFAULT", True, value=(0, 0, 2))
    yield SETTLE
    assert np.abs(look(driver, shown, "edited") - before).max() > 0.05, "edits in edit mode do not show"
    for _ in range(2):
        with driver.override():
            bpy.ops.ed.undo()
        yield DRAW
    with driver.override():
        bpy.ops.ed.redo()
    yield SETTLE
    camera = bpy.context.scene.camera
    if source_of(camera) is not None:
        toggle(driver)
    yield from until_shown(driver, 0)
    with driver.override():
        bpy.ops.object.mode_set("EXEC_DEFAULT", True, mode="SCULPT")
    toggle(driver)
    yield from until_shown(driver, 1)
    driver.shot("sculpt")
    assert bpy.context.mode == "SCULPT"
    toggle(driver)
    yield from until_shown(driver, 0)
    with driver.override():
        bpy.ops.object.mode_set("EXEC_DEFAULT", True, mode="OBJECT")
    assert source_of(bpy.context.scene.camera) is None
    assert not [obj.name for obj in bpy.data.objects if "Preview" in obj.name]


def preview_after_every_mode(driver):
    """It is switched on after each mode; where its viewport cannot be prepared none stays open."""
    build_scene()
    driver.add_camera()
    bpy.ops.mesh.primitive_uv_sphere_add(location=(0, -3, 2))
    ball = bpy.context.object
    bpy.ops.object.grease_pencil_add(type="STROKE")
    strokes = bpy.context.object
    yield DRAW
    meshes = ("SCULPT", "TEXTURE_PAINT", "EDIT")
    drawings = ("PAINT_GREASE_PENCIL", "SCULPT_GREASE_PENCIL", "EDIT")
    for obj, modes in ((ball, meshes), (strokes, drawings)):
        for mode in modes:
            bpy.context.view_layer.objects.active = obj
            with driver.override():
                bpy.ops.object.mode_set("EXEC_DEFAULT", True, mode=mode)
            yield SETTLE
            with driver.override():
                bpy.ops.object.mode_set("EXEC_DEFAULT", True, mode="OBJECT")
            toggle(driver)
            yield from until_shown(driver, 1)
            driver.shot(mode)
            for group in bpy.data.node_groups:
                group.use_fake_user = True  # they would be built anew, which takes seconds
            toggle(driver)
            yield from until_shown(driver, 0)
    preview, viewport = (
        next(module for name, module in sys.modules.items() if name.endswith(f"scanline.preview.{wanted}"))
        for wanted in ("preview", "preview_viewports")
    )
    kept, camera = viewport.show_alone, bpy.context.scene.camera
    try:
        for error in (AttributeError("read-only"), RuntimeError("refused")):

            def fail(*_, error=error):
                raise error

            viewport.show_alone = fail
            try:
                with driver.override():
                    preview.switch_on(bpy.context, camera)
            except (AttributeError, viewport.UserError) as said:
                assert str(error) in str(said)
            else:
                raise AssertionError("a viewport that cannot be prepared is not refused")
            yield from until_shown(driver, 0)
            assert not [obj.name for obj in bpy.data.objects if "Preview" in obj.name]
    finally:
        viewport.show_alone = kept


def stroke(driver, area):
    """Generator: draw with the brush across the middle of a viewport, the button held for some events."""
    x, y = area.x + area.width // 2, area.y + area.height // 2
    driver.window.event_simulate("MOUSEMOVE", "NOTHING", x=x - 60, y=y)
    yield 0.2
    driver.window.event_simulate("LEFTMOUSE", "PRESS", x=x - 60, y=y)
    for step in range(7):
        driver.window.event_simulate("MOUSEMOVE", "NOTHING", x=x - 60 + 20 * step, y=y)
        yield 0.1


def preview_follows_sculpting(driver):
    """Sculpting shows while the brush is down, and undo restores the image."""
    build_scene()
    bpy.ops.mesh.primitive_ico_sphere_add(subdivisions=6, radius=3, location=(0, -3, 2))
    ball = bpy.context.object
    driver.add_camera()
    bpy.context.view_layer.objects.active = ball
    toggle(driver)
    yield from until_shown(driver, 1)
    with driver.override():
        bpy.ops.object.mode_set("EXEC_DEFAULT", True, mode="SCULPT")
    bpy.context.scene.tool_settings.sculpt.brush.strength = 1.0
    (shown,) = preview_areas(driver)
    area = artist_area(driver)
    x, y = area.x + area.width // 2, area.y + area.height // 2
    yield SETTLE
    before = middle(look(driver, shown, "before"))
    driver.window.event_simulate("MOUSEMOVE", "NOTHING", x=x - 60, y=y)
    yield 0.2
    driver.window.event_simulate("LEFTMOUSE", "PRESS", x=x - 60, y=y)
    for step in range(7):
        driver.window.event_simulate("MOUSEMOVE", "NOTHING", x=x - 60 + 20 * step, y=y)
        yield 0.1
    end = time.monotonic() + PATIENCE / 6
    yield SETTLE
    while np.abs(middle(look(driver, shown, "during")) - before).max() <= 0.05:
        assert time.monotonic() < end, "a stroke does not show before its end"
        yield SETTLE
    driver.window.event_simulate("LEFTMOUSE", "RELEASE", x=x + 60, y=y)
    yield SETTLE
    after = middle(look(driver, shown, "after"))
    assert np.abs(after - before).max() > 0.05, "a stroke does not show"
    with driver.override():
        bpy.ops.ed.undo()
    # Undo in Sculpt Mode computes the whole ball anew.
    end = time.monotonic() + PATIENCE / 6
    yield SETTLE
    while np.abs(middle(look(driver, shown, "undone")) - before).mean() >= SAME:
        assert time.monotonic() < end, "an undone stroke shows"
        yield SETTLE
    with driver.override():
        bpy.ops.object.mode_set("EXEC_DEFAULT", True, mode="OBJECT")


def preview_progress(driver):
    """Switching on tells how far it is, and Esc leaves the file as it was; then it goes through."""
    build_scene()
    driver.add_camera()
    yield DRAW
    area = artist_area(driver)
    region = next(region for region in area.regions if region.type == "WINDOW")
    groups = len(bpy.data.node_groups)

    def press():
        with bpy.context.temp_override(window=driver.window, area=area, region=region):
            return bpy.ops.scfpf.preview_toggle("INVOKE_DEFAULT", True)

    assert press() == {"RUNNING_MODAL"}
    yield 0.0
    driver.key("ESC")
    yield SETTLE
    assert source_of(bpy.context.scene.camera) is None
    assert len(bpy.data.node_groups) == groups
    assert press() == {"RUNNING_MODAL"}
    yield from until_shown(driver, 1)
    assert len(bpy.data.node_groups) > groups


def is_draft(source):
    """Return whether the preview's first part shows a draft."""
    modifier = source.scfpf_preview.parts[0].picture.modifiers[0]
    sockets = modifier.node_group.interface.items_tree
    return bool(getattr(modifier.properties.inputs, sockets["Draft"].identifier).value)


def preview_drag(driver):
    """While a surface is dragged the preview is a draft; it is whole when nothing has moved for a moment."""
    yield from prepare(driver)
    source = source_of(bpy.context.scene.camera)
    end = time.monotonic() + PATIENCE
    while is_draft(source):
        assert time.monotonic() < end, "the preview stays a draft"
        yield 0.2
    far = bpy.context.scene.camera.scfpf.surfaces[-1].object
    seen = []
    for _ in range(8):
        far.location.x += 0.2
        yield 0.05
        seen.append(is_draft(source))
    driver.shot("draft")
    assert seen[-1], "a surface that moves shows no draft"
    end = time.monotonic() + PATIENCE
    while is_draft(source):
        assert time.monotonic() < end, "the preview stays a draft"
        yield 0.1
    yield SETTLE
    driver.shot("whole")
    (shown,) = preview_areas(driver)
    assert look(driver, shown, "after").std() > 0.01
    assert not is_draft(source), "whole pictures become drafts by themselves"


SCENARIOS = (
    preview_sleeps,
    preview_in_other_modes,
    preview_after_every_mode,
    preview_follows_sculpting,
    preview_progress,
    preview_drag,
)
