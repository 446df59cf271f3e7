# SPDX-License-Identifier: GPL-3.0-or-later
"""Control surfaces as objects: the drawn mesh is the analytic surface; parameters and grids read back."""

import bpy
import numpy as np
import pytest

# The mesh is float32 and its largest coordinate here is about 5.
DRAWN = 1e-6

PARAMETERS = {
    "PLANE": {"width": 3.0, "height": 0.7},
    "DISC": {"radius": 2.3, "arc": 4.0},
    "CYLINDER": {"radius": 2.5, "arc": 3.0, "height": 1.4},
    "CONE": {"radius_start": 0.4, "radius_end": 2.0, "arc": 5.5, "height": 3.0},
    "SPHERE": {"radius": 1.7, "arc": 2.5, "latitude_start": -0.6, "latitude_end": 1.2},
    "PARABOLOID": {"radius": 1.3, "arc": 4.5, "depth": 2.1},
}


@pytest.fixture
def nodes(addon):
    return addon("bridge.surfaces.surface_object")


@pytest.fixture
def kinds(addon):
    return addon("bridge.surfaces.kinds")


@pytest.fixture
def pure(addon):
    """The classes of the parametric kinds."""
    return {key: kind.surface for key, kind in addon("projection.surfaces.kinds").PARAMETRIC_KINDS.items()}


def place(surface):
    bpy.context.scene.collection.objects.link(surface)
    return surface


def evaluated(surface):
    return surface.evaluated_get(bpy.context.evaluated_depsgraph_get())


def drawn(surface):
    """Vertices (3, V), UVs of the corners (2, C) and the corners' vertices (C,) of the evaluated mesh."""
    mesh = evaluated(surface).data
    points = np.array([vertex.co for vertex in mesh.vertices]).T
    corners = np.array([loop.vertex_index for loop in mesh.loops])
    uv = np.array([corner.vector for corner in mesh.uv_layers["UVMap"].uv]).T
    return points, uv, corners


@pytest.mark.parametrize("given", [True, False], ids=["given", "default"])
@pytest.mark.parametrize("kind", PARAMETERS)
def test_drawn_mesh_is_the_analytic_surface(nodes, pure, kind, given):
    parameters = PARAMETERS[kind] if given else {}
    surface = place(nodes.new_surface("S", kind, parameters))
    nodes.set_surface_parameters(surface, {"resolution_u": 7, "resolution_v": 3})
    points, uv, corners = drawn(surface)
    assert points.shape == (3, 8 * 4) and len(corners) == 4 * 7 * 3
    assert sorted({(round(7 * u, 4), round(3 * v, 4)) for u, v in uv.T}) == [
        (u, v) for u in range(8) for v in range(4)
    ]
    exact = pure[kind](**parameters).evaluate(*uv).position
    assert np.abs(points[:, corners] - exact).max() < DRAWN * max(1, np.abs(exact).max())


@pytest.mark.parametrize("kind", PARAMETERS)
def test_defaults_are_those_of_the_pure_classes(nodes, pure, kind):
    surface = place(nodes.new_surface("S", kind))
    exact = pure[kind]()
    read = nodes.surface_parameters(evaluated(surface))
    assert set(read) == set(PARAMETERS[kind])
    for key, value in read.items():
        assert value == pytest.approx(getattr(exact, key), rel=1e-7)


def test_a_point_is_a_cross_to_see_and_pick(nodes):
    surface = place(nodes.new_surface("P", "POINT", {"size": 0.5}))
    mesh = evaluated(surface).data
    assert (len(mesh.vertices), len(mesh.edges), len(mesh.polygons)) == (6, 3, 0)
    ends = sorted(tuple(round(c, 6) for c in vertex.co) for vertex in mesh.vertices)
    assert ends == sorted(
        tuple(sign * 0.25 * (i == axis) + 0.0 for i in range(3)) for axis in range(3) for sign in (-1, 1)
    )
    assert nodes.surface_parameters(evaluated(surface)) == {}


def test_parameters_are_animated_and_driven(nodes):
    """The radius is keyed, the height driven by it being frame / 10; frames 1, 6 and 11."""
    surface = place(nodes.new_surface("S", "CYLINDER"))
    places = {label: (owner, path) for label, owner, path in nodes.parameter_properties(surface)}
    owner, path = places["Radius"]
    for frame, radius in ((1, 1.0), (11, 3.0)):
        nodes.set_surface_parameters(surface, {"radius": radius})
        assert owner.keyframe_insert(path, frame=frame)
    owner, path = places["Height"]
    owner.driver_add(path).driver.expression = "frame / 10"
    for frame in (1, 6, 11):
        bpy.context.scene.frame_set(frame)
        now = evaluated(surface)
        read = nodes.surface_parameters(now)
        expected = {1: 1.0, 6: 2.0, 11: 3.0}[frame]
        assert read["radius"] == pytest.approx(expected, rel=1e-6)
        assert read["height"] == pytest.approx(frame / 10, rel=1e-6)
        mesh = now.data
        assert max(vertex.co.y for vertex in mesh.vertices) == pytest.approx(frame / 20, rel=1e-6)
        assert max(np.hypot(v.co.x, v.co.z) for v in mesh.vertices) == pytest.approx(expected, rel=1e-6)


