# SPDX-License-Identifier: GPL-3.0-or-later
"""Reading a scene: every kind of object, its transform, normals and slots."""

import math
from dataclasses import replace

import bpy
import numpy as np
import pytest
from engine_images import f12
from mathutils import Euler, Matrix, Vector
from small_scenes import corners, cube_mesh, link, shown, triangle_mesh, triangles_of

COMBINED = "ViewLayer.Combined"


def geometric_normals(scene, which=slice(None)):
    a, b, c = corners(scene, which).swapaxes(0, 1)
    normals = np.cross(b - a, c - a)
    return normals / np.linalg.norm(normals, axis=1, keepdims=True)


def area(scene, which=slice(None)):
    a, b, c = corners(scene, which).swapaxes(0, 1)
    return np.linalg.norm(np.cross(b - a, c - a), axis=1).sum() / 2


def test_arrays_have_the_contracts_types_and_shapes(read):
    mesh = cube_mesh()
    mesh.shade_smooth()
    link("Cube", mesh)
    geometry = read().geometry
    assert geometry.vertices.shape == (8, 3) and geometry.vertices.dtype == np.float64
    assert geometry.triangles.shape == (12, 3) and geometry.triangles.dtype == np.int32
    assert geometry.corner_normals.shape == (12, 3, 3) and geometry.corner_normals.dtype == np.float32
    assert geometry.material.shape == (12,) and geometry.material.dtype == np.int32
    assert geometry.object_index.shape == (12,) and geometry.object_index.dtype == np.int32
    assert geometry.object_names == ("Cube",)


def test_vertices_are_transformed_in_float64(read):
    mesh = cube_mesh()
    obj = link("Far", mesh)
    obj.matrix_world = Matrix.LocRotScale((1e6, -3e5, 12.0), Euler((0.3, 1.1, -2.0)), (1.7, 0.02, 30.0))
    bpy.context.view_layer.update()
    matrix = np.array(obj.matrix_world, np.float64)
    local = np.array([vertex.co for vertex in mesh.vertices], np.float64)
    assert read().geometry.vertices == pytest.approx(local @ matrix[:3, :3].T + matrix[:3, 3], rel=1e-15)


@pytest.mark.parametrize(
    "scale", [(1, 1, 1), (2, 0.3, 5), (-1, 1, 1), (1, -3, 0.2), (-1, -2, -0.5), (-1, -1, 1)]
)
def test_normals_point_out_of_a_closed_mesh_at_any_scale(read, scale):
    bpy.ops.mesh.primitive_uv_sphere_add(segments=24, ring_count=12, location=(3, -2, 5))
    obj = bpy.context.object
    obj.data.shade_smooth()
    obj.rotation_euler = (0.4, -1.0, 2.2)
    obj.scale = scale
    scene = read()
    outward = corners(scene, slice(None)).mean(axis=1) - np.array(obj.location)
    geometric = geometric_normals(scene)
    assert (np.einsum("tc,tc->t", outward, geometric) > 0).all()
    assert np.linalg.norm(scene.geometry.corner_normals, axis=2) == pytest.approx(1, abs=1e-6)
    # The ellipsoid's own normal: the gradient of x'Mx, in the object's axes p / s².
    rotation = np.array(obj.rotation_euler.to_matrix())
    local = (corners(scene, slice(None)) - np.array(obj.location)) @ rotation
    exact = (local / np.square(scale)) @ rotation.T
    exact /= np.linalg.norm(exact, axis=2, keepdims=True)
    # Blender's smooth normals are averages over faces: 15° apart there, a few degrees from exact.
    assert np.einsum("tkc,tkc->tk", exact, scene.geometry.corner_normals).min() > math.cos(math.radians(10))


def test_a_flattened_object_has_the_normal_of_its_plane(read):
    obj = link("Flat", cube_mesh())
    obj.scale = (1, 1, 0)
    obj.rotation_euler = (0.5, 0.2, 0)
    bpy.ops.mesh.primitive_uv_sphere_add(segments=4, ring_count=3, radius=0.1)
    bpy.context.object.data.shade_smooth()
    scene = read()
    plane = np.array(obj.rotation_euler.to_matrix())[:, 2]
    lids = [triangle for triangle in triangles_of(scene, "Flat") if area(scene, [triangle]) > 1]
    assert len(lids) == 4
    assert np.abs(scene.geometry.corner_normals[lids] @ plane) == pytest.approx(1, abs=1e-6)
    assert np.isfinite(scene.geometry.corner_normals).all()


