# SPDX-License-Identifier: GPL-3.0-or-later
"""The nodes preview keeps normals, materials, UVs and colours as Blender evaluates them."""

import bpy
import numpy as np
import pytest
from mathutils import Matrix

pytestmark = pytest.mark.usefixtures("built_groups")

NEAR, FAR, WIDTH, HEIGHT = -1.0, -11.0, 12.0, 8.0
# float32 of the viewbox over its extent, and Newton's rest.
PLACE = 2e-5
# Normals are stored in 16 bits a part where they are custom.
NORMAL = 2e-3


@pytest.fixture
def flexible(addon):
    """The scene's flexible camera: orthographic, so that places in the viewbox are easily undone."""
    flexible_camera = addon("bridge.camera.flexible_camera")
    camera = bpy.data.objects.new("Camera", bpy.data.cameras.new("Camera"))
    scene = bpy.context.scene
    scene.collection.objects.link(camera)
    scene.camera = camera
    flexible_camera.make_flexible(camera)
    for z in (NEAR, FAR):
        flexible_camera.add_surface(
            camera,
            "PLANE",
            matrix=np.array(Matrix.Translation((0, 0, z))),
            parameters={"width": WIDTH, "height": HEIGHT},
        )
    scene.render.resolution_x, scene.render.resolution_y = 1500, 1000
    # So coarse that nothing is divided, and all elements keep their order.
    camera.scfpf.pixel_error = camera.scfpf.bl_rna.properties["pixel_error"].hard_max
    bpy.context.view_layer.objects.active = camera
    return camera


@pytest.fixture
def source(flexible, addon):
    """The camera's preview, switched on."""
    bpy.ops.scfpf.preview_toggle()
    return addon("scanline.preview.preview_data").preview_of(flexible, bpy.context.scene)


def shown(source):
    """The evaluated mesh of a preview's picture."""
    (part,) = source.scfpf_preview.parts
    return part.picture.evaluated_get(bpy.context.evaluated_depsgraph_get()).data


def read(values, name, width, kind=np.float32):
    array = np.empty(len(values) * width, kind)
    values.foreach_get(name, array)
    return array.reshape(len(values), width).astype(np.float64)


def elements(mesh, matrix=None):
    """The attributes to be kept: place, normal, UV and colour of corners, material and size of faces."""
    matrix = np.eye(4) if matrix is None else np.array(matrix)
    order = np.arange(len(mesh.loops))
    if np.linalg.det(matrix[:3, :3]) < 0:
        # Seen from its outside, the corners of a mirrored face go round the other way.
        for face in mesh.polygons:
            order[face.loop_start + 1 : face.loop_start + face.loop_total] = order[
                face.loop_start + face.loop_total - 1 : face.loop_start : -1
            ]
    corners = read(mesh.loops, "vertex_index", 1, np.int32)[order, 0].astype(int)
    place = read(mesh.vertices, "co", 3) @ matrix[:3, :3].T + matrix[:3, 3]
    normal = read(mesh.corner_normals, "vector", 3)[order] @ np.linalg.inv(matrix[:3, :3])
    found = {
        "place": place[corners],
        "normal": normal / np.linalg.norm(normal, axis=1, keepdims=True),
        "sizes": read(mesh.polygons, "loop_total", 1, np.int32),
    }
    names = [material.name if material else "" for material in mesh.materials] or [""]
    numbers = read(mesh.polygons, "material_index", 1, np.int32)[:, 0].astype(int)
    found["materials"] = [names[min(number, len(names) - 1)] for number in numbers]
    if mesh.uv_layers:
        found["uv"] = read(mesh.uv_layers[0].uv, "vector", 2)[order]
    if "Tint" in mesh.attributes:
        tint = mesh.attributes["Tint"]
        values = read(tint.data, "color", 4)
        found["tint"] = values[order] if tint.domain == "CORNER" else values[corners]
    return found


def of_scene():
    """The same of Blender's own evaluation, from the depsgraph's instances."""
    depsgraph, found = bpy.context.evaluated_depsgraph_get(), []
    for instance in depsgraph.object_instances:
        thing = instance.object
        # What curves, texts and metaballs become is listed as a mesh too.
        if thing.type != "MESH" or thing.original.hide_render or thing.original.scfpf_surface.kind != "NONE":
            continue
        mesh = thing.to_mesh()
        if mesh is not None and len(mesh.polygons):
            found.append(elements(mesh, instance.matrix_world.copy()))
        thing.to_mesh_clear()
    assert found
    return found


