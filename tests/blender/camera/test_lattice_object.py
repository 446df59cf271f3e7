# SPDX-License-Identifier: GPL-3.0-or-later
"""Lattice objects as volumes: equal to Blender's Lattice modifier, evaluated whatever hides them."""

import itertools

import bpy
import numpy as np
import pytest

KINDS = ("KEY_LINEAR", "KEY_CARDINAL", "KEY_CATMULL_ROM", "KEY_BSPLINE")
# The modifier works in float32, on coordinates up to some ten units here.
MODIFIER = 2e-5
FRAMES = (1, 6, 11)


@pytest.fixture
def camera(bridge):
    made = bpy.data.objects.new("Camera", bpy.data.cameras.new("Camera"))
    bpy.context.scene.collection.objects.link(made)
    bpy.context.scene.camera = made
    bridge.make_flexible(made)
    made.location, made.rotation_euler = (1, -2, 0.5), (0.4, 0.3, 0.2)
    return made


def add_lattice(bridge, camera, shape=(4, 3, 5), seed=1):
    """A camera's lattice, its points moved about."""
    rng = np.random.default_rng(seed)
    axes = [np.linspace(-0.5, 0.5, n) for n in shape]
    rest = np.stack(np.meshgrid(*axes, indexing="ij")[::-1], -1) * (1, 1, -1)
    matrix = np.diag([4.0, 3, 6, 1])
    matrix[:3, 3] = (0.5, 0.25, -5)
    points = rest + rng.normal(0, 0.1, rest.shape)
    return bridge.add_surface(camera, "LATTICE", matrix=matrix, points=points)


def modified(lattice, shares):
    """World places (N, 3) that the Lattice modifier gives to points at shares (N, 3) of the box."""
    bpy.context.view_layer.update()
    rest = np.array([point.co for point in lattice.data.points], float)
    low, high = rest.min(0), rest.max(0)
    matrix = np.array(lattice.matrix_world, float)
    world = (low + shares * (high - low)) @ matrix[:3, :3].T + matrix[:3, 3]
    mesh = bpy.data.meshes.new("Points")
    mesh.from_pydata(world.tolist(), [], [])
    probe = bpy.data.objects.new("Points", mesh)
    bpy.context.scene.collection.objects.link(probe)
    probe.modifiers.new("Lattice", "LATTICE").object = lattice
    vertices = probe.evaluated_get(bpy.context.evaluated_depsgraph_get()).data.vertices
    found = np.array([vertex.co for vertex in vertices], float)
    bpy.data.objects.remove(probe)
    return found


def projected(reading, camera, shares):
    projection = reading.read_projection(camera, bpy.context.evaluated_depsgraph_get(), 1.5)
    u, v, w = np.asarray(shares).T
    return projection.volume.evaluate(u, v, 1 - w).position.T


def fine_shares():
    axis = np.linspace(0, 1, 13)
    return np.stack(np.meshgrid(axis, axis, axis), -1).reshape(-1, 3)


@pytest.mark.parametrize("outside", [False, True])
@pytest.mark.parametrize("kinds", [*((k, k, k) for k in KINDS), *itertools.permutations(KINDS, 3)])
def test_the_volume_is_what_the_modifier_makes(bridge, reading, camera, kinds, outside):
    lattice = add_lattice(bridge, camera)
    for axis, kind in zip("uvw", kinds, strict=True):
        setattr(lattice.data, f"interpolation_type_{axis}", kind)
    lattice.data.use_outside = outside
    shares = fine_shares()
    expected = modified(lattice, shares)
    assert np.abs(projected(reading, camera, shares) - expected).max() < MODIFIER


@pytest.mark.parametrize("shape", [(2, 2, 2), (2, 4, 3), (3, 2, 6)])
def test_any_number_of_points(bridge, reading, camera, shape):
    lattice = add_lattice(bridge, camera, shape)
    data = lattice.data
    assert (data.points_w, data.points_v, data.points_u) == shape
    shares = fine_shares()
    assert np.abs(projected(reading, camera, shares) - modified(lattice, shares)).max() < MODIFIER


