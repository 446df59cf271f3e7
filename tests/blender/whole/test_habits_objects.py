# SPDX-License-Identifier: GPL-3.0-or-later
"""Common edits of objects, applied to cameras and control surfaces: the volume follows the objects.

Expected positions come from Blender's own evaluated meshes or from closed forms.
"""

import math

import bpy
import numpy as np
import pytest
from bpy_extras.object_utils import world_to_camera_view
from mathutils import Euler, Matrix, Vector

U, V, T = np.random.default_rng(31).random((3, 60))
# Objects are float32; coordinates are about 20.
FLOAT32 = 3e-5


@pytest.fixture
def projection(addon):
    def read(camera):
        bpy.context.view_layer.update()
        depsgraph = bpy.context.evaluated_depsgraph_get()
        return addon("bridge.camera.read_projection").read_projection(camera, depsgraph, 16 / 9)

    return read


@pytest.fixture
def shown(projection):
    return lambda camera, t=T: projection(camera).volume.evaluate(U, V, t).position


@pytest.fixture
def add(addon):
    return addon("bridge.camera.flexible_camera").add_surface


@pytest.fixture
def camera(add):
    """A camera off the origin with a plane, a cylinder and a larger plane."""
    bpy.ops.object.camera_add(location=(3, -2, 1), rotation=(1.2, 0.1, 0.4))
    camera = bpy.context.object
    camera.name = "Eye"
    camera.scfpf.enabled = True
    camera.scfpf.edit_volume = True  # or else its surfaces could not be selected
    add(camera, "PLANE", "Near", Matrix.Translation((0, 0, -1)), {"width": 2, "height": 1})
    add(camera, "CYLINDER", "Middle", None, {"radius": 4, "arc": 2.0, "height": 3})
    add(camera, "PLANE", "Far", Matrix.Translation((0, 0, -9)), {"width": 8, "height": 5})
    bpy.context.scene.camera = camera
    bpy.context.view_layer.update()
    return camera


def moved(matrix, positions):
    matrix = np.array(matrix)
    return matrix[:3, :3] @ positions + matrix[:3, 3:]


def evaluated_positions(surface, u, v):
    """The evaluated mesh of a regular grid at (u, v), bilinear between its vertices; (3, N), world."""
    evaluated = surface.evaluated_get(bpy.context.evaluated_depsgraph_get())
    mesh = evaluated.to_mesh()
    co = np.empty(3 * len(mesh.vertices), np.float32)
    mesh.vertices.foreach_get("co", co)
    uv = np.empty(2 * len(mesh.loops), np.float32)
    mesh.uv_layers[0].uv.foreach_get("vector", uv)
    corner = np.empty(len(mesh.loops), np.int32)
    mesh.loops.foreach_get("vertex_index", corner)
    at = np.zeros((len(mesh.vertices), 2))
    at[corner] = uv.reshape(-1, 2)
    columns, rows = (len(np.unique(np.round(at[:, axis], 4))) for axis in (0, 1))
    order = np.lexsort((np.round(at[:, 0], 4), np.round(at[:, 1], 4)))
    points = co.reshape(-1, 3)[order].reshape(rows, columns, 3).astype(float)
    evaluated.to_mesh_clear()
    x, y = u * (columns - 1), v * (rows - 1)
    i, j = np.minimum(x.astype(int), columns - 2), np.minimum(y.astype(int), rows - 2)
    a, b = (x - i)[:, None], (y - j)[:, None]
    low = points[j, i] * (1 - a) + points[j, i + 1] * a
    high = points[j + 1, i] * (1 - a) + points[j + 1, i + 1] * a
    return moved(evaluated.matrix_world, (low * (1 - b) + high * b).T)


# Parents


def test_camera_parented_to_a_moving_empty(camera, shown):
    before, world = shown(camera), camera.matrix_world.copy()
    bpy.ops.object.empty_add(location=(1, 1, 1))
    empty = bpy.context.object
    empty.keyframe_insert("location", frame=1)
    empty.keyframe_insert("rotation_euler", frame=1)
    empty.location, empty.rotation_euler = (6, 0, 2), (0.5, 0, 1.0)
    empty.keyframe_insert("location", frame=11)
    empty.keyframe_insert("rotation_euler", frame=11)
    bpy.context.scene.frame_set(1)
    camera.select_set(True)
    bpy.context.view_layer.objects.active = empty
    assert bpy.ops.object.parent_set(type="OBJECT") == {"FINISHED"}
    bpy.context.view_layer.update()
    assert np.abs(shown(camera) - before).max() < FLOAT32
    start = empty.matrix_world.copy()
    for frame in (6, 11):
        bpy.context.scene.frame_set(frame)
        expected = moved(empty.matrix_world @ start.inverted(), before)
        assert np.abs(shown(camera) - expected).max() < FLOAT32
        assert np.abs(expected - before).max() > 1
    bpy.context.scene.frame_set(1)
    assert np.allclose(camera.matrix_world, world, atol=1e-5)


