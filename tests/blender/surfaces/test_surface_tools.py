# SPDX-License-Identifier: GPL-3.0-or-later
"""Subdivide, equalise, mirror, convert: what they leave the same, what they refuse, undo and redo."""

import bpy
import numpy as np
import pytest
from mathutils import Matrix

RANDOM = np.random.default_rng(9)
U, V, T = RANDOM.random((3, 300))
# Objects and points are float32; the coordinates here are about 10.
FLOAT32 = 3e-5
# Of a cubic patch with 12 × 12 points near half a turn of a round surface, as a share of the size.
FITTED = 1e-4
ROUND = {"arc": 2.5}
SPHERE = {"arc": 2.5, "latitude_start": -1.0, "latitude_end": 1.2}


@pytest.fixture
def read(addon):
    def read_volume(camera):
        read_projection = addon("bridge.camera.read_projection").read_projection
        return read_projection(camera, bpy.context.evaluated_depsgraph_get(), 1.5).volume

    return read_volume


@pytest.fixture
def camera_with(addon):
    def make(kind, parameters=None, points=None, basis="BEZIER"):
        """A camera off the origin with a plane and, unevenly scaled behind it, a surface of ``kind``."""
        module = addon("bridge.camera.flexible_camera")
        bpy.ops.object.camera_add(location=(3, -2, 1), rotation=(1.2, 0.1, 0.4))
        camera = bpy.context.object
        bpy.context.scene.camera = camera
        module.add_surface(camera, "PLANE", matrix=np.array(Matrix.Translation((0, 0, -1))))
        matrix = Matrix.LocRotScale((1, 2, -5), Matrix.Rotation(0.4, 3, "Y"), (2, 3, 1.5))
        module.add_surface(camera, kind, matrix=np.array(matrix), parameters=parameters, points=points)
        module.make_flexible(camera)
        camera.scfpf.basis = basis
        bpy.context.view_layer.update()
        return camera

    return make


def last(camera):
    return camera.scfpf.surfaces[len(camera.scfpf.surfaces) - 1].object


def positions(volume, u=U, v=V):
    return volume.evaluate(u, v, T).position


def same(before, after, tolerance=FLOAT32):
    return np.abs(before - after).max() <= tolerance * np.abs(before).max()


def bumpy(rows, columns, numbers=3, seed=3):
    rng = np.random.default_rng(seed)
    x, y = np.meshgrid(np.linspace(-1, 1, columns), np.linspace(-1, 1, rows))
    points = np.stack([x, y, np.zeros_like(x)], 2) + rng.normal(0, 0.15, (rows, columns, 3))
    if numbers == 3:
        return points
    return np.concatenate([points, rng.uniform(0.5, 2, (rows, columns, 1))], 2)


def unwrapped(surface, cuts=5):
    """The mesh of a bent sheet in triangles with a UV map named otherwise: no regular grid."""
    import bmesh

    shape = bmesh.new()
    bmesh.ops.create_grid(shape, x_segments=cuts, y_segments=cuts, size=1)
    bmesh.ops.triangulate(shape, faces=shape.faces)
    layer = shape.loops.layers.uv.new("Unwrapped")
    for face in shape.faces:
        for loop in face.loops:
            loop[layer].uv = [(c + 1) / 2 for c in loop.vert.co.xy]
    for vertex in shape.verts:
        vertex.co.z = 0.3 * vertex.co.x**2 + 0.2 * vertex.co.y
    surface.data.clear_geometry()
    while surface.data.uv_layers:
        surface.data.uv_layers.remove(surface.data.uv_layers[0])
    shape.to_mesh(surface.data)
    shape.free()
    bpy.context.view_layer.update()


# Subdivide


@pytest.mark.parametrize("direction", ["U", "V", "BOTH"])
@pytest.mark.parametrize("kind", ["PATCH", "GRID", "NURBS"])
def test_a_subdivided_surface_makes_the_same_image(camera_with, read, kind, direction):
    points = {"PATCH": bumpy(2, 2), "GRID": bumpy(4, 3), "NURBS": bumpy(4, 6, 4)}[kind]
    camera = camera_with(kind, points=points)
    before = positions(read(camera))
    assert bpy.ops.scfpf.surface_subdivide(direction=direction) == {"FINISHED"}
    assert bpy.ops.scfpf.surface_subdivide(direction=direction) == {"FINISHED"}
    assert last(camera).scfpf_surface.kind == ("NURBS" if kind == "NURBS" else "GRID")
    assert same(before, positions(read(camera)))
    now = np.shape(read(camera).surfaces[1].points)
    rows, columns = points.shape[:2]
    if kind != "NURBS":
        assert now[1] == (columns if direction == "V" else 4 * (columns - 1) + 1)
        assert now[0] == (rows if direction == "U" else 4 * (rows - 1) + 1)
    else:  # order 4: pieces are three fewer than points
        assert now[1] == (columns if direction == "V" else 4 * (columns - 3) + 3)
        assert now[0] == (rows if direction == "U" else 4 * (rows - 3) + 3)