def test_smooth_faces_share_normals(read):
    mesh = cube_mesh()
    mesh.shade_smooth()
    link("Smooth", mesh)
    scene = read()
    expected = corners(scene, slice(None)) / math.sqrt(3)
    assert scene.geometry.corner_normals == pytest.approx(expected, abs=1e-6)


def test_custom_normals_are_read(read):
    mesh = cube_mesh()
    mesh.shade_smooth()
    wanted = Vector((0.36, 0.48, 0.8))
    mesh.normals_split_custom_set([wanted] * len(mesh.loops))
    link("Custom", mesh)
    # Blender stores custom normals in 16 bits an angle.
    assert read().geometry.corner_normals == pytest.approx(
        np.broadcast_to(np.array(wanted), (12, 3, 3)), abs=1e-3
    )


def test_modifiers_are_applied(read):
    obj = link("Array", cube_mesh())
    modifier = obj.modifiers.new("Array", "ARRAY")
    modifier.count = 4
    assert len(read().geometry.triangles) == 4 * 12


def test_ngons_cover_their_polygon(read):
    mesh = bpy.data.meshes.new("L")
    outline = [(0, 0), (3, 0), (3, 1), (1, 1), (1, 2), (0, 2)]
    mesh.from_pydata([(x, y, 0) for x, y in outline], [], [range(6)])
    link("L", mesh)
    scene = read()
    assert len(scene.geometry.triangles) == 4
    assert area(scene) == pytest.approx(4.0)
    assert geometric_normals(scene) == pytest.approx(np.broadcast_to([0.0, 0, 1], (4, 3)))


def curve():
    bpy.ops.curve.primitive_bezier_circle_add(radius=2)
    bpy.context.object.data.bevel_depth = 0.25
    bpy.context.object.data.bevel_resolution = 16
    bpy.context.object.data.resolution_u = 64
    return 4 * math.pi**2 * 2 * 0.25


def surface():
    bpy.ops.surface.primitive_nurbs_surface_sphere_add(radius=1.5)
    bpy.context.object.data.resolution_u = bpy.context.object.data.resolution_v = 16
    return None


def text():
    bpy.ops.object.text_add()
    bpy.context.object.data.body = "HI"
    bpy.context.object.data.extrude = 0.1
    return None


def metaball():
    bpy.ops.object.metaball_add(radius=1)
    return None


@pytest.mark.parametrize("make", [curve, surface, text, metaball])
def test_other_geometry_is_read_as_a_mesh(read, make):
    expected = make()
    obj = bpy.context.object
    obj.location = (4, 5, 6)
    scene = read()
    mesh = obj.evaluated_get(bpy.context.evaluated_depsgraph_get()).to_mesh()
    mesh.calc_loop_triangles()
    assert len(scene.geometry.triangles) == len(mesh.loop_triangles) > 0
    assert area(scene) == pytest.approx(sum(face.area for face in mesh.polygons), rel=1e-4)
    if expected:
        assert area(scene) == pytest.approx(expected, rel=0.01)
    low, high = scene.geometry.vertices.min(axis=0), scene.geometry.vertices.max(axis=0)
    box = np.array([obj.matrix_world @ Vector(corner) for corner in obj.bound_box])
    assert low == pytest.approx(box.min(axis=0), abs=0.05)
    assert high == pytest.approx(box.max(axis=0), abs=0.05)