def test_groups_are_shared_and_rebuilt_when_edited(nodes):
    first, second = (place(nodes.new_surface(name, "DISC")) for name in "AB")
    group = first.modifiers[0].node_group
    assert second.modifiers[0].node_group == group
    group.interface.remove(group.interface.items_tree["Arc"])
    with pytest.raises(nodes.UserError, match=r"'A'.*just the inputs Radius, Arc.*SCFPF Disk"):
        nodes.surface_parameters(evaluated(first))
    third = place(nodes.new_surface("C", "DISC"))
    assert third.modifiers[0].node_group != group
    assert nodes.surface_parameters(evaluated(third))["radius"] == 1.0


def test_inputs_are_found_by_name(nodes):
    surface = place(nodes.new_surface("S", "PLANE", {"width": 2.0, "height": 3.0}))
    group = surface.modifiers[0].node_group
    group.name = "Anything"
    surface.modifiers[0].name = "Something"
    group.interface.move(group.interface.items_tree["Height"], 0)
    assert nodes.surface_parameters(evaluated(surface)) == {"width": 2.0, "height": 3.0}
    surface.modifiers.clear()
    with pytest.raises(nodes.UserError, match="'S' has no node group"):
        nodes.surface_parameters(evaluated(surface))


def test_bad_parameters_are_refused_and_leave_nothing(nodes):
    for kind, parameters, points in (
        ("PLANE", {"radius": 1.0}, None),
        ("PLANE", {"width": float("nan")}, None),
        ("TORUS", {}, None),
        ("PATCH", None, np.zeros((3, 2, 3))),
        ("GRID", None, np.zeros((1, 5, 3))),
        ("GRID", None, np.full((2, 2, 3), np.inf)),
    ):
        with pytest.raises(nodes.UserError):
            nodes.new_surface("S", kind, parameters, points)
    assert not bpy.data.objects and not bpy.data.meshes


def test_another_kind_keeps_what_the_kinds_share(nodes):
    surface = place(nodes.new_surface("S", "CYLINDER", {"radius": 3.0, "arc": 2.0, "height": 5.0}))
    surface.modifiers.new("Displace", "DISPLACE")
    surface.scfpf_surface.kind = "SPHERE"
    assert nodes.surface_parameters(evaluated(surface)) == {
        "radius": 3.0,
        "arc": 2.0,
        "latitude_start": pytest.approx(-np.pi / 2),
        "latitude_end": pytest.approx(np.pi / 2),
    }
    assert [modifier.name for modifier in surface.modifiers] == ["SCFPF Sphere", "Displace"]
    surface.scfpf_surface.kind = "NONE"
    surface.scfpf_surface.kind = "POINT"
    assert nodes.surface_parameters(evaluated(surface)) == {}


@pytest.mark.parametrize("kind", PARAMETERS)
def test_a_parametric_surface_becomes_a_mesh_of_its_shape(nodes, pure, kind):
    surface = place(nodes.new_surface("S", kind, PARAMETERS[kind] | {"resolution_u": 5, "resolution_v": 3}))
    surface.scfpf_surface.kind = "GRID"
    points = nodes.surface_parameters(evaluated(surface))["points"]
    u, v = np.meshgrid(np.arange(6) / 5, np.arange(4) / 3)
    exact = pure[kind](**PARAMETERS[kind]).evaluate(u.ravel(), v.ravel()).position
    assert np.allclose(points.reshape(-1, 3).T, exact, atol=5e-6) and not surface.modifiers
    surface.scfpf_surface.kind = kind
    assert set(nodes.surface_parameters(evaluated(surface))) == set(PARAMETERS[kind])


def bumpy(rows=4, columns=6):
    random = np.random.default_rng(3)
    return random.normal(size=(rows, columns, 3)).astype(np.float32).astype(np.float64)


