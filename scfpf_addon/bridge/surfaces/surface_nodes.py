# SPDX-License-Identifier: GPL-3.0-or-later
"""Control surfaces as objects: one Geometry-Nodes group a parametric kind, or a mesh grid.

A parametric surface is an empty mesh with a node modifier. The modifier's inputs
are the only source of its parameters, so keyframes and drivers act on the
drawn shape and on the picture alike. PATCH and GRID are plain meshes whose
vertices are put in order by their UV map; UV_MESH is any mesh that has one
(``uv_mesh.py`` reads it). NURBS is a SURFACE object
(``nurbs_object``), LATTICE a Lattice object (``lattice_object``).
"""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import dataclass

import bpy
import numpy as np

from ...projection.file_values import LARGEST_LENGTH
from ...projection.presets.preset import surface_from_parameters
from ...projection.surfaces import surface
from ...projection.surfaces.uv_mesh import UVMesh
from ..blender import versions
from ..blender.mesh_grid import UV_LAYER, SurfaceError, grid_points, write_grid
from ..blender.node_builder import NodeBuilder
from ..blender.scene_objects import delete_with_data
from . import lattice_object, nurbs_object
from .gizmos import add_gizmos
from .shape_attributes import store_shape
from .surface_limits import LEAST_FACES, MOST_FACES, drawn_vertices, vertices_along
from .uv_mesh import write_uv_mesh

# Kinds that are plain meshes, with their titles.
MESH_KINDS = {"PATCH": "Patch", "GRID": "Grid", "UV_MESH": "UV Mesh"}
# Kinds that are objects of a type of their own, with the modules that know them.
OBJECT_KINDS = {module.KIND: module for module in (nurbs_object, lattice_object)}


@dataclass(frozen=True)
class Input:
    """One input of a surface's node group; ``label`` is the name that it is found by."""

    label: str
    default: float
    minimum: float
    maximum: float
    subtype: str = "NONE"
    description: str = ""

    @property
    def key(self) -> str:
        return self.label.lower().replace(" ", "_")

    @property
    def socket_type(self) -> str:
        return "NodeSocketInt" if isinstance(self.default, int) else "NodeSocketFloat"


@dataclass(frozen=True)
class ParametricKind:
    """A kind whose shape follows from numbers.

    parameters: what defines the surface. display: what only its drawing needs.
    shape: (nodes, u, v, group inputs by key) -> position socket.
    """

    title: str
    parameters: tuple[Input, ...]
    display: tuple[Input, ...]
    shape: Callable

    @property
    def group_name(self) -> str:
        return f"SCFPF {self.title}"

    @property
    def inputs(self) -> tuple[Input, ...]:
        return self.parameters + self.display


def _length(label: str, default: float, description: str) -> Input:
    return Input(label, default, 0.0, LARGEST_LENGTH, "DISTANCE", description)


def _arc(default: float) -> Input:
    return Input("Arc", default, 0.0, 2 * math.pi, "ANGLE", "How far the surface turns as u goes from 0 to 1")


def _latitude(label: str, default: float, description: str) -> Input:
    return Input(label, default, -math.pi / 2, math.pi / 2, "ANGLE", description)


# Multiples of 8 by default: the mesh has edges, which can be clicked, where lines of the volume are drawn.
def _resolution(u: int, v: int) -> tuple[Input, Input]:
    text = "Faces of the displayed mesh along {}; pictures use the exact surface unless another modifier acts"
    return (
        Input("Resolution U", u, LEAST_FACES, MOST_FACES, description=text.format("u")),
        Input("Resolution V", v, LEAST_FACES, MOST_FACES, description=text.format("v")),
    )


def _plane(nodes, u, v, given):
    return nodes.vector(
        nodes.centred(u, given["width"], "X"), nodes.centred(v, given["height"], "Y"), 0.0, "Plane"
    )


def _disc(nodes, u, v, given):
    angle = nodes.math("MULTIPLY", u, given["arc"], "Angle")
    radius = nodes.math("MULTIPLY", v, given["radius"], "Radius Here")
    return nodes.vector(
        nodes.math("MULTIPLY", radius, nodes.math("COSINE", angle), "X"),
        nodes.math("MULTIPLY", radius, nodes.math("SINE", angle), "Y"),
        0.0,
        "Disk",
    )


