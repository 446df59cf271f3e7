# SPDX-License-Identifier: GPL-3.0-or-later
"""The node groups of the nodes preview against the viewing volume in float64."""

import json
from types import SimpleNamespace

import bpy
import numpy as np
import pytest
from made_cameras import PRESETS
from mathutils import Euler, Vector
from mathutils.bvhtree import BVHTree

pytestmark = pytest.mark.usefixtures("built_groups")

ASPECT = 1.5
POINTS = 1500
# Share of the picture's width: a tenth of a pixel of a thousand. The table's cells make most of it.
PICTURE = 1e-4
# float32 of the viewbox' z, from -1 to -2, in t: it is that of the far end over this.
DEPTH_FLOAT = 2.5e-7


@pytest.fixture
def scanline(addon):
    """The preview's node groups, and the object with the table."""
    table_object = addon("scanline.table.table_object").table_object
    return SimpleNamespace(**vars(addon("scanline.remap.remap_nodes")), table_object=table_object)


@pytest.fixture
def flexible(addon):
    return addon("bridge.camera.flexible_camera")


@pytest.fixture
def camera():
    made = bpy.data.objects.new("Camera", bpy.data.cameras.new("Camera"))
    bpy.context.scene.collection.objects.link(made)
    made.location, made.rotation_euler = (1.0, 2.0, 3.0), (0.3, 0.2, 0.5)
    return made


@pytest.fixture
def remapped(addon, scanline):
    """Puts points into the scene, each as a face without size, and reads them back from the viewbox."""
    versions = addon("bridge.blender.versions")

    def make(camera, points, corners=3):
        count = len(points)
        mesh = bpy.data.meshes.new("Points")
        mesh.from_pydata(
            np.repeat(points, corners, 0).tolist(),
            [],
            np.arange(corners * count).reshape(-1, corners).tolist(),
        )
        number = mesh.attributes.new("number", "INT", "POINT")
        number.data.foreach_set("value", np.repeat(np.arange(count, dtype=np.int32), corners))
        seen = bpy.data.collections.new("Seen")
        seen.objects.link(bpy.data.objects.new("Points", mesh))
        preview = bpy.data.objects.new("Preview", bpy.data.meshes.new("Preview"))
        preview.parent = camera
        bpy.context.scene.collection.objects.link(preview)
        modifier = preview.modifiers.new("Preview", "NODES")
        modifier.node_group = scanline.preview_group()
        values = {"Collection": seen, "Table": scanline.table_object(camera), "Aspect": ASPECT}
        for item in modifier.node_group.interface.items_tree:
            if item.in_out == "INPUT" and item.name in values:
                versions.set_modifier_input(modifier, item.identifier, values[item.name])
        modifier.node_group = scanline.preview_group()
        return preview

    return make


def placed(preview):
    """(number of the point, place in the viewbox) of the vertices of an evaluated preview."""
    mesh = preview.evaluated_get(bpy.context.evaluated_depsgraph_get()).data
    box, number = np.empty(3 * len(mesh.vertices), np.float32), np.empty(len(mesh.vertices), np.int32)
    mesh.vertices.foreach_get("co", box)
    if len(number):
        mesh.attributes["number"].data.foreach_get("value", number)
    return number, box.reshape(-1, 3).T.astype(np.float64)


def depth_ratio(scanline, camera):
    """Near size over far size, as the table has it."""
    table = scanline.table_object(camera).evaluated_get(bpy.context.evaluated_depsgraph_get())
    return table.data.attributes["ratio, turn, polar"].data[0].vector[0]


def t_of(z, ratio):
    """t of a z in the viewbox: perspective depth undone."""
    depth = -1.0 - z
    return ratio * depth / (1.0 - depth * (1.0 - ratio))


def random_places(seed):
    generator = np.random.default_rng(seed)
    x, y = generator.uniform(0.02, 0.98, (2, POINTS))
    return x, y, generator.uniform(0.02, 0.98, POINTS)


