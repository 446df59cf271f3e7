# SPDX-License-Identifier: GPL-3.0-or-later
"""SURFACE objects as control surfaces: the patch that is read is the surface that Blender draws."""

import itertools

import bpy
import numpy as np
import pytest
from mathutils import Matrix

# Blender tessellates in float32 over float32 knots; relative to the largest coordinate.
DRAWN = 1e-5
FLAGS = list(itertools.product((False, True), repeat=3))
STEPS_U, STEPS_V = 3, 2


@pytest.fixture
def nodes(addon):
    return addon("bridge.surfaces.surface_object")


@pytest.fixture
def objects(addon):
    return addon("bridge.surfaces.nurbs_object")


@pytest.fixture
def pure(addon):
    return addon("projection.surfaces.nurbs")


@pytest.fixture
def camera():
    made = bpy.data.objects.new("Camera", bpy.data.cameras.new("Camera"))
    bpy.context.scene.collection.objects.link(made)
    bpy.context.scene.camera = made
    return made


def bumpy(rows, columns, seed=1):
    """Points with weights from ½ to 2, as float32 keeps them."""
    rng = np.random.default_rng(seed)
    points = np.concatenate(
        [rng.normal(size=(rows, columns, 3)), rng.uniform(0.5, 2, (rows, columns, 1))], axis=2
    )
    return points.astype(np.float32).astype(float)


def place(surface):
    bpy.context.scene.collection.objects.link(surface)
    spline = surface.data.splines[0]
    spline.resolution_u, spline.resolution_v = STEPS_U, STEPS_V
    return surface


def evaluated(surface):
    surface.data.update_tag()
    return surface.evaluated_get(bpy.context.evaluated_depsgraph_get())


def drawn(surface):
    """Vertices that Blender draws, (V, U, 3); it writes them column by column."""
    now = evaluated(surface)
    spline = now.data.splines[0]
    vertices = np.array([vertex.co for vertex in now.to_mesh().vertices])
    now.to_mesh_clear()
    if len(vertices) == 0:
        return None
    return vertices.reshape(spline.point_count_u * STEPS_U, -1, 3).swapaxes(0, 1)


def at_steps(patch, shape):
    """A surface where Blender has its vertices: even in the knots, without the seam of a cyclic one."""
    (rows, columns), cyclic = shape[:2], (patch.along_u.cyclic, patch.along_v.cyclic)
    u, v = (np.arange(n) / (n - (not c)) for n, c in zip((columns, rows), cyclic, strict=True))
    u, v = (grid.ravel() for grid in np.meshgrid(u, v))
    return patch.evaluate(u, v).position.T.reshape(rows, columns, 3)


def agrees(patch, surface):
    shown = drawn(surface)
    return np.abs(at_steps(patch, shown.shape) - shown).max() < DRAWN * np.abs(shown).max()


@pytest.mark.parametrize("order", range(2, 7))
def test_the_patch_is_what_blender_draws(nodes, objects, order):
    """Every combination of flags along u and some along v; where Blender draws nothing, an error says why."""
    points = bumpy(7, 6)
    surface = place(nodes.new_surface("S", "NURBS", points=points))
    spline = surface.data.splines[0]
    seen = 0
    for flags, other in itertools.product(FLAGS, ((True, False, False), (False, True, True))):
        spline.use_endpoint_u, spline.use_bezier_u, spline.use_cyclic_u = flags
        spline.use_endpoint_v, spline.use_bezier_v, spline.use_cyclic_v = other
        spline.order_u, spline.order_v = order, 3 if other[0] else 2
        if drawn(surface) is None:
            with pytest.raises(nodes.UserError, match="'S' is not a valid surface: along u"):
                objects.read_patch(evaluated(surface), "VIEWPORT")
            continue
        patch = objects.read_patch(evaluated(surface), "VIEWPORT")
        assert np.array_equal(patch.points, points)
        assert agrees(patch, surface)
        seen += 1
    assert seen >= 10


def test_a_high_order_is_read_too(nodes, objects):
    surface = place(nodes.new_surface("S", "NURBS", {"order_u": 9, "order_v": 3}, bumpy(3, 12)))
    assert surface.data.splines[0].order_u == 9
    assert agrees(objects.read_patch(evaluated(surface), "VIEWPORT"), surface)