@pytest.mark.parametrize("flags", [(0, 0, 0), (0, 0, 1), (1, 1, 0)])
def test_subdivided_patches_keep_their_settings(camera_with, read, flags):
    camera = camera_with("NURBS", {"order_u": 3}, bumpy(4, 7, 4))
    surface = last(camera)
    spline = surface.data.splines[0]
    spline.use_endpoint_u, spline.use_bezier_u, spline.use_cyclic_u = (bool(flag) for flag in flags)
    spline.resolution_u = 7
    surface.data.materials.append(bpy.data.materials.new("Some"))
    name, before = surface.data.name, positions(read(camera))
    assert bpy.ops.scfpf.surface_subdivide(direction="U") == {"FINISHED"}
    assert same(before, positions(read(camera)))
    spline = last(camera).data.splines[0]
    assert (spline.use_endpoint_u, spline.use_bezier_u, spline.use_cyclic_u) == tuple(map(bool, flags))
    assert (spline.order_u, spline.resolution_u, spline.point_count_v) == (3, 7, 4)
    assert last(camera) == surface and surface.data.name == name and len(surface.data.materials) == 1
    assert len(bpy.data.curves) == 1


def test_what_cannot_be_subdivided_is_said(camera_with):
    camera = camera_with("CYLINDER")
    with pytest.raises(RuntimeError, match="convert it to a grid"):
        bpy.ops.scfpf.surface_subdivide()
    surface = last(camera)
    bpy.ops.scfpf.surface_to_grid(columns=2, rows=2)
    surface.shape_key_add(name="Basis")
    with pytest.raises(RuntimeError, match="shape keys"):
        bpy.ops.scfpf.surface_subdivide()
    surface.shape_key_clear()
    surface.modifiers.new("Hook", "HOOK")
    with pytest.raises(RuntimeError, match="hooks"):
        bpy.ops.scfpf.surface_subdivide()
    surface.modifiers.clear()
    for _ in range(9):
        assert bpy.ops.scfpf.surface_subdivide(direction="U") == {"FINISHED"}
    with pytest.raises(RuntimeError, match="more than 1024 faces"):
        bpy.ops.scfpf.surface_subdivide(direction="U")


@pytest.mark.parametrize("radius", [float("nan"), 1e10])
def test_a_surface_that_no_mesh_can_hold_is_refused_and_stays(camera_with, addon, radius, capfd):
    """By the operator; the property Kind, which cannot refuse, gives the shape of a new surface."""
    camera = camera_with("CYLINDER")
    surface = last(camera)
    modifier = surface.modifiers[0]
    (identifier,) = (i.identifier for i in modifier.node_group.interface.items_tree if i.name == "Radius")
    addon("bridge.blender.versions").set_modifier_input(modifier, identifier, radius)
    surface.update_tag()
    with pytest.raises(RuntimeError):
        bpy.ops.scfpf.surface_to_grid(columns=4, rows=4)
    assert (last(camera), surface.scfpf_surface.kind, len(surface.modifiers)) == (surface, "CYLINDER", 1)
    surface.scfpf_surface.kind = "PATCH"
    assert sorted(tuple(vertex.co.xy) for vertex in surface.data.vertices) == [
        (-0.5, -0.5),
        (-0.5, 0.5),
        (0.5, -0.5),
        (0.5, 0.5),
    ]
    assert "Traceback" not in capfd.readouterr().err


# Equalise