def check_volume(addon, scanline, camera, remapped, seed, share=1.0):
    """Points at known (x, y, t) come out there. share: of the points that must."""
    read = addon("bridge.camera.read_projection").read_projection
    bpy.context.view_layer.update()
    projection = read(camera, bpy.context.evaluated_depsgraph_get(), ASPECT)
    x, y, t = random_places(seed)
    image = projection.parameters(x, y)
    points = projection.volume.evaluate(image.u, image.v, t).position
    preview = remapped(camera, points.T)
    number, box = placed(preview)
    shown = image.mask[number]
    assert set(number[shown]) == set(np.flatnonzero(image.mask))
    off_x = np.abs(box[0] + 0.5 - x[number])
    off_x = np.minimum(off_x, 1.0 - off_x)  # of a periodic picture either end will do
    off_y = np.abs(box[1] + 0.5 / ASPECT - y[number] / ASPECT)
    right = (off_x < PICTURE) & (off_y < PICTURE)
    assert right[shown].mean() >= share
    # What they lead to, forward again in float64, is where they were.
    ratio = depth_ratio(scanline, camera)
    back = projection.parameters(box[0] + 0.5, box[1] * ASPECT + 0.5)
    again = projection.volume.evaluate(back.u, back.v, t_of(box[2], ratio)).position
    size = np.abs(points - points.mean(axis=1, keepdims=True)).max()
    error = np.linalg.norm(again - points[:, number], axis=0)[shown & right]
    assert error.max() < size * (PICTURE + DEPTH_FLOAT / min(ratio, 1.0))
    return preview


@pytest.mark.parametrize("path", PRESETS, ids=lambda path: path.stem)
def test_vertices_of_every_preset_come_to_their_place_in_the_picture(
    addon, scanline, flexible, camera, remapped, path
):
    preset = addon("projection.presets.preset").load_preset(path.read_text(encoding="utf-8"))
    flexible.apply_preset(camera, preset, ASPECT)
    check_volume(addon, scanline, camera, remapped, 1, ONE_TO_ONE.get(path.stem, 1.0))


# Presets that fold: the share of points that have one place alone.
ONE_TO_ONE = {"around_the_car": 0.99}


def plane(flexible, camera, generator, index, count):
    """One of a row of rectangles along -Z, each turned, shifted and scaled a little."""
    turn = generator.uniform(-0.15, 0.15, 3) * (1, 1, 2)
    matrix = np.array(Euler(turn).to_matrix().to_4x4())
    matrix[:3, 3] = [*generator.uniform(-0.4, 0.4, 2), -1.0 - 8.0 * index / (count - 1)]
    size = 2.0 + index + generator.uniform(-0.3, 0.3)
    flexible.add_surface(camera, "PLANE", matrix=matrix, parameters={"width": size * ASPECT, "height": size})


# test_scanline_pictures has more of them, with curved surfaces.
@pytest.mark.parametrize(
    ("basis", "count", "seed"),
    [
        ("BEZIER", 2, 0),
        ("BEZIER", 4, 1),
        ("BEZIER", 6, 0),
        ("POLYLINE", 4, 1),
        ("B_SPLINE", 6, 0),
        ("NURBS", 4, 1),
        ("SMOOTH", 4, 1),
    ],
)
def test_random_one_to_one_volumes_of_every_basis(
    addon, scanline, flexible, camera, remapped, basis, count, seed
):
    generator = np.random.default_rng(seed)
    for index in range(count):
        plane(flexible, camera, generator, index, count)
    camera.scfpf.basis = basis
    for slot, weight in zip(camera.scfpf.surfaces, generator.uniform(0.6, 1.5, count), strict=True):
        slot.weight = weight
    camera.scfpf.u_range, camera.scfpf.v_range = (0.1, 0.8), (0.0, 1.0)
    check_volume(addon, scanline, camera, remapped, seed)


MIXED = {
    "point and sphere": [
        ("POINT", {}),
        ("SPHERE", {"radius": 5.0, "arc": 2.0, "latitude_start": -0.7, "latitude_end": 0.7}),
    ],
    "cylinder in cone": [
        ("CYLINDER", {"radius": 1.0, "arc": 6.2831853, "height": 1.0}),
        ("CONE", {"radius_start": 6.0, "radius_end": 4.0, "arc": 6.2831853, "height": 6.0}),
    ],
    "disk and dish": [
        ("DISC", {"radius": 0.5, "arc": 2.0}),
        ("PARABOLOID", {"radius": 4.0, "arc": 2.0, "depth": 3.0}, -6.0),
    ],
}


@pytest.mark.parametrize("name", MIXED)
def test_curved_kinds_are_exact_from_their_parameters(addon, scanline, flexible, camera, remapped, name):
    for kind, parameters, *z in MIXED[name]:
        # A drawing this coarse would be off by a tenth of the radius.
        drawing = {} if kind == "POINT" else {"resolution_u": 6, "resolution_v": 2}
        surface = flexible.add_surface(camera, kind, parameters=parameters | drawing)
        surface.location.z = sum(z)
    check_volume(addon, scanline, camera, remapped, 5)