@pytest.mark.parametrize("shape", [(3, 3), (4, 4), (3, 7), (6, 3)])
def test_blenders_u_is_our_u(nodes, objects, shape):
    points = bumpy(*shape)[..., :3]
    surface = place(nodes.new_surface("S", "NURBS", {"order_u": 3, "order_v": 2}, points))
    spline = surface.data.splines[0]
    assert (surface.type, surface.mode, len(surface.data.splines)) == ("SURFACE", "OBJECT", 1)
    assert (spline.point_count_v, spline.point_count_u) == shape
    assert (spline.order_u, spline.order_v) == (3, 2)
    patch = objects.read_patch(evaluated(surface), "VIEWPORT")
    corners = patch.evaluate([0, 1, 0, 1], [0, 0, 1, 1]).position.T
    assert np.abs(corners - points[[0, 0, -1, -1], [0, -1, 0, -1]]).max() < 1e-6
    assert np.array_equal(nodes.surface_parameters(surface)["points"][..., :3], points)


def test_making_one_leaves_scene_mode_and_selection_alone(addon, nodes):
    mesh = bpy.data.meshes.new("M")
    mesh.from_pydata([(0, 0, 0), (1, 0, 0), (0, 1, 0)], [], [(0, 1, 2)])
    other = bpy.data.objects.new("Other", mesh)
    bpy.context.scene.collection.objects.link(other)
    bpy.context.view_layer.objects.active = other
    other.select_set(True)
    for mode in ("OBJECT", "EDIT"):
        bpy.ops.object.mode_set(mode=mode)
        before = {name: len(getattr(bpy.data, name)) for name in ("scenes", "objects", "curves")}
        surface = nodes.new_surface("S", "NURBS")
        assert (bpy.context.active_object, other.mode, bpy.context.selected_objects) == (other, mode, [other])
        assert not surface.users_collection and surface.data.users == 1
        addon("bridge.volume.volume_object").delete_with_data(surface)
        assert before == {name: len(getattr(bpy.data, name)) for name in before}
    bpy.ops.object.mode_set(mode="OBJECT")


def test_points_and_orders_are_written(nodes):
    surface = place(nodes.new_surface("S", "NURBS"))
    points = bumpy(4, 4)
    nodes.set_surface_parameters(surface, {"points": points, "order_u": 2})
    read = nodes.surface_parameters(evaluated(surface))
    assert np.array_equal(read["points"], points) and (read["order_u"], read["order_v"]) == (2, 4)


@pytest.mark.parametrize(
    ("parameters", "points", "message"),
    [
        ({"radius": 1.0}, None, "no parameter 'radius'"),
        ({"order_u": 5}, None, "order 5 needs at least 5"),
        ({}, np.zeros((2, 4, 3)), "at least 3 × 3"),
        ({}, np.zeros((4, 4)), "at least 3 × 3"),
        ({}, np.zeros((4, 4, 4)), "weights"),
        ({}, np.full((4, 4, 3), np.inf), "numbers up to"),
    ],
)
def test_bad_patches_are_refused_and_leave_nothing(nodes, parameters, points, message):
    with pytest.raises(nodes.UserError, match=message):
        nodes.new_surface("S", "NURBS", parameters, points)
    assert not bpy.data.curves and not bpy.data.objects
    surface = nodes.new_surface("S", "NURBS")
    if parameters or points.ndim == 3:
        with pytest.raises(nodes.UserError):
            nodes.set_surface_parameters(surface, {"points": points} if points is not None else parameters)


def shape_key(surface):
    surface.shape_key_add(name="Basis")
    up = surface.shape_key_add(name="Up")
    for index, point in enumerate(up.data):
        point.co.z += index % 3
    up.value = 0.7


def hook(surface):
    empty = bpy.data.objects.new("Hook", None)
    bpy.context.scene.collection.objects.link(empty)
    modifier = surface.modifiers.new("Hook", "HOOK")
    modifier.object = empty
    modifier.vertex_indices_set([0, 1, 7])
    bpy.context.view_layer.update()
    empty.location = (0.5, -1, 2)