def joined(found):
    whole = {key: np.concatenate([one[key] for one in found]) for key in found[0]}
    return whole | {"materials": whole["materials"].tolist()}


def undone(mesh):
    """The preview's elements with their places back in the scene."""
    found = elements(mesh)
    x, y, z = found["place"].T
    found["place"] = np.stack([x * WIDTH, y * WIDTH, NEAR + (-1.0 - z) * (FAR - NEAR)], axis=1)
    return found


def check(case, source):
    expected, got = joined(of_scene()), undone(shown(source))
    assert got["materials"] == expected["materials"], case
    assert np.array_equal(got["sizes"], expected["sizes"]), case
    assert np.abs(got["place"] - expected["place"]).max() < PLACE * WIDTH, case
    assert np.abs(got["normal"] - expected["normal"]).max() < NORMAL, case
    for key in ("uv", "tint"):
        if key in expected:
            assert np.abs(got[key] - expected[key]).max() < 1e-5, (case, key)


def link(name, data, location=(0.0, 0.0, -5.0)):
    made = bpy.data.objects.new(name, data)
    made.location = location
    bpy.context.scene.collection.objects.link(made)
    return made


def add_ball(smooth=True):
    """A ball with two materials, UVs and colours."""
    bpy.ops.mesh.primitive_uv_sphere_add(segments=16, ring_count=8, radius=1.0, location=(0, 0, -5))
    ball = bpy.context.object
    (bpy.ops.object.shade_smooth if smooth else bpy.ops.object.shade_flat)()
    for name in ("Red", "Blue"):
        ball.data.materials.append(bpy.data.materials.new(name))
    for number, polygon in enumerate(ball.data.polygons):
        polygon.material_index = number % 2
    tint = ball.data.color_attributes.new("Tint", "FLOAT_COLOR", "CORNER")
    values = np.random.default_rng(0).uniform(0, 1, (len(tint.data), 4)).astype(np.float32)
    tint.data.foreach_set("color", values.ravel())
    return ball


def flat():
    add_ball(smooth=False)


def modified():
    ball = add_ball()
    ball.modifiers.new("Wave", "SIMPLE_DEFORM").angle = 1.0
    array = ball.modifiers.new("Array", "ARRAY")
    array.count = 2
    ball.modifiers.new("Subdivision", "SUBSURF").levels = 1
    ball.location.x = -1


def custom_normals():
    ball = add_ball()
    ball.data.normals_split_custom_set_from_vertices([(0.6, 0.0, 0.8)] * len(ball.data.vertices))


def mirrored():
    ball = add_ball()
    ball.scale = (-1.5, 1.5, 1.5)
    ball.rotation_euler = (0.3, 0.2, 0.1)


def shape_keys():
    ball = add_ball()
    ball.shape_key_add(name="Basis")
    key = ball.shape_key_add(name="Wide")
    for point in key.data:
        point.co.x *= 2
    key.value = 0.5


def text():
    data = bpy.data.curves.new("Text", "FONT")
    data.body, data.extrude = "Ab", 0.2
    data.materials.append(bpy.data.materials.new("Ink"))
    link("Text", data)


def curve():
    bpy.ops.curve.primitive_bezier_circle_add(location=(0, 0, -5))
    bpy.context.object.data.bevel_depth = 0.2


def metaball():
    bpy.ops.object.metaball_add(location=(0, 0, -5), radius=1.0)


def collection_instance():
    ball = add_ball()
    held = bpy.data.collections.new("Held")
    bpy.context.scene.collection.objects.unlink(ball)
    held.objects.link(ball)
    for x in (-2, 2):
        carrier = link("Carrier", None, (x, 0, 0))
        carrier.instance_type, carrier.instance_collection = "COLLECTION", held
        carrier.rotation_euler.z = 0.5 * x


def node_instances():
    ball = add_ball()
    bpy.context.scene.collection.objects.unlink(ball)
    mesh = bpy.data.meshes.new("Points")
    mesh.from_pydata([(-2, 0, -5), (0, 1, -6), (2, 0, -4)], [], [])
    carrier = link("Carrier", mesh, (0, 0, 0))
    tree = bpy.data.node_groups.new("Instances", "GeometryNodeTree")
    for way in ("INPUT", "OUTPUT"):
        tree.interface.new_socket("Geometry", in_out=way, socket_type="NodeSocketGeometry")
    kinds = ("NodeGroupInput", "GeometryNodeObjectInfo", "GeometryNodeInstanceOnPoints", "NodeGroupOutput")
    start, info, instance, end = (tree.nodes.new(kind) for kind in kinds)
    info.inputs["Object"].default_value = ball
    info.inputs["As Instance"].default_value = True
    tree.links.new(start.outputs[0], instance.inputs["Points"])
    tree.links.new(info.outputs["Geometry"], instance.inputs["Instance"])
    tree.links.new(instance.outputs[0], end.inputs[0])
    carrier.modifiers.new("Instances", "NODES").node_group = tree