def test_the_preview_follows_edits_and_frames_without_python(addon, scanline, flexible, camera, remapped):
    surfaces = addon("bridge.surfaces.surface_object")
    preset = json.loads((PRESETS[0].parent / "perspective.json").read_text(encoding="utf-8"))
    flexible.apply_preset(camera, addon("projection.presets.preset").load_preset(json.dumps(preset)), ASPECT)
    camera.location, camera.rotation_euler = (0.0, 0.0, 0.0), (0.0, 0.0, 0.0)
    preview = remapped(camera, np.array([[1.0, 0.5, -10.0]]))
    first = placed(preview)[1][:, 0]
    far = camera.scfpf.surfaces[1].object
    width = surfaces.surface_parameters(far)["width"]
    surfaces.set_surface_parameters(far, {"width": 2 * width})
    near = camera.scfpf.surfaces[0].object
    surfaces.set_surface_parameters(near, {"width": 2 * surfaces.surface_parameters(near)["width"]})
    assert placed(preview)[1][0, 0] == pytest.approx(first[0] / 2, abs=PICTURE)
    far.location.x = 10.0
    far.keyframe_insert("location", frame=1)
    far.location.x = -10.0
    far.keyframe_insert("location", frame=11)
    places = []
    for frame in (1, 11):
        bpy.context.scene.frame_set(frame)
        places.append(placed(preview)[1][0, 0])
    assert places[1] - places[0] > 0.01
    camera.scfpf.u_range = (0.25, 0.75)
    assert abs(placed(preview)[1][0, 0] - places[1]) > 0.01


def test_what_is_behind_the_eye_or_far_outside_is_left_out(addon, scanline, flexible, camera, remapped):
    preset = (PRESETS[0].parent / "perspective.json").read_text(encoding="utf-8")
    flexible.apply_preset(camera, addon("projection.presets.preset").load_preset(preset), ASPECT)
    camera.location, camera.rotation_euler = (0.0, 0.0, 0.0), (0.0, 0.0, 0.0)
    behind = np.random.default_rng(2).uniform(-20, 20, (400, 3))
    behind[:, 2] = np.abs(behind[:, 2]) + 1.0
    _, box = placed(remapped(camera, behind))
    inside = (np.abs(box[0]) < 0.5) & (np.abs(box[1]) < 0.5 / ASPECT) & (box[2] < -1.0) & (box[2] > -2.0)
    assert not inside.any()


def test_faces_beyond_both_ends_of_a_view_all_round_are_left_out(addon, scanline, flexible, camera, remapped):
    preset = (PRESETS[0].parent / "around_the_car.json").read_text(encoding="utf-8")
    flexible.apply_preset(camera, addon("projection.presets.preset").load_preset(preset), ASPECT)
    camera.location, camera.rotation_euler = (0.0, -10.0, 1.0), (np.pi / 2, 0.0, 0.0)
    # A strip on the road behind the car: the image's left and right borders meet there.
    corners = [(x, y, 0.006) for y in (1.9, 3.6) for x in (-4.0, 4.0)]
    picture = remapped(camera, corners, 1)
    bpy.data.objects["Points"].data = strip = bpy.data.meshes.new("Strip")
    strip.from_pydata(corners, [], [(0, 1, 3, 2)])
    seen = picture.evaluated_get(bpy.context.evaluated_depsgraph_get())
    assert 0 < len(seen.data.polygons) < 20_000
    # All of its points have a place, though faces across the seam have corners at both ends.
    assert scanline.remap_counts(seen)["unreachable"] == 0