def _about_y(nodes, u, radius, y, arc, label):
    """Turned about +Y at a radius, -Z in the middle of the arc."""
    angle = nodes.centred(u, arc, "Angle")
    back = nodes.math("MULTIPLY", radius, nodes.math("COSINE", angle))
    return nodes.vector(
        nodes.math("MULTIPLY", radius, nodes.math("SINE", angle), "X"),
        y,
        nodes.math("MULTIPLY", back, -1.0, "Z"),
        label,
    )


def _cylinder(nodes, u, v, given):
    y = nodes.centred(v, given["height"], "Y")
    return _about_y(nodes, u, given["radius"], y, given["arc"], "Cylinder")


def _cone(nodes, u, v, given):
    radius = nodes.between(given["radius_start"], given["radius_end"], v, "Radius Here")
    y = nodes.centred(v, given["height"], "Y")
    return _about_y(nodes, u, radius, y, given["arc"], "Cone")


def _sphere(nodes, u, v, given):
    latitude = nodes.between(given["latitude_start"], given["latitude_end"], v, "Latitude")
    radius = nodes.math("MULTIPLY", given["radius"], nodes.math("COSINE", latitude), "Radius Here")
    y = nodes.math("MULTIPLY", given["radius"], nodes.math("SINE", latitude), "Y")
    return _about_y(nodes, u, radius, y, given["arc"], "Sphere")


_RADIUS = "Distance from the axis or center"
_HEIGHT = "Extent along the axis as v goes from 0 to 1"

# The defaults are those of the classes in projection.surfaces.
PARAMETRIC_KINDS = {
    "POINT": ParametricKind(
        "Point", (), (_length("Size", 0.1, "Length of the drawn cross's arms; a point has no size"),), None
    ),
    "PLANE": ParametricKind(
        "Plane",
        (
            _length("Width", surface.Plane.width, "Extent along X as u goes from 0 to 1"),
            _length("Height", surface.Plane.height, "Extent along Y as v goes from 0 to 1"),
        ),
        _resolution(8, 8),
        _plane,
    ),
    "DISC": ParametricKind(
        "Disk",
        (
            _length("Radius", surface.Disc.radius, "Distance from the center at v = 1"),
            _arc(surface.Disc.arc),
        ),
        _resolution(32, 8),
        _disc,
    ),
    "CYLINDER": ParametricKind(
        "Cylinder",
        (
            _length("Radius", surface.Cylinder.radius, _RADIUS),
            _arc(surface.Cylinder.arc),
            _length("Height", surface.Cylinder.height, _HEIGHT),
        ),
        _resolution(32, 8),
        _cylinder,
    ),
    "CONE": ParametricKind(
        "Cone",
        (
            _length("Radius Start", surface.Cone.radius_start, "Distance from the axis at v = 0"),
            _length("Radius End", surface.Cone.radius_end, "Distance from the axis at v = 1"),
            _arc(surface.Cone.arc),
            _length("Height", surface.Cone.height, _HEIGHT),
        ),
        _resolution(32, 8),
        _cone,
    ),
    "SPHERE": ParametricKind(
        "Sphere",
        (
            _length("Radius", surface.SphereSector.radius, _RADIUS),
            _arc(surface.SphereSector.arc),
            _latitude("Latitude Start", surface.SphereSector.latitude_start, "Latitude at v = 0"),
            _latitude("Latitude End", surface.SphereSector.latitude_end, "Latitude at v = 1"),
        ),
        _resolution(32, 16),
        _sphere,
    ),
}


def _group_inputs(group) -> dict[str, str]:
    """Identifiers of a node group's inputs by name."""
    return {
        item.name: item.identifier
        for item in group.interface.items_tree
        if item.item_type == "SOCKET" and item.in_out == "INPUT"
    }


