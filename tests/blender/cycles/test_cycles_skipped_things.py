# SPDX-License-Identifier: GPL-3.0-or-later
"""Things that rays which skip chords could miss: thin, unusual and hidden ones, in random volumes."""

import bpy
import numpy as np
import pytest
from rig_scenes import (
    VOLUMES,
    bend_at_random,
    fill_volume,
    make_volume,
    project,
    reference,
    render_passes,
    show_whole_sheets,
    start_anew,
    switch,
)

WIDTH, HEIGHT = 48, 32
# Of one volume each, and each of another; the surfaces of a volume are moved, turned and sized at random.
SEEDS = (0, 1, 3, 4, 7, 11)
PRESETS = ("around_the_car", "nonlinear_twist", "deep_curvy_volume", "occlusion_camera", "angular_fisheye")
# Pixels that may differ: rounding decides which of two things that touch in a pixel its ray meets.
ROUNDED = 2


@pytest.fixture
def compare(addon, tmp_path, monkeypatch):
    """Return the passes of the scene with rays that skip chords, and with rays that do not."""

    def images(camera, samples=1):
        refresh, rigs = addon("cycles.skipping.refresh"), addon("cycles.rig_data")
        bpy.context.view_layer.update()
        assert switch(camera) == {"FINISHED"}
        rig = rigs.rig_of(bpy.context.scene)
        assert refresh.skips(rig), rig.scfpf_rig.travels_all
        some = render_passes(tmp_path / "some", samples)
        assert refresh.skips(rig)
        monkeypatch.setattr(addon("cycles.rig"), "renew", lambda *_: None)
        show_whole_sheets(addon, rig)
        return some, render_passes(tmp_path / "every", samples)

    return images


def new_camera():
    camera = reference.add_camera(WIDTH, HEIGHT)
    camera.location, camera.rotation_euler = (0.4, -0.6, 0.3), (1.4, 0.1, 0.5)
    return camera


def random_volume(addon, generator):
    """A camera of one of the volumes, bent at random."""
    start_anew()
    camera = new_camera()
    make_volume(addon, camera, generator.choice([*VOLUMES, *PRESETS]))
    camera.scfpf.pixel_error = 0.5
    bend_at_random(camera, generator)
    return camera


def wire(generator, points, thickness):
    """A bent wire through points (N, 3)."""
    curve = bpy.data.curves.new("Wire", "CURVE")
    curve.dimensions, curve.bevel_depth, curve.bevel_resolution = "3D", thickness, 0
    spline = curve.splines.new("POLY")
    spline.points.add(len(points) - 1)
    spline.points.foreach_set("co", np.c_[points, np.ones(len(points))].ravel())
    return linked(bpy.data.objects.new("Wire", curve))


def needle_and_sheets(points):
    """A needle from one point to another, and two sheets 1e-4 of their size apart."""
    a, b, c = points
    size = np.linalg.norm(b - a)
    side, up = 0.2 * (b - a), 0.2 * np.cross(b - a, c - a) / max(size, 1e-9)
    normal = np.cross(side, up)
    normal *= 1e-4 * size / max(np.linalg.norm(normal), 1e-12)
    sheet = [c + s * side + t * up for s, t in ((-1, -1), (1, -1), (1, 1), (-1, 1))]
    mesh = bpy.data.meshes.new("Thin")
    corners = [a, b, b + normal, *sheet, *(corner + normal for corner in sheet)]
    mesh.from_pydata(corners, [], [(0, 1, 2), (3, 4, 5, 6), (7, 8, 9, 10)])
    return linked(bpy.data.objects.new("Thin", mesh))


def linked(obj):
    bpy.context.scene.collection.objects.link(obj)
    return obj


