# SPDX-License-Identifier: GPL-3.0-or-later
"""The volume's tools as operators: unchanged images, intended changes, undo, errors."""

import bpy
import numpy as np
import pytest
from mathutils import Matrix, Vector

RANDOM = np.random.default_rng(7)
U, V, T = RANDOM.random((3, 300))
# Objects and meshes are float32; the coordinates here are about 100.
FLOAT32 = 3e-5
KINDS = ("PLANE", "PATCH", "DISC", "CYLINDER", "CONE", "SPHERE", "PARABOLOID", "GRID")


@pytest.fixture
def read(addon):
    def read_volume(camera, space="CAMERA"):
        read_projection = addon("bridge.camera.read_projection").read_projection
        volume = read_projection(camera, bpy.context.evaluated_depsgraph_get(), 16 / 9).volume
        if space == "WORLD":
            return volume
        return volume.transformed(np.linalg.inv(np.array(camera.matrix_world, np.float64)))

    return read_volume


def add_cube(location=(0, 0, 0)):
    bpy.ops.mesh.primitive_cube_add(location=location)
    return bpy.context.object


def add_camera(preset="VIEW"):
    assert bpy.ops.scfpf.camera_add(preset=preset) == {"FINISHED"}
    return bpy.context.object


def camera_with(addon, *described):
    """A flexible camera off the origin with the surfaces described: (kind, matrix, parameters, points)."""
    module = addon("bridge.camera.flexible_camera")
    bpy.ops.object.camera_add(location=(3, -2, 1), rotation=(1.2, 0.1, 0.4))
    camera = bpy.context.object
    for kind, matrix, parameters, points in described:
        module.add_surface(camera, kind, matrix=matrix, parameters=parameters, points=points)
    module.make_flexible(camera)
    bpy.context.view_layer.update()
    return camera


def at(x=0.0, y=0.0, z=0.0):
    return np.array(Matrix.Translation((x, y, z)))


def positions(volume, u=U, v=V, t=T):
    return volume.evaluate(u, v, t).position


def assert_same(before, after, tolerance=FLOAT32):
    assert np.abs(before - after).max() <= tolerance * np.abs(before).max()


def surfaces(camera):
    return [slot.object for slot in camera.scfpf.surfaces]


def kinds(camera):
    return [surface.scfpf_surface.kind for surface in surfaces(camera)]


def poll_message(operator):
    with pytest.raises(RuntimeError) as caught:
        operator()
    return str(caught.value)


# Insert, duplicate, swap


@pytest.mark.parametrize(
    ("preset", "kind"),
    [("VIEW", "PLANE"), ("cylindrical_panorama", "CYLINDER"), ("nonlinear_twist", "PLANE")],
)
def test_insert_leaves_the_volume_as_it_is(read, preset, kind):
    add_cube()
    camera = add_camera(preset)
    before, count = positions(read(camera)), len(surfaces(camera))
    near, far = surfaces(camera)[0], surfaces(camera)[-1]
    objects = len(bpy.data.objects)
    for number in (1, 2):
        assert bpy.ops.scfpf.surface_insert() == {"FINISHED"}
        assert len(surfaces(camera)) == count + number == len(set(surfaces(camera)))
        assert surfaces(camera)[0] == near and surfaces(camera)[-1] == far
        assert kinds(camera)[1] == kind
        assert len(bpy.data.objects) == objects + number, "old inner surfaces are left over"
        assert_same(before, positions(read(camera)))


def test_insert_between_kinds_is_a_grid_of_the_resolution(addon, read):
    sizes = {"radius": 20.0, "arc": 2.0, "height": 9.0}
    camera = camera_with(addon, ("PLANE", at(z=-1), {}, None), ("CYLINDER", at(), sizes, None))
    before = positions(read(camera))
    bpy.ops.scfpf.surface_insert(resolution=128)
    assert kinds(camera) == ["PLANE", "GRID", "CYLINDER"]
    # A chord of 1/128 of the arc of 2 is off by r·(2/128)²/8, halved by the blend, halved by the basis.
    assert_same(before, positions(read(camera)), 1e-5 + (2 / 128) ** 2 / 8)