def lattice(surface):
    """A shear, before tessellation: an affine map of the points is one of the surface."""
    cage = bpy.data.objects.new("Cage", bpy.data.lattices.new("Cage"))
    bpy.context.scene.collection.objects.link(cage)
    cage.scale = (9, 9, 9)
    for point in cage.data.points:
        point.co_deform.x += 0.5 * point.co.z
    modifier = surface.modifiers.new("Lattice", "LATTICE")
    modifier.object = cage
    modifier.use_apply_on_spline = True


@pytest.mark.parametrize("act", [shape_key, hook, lattice])
@pytest.mark.parametrize("flags", FLAGS)
def test_shape_keys_hooks_and_spline_modifiers_move_the_points(nodes, objects, pure, act, flags):
    surface = place(nodes.new_surface("S", "NURBS", points=bumpy(5, 6)))
    spline = surface.data.splines[0]
    spline.use_endpoint_u, spline.use_bezier_u, spline.use_cyclic_u = flags
    before = drawn(surface)
    act(surface)
    patch = objects.read_patch(evaluated(surface), "VIEWPORT")
    assert type(patch) is pure.NurbsPatch
    assert np.abs(drawn(surface) - before).max() > 0.1
    assert agrees(patch, surface)


def test_a_shape_key_is_exact_between_blenders_steps(nodes, objects):
    """The points of a key that is wholly on are known."""
    surface = place(nodes.new_surface("S", "NURBS", points=bumpy(5, 6)))
    shape_key(surface)
    surface.data.shape_keys.key_blocks["Up"].value = 1.0
    patch = objects.read_patch(evaluated(surface), "VIEWPORT")
    expected = bumpy(5, 6)
    expected[..., 2] += np.arange(30).reshape(5, 6) % 3
    assert np.abs(patch.points - expected).max() < 1e-4
    exact = type(patch)(expected, patch.along_u, patch.along_v)
    u, v = np.random.default_rng(3).uniform(size=(2, 100))
    assert np.abs(patch.evaluate(u, v).position - exact.evaluate(u, v).position).max() < 3 * DRAWN


def test_a_modifier_after_tessellation_makes_it_a_grid_only_while_it_acts(nodes, objects, pure):
    surface = place(nodes.new_surface("S", "NURBS", points=bumpy(5, 6)))
    surface.data.splines[0].use_cyclic_u = True
    bend = surface.modifiers.new("Bend", "SIMPLE_DEFORM")
    bend.deform_method, bend.angle = "BEND", 1.5
    grid = objects.read_patch(evaluated(surface), "VIEWPORT")
    shown = drawn(surface)
    assert type(grid).__name__ == "Grid" and grid.points.shape == (5 * STEPS_V, 6 * STEPS_U + 1, 3)
    assert np.array_equal(grid.points[:, :-1], shown)
    assert np.array_equal(grid.points[:, -1], shown[:, 0])
    bend.show_viewport = False
    assert type(objects.read_patch(evaluated(surface), "VIEWPORT")) is pure.NurbsPatch
    bend.show_viewport = True
    bend.show_render = False
    assert type(objects.read_patch(evaluated(surface), "RENDER")) is pure.NurbsPatch
    surface.modifiers.new("Subdivision", "SUBSURF").levels = 1
    with pytest.raises(nodes.UserError, match="adds or removes points"):
        objects.read_patch(evaluated(surface), "VIEWPORT")


def test_points_are_animated(nodes, objects):
    surface = place(nodes.new_surface("S", "NURBS"))
    point = surface.data.splines[0].points[5]
    for frame, z in ((1, 0.0), (11, 2.0)):
        point.co.z = z
        assert point.keyframe_insert("co", frame=frame)
    for frame in (1, 6, 11):
        bpy.context.scene.frame_set(frame)
        now = surface.evaluated_get(bpy.context.evaluated_depsgraph_get())
        expected = {1: 0.0, 6: 1.0, 11: 2.0}[frame]
        assert objects.read_patch(now, "VIEWPORT").points[1, 1, 2] == pytest.approx(expected, abs=1e-6)


