# SPDX-License-Identifier: GPL-3.0-or-later
"""The Cycles rig in files, scenes and histories: what it follows, leaves alone and takes back."""

import os
import subprocess
import sys

import bpy
import pytest
from rig_scenes import add_box, bent_camera, keep_groups, pixels_of, render, start_anew, switch

# Renders frames of a saved file in a Blender that knows nothing of the add-on.
WITHOUT_ADDON = """
import bpy, sys
blend, *frames = sys.argv[1:]
bpy.ops.wm.read_factory_settings(use_empty=True)
bpy.ops.wm.open_mainfile(filepath=blend)
assert not hasattr(bpy.types.Object, "scfpf")
for frame in frames:
    bpy.context.scene.frame_set(int(frame))
    bpy.context.scene.render.filepath = f"{blend}.{frame}.exr"
    bpy.ops.render.render(write_still=True)
"""


# What looks for datablocks left behind, or for those of the past, begins with a file that has none.
FRESH = {"test_it_is_removed_without_a_trace", "test_undo_and_redo"}


@pytest.fixture(autouse=True)
def empty_file(extension, request):
    """An empty file, or what is as good as one and has the node groups, which take long to build."""
    if request.function.__name__ in FRESH:
        bpy.ops.wm.read_homefile(use_empty=True, use_factory_startup=True)
    else:
        start_anew()
    yield
    keep_groups()


def everything():
    """Names of all datablocks that a rig could leave behind."""
    kinds = ("objects", "meshes", "cameras", "materials", "collections", "node_groups", "scenes", "actions")
    return {kind: sorted(one.name for one in getattr(bpy.data, kind)) for kind in kinds}


@pytest.fixture
def camera(addon):
    return bent_camera(addon)


@pytest.fixture
def rig_of(addon):
    return lambda: addon("cycles.rig_data").rig_of(bpy.context.scene)


def test_it_is_removed_without_a_trace(camera, rig_of):
    scene = bpy.context.scene
    scene.timeline_markers.new("Here", frame=1).camera = camera
    scene.render.engine = "BLENDER_WORKBENCH"
    scene.cycles.transparent_max_bounces, scene.cycles.min_transparent_bounces = 5, 2
    before = everything()
    assert switch(camera) == {"FINISHED"}
    settings = rig_of().scfpf_rig
    assert scene.camera == settings.view_camera == scene.timeline_markers[0].camera
    assert scene.render.engine == "CYCLES" and scene.cycles.transparent_max_bounces > 5 + settings.chords
    assert scene.cycles.min_transparent_bounces > 2 + settings.chords
    # Viewports evaluate and show nothing of it.
    shown = {instance.object.name for instance in bpy.context.evaluated_depsgraph_get().object_instances}
    assert not shown & {settings.portals.name, settings.view_camera.name}
    assert switch(camera) == {"FINISHED"}
    assert everything() == before
    assert scene.camera == camera == scene.timeline_markers[0].camera
    assert scene.render.engine == "BLENDER_WORKBENCH" and scene.cycles.transparent_max_bounces == 5
    assert scene.cycles.dicing_camera is None and scene.cycles.min_transparent_bounces == 2


# Nodes that some of Cycles' devices lack: Open Shading Language runs on CPUs, and on OptiX in part.
NOT_ON_ALL_DEVICES = {
    "ShaderNodeScript",
    "ShaderNodeBevel",
    "ShaderNodeAmbientOcclusion",
    "ShaderNodeRaycast",
}


def test_nothing_in_it_needs_a_cpu(camera, rig_of):
    scene = bpy.context.scene
    switch(camera)
    settings = rig_of().scfpf_rig
    materials = settings.portals.data.materials
    kinds = {node.bl_idname for material in materials for node in material.node_tree.nodes}
    assert "ShaderNodeBsdfRayPortal" in kinds and not kinds & NOT_ON_ALL_DEVICES
    assert not any(kind.endswith("Group") for kind in kinds), "groups were not looked into"
    assert settings.view_camera.data.type in {"ORTHO", "PERSP"} and not scene.cycles.shading_system


def normalised(node):
    """Return whether a Ray Portal's direction has length 1: up to 5.1 Cycles takes it as it is."""
    return node.inputs["Direction"].links[0].from_node.operation == "NORMALIZE"


def test_portals_get_directions_of_length_1(camera, rig_of):
    """Made by an earlier version of the add-on, too, once the chords are updated."""
    switch(camera)
    mesh = rig_of().scfpf_rig.portals.data
    before = everything()

    def portals():
        trees = [material.node_tree for material in mesh.materials]
        return [node for tree in trees for node in tree.nodes if node.bl_idname == "ShaderNodeBsdfRayPortal"]

    assert len(portals()) == 5 and all(map(normalised, portals()))
    portals()[0].inputs["Direction"].links[0].from_node.operation = "ADD"
    assert bpy.ops.scfpf.cycles_rig_update() == {"FINISHED"}
    assert len(portals()) == 5 and all(map(normalised, portals()))
    assert {kind: len(names) for kind, names in everything().items()} == {
        kind: len(names) for kind, names in before.items()
    }


