# SPDX-License-Identifier: GPL-3.0-or-later
"""Meshes as evaluated, read as UV meshes: animated in every way, with modifiers; errors named."""

import bmesh
import bpy
import numpy as np
import pytest
from mathutils import Matrix

FRAMES = (1, 6, 11)
# Blender's vertices and UVs are float32; lengths here are below 20.
FLOAT32 = 1e-5


@pytest.fixture
def camera(bridge):
    made = bpy.data.objects.new("Camera", bpy.data.cameras.new("Camera"))
    bpy.context.scene.collection.objects.link(made)
    bpy.context.scene.camera = made
    bridge.make_flexible(made)
    bridge.add_surface(made, "PLANE", "Near", Matrix.Translation((0, 0, -1)))
    return made


def linked(mesh, name="Sheet"):
    obj = bpy.data.objects.new(name, mesh)
    bpy.context.scene.collection.objects.link(obj)
    return obj


def sheet(across=3, up=2, hole=None):
    """A flat mesh of quadrilaterals, (u, v) = (x, y) of the unit square; no regular grid: faces are shuffled,
    one vertex is moved in UV and in space alike. hole: a face to leave out."""
    random = np.random.default_rng(3)
    x, y = np.meshgrid(np.linspace(0, 1, across + 1), np.linspace(0, 1, up + 1))
    places = np.stack([x.ravel(), y.ravel(), 0 * x.ravel()], 1)
    places[across + 2] += (0.1, 0.08, 0)
    first = (np.arange(up)[:, None] * (across + 1) + np.arange(across)).ravel()
    faces = np.stack([first, first + 1, first + across + 2, first + across + 1], 1)
    faces = np.delete(faces, [] if hole is None else [hole], axis=0)
    random.shuffle(faces)
    mesh = bpy.data.meshes.new("Sheet")
    mesh.from_pydata(places.tolist(), [], faces.tolist())
    layer = mesh.uv_layers.new(name="Mine")
    layer.uv.foreach_set("vector", places[faces.ravel(), :2].astype(np.float32).ravel())
    return linked(mesh)


def far_surface(reading, camera):
    return reading.read_projection(camera, bpy.context.evaluated_depsgraph_get(), 1.0).volume.surfaces[-1]


def corners_of(obj):
    """Position (3, C) and UV (2, C) at every corner of the evaluated mesh, in world space."""
    evaluated = obj.evaluated_get(bpy.context.evaluated_depsgraph_get())
    mesh = evaluated.to_mesh()
    layer = next(layer for layer in mesh.uv_layers if layer.name == "Mine")
    positions = [evaluated.matrix_world @ mesh.vertices[loop.vertex_index].co for loop in mesh.loops]
    uv = [tuple(corner.vector) for corner in layer.uv]
    evaluated.to_mesh_clear()
    return np.array(positions).T, np.array(uv).T


def test_a_sheet_answers_where_its_uv_map_has_it(bridge, reading, camera):
    obj = sheet()
    bridge.attach_surface(camera, obj)
    assert obj.scfpf_surface.kind == "UV_MESH"
    surface = far_surface(reading, camera)
    assert type(surface).__name__ == "UVMesh" and surface.points.dtype == np.float64
    u, v = np.random.default_rng(1).random((2, 100))
    sample = surface.evaluate(u, v)
    assert sample.valid.all() and not sample.tile.any()
    assert np.abs(sample.position - np.stack([u, v, 0 * u])).max() < FLOAT32
    assert np.abs(sample.du.T - (1, 0, 0)).max() < FLOAT32
    assert np.abs(sample.dv.T - (0, 1, 0)).max() < FLOAT32


def test_a_hole_in_the_mesh_is_a_hole_in_the_surface(bridge, reading, camera):
    bridge.attach_surface(camera, sheet(hole=5))  # the last cell: x above 2/3, y above 1/2
    surface = far_surface(reading, camera)
    assert surface.evaluate([0.8, 0.5, 0.8], [0.8, 0.8, 0.3]).valid.tolist() == [False, True, True]


@pytest.mark.parametrize("kind", ["PATCH", "GRID", "UV_MESH"])
def test_attach_chooses_the_kind_by_the_uv_map(bridge, reading, camera, kind):
    if kind == "UV_MESH":
        bpy.ops.mesh.primitive_cone_add(vertices=8)
    else:
        bpy.ops.mesh.primitive_grid_add(x_subdivisions=1, y_subdivisions=1 if kind == "PATCH" else 2)
    obj = bpy.context.object
    bridge.attach_surface(camera, obj)
    assert obj.scfpf_surface.kind == kind
    assert far_surface(reading, camera).evaluate([0.3], [0.3]).valid.all()