def test_insert_into_a_polyline_leaves_each_projector_where_it_is(addon, read):
    camera = camera_with(addon, *(("PLANE", at(x=x, z=-z), {}, None) for x, z in ((0, 1), (2, 5), (0, 9))))
    camera.scfpf.basis = "POLYLINE"
    camera.scfpf.active_surface = 1
    before = read(camera)
    bpy.ops.scfpf.surface_insert()
    after = read(camera)
    assert len(surfaces(camera)) == 4 and kinds(camera)[2] == "PLANE"
    # Two pieces of three thirds are now three: t ≤ ½ is t ≤ ⅓, and the second half is two thirds.
    t = np.where(T < 0.5, T * 2 / 3, 1 / 3 + (T - 0.5) * 4 / 3)
    assert_same(positions(before), positions(after, t=t))


def test_a_failed_insert_leaves_nothing_behind(addon, monkeypatch):
    camera = camera_with(addon, *(("PLANE", at(z=-z), {}, None) for z in (1, 3, 9)))
    edits = addon("bridge.camera.volume_edits")
    before, objects, add = surfaces(camera), len(bpy.data.objects), edits.add_surface

    def second_fails(camera, kind, index, **given):
        if index == 2:
            raise addon("projection.user_error").UserError("no")
        return add(camera, kind, index=index, **given)

    monkeypatch.setattr(edits, "add_surface", second_fails)
    with pytest.raises(RuntimeError, match="no"):
        bpy.ops.scfpf.surface_insert()
    assert surfaces(camera) == before and len(bpy.data.objects) == objects


def test_duplicate_is_a_surface_of_its_own_at_the_same_place(addon, read):
    camera = camera_with(addon, ("DISC", at(z=-1), {}, None), ("GRID", at(z=-3), None, None))
    bpy.ops.scfpf.surface_duplicate()
    assert kinds(camera) == ["DISC", "GRID", "GRID"] and camera.scfpf.active_surface == 2
    first, second = surfaces(camera)[1:]
    assert first != second and first.data != second.data and second.parent == camera
    volume = read(camera)
    assert np.array_equal(
        volume.surfaces[1].evaluate(U, V).position, volume.surfaces[2].evaluate(U, V).position
    )
    second.location.x += 2
    assert surfaces(camera)[1].location.x == 0


def test_swap_reverses_the_projectors(read):
    camera = add_camera("nonlinear_twist")
    before, order = read(camera), surfaces(camera)
    camera.scfpf.active_surface = 2
    bpy.ops.scfpf.volume_swap()
    assert surfaces(camera) == order[::-1] and camera.scfpf.active_surface == 0
    assert_same(positions(before), positions(read(camera), t=1 - T))


# Mirror


@pytest.mark.parametrize("axis", "UV")
@pytest.mark.parametrize("kind", KINDS)
def test_mirrored_volume_answers_at_the_mirrored_parameter(addon, read, kind, axis):
    points = RANDOM.normal(size=(4, 3, 3)) if kind == "GRID" else None
    camera = camera_with(addon, ("POINT", at(y=0.3), {}, None), (kind, at(1, 2, -5), None, points))
    surface = surfaces(camera)[1]
    surface.rotation_euler = 0.3, 0.5, -0.2
    before = read(camera)
    if axis == "V" and kind in {"DISC", "PARABOLOID"}:
        with pytest.raises(RuntimeError, match="convert it to a grid first"):
            bpy.ops.scfpf.volume_mirror(axis=axis)
        camera.scfpf.active_surface = 1
        bpy.ops.scfpf.surface_to_grid()
        before = read(camera)
    bpy.ops.scfpf.volume_mirror(axis=axis)
    mirrored = (1 - U, V) if axis == "U" else (U, 1 - V)
    after = read(camera)
    assert_same(positions(before), positions(after, *mirrored))
    determinant = addon("projection.volume.viewing_volume").determinant
    signs = [np.sign(determinant(v.evaluate(*uv, T))) for v, uv in ((before, (U, V)), (after, mirrored))]
    assert np.array_equal(signs[0], -signs[1])


