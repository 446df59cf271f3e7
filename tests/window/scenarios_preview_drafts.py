# SPDX-License-Identifier: GPL-3.0-or-later
"""The live preview as it is switched on, with progress and Esc, and its drafts while a surface is dragged."""

import time

import bpy
from driver import DRAW, PATIENCE, build_scene
from scenarios_preview import SETTLE, artist_area, look, prepare, preview_areas, source_of, until_shown


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
    """Whether the preview's first part shows a draft."""
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


SCENARIOS = (preview_progress, preview_drag)