def test_four_vertices_unwrapped_at_will_are_a_uv_mesh(bridge, reading, camera):
    bpy.ops.mesh.primitive_plane_add()
    obj = bpy.context.object
    for corner in obj.data.uv_layers[0].uv:
        corner.vector = 0.25 + 0.5 * corner.vector.x, 0.25 + 0.5 * corner.vector.y
    bridge.attach_surface(camera, obj)
    assert obj.scfpf_surface.kind == "UV_MESH"
    assert far_surface(reading, camera).evaluate([0.1, 0.5], [0.5, 0.5]).valid.tolist() == [False, True]


def test_attach_in_edit_mode_sees_the_edits(bridge, reading, camera):
    obj = sheet()
    bpy.context.view_layer.objects.active = obj
    bpy.ops.object.mode_set(mode="EDIT")
    try:
        bridge.attach_surface(camera, obj)
        assert obj.scfpf_surface.kind == "UV_MESH"
        edited = bmesh.from_edit_mesh(obj.data)
        for vertex in edited.verts:
            vertex.co.z = 4
        bmesh.update_edit_mesh(obj.data)
        assert far_surface(reading, camera).evaluate([0.3], [0.6]).position[2] == 4
    finally:
        bpy.ops.object.mode_set(mode="OBJECT")


def test_the_map_that_renders_counts(bridge, reading, camera):
    obj = sheet()
    other = obj.data.uv_layers.new(name="Other")
    for corner in other.uv:
        corner.vector *= 0.5
    bridge.attach_surface(camera, obj)
    assert far_surface(reading, camera).evaluate([0.9], [0.9]).valid.all()
    other.active_render = True
    obj.data.update_tag()
    assert far_surface(reading, camera).evaluate([0.4, 0.9], [0.4, 0.9]).valid.tolist() == [True, False]


def key(owner, path, values):
    for frame, value in zip(FRAMES, values, strict=True):
        setattr(owner, path, value)
        owner.keyframe_insert(path, frame=frame)


def by_shape_key(obj):
    obj.shape_key_add(name="Basis")
    up = obj.shape_key_add(name="Up")
    for number, vertex in enumerate(up.data):
        vertex.co.z += number / 5
    key(up, "value", [0.0, 0.5, 1.0])


def by_hook(obj):
    hook = linked(None, "Hook")
    modifier = obj.modifiers.new("Hook", "HOOK")
    modifier.object = hook
    modifier.vertex_indices_set([0, 3, 7])
    key(hook, "location", [(0, 0, 0), (0, 1, 2), (3, 0, 1)])


def by_wave(obj):
    wave = obj.modifiers.new("Wave", "WAVE")
    wave.height, wave.width, wave.narrowness, wave.time_offset = 0.5, 1.0, 2.0, -5.0


def by_armature(obj):
    rig = linked(bpy.data.armatures.new("Rig"), "Rig")
    bpy.context.view_layer.objects.active = rig
    bpy.ops.object.mode_set(mode="EDIT")
    bone = rig.data.edit_bones.new("Bone")
    bone.head, bone.tail = (0, 0, 0), (0, 0, 1)
    bpy.ops.object.mode_set(mode="OBJECT")
    obj.vertex_groups.new(name="Bone").add([2, 3, 6, 7], 1.0, "REPLACE")
    obj.modifiers.new("Armature", "ARMATURE").object = rig
    pose = rig.pose.bones["Bone"]
    pose.rotation_mode = "XYZ"
    key(pose, "rotation_euler", [(0, 0, 0), (0.5, 0, 0), (1, 0.5, 0)])


def by_itself(obj):
    key(obj, "location", [(0, 0, 0), (1, 2, 3), (4, 5, 6)])


@pytest.mark.parametrize("hidden", [False, True], ids=["shown", "hidden"])
@pytest.mark.parametrize("animated", [by_shape_key, by_hook, by_wave, by_armature, by_itself])
def test_every_frame_is_read_as_evaluated(bridge, reading, camera, animated, hidden):
    obj = sheet(4, 3)
    animated(obj)
    bridge.attach_surface(camera, obj)
    assert obj.scfpf_surface.kind == "UV_MESH"
    seen = {}
    for frame in FRAMES:
        obj.hide_viewport = False
        bpy.context.scene.frame_set(frame)
        positions, uv = corners_of(obj)
        obj.hide_viewport = hidden
        bpy.context.scene.frame_set(frame)
        sample = far_surface(reading, camera).evaluate(*uv)
        assert sample.valid.all()
        assert np.abs(sample.position - positions).max() < FLOAT32
        seen[frame] = positions
    assert np.abs(seen[6] - seen[1]).max() > 0.1 and np.abs(seen[11] - seen[6]).max() > 0.1