def test_mirror_of_one_surface_copies_a_shared_mesh(addon, read):
    points = RANDOM.normal(size=(3, 4, 3))
    camera = camera_with(addon, ("GRID", at(z=-1), None, points), ("GRID", at(z=-9), None, points))
    near, far = surfaces(camera)
    far.data = near.data
    before = [one.evaluate(U, V).position for one in read(camera).surfaces]
    camera.scfpf.active_surface = 1
    bpy.ops.scfpf.volume_mirror(axis="U", only_active=True)
    after = read(camera).surfaces
    assert np.array_equal(after[0].evaluate(U, V).position, before[0])
    assert np.allclose(after[1].evaluate(1 - U, V).position, before[1], atol=1e-5)


@pytest.mark.parametrize(("kind", "other"), [("NURBS", "GRID"), ("GRID", "NURBS"), ("GRID", "LATTICE")])
def test_mirror_of_another_kind_than_the_object_is_refused(addon, kind, other):
    camera = camera_with(addon, ("PLANE", at(z=-1), {}, None), (kind, at(z=-9), None, None))
    surfaces(camera)[1].scfpf_surface.kind = other
    with pytest.raises(RuntimeError, match="choose another kind first") as refused:
        bpy.ops.scfpf.volume_mirror()
    assert "Traceback" not in str(refused.value)


def test_what_a_mirror_would_not_reach_is_refused_before_anything_changes(addon):
    camera = camera_with(addon, ("PLANE", at(z=-1), {}, None), ("CYLINDER", at(), {}, None))
    surfaces(camera)[1].modifiers.new("Bend", "SIMPLE_DEFORM")
    with pytest.raises(RuntimeError, match="'Cylinder' has modifiers or animation"):
        bpy.ops.scfpf.volume_mirror()
    surfaces(camera)[1].modifiers.remove(surfaces(camera)[1].modifiers["Bend"])
    surfaces(camera)[1].keyframe_insert("location", frame=1)
    with pytest.raises(RuntimeError, match="'Cylinder' has modifiers or animation"):
        bpy.ops.scfpf.volume_mirror()
    surfaces(camera)[1].animation_data_clear()
    surfaces(camera)[1].scfpf_surface.kind = "DISC"
    surfaces(camera)[1].scale.x = 3
    addon("bridge.surfaces.surface_object").set_surface_parameters(surfaces(camera)[1], {"arc": 2.0})
    with pytest.raises(RuntimeError, match="'Cylinder' is scaled unevenly"):
        bpy.ops.scfpf.volume_mirror()
    assert surfaces(camera)[0].scale.x == 1, "the plane before it was mirrored"


# Place


def viewport():
    window = bpy.context.window_manager.windows[0]
    area = next(area for area in window.screen.areas if area.type == "VIEW_3D")
    region = next(region for region in area.regions if region.type == "WINDOW")
    return bpy.context.temp_override(window=window, area=area, region=region)


