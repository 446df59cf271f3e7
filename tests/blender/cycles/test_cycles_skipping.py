# SPDX-License-Identifier: GPL-3.0-or-later
"""Rays that skip empty chords, compared with rays that travel them all: every pixel sees the same."""

import bpy
import numpy as np
import pytest
from rig_scenes import (
    keep_groups,
    project,
    render_passes,
    show_whole_sheets,
    start_anew,
    switch,
    volume_scene,
)

WIDTH, HEIGHT = 72, 48
# test_cycles_skipped_things has the others, and moves their surfaces.
SHOWN = (
    "around_the_car",
    "house_of_stairs",
    "mirror_ball",
    "nonlinear_twist",
    "perspective",
    "bent cubic",
    "B-spline",
    "NURBS",
    "loop",
    "grids",
)
# Pixels that may differ: rounding decides which of two things that touch in a pixel its ray meets.
ROUNDED = 2
# Positions differ by the rounding of float32, as a share of the largest coordinate.
PLACE = 1e-4


@pytest.fixture(autouse=True)
def empty_file(extension):
    """In place of an empty file."""
    start_anew()
    yield
    keep_groups()


@pytest.fixture
def skipping(addon, monkeypatch):
    """The module, which takes the time that a busy machine needs."""
    module = addon("cycles.skipping.refresh")
    monkeypatch.setattr(module, "PATIENCE", 600.0)
    return module


@pytest.fixture
def rig_of(addon):
    return lambda: addon("cycles.rig_data").rig_of(bpy.context.scene)


def thin_things(addon, camera, count=12):
    """Needles along and across projectors, and pairs of sheets 1e-4 apart."""
    generator = np.random.default_rng(11)
    projection = project(addon, camera)
    for number in range(count):
        x, y = generator.uniform(0.05, 0.95, (2, 1))
        ends = projection.projectors(*(np.repeat(a, 3) for a in (x, y)))
        weights, _ = projection.volume.spans.weights(np.sort(generator.uniform(0.1, 0.9, 3)))
        a, b, c = np.einsum("kn,kcn->nc", weights, ends.points)
        if not np.isfinite([a, b, c]).all():
            continue
        off = generator.normal(size=3) * 1e-4 * np.linalg.norm(b - a)
        needle = [a, b, b + off]
        middle, side, up = c, b - a, np.cross(b - a, generator.normal(size=3))
        side, up = (0.2 * v * np.linalg.norm(b - a) / max(np.linalg.norm(v), 1e-9) for v in (side, up))
        sheets = [middle + s * side + t * up for s, t in ((-1, -1), (1, -1), (1, 1), (-1, 1))]
        normal = np.cross(side, up)
        sheets += [point + 1e-4 * normal / max(np.linalg.norm(normal), 1e-9) for point in sheets]
        mesh = bpy.data.meshes.new("Thin")
        mesh.from_pydata([*needle, *sheets], [], [(0, 1, 2), (3, 4, 5, 6), (7, 8, 9, 10)])
        thin = bpy.data.objects.new("Thin", mesh)
        thin.pass_index = 100 + number
        bpy.context.scene.collection.objects.link(thin)
    bpy.context.view_layer.update()


@pytest.mark.parametrize("name", SHOWN)
def test_skipping_shows_what_all_chords_show(addon, skipping, rig_of, tmp_path, monkeypatch, name):
    camera = volume_scene(addon, name)
    thin_things(addon, camera)
    assert switch(camera) == {"FINISHED"}
    rig = rig_of()
    assert skipping.skips(rig), rig.scfpf_rig.travels_all
    some = render_passes(tmp_path / "some")
    assert skipping.skips(rig)
    mesh = rig.scfpf_rig.portals.data
    faces = len(mesh.polygons)
    show_whole_sheets(addon, rig)
    monkeypatch.setattr(addon("cycles.rig"), "renew", lambda *_: None)
    every = render_passes(tmp_path / "every")
    assert not skipping.skips(rig)
    other = some["Object Index"] != every["Object Index"]
    off = np.linalg.norm(some["Position"] - every["Position"], axis=2)
    moved = off > PLACE * np.abs(every["Position"]).max()
    print(name, rig.scfpf_rig.chords, faces, other.sum(), moved.sum(), off.max())
    assert (every["Object Index"] > 0).mean() > 0.02
    assert other.sum() <= ROUNDED and moved.sum() <= ROUNDED


def moved_object(_scene):
    bpy.data.objects["Object 1"].location.x += 0.01


