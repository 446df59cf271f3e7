# SPDX-License-Identifier: GPL-3.0-or-later
"""Drags of a layer by numbers, against where its thing is in renders; its frame, and what is refused."""

import bpy
import numpy as np
import pytest
from engine_images import button

SIZE = np.array([160, 90])


@pytest.fixture
def camera(scene):
    """A camera with a layer of a cube, of which alone renders have an alpha."""
    for name in ("Wall", "Floor"):
        bpy.data.objects[name].hide_render = True
    scene.render.film_transparent = True
    scene.render.resolution_x, scene.render.resolution_y = SIZE.tolist()
    assert bpy.ops.scfpf.layer_add(collection="Things") == {"FINISHED"}
    return scene.camera


def borders(camera):
    """The borders of the thing in the image, in pixels, (2 corners, 2), x and y."""
    rows, columns = np.nonzero(button()[..., 3] > 0.5)
    assert rows.size
    return np.array([[columns.min(), rows.min()], [columns.max() + 1, rows.max() + 1]])


def test_the_picture_moves_and_scales_by_the_numbers(camera):
    """A pixel goes to the layer's new middle, and from there the factor times as far as it was."""
    before = borders(camera)
    assert bpy.ops.scfpf.layer_drag(shift=(0.2, -0.1), factor=0.5) == {"FINISHED"}
    layer = camera.scfpf.layers[0]
    assert layer.position[:] == pytest.approx((0.7, 0.4)) and layer.size[:] == pytest.approx((0.5, 0.5))
    expected = (np.array([0.7, 0.4]) + (before / SIZE - 0.5) * 0.5) * SIZE
    assert np.abs(borders(camera) - expected).max() <= 1.0


def test_the_proportions_stay_at_the_limits(camera):
    layer = camera.scfpf.layers[0]
    layer.size = 0.4, 0.1
    assert bpy.ops.scfpf.layer_drag(factor=0.01) == {"FINISHED"}
    assert layer.size[:] == pytest.approx((0.04, 0.01))


def test_the_frame_lies_around_the_layers_picture(camera, addon):
    shown, frames = addon("bridge.frames.shown_image"), addon("bridge.frames.layer_frames")
    rectangle = addon("bridge.render.view_painter").Rectangle(40.0, 30.0, 320.0, 180.0)
    layer = camera.scfpf.layers[0]
    layer.position, layer.size = (0.25, 0.5), (0.5, 0.2)
    found = frames.layer_frame(0, layer, shown.ShownImage(camera, rectangle))
    assert found.origin == pytest.approx([120.0, 120.0]) and found.label == "Things"
    low, high = found.frame.corners.min(axis=1), found.frame.corners.max(axis=1)
    assert np.allclose([low, high], [[40.0, 102.0], [200.0, 138.0]])
    at = addon("bridge.frames.shown_frame").frame_at
    assert at([found], 200.0, 138.0, 1.0) == (0, 2)
    assert at([found], 150.0, 120.0, 1.0) is None  # the click selects what is seen there


def test_a_layer_that_is_not_shown_has_no_frame(camera, addon):
    group = bpy.types.SCFPF_GGT_layer_viewport if hasattr(bpy.types, "SCFPF_GGT_layer_viewport") else None
    group = group or addon("bridge.frames.layer_frames").SCFPF_GGT_layer_viewport
    layer = camera.scfpf.layers[0]
    assert group.has_frames(camera.scfpf)
    layer.is_on = False
    assert not group.has_frames(camera.scfpf)
    layer.is_on, layer.camera = True, None
    assert not group.has_frames(camera.scfpf)


def test_without_that_layer_it_is_refused(camera):
    with pytest.raises(RuntimeError, match="has no layer at place 8"):
        bpy.ops.scfpf.layer_drag(index=7)
    bpy.ops.scfpf.layer_remove()
    assert not bpy.ops.scfpf.layer_drag.poll()