@pytest.mark.parametrize("kind", ["PLANE", "CYLINDER", "GRID"])
def test_near_surface_snaps_to_the_view(addon, read, kind):
    camera = camera_with(addon, (kind, at(z=-1), None, None), ("PLANE", at(z=-9), {}, None))
    near = surfaces(camera)[0]
    near.scale = 2, 2, 2
    with viewport():
        view = bpy.context.region_data
        to_view, window = view.view_matrix.copy(), np.array(view.window_matrix)
        depth = -(to_view @ near.matrix_world.translation).z
        bpy.ops.scfpf.surface_snap_to_view()
    bpy.context.view_layer.update()
    placed = to_view @ near.matrix_world
    assert np.allclose(np.array(placed)[:3, :3], 2 * np.eye(3), atol=1e-5)
    if kind == "CYLINDER":
        assert placed.translation.length < 1e-4
        return
    if kind == "GRID":
        assert np.allclose(placed.translation, (0, 0, -depth), atol=1e-4)
        return
    # The plane's right border is the border of the picture's frame in the view.
    right = window @ np.array([*(placed @ Vector((0.5, 0, 0))), 1])
    aspect = 16 / 9
    assert right[0] / right[3] == pytest.approx(min(1, aspect * window[0, 0] / window[1, 1]), abs=1e-4)


def test_snap_needs_a_viewport():
    add_camera()
    assert "3D viewport" in poll_message(bpy.ops.scfpf.surface_snap_to_view)


def test_surface_is_aligned_to_the_active_object(addon):
    camera = camera_with(addon, ("PLANE", at(z=-1), {}, None), ("PLANE", at(z=-9), {}, None))
    bpy.context.scene.camera = camera
    assert "Select the object to align to" in poll_message(bpy.ops.scfpf.surface_align)
    cube = add_cube((4, 5, 6))
    cube.rotation_euler, cube.scale = (0.1, 0.2, 0.3), (7, 7, 7)
    surface = surfaces(camera)[1]
    surface.scale = 1, 2, 3
    bpy.ops.scfpf.surface_align(location=False)
    bpy.context.view_layer.update()
    assert np.allclose(surface.matrix_world.to_quaternion(), cube.matrix_world.to_quaternion(), atol=1e-5)
    assert surface.matrix_world.translation != cube.location
    bpy.ops.scfpf.surface_align()
    bpy.context.view_layer.update()
    assert np.allclose(surface.matrix_world.translation, cube.location, atol=1e-5)
    assert np.allclose(surface.matrix_world.to_scale(), (1, 2, 3), atol=1e-5)


def test_single_user_shares_nothing_and_shows_the_same(addon, read):
    camera = camera_with(addon, ("GRID", at(z=-1), None, None), ("PLANE", at(z=-9), {}, None))
    bpy.ops.object.camera_add(location=(9, 9, 9))
    other = bpy.context.object
    attach = addon("bridge.camera.flexible_camera").attach_surface
    for surface in surfaces(camera):
        attach(other, surface)
    other.scfpf.enabled = True
    surfaces(camera)[0].location.x = 0.5
    before = positions(read(other, "WORLD"))
    assert bpy.ops.scfpf.volume_single_user() == {"FINISHED"}
    assert not set(surfaces(camera)) & set(surfaces(other))
    assert {surface.parent for surface in surfaces(other)} == {other}
    assert all(surface.data.users == 1 for surface in surfaces(camera) + surfaces(other))
    bpy.context.view_layer.update()
    assert_same(before, positions(read(other, "WORLD")))


@pytest.mark.parametrize("kind", ["POINT", *KINDS[:-1]])
def test_a_surface_becomes_a_grid_of_the_same_shape(addon, read, kind):
    camera = camera_with(addon, ("PLANE", at(z=-1), {}, None), (kind, at(1, 2, -5), None, None))
    before = positions(read(camera))
    assert bpy.ops.scfpf.surface_to_grid(columns=128, rows=64) == {"FINISHED"}
    assert kinds(camera)[1] == "GRID"
    exact = kind in {"POINT", "PLANE", "PATCH"}
    # A chord of 1/64 of half a turn, or 1/128 of a turn, is off by r·(π/64)²/8.
    assert_same(before, positions(read(camera)), FLOAT32 if exact else (np.pi / 64) ** 2 / 8)
    assert "grid already" in poll_message(bpy.ops.scfpf.surface_to_grid)


