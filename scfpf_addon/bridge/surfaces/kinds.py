# SPDX-License-Identifier: GPL-3.0-or-later
"""The part of each kind of control surface that needs Blender; the records are in ``projection.surfaces``.

Formulas are nodes: (builder, u, v, the group's inputs by key) → the socket of the position. They are those of
the classes in ``projection.surfaces.surface``.

Handles in the viewport are gizmo nodes: (builder, the group's inputs by key) adds them. Blender traces a
gizmo's value backwards through Math nodes, by their first input, to the modifier's input. Half an extent that
is centred on the origin is the value of its handle, so that the edge stays under the mouse. The gizmos'
geometry outputs stay unlinked: the group makes the same mesh with and without them.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from functools import cached_property
from types import ModuleType

from ...projection.file_values import LARGEST_LENGTH
from ...projection.surfaces.kinds import SURFACE_KINDS, ParametricKind, SurfaceKind
from . import lattice_object, nurbs_object
from .surface_limits import LEAST_FACES, MOST_FACES

# The ring of the lower latitude is this much smaller, so that both can be grasped.
INNER_RING = 0.85

ACROSS, UP, AHEAD, FACING = (1.0, 0.0, 0.0), (0.0, 1.0, 0.0), (0.0, 0.0, -1.0), (0.0, 0.0, 1.0)


@dataclass(frozen=True)
class Input:
    """An input of a surface's node group; ``label`` is the name by which it is found."""

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
class BlenderKind:
    """A kind of control surface in Blender.

    number: of the kind in the property ``kind``, as files store it. icon: in lists. object_type: of its
    objects. module: the functions of a kind that is no mesh: new_data, read_parameters, write_parameters and
    data_properties. Of kinds that a node group makes, display: the inputs that only the drawing needs;
    formula, handles: see above, None for a point.
    """

    record: SurfaceKind
    number: int
    icon: str
    object_type: str = "MESH"
    module: ModuleType | None = None
    display: tuple[Input, ...] = ()
    formula: Callable | None = None
    handles: Callable | None = None

    @property
    def title(self) -> str:
        return self.record.title

    @property
    def group_name(self) -> str:
        return f"SCFPF {self.title}"

    @cached_property
    def parameters(self) -> tuple[Input, ...]:
        """The inputs that define the surface; none if no node group makes it."""
        if not isinstance(self.record, ParametricKind):
            return ()
        return tuple(
            Input(
                label=one.label,
                default=self.record.default(one.name),
                minimum=one.range.low,
                maximum=one.range.high,
                subtype="ANGLE" if one.is_angle else "DISTANCE",
                description=one.text,
            )
            for one in self.record.parameters
        )

    @property
    def inputs(self) -> tuple[Input, ...]:
        return self.parameters + self.display


def _resolution(u: int, v: int) -> tuple[Input, Input]:
    """Faces of the drawn mesh. Multiples of 8: it then has edges, to click, along the volume's lines."""
    text = "Faces of the displayed mesh along {}; pictures use the exact surface unless another modifier acts"
    return (
        Input("Resolution U", u, LEAST_FACES, MOST_FACES, description=text.format("u")),
        Input("Resolution V", v, LEAST_FACES, MOST_FACES, description=text.format("v")),
    )


def _half(nodes, extent, label: str):
    return nodes.math("MULTIPLY", extent, 0.5, label)


def _arrow(nodes, name: str, value, place, direction) -> None:
    """Add a handle that is drawn at ``place`` (x, y, z: numbers or sockets) and moves along ``direction``."""
    color = "XYZ"[max(range(3), key=lambda axis: abs(direction[axis]))]
    position = nodes.vector(*place, f"{name} Handle Position")
    inputs = {"Value": value, "Position": position, "Direction": direction}
    nodes.node("GeometryNodeGizmoLinear", f"{name} Handle", inputs, color_id=color)


def _dial(nodes, name: str, value, axis, radius, color: str) -> None:
    """Add a ring about the origin; turning it about ``axis``, right-handed, adds to ``value``."""
    inputs = {"Value": value, "Up": axis, "Screen Space": False, "Radius": radius}
    nodes.node("GeometryNodeGizmoDial", f"{name} Handle", inputs, color_id=color)


