# SPDX-License-Identifier: GPL-3.0-or-later
"""The handles of the parametric kinds: there is one for each parameter, and Blender can trace it back."""

import bpy
import numpy as np
import pytest

HANDLES = {
    "POINT": {},
    "PLANE": {"Width": "Linear", "Height": "Linear"},
    "DISC": {"Radius": "Linear", "Arc": "Dial"},
    "CYLINDER": {"Radius": "Linear", "Arc": "Dial", "Height": "Linear"},
    "CONE": {"Radius Start": "Linear", "Radius End": "Linear", "Arc": "Dial", "Height": "Linear"},
    "SPHERE": {"Radius": "Linear", "Arc": "Dial", "Latitude Start": "Dial", "Latitude End": "Dial"},
    "PARABOLOID": {"Radius": "Linear", "Arc": "Dial", "Depth": "Linear"},
}
# How far along its handle a parameter's edge moves for a unit of the parameter.
HALVES = {("PLANE", "Width"), ("PLANE", "Height"), ("CYLINDER", "Height"), ("CONE", "Height")}
HALVES |= {(kind, "Arc") for kind in ("CYLINDER", "CONE", "SPHERE")}


@pytest.fixture
def nodes(addon):
    return addon("bridge.surfaces.surface_object")


def group_of(nodes, kind):
    return nodes.new_surface("S", kind).modifiers[0].node_group


def gizmos(group):
    return [node for node in group.nodes if node.bl_idname.startswith("GeometryNodeGizmo")]


def trace(socket):
    """The group input that a gizmo's value leads back to, and the share of it that the value is.

    Backwards through Math nodes by their first input, as Blender does it.
    """
    share = 1.0
    while socket.node.bl_idname != "NodeGroupInput":
        assert socket.node.bl_idname == "ShaderNodeMath" and socket.node.operation == "MULTIPLY"
        first, second = socket.node.inputs[:2]
        assert first.is_linked and not second.is_linked
        share *= second.default_value
        socket = first.links[0].from_socket
    return socket.name, share


@pytest.mark.parametrize("kind", HANDLES)
def test_each_parameter_has_a_handle_that_leads_back_to_it(nodes, kind):
    found = {}
    for gizmo in gizmos(group_of(nodes, kind)):
        (link,) = gizmo.inputs["Value"].links
        label, share = trace(link.from_socket)
        assert share == (0.5 if (kind, label) in HALVES else 1.0)
        found[label] = gizmo.bl_idname.removeprefix("GeometryNodeGizmo")
        assert not gizmo.outputs["Transform"].is_linked, "the handle would change the geometry"
    assert found == HANDLES[kind]
    if kind != "POINT":
        assert set(found) == {given.label for given in nodes.PARAMETRIC_KINDS[kind].parameters}


@pytest.mark.parametrize("kind", [kind for kind in HANDLES if kind != "POINT"])
def test_a_handle_stands_on_the_surface_and_goes_with_it(nodes, addon, kind):
    """Position and direction are those of the surface's own derivative by the parameter."""
    description = nodes.PARAMETRIC_KINDS[kind]
    values = {given.key: 0.4 + 0.3 * number for number, given in enumerate(description.parameters)}
    shape = addon("projection.surfaces.kinds").surface_from_parameters
    for gizmo in gizmos(group_of(nodes, kind)):
        if not gizmo.bl_idname.endswith("Linear"):
            continue
        label, share = trace(gizmo.inputs["Value"].links[0].from_socket)
        key = label.lower().replace(" ", "_")
        place = at(gizmo.inputs["Position"], values)
        direction = np.array(gizmo.inputs["Direction"].default_value)
        u = np.array([1.0 if label == "Width" else 0.0 if kind in {"DISC", "PARABOLOID"} else 0.5])
        v = np.array([{"Height": 1.0, "Radius End": 1.0, "Radius Start": 0.0}.get(label, 0.5)])
        if kind in {"DISC", "PARABOLOID"}:
            v[:] = 1.0
        if kind == "SPHERE":
            start, end = values["latitude_start"], values["latitude_end"]
            v[:] = -start / (end - start)  # the equator
        surface, grown = (
            shape(kind, values | {key: value}, None, np.eye(4)).evaluate(u, v).position[:, 0]
            for value in (values[key], values[key] + 1e-3)
        )
        assert np.allclose(place, surface, atol=1e-12)
        assert np.allclose((grown - surface) / 1e-3, share * direction, atol=1e-9)


def at(socket, values):
    """The value of a socket from the group's inputs: Combine XYZ and Math nodes."""
    if not socket.is_linked:
        return socket.default_value
    node = socket.links[0].from_node
    if node.bl_idname == "NodeGroupInput":
        return values[socket.links[0].from_socket.name.lower().replace(" ", "_")]
    given = [at(one, values) for one in node.inputs]
    if node.bl_idname == "ShaderNodeCombineXYZ":
        return np.array(given)
    assert node.operation == "MULTIPLY"
    return given[0] * given[1]


def test_the_parameters_modifier_is_the_active_one(nodes):
    """Blender shows a modifier's handles only while it is the active one."""
    surface = nodes.new_surface("S", "CYLINDER")
    bpy.context.scene.collection.objects.link(surface)
    assert surface.modifiers.active == surface.modifiers[0]
    surface.scfpf_surface.kind = "SPHERE"
    assert surface.modifiers.active == surface.modifiers[0]
