# SPDX-License-Identifier: GPL-3.0-or-later
"""Framing by the mouse: effects of movements in several views; safe areas follow their settings.

The keys, and that Esc restores everything, are tested in a window: ``tests/window/picture_scenarios.py``.
"""

import math
from types import SimpleNamespace

import bpy
import numpy as np
import pytest
from mathutils import Matrix


@pytest.fixture
def module(addon):
    return addon("operators.volume.framing")


@pytest.fixture
def drag(module):
    """A function that moves the mouse and returns the amounts after it."""

    def drag(x, y, ctrl=False, shift=False, rolling=False, sides=(1, 1, 1), key=None):
        state = SimpleNamespace(pan=0.0, tilt=0.0, roll=0.0, dolly=0.0, zoom=1.0)
        state._mouse, state._centre, state._reach = (500, 300), (400, 300), 1000
        state._distance, state._rolling, state._sides = 20.0, rolling, sides
        operator = module.SCFPF_OT_volume_frame
        state._zoom_by = lambda factor: operator._zoom_by(state, factor)
        state._shift = lambda *amounts: operator._shift(state, *amounts)
        event = SimpleNamespace(mouse_x=500 + x, mouse_y=300 + y, ctrl=ctrl, shift=shift, type=key)
        (operator._step if key else operator._drag)(state, event)
        return state

    return drag


def test_moving_pans_and_tilts_towards_the_mouse_from_before_and_behind(module, drag):
    state = drag(100, -50)
    assert (state.pan, state.tilt) == pytest.approx((module.TURN * 0.1, -module.TURN * 0.05))
    assert (state.roll, state.dolly, state.zoom) == (0, 0, 1)
    assert drag(100, 0, sides=(-1, 1, -1)).pan == pytest.approx(-module.TURN * 0.1)


def test_keys_zoom_dolly_and_roll(module, drag):
    state = drag(0, 100, ctrl=True)
    assert (state.zoom, state.pan, state.tilt) == (pytest.approx(math.exp(0.1 * module.ZOOM)), 0, 0)
    assert drag(0, -100, ctrl=True).zoom == pytest.approx(1 / state.zoom)
    assert drag(10**5, 0, ctrl=True).zoom == module.MOST_ZOOM
    assert drag(0, 100, shift=True).dolly == pytest.approx(2.0)
    # From the right of the centre to above it: a quarter turn anticlockwise.
    assert drag(-100, 100, rolling=True).roll == pytest.approx(math.pi / 2)
    assert drag(-100, 100, rolling=True, sides=(-1, 1, -1)).roll == pytest.approx(-math.pi / 2)


def test_arrow_keys_do_what_the_mouse_does(drag):
    """Half a degree each."""
    assert drag(0, 0, key="RIGHT_ARROW").pan == pytest.approx(math.radians(0.5))
    assert drag(0, 0, key="DOWN_ARROW").tilt == pytest.approx(-math.radians(0.5))
    assert drag(0, 0, key="UP_ARROW", ctrl=True).zoom > 1 > drag(0, 0, key="LEFT_ARROW", ctrl=True).zoom
    assert drag(0, 0, key="UP_ARROW", shift=True).dolly > 0
    assert drag(0, 0, key="LEFT_ARROW", rolling=True).roll == pytest.approx(math.radians(0.5))


def test_the_side_of_the_screen_that_the_volume_is_seen_from(module):
    bpy.ops.scfpf.camera_add()
    camera = bpy.context.object
    camera.matrix_world = Matrix.Rotation(0.4, 4, "Z") @ Matrix.Rotation(1.2, 4, "X")
    through = SimpleNamespace(view_matrix=camera.matrix_world.inverted())
    assert module._sides(camera, through) == (1, 1, 1)
    turned = camera.matrix_world @ Matrix.Rotation(math.pi, 4, "Y")
    assert module._sides(camera, SimpleNamespace(view_matrix=turned.inverted())) == (-1, 1, -1)
    assert module._sides(camera, None) == (1, 1, 1)


def test_values_still_frame_without_a_mouse():
    bpy.ops.scfpf.camera_add()
    camera = bpy.context.object
    far = camera.scfpf.surfaces[1].object
    bpy.context.view_layer.update()
    before = np.array(far.matrix_world)
    assert bpy.ops.scfpf.volume_frame(dolly=2.0) == {"FINISHED"}
    bpy.context.view_layer.update()
    moved = np.array(far.matrix_world)[:3, 3] - before[:3, 3]
    assert np.allclose(moved, -2 * np.array(camera.matrix_world)[:3, 2], atol=1e-4)


def test_safe_areas_follow_the_settings_of_the_camera_and_the_scene(addon):
    areas = addon("bridge.overlays.viewport_overlay").safe_areas
    bpy.ops.scfpf.camera_add()
    lens, scene = bpy.context.object.data, bpy.context.scene
    assert areas(lens, scene) == ()
    lens.show_safe_center = True
    assert areas(lens, scene) == ()
    lens.show_safe_areas = True
    assert len(areas(lens, scene)) == 4
    lens.show_safe_center = False
    scene.safe_areas.title, scene.safe_areas.action = (0.25, 0.125), (0, 0)
    assert areas(lens, scene) == ((0.25, 0.125),)