def test_a_converted_surface_keeps_its_further_modifiers(addon, read):
    camera = camera_with(addon, ("PLANE", at(z=-1), {}, None), ("PLANE", at(z=-5), {}, None))
    surface = surfaces(camera)[1]
    surface.modifiers.new("Up", "DISPLACE").strength = 0.5
    before = positions(read(camera))
    bpy.ops.scfpf.surface_to_grid(columns=4, rows=4)
    assert [modifier.name for modifier in surface.modifiers] == ["Up"]
    assert_same(before, positions(read(camera)))


# The whole volume


def test_framing_moves_every_surface_alike(addon, read):
    camera = camera_with(
        addon,
        ("PLANE", at(z=-1), {}, None),
        ("CYLINDER", at(), {"radius": 9.0}, None),
        ("GRID", at(z=-9), None, None),
    )
    surfaces(camera)[1].rotation_euler = 0.5, 0.4, 0.3
    before = read(camera)
    amounts = {"pan": 0.3, "tilt": -0.2, "roll": 0.5, "dolly": 2.0, "zoom": 1.5}
    bpy.ops.scfpf.volume_frame(**amounts)
    bpy.context.view_layer.update()
    matrix = addon("projection.editing.volume_edits").framing(**amounts)
    assert_same(positions(before.transformed(matrix)), positions(read(camera)))
    surfaces(camera)[1].parent = None
    with pytest.raises(RuntimeError, match="'Cylinder' is not a child"):
        bpy.ops.scfpf.volume_frame(pan=0.1)


@pytest.mark.parametrize("preset", ["VIEW", "cylindrical_panorama", "nonlinear_twist", "angular_fisheye"])
def test_fitted_volume_just_holds_the_selection(addon, read, preset):
    camera = add_camera(preset)
    cube = add_cube((40, 10, 3))
    cube.scale = 2, 5, 1
    camera.select_set(True)
    bpy.context.view_layer.objects.active = camera
    direction = camera.matrix_world.to_quaternion()
    assert bpy.ops.scfpf.volume_fit() == {"FINISHED"}
    bpy.context.view_layer.update()
    assert np.allclose(camera.matrix_world.to_quaternion(), direction, atol=1e-6)
    corners = np.array([cube.matrix_world @ Vector(corner) for corner in cube.bound_box]).T
    invert = addon("projection.volume.inverse").invert
    volume, centre = read(camera, "WORLD"), np.array(cube.location)[:, None]
    assert invert(volume, corners).found.all()
    assert not invert(volume, centre + 1.1 * (corners - centre)).found.all(), (
        "the volume is larger than it must be"
    )


def test_a_fitted_volume_has_the_sizes_of_the_world(addon, read):
    """Sizes in the panel are those that Blender draws, whatever the factor was; an animated one keeps its."""
    camera = add_camera("angular_fisheye")
    near, far = (slot.object for slot in camera.scfpf.surfaces)
    far.location = 0, 0.5, 0
    near.keyframe_insert("location", frame=1)
    child = bpy.data.objects.new("Child", None)
    bpy.context.scene.collection.objects.link(child)
    child.parent, child.location = far, (1, 2, 3)
    cube = add_cube((400, 10, 3))
    cube.scale = 20, 50, 10
    camera.select_set(True)
    child_before = far.matrix_world.inverted() @ child.matrix_world
    bpy.context.view_layer.objects.active = camera
    assert bpy.ops.scfpf.volume_fit() == {"FINISHED"}
    bpy.context.view_layer.update()
    scales = addon("bridge.camera.surface_scale")
    drawn = far.evaluated_get(bpy.context.evaluated_depsgraph_get())
    extent = max(drawn.dimensions)
    (label, radius), *_ = scales.world_sizes(far)
    assert label == "Radius" and not scales.is_scaled(far)
    assert 2 * radius == pytest.approx(extent, rel=1e-5) and radius > 60
    assert scales.is_scaled(near)
    assert (far.matrix_world.inverted() @ child.matrix_world).translation.length == pytest.approx(
        child_before.translation.length * scales.whole_scale(near)[0], rel=1e-5
    )