@pytest.mark.parametrize(
    ("kind", "parameters", "points"),
    [
        ("PATCH", None, np.array([[[-1.0, -1, 0], [3, -1, 0]], [[-1, 1, 0], [0, 2, 0]]])),
        ("GRID", None, bumpy(5, 5)),
        ("UV_MESH", None, bumpy(5, 5)),
        ("NURBS", None, bumpy(5, 5, 4)),
        ("SPHERE", SPHERE, None),
    ],
)
@pytest.mark.parametrize("direction", ["U", "V"])
def test_equalised_steps_are_even_on_the_same_surface(
    addon, camera_with, read, kind, parameters, points, direction
):
    unevenness = addon("projection.editing.respacing").unevenness
    camera = camera_with(kind, parameters, points)
    surface = last(camera)
    frame = np.array(surface.matrix_world)
    u, v = (grid.ravel() for grid in np.meshgrid(np.linspace(0, 1, 200), np.linspace(0, 1, 200)))
    before = read(camera).surfaces[1].evaluate(u, v).position
    assert bpy.ops.scfpf.surface_equalise(direction=direction, columns=24, rows=24) == {"FINISHED"}
    assert last(camera).scfpf_surface.kind == "GRID"
    bpy.context.view_layer.update()
    assert np.allclose(np.array(last(camera).matrix_world), frame, atol=1e-6)
    grid = addon("bridge.blender.mesh_grid").grid_points(last(camera))
    # float32 points, steps about 1/24 of the size.
    assert unevenness(grid, 1 if direction == "U" else 0) < 2e-4
    world = grid.reshape(-1, 3) @ frame[:3, :3].T + frame[:3, 3]
    nearest = [np.sqrt(((before.T - place) ** 2).sum(1).min()) for place in world[::7]]
    assert max(nearest) < 0.02 * np.ptp(before)


def test_equalised_shape_is_not_moved_by_a_uniform_surface(camera_with, read):
    camera = camera_with("PLANE")
    before = positions(read(camera))
    bpy.ops.scfpf.surface_equalise()
    assert same(before, positions(read(camera)))
    bpy.ops.scfpf.surface_remove()
    camera = camera_with("POINT")
    with pytest.raises(RuntimeError, match="is a point"):
        bpy.ops.scfpf.surface_equalise()


# Mirror


@pytest.mark.parametrize("axis", ["U", "V"])
@pytest.mark.parametrize("kind", ["NURBS", "CLOSED", "UV_MESH"])
def test_mirrored_patches_and_meshes(camera_with, read, kind, axis):
    camera = camera_with(
        "UV_MESH" if kind == "UV_MESH" else "NURBS", points=bumpy(5, 6, 3 if kind == "UV_MESH" else 4)
    )
    if kind == "UV_MESH":
        unwrapped(last(camera))
    if kind == "CLOSED":
        spline = last(camera).data.splines[0]
        spline.use_endpoint_u, spline.use_cyclic_u = False, True
    before = positions(read(camera), *((1 - U, V) if axis == "U" else (U, 1 - V)))
    assert bpy.ops.scfpf.volume_mirror(axis=axis) == {"FINISHED"}
    assert same(before, positions(read(camera)))


def test_a_patch_that_cannot_be_mirrored_is_refused_before_anything_changes(camera_with, read):
    camera = camera_with("NURBS")
    last(camera).modifiers.new("Hook", "HOOK")
    before = positions(read(camera))
    with pytest.raises(RuntimeError, match="shape keys or hooks"):
        bpy.ops.scfpf.volume_mirror()
    assert np.array_equal(before, positions(read(camera)))


# Convert


@pytest.mark.parametrize("kind", ["NURBS", "UV_MESH"])
def test_other_kinds_become_grids(camera_with, read, kind):
    camera = camera_with(kind, points=bumpy(5, 5, 4 if kind == "NURBS" else 3))
    if kind == "UV_MESH":
        unwrapped(last(camera))
    else:
        last(camera).modifiers.new("Wave", "SIMPLE_DEFORM").angle = 0.3
    before, name = positions(read(camera)), last(camera).name
    # A bent patch is the mesh that Blender draws, 19 × 19 faces; the sheet has 5 × 5.
    assert bpy.ops.scfpf.surface_to_grid(columns=190, rows=190) == {"FINISHED"}
    assert same(before, positions(read(camera)), 1e-4)
    surface = last(camera)
    assert surface.type == "MESH" and surface.scfpf_surface.kind == "GRID" and surface.name == name
    assert len(bpy.data.curves) == 0 and surface.parent == camera