def test_passes_come_and_go(camera, rig_of):
    scene, layer = bpy.context.scene, bpy.context.view_layer
    switch(camera)
    before = everything()
    assert bpy.ops.scfpf.cycles_passes() == {"FINISHED"}
    assert len(layer.aovs) == 4 and rig_of().scfpf_rig.passes
    assert bpy.ops.scfpf.cycles_passes() == {"FINISHED"}
    assert everything() == before and not len(layer.aovs) and not rig_of().scfpf_rig.passes
    assert not layer.use_pass_position and "scfpf_passes" not in layer
    layer.use_pass_position = True
    bpy.ops.scfpf.cycles_passes()
    bpy.ops.scfpf.cycles_passes()
    assert layer.use_pass_position, "the artist's own"
    bpy.ops.scfpf.cycles_passes()
    tree = getattr(scene, "compositing_node_group", None) or scene.node_tree
    # What the artist adds stays, with the tree.
    tree.nodes.new("CompositorNodeBlur").name = "Own"
    switch(camera)
    assert not len(layer.aovs)
    tree = getattr(scene, "compositing_node_group", None) or scene.node_tree
    assert "Own" in tree.nodes and not any("SCFPF" in node.name for node in tree.nodes)


def test_undo_and_redo(camera, rig_of):
    bpy.ops.ed.undo_push(message="Before")
    before = everything()
    bpy.ops.scfpf.cycles_rig()
    bpy.ops.ed.undo_push(message="Set Up Cycles")
    bpy.ops.ed.undo()
    assert rig_of() is None and everything() == before
    assert bpy.context.scene.camera == bpy.data.objects["Camera"]
    bpy.ops.ed.redo()
    assert rig_of() is not None and rig_of().scfpf_rig.chords > 1


def test_undo_in_one_scene_leaves_the_rig_of_another_as_it_is(camera, tmp_path):
    """Nothing evaluates that scene; its picture is the same."""
    switch(camera)
    scene, own = bpy.context.scene, bpy.context.scene.name
    scene.render.filepath = str(tmp_path / "picture.exr")

    def picture():
        bpy.ops.render.render(scene=own, write_still=True)
        return pixels_of(tmp_path / "picture.exr")

    before = picture()
    bpy.ops.scene.new(type="EMPTY")
    for message in ("First", "Second", "Third"):
        bpy.ops.ed.undo_push(message=message)
    assert bpy.ops.ed.undo() == {"FINISHED"}
    assert bpy.context.scene.name != own
    assert (picture() == before).all()


def test_a_camera_knows_its_table_when_undo_brings_its_scene_back(camera, rig_of):
    bpy.ops.scene.new(type="EMPTY")
    bpy.context.window.scene = bpy.data.objects[camera.name].users_scene[0]
    switch(camera)
    table = rig_of().scfpf_rig.table.name
    for message in ("First", "Second"):
        bpy.ops.ed.undo_push(message=message)
    bpy.ops.scene.delete("EXEC_DEFAULT", True)
    bpy.context.view_layer.update()
    assert table not in bpy.data.objects
    assert bpy.ops.ed.undo() == {"FINISHED"}
    settings = rig_of().scfpf_rig
    assert settings.camera["scfpf_rig_table"] == settings.table == bpy.data.objects[table]


def test_other_cameras_and_our_own_pictures_do_not_see_it(addon, camera, tmp_path):
    """Not through its sheets, and not from where its screen is; with no add-on's help: drivers tell."""
    scene = bpy.context.scene
    other = bpy.data.objects.new("Other", bpy.data.cameras.new("Other"))
    scene.collection.objects.link(other)
    other.location.z = 3
    scene.camera = other
    plain = render(tmp_path / "plain.exr")
    scene.camera = camera
    switch(camera)
    rig_camera, scene.camera = scene.camera, other
    assert (render(tmp_path / "with.exr") == plain).all()
    scene.camera = rig_camera
    assert not (render(tmp_path / "rig.exr") == plain).all()
    inputs = addon("bridge.render.render_inputs").prepare(bpy.context.scene, bpy.context.view_layer, camera)
    assert sorted(inputs.scene.geometry.object_names) == ["Blue", "Green", "Red"]
    members = addon("scanline.preview.preview_members").shown_objects(bpy.context.view_layer)
    assert sorted(member.name for member in members.values()) == ["Blue", "Green", "Red"]
    # Whatever asks for the scene's camera gets the flexible one.
    bpy.context.view_layer.objects.active = None
    target = addon("operators.common.target")
    assert target.camera_of(bpy.context) == target.render_camera(bpy.context) == camera