@pytest.mark.parametrize("size", [1e3, 1e4, 1e5, 1e6])
def test_a_ground_of_any_size_has_a_place(scanline, flexible, camera, remapped, size):
    """One face of two sizes across, in a view that ends at 1,000."""
    camera.location, camera.rotation_euler = (0.0, -10.0, 2.0), (1.4, 0.0, 0.0)
    camera.data.clip_end = 1000.0
    bpy.context.view_layer.update()
    flexible.volume_from_camera(camera, bpy.context.scene)
    corners = [(x, y, 0.0) for y in (-size, size) for x in (-size, size)]
    picture = remapped(camera, corners, 1)
    bpy.data.objects["Points"].data = ground = bpy.data.meshes.new("Ground")
    ground.from_pydata(corners, [], [(0, 1, 3, 2)])
    seen = picture.evaluated_get(bpy.context.evaluated_depsgraph_get())
    assert scanline.remap_counts(seen)["unreachable"] == 0
    polygons = [list(face.vertices) for face in seen.data.polygons]
    tree = BVHTree.FromPolygons([vertex.co for vertex in seen.data.vertices], polygons)
    # The lower part of the image looks at the ground nearer than 100.
    for x, y in np.stack(np.meshgrid(np.linspace(-0.49, 0.49, 25), np.linspace(-0.27, -0.1, 9)), -1).reshape(
        -1, 2
    ):
        assert tree.ray_cast(Vector((x, y, -1.0)), Vector((0.0, 0.0, -1.0)), 1.0)[0] is not None


def test_normals_materials_uvs_and_colours_survive(addon, scanline, flexible, camera, remapped):
    preset = (PRESETS[0].parent / "orthographic.json").read_text(encoding="utf-8")
    flexible.apply_preset(camera, addon("projection.presets.preset").load_preset(preset), ASPECT)
    camera.location, camera.rotation_euler = (0.0, 0.0, 0.0), (0.0, 0.0, 0.0)
    preview = remapped(camera, np.array([[0.0, 0.0, -5.0]]))
    bpy.ops.mesh.primitive_uv_sphere_add(radius=1.0, location=(0.0, 0.0, -10.0))
    ball = bpy.context.object
    bpy.ops.object.shade_smooth()
    bpy.context.scene.collection.objects.unlink(ball)
    ball.data.materials.append(bpy.data.materials.new("Red"))
    colour = ball.data.color_attributes.new("Tint", "FLOAT_COLOR", "POINT")
    for corner, value in zip(colour.data, np.linspace(0, 1, len(colour.data)), strict=True):
        corner.color = (value, 0.0, 0.0, 1.0)
    bpy.data.collections["Seen"].objects.link(ball)
    mesh = preview.evaluated_get(bpy.context.evaluated_depsgraph_get()).data
    assert [material.name for material in mesh.materials if material] == ["Red"]
    assert mesh.uv_layers.get("UVMap") and "Tint" in mesh.color_attributes
    assert not [each.name for each in mesh.attributes if each.name.startswith("scfpf_")]
    # A unit ball at x, y: the shading normal's x, y is the place, from widths of the picture to lengths.
    surface = camera.scfpf.surfaces[0].object
    width = addon("bridge.surfaces.surface_object").surface_parameters(surface)["width"]
    corners = mesh.corner_normals
    own = max(
        np.abs(np.array(normal.vector) - np.array(vertex.co))[:2].max()
        for normal, vertex in zip(ball.data.vertex_normals, ball.data.vertices, strict=True)
    )
    worst = 0.0
    for loop, normal in zip(mesh.loops, corners, strict=True):
        place = np.array(mesh.vertices[loop.vertex_index].co)[:2] * width
        if loop.vertex_index > 2:
            worst = max(worst, np.abs(np.array(normal.vector)[:2] - place).max())
    # A smooth sphere of quads has normals that are a little off its radii itself.
    assert worst < own + 1e-4


def test_surface_patches_are_smooth_between_the_points_that_are_drawn(
    addon, scanline, flexible, camera, remapped
):
    flexible.add_surface(camera, "PLANE", parameters={"width": 1.5, "height": 1.0})
    x, y = np.meshgrid(np.linspace(-3, 3, 5), np.linspace(-2, 2, 4))
    z = -5.0 + np.random.default_rng(0).uniform(-0.5, 0.5, x.shape)
    flexible.add_surface(camera, "NURBS", points=np.stack([x, y, z], axis=-1))
    check_volume(addon, scanline, camera, remapped, 6)


def test_a_reshaped_parametric_surface_is_the_mesh_that_it_became(
    addon, scanline, flexible, camera, remapped
):
    flexible.add_surface(camera, "PLANE", parameters={"width": 1.5, "height": 1.0})
    matrix = np.eye(4)
    matrix[2, 3] = -6.0
    size = {"width": 9.0, "height": 6.0, "resolution_u": 8, "resolution_v": 8}
    far = flexible.add_surface(camera, "PLANE", matrix=matrix, parameters=size)
    bend = far.modifiers.new("Bend", "SIMPLE_DEFORM")
    bend.deform_method, bend.deform_axis, bend.angle = "BEND", "Y", 0.8
    check_volume(addon, scanline, camera, remapped, 7)