@pytest.mark.parametrize("seed", SEEDS)
def test_thin_things_in_random_volumes_are_seen(addon, compare, seed):
    generator = np.random.default_rng(seed)
    camera = random_volume(addon, generator)
    fill_volume(addon, camera, 6)
    projection = project(addon, camera)

    def places(count):
        x, y = generator.uniform(0.1, 0.9, (2, count))
        image = projection.parameters(x, y)
        t = generator.uniform(0.1, 0.9, count)
        found = projection.volume.evaluate(image.u, image.v, t).position.T
        return found[np.isfinite(found).all(axis=1) & image.mask]

    for number in range(8):
        some = places(12)
        if len(some) < 3:
            continue
        size = np.linalg.norm(np.ptp(some, axis=0))
        made = wire(generator, some[:5], 2e-3 * size) if number % 2 else needle_and_sheets(some[:3])
        made.pass_index = 100 + number
    things = [obj for obj in bpy.context.scene.objects if obj.pass_index]
    generator.choice(things).is_holdout = True
    if seed % 4 == 0:
        # A camera in things: the whole of the near surface is in a ball, which is seen from inside.
        near = projection.volume.evaluate(np.full(1, 0.5), np.full(1, 0.5), np.full(1, 0.0)).position[:, 0]
        bpy.ops.mesh.primitive_uv_sphere_add(radius=0.5, location=near)
        bpy.context.object.pass_index = 200
    some, every = compare(camera)
    other = some["Object Index"] != every["Object Index"]
    off = np.abs(some["Position"] - every["Position"]).max(axis=2) > 1e-4 * np.abs(every["Position"]).max()
    # Where projectors collapse, a ray ends on a sheet, and nothing is seen.
    off &= every["Object Index"] > 0
    print(seed, other.sum(), off.sum(), (every["Object Index"] > 0).mean())
    assert (every["Object Index"] > 0).mean() > 0.01
    assert other.sum() <= ROUNDED and off.sum() <= ROUNDED


def nodes_object(kind, **inputs):
    """An object whose nodes make something else of it."""
    obj = linked(bpy.data.objects.new("Made", bpy.data.meshes.new("Made")))
    tree = bpy.data.node_groups.new("Made", "GeometryNodeTree")
    tree.interface.new_socket("Geometry", in_out="INPUT", socket_type="NodeSocketGeometry")
    tree.interface.new_socket("Geometry", in_out="OUTPUT", socket_type="NodeSocketGeometry")
    node, end = tree.nodes.new(kind), tree.nodes.new("NodeGroupOutput")
    for name, value in inputs.items():
        node.inputs[name].default_value = value
    tree.links.new(node.outputs[0], end.inputs[0])
    obj.modifiers.new("Made", "NODES").node_group = tree
    return obj


def points():
    return nodes_object("GeometryNodePoints", Count=1, Radius=1.5, Position=(0, 0, -8))


def instances():
    made = bpy.data.collections.new("Made")
    bpy.ops.mesh.primitive_monkey_add(size=4)
    monkey = bpy.context.object
    bpy.context.scene.collection.objects.unlink(monkey)
    made.objects.link(monkey)
    obj = linked(bpy.data.objects.new("Instance", None))
    obj.instance_type, obj.instance_collection, obj.location = "COLLECTION", made, (0.5, 0, -8)
    return monkey


def ball(**settings):
    bpy.ops.mesh.primitive_uv_sphere_add(radius=1.5, location=(0.5, 0, -8))
    for name, value in settings.items():
        setattr(bpy.context.object, name, value)
    return bpy.context.object


def hidden_in_viewports():
    return ball(hide_viewport=True)


def of_another_layer():
    obj, scene = ball(), bpy.context.scene
    collection = bpy.data.collections.new("Apart")
    scene.collection.children.link(collection)
    collection.objects.link(obj)
    scene.collection.objects.unlink(obj)
    layer = scene.view_layers.new("Other")
    layer.layer_collection.children["Apart"].exclude = False
    scene.view_layers[0].layer_collection.children["Apart"].exclude = True
    return obj


def text():
    bpy.ops.object.text_add(location=(-2, -0.5, -8))
    bpy.context.object.data.size = 2.0
    return bpy.context.object


def metaball():
    bpy.ops.object.metaball_add(radius=2.0, location=(0.5, 0, -8))
    return bpy.context.object


def render_modifier():
    """Only renders show that it is thick."""
    bpy.ops.mesh.primitive_plane_add(size=1.0, location=(0.5, 0, -8))
    modifier = bpy.context.object.modifiers.new("Array", "ARRAY")
    modifier.count, modifier.relative_offset_displace = 3, (0, 1.2, 0)
    modifier.show_viewport = False
    return bpy.context.object


THINGS = (points, instances, hidden_in_viewports, of_another_layer, text, metaball, render_modifier)


def bent(addon):
    start_anew()
    camera = reference.add_camera(WIDTH, HEIGHT)
    make_volume(addon, camera, "bent cubic")
    camera.scfpf.pixel_error = 0.5
    bpy.context.view_layer.update()
    return camera