@pytest.mark.parametrize(
    ("kind", "parameters", "points", "error"),
    [
        ("PLANE", None, None, FLOAT32),
        ("PATCH", None, bumpy(2, 2), FLOAT32),
        ("GRID", None, bumpy(4, 5), FLOAT32),
        ("CYLINDER", ROUND, None, FITTED),
        ("CONE", ROUND, None, FITTED),
        ("DISC", ROUND, None, FITTED),
        ("SPHERE", SPHERE, None, FITTED),
    ],
)
def test_surface_to_patch_to_grid_without_changing_the_image(
    camera_with, read, kind, parameters, points, error
):
    camera = camera_with(kind, parameters, points)
    last(camera).delta_location.x = 0.5
    before = positions(read(camera))
    assert bpy.ops.scfpf.surface_to_patch(columns=12, rows=12) == {"FINISHED"}
    surface = last(camera)
    assert surface.type == "SURFACE" and surface.scfpf_surface.kind == "NURBS"
    assert same(before, positions(read(camera)), error)
    # As fine as both, and with the lines of the grid's 4 × 3 faces among its own.
    fine = 192 if error == FITTED else 24
    assert bpy.ops.scfpf.surface_to_grid(columns=fine, rows=fine) == {"FINISHED"}
    assert last(camera).scfpf_surface.kind == "GRID"
    # Chords of 1/192 of the arc: 2.5²/192²/8 of the radius.
    assert same(before, positions(read(camera)), error + 2e-5)


@pytest.mark.parametrize(
    "kind", ["POINT", "PLANE", "PATCH", "DISC", "CYLINDER", "CONE", "SPHERE", "GRID", "UV_MESH", "NURBS"]
)
def test_as_many_points_as_keep_the_image_if_nothing_else_is_said(camera_with, read, kind):
    """A full turn, as new surfaces of a round kind are, to a tenth of a pixel of 1920."""
    camera = camera_with(kind)
    before, kept = positions(read(camera)), 0.1 / 1920 + FLOAT32
    conversions = [bpy.ops.scfpf.surface_to_patch] if kind != "NURBS" else []
    for times, convert in enumerate([*conversions, bpy.ops.scfpf.surface_to_grid], 1):
        assert convert() == {"FINISHED"}
        assert same(before, positions(read(camera)), times * kept)
    assert len(last(camera).data.vertices) < 70_000 and last(camera).scfpf_surface.kind == "GRID"


def test_a_coarser_image_needs_fewer_points(camera_with):
    counts = []
    for error in (0.1, 10.0):
        camera = camera_with("CYLINDER")
        camera.scfpf.pixel_error = error
        assert bpy.ops.scfpf.surface_to_patch() == {"FINISHED"}
        counts.append(len(last(camera).data.splines[0].points))
    assert 4 * 4 < counts[1] < 0.7 * counts[0] < 0.7 * 16 * 8


@pytest.mark.parametrize("parented", [True, False])
def test_what_refers_to_a_converted_surface_refers_to_the_new_one(camera_with, parented):
    """Children, constraints and drivers; the new object stands alone, as after Blender's Convert."""
    camera = camera_with("CYLINDER")
    surface = last(camera)
    if not parented:
        bpy.context.view_layer.update()
        world = surface.matrix_world.copy()
        surface.parent, surface.matrix_world = None, world
    others = [bpy.data.objects.new(name, None) for name in ("Child", "Tracks", "Driven")]
    for other in others:
        bpy.context.scene.collection.objects.link(other)
    child, tracks, driven = others
    child.parent, child.location = surface, (0, 0, 3)
    tracks.constraints.new("COPY_LOCATION").target = surface
    driver = driven.driver_add("location", 0).driver
    driver.expression = "there"
    variable = driver.variables.new()
    variable.name, variable.type = "there", "TRANSFORMS"
    variable.targets[0].id, variable.targets[0].transform_type = surface, "LOC_Z"
    bpy.context.view_layer.update()
    before = [np.array(other.matrix_world) for other in others]
    name, count = surface.name, len(bpy.data.objects)
    for convert in (bpy.ops.scfpf.surface_to_patch, bpy.ops.scfpf.surface_to_grid):
        assert convert() == {"FINISHED"}
        bpy.context.view_layer.update()
        new = last(camera)
        assert new.name == name and len(bpy.data.objects) == count
        assert list(new.users_collection) == [bpy.context.scene.collection]
        assert child.parent == tracks.constraints[0].target == variable.targets[0].id == new
        for matrix, other in zip(before, others, strict=True):
            assert np.allclose(np.array(other.matrix_world), matrix, atol=1e-6)
    assert len(bpy.data.curves) == 0