def _build_point(nodes, given):
    """A cross of three lines through the origin."""
    arms = []
    half = nodes.math("MULTIPLY", given["size"], -0.5, "Start")
    for axis in range(3):
        start, offset = ([size if i == axis else 0.0 for i in range(3)] for size in (half, given["size"]))
        line = {
            "Count": 2,
            "Start Location": nodes.vector(*start, "Start of " + "XYZ"[axis]),
            "Offset": nodes.vector(*offset, "Length of " + "XYZ"[axis]),
        }
        arms.append(nodes.node("GeometryNodeMeshLine", "Arm " + "XYZ"[axis], line).outputs["Mesh"])
    nodes.close_frame()
    join = nodes.node("GeometryNodeJoinGeometry", "Cross", {})
    for arm in arms:
        nodes.tree.links.new(arm, join.inputs["Geometry"])
    return join.outputs["Geometry"]


def _build_sheet(nodes, shape, given):
    """A grid in UV, moved onto the surface, with its UV map."""
    nodes.open_frame("Grid in UV")
    count = {f"Vertices {axis}": vertices_along(nodes, given, key) for axis, key in (("X", "u"), ("Y", "v"))}
    grid = nodes.node("GeometryNodeMeshGrid", "Grid", count)
    uv = nodes.node("ShaderNodeSeparateXYZ", "u, v", {"Vector": grid.outputs["UV Map"]})
    nodes.open_frame("Position at u, v")
    position = shape(nodes, uv.outputs["X"], uv.outputs["Y"], given)
    nodes.open_frame("Mesh with UV map")
    moved = nodes.node(
        "GeometryNodeSetPosition",
        "Onto the Surface",
        {"Geometry": grid.outputs["Mesh"], "Position": position},
    )
    stored = nodes.node(
        "GeometryNodeStoreNamedAttribute",
        "UV Map",
        {"Geometry": moved.outputs["Geometry"], "Name": UV_LAYER, "Value": grid.outputs["UV Map"]},
        data_type="FLOAT2",
        domain="CORNER",
    )
    return stored.outputs["Geometry"]


def _surface_group(kind: str):
    """The node group of a parametric kind: the file's own if it is whole, else a new one."""
    description = PARAMETRIC_KINDS[kind]
    labels = [given.label for given in description.inputs]
    existing = bpy.data.node_groups.get((description.group_name, None))
    if existing and existing.bl_idname == "GeometryNodeTree" and list(_group_inputs(existing)) == labels:
        return existing
    tree = bpy.data.node_groups.new(description.group_name, "GeometryNodeTree")
    tree.is_modifier = True
    tree.description = f"The control surface {description.title} of a flexible camera"
    tree.interface.new_socket("Mesh", in_out="OUTPUT", socket_type="NodeSocketGeometry")
    for given in description.inputs:
        socket = tree.interface.new_socket(
            given.label, description=given.description, in_out="INPUT", socket_type=given.socket_type
        )
        socket.subtype = given.subtype
        socket.min_value, socket.max_value = given.minimum, given.maximum
        socket.default_value = given.default
    nodes = NodeBuilder(tree)
    source = nodes.node("NodeGroupInput", "Parameters", {})
    given = {one.key: source.outputs[one.label] for one in description.inputs}
    mesh = _build_sheet(nodes, description.shape, given) if description.shape else _build_point(nodes, given)
    mesh = store_shape(nodes, kind, [one.key for one in description.parameters], mesh, given)
    nodes.close_frame()
    nodes.node("NodeGroupOutput", "Surface", {"Mesh": mesh})
    add_gizmos(nodes, kind, given)
    return tree