@pytest.mark.parametrize("make", THINGS)
def test_what_is_no_plain_mesh_is_seen(addon, compare, make):
    camera = bent(addon)
    make().pass_index = 7
    some, every = compare(camera)
    index = [passes["Object Index"] for passes in (some, every)]
    print(make.__name__, (index[1] == 7).sum(), (index[0] != index[1]).sum())
    if make is not of_another_layer:
        assert (index[1] > 0).sum() > 10
    assert (index[0] != index[1]).sum() <= ROUNDED


def test_a_grid_of_smoke_counts_as_its_box(addon):
    bent(addon)
    low, high = (-1, -1, -9), (2, 2, -7)
    nodes_object("GeometryNodeVolumeCube", Density=1.0, Min=low, Max=high)
    bpy.context.view_layer.update()
    bodies = addon("cycles.skipping.bodies").Bodies()
    depsgraphs = addon("bridge.scene.render_depsgraph")
    depsgraphs.with_render_depsgraph(bpy.context.scene, bpy.context.view_layer, bodies.read)
    _, boxes = bodies.points()
    assert boxes.shape[2] == 1
    assert (boxes.min(axis=(0, 2)) <= low).all() and (boxes.max(axis=(0, 2)) >= high).all()


def test_small_instances_of_many_triangles_count_as_boxes_that_hold_them(addon, monkeypatch):
    bent(addon)
    turned = ball()
    turned.scale, turned.rotation_euler = (0.1, 0.2, 0.3), (0.5, 1.0, 1.5)
    bpy.ops.mesh.primitive_uv_sphere_add(radius=5.0)
    bpy.context.view_layer.update()
    bodies = addon("cycles.skipping.bodies").Bodies()
    depsgraphs = addon("bridge.scene.render_depsgraph")
    depsgraphs.with_render_depsgraph(bpy.context.scene, bpy.context.view_layer, bodies.read)
    all_triangles, boxes = bodies.points(100.0)
    assert boxes.shape[2] == 0
    monkeypatch.setattr(addon("cycles.skipping.bodies"), "MANY_TRIANGLES", 100)
    triangles, boxes = bodies.points(100.0)
    assert boxes.shape[2] == 1
    large = len(bpy.context.object.data.loop_triangles)
    assert triangles.shape[2] == large
    # In the ball's own space the box is upright, and just holds each vertex.
    into = np.array(turned.matrix_world.inverted(), np.float64)
    corners = into[:3, :3] @ boxes[:, :, 0].T + into[:3, 3:]
    own = np.array([vertex.co for vertex in turned.data.vertices]).T
    assert np.allclose(corners.min(axis=1), own.min(axis=1), atol=1e-5)
    assert np.allclose(corners.max(axis=1), own.max(axis=1), atol=1e-5)
    assert all_triangles.shape[2] == large + len(turned.data.loop_triangles)
    # Beyond the second number everything is a box.
    monkeypatch.setattr(addon("cycles.skipping.bodies"), "MOST_TRIANGLES", 200)
    assert [some.shape[2] for some in bodies.points(100.0)] == [0, 2]


@pytest.mark.parametrize("kind", ["displacement", "velocity"])
def test_what_has_no_bounds_is_named(addon, kind):
    camera = bent(addon)
    obj = ball()
    if kind == "displacement":
        material = bpy.data.materials.new("Bumps")
        if material.node_tree is None:
            material.use_nodes = True
        material.displacement_method = "DISPLACEMENT"
        nodes = material.node_tree.nodes
        end = next(node for node in nodes if node.type == "OUTPUT_MATERIAL")
        material.node_tree.links.new(
            nodes.new("ShaderNodeDisplacement").outputs[0], end.inputs["Displacement"]
        )
        obj.data.materials.append(material)
    else:
        bpy.context.scene.render.use_motion_blur = True
        obj.data.attributes.new("velocity", "FLOAT_VECTOR", "POINT")
        obj.keyframe_insert("location", frame=1)
    assert switch(camera) == {"FINISHED"}
    rig = addon("cycles.rig_data").rig_of(bpy.context.scene)
    assert not addon("cycles.skipping.refresh").skips(rig)
    assert "known bounds" in rig.scfpf_rig.travels_all
