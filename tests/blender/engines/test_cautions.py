# SPDX-License-Identifier: GPL-3.0-or-later
"""What joined pictures do not show as the scene says: each is named, and named before rendering."""

import bpy
import numpy as np
import pytest
from layer_scenes import flexible

LEFT_OUT, AS_IT_COMES, BY_SCREEN = "Left out of pictures", "in front of faces", "where they meet"
SOFT = "Soft and clear parts"


def link(data):
    obj = bpy.data.objects.new("Thing", data)
    bpy.context.scene.collection.objects.link(obj)
    return obj


def strokes(scene):
    kind = "grease_pencils" if bpy.app.version >= (5, 0, 0) else "grease_pencils_v3"
    link(getattr(bpy.data, kind).new("Lines"))


def lens(scene):
    scene.camera.data.dof.use_dof = True


def compositor(scene):
    if hasattr(scene, "compositing_node_group"):
        scene.compositing_node_group = bpy.data.node_groups.new("Glare", "CompositorNodeTree")
    else:
        scene.use_nodes = True


def sequencer(scene):
    editor = scene.sequence_editor_create()
    strips = editor.strips if hasattr(editor, "strips") else editor.sequences
    ends = {"length": 10} if bpy.app.version >= (5, 0, 0) else {"frame_end": 10}
    strips.new_effect(name="Color", type="COLOR", channel=1, frame_start=1, **ends)


def volume_in(tree, kind):
    tree.nodes.clear()
    scatter, output = (tree.nodes.new(each) for each in ("ShaderNodeVolumeScatter", kind))
    tree.links.new(scatter.outputs[0], output.inputs["Volume"])


def smoke_domain(scene):
    material = bpy.data.materials.new("Smoke")
    material.use_nodes = True
    volume_in(material.node_tree, "ShaderNodeOutputMaterial")
    bpy.ops.mesh.primitive_cube_add(size=6.0)
    bpy.context.object.data.materials.append(material)


def mist(scene):
    scene.world = bpy.data.worlds.new("World")
    scene.world.use_nodes = True
    volume_in(scene.world.node_tree, "ShaderNodeOutputWorld")


def particle_hair(scene):
    modifier = bpy.data.objects["Cube"].modifiers.new("Hair", "PARTICLE_SYSTEM")
    modifier.particle_system.settings.type = "HAIR"
    modifier.particle_system.settings.render_type = "PATH"


def workbench(name):
    def switch(scene):
        scene.render.engine = "BLENDER_WORKBENCH"
        setattr(scene.display.shading, name, True)

    return switch


# What is switched on in the scene, how it is named, and what the name says of it.
CASES = {
    "motion blur": (lambda scene: setattr(scene.render, "use_motion_blur", True), LEFT_OUT),
    "Freestyle": (lambda scene: setattr(scene.render, "use_freestyle", True), LEFT_OUT),
    "the border": (lambda scene: setattr(scene.render, "use_border", True), LEFT_OUT),
    "stereoscopy": (lambda scene: setattr(scene.render, "use_multiview", True), LEFT_OUT),
    "depth of field": (lens, LEFT_OUT),
    "glare or bloom": (compositor, LEFT_OUT),
    "the sequencer": (sequencer, LEFT_OUT),
    "Grease Pencil": (strokes, SOFT),
    "smoke": (lambda scene: link(bpy.data.volumes.new("Smoke")), AS_IT_COMES),
    "smoke, by material": (smoke_domain, AS_IT_COMES),
    "smoke, of the world": (mist, AS_IT_COMES),
    "Raytracing": (lambda scene: setattr(scene.eevee, "use_raytracing", True), BY_SCREEN),
    "Cavity": (workbench("show_cavity"), BY_SCREEN),
    "Outline": (workbench("show_object_outline"), BY_SCREEN),
}


@pytest.fixture
def scene(addon):
    scene = bpy.context.scene
    for obj in list(scene.objects):
        bpy.data.objects.remove(obj)
    scene.world = None
    bpy.ops.mesh.primitive_cube_add(size=4.0)
    bpy.ops.object.camera_add(location=(0, 0, 6))
    scene.camera = bpy.context.object
    render = scene.render
    render.resolution_x, render.resolution_y, render.resolution_percentage = 32, 18, 100
    render.engine = addon("bridge.blender.versions").EEVEE
    scene.eevee.use_raytracing = False
    scene.display.shading.show_cavity = scene.display.shading.show_object_outline = False
    flexible(scene.camera, "inverted_perspective")
    return scene


def planned(addon, scene):
    """The warnings of a plan, which is made before rendering."""
    return [str(text) for text in addon("engines.anchors_job").plan_picture(bpy.context, scene.camera)[1]]


def test_a_plain_scene_has_no_cautions(scene, addon):
    assert planned(addon, scene) == []


@pytest.mark.parametrize("name", CASES)
def test_each_is_named_before_rendering(scene, addon, name):
    switch, says = CASES[name]
    switch(scene)
    (warning,) = planned(addon, scene)
    assert says in warning and name.split(",")[0] in warning


@pytest.mark.parametrize("kind", ["hair_curves", "pointclouds", "particles"])
def test_what_has_depth_is_not_named(scene, addon, kind):
    """But in layers, which are shown as they come."""
    if kind == "particles":
        particle_hair(scene)
        thing = bpy.data.objects["Cube"]
    else:
        thing = link(getattr(bpy.data, kind).new("Things"))
    assert planned(addon, scene) == []
    found = addon("engines.cautions").cautions(scene, [], False, {thing.session_uid: 1})
    assert len(found) == 1 and AS_IT_COMES in str(found[0])


def test_what_is_hidden_is_not_named(scene, addon):
    link(bpy.data.volumes.new("Smoke")).hide_render = True
    assert planned(addon, scene) == []


def test_anchors_have_neither_lens_nor_blur(scene, addon, monkeypatch):
    """What is named as left out is off in the scene that is rendered, and on in the artist's."""
    lens(scene)
    scene.render.use_motion_blur = scene.render.use_freestyle = True
    anchors = addon("engines.anchor_scene")
    anchor = addon("anchors.anchor").Anchor
    window = addon("anchors.anchor").Window(-1.0, -1.0, 1.0, 1.0)
    passing = anchors.AnchorScene(scene, bpy.context.view_layer)
    try:
        passing.look_through(anchor(np.eye(4), window, (8, 8), 0.1, 9.0))
        copy = passing.scene
        render = copy.render
        assert not (render.use_motion_blur or render.use_freestyle or render.use_compositing)
        assert not copy.camera.data.dof.use_dof
    finally:
        passing.remove()
    assert scene.render.use_motion_blur and scene.render.use_freestyle and scene.camera.data.dof.use_dof