def test_fit_needs_a_selection():
    add_cube()
    camera = add_camera()
    assert bpy.context.selected_objects == [camera]
    assert "Select the objects" in poll_message(bpy.ops.scfpf.volume_fit)


def test_tools_say_what_they_need():
    add_cube()
    operators = (
        bpy.ops.scfpf.surface_insert,
        bpy.ops.scfpf.surface_duplicate,
        bpy.ops.scfpf.volume_swap,
        bpy.ops.scfpf.volume_mirror,
        bpy.ops.scfpf.volume_single_user,
        bpy.ops.scfpf.surface_to_grid,
        bpy.ops.scfpf.volume_frame,
        bpy.ops.scfpf.volume_fit,
    )
    for operator in operators:
        assert "Flexible Camera" in poll_message(operator)
    add_camera()
    while len(bpy.context.object.scfpf.surfaces):
        bpy.ops.scfpf.surface_remove()
    for operator in operators:
        message = poll_message(operator)
        assert "Choose a control surface" in message or "two control surfaces" in message
    for operator in operators:
        assert operator.get_rna_type().description


def test_undo_and_redo_of_every_tool(read):
    def state():
        camera = bpy.context.scene.camera
        counts = len(bpy.data.objects), len(bpy.data.meshes)
        return kinds(camera), counts, positions(read(camera, "WORLD"))

    def same(one, other):
        return one[:2] == other[:2] and np.allclose(one[2], other[2], atol=1e-4)

    add_cube((1, 2, 3))
    steps = (
        lambda: bpy.ops.scfpf.surface_insert("EXEC_DEFAULT", True),
        lambda: bpy.ops.scfpf.surface_duplicate("EXEC_DEFAULT", True),
        lambda: bpy.ops.scfpf.volume_swap("EXEC_DEFAULT", True),
        lambda: bpy.ops.scfpf.volume_mirror("EXEC_DEFAULT", True, axis="U"),
        lambda: bpy.ops.scfpf.surface_align("EXEC_DEFAULT", True),
        lambda: bpy.ops.scfpf.surface_to_grid("EXEC_DEFAULT", True),
        lambda: bpy.ops.scfpf.volume_mirror("EXEC_DEFAULT", True, axis="V"),
        lambda: bpy.ops.scfpf.volume_frame("EXEC_DEFAULT", True, pan=0.3, zoom=2),
        lambda: bpy.ops.scfpf.volume_fit("EXEC_DEFAULT", True),
    )
    cube = bpy.context.object
    add_camera()
    cube.select_set(True)
    bpy.context.view_layer.objects.active = cube
    with bpy.context.temp_override(window=bpy.context.window_manager.windows[0]):
        bpy.ops.ed.undo_push(message="start")
        states = [state()]
        for step in steps:
            assert step() == {"FINISHED"}
            bpy.context.view_layer.update()
            states.append(state())
            assert not same(states[-1], states[-2])
        for before in reversed(states[:-1]):
            bpy.ops.ed.undo()
            assert same(state(), before)
        for after in states[1:]:
            bpy.ops.ed.redo()
            assert same(state(), after)


def test_a_mesh_that_is_no_surface_is_not_converted(addon):
    camera = camera_with(addon, ("PLANE", at(z=-1), {}, None))
    surfaces(camera)[0].scfpf_surface.kind = "NONE"
    with pytest.raises(RuntimeError, match="cannot become"):
        bpy.ops.scfpf.surface_to_grid()
    surfaces(camera)[0].scfpf_surface.kind = "PATCH"
    surfaces(camera)[0].shape_key_add(name="Basis")
    with pytest.raises(RuntimeError, match="shape keys"):
        bpy.ops.scfpf.surface_to_grid()