@pytest.mark.parametrize("keep", [True, False], ids=["parent inverse", "no inverse"])
def test_surface_parented_elsewhere(camera, shown, keep):
    """It stays, or lands in the new parent's space; then it follows that parent, not the camera."""
    far = camera.scfpf.surfaces[2].object
    before, basis = shown(camera, 1), far.matrix_basis.copy()
    bpy.ops.object.empty_add(location=(2, 0, 5), rotation=(0, 0.3, 0.2))
    empty = bpy.context.object
    far.select_set(True)
    camera.select_set(False)
    bpy.context.view_layer.update()
    own = moved(far.matrix_world.inverted(), before)
    if keep:
        # Ctrl-P on an object that has a parent already: the new one replaces it, nothing moves.
        bpy.ops.object.parent_set(type="OBJECT", keep_transform=True)
        assert np.abs(shown(camera, 1) - before).max() < FLOAT32
    else:
        bpy.ops.object.parent_no_inverse_set()
        bpy.context.view_layer.update()
        assert np.abs(shown(camera, 1) - moved(empty.matrix_world, own)).max() < FLOAT32 or (
            np.abs(shown(camera, 1) - moved(empty.matrix_world @ basis, own)).max() < FLOAT32
        )
    placed = shown(camera, 1)
    camera.location.x += 7
    assert np.abs(shown(camera, 1) - placed).max() < FLOAT32
    old = empty.matrix_world.copy()
    empty.location.y += 3
    bpy.context.view_layer.update()
    assert np.abs(shown(camera, 1) - moved(empty.matrix_world @ old.inverted(), placed)).max() < FLOAT32


def test_clear_parent_keeps_the_surface_where_it_is(camera, shown):
    before = shown(camera)
    for slot in camera.scfpf.surfaces:
        slot.object.select_set(True)
    camera.select_set(False)
    bpy.ops.object.parent_clear(type="CLEAR_KEEP_TRANSFORM")
    assert np.abs(shown(camera) - before).max() < FLOAT32
    camera.location.x += 5
    assert np.abs(shown(camera) - before).max() < FLOAT32


# Transforms


def test_delta_transforms(camera, shown):
    """On the camera they move the volume, on a surface the surface: Blender's own matrices say whereto."""
    before, world = shown(camera), camera.matrix_world.copy()
    camera.delta_location, camera.delta_rotation_euler = (1, 2, 3), (0.1, 0.2, 0.3)
    bpy.context.view_layer.update()
    expected = moved(camera.matrix_world @ world.inverted(), before)
    assert np.abs(shown(camera) - expected).max() < FLOAT32 and np.abs(expected - before).max() > 1
    far = camera.scfpf.surfaces[2].object
    before = shown(camera, 1)
    far.delta_scale = 2, 1, 1
    far.delta_location = 0, 0, -1
    axes = np.array(camera.matrix_world.to_3x3())
    across = 8 * (U - 0.5)
    assert np.abs(shown(camera, 1) - before - axes @ np.stack([across, 0 * U, -1 + 0 * U])).max() < FLOAT32
    far.select_set(True)
    bpy.ops.object.transforms_to_deltas(mode="ALL")
    after = shown(camera, 1)
    assert np.abs(after - before - axes @ np.stack([across, 0 * U, -1 + 0 * U])).max() < FLOAT32


@pytest.mark.parametrize("scale", [(2, 3, 0.5), (-1, 1, 1), (1, -2, 1), (-1, -1, -1)])
def test_scale_of_a_surface(camera, shown, scale):
    far = camera.scfpf.surfaces[2].object
    far.scale = scale
    bpy.context.view_layer.update()
    own = np.stack([8 * (U - 0.5), 5 * (V - 0.5), 0 * U])
    assert np.abs(shown(camera, 1) - moved(far.matrix_world, own)).max() < FLOAT32


@pytest.mark.parametrize("scale", [(2, 3, 0.5), (-1, 1, 1), (1, 1, -1), (-2, -2, -2)])
def test_scale_of_the_camera(camera, shown, scale):
    """The children's world scales along: so does the volume, unevenly and mirrored too."""
    before, world = shown(camera), camera.matrix_world.copy()
    camera.scale = scale
    bpy.context.view_layer.update()
    expected = moved(camera.matrix_world @ world.inverted(), before)
    assert np.abs(shown(camera) - expected).max() < FLOAT32 * 10


