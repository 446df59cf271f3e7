# SPDX-License-Identifier: GPL-3.0-or-later
"""The messages of Solve: what hides a target, eyes that see it, and targets that contradict each other."""

import math

import bpy
import pytest
from aim_scenes import box_scene, solve, turned_view


def test_what_hides_a_view_is_named_with_a_way_out():
    camera = turned_view(box_scene(bpy.context.scene), 0.0)
    # Between the box and the camera, left of the middle of the line of sight.
    bpy.ops.mesh.primitive_cube_add(location=(0.2, -4.0, 2.0), scale=(0.6, 0.1, 3.0))
    bpy.context.object.name = "Post"
    target = camera.scfpf.aim_targets[0]
    assert solve(camera) == {"FINISHED"}
    assert target.hidden_by == "Post" and 0.1 < target.hidden < 1.0
    assert "by Post: nearest free direction" in target.message and "to the right" in target.message
    assert target.free_turn[0] < 0.0
    assert "partly hidden: Box" in camera.scfpf.aim.message
    # The way out is one: by brute force, no line of sight to the box's middle and corners meets the post.
    assert bpy.ops.scfpf.aim_turn(camera=camera.name, index=0, to_free=True) == {"FINISHED"}
    bpy.context.view_layer.update()
    start = target.eye.matrix_world.translation
    for x in (-1.4, 0.0, 1.4):
        for z in (0.1, 1.0, 1.9):
            way = type(start)((1 + x, -0.8, z)) - start
            hit, *_, obj, _ = bpy.context.scene.ray_cast(
                bpy.context.evaluated_depsgraph_get(), start, way.normalized(), distance=way.length - 0.05
            )
            assert not hit or obj.name != "Post"


def test_views_that_show_the_same_twice_are_told():
    camera = turned_view(box_scene(bpy.context.scene), 0.0)
    bpy.ops.scfpf.aim_view_add(camera=camera.name, object="Box")
    bpy.ops.scfpf.aim_turn(camera=camera.name, left=math.radians(10))
    camera.scfpf.aim_targets[1].position[0] -= 0.2
    bpy.context.view_layer.update()
    try:
        solve(camera)
        message = camera.scfpf.aim.message
    except RuntimeError as error:
        message = str(error)
    assert "the views 'Box' and 'Box 2' show the same part in two places" in message


@pytest.mark.parametrize(
    ("left", "up", "words"),
    [
        (12.0, 0.0, "12° to the left"),
        (-30.0, 5.0, "30° to the right and 5° up"),
        (0.0, -7.0, "7° down"),
    ],
)
def test_directions_in_words(addon, left, up, words):
    assert addon("bridge.aim.verdict")._direction(math.radians(left), math.radians(up)) == words