def test_a_converted_surface_of_two_cameras_stays_with_the_other(camera_with):
    first = camera_with("CYLINDER")
    surface = last(first)
    second = camera_with("PLANE")
    second.scfpf.surfaces[1].object = surface
    bpy.context.view_layer.update()
    assert bpy.ops.scfpf.surface_to_patch() == {"FINISHED"}
    assert last(first) == surface and last(second).type == "SURFACE" and last(second) != surface


def test_the_cast_image_is_the_same(addon, camera_with, read):
    """Patch, then grid, of a cylinder: the same triangles at the same t, silhouettes excepted."""
    geometry = addon("casting.scene.cast_scene")
    casting = addon("casting.cast").cast
    projection = addon("projection.volume.viewing_volume").Projection
    camera = camera_with("CYLINDER", ROUND)
    rng = np.random.default_rng(2)
    low, high = (f(positions(read(camera)), axis=1) for f in (np.min, np.max))
    corners = rng.uniform(low, high, (300, 1, 3)) + rng.normal(0, 0.3, (300, 3, 3))
    scene = geometry.CastScene(corners.reshape(-1, 3), np.arange(900, dtype=np.int32).reshape(-1, 3))
    place = (np.arange(64) + 0.5) / 64
    x, y = (grid.ravel() for grid in np.meshgrid(place, place))

    def image():
        return casting(
            scene, projection(read(camera)).transformed(scene.matrix), x, y, (1 / 64, 1 / 64), 0.01
        )

    before = image()
    assert (before.triangle >= 0).mean() > 0.2
    for convert in (
        lambda: bpy.ops.scfpf.surface_to_patch(columns=16, rows=4),
        lambda: bpy.ops.scfpf.surface_to_grid(columns=256, rows=8),
        lambda: bpy.ops.scfpf.surface_subdivide(),
    ):
        assert convert() == {"FINISHED"}
        after = image()
        agree = (after.triangle == before.triangle) & (before.triangle >= 0)
        assert (after.triangle != before.triangle).mean() < 2e-3
        assert np.median(np.abs(after.t[agree] - before.t[agree])) < 1e-4


def test_what_cannot_be_converted_is_said(addon, camera_with):
    camera = camera_with("NURBS")
    with pytest.raises(RuntimeError, match="Surface Patch already"):
        bpy.ops.scfpf.surface_to_patch()
    last(camera).keyframe_insert("location", frame=1)
    with pytest.raises(RuntimeError, match="constraints or animation"):
        bpy.ops.scfpf.surface_to_grid()
    last(camera).animation_data_clear()
    last(camera).data.splines[0].points[3].keyframe_insert("co", frame=1)
    with pytest.raises(RuntimeError, match="constraints or animation"):
        bpy.ops.scfpf.surface_to_grid()
    with pytest.raises(RuntimeError, match="animated points"):
        bpy.ops.scfpf.volume_mirror()
    assert last(camera).type == "SURFACE" and len(camera.scfpf.surfaces) == 2
    camera = camera_with("LATTICE")
    for operator, text in (
        (bpy.ops.scfpf.surface_to_grid, "cannot become a grid"),
        (bpy.ops.scfpf.surface_to_patch, "cannot become a surface patch"),
        (bpy.ops.scfpf.surface_subdivide, "is a lattice"),
        (bpy.ops.scfpf.surface_equalise, "cannot be equalized"),
        (bpy.ops.scfpf.surface_insert, "more points along W"),
    ):
        with pytest.raises(RuntimeError, match=text):
            operator()
    camera = camera_with("UV_MESH", points=bumpy(3, 3))
    unwrapped(last(camera))
    mesh = last(camera).data
    uv = mesh.attributes["Unwrapped"].data
    values = np.empty(2 * len(uv), np.float32)
    uv.foreach_get("vector", values)
    uv.foreach_set("vector", values / 2)
    mesh.update()
    for operator in (bpy.ops.scfpf.surface_to_grid, bpy.ops.scfpf.surface_equalise):
        with pytest.raises(RuntimeError, match="holes"):
            operator()


# Lattice