def test_mirrored_camera_shows_a_mirrored_picture_as_blenders_own_does(addon, projection):
    """Blender's own view of a camera scaled by -1 is mirrored; so is the volume, without a fold."""
    bpy.ops.object.camera_add(location=(3, -2, 1), rotation=(1.2, 0.1, 0.4))
    camera = bpy.context.object
    bpy.context.scene.camera = camera
    camera.data.clip_start, camera.data.clip_end = 0.5, 8
    bpy.ops.scfpf.camera_from_camera()
    folds = addon("projection.volume.folds").find_folds
    assert not folds(projection(camera)).mirrored
    for scale in ((-1, 1, 1), (1, -1, 1), (-1, -1, 1)):
        camera.scale = scale
        made = projection(camera)
        for u, v, t in zip(U[:9], V[:9], T[:9], strict=True):
            point = made.volume.evaluate(*(np.full(1, one) for one in (u, v, t))).position[:, 0]
            seen = world_to_camera_view(bpy.context.scene, camera, Vector(point))
            assert (seen.x, seen.y) == pytest.approx((u, v), abs=1e-5)
        found = folds(made)
        assert not found and found.mirrored == (np.prod(scale) < 0)


def test_apply_scale_of_a_mesh_surface(camera, add, shown):
    grid = add(camera, "GRID", "Grid", Matrix.Translation((0, 0, -12)))
    grid.scale = 3, -2, 1
    before = shown(camera)
    for obj in bpy.context.selected_objects:
        obj.select_set(False)
    grid.select_set(True)
    bpy.context.view_layer.objects.active = grid
    bpy.ops.object.transform_apply(location=True, rotation=True, scale=True)
    assert tuple(grid.scale) == (1, 1, 1)
    assert np.abs(shown(camera) - before).max() < FLOAT32


def test_apply_scale_of_a_parametric_surface(camera, shown):
    """Its own mesh is empty, so that Blender's Apply changes what is seen; undo mends it. Ours keeps it."""
    far = camera.scfpf.surfaces[2].object
    far.scale = 2, 2, 2
    for obj in bpy.context.selected_objects:
        obj.select_set(False)
    far.select_set(True)
    bpy.context.view_layer.objects.active = far
    with bpy.context.temp_override(window=bpy.context.window_manager.windows[0]):
        bpy.ops.ed.undo_push(message="scaled")
        before = shown(camera)
        bpy.ops.object.transform_apply(location=False, rotation=False, scale=True)
        bpy.ops.ed.undo_push(message="applied")
        drawn = evaluated_positions(bpy.data.objects["Far"], U, V)
        assert np.abs(shown(bpy.data.objects["Eye"], 1) - drawn).max() < FLOAT32
        bpy.ops.ed.undo()
        assert np.abs(shown(bpy.data.objects["Eye"]) - before).max() == 0


@pytest.mark.parametrize("length", [0.01, 100.0])
def test_scene_unit_scale_changes_no_picture(camera, shown, length):
    """Lengths are Blender units; the unit scale changes how they are written."""
    before = shown(camera)
    bpy.context.scene.unit_settings.scale_length = length
    assert np.abs(shown(camera) - before).max() == 0
    bpy.ops.scfpf.preset_apply(preset="perspective", fit=False)
    small = shown(camera)
    bpy.context.scene.unit_settings.scale_length = 1
    bpy.ops.scfpf.preset_apply(preset="perspective", fit=False)
    assert np.abs(shown(camera) - small).max() == 0


def test_the_3d_cursor_moves_nothing(camera, shown):
    """New cameras and surfaces go where the view or the volume is."""
    camera.scfpf.active_surface = 0
    bpy.ops.scfpf.surface_add(kind="PLANE")
    before = shown(camera)
    bpy.ops.scfpf.surface_remove()
    bpy.context.scene.cursor.location = 50, 60, 70
    bpy.context.scene.cursor.rotation_euler = 1, 2, 3
    camera.scfpf.active_surface = 0
    bpy.ops.scfpf.surface_add(kind="PLANE")
    assert np.abs(shown(camera) - before).max() < FLOAT32


def test_names(camera, shown):
    before = shown(camera)
    camera.name, camera.data.name = "Fern", "Fern"
    for slot in camera.scfpf.surfaces:
        slot.object.name = "Fläche äöü 漢"
        slot.object.data.name = "x" * 60
    assert np.abs(shown(camera) - before).max() == 0
    bpy.ops.mesh.primitive_cube_add(size=20)
    bpy.context.scene.render.resolution_x = bpy.context.scene.render.resolution_y = 8
    assert bpy.ops.scfpf.render(camera="Fern") == {"FINISHED"}
    assert bpy.ops.scfpf.volume_swap() == {"FINISHED"}