def test_a_modifier_that_adds_geometry_makes_a_parametric_surface_a_uv_mesh(bridge, reading, camera):
    """Bent, it is a grid; with its faces cut at will, a UV mesh of the same shape; then itself again."""
    plane = bridge.add_surface(camera, "PLANE", "Far", Matrix.Translation((0, 0, -9)), {"width": 4.0})
    exact = far_surface(reading, camera)
    u, v = np.random.default_rng(2).random((2, 50))
    for name, kind in ((None, "Plane"), ("SUBSURF", "Grid"), ("DECIMATE", "UVMesh"), (None, "Plane")):
        modifier = plane.modifiers.new("Further", name) if name else None
        if name == "DECIMATE":
            modifier.decimate_type, modifier.ratio = "COLLAPSE", 0.4
        if name == "SUBSURF":
            modifier.subdivision_type = "SIMPLE"
        surface = far_surface(reading, camera)
        assert type(surface).__name__ == kind
        sample = surface.evaluate(u, v)
        if name == "DECIMATE":
            # Collapsing edges inside of the plane moves UVs a little.
            assert sample.valid.mean() > 0.9 and np.abs(sample.position[2] + 9).max() < FLOAT32
        else:
            assert np.abs(sample.position - exact.evaluate(u, v).position).max() < FLOAT32
        if modifier:
            plane.modifiers.remove(modifier)


def test_a_new_uv_mesh_is_a_flat_sheet(bridge, reading, camera):
    surface = bridge.add_surface(camera, "UV_MESH", matrix=Matrix.Translation((0, 0, -9)))
    assert surface.name == "UV Mesh" and len(surface.data.polygons) == 16
    sample = far_surface(reading, camera).evaluate([0.0, 0.3, 1.0], [0.0, 0.6, 1.0])
    assert np.abs(sample.position - [[-0.5, -0.2, 0.5], [-0.5, 0.1, 0.5], [-9, -9, -9]]).max() < FLOAT32


def test_a_parametric_surface_becomes_a_uv_mesh_of_its_shape(bridge, reading, camera):
    cylinder = bridge.add_surface(camera, "CYLINDER", "Far", None, {"radius": 3.0, "arc": 2.0})
    exact = far_surface(reading, camera)
    cylinder.scfpf_surface.kind = "UV_MESH"
    assert not cylinder.modifiers
    surface = far_surface(reading, camera)
    assert type(surface).__name__ == "UVMesh"
    u, v = (axis.ravel() for axis in np.meshgrid(np.linspace(0, 1, 33), np.linspace(0, 1, 5)))
    sample = surface.evaluate(u, v)
    assert sample.valid.all()
    assert np.abs(sample.position - exact.evaluate(u, v).position).max() < FLOAT32


def no_map(mesh):
    mesh.uv_layers.remove(mesh.uv_layers[0])


def no_faces(mesh):
    mesh.clear_geometry()
    mesh.vertices.add(3)


def elsewhere(mesh):
    for corner in mesh.uv_layers[0].uv:
        corner.vector.x += 1.5


def without_area(mesh):
    for corner in mesh.uv_layers[0].uv:
        corner.vector.x = 0.5


def broken_map(mesh):
    mesh.uv_layers[0].uv[2].vector.x = float("nan")


def broken_vertex(mesh):
    mesh.vertices[0].co.x = float("inf")


@pytest.mark.parametrize(
    ("damage", "message"),
    [
        (no_map, "'Sheet' has no UV map: unwrap it"),
        (no_faces, "'Sheet' has no faces"),
        (elsewhere, "No face of 'Sheet'.*UV square"),
        (without_area, "No face of 'Sheet'.*UV square"),
        (broken_map, "UV map of 'Sheet' is not finite"),
        (broken_vertex, "'Sheet' has vertices that are not finite"),
    ],
)
def test_what_cannot_be_read_is_named(bridge, reading, camera, damage, message):
    obj = sheet()
    bridge.attach_surface(camera, obj)
    damage(obj.data)
    obj.data.update()
    with pytest.raises(reading.UserError, match=message):
        far_surface(reading, camera)


def test_maps_without_a_common_place_are_said_and_a_small_one_is_found(bridge, reading, camera):
    """Left and right halves of the square have no projector; a triangle that no sample meets has some."""
    near, far = sheet(), sheet()
    far.location.z = -3.0
    for obj in (near, far):
        bridge.attach_surface(camera, obj)
    while len(camera.scfpf.surfaces) > 2:
        camera.scfpf.surfaces.remove(0)

    def squeeze(obj, scale, start):
        for corner, place in zip(obj.data.uv_layers[0].uv, maps[obj.name], strict=True):
            corner.vector = np.array(place) * scale + start
        obj.data.update()
        bpy.context.view_layer.update()

    maps = {obj.name: [tuple(corner.vector) for corner in obj.data.uv_layers[0].uv] for obj in (near, far)}
    squeeze(near, (0.45, 1.0), (0.0, 0.0))
    squeeze(far, (0.45, 1.0), (0.55, 0.0))
    with pytest.raises(reading.UserError, match="'Camera' has no projector: the UV maps"):
        far_surface(reading, camera)
    squeeze(near, (1.0, 1.0), (0.0, 0.0))
    far_surface(reading, camera)
    squeeze(far, (0.003, 0.003), (0.501, 0.501))
    far_surface(reading, camera)
    camera.scfpf.u_range = 0.6, 0.9
    with pytest.raises(reading.UserError, match="widen the ranges"):
        far_surface(reading, camera)