def test_edit_mode_acts_at_once(nodes, objects):
    surface = place(nodes.new_surface("S", "NURBS", points=bumpy(4, 4)))
    bpy.context.view_layer.objects.active = surface
    bpy.ops.object.mode_set(mode="EDIT")
    bpy.ops.curve.select_all(action="SELECT")
    bpy.ops.transform.translate(value=(0, 0, 3))
    patch = objects.read_patch(surface.evaluated_get(bpy.context.evaluated_depsgraph_get()), "VIEWPORT")
    bpy.ops.object.mode_set(mode="OBJECT")
    assert np.abs(patch.points - bumpy(4, 4) - [0, 0, 3, 0]).max() < 1e-6


def test_more_than_one_patch_is_refused(nodes, objects):
    surface = place(nodes.new_surface("S", "NURBS"))
    surface.data.splines.new("NURBS")
    with pytest.raises(nodes.UserError, match="'S' has 2 patches"):
        objects.read_patch(evaluated(surface), "VIEWPORT")
    surface.data.splines.clear()
    with pytest.raises(nodes.UserError, match="'S' has no patch"):
        objects.read_patch(evaluated(surface), "VIEWPORT")
    curve = surface.data.splines.new("NURBS")
    curve.points.add(5)
    with pytest.raises(nodes.UserError, match="'S' is not a valid surface: along v"):
        objects.read_patch(evaluated(surface), "VIEWPORT")


def read(reading, camera):
    return reading.read_projection(camera, bpy.context.evaluated_depsgraph_get(), 1.0)


@pytest.mark.parametrize("hidden", list(itertools.product((False, True), repeat=2)))
def test_a_patch_in_a_volume_is_current_however_hidden(bridge, reading, pure, camera, hidden):
    bridge.make_flexible(camera)
    camera.location = (1, 2, 3)
    bridge.add_surface(camera, "PLANE", "Near", Matrix.Translation((0, 0, -1)))
    far = bridge.add_surface(camera, "NURBS", None, Matrix.Translation((0, 0, -5)), points=bumpy(4, 5))
    assert far.name == "Surface Patch" and far.parent == camera and far.hide_render
    far.hide_viewport = hidden[0]
    far.hide_set(hidden[1])
    shape_key(far)
    for value in (0.0, 1.0):
        far.data.shape_keys.key_blocks["Up"].value = value
        surface = read(reading, camera).volume.surfaces[1]
        assert type(surface) is pure.NurbsPatch
        expected = bumpy(4, 5)
        expected[..., 2] += value * (np.arange(20).reshape(4, 5) % 3)
        exact = pure.NurbsPatch(expected).evaluate([0, 0.3, 1], [0, 0.6, 1]).position
        exact += np.array([1, 2, -2])[:, None]
        assert np.abs(surface.evaluate([0, 0.3, 1], [0, 0.6, 1]).position - exact).max() < 1e-4


def test_any_surface_object_can_be_attached(bridge, reading, pure, camera):
    """Blender's own primitives: a patch, a torus that is cyclic both ways."""
    bridge.make_flexible(camera)
    for add in (
        bpy.ops.surface.primitive_nurbs_surface_surface_add,
        bpy.ops.surface.primitive_nurbs_surface_torus_add,
        bpy.ops.surface.primitive_nurbs_surface_cylinder_add,
    ):
        add()
        bridge.attach_surface(camera, bpy.context.active_object)
        assert bpy.context.active_object.scfpf_surface.kind == "NURBS"
    surfaces = read(reading, camera).volume.surfaces
    assert [type(surface) for surface in surfaces] == [pure.NurbsPatch] * 3
    assert surfaces[1].along_u.cyclic and surfaces[1].along_v.cyclic


def test_wrong_kinds_are_named(bridge, reading, camera):
    bridge.make_flexible(camera)
    near = bridge.add_surface(camera, "PLANE", "Near")
    patch = bridge.add_surface(camera, "NURBS", "Patch")
    patch.scfpf_surface.kind = "PLANE"
    with pytest.raises(reading.UserError, match="'Patch' is a surface object: set its kind to Surface Patch"):
        read(reading, camera)
    patch.scfpf_surface.kind = "NURBS"
    near.scfpf_surface.kind = "NURBS"
    with pytest.raises(reading.UserError, match="'Near' is of type Mesh"):
        read(reading, camera)