def test_instances_stand_where_blender_puts_them(read):
    mesh = triangle_mesh()
    inner = bpy.data.collections.new("Inner")
    link("Leaf", mesh, inner).location = (1, 2, 3)
    outer = bpy.data.collections.new("Outer")
    nested = link("Nested", None, outer)
    nested.instance_type, nested.instance_collection = "COLLECTION", inner
    nested.scale = (-2, 1, 1)
    for x in (0, 10, 20):
        empty = link("Empty", None)
        empty.instance_type, empty.instance_collection = "COLLECTION", outer
        empty.location, empty.rotation_euler = (x, 0, 0), (0, 0, x)
    scene = read()
    instances = [
        np.array(instance.matrix_world)
        for instance in bpy.context.evaluated_depsgraph_get().object_instances
        if instance.object.type == "MESH"
    ]
    assert len(instances) == len(scene.geometry.triangles) == 3
    assert scene.geometry.object_names == ("Leaf",)
    local = np.array([[0, 0, 0, 1], [1, 0, 0, 1], [0, 1, 0, 1]])
    expected = np.array([(local @ matrix.T)[:, :3] for matrix in instances])
    # The scale mirrors: vertices stay in place, the winding turns over.
    assert scene.geometry.vertices.reshape(3, 3, 3) == pytest.approx(expected)
    assert geometric_normals(scene) == pytest.approx(np.broadcast_to([0.0, 0, 1], (3, 3)), abs=1e-6)


def geometry_nodes_cubes(target):
    """Instance a cube on every vertex of ``target``, without the mesh itself."""
    tree = bpy.data.node_groups.new("Instances", "GeometryNodeTree")
    for direction in ("INPUT", "OUTPUT"):
        tree.interface.new_socket("Geometry", in_out=direction, socket_type="NodeSocketGeometry")
    nodes = [
        tree.nodes.new(kind)
        for kind in (
            "NodeGroupInput",
            "GeometryNodeMeshCube",
            "GeometryNodeSetMaterial",
            "GeometryNodeInstanceOnPoints",
            "NodeGroupOutput",
        )
    ]
    source, cube, material, instance, output = nodes
    material.inputs["Material"].default_value = bpy.data.materials.new("Of the nodes")
    tree.links.new(cube.outputs["Mesh"], material.inputs["Geometry"])
    tree.links.new(source.outputs[0], instance.inputs["Points"])
    tree.links.new(material.outputs["Geometry"], instance.inputs["Instance"])
    tree.links.new(instance.outputs[0], output.inputs[0])
    target.modifiers.new("Instances", "NODES").node_group = tree


def test_geometry_nodes_instances_are_read(read):
    obj = link("Points", triangle_mesh(((0, 0, 0), (5, 0, 0), (0, 5, 0))))
    obj.location.z = 7
    geometry_nodes_cubes(obj)
    scene = read()
    assert len(scene.geometry.triangles) == 36
    centres = scene.geometry.vertices.reshape(3, 8, 3).mean(axis=1)
    assert sorted(centres.tolist()) == [[0, 0, 7], [0, 5, 7], [5, 0, 7]]
    assert set(scene.geometry.material) == {1}


def test_instancing_on_vertices_hides_the_instancer_when_asked(read_render):
    parent = link("Parent", triangle_mesh())
    parent.instance_type = "VERTS"
    parent.show_instancer_for_render = False
    link("Child", triangle_mesh()).parent = parent
    scene = read_render()
    assert shown(scene) == {"Child"} and len(scene.geometry.triangles) == 3


def test_one_mesh_is_read_once(addon, monkeypatch):
    module = addon("bridge.scene.read_scene")
    mesh, calls = cube_mesh(), []
    read_mesh = module.read_mesh

    def noted(one, *options):
        calls.append(one.name)
        return read_mesh(one, *options)

    monkeypatch.setattr(module, "read_mesh", noted)
    inside = bpy.data.collections.new("Inside")
    link("Leaf", mesh, inside)
    for number in range(20):
        link("Alone", mesh).location.x = number
        empty = link("Empty", None)
        empty.instance_type, empty.instance_collection = "COLLECTION", inside
    scene = module.read_scene(bpy.context.evaluated_depsgraph_get())
    assert len(scene.geometry.triangles) == 40 * 12
    assert calls == ["Cube"]