def moved_vertex(_scene):
    mesh = next(obj.data for obj in bpy.data.objects if obj.type == "MESH" and obj.pass_index)
    mesh.vertices[0].co.x += 0.01
    mesh.update()
    bpy.context.view_layer.objects.active = None


def new_object(scene):
    scene.collection.objects.link(bpy.data.objects.new("New", bpy.data.meshes["Sphere"]))


def hidden_object(_scene):
    bpy.data.objects["Object 2"].hide_render = True


def wider_lamp(scene):
    lamp = bpy.data.lights.get("Lamp")
    lamp.shadow_soft_size += 1.0


def simulated_object(_scene):
    bpy.data.objects["Object 1"].modifiers.new("Cloth", "CLOTH")


def foggy_world(scene):
    tree = scene.world.node_tree
    output = next(node for node in tree.nodes if node.type == "OUTPUT_WORLD")
    tree.links.new(tree.nodes.new("ShaderNodeVolumeScatter").outputs[0], output.inputs["Volume"])


def moved_surface(scene):
    scene.objects["Camera"].scfpf.surfaces[1].object.location.x += 0.1


def keyed_object(_scene):
    bpy.data.objects["Object 2"].keyframe_insert("color")


def keyed_lamp(_scene):
    bpy.data.lights["Lamp"].keyframe_insert("energy")


def hidden_and_moved_object(_scene):
    """Updates name only what viewports show, here another object."""
    hidden = bpy.data.objects["Object 1"]
    hidden.hide_set(True)
    bpy.context.view_layer.update()
    hidden.location.x += 0.01
    bpy.data.objects["Object 2"].update_tag(refresh={"OBJECT"})


def removed_object(_scene):
    bpy.data.objects.remove(bpy.data.objects["Object 2"])


def displaced_material(_scene):
    made = bpy.data.materials.new("Displaced")
    if made.node_tree is None:
        made.use_nodes = True
    node, output = made.node_tree.nodes.new("ShaderNodeDisplacement"), made.node_tree.nodes["Material Output"]
    made.node_tree.links.new(node.outputs[0], output.inputs["Displacement"])
    made.displacement_method = "DISPLACEMENT"
    bpy.data.objects["Object 1"].data.materials.append(made)


NAMED_EDITS = (keyed_object, keyed_lamp, hidden_and_moved_object, removed_object, displaced_material)
EDITS = (moved_object, moved_vertex, new_object, hidden_object, wider_lamp, moved_surface)
OBSTACLES = {simulated_object: "'Object 1' is simulated", foggy_world: "filled with a volume"}


@pytest.fixture
def rigged(addon, rig_of):
    camera = volume_scene(addon, "nonlinear_twist")
    scene = bpy.context.scene
    scene.world = bpy.data.worlds.new("World")
    if scene.world.node_tree is None:
        scene.world.use_nodes = True
    scene.collection.objects.link(bpy.data.objects.new("Lamp", bpy.data.lights.new("Lamp", "POINT")))
    bpy.context.view_layer.update()
    assert switch(camera) == {"FINISHED"}
    bpy.context.view_layer.update()
    return rig_of()


@pytest.mark.parametrize("edit", EDITS)
def test_an_edit_stops_skipping_until_the_next_render(skipping, rigged, tmp_path, edit):
    assert skipping.skips(rigged) and skipping.TEXT_KEY in rigged.scfpf_rig.portals
    edit(bpy.context.scene)
    bpy.context.view_layer.update()
    assert not skipping.skips(rigged) and rigged.scfpf_rig.travels_all == skipping.CHANGED
    render_passes(tmp_path / "some")
    assert skipping.skips(rigged) and rigged.scfpf_rig.travels_all == ""


def test_what_updates_name_stops_skipping(addon, skipping, rigged, monkeypatch):
    """A look at what they name is enough, and others change nothing."""
    states, looks = addon("cycles.skipping.scene_state"), []
    state = states._object_state
    monkeypatch.setattr(states, "_object_state", lambda obj: looks.append(obj.name) or state(obj))
    for _ in range(3):
        bpy.data.objects["Object 1"].update_tag(refresh={"OBJECT"})
        bpy.data.materials.new("Unused").diffuse_color[0] = 0.5
        bpy.context.view_layer.update()
    assert skipping.skips(rigged) and set(looks) == {"Object 1"}
    for edit in NAMED_EDITS:
        edit(bpy.context.scene)
        bpy.context.view_layer.update()
        assert not skipping.skips(rigged), edit.__name__
        for material in bpy.data.materials:
            material.displacement_method = "BUMP"
        addon("cycles.rig").update(bpy.context, rigged)
        assert skipping.skips(rigged), edit.__name__