def test_a_file_renders_without_the_add_on(addon, camera, rig_of, tmp_path):
    """Frames of an animated volume, in a Blender that has never heard of it."""
    scene = bpy.context.scene
    scene.frame_start, scene.frame_end = 1, 10
    middle = camera.scfpf.surfaces[1].object
    middle.keyframe_insert("location", frame=1)
    middle.location.x = -4
    middle.keyframe_insert("location", frame=10)
    scene.frame_set(1)
    switch(camera)
    settings = rig_of().scfpf_rig
    # The chords are enough for the frame that bends most.
    assert settings.animated and settings.chords > 3
    scene.frame_set(10)
    projection = addon("bridge.camera.read_projection").read_projection(
        camera, bpy.context.evaluated_depsgraph_get(), 1.5
    )
    chords = addon("cycles.rig_data").present_chords(rig_of())
    assert addon("cycles.chords.chord_plan").chord_error(projection, (60, 40), *chords) < 0.1
    path = tmp_path / "rig.blend"
    bpy.ops.wm.save_as_mainfile(filepath=str(path))
    done = subprocess.run(
        [sys.executable, "-c", WITHOUT_ADDON, str(path), "1", "10"],
        env=os.environ | {"BLENDER_USER_RESOURCES": str(tmp_path)},
        capture_output=True,
        text=True,
        timeout=120,
        check=False,
    )
    assert done.returncode == 0, done.stdout + done.stderr
    pictures = []
    for frame in (1, 10):
        scene.frame_set(frame)
        pictures.append(render(tmp_path / "here.exr"))
        assert (pixels_of(f"{path}.{frame}.exr") == pictures[-1]).all()
    assert (pictures[0] != pictures[1]).any(axis=2).mean() > 0.05
    assert all((picture[..., :3].max(axis=2) > 0).mean() > 0.05 for picture in pictures)


def test_it_follows_the_volume_or_says_why_not(addon, camera, rig_of):
    switch(camera)
    settings = rig_of().scfpf_rig
    chords, error = settings.chords, settings.error
    assert chords > 1 and 0 < error <= 0.1
    vertices = len(settings.portals.data.vertices)
    bpy.data.objects["Red"].location.x += 1
    bpy.context.view_layer.update()
    assert (settings.chords, len(settings.portals.data.vertices)) == (chords, vertices)
    camera.scfpf.surfaces[1].object.location.x = 5
    bpy.context.view_layer.update()
    assert settings.chords > chords and settings.error <= 0.1
    camera.scfpf.pixel_error = 0.5
    bpy.context.view_layer.update()
    assert settings.chords < chords and settings.error <= 0.5
    cautions = addon("cycles.cautions").cautions
    scene, layer = bpy.context.scene, bpy.context.view_layer
    assert cautions(scene, layer, rig_of()) == []
    camera.scfpf.surfaces[1].object.scale.x = 0
    bpy.context.view_layer.update()
    assert "has no size" in settings.problem
    camera.scfpf.surfaces[1].object.scale.x = 1
    bpy.context.view_layer.update()
    assert settings.problem == ""


def test_cautions_name_what_the_rig_cannot_do(addon, camera, rig_of):
    switch(camera)
    settings, cautions = rig_of().scfpf_rig, addon("cycles.cautions").cautions
    scene, layer = bpy.context.scene, bpy.context.view_layer
    camera.scfpf.surfaces[1].object.location.x = 5
    camera.scfpf.pixel_error = 0.5
    bpy.context.view_layer.update()
    scene.render.engine = "BLENDER_WORKBENCH"
    scene.cycles.transparent_max_bounces = 2
    camera.data.dof.use_dof = True
    smoke = add_box("Smoke", (0, 0, 0), (0, 0, 0))
    tree = smoke.data.materials[0].node_tree
    scatter, output = tree.nodes.new("ShaderNodeVolumeScatter"), tree.nodes["Material Output"]
    tree.links.new(scatter.outputs[0], output.inputs["Volume"])
    smoke.scale = (4, 4, 4)
    bpy.context.view_layer.update()
    assert settings.smoke == "Smoke"
    # In Edit Mode, too.
    for place, said in (((50, 0, 0), ""), ((0, 0, 0), "Smoke")):
        smoke.location = place
        layer.objects.active = smoke
        bpy.ops.object.mode_set(mode="EDIT")
        camera.scfpf.surfaces[1].object.location.x += 0.01
        layer.update()
        assert settings.smoke == said
        bpy.ops.object.mode_set(mode="OBJECT")
    found = cautions(scene, layer, rig_of())
    assert len(found) == 4 and "smoke of 'Smoke'" in found[-1]
    # The override is the material of the smoke, too.
    layer.material_override = bpy.data.materials["Red"]
    layer.update()
    found = cautions(scene, layer, rig_of())
    assert len(found) == 4
    for said in ("only in Cycles", "override", "bounces", "depth of field"):
        assert any(said in caution for caution in found)
    # A surface less: straight projectors.
    camera.scfpf.active_surface = 1
    bpy.ops.scfpf.surface_remove()
    bpy.context.view_layer.update()
    assert settings.chords == 1 and settings.error == 0.0
    assert not any("depth of field" in caution for caution in cautions(scene, layer, rig_of()))
    # A deleted camera takes its rig along.
    bpy.data.objects.remove(camera)
    bpy.context.view_layer.update()
    assert not [c.name for c in bpy.data.collections if "Rig" in c.name]
    assert not [m.name for m in bpy.data.materials if "SCFPF" in m.name]