def test_every_face_has_the_material_of_its_slot(read):
    mesh = cube_mesh()
    colors = {"Red": (1, 0, 0), "Green": (0, 1, 0), "Blue": (0, 0, 1)}
    materials = {name: bpy.data.materials.new(name) for name in colors}
    for name, color in colors.items():
        materials[name].diffuse_color = (*color, 1)
        if materials[name].node_tree:
            shader = materials[name].node_tree.nodes["Principled BSDF"]
            shader.inputs["Base Color"].default_value = (*color, 1)
    for name in ("Red", "Green", None):
        mesh.materials.append(materials.get(name))
    for face, slot in zip(mesh.polygons, (0, 1, 2, 3, 40, 0), strict=True):
        face.material_index = slot
    first, second = link("First", mesh), link("Second", mesh)
    second.material_slots[0].link = "OBJECT"
    second.material_slots[0].material = materials["Blue"]
    assert first.material_slots[0].material == materials["Red"]
    scene = read()
    shown_colors = scene.materials.base_color[scene.geometry.material]
    centre = corners(scene, slice(None)).mean(axis=1)
    for obj, of_slot_0 in ((first, "Red"), (second, "Blue")):
        which = triangles_of(scene, obj.name)
        for face, slot in zip(mesh.polygons, (0, 1, 2, 3, 40, 0), strict=True):
            on_face = which[np.abs((centre[which] - np.array(face.center)) @ np.array(face.normal)) < 1e-6]
            assert len(on_face) == 2
            # Empty slots are grey; numbers beyond the slots mean the last one, as in Cycles.
            wanted = {0: colors[of_slot_0], 1: colors["Green"]}.get(slot, (0.8, 0.8, 0.8))
            assert shown_colors[on_face] == pytest.approx(np.broadcast_to(wanted, (2, 3)))


def test_hidden_objects_are_shown_where_they_are_instanced(read, read_render):
    """The usual way to scatter: the source is hidden, its instances are not. F12 does the same."""
    source = link("Source", triangle_mesh())
    source.hide_render = True
    host = link("Host", triangle_mesh())
    geometry_nodes_cubes(host)
    tree = host.modifiers[0].node_group
    instance = next(node for node in tree.nodes if node.bl_idname == "GeometryNodeInstanceOnPoints")
    info = tree.nodes.new("GeometryNodeObjectInfo")
    info.inputs["Object"].default_value, info.inputs["As Instance"].default_value = source, True
    tree.links.new(info.outputs["Geometry"], instance.inputs["Instance"])
    for scene in (read(), read_render()):
        assert shown(scene) == {"Source"} and len(scene.geometry.triangles) == 3


def test_edit_mode_shows_the_edited_mesh(read, read_render):
    import bmesh

    bpy.ops.mesh.primitive_cube_add()
    obj = bpy.context.object
    obj.modifiers.new("Array", "ARRAY").count = 3
    bpy.ops.object.mode_set(mode="EDIT")
    editing = bmesh.from_edit_mesh(obj.data)
    for vertex in editing.verts:
        vertex.co.z += 50
    bmesh.update_edit_mesh(obj.data)
    for scene in (read(), read_render()):
        assert len(scene.geometry.triangles) == 36
        assert scene.geometry.vertices[:, 2].min() == pytest.approx(49)
    assert obj.mode == "EDIT"


def test_animation_is_read_at_the_frame(read, read_render):
    obj = link("Moving", triangle_mesh())
    for frame, x in ((1, 0.0), (11, 10.0)):
        obj.location.x = x
        obj.keyframe_insert("location", frame=frame)
    for curve in obj.animation_data.action.layers[0].strips[0].channelbags[0].fcurves:
        for key in curve.keyframe_points:
            key.interpolation = "LINEAR"
    for frame in (1, 6, 11):
        bpy.context.scene.frame_set(frame)
        for scene in (read(), read_render()):
            assert scene.geometry.vertices[:, 0].min() == pytest.approx(frame - 1, abs=1e-5)
    bpy.context.scene.frame_set(6, subframe=0.5)
    assert read_render().geometry.vertices[:, 0].min() == pytest.approx(5.5, abs=1e-5)


def test_lights_and_world_come_along(read_render):
    link("Shown", triangle_mesh())
    world = bpy.context.scene.world = bpy.data.worlds.new("World")
    world.color = (0.1, 0.2, 0.3)
    if world.node_tree:
        background = next(node for node in world.node_tree.nodes if node.type == "BACKGROUND")
        background.inputs["Color"].default_value = (0.1, 0.2, 0.3, 1)
    inside = bpy.data.collections.new("Inside")
    lamp = link("Lamp", bpy.data.lights.new("Lamp", "POINT"), inside)
    lamp.location = (1, 0, 0)
    for x in (10, 20):
        empty = link("Empty", None)
        empty.instance_type, empty.instance_collection = "COLLECTION", inside
        empty.location.x = x
    link("Off", bpy.data.lights.new("Off", "POINT")).hide_render = True
    link("Zero", bpy.data.lights.new("Zero", "SUN")).data.energy = 0
    scene = read_render()
    assert sorted(light.matrix[0, 3] for light in scene.lights) == [11, 21]
    assert scene.world_color == pytest.approx((0.1, 0.2, 0.3))


