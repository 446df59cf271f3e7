# SPDX-License-Identifier: GPL-3.0-or-later
"""The render depsgraph is Blender's own, and reading it leaves no trace."""

import bpy
import numpy as np
import pytest

MODULE = "bridge.scene.render_depsgraph"


@pytest.fixture
def with_render_depsgraph(addon):
    return addon(MODULE).with_render_depsgraph


def polygons(depsgraph):
    return {
        instance.object.name: len(instance.object.data.polygons)
        for instance in depsgraph.object_instances
        if instance.object.type == "MESH"
    }


def everything():
    """The contents of a file and the selection, as plain data."""
    scene = bpy.context.scene
    return {
        "names": sorted(
            (kind, one.name)
            for kind in ("objects", "meshes", "scenes", "images", "collections")
            for one in getattr(bpy.data, kind)
        ),
        "engine": scene.render.engine,
        "active": bpy.context.view_layer.objects.active,
        "selected": sorted(obj.name for obj in bpy.context.selected_objects),
        "mode": bpy.context.mode,
        "frame": (scene.frame_current, scene.frame_subframe),
        "bake": {name: getattr(scene.render.bake, name) for name in ("target", "use_clear", "margin")},
    }


def test_modifiers_have_their_render_levels(with_render_depsgraph):
    bpy.ops.mesh.primitive_cube_add()
    modifier = bpy.context.object.modifiers.new("Subdivision", "SUBSURF")
    modifier.levels, modifier.render_levels = 1, 3
    counts = with_render_depsgraph(bpy.context.scene, bpy.context.view_layer, polygons)
    assert counts["Cube"] == 6 * 4**3


@pytest.mark.parametrize("mode", ["OBJECT", "EDIT", "SCULPT"])
def test_nothing_is_left_behind(with_render_depsgraph, mode):
    bpy.ops.mesh.primitive_cube_add()
    bpy.context.scene.render.engine = "CYCLES"
    bpy.context.scene.render.bake.use_selected_to_active = True
    bpy.context.scene.frame_set(7, subframe=0.25)
    bpy.ops.object.mode_set(mode=mode)
    before = everything()
    result = with_render_depsgraph(
        bpy.context.scene,
        bpy.context.view_layer,
        lambda depsgraph: (depsgraph.mode, depsgraph.scene.frame_subframe),
    )
    assert result == ("RENDER", 0.25)
    assert everything() == before
    assert not hasattr(bpy.types, "SceneReader")


def test_the_last_render_is_not_touched(with_render_depsgraph):
    started = []
    handlers = bpy.app.handlers
    lists = (handlers.render_init, handlers.render_pre, handlers.render_post, handlers.render_complete)
    for one in lists:
        one.append(lambda *arguments: started.append(arguments))
    bpy.ops.mesh.primitive_cube_add()
    try:
        with_render_depsgraph(bpy.context.scene, bpy.context.view_layer, polygons)
    finally:
        for one in lists:
            one.pop()
    assert not started
    assert "Render Result" not in bpy.data.images


def test_an_error_of_the_reader_is_raised_and_nothing_is_left_behind(with_render_depsgraph):
    bpy.ops.mesh.primitive_cube_add()
    before = everything()

    def fail(_):
        raise KeyError("of the reader")

    with pytest.raises(KeyError, match="of the reader"):
        with_render_depsgraph(bpy.context.scene, bpy.context.view_layer, fail)
    assert everything() == before


def test_another_scene_and_view_layer_can_be_read(with_render_depsgraph):
    scene = bpy.data.scenes.new("Other")
    for name in ("A", "B"):
        made = bpy.data.collections.new(name)
        scene.collection.children.link(made)
        mesh = bpy.data.meshes.new(name)
        mesh.from_pydata(np.eye(3).tolist(), [], [(0, 1, 2)])
        made.objects.link(bpy.data.objects.new(name, mesh))
    second = scene.view_layers.new("Second")
    second.layer_collection.children["A"].exclude = True
    assert {"A", "B"} <= set(with_render_depsgraph(scene, scene.view_layers[0], polygons))
    shown = with_render_depsgraph(scene, second, polygons)
    assert "B" in shown and "A" not in shown
    assert bpy.context.scene.name == "Scene"


def test_a_simulation_is_read_as_it_was_played(with_render_depsgraph):
    bpy.ops.mesh.primitive_cube_add(location=(0, 0, 10))
    bpy.ops.rigidbody.object_add()
    for frame in range(1, 16):
        bpy.context.scene.frame_set(frame)

    def height(depsgraph):
        return next(
            instance.matrix_world[2][3]
            for instance in depsgraph.object_instances
            if instance.object.name == "Cube"
        )

    played = height(bpy.context.evaluated_depsgraph_get())
    assert played < 9
    assert with_render_depsgraph(bpy.context.scene, bpy.context.view_layer, height) == played