@pytest.mark.parametrize("kind", ["FULL_COPY", "LINK_COPY"])
def test_a_copied_scene_renders_as_its_original(addon, camera, kind, tmp_path):
    switch(camera)
    first, picture = bpy.context.scene, render(tmp_path / "before.exr")
    bpy.ops.scene.new(type=kind)
    copy = bpy.context.scene
    bpy.context.view_layer.update()
    assert (render(tmp_path / "copy.exr") == picture).all()
    for number, rig in enumerate(addon("cycles.rig_data").rigs()):
        assert rig.scfpf_rig.scene == (first, copy)[number]
        assert rig.scfpf_rig.table.parent == rig.scfpf_rig.camera
    first.render.filepath = str(tmp_path / "after.exr")
    bpy.ops.render.render(write_still=True, scene=first.name)
    assert (pixels_of(tmp_path / "after.exr") == picture).all()
    if kind == "LINK_COPY":
        # Another rig in the copy: each camera sees its own sheets only.
        bpy.context.view_layer.objects.active = camera
        copy.camera = camera
        bpy.ops.scfpf.cycles_rig()
        assert copy.camera["scfpf_rig_mark"] != first.camera["scfpf_rig_mark"]
        assert (render(tmp_path / "second.exr") == picture).all()
        bpy.context.window.scene = first
    switch(bpy.context.scene.camera)
    assert copy.camera is not None and copy.camera.scfpf.enabled


def test_without_enough_surfaces_it_says_so(camera):
    camera.scfpf.surfaces.remove(0)
    camera.scfpf.surfaces.remove(0)
    bpy.context.view_layer.update()
    before = everything()
    with pytest.raises(RuntimeError, match="needs at least two"):
        switch(camera)
    assert everything() == before and bpy.context.scene.camera == camera


@pytest.mark.parametrize("steps", [1, 4, 10])
def test_planning_that_is_given_up_leaves_nothing(addon, camera, steps):
    """While frames are read, and when the node groups are built; a camera that goes meanwhile is named."""
    planning = addon("cycles.chord_planning")
    scene = bpy.context.scene
    camera.scfpf.surfaces[1].object.keyframe_insert("location", frame=1)
    # Not the groups that other tests have left.
    bpy.data.batch_remove([group for group in bpy.data.node_groups if group.name.startswith("SCFPF Portals")])
    scene.frame_set(3, subframe=0.25)
    bpy.context.view_layer.update()
    before, frames, told = everything(), set(), []
    plan = planning.Planning(bpy.context, camera)
    for number in range(steps):
        told.append((plan.progress, plan.text))
        assert plan.step(bpy.context) == (number < 9)
        frames.add(scene.frame_current)
    assert told == sorted(told, key=lambda each: each[0]) and told[0] == (0.0, "frame 1 of 9")
    assert len(frames) > 1 or steps == 1
    plan.give_up()
    assert everything() == before
    assert (scene.frame_current, scene.frame_subframe) == (3, 0.25)
    plan = planning.Planning(bpy.context, camera)
    bpy.data.objects.remove(camera)
    with pytest.raises(ValueError, match="was deleted meanwhile"):
        plan.step(bpy.context)


def test_film_and_border(camera, tmp_path):
    scene = bpy.context.scene
    scene.render.film_transparent = True
    switch(camera)
    whole = render(tmp_path / "whole.exr")
    hit = whole[..., :3].max(axis=2) > 0
    assert 0.02 < hit.mean() < 0.9
    assert ((whole[..., 3] == 1) == hit).all() and ((whole[..., 3] == 0) == ~hit).all()
    render_settings = scene.render
    render_settings.use_border, render_settings.use_crop_to_border = True, True
    render_settings.border_min_x, render_settings.border_max_x = 0.25, 0.75
    render_settings.border_min_y, render_settings.border_max_y = 0.25, 0.75
    assert (render(tmp_path / "part.exr") == whole[10:30, 15:45]).all()