def test_faces_of_one_triangle_are_read_in_order(addon):
    """Triangulation is skipped if every face is a triangle, and runs once a face has four corners."""
    arrays = addon("bridge.scene.mesh_arrays")
    points = [(0, 0, 0), (1, 0, 0), (1, 1, 0), (0, 1, 0), (0, 0, 1)]
    for faces in ([(4, 1, 0), (2, 3, 4), (1, 4, 2)], [(4, 1, 0), (0, 1, 2, 3), (2, 3, 4)]):
        mesh = bpy.data.meshes.new("Faces")
        mesh.from_pydata(points, [], faces)
        found = arrays.read_mesh(mesh)
        mesh.calc_loop_triangles()
        assert found.triangles.tolist() == [list(each.vertices) for each in mesh.loop_triangles]
        own = arrays.own_normals(found.vertices, found.triangles)
        assert found.normals is None
        assert np.allclose(own[:, 0], [each.normal for each in mesh.loop_triangles], atol=1e-6)
        assert found.vertices.tolist() == [list(point) for point in points]


def plain_and_smooth():
    """A flat mesh of triangles alone, turned, flattened and mirrored; a smooth one, to be linked."""
    bpy.ops.mesh.primitive_ico_sphere_add(subdivisions=2)
    plain = bpy.context.object
    plain.name, plain.location.x = "Plain", 3
    plain.rotation_euler, plain.scale = (0.4, 1.0, -0.3), (-2, 0.5, 1)
    bpy.ops.mesh.primitive_uv_sphere_add(segments=16, ring_count=8)
    bpy.context.object.name = "Smooth"
    bpy.context.object.data.shade_smooth()
    return plain, bpy.context.object


def test_normals_of_triangles_are_left_out_where_no_others_are(read):
    _, smooth = plain_and_smooth()
    together = read()
    bpy.context.scene.collection.objects.unlink(smooth)
    alone = read()
    assert alone.geometry.corner_normals is None and alone.geometry.flat
    mine = np.isin(np.arange(len(together.geometry.triangles)), triangles_of(together, "Plain"))
    own = together.geometry.part(mine)
    assert np.array_equal(own.vertices, alone.geometry.vertices)
    assert np.array_equal(own.triangles, alone.geometry.triangles)
    # Those of the mesh, turned; those of the triangles as they stand are the same.
    difference = own.corner_normals - geometric_normals(alone)[:, None]
    assert np.abs(difference).max() < 1e-5


def test_normals_of_broken_meshes_fit_the_remaining_triangles(read):
    """Triangles with a NaN corner are left out of both."""
    plain, _ = plain_and_smooth()
    plain.data.vertices[0].co.x = math.nan
    geometry = read().geometry
    assert len(geometry.triangles) == len(geometry.corner_normals) == 80 - 5 + 16 * 14


def test_images_of_triangles_are_those_by_normals_of_corners(addon, engine_scene, monkeypatch):
    plain, smooth = plain_and_smooth()
    for other in (smooth, bpy.data.objects["Cube"]):
        bpy.data.objects.remove(other)
    plain.location.x, plain.location.z = 0, 0
    own = f12(engine_scene)[COMBINED]
    module = addon("bridge.scene.read_scene")
    read_mesh = module.read_mesh

    def with_normals(mesh, with_uv):
        found = read_mesh(mesh, with_uv)
        normals = addon("bridge.scene.mesh_arrays").own_normals(found.vertices, found.triangles)
        return replace(found, normals=normals.repeat(3, axis=1))

    monkeypatch.setattr(module, "read_mesh", with_normals)
    theirs = f12(engine_scene)[COMBINED]
    assert np.ptp(own[..., :3]) > 0.05 and np.array_equal(own, theirs)