@pytest.mark.parametrize("edit", OBSTACLES)
def test_what_has_no_bounds_keeps_all_chords(skipping, rigged, tmp_path, edit):
    assert skipping.skips(rigged)
    edit(bpy.context.scene)
    bpy.context.view_layer.update()
    assert not skipping.skips(rigged)
    render_passes(tmp_path / "some")
    assert not skipping.skips(rigged) and OBSTACLES[edit] in rigged.scfpf_rig.travels_all


def test_skipping_stops_when_a_file_is_loaded(addon, skipping, rigged, rig_of, tmp_path):
    """Somebody may have changed it without the add-on."""
    path = str(tmp_path / "saved.blend")
    bpy.ops.wm.save_as_mainfile(filepath=path)
    assert skipping.skips(rigged)
    bpy.ops.wm.open_mainfile(filepath=path)
    bpy.context.view_layer.update()
    assert not skipping.skips(rig_of())
    render_passes(tmp_path / "some")
    assert skipping.skips(rig_of())


def shown(path):
    """The image, (H, W, 4), of samples in the middle of each pixel; smoke is random from 5.0 on."""
    bpy.context.scene.cycles.max_bounces = 0
    return next(v for name, v in render_passes(path, 16).items() if "Combined" in name)


def test_smoke_wide_lamps_and_holdouts_are_seen(addon, skipping, rigged, rig_of, tmp_path, monkeypatch):
    """Smoke and lamps are not skipped: the chords inside a cube of smoke meet none of its faces."""
    scene = bpy.context.scene
    # Rays in smoke take long.
    scene.render.resolution_percentage = 50
    camera = scene.objects["Camera"]
    projection = project(addon, camera)
    middle = projection.volume.evaluate(
        np.array([0.4, 0.6]), np.array([0.5, 0.4]), np.array([0.4, 0.6])
    ).position
    size = np.linalg.norm(np.ptp(middle, axis=1))
    bpy.ops.mesh.primitive_cube_add(size=3 * size, location=middle[:, 0])
    smoke = bpy.data.materials.new("Smoke")
    if smoke.node_tree is None:
        smoke.use_nodes = True
    nodes = smoke.node_tree.nodes
    nodes.clear()
    absorption, output = nodes.new("ShaderNodeVolumeAbsorption"), nodes.new("ShaderNodeOutputMaterial")
    absorption.inputs["Density"].default_value = 0.3 / size
    smoke.node_tree.links.new(absorption.outputs[0], output.inputs["Volume"])
    bpy.context.object.data.materials.append(smoke)
    lamp = bpy.data.objects.new("Panel", bpy.data.lights.new("Panel", "AREA"))
    lamp.data.size = 0.7 * size
    lamp.location = middle[:, 1]
    scene.collection.objects.link(lamp)
    bpy.data.objects["Object 3"].is_holdout = True
    # Things that glow: no sample of a lamp is random.
    glow = bpy.data.materials.new("Glow")
    if glow.node_tree is None:
        glow.use_nodes = True
    glow.node_tree.nodes.clear()
    emission, output = (
        glow.node_tree.nodes.new(f"ShaderNode{kind}") for kind in ("Emission", "OutputMaterial")
    )
    glow.node_tree.links.new(emission.outputs[0], output.inputs["Surface"])
    for obj in scene.objects:
        if obj.pass_index:
            obj.data.materials.clear()
            obj.data.materials.append(glow)
    scene.render.film_transparent = True
    bpy.context.view_layer.update()
    some = shown(tmp_path / "some")
    assert skipping.skips(rigged)
    monkeypatch.setattr(addon("cycles.rig"), "renew", lambda *_: None)
    skipping.stop_skipping(rigged)
    every = shown(tmp_path / "every")
    assert not skipping.skips(rigged)
    off = np.abs(some - every).max(axis=2)
    print(off.max(), (off > 0.15).mean(), off.mean(), some.mean(axis=(0, 1)) - every.mean(axis=(0, 1)))

    assert every[..., 3].std() > 0.05
    assert (off > 0.15).mean() < 0.005 and abs(some - every).mean() < 0.01
    assert np.abs(some.mean(axis=(0, 1)) - every.mean(axis=(0, 1))).max() < 1e-3