# Constraints, drivers, keyframes, shape keys, modifiers


def test_constraints_on_surfaces(camera, shown):
    bpy.ops.object.empty_add(location=(4, 5, 6))
    target = bpy.context.object
    far = camera.scfpf.surfaces[2].object
    own = np.stack([8 * (U - 0.5), 5 * (V - 0.5), 0 * U])
    copy = far.constraints.new("COPY_LOCATION")
    copy.target = target
    axes = np.array(camera.matrix_world.to_3x3())
    assert np.abs(shown(camera, 1) - (axes @ own + [[4], [5], [6]])).max() < FLOAT32
    target.location.x = 9
    assert np.abs(shown(camera, 1) - (axes @ own + [[9], [5], [6]])).max() < FLOAT32
    far.constraints.remove(copy)
    track = far.constraints.new("TRACK_TO")
    track.target, track.track_axis, track.up_axis = target, "TRACK_Z", "UP_Y"
    centre = shown(camera, 1).mean(1)
    bpy.context.view_layer.update()
    placed = np.array(far.evaluated_get(bpy.context.evaluated_depsgraph_get()).matrix_world)
    towards = np.array(target.location) - placed[:3, 3]
    assert np.allclose(placed[:3, 2], towards / np.linalg.norm(towards), atol=1e-5)
    corners = moved(placed, own)
    assert np.abs(shown(camera, 1) - corners).max() < FLOAT32 and np.isfinite(centre).all()
    far.constraints.remove(track)
    before = shown(camera, 1)
    child = far.constraints.new("CHILD_OF")
    child.target = target
    child.inverse_matrix = target.matrix_world.inverted()
    assert np.abs(shown(camera, 1) - before).max() < FLOAT32
    old = target.matrix_world.copy()
    target.rotation_euler.z = 0.5
    bpy.context.view_layer.update()
    assert np.abs(shown(camera, 1) - moved(target.matrix_world @ old.inverted(), before)).max() < FLOAT32


@pytest.mark.parametrize("hidden", [False, True])
def test_keyframes_and_drivers_of_parameters(addon, camera, projection, hidden):
    nodes = addon("bridge.surfaces.surface_object")
    middle = camera.scfpf.surfaces[1].object
    owners = {label: (owner, name) for label, owner, name in nodes.parameter_properties(middle)}
    owner, name = owners["Radius"]
    for frame, radius in ((1, 4.0), (11, 8.0)):
        nodes.set_surface_parameters(middle, {"radius": radius})
        owner.keyframe_insert(name, frame=frame)
    owner, name = owners["Arc"]
    driver = owner.driver_add(name).driver
    variable = driver.variables.new()
    variable.name = "x"
    variable.type = "TRANSFORMS"
    variable.targets[0].id = camera
    variable.targets[0].transform_type = "LOC_X"
    driver.expression = "x * 0.1 + 1"
    middle.hide_viewport = middle.hide_render = hidden
    for frame in (1, 6, 11):
        bpy.context.scene.frame_set(frame)
        surface = projection(camera).volume.surfaces[1]
        share = (frame - 1) / 10
        eased = 3 * share**2 - 2 * share**3  # Blender's Bézier key frames with flat handles, at a half exact
        assert surface.radius == pytest.approx(4 + 4 * eased, abs=1e-4)
        assert surface.arc == pytest.approx(1.3, abs=1e-6)
    camera.location.x = 8
    assert projection(camera).volume.surfaces[1].arc == pytest.approx(1.8, abs=1e-6)


def test_shape_keys_on_a_uv_mesh(camera, shown):
    bpy.ops.mesh.primitive_ico_sphere_add(subdivisions=2, radius=2, location=(0, 0, -6))
    ball = bpy.context.object
    camera.select_set(True)
    bpy.context.view_layer.objects.active = camera
    assert bpy.ops.scfpf.surface_attach() == {"FINISHED"}
    assert ball.scfpf_surface.kind == "UV_MESH"
    ball.shape_key_add(name="Basis")
    key = ball.shape_key_add(name="Shifted")
    for point in key.data:
        point.co.x += 3
    key.value = 0
    key.keyframe_insert("value", frame=1)
    key.value = 1
    key.keyframe_insert("value", frame=11)
    # Positions at the UVs of the first face's middle: holes of the map have none.
    mesh = ball.data
    uv = mesh.uv_layers.active.uv
    middles = [np.mean([uv[i].vector for i in face.loop_indices], axis=0) for face in mesh.polygons[:20]]
    bodies = np.array(
        [np.mean([mesh.vertices[i].co for i in face.vertices], axis=0) for face in mesh.polygons[:20]]
    )
    u, v = np.array(middles, float).T
    bpy.context.scene.frame_set(1)
    first = shown_at(camera, shown, u, v)
    assert np.abs(first - (bodies + np.array([0, 0, -6])).T).max() < 1e-4
    for frame, shift in ((6, 1.5), (11, 3)):
        bpy.context.scene.frame_set(frame)
        assert np.allclose(shown_at(camera, shown, u, v) - first, [[shift], [0], [0]], atol=1e-4)


