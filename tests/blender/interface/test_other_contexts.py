# SPDX-License-Identifier: GPL-3.0-or-later
"""Polls and operators in contexts that lack what a window gives, as in timers and handlers."""

import bpy
import pytest
from operator_steps import add_camera, add_cube

LACKING = (
    "window",
    "screen",
    "workspace",
    "area",
    "region",
    "space_data",
    "region_data",
    "object",
    "active_object",
    "selected_objects",
    "view_layer",
    "collection",
    "camera",
)


def polled() -> dict:
    """Every operator, panel and menu of ours that has a poll, by its name."""
    classes = {name: getattr(bpy.types, name) for name in dir(bpy.types) if name.startswith("SCFPF_")}
    return {name: cls for name, cls in classes.items() if hasattr(cls, "poll")}


@pytest.mark.parametrize("lacking", LACKING)
@pytest.mark.parametrize("is_flexible", [False, True])
def test_no_poll_raises(lacking, is_flexible):
    add_cube()
    if is_flexible:
        add_camera()
    assert len(polled()) > 80
    raised = {}
    for name, cls in polled().items():
        with bpy.context.temp_override(**{lacking: None}):
            try:
                cls.poll(bpy.context)
            except Exception as error:
                raised[name] = repr(error)
    assert raised == {}


def test_operators_work_on_the_active_object_without_a_window():
    add_cube()
    first = add_camera()
    second = add_camera()
    bpy.context.view_layer.objects.active = first
    with bpy.context.temp_override(window=None):
        assert bpy.ops.scfpf.preset_apply(preset="curved_convergence") == {"FINISHED"}
        assert bpy.ops.scfpf.surface_add() == {"FINISHED"}
    assert (len(first.scfpf.surfaces), len(second.scfpf.surfaces)) == (4, 2)