def test_a_resized_lattice_of_the_user(bridge, reading, camera):
    """Made with Blender's own operator, resized afterwards, and taken with Use Selected."""
    bpy.ops.object.add(type="LATTICE", location=(0, 0, -3))
    lattice = bpy.context.object
    lattice.scale = (2, 3, -4)
    lattice.data.points_u, lattice.data.points_w = 5, 3
    bpy.context.view_layer.update()
    bridge.attach_surface(camera, lattice)
    assert lattice.scfpf_surface.kind == "LATTICE"
    for point in lattice.data.points:
        point.co_deform[1] += 0.3 * point.co_deform[0] ** 2
    shares = fine_shares()
    assert np.abs(projected(reading, camera, shares) - modified(lattice, shares)).max() < MODIFIER


def animate(lattice):
    """A shape key, a hook and an Object-level key, all from frame 1 to 11."""
    lattice.shape_key_add(name="Basis")
    key = lattice.shape_key_add(name="Key")
    for index, point in enumerate(key.data):
        point.co = np.add(point.co, (0.02 * index, 0, 0.1))
    empty = bpy.data.objects.new("Empty", None)
    bpy.context.scene.collection.objects.link(empty)
    hook = lattice.modifiers.new("Hook", "HOOK")
    hook.object = empty
    hook.vertex_indices_set(range(0, len(lattice.data.points), 3))
    for frame, amount in ((1, 0.0), (11, 1.0)):
        key.value = amount
        key.keyframe_insert("value", frame=frame)
        empty.location = (0, amount, 0)
        empty.keyframe_insert("location", frame=frame)


def hide(lattice, how):
    scene = bpy.context.scene
    collection = bpy.data.collections.new("Hidden")
    scene.collection.children.link(collection)
    for old in lattice.users_collection:
        old.objects.unlink(lattice)
    collection.objects.link(lattice)
    layer = bpy.context.view_layer.layer_collection.children["Hidden"]
    if "render" in how:
        lattice.hide_render = collection.hide_render = True
    if "viewport" in how:
        lattice.hide_viewport = True
    if "eye" in how:
        lattice.hide_set(True)
    if "collection" in how:
        collection.hide_viewport = True
    if "excluded" in how:
        layer.exclude = True


@pytest.mark.parametrize(
    "how", ["shown", "render", "viewport", "eye", "collection", "excluded", "render viewport"]
)
def test_hidden_lattices_follow_the_frame(addon, bridge, reading, camera, how):
    """Shape keys and hooks act at every frame, in the viewport and in a render, whatever hides it."""
    lattice = add_lattice(bridge, camera)
    animate(lattice)
    shares, scene = fine_shares()[::7], bpy.context.scene
    expected = []
    for frame in FRAMES:
        scene.frame_set(frame)
        expected.append(modified(lattice, shares))
    assert np.abs(expected[0] - expected[2]).max() > 0.5
    hide(lattice, how)
    rendered = addon("bridge.scene.render_depsgraph").with_render_depsgraph
    u, v, w = shares.T
    for frame, place in zip(FRAMES, expected, strict=True):
        scene.frame_set(frame)
        assert np.abs(projected(reading, camera, shares) - place).max() < MODIFIER
        seen = rendered(
            scene,
            bpy.context.view_layer,
            lambda graph: reading.read_projection(camera, graph, 1.5).volume.evaluate(u, v, 1 - w).position.T,
        )
        assert np.abs(seen - place).max() < MODIFIER


def test_among_other_surfaces_the_layers_are_control_surfaces(bridge, reading, camera):
    bridge.add_surface(camera, "PLANE", parameters={"width": 4.0, "height": 3.0})
    lattice = add_lattice(bridge, camera, (3, 4, 4))
    for axis in "uvw":
        setattr(lattice.data, f"interpolation_type_{axis}", "KEY_LINEAR")
    camera.scfpf.basis = "POLYLINE"
    bpy.context.view_layer.update()
    volume = reading.read_projection(camera, bpy.context.evaluated_depsgraph_get(), 1.5).volume
    assert len(volume.surfaces) == 4
    shares = fine_shares()
    for layer, w in enumerate((1.0, 0.5, 0.0), 1):
        flat = shares[shares[:, 2] == 0] + (0, 0, w)
        got = volume.surfaces[layer].evaluate(*flat[:, :2].T).position.T
        assert np.abs(got - modified(lattice, flat)).max() < MODIFIER