def test_the_remap_works_in_a_modifier_stack_by_hand(addon, scanline, flexible, camera, remapped):
    """On an object of its own place, turn and uneven scale, after another modifier."""
    plane_generator = np.random.default_rng(8)
    for index in range(3):
        plane(flexible, camera, plane_generator, index, 3)
    bpy.context.view_layer.update()
    read = addon("bridge.camera.read_projection").read_projection
    projection = read(camera, bpy.context.evaluated_depsgraph_get(), ASPECT)
    x, y, t = random_places(9)
    image = projection.parameters(x, y)
    points = projection.volume.evaluate(image.u, image.v, t).position
    preview = remapped(camera, points.T)
    expected = placed(preview)[1]
    thing = bpy.data.objects.new("Thing", bpy.data.meshes.new("Thing"))
    bpy.context.scene.collection.objects.link(thing)
    thing.location, thing.rotation_euler, thing.scale = (3.0, -1.0, 2.0), (0.4, 0.1, 2.0), (2.0, 0.5, 1.5)
    bpy.context.view_layer.update()
    own = np.linalg.inv(np.array(thing.matrix_world)) @ np.vstack([points, np.ones(points.shape[1])])
    faces = np.arange(3 * points.shape[1]).reshape(-1, 3)
    # Half as far out as it belongs: the first modifier doubles it.
    thing.data.from_pydata(np.repeat(own[:3].T / 2, 3, 0).tolist(), [], faces.tolist())
    double = bpy.data.node_groups.new("Double", "GeometryNodeTree")
    for way in ("INPUT", "OUTPUT"):
        double.interface.new_socket("Geometry", in_out=way, socket_type="NodeSocketGeometry")
    kinds = ("NodeGroupInput", "GeometryNodeTransform", "NodeGroupOutput")
    start, scale, end = (double.nodes.new(kind) for kind in kinds)
    scale.inputs["Scale"].default_value = (2.0, 2.0, 2.0)
    double.links.new(start.outputs[0], scale.inputs["Geometry"])
    double.links.new(scale.outputs[0], end.inputs[0])
    thing.modifiers.new("Double", "NODES").node_group = double
    # As an artist finds it: by its name, among the groups that modifiers may have.
    group = bpy.data.node_groups["SCFPF Remap"]
    assert group.is_modifier
    by_hand = thing.modifiers.new("Seen", "NODES")
    by_hand.node_group = group
    inputs = {item.name: item for item in group.interface.items_tree if item.in_out == "INPUT"}
    assert all(item.description for item in inputs.values())
    versions = addon("bridge.blender.versions")
    for name, value in {"Table": scanline.table_object(camera), "Aspect": ASPECT}.items():
        versions.set_modifier_input(by_hand, inputs[name].identifier, value)
    by_hand.node_group = group
    evaluated = thing.evaluated_get(bpy.context.evaluated_depsgraph_get())
    seen = np.empty(3 * len(evaluated.data.vertices), np.float32)
    evaluated.data.vertices.foreach_get("co", seen)
    seen = np.vstack([seen.reshape(-1, 3).T, np.ones(len(seen) // 3)])
    in_camera = (np.linalg.inv(np.array(camera.matrix_world)) @ np.array(thing.matrix_world) @ seen)[:3]
    assert in_camera.shape == expected.shape
    assert np.abs(in_camera - expected).max() < PICTURE


def test_node_groups_can_be_read(scanline, flexible, camera):
    """Every node is named, those of the groups that artists open stand in frames, and none covers another."""
    flexible.add_surface(camera, "PLANE", parameters={"width": 1.5, "height": 1.0})
    flexible.add_surface(camera, "PLANE", matrix=np.diag([1.0, 1.0, 1.0, 1.0]))
    scanline.table_object(camera)
    scanline.preview_group()
    groups = [tree for tree in bpy.data.node_groups if tree.name.startswith("SCFPF")]
    assert len(groups) > 20
    for tree in groups:
        assert tree.description, tree.name
        places = [tuple(node.location) for node in tree.nodes if node.bl_idname != "NodeFrame"]
        assert all(node.label for node in tree.nodes), tree.name
        assert len(places) - len(set(places)) <= 2, tree.name
    ends = {"NodeFrame", "NodeGroupInput", "NodeGroupOutput"}
    for node in bpy.data.node_groups["SCFPF Remap"].nodes:
        assert node.bl_idname in ends or node.parent is not None, node.name