def new_surface(name: str, kind: str, parameters: dict | None = None, points=None):
    """A new control-surface object, linked to no collection yet.

    kind: one of ``PARAMETRIC_KINDS`` or ``MESH_KINDS``, NURBS or LATTICE. parameters: lengths in
    Blender units and angles in radians by name (``radius``, ``arc``, ...); what
    is missing takes its default. points: (rows, columns, 3), own space, for
    PATCH (2 × 2, default a unit square), GRID and UV_MESH (default 5 × 5), which takes a
    UVMesh as well; NURBS takes 4
    numbers as well, the last a weight (default 4 × 4), and the parameters order_u and order_v.
    LATTICE: see ``lattice_object.new_data``.
    Raises SurfaceError for an unknown kind or parameter, or points of a wrong shape.
    """
    if kind not in PARAMETRIC_KINDS and kind not in MESH_KINDS and kind not in OBJECT_KINDS:
        raise SurfaceError(f"Unknown kind of control surface: {kind!r}")
    if kind in OBJECT_KINDS:
        data = OBJECT_KINDS[kind].new_data(name, points, parameters or {})
    else:
        data = bpy.data.meshes.new(name)
    surface = bpy.data.objects.new(name, data)
    surface.scfpf_surface.kind = kind  # its update callback adds the node group
    surface.scfpf_surface.is_made = True
    surface.display_type = "WIRE"
    surface.hide_render = True
    try:
        if kind in PARAMETRIC_KINDS:
            set_surface_parameters(surface, parameters or {})
        elif isinstance(points, UVMesh):
            write_uv_mesh(data, points)
        elif kind in MESH_KINDS:
            set_surface_parameters(surface, {"points": _flat(kind) if points is None else points})
    except SurfaceError:
        delete_with_data(surface)
        raise
    return surface


def _flat(kind: str):
    """The unit square in the XY plane as a grid of points."""
    line = np.linspace(-0.5, 0.5, 2 if kind == "PATCH" else 5)
    x, y = np.meshgrid(line, line)
    return np.stack([x, y, np.zeros_like(x)], 2)


def take_kind(surface) -> None:
    """Give a surface whose ``kind`` was just set what the kind needs.

    From one parametric kind to another, inputs of the same name keep their
    values; from a parametric kind to a mesh, the mesh gets the surface's shape.
    """
    kind, own = surface.scfpf_surface.kind, _own_modifier(surface)
    if kind in PARAMETRIC_KINDS and (own is None or own[1] != kind):
        _take_group(surface, kind, own)
    elif kind in MESH_KINDS and own is not None:
        modifier, before = own
        values = _input_values(modifier)
        points = _flat(kind)
        if before != "POINT":
            columns, rows = (
                2 if kind == "PATCH" else drawn_vertices(values[f"Resolution {axis}"]) for axis in "UV"
            )
            parameters = {given.key: values[given.label] for given in PARAMETRIC_KINDS[before].parameters}
            u, v = np.meshgrid(np.linspace(0, 1, columns), np.linspace(0, 1, rows))
            shape = surface_from_parameters(before, parameters, None, np.eye(4))
            points = shape.evaluate(u.ravel(), v.ravel()).position.T.reshape(rows, columns, 3)
        surface.modifiers.remove(modifier)
        if surface.data.users > 1:
            # Of a linked duplicate (Alt-D): the mesh was empty so far, the other's shape is its modifier's.
            surface.data = surface.data.copy()
        write_grid(surface.data, points)


def _own_modifier(surface):
    """The modifier that makes a parametric surface of some kind, and that kind; None for a mesh."""
    for modifier in surface.modifiers:
        if modifier.type == "NODES" and modifier.node_group:
            labels = set(_group_inputs(modifier.node_group))
            for kind, description in PARAMETRIC_KINDS.items():
                if labels == {given.label for given in description.inputs}:
                    return modifier, kind
    return None


def _input_values(modifier) -> dict:
    return {
        label: versions.modifier_input(modifier, identifier)
        for label, identifier in _group_inputs(modifier.node_group).items()
    }


def _take_group(surface, kind: str, own) -> None:
    group = _surface_group(kind)
    if own is None:
        before = {}
        modifier = surface.modifiers.new(group.name, "NODES")
        surface.modifiers.move(len(surface.modifiers) - 1, 0)
    else:
        modifier, before = own[0], _input_values(own[0])
        modifier.name = group.name
    modifier.node_group = group
    identifiers = _group_inputs(group)
    for given in PARAMETRIC_KINDS[kind].inputs:
        # All of them: Blender keeps values by identifier, which says nothing of what they mean.
        value = before.get(given.label, given.default)
        versions.set_modifier_input(modifier, identifiers[given.label], value)
    surface.update_tag()