def test_what_makes_no_volume_is_said(bridge, reading, camera):
    lattice = add_lattice(bridge, camera, (2, 2, 2))

    def refused(match):
        with pytest.raises(reading.UserError, match=match):
            reading.read_projection(camera, bpy.context.evaluated_depsgraph_get(), 1.0)

    lattice.data.points_w = 1
    refused("two or more points along W")
    lattice.data.points_w, lattice.data.points_u = 3, 1
    refused("one point along U")
    lattice.data.points_u = 3
    lattice.vertex_groups.new(name="Some").add([0], 0.5, "REPLACE")
    lattice.data.vertex_group = "Some"
    refused("vertex group")
    lattice.data.vertex_group = ""
    lattice.scfpf_surface.kind = "PLANE"
    bridge.add_surface(camera, "PLANE")
    refused("set its kind to Lattice")


def test_bad_points_leave_nothing_behind(addon, bridge, camera):
    error = addon("projection.user_error").UserError
    before = len(bpy.data.lattices), len(bpy.data.objects)
    for points in (np.zeros((2, 2, 3)), np.full((2, 2, 2, 3), np.inf), np.zeros((1, 2, 2, 3))):
        with pytest.raises(error):
            bridge.add_surface(camera, "LATTICE", points=points)
    with pytest.raises(error, match="no parameter"):
        bridge.add_surface(camera, "LATTICE", parameters={"radius": 1.0})
    assert (len(bpy.data.lattices), len(bpy.data.objects)) == before


def test_from_the_interface_saved_and_removed(addon, reading, tmp_path):
    bpy.ops.scfpf.camera_add(preset="VIEW")
    camera = bpy.context.object
    camera.scfpf.active_surface = 0
    assert bpy.ops.scfpf.surface_add(kind="LATTICE") == {"FINISHED"}
    lattice = camera.scfpf.surfaces[1].object
    graph = bpy.context.evaluated_depsgraph_get()
    volume = reading.read_projection(camera, graph, 1.0).volume
    assert len(volume.surfaces) == 2 + 4
    depth = [
        camera.matrix_world.inverted() @ lattice.matrix_world @ point.co_deform
        for point in lattice.data.points
    ]
    near, far = (camera.scfpf.surfaces[i].object.matrix_local.translation.z for i in (0, 2))
    assert all(far < place.z < near for place in depth)
    drawing = addon("projection.diagrams.diagram")
    lines = drawing.diagram(
        reading.read_projection(camera, graph, 1.0), drawing.DiagramOptions(3, 3, (), True, None)
    )
    assert len(lines["SURFACE"]) and len(lines["PROJECTOR"])
    path = str(tmp_path / "lattice.blend")
    bpy.ops.wm.save_as_mainfile(filepath=path)
    bpy.ops.wm.open_mainfile(filepath=path)
    camera = bpy.context.scene.camera
    again = reading.read_projection(camera, bpy.context.evaluated_depsgraph_get(), 1.0).volume
    at = np.linspace(0, 1, 9)
    assert np.array_equal(again.evaluate(at, at, at).position, volume.evaluate(at, at, at).position)
    camera.scfpf.active_surface = 1
    bpy.ops.scfpf.surface_remove()
    assert not bpy.data.lattices and len(camera.scfpf.surfaces) == 2


def test_alone_on_the_list_it_is_a_volume_at_once(bridge, reading, camera):
    bpy.context.view_layer.objects.active = camera
    assert bpy.ops.scfpf.surface_add(kind="LATTICE") == {"FINISHED"}
    volume = reading.read_projection(camera, bpy.context.evaluated_depsgraph_get(), 1.0).volume
    assert type(volume).__name__ == "LatticeVolume"
    half = np.array([0.5])
    ends = [volume.evaluate(half, half, np.array([t])).position[:, 0] for t in (0.0, 1.0)]
    local = [
        camera.matrix_world.inverted() @ bpy.context.scene.cursor.location.__class__(end) for end in ends
    ]
    assert local[0].z == pytest.approx(-1, abs=1e-5) and local[1].z == pytest.approx(-9, abs=1e-5)