def uneven():
    ball = add_ball()
    ball.scale, ball.rotation_euler = (2.0, 0.5, 1.0), (0.3, 0.8, 0.1)


def uneven_with_custom_normals():
    custom_normals()
    ball = bpy.context.object
    ball.scale, ball.rotation_euler = (0.4, 1.0, 2.0), (0.3, 0.8, 0.1)


def sheared():
    """Turned within a parent that is scaled unevenly: no scale of its own says so."""
    ball, parent = add_ball(), link("Parent", None)
    parent.scale = (2.0, 0.6, 1.0)
    ball.parent, ball.location, ball.rotation_euler = parent, (0.2, 0.0, 0.0), (0.5, 0.4, 0.8)


def mirrored_twice():
    ball, parent = add_ball(), link("Parent", None)
    parent.scale = (-1.0, 0.7, 1.2)
    ball.parent, ball.location, ball.scale = parent, (0.0, 0.0, 0.0), (1.0, -1.0, 1.0)


def instance(held, parent=None):
    """An empty that instances a collection."""
    carrier = link("Carrier", None)
    carrier.instance_type, carrier.instance_collection, carrier.parent = "COLLECTION", held, parent
    return carrier


def held(name, *things):
    """A collection of things that the scene does not have otherwise."""
    made = bpy.data.collections.new(name)
    for thing in things:
        bpy.context.scene.collection.objects.unlink(thing)
        made.objects.link(thing)
    return made


def nested_mirrors():
    """Mirrored in an instance that is mirrored in one that is not even."""
    ball = add_ball()
    ball.location, ball.scale = (0.2, 0.1, 0.0), (-1.0, 1.0, 1.0)
    inner = instance(held("Inner", ball))
    inner.location, inner.scale, inner.rotation_euler = (0.3, 0.0, 0.0), (1.0, -1.0, 1.0), (0.2, 0.4, 0.0)
    outer = instance(held("Outer", inner))
    outer.scale, outer.rotation_euler = (1.5, 0.5, -1.0), (0.0, 0.3, 0.7)


def uneven_within_even():
    """Only the innermost of three is not even: outside nothing tells."""
    ball = add_ball()
    ball.location, ball.scale = (0.0, 0.0, 0.0), (1.5, 1.0, 0.3)
    inner = instance(held("Innermost", ball))
    inner.location, inner.rotation_euler = (0.3, 0.0, 0.0), (0.2, 0.4, 0.0)
    instance(held("Around", inner)).rotation_euler = (0.0, 0.0, 0.7)


CASES = (
    add_ball,
    uneven,
    uneven_with_custom_normals,
    sheared,
    mirrored_twice,
    nested_mirrors,
    uneven_within_even,
    flat,
    modified,
    custom_normals,
    mirrored,
    shape_keys,
    text,
    curve,
    metaball,
    collection_instance,
    node_instances,
)


def test_what_blender_shows_survives(source):
    # One after the other under one preview: building its nodes takes longer than all of them.
    before = set(bpy.data.objects)
    for make in CASES:
        make()
        bpy.context.view_layer.update()
        bpy.context.view_layer.update()
        check(make.__name__, source)
        bpy.data.batch_remove(set(bpy.data.objects) - before)


def test_an_object_in_edit_mode_shows_its_edit(source):
    ball = add_ball()
    bpy.context.view_layer.update()
    bpy.context.view_layer.update()
    before = read(shown(source).vertices, "co", 3)
    bpy.context.view_layer.objects.active = ball
    bpy.ops.object.mode_set(mode="EDIT")
    bpy.ops.mesh.select_all(action="SELECT")
    bpy.ops.transform.translate(value=(1.2, 0, 0))
    bpy.context.view_layer.update()
    after = read(shown(source).vertices, "co", 3)
    assert after[:, 0] - before[:, 0] == pytest.approx(0.1, abs=1e-4)
    bpy.ops.object.mode_set(mode="OBJECT")