@pytest.mark.parametrize("interpolation", ["LINEAR", "CARDINAL", "CATMULL_ROM", "BSPLINE"])
@pytest.mark.parametrize("preset", ["VIEW", "perspective", "nonlinear_twist", "cylindrical_panorama"])
def test_a_volume_becomes_a_lattice(read, preset, interpolation):
    bpy.ops.mesh.primitive_cube_add()
    assert bpy.ops.scfpf.camera_add(preset=preset) == {"FINISHED"}
    camera = bpy.context.object
    inner, end = RANDOM.random((2, 200)), RANDOM.integers(0, 2, 200)
    before = read(camera).evaluate(*inner, end).position
    assert bpy.ops.scfpf.volume_to_lattice(
        points_u=24, points_v=8, points_w=8, interpolation=interpolation
    ) == {"FINISHED"}
    assert [slot.object.type for slot in camera.scfpf.surfaces] == ["LATTICE"]
    flat = preset in {"VIEW", "perspective"}
    # 23 chords of a full turn leave it by 1 - cos(π/23) of the radius; cubics bend the outer cells.
    assert same(
        before,
        read(camera).evaluate(*inner, end).position,
        FLOAT32 if flat and interpolation == "LINEAR" else 0.03,
    )


def test_undo_and_redo_of_every_tool(camera_with, read):
    def state():
        camera = bpy.context.scene.camera
        return [slot.object.type for slot in camera.scfpf.surfaces], positions(read(camera))

    def agrees(one, other):
        return one[0] == other[0] and np.allclose(one[1], other[1], atol=1e-4)

    camera_with("CYLINDER", ROUND)
    steps = (
        lambda: bpy.ops.scfpf.surface_to_patch("EXEC_DEFAULT", True),
        lambda: bpy.ops.scfpf.surface_subdivide("EXEC_DEFAULT", True),
        lambda: bpy.ops.scfpf.volume_mirror("EXEC_DEFAULT", True, axis="U"),
        lambda: bpy.ops.scfpf.surface_to_grid("EXEC_DEFAULT", True),
        lambda: bpy.ops.scfpf.surface_equalise("EXEC_DEFAULT", True),
        lambda: bpy.ops.scfpf.volume_to_lattice("EXEC_DEFAULT", True),
    )
    with bpy.context.temp_override(window=bpy.context.window_manager.windows[0]):
        bpy.ops.ed.undo_push(message="start")
        states = [state()]
        for step in steps:
            assert step() == {"FINISHED"}
            bpy.context.view_layer.update()
            states.append(state())
        for before in reversed(states[:-1]):
            bpy.ops.ed.undo()
            assert agrees(state(), before)
        for after in states[1:]:
            bpy.ops.ed.redo()
            assert agrees(state(), after)


def test_tools_say_what_they_need():
    operators = (
        bpy.ops.scfpf.surface_to_patch,
        bpy.ops.scfpf.surface_subdivide,
        bpy.ops.scfpf.surface_equalise,
        bpy.ops.scfpf.volume_to_lattice,
    )
    for operator in operators:
        with pytest.raises(RuntimeError, match="Flexible Camera"):
            operator()
        assert operator.get_rna_type().description


# Scales of 0

TOOLS = (
    *("surface_to_grid", "surface_to_patch", "surface_subdivide", "surface_equalise", "surface_apply_scale"),
    *("volume_to_lattice", "surface_insert", "surface_duplicate", "volume_swap", "volume_mirror"),
    *("surface_align", "volume_single_user", "volume_fit", "volume_fit_picture", "volume_frame", "attention"),
)


@pytest.mark.parametrize("kind", ["PLANE", "POINT", "UV_MESH"])
@pytest.mark.parametrize("scale", [(0, 1, 1), (0, 0, 0)])
@pytest.mark.parametrize("flat", ["surface", "camera"])
def test_flat_objects_are_worked_on_or_refused_in_words(camera_with, kind, scale, flat):
    points = bumpy(4, 4) if kind == "UV_MESH" else None
    for tool in TOOLS:
        camera = camera_with(kind, points=points)
        (last(camera) if flat == "surface" else camera).scale = scale
        bpy.context.view_layer.update()
        camera.scfpf.active_surface = len(camera.scfpf.surfaces) - 1
        operator = getattr(bpy.ops.scfpf, tool)
        if not operator.poll():
            continue
        try:
            operator()
        except RuntimeError as error:
            assert "fault of the add-on" not in str(error), tool