def _about_y(nodes, u, radius, y, arc, label):
    """The position after a turn about +Y at a radius, with -Z in the middle of the arc."""
    angle = nodes.centred(u, arc, "Angle")
    back = nodes.math("MULTIPLY", radius, nodes.math("COSINE", angle))
    return nodes.vector(
        nodes.math("MULTIPLY", radius, nodes.math("SINE", angle), "X"),
        y,
        nodes.math("MULTIPLY", back, -1.0, "Z"),
        label,
    )


def _arc_about_y(nodes, given, radius) -> None:
    down = (0.0, -1.0, 0.0)  # from straight ahead towards the end at u = 1
    _dial(nodes, "Arc", _half(nodes, given["arc"], "Half Arc"), down, radius, "PRIMARY")


def _ahead(nodes, radius, name: str):
    """The z of a point that is ``radius`` straight ahead."""
    return nodes.math("MULTIPLY", radius, -1.0, f"{name} Ahead")


def _plane(nodes, u, v, given):
    return nodes.vector(
        nodes.centred(u, given["width"], "X"), nodes.centred(v, given["height"], "Y"), 0.0, "Plane"
    )


def _plane_handles(nodes, given) -> None:
    x, y = _half(nodes, given["width"], "Half Width"), _half(nodes, given["height"], "Half Height")
    _arrow(nodes, "Width", x, (x, 0.0, 0.0), ACROSS)
    _arrow(nodes, "Height", y, (0.0, y, 0.0), UP)


def _disc(nodes, u, v, given):
    angle = nodes.math("MULTIPLY", u, given["arc"], "Angle")
    radius = nodes.math("MULTIPLY", v, given["radius"], "Radius Here")
    return nodes.vector(
        nodes.math("MULTIPLY", radius, nodes.math("COSINE", angle), "X"),
        nodes.math("MULTIPLY", radius, nodes.math("SINE", angle), "Y"),
        0.0,
        "Disk",
    )


def _disc_handles(nodes, given) -> None:
    _arrow(nodes, "Radius", given["radius"], (given["radius"], 0.0, 0.0), ACROSS)
    _dial(nodes, "Arc", given["arc"], FACING, given["radius"], "PRIMARY")


def _dish(nodes, u, v, given):
    disc = nodes.node("ShaderNodeSeparateXYZ", "Disk", {"Vector": _disc(nodes, u, v, given)})
    rise = nodes.math("MULTIPLY", nodes.math("MULTIPLY", v, v), given["depth"], "Z")
    return nodes.vector(disc.outputs["X"], disc.outputs["Y"], rise, "Paraboloid")


def _dish_handles(nodes, given) -> None:
    _arrow(nodes, "Radius", given["radius"], (given["radius"], 0.0, given["depth"]), ACROSS)
    _arrow(nodes, "Depth", given["depth"], (given["radius"], 0.0, given["depth"]), FACING)
    _dial(nodes, "Arc", given["arc"], FACING, given["radius"], "PRIMARY")


def _cylinder(nodes, u, v, given):
    y = nodes.centred(v, given["height"], "Y")
    return _about_y(nodes, u, given["radius"], y, given["arc"], "Cylinder")


def _cylinder_handles(nodes, given) -> None:
    z = _ahead(nodes, given["radius"], "Radius")
    y = _half(nodes, given["height"], "Half Height")
    _arrow(nodes, "Radius", given["radius"], (0.0, 0.0, z), AHEAD)
    _arrow(nodes, "Height", y, (0.0, y, z), UP)
    _arc_about_y(nodes, given, given["radius"])


def _cone(nodes, u, v, given):
    radius = nodes.between(given["radius_start"], given["radius_end"], v, "Radius Here")
    y = nodes.centred(v, given["height"], "Y")
    return _about_y(nodes, u, radius, y, given["arc"], "Cone")


def _cone_handles(nodes, given) -> None:
    start, end = (
        _ahead(nodes, given[f"radius_{which}"], f"Radius {which.title()}") for which in ("start", "end")
    )
    y = _half(nodes, given["height"], "Half Height")
    below = nodes.math("MULTIPLY", y, -1.0, "Lower Edge")
    _arrow(nodes, "Radius Start", given["radius_start"], (0.0, below, start), AHEAD)
    _arrow(nodes, "Radius End", given["radius_end"], (0.0, y, end), AHEAD)
    _arrow(nodes, "Height", y, (0.0, y, end), UP)
    widest = nodes.math("MAXIMUM", given["radius_start"], given["radius_end"], "Widest")
    _arc_about_y(nodes, given, widest)