@pytest.mark.parametrize("shape", [(2, 2), (4, 6), (3, 2), (33, 17)])
def test_grid_reads_back_exactly(nodes, shape):
    points = bumpy(*shape)
    surface = place(nodes.new_surface("G", "PATCH" if shape == (2, 2) else "GRID", points=points))
    assert np.array_equal(nodes.surface_parameters(evaluated(surface))["points"], points)
    assert len(evaluated(surface).data.polygons) == (shape[0] - 1) * (shape[1] - 1)


def test_blenders_own_grid_reads_back(nodes, pure):
    bpy.ops.mesh.primitive_grid_add(x_subdivisions=5, y_subdivisions=3, size=2)
    surface = bpy.context.object
    surface.scfpf_surface.kind = "GRID"
    points = nodes.surface_parameters(evaluated(surface))["points"]
    assert points.shape == (4, 6, 3)
    x, y = np.meshgrid(np.linspace(-1, 1, 6), np.linspace(-1, 1, 4))
    assert np.allclose(points, np.stack([x, y, 0 * x], 2), atol=1e-6)


def test_grid_is_read_with_its_modifiers_and_shape_keys(nodes):
    points = bumpy()
    surface = place(nodes.new_surface("G", "GRID", points=points))
    surface.shape_key_add(name="Basis")
    key = surface.shape_key_add(name="Up")
    for data in key.data:
        data.co.y += 2
    key.value = 0.5
    hook = bpy.data.objects.new("Hook", None)
    bpy.context.scene.collection.objects.link(hook)
    modifier = surface.modifiers.new("Hook", "HOOK")
    modifier.object = hook
    modifier.vertex_indices_set([0])
    hook.location.z = 3
    read = nodes.surface_parameters(evaluated(surface))["points"]
    expected = points + np.array([0, 1, 0])
    expected[0, 0, 2] += 3
    assert np.allclose(read, expected, atol=1e-5)


def test_grid_is_read_in_edit_mode(nodes):
    import bmesh

    surface = place(nodes.new_surface("G", "GRID", points=bumpy()))
    bpy.context.view_layer.objects.active = surface
    bpy.ops.object.mode_set(mode="EDIT")
    try:
        edited = bmesh.from_edit_mesh(surface.data)
        edited.verts.ensure_lookup_table()
        edited.verts[0].co.z = 7
        bmesh.update_edit_mesh(surface.data)
        assert nodes.surface_parameters(evaluated(surface))["points"][0, 0, 2] == 7
    finally:
        bpy.ops.object.mode_set(mode="OBJECT")


def test_subdivided_grid_stays_a_grid(nodes):
    surface = place(nodes.new_surface("G", "GRID"))
    surface.modifiers.new("Subdivision", "SUBSURF").levels = 2
    assert nodes.surface_parameters(evaluated(surface))["points"].shape == (17, 17, 3)


def break_no_uv(mesh):
    mesh.uv_layers.remove(mesh.uv_layers[0])


def break_loose_vertex(mesh):
    mesh.vertices.add(1)


def break_seam(mesh):
    mesh.uv_layers[0].uv[1].vector.x += 0.01  # a corner whose vertex has two


def break_spacing(mesh):
    for corner in mesh.uv_layers[0].uv:
        corner.vector.x **= 2


def break_scale(mesh):
    for corner in mesh.uv_layers[0].uv:
        corner.vector.x *= 0.5


def break_collapse(mesh):
    for corner in mesh.uv_layers[0].uv:
        corner.vector = 0, 0


@pytest.mark.parametrize(
    ("damage", "message"),
    [
        (break_no_uv, "UV map"),
        (break_loose_vertex, "loose vertices"),
        (break_seam, "seam"),
        (break_spacing, "evenly spaced"),
        (break_scale, "evenly spaced"),
        (break_collapse, "not a regular grid"),
    ],
)
def test_what_is_no_grid_is_named(nodes, damage, message):
    surface = place(nodes.new_surface("Sheet", "GRID", points=bumpy()))
    damage(surface.data)
    surface.data.update()
    with pytest.raises(nodes.UserError, match=f"'Sheet'.*{message}"):
        nodes.surface_parameters(evaluated(surface))


def test_every_input_has_a_tooltip_and_limits(nodes):
    for kind, description in nodes.PARAMETRIC_KINDS.items():
        surface = nodes.new_surface(kind, kind)
        items = surface.modifiers[0].node_group.interface.items_tree
        sockets = [item for item in items if item.in_out == "INPUT"]
        assert [socket.name for socket in sockets] == [given.label for given in description.inputs]
        for socket in sockets:
            assert socket.description and socket.min_value <= socket.default_value <= socket.max_value
            if socket.name in ("Arc", "Latitude Start", "Latitude End"):
                assert socket.subtype == "ANGLE"