def test_the_operator_adds_undoes_and_saves_a_patch(addon, reading, pure, tmp_path):
    assert bpy.ops.scfpf.camera_add() == {"FINISHED"}
    bpy.ops.ed.undo_push(message="before")
    assert bpy.ops.scfpf.surface_add("EXEC_DEFAULT", True, kind="NURBS") == {"FINISHED"}
    camera = bpy.context.scene.camera
    patch = camera.scfpf.surfaces[1].object
    spline = patch.data.splines[0]
    assert (patch.scfpf_surface.kind, spline.point_count_u, spline.point_count_v) == ("NURBS", 4, 4)
    assert spline.use_endpoint_u and spline.use_endpoint_v
    near, ours, far = read(reading, camera).volume.surfaces
    middle = [surface.evaluate(0.5, 0.5).position[:, 0] for surface in (near, ours, far)]
    assert np.abs((middle[0] + middle[2]) / 2 - middle[1]).max() < 1e-4 * np.abs(middle[2]).max()
    bpy.ops.ed.undo()
    camera = bpy.context.scene.camera
    assert len(camera.scfpf.surfaces) == 2
    bpy.ops.ed.redo()
    camera = bpy.context.scene.camera
    assert type(read(reading, camera).volume.surfaces[1]) is pure.NurbsPatch
    assert len(bpy.data.scenes) == 1
    camera.scfpf.basis = "B_SPLINE"
    bpy.ops.wm.save_as_mainfile(filepath=str(tmp_path / "patch.blend"))
    bpy.ops.wm.open_mainfile(filepath=str(tmp_path / "patch.blend"))
    volume = read(reading, bpy.context.scene.camera).volume
    assert type(volume.surfaces[1]) is pure.NurbsPatch and volume.basis == "B_SPLINE"
    assert bpy.ops.scfpf.surface_remove() == {"FINISHED"}
    assert not bpy.data.curves


def test_a_preset_with_a_patch_is_applied_and_scaled(addon, bridge, reading, pure, camera):
    presets = addon("projection.presets.preset")
    points = bumpy(3, 4)
    orders = {"order_u": 4.0, "order_v": 3.0}
    surfaces = (
        presets.PresetSurface("Near", "PLANE", np.eye(4), {"width": 1.0, "height": 1.0}),
        presets.PresetSurface("Far", "NURBS", np.diag([1, 1, 1, 1.0]), orders, points),
    )
    preset = presets.Preset(
        "Trial", "", "", "B_SPLINE", "RECTANGLE", (0.0, 1.0), (0.0, 1.0), 1.0, "NONE", surfaces
    )
    bridge.apply_preset(camera, preset, 1.0, scale=3.0)
    volume = read(reading, camera).volume
    assert volume.basis == "B_SPLINE" and type(volume.surfaces[1]) is pure.NurbsPatch
    assert np.allclose(volume.surfaces[1].points, points * [3, 3, 3, 1], rtol=1e-6)
    assert (volume.surfaces[1].along_u.order, volume.surfaces[1].along_v.order) == (4, 3)


def test_the_render_resolution_counts_in_a_render(addon, bridge, reading, pure, camera):
    bridge.make_flexible(camera)
    bridge.add_surface(camera, "PLANE", "Near", Matrix.Translation((0, 0, -1)))
    far = bridge.add_surface(camera, "NURBS", "Far", points=bumpy(4, 5))
    far.data.render_resolution_u, far.data.render_resolution_v = 7, 5
    shape_key(far)
    depsgraphs = addon("bridge.scene.render_depsgraph")
    seen = depsgraphs.with_render_depsgraph(
        bpy.context.scene,
        bpy.context.view_layer,
        lambda depsgraph: reading.read_projection(camera, depsgraph, 1.0),
    )
    here = read(reading, camera)
    u, v = np.random.default_rng(3).uniform(size=(2, 100))
    one, other = (p.volume.surfaces[1] for p in (seen, here))
    assert type(one) is pure.NurbsPatch
    assert np.abs(one.evaluate(u, v).position - other.evaluate(u, v).position).max() < 1e-4


def test_the_panel_shows_the_patch_settings(nodes):
    surface = place(nodes.new_surface("S", "NURBS"))
    shown = nodes.parameter_properties(surface)
    assert [label for label, *_ in shown][:4] == ["Order U", "Order V", "Endpoint U", "Endpoint V"]
    for _, owner, name in shown:
        assert name in owner.bl_rna.properties