def _sphere(nodes, u, v, given):
    latitude = nodes.between(given["latitude_start"], given["latitude_end"], v, "Latitude")
    radius = nodes.math("MULTIPLY", given["radius"], nodes.math("COSINE", latitude), "Radius Here")
    y = nodes.math("MULTIPLY", given["radius"], nodes.math("SINE", latitude), "Y")
    return _about_y(nodes, u, radius, y, given["arc"], "Sphere")


def _sphere_handles(nodes, given) -> None:
    z = _ahead(nodes, given["radius"], "Radius")
    _arrow(nodes, "Radius", given["radius"], (0.0, 0.0, z), AHEAD)
    _arc_about_y(nodes, given, given["radius"])
    inner = nodes.math("MULTIPLY", given["radius"], INNER_RING, "Inner Ring")
    _dial(nodes, "Latitude Start", given["latitude_start"], ACROSS, inner, "SECONDARY")
    _dial(nodes, "Latitude End", given["latitude_end"], ACROSS, given["radius"], "SECONDARY")


def _blender_kind(key: str, number: int, icon: str, **settings) -> BlenderKind:
    return BlenderKind(SURFACE_KINDS[key], number, icon, **settings)


_SIZE = Input(
    label="Size",
    default=0.1,
    minimum=0.0,
    maximum=LARGEST_LENGTH,
    subtype="DISTANCE",
    description="Length of the drawn cross's arms; a point has no size",
)
_ROUND, _BALL = _resolution(32, 8), _resolution(32, 16)
# In the order of the records, which is that of menus.
BLENDER_KINDS = {
    kind.record.key: kind
    for kind in (
        _blender_kind("POINT", 1, "DOT", display=(_SIZE,)),
        _blender_kind(
            "PLANE", 2, "MESH_PLANE", display=_resolution(8, 8), formula=_plane, handles=_plane_handles
        ),
        _blender_kind("PATCH", 3, "SURFACE_DATA"),
        _blender_kind("DISC", 4, "MESH_CIRCLE", display=_ROUND, formula=_disc, handles=_disc_handles),
        _blender_kind(
            "CYLINDER", 5, "MESH_CYLINDER", display=_ROUND, formula=_cylinder, handles=_cylinder_handles
        ),
        _blender_kind("CONE", 6, "MESH_CONE", display=_ROUND, formula=_cone, handles=_cone_handles),
        _blender_kind("SPHERE", 7, "MESH_UVSPHERE", display=_BALL, formula=_sphere, handles=_sphere_handles),
        _blender_kind(
            "PARABOLOID",
            12,
            "SURFACE_NSPHERE",
            display=_BALL,
            formula=_dish,
            handles=_dish_handles,
        ),
        _blender_kind("GRID", 8, "MESH_GRID"),
        _blender_kind("UV_MESH", 9, "UV"),
        _blender_kind("NURBS", 10, "SURFACE_NSURFACE", object_type="SURFACE", module=nurbs_object),
        _blender_kind("LATTICE", 11, "MOD_LATTICE", object_type="LATTICE", module=lattice_object),
    )
}
# Kinds that a node group makes, plain meshes, and objects of a type of their own.
PARAMETRIC_KINDS = {
    key: kind for key, kind in BLENDER_KINDS.items() if isinstance(kind.record, ParametricKind)
}
OBJECT_KINDS = {key: kind.module for key, kind in BLENDER_KINDS.items() if kind.module is not None}
MESH_KINDS = BLENDER_KINDS.keys() - PARAMETRIC_KINDS.keys() - OBJECT_KINDS.keys()


# The items of the menus of kinds, without and with that of other objects.
KIND_ITEMS = tuple((key, kind.title, kind.record.text, kind.number) for key, kind in BLENDER_KINDS.items())
KINDS_OR_NONE = (("NONE", "None", "No control surface", 0), *KIND_ITEMS)


def icon_of(surface) -> str:
    """The icon of an object on a camera's list, of whatever kind."""
    kind = surface.scfpf_surface.kind
    return BLENDER_KINDS[kind].icon if kind in BLENDER_KINDS else "MESH_DATA"