@pytest.mark.parametrize("axis", ["U", "V"])
@pytest.mark.parametrize("kind", KINDS)
def test_mirrored_lattices(bridge, reading, camera, kind, axis):
    lattice = add_lattice(bridge, camera)
    lattice.rotation_euler = (0.3, 0.2, 0.1)
    for letter in "uvw":
        setattr(lattice.data, f"interpolation_type_{letter}", kind)
    shares = fine_shares()
    other = shares.copy()
    other[:, "UV".index(axis)] = 1 - other[:, "UV".index(axis)]
    bpy.context.view_layer.update()
    before = projected(reading, camera, other)
    bpy.context.view_layer.objects.active = camera
    assert bpy.ops.scfpf.volume_mirror(axis=axis) == {"FINISHED"}
    bpy.context.view_layer.update()
    assert np.abs(projected(reading, camera, shares) - before).max() < MODIFIER
    lattice.modifiers.new("Hook", "HOOK")
    with pytest.raises(RuntimeError, match="would not be mirrored"):
        bpy.ops.scfpf.volume_mirror(axis=axis)


def test_insert_refuses_a_lattice(bridge, camera):
    add_lattice(bridge, camera)
    bridge.add_surface(camera, "PLANE")
    bpy.context.view_layer.objects.active = camera
    with pytest.raises(RuntimeError, match="more points along W"):
        bpy.ops.scfpf.surface_insert()


def test_the_picture_through_a_lattice_is_that_of_the_volume_it_replaced():
    for place in ((0, 0, 0), (1.5, 1, 0.5), (-1, 2, 1)):
        bpy.ops.mesh.primitive_uv_sphere_add(location=place, segments=24, ring_count=12)
    bpy.ops.object.light_add(type="SUN", rotation=(0.5, 0.3, 0))
    render = bpy.context.scene.render
    render.resolution_x, render.resolution_y = 96, 54
    assert bpy.ops.scfpf.camera_add(preset="VIEW") == {"FINISHED"}
    pictures = []
    for convert in (None, bpy.ops.scfpf.volume_to_lattice, bpy.ops.scfpf.volume_mirror):
        if convert is not None:
            assert convert() == {"FINISHED"}
        assert bpy.ops.scfpf.render() == {"FINISHED"}
        pixels = np.empty(96 * 54 * 4, np.float32)
        bpy.data.images["SCFPF Render"].pixels.foreach_get(pixels)
        pictures.append(pixels.reshape(54, 96, 4))
    planes, lattice, mirrored = pictures
    assert np.ptp(planes[..., :3]) > 0.2
    # Edges of spheres move by the rounding of the lattice's points.
    assert (np.abs(planes - lattice).max(axis=2) > 0.01).mean() < 0.005
    assert (np.abs(planes[:, ::-1] - mirrored).max(axis=2) > 0.01).mean() < 0.02


def test_framing_and_fitting_move_a_lattice(bridge, reading, camera):
    add_lattice(bridge, camera, (2, 3, 3), seed=4)
    bpy.ops.mesh.primitive_cube_add(location=(5, 5, 5))
    cube = bpy.context.object
    bpy.context.view_layer.objects.active = camera
    before = projected(reading, camera, fine_shares())
    assert bpy.ops.scfpf.volume_frame(zoom=2.0) == {"FINISHED"}
    bpy.context.view_layer.update()
    to_camera = np.linalg.inv(np.array(camera.matrix_world))
    was, now = (
        place @ to_camera[:3, :3].T + to_camera[:3, 3]
        for place in (before, projected(reading, camera, fine_shares()))
    )
    assert np.abs(now - was * (0.5, 0.5, 1)).max() < MODIFIER
    cube.select_set(True)
    assert bpy.ops.scfpf.volume_fit() == {"FINISHED"}
    bpy.context.view_layer.update()
    low, high = (f(projected(reading, camera, fine_shares()), axis=0) for f in (np.min, np.max))
    assert (low < 4).all() and (high > 6).all()