def shown_at(camera, shown, u, v):
    global U, V
    keep, (U, V) = (U, V), (u, v)
    try:
        return shown(camera, 1)
    finally:
        U, V = keep


MODIFIERS = {
    "Bend": ("SIMPLE_DEFORM", {"deform_method": "BEND", "deform_axis": "Z", "angle": 1.0}, "angle", 2.0),
    "Wave": ("WAVE", {"height": 0.5, "width": 1.0, "narrowness": 1.5, "speed": 0.1}, None, None),
    "Subdivide and bend": ("SUBSURF", {"levels": 1, "subdivision_type": "SIMPLE"}, None, None),
}


@pytest.mark.parametrize("hidden", [False, True])
@pytest.mark.parametrize("kind", ["PLANE", "CYLINDER"])
@pytest.mark.parametrize("which", MODIFIERS)
def test_further_modifiers_reshape_the_volume(camera, add, shown, which, kind, hidden):
    """At frames 1, 6 and 11 the far surface is what Blender's modifier stack makes of it."""
    parameters = {"width": 8, "height": 5} if kind == "PLANE" else {"radius": 9, "arc": 2, "height": 5}
    last = add(camera, kind, "Last", Matrix.Translation((0, 0, -12)), parameters)
    plain = shown(camera, 1)
    of_type, settings, animated, end = MODIFIERS[which]
    modifier = last.modifiers.new(which, of_type)
    for key, value in settings.items():
        setattr(modifier, key, value)
    if animated:
        modifier.keyframe_insert(animated, frame=1)
        setattr(modifier, animated, end)
        modifier.keyframe_insert(animated, frame=11)
    last.hide_viewport = hidden
    seen = []
    for frame in (1, 6, 11):
        bpy.context.scene.frame_set(frame)
        seen.append(shown(camera, 1))
        assert np.abs(seen[-1] - evaluated_positions(last, U, V)).max() < FLOAT32 * 3
    if which == "Subdivide and bend":
        # More faces on flat facets: a cylinder's chords are off by r(1-cos(arc/64)).
        sagitta = 9 * (1 - math.cos(2 / 64)) if kind == "CYLINDER" else 0
        assert np.abs(seen[0] - plain).max() < sagitta + FLOAT32
    else:
        assert np.abs(seen[0] - seen[2]).max() > 0.05
        assert np.abs(seen[0] - plain).max() > 0.05 or np.abs(seen[1] - plain).max() > 0.05


def test_hook_moves_a_corner_of_a_patch(camera, add, shown):
    patch = add(camera, "PATCH", "Patch", Matrix.Translation((0, 0, -12)))
    before = shown(camera, 1)
    bpy.ops.object.empty_add(location=(0, 0, 0))
    empty = bpy.context.object
    hook = patch.modifiers.new("Hook", "HOOK")
    hook.object = empty
    bpy.context.view_layer.update()
    hook.matrix_inverse = empty.matrix_world.inverted() @ patch.matrix_world
    corner = min(patch.data.vertices, key=lambda vertex: vertex.co.x + vertex.co.y)
    hook.vertex_indices_set([corner.index])
    assert np.abs(shown(camera, 1) - before).max() < FLOAT32
    empty.location = 1, 2, 3
    assert (
        np.abs(shown(camera, 1) - before - np.array([[1], [2], [3]]) * (1 - U) * (1 - V)).max() < FLOAT32 * 3
    )


def test_camera_with_a_rotation_mode_of_its_own(camera, shown):
    before = shown(camera)
    turn = Euler((0.3, 0.4, 0.5)).to_quaternion()
    world = camera.matrix_world.copy()
    camera.rotation_mode = "QUATERNION"
    camera.rotation_quaternion = turn
    bpy.context.view_layer.update()
    assert np.abs(shown(camera) - moved(camera.matrix_world @ world.inverted(), before)).max() < FLOAT32