def parameter_modifier(surface):
    """A parametric surface's node modifier and its inputs' identifiers by name.

    Its group has the kind's inputs by name, no more and no fewer. Raises SurfaceError when there is none.
    """
    own = _own_modifier(surface)
    if own is not None and own[1] == surface.scfpf_surface.kind:
        return own[0], _group_inputs(own[0].node_group)
    description = PARAMETRIC_KINDS[surface.scfpf_surface.kind]
    raise SurfaceError(
        f"'{surface.name}' has no node group with just the inputs "
        f"{', '.join(given.label for given in description.inputs)}: undo the change to its "
        f"'{description.group_name}' modifier, or remove the surface and add a new {description.title}"
    )


def parameter_properties(surface) -> list[tuple[str, object, str]]:
    """(label, owner, property) of each input of a parametric surface, for panels and keyframes.

    Empty for a mesh kind. Raises SurfaceError when the node group is gone.
    """
    if surface.scfpf_surface.kind in OBJECT_KINDS:
        return OBJECT_KINDS[surface.scfpf_surface.kind].data_properties(surface)
    description = PARAMETRIC_KINDS.get(surface.scfpf_surface.kind)
    if description is None:
        return []
    modifier, identifiers = parameter_modifier(surface)
    return [
        (given.label, *versions.modifier_input_property(modifier, identifiers[given.label]))
        for given in description.inputs
    ]


def set_surface_parameters(surface, parameters: dict) -> None:
    """Write parameters by name: those of the kind, those of its drawing, or ``points`` of a mesh kind.

    Raises SurfaceError for an unknown name or a value out of its limits; then nothing has changed.
    """
    kind = surface.scfpf_surface.kind
    if kind in OBJECT_KINDS:
        OBJECT_KINDS[kind].write_parameters(surface, parameters)
        return
    if kind in MESH_KINDS:
        if set(parameters) != {"points"}:
            raise SurfaceError(
                f"A {MESH_KINDS[kind]} is given by its points alone, not by {sorted(parameters)}"
            )
        if kind == "PATCH" and np.shape(parameters["points"]) != (2, 2, 3):
            raise SurfaceError("A Patch needs 2 × 2 points")
        write_grid(surface.data, parameters["points"])
        return
    known = {given.key: given for given in PARAMETRIC_KINDS[kind].inputs}
    modifier, identifiers = parameter_modifier(surface)
    taken = {}
    for key, value in parameters.items():
        if key not in known:
            raise SurfaceError(f"A {PARAMETRIC_KINDS[kind].title} has no parameter {key!r}")
        given = known[key]
        # The limits as Blender stores them, in float32: 2π read back is above 2π.
        low, high = np.array([given.minimum, given.maximum], np.float32).tolist()
        if not low <= value <= high:
            raise SurfaceError(
                f"{given.label} must lie from {given.minimum:g} to {given.maximum:g}, not {value:g}"
            )
        taken[identifiers[given.label]] = type(given.default)(value)
    for identifier, value in taken.items():
        versions.set_modifier_input(modifier, identifier, value)
    surface.update_tag()


def surface_parameters(evaluated_object) -> dict:
    """What defines a surface: parameters by name in radians and Blender units, as animated.

    PATCH and GRID answer {"points": (rows, columns, 3) float64}, own space, as does a UV_MESH
    that is a grid; NURBS with weights as a fourth number and order_u and order_v beside.
    Raises SurfaceError when the node group or the regular grid is gone.
    """
    kind = evaluated_object.scfpf_surface.kind
    if kind in OBJECT_KINDS:
        return OBJECT_KINDS[kind].read_parameters(evaluated_object)
    description = PARAMETRIC_KINDS.get(kind)
    if description is None:
        return {"points": grid_points(evaluated_object)}
    if not description.parameters:
        return {}
    modifier, identifiers = parameter_modifier(evaluated_object)
    return {
        given.key: float(versions.modifier_input(modifier, identifiers[given.label]))
        for given in description.parameters
    }


def is_reshaped(surface, mode: str) -> bool:
    """Whether other modifiers than the parameters' act on a parametric surface in VIEWPORT or RENDER."""
    own = parameter_modifier(surface)[0]
    show = "show_render" if mode == "RENDER" else "show_viewport"
    return any(getattr(modifier, show) for modifier in surface.modifiers if modifier != own)
