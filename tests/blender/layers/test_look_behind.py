# SPDX-License-Identifier: GPL-3.0-or-later
"""Look Behind in Blender: the list, and the views and layers that show what it names."""

import bpy
import numpy as np
import pytest
from mathutils import Vector
from operator_steps import add_cube
from recorded_layout import drawn


def thing(name, location, size):
    obj = add_cube(location)
    obj.name, obj.scale = name, np.array(size) / 2
    return obj


@pytest.fixture
def camera(engine_scene):
    """A ball behind a wall, a floor, and a flexible camera of a perspective that looks along Y."""
    bpy.data.objects.remove(bpy.data.objects["Cube"])
    thing("Wall", (0, 0, 0), (2.0, 0.2, 2.4))
    thing("Floor", (0, 0, -1.3), (12.0, 12.0, 0.2))
    bpy.ops.mesh.primitive_uv_sphere_add(location=(0.3, 2.0, 0), radius=0.6)
    bpy.context.object.name = "Ball"
    engine_scene.render.resolution_x, engine_scene.render.resolution_y = 96, 64
    camera = engine_scene.camera
    camera.name = "Master"
    bpy.ops.object.select_all(action="DESELECT")
    bpy.context.view_layer.objects.active = camera
    assert bpy.ops.scfpf.preset_apply(preset="perspective") == {"FINISHED"}
    camera.matrix_world = placed_at((0, -7, 0.5))
    camera.scfpf.pixel_error = 0.1
    bpy.context.view_layer.update()
    return camera


def placed_at(place):
    turn = (-Vector(place)).to_track_quat("-Z", "Y").to_matrix().to_4x4()
    turn.translation = place
    return turn


def rows(camera):
    return {row.name: row for row in camera.scfpf.hidden_things}


def shares(addon, camera):
    """The shares of the image of layers that are seen, by Check Layers' count."""
    bpy.context.view_layer.objects.active = camera
    assert bpy.ops.scfpf.layer_check() == {"FINISHED"}
    return [layer.share for layer in camera.scfpf.layers]


def test_the_ball_is_listed_and_the_floor_is_not(camera):
    assert bpy.ops.scfpf.look_behind() == {"FINISHED"}
    assert list(rows(camera)) == ["Ball"]
    (row,) = camera.scfpf.hidden_things
    assert row.hider == "Wall" and row.hidden > 0.9
    assert "most by Wall" in row.message and "on its right" in row.message
    bpy.data.objects["Floor"].select_set(True)
    bpy.context.view_layer.objects.active = camera
    assert bpy.ops.scfpf.look_behind() == {"FINISHED"}
    assert list(rows(camera)) == ["Floor", "Ball"]


def test_nothing_is_said_to_be_hidden(camera):
    bpy.data.objects["Wall"].location.z = 50.0
    assert bpy.ops.scfpf.look_behind() == {"FINISHED"}
    assert not len(camera.scfpf.hidden_things)
    assert "hides nothing" in camera.scfpf.hidden_message


def test_a_layer_shows_all_of_it_where_it_is(addon, camera):
    bpy.ops.scfpf.look_behind()
    alone = camera.scfpf.hidden_things[0].share
    assert bpy.ops.scfpf.hidden_show(way="LAYER") == {"FINISHED"}
    (share,) = shares(addon, camera)
    assert share == pytest.approx(alone, rel=0.03)
    # Where it was: the middle of the ball, as the camera's own picture has it.
    layer = camera.scfpf.layers[0]
    own = camera.matrix_world.inverted() @ bpy.data.objects["Ball"].location
    half = np.tan(camera.data.angle_x / 2)
    wanted = 0.5 + own.x / -own.z / half / 2, 0.5 + own.y / -own.z / half / 2 * 96 / 64
    assert tuple(layer.position) == pytest.approx(wanted, abs=0.01)
    bpy.ops.scfpf.look_behind()
    assert "Ball" not in rows(camera)


def test_a_view_shows_it_after_solve(camera):
    """Beside the wall, by projectors that come round its edge."""
    bpy.data.objects["Wall"].scale.x, bpy.data.objects["Ball"].location = 0.8, (-0.3, 3.0, 0.0)
    bpy.context.view_layer.update()
    bpy.ops.scfpf.look_behind()
    before = rows(camera)["Ball"].hidden
    camera.scfpf.hidden_things.add()
    camera.scfpf.active_hidden = 1
    assert bpy.ops.scfpf.hidden_show(way="VIEW", index=0) == {"FINISHED"}
    (target,) = camera.scfpf.aim_targets
    assert target.object.name == "Ball" and target.position[0] < 0.35
    assert camera.scfpf.active_hidden == 0
    assert bpy.ops.scfpf.aim_solve() == {"FINISHED"}, camera.scfpf.aim.message
    bpy.data.objects["Ball"].select_set(True)
    bpy.context.view_layer.objects.active = camera
    bpy.ops.scfpf.look_behind()
    after = rows(camera)["Ball"].hidden if "Ball" in rows(camera) else 0.0
    assert before > 0.99 and after < 0.2


def test_what_is_enclosed_has_no_view_but_a_layer(addon, camera):
    """The ball in a box: no direction is free, and nothing of the refused view is left."""
    bpy.data.objects["Wall"].scale = 1.0, 1.0, 1.0
    bpy.data.objects["Ball"].location = 0.0, 0.0, 0.0
    bpy.context.view_layer.update()
    bpy.ops.scfpf.look_behind()
    assert "No place" not in rows(camera)["Ball"].message
    objects = len(bpy.data.objects)
    with pytest.raises(RuntimeError, match="press Add Layer instead"):
        bpy.ops.scfpf.hidden_show(way="VIEW")
    assert len(bpy.data.objects) == objects and not len(camera.scfpf.aim_targets)
    assert bpy.ops.scfpf.hidden_show(way="LAYER") == {"FINISHED"}
    assert shares(addon, camera)[0] > 0.0


def test_a_thing_that_has_gone_is_named(camera):
    bpy.ops.scfpf.look_behind()
    bpy.data.objects["Ball"].name = "Other"
    with pytest.raises(RuntimeError, match="press Look Behind again"):
        bpy.ops.scfpf.hidden_show()
    camera.scfpf.hidden_things.clear()
    with pytest.raises(RuntimeError, match="no hidden thing"):
        bpy.ops.scfpf.hidden_show()


def test_what_an_instancer_shows_has_its_name(camera):
    """An empty that instances the ball's collection is what can be selected."""
    parts = bpy.data.collections.new("Parts")
    ball = bpy.data.objects["Ball"]
    for collection in ball.users_collection:
        collection.objects.unlink(ball)
    parts.objects.link(ball)
    empty = bpy.data.objects.new("Copy", None)
    empty.instance_type, empty.instance_collection = "COLLECTION", parts
    bpy.context.scene.collection.objects.link(empty)
    bpy.context.view_layer.update()
    bpy.ops.scfpf.look_behind()
    assert list(rows(camera)) == ["Copy"]
    for way in ("VIEW", "LAYER"):
        assert bpy.ops.scfpf.hidden_show(way=way) == {"FINISHED"}


def test_the_panel_has_the_list_and_its_buttons(camera):
    panel = bpy.types.SCFPF_PT_view_look_behind
    assert ("operator", "scfpf.hidden_show") not in drawn(panel)
    bpy.ops.scfpf.look_behind()
    assert drawn(panel).count(("operator", "scfpf.hidden_show")) == 2
