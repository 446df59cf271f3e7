# SPDX-License-Identifier: GPL-3.0-or-later
"""Control surfaces as objects: made, given another kind, their parameters written and read.

A parametric surface is an empty mesh with a node modifier. The modifier's inputs are the only source of its
parameters, so that keyframes and drivers act on the drawn shape and on the image alike. PATCH and GRID are
plain meshes whose UV map puts their vertices in order. UV_MESH is any mesh with a UV map (``uv_mesh`` reads
it). NURBS is a SURFACE object (``nurbs_object``), LATTICE a Lattice object (``lattice_object``).
"""

from __future__ import annotations

import contextlib

import bpy
import numpy as np

from ...projection.surfaces.kinds import surface_from_parameters
from ...projection.surfaces.uv_mesh import UVMesh
from ...projection.user_error import UserError
from ..blender import versions
from ..blender.all_or_nothing import way_back
from ..blender.mesh_grid import checked_grid, grid_points, write_grid
from ..blender.scene_objects import delete_with_data, is_being_edited, object_by_uid
from .kinds import BLENDER_KINDS, MESH_KINDS, OBJECT_KINDS, PARAMETRIC_KINDS
from .surface_groups import group_inputs, surface_group
from .surface_limits import drawn_vertices
from .uv_mesh import write_uv_mesh


def new_surface(name: str | None, kind: str, parameters: dict | None = None, points=None):
    """A new control-surface object, linked to no collection yet.

    name: None for the kind's title. kind: one of ``BLENDER_KINDS``. parameters: lengths in Blender units and
    angles in radians by name (``radius``, ``arc``, ...); missing ones take their defaults. points: (rows,
    columns, 3), own space, for PATCH (2 × 2, default a unit square), GRID and UV_MESH (default 5 × 5), which
    also takes a UVMesh. NURBS also takes 4 numbers, the last a weight (default 4 × 4 points), and the
    parameters order_u and order_v. LATTICE: see ``lattice_object.new_data``.
    Raises UserError for an unknown kind or parameter, or points of a wrong shape.
    """
    if kind not in BLENDER_KINDS:
        raise UserError("Unknown kind of control surface: {0!r}", kind)
    name = name or BLENDER_KINDS[kind].title
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
    except UserError:
        delete_with_data(surface)
        raise
    return surface


def _flat(kind: str):
    """The unit square in the XY plane as a grid of points."""
    line = np.linspace(-0.5, 0.5, 2 if kind == "PATCH" else 5)
    x, y = np.meshgrid(line, line)
    return np.stack([x, y, np.zeros_like(x)], 2)


def take_kind(surface) -> None:
    """Give a surface the node group or mesh that its new ``kind`` needs.

    Between parametric kinds, inputs of the same name keep their values. From a parametric kind to a mesh, the
    mesh gets the surface's shape, or that of a new surface if no mesh can hold it; in Edit Mode it stays what
    the modifier makes.
    """
    kind, own = surface.scfpf_surface.kind, _own_modifier(surface)
    if kind in PARAMETRIC_KINDS and (own is None or own[1] != kind):
        _take_group(surface, kind, own)
    elif kind in MESH_KINDS and own is not None and not is_being_edited(surface):
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
            with contextlib.suppress(UserError):  # a property's change cannot be refused
                points = checked_grid(
                    shape.evaluate(u.ravel(), v.ravel()).position.T.reshape(rows, columns, 3)
                )
        place = list(surface.modifiers).index(modifier)
        way_back(_take_again, surface, place, modifier.name, modifier.node_group, values)
        surface.modifiers.remove(modifier)
        if surface.data.users > 1:
            # Of a linked duplicate (Alt-D): the mesh was empty so far, the other's shape is its modifier's.
            surface.data = surface.data.copy()
        write_grid(surface.data, points)


def _take_again(surface, place: int, name: str, group, values: dict) -> None:
    """Give a surface the node modifier that it had at a place, with its name, group and values by label."""
    modifier = surface.modifiers.new(name, "NODES")
    surface.modifiers.move(len(surface.modifiers) - 1, place)
    modifier.node_group = group
    for label, identifier in group_inputs(group).items():
        versions.set_modifier_input(modifier, identifier, values[label])


def _own_modifier(surface):
    """The modifier that makes a parametric surface of some kind, and that kind; None for a mesh."""
    for modifier in surface.modifiers:
        if modifier.type == "NODES" and modifier.node_group:
            labels = set(group_inputs(modifier.node_group))
            for kind, description in PARAMETRIC_KINDS.items():
                if labels == {given.label for given in description.inputs}:
                    return modifier, kind
    return None


def _input_values(modifier) -> dict:
    return {
        label: versions.modifier_input(modifier, identifier)
        for label, identifier in group_inputs(modifier.node_group).items()
    }


def _take_group(surface, kind: str, own) -> None:
    group = surface_group(kind)
    if own is None:
        before = {}
        modifier = surface.modifiers.new(group.name, "NODES")
        surface.modifiers.move(len(surface.modifiers) - 1, 0)
    else:
        modifier, before = own[0], _input_values(own[0])
        modifier.name = group.name
    modifier.node_group = group
    identifiers = group_inputs(group)
    for given in PARAMETRIC_KINDS[kind].inputs:
        # All of them: Blender keeps values by identifier, which says nothing of what they mean.
        value = before.get(given.label, given.default)
        versions.set_modifier_input(modifier, identifiers[given.label], value)
    surface.update_tag()


def parameter_modifier(surface):
    """A parametric surface's node modifier and its inputs' identifiers by name.

    Its group has exactly the kind's inputs by name. Raises UserError if there is no such modifier.
    """
    own = _own_modifier(surface)
    if own is not None and own[1] == surface.scfpf_surface.kind:
        return own[0], group_inputs(own[0].node_group)
    description = PARAMETRIC_KINDS[surface.scfpf_surface.kind]
    raise UserError(
        "'{0}' has no node group with just the inputs {1}: undo the change to its '{2}' "
        "modifier, or remove the surface and add a new {3}",
        surface.name,
        ", ".join(given.label for given in description.inputs),
        description.group_name,
        description.title,
    )


def parameter_properties(surface) -> list[tuple[str, object, str]]:
    """(label, owner, property) of each input of a parametric surface, for panels and keyframes.

    Empty for a mesh kind. Raises UserError when the node group is gone.
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

    Raises UserError for an unknown name or a value out of its limits; then nothing has changed.
    """
    kind = surface.scfpf_surface.kind
    if kind in OBJECT_KINDS:
        OBJECT_KINDS[kind].write_parameters(surface, parameters)
        return
    if kind in MESH_KINDS:
        if set(parameters) != {"points"}:
            raise UserError(
                "A {0} is given by its points alone, not by {1}",
                BLENDER_KINDS[kind].title,
                sorted(parameters),
            )
        if kind == "PATCH" and np.shape(parameters["points"]) != (2, 2, 3):
            raise UserError("A Patch needs 2 × 2 points")
        write_grid(surface.data, parameters["points"])
        return
    known = {given.key: given for given in PARAMETRIC_KINDS[kind].inputs}
    modifier, identifiers = parameter_modifier(surface)
    taken = {}
    for key, value in parameters.items():
        if key not in known:
            raise UserError("A {0} has no parameter {1!r}", PARAMETRIC_KINDS[kind].title, key)
        given = known[key]
        # The limits as Blender stores them, in float32: 2π read back is above 2π.
        low, high = np.array([given.minimum, given.maximum], np.float32).tolist()
        if not low <= value <= high:
            raise UserError(
                "{0} must lie from {1:g} to {2:g}, not {3:g}",
                given.label,
                given.minimum,
                given.maximum,
                value,
            )
        taken[identifiers[given.label]] = type(given.default)(value)
    for identifier, value in taken.items():
        before = versions.modifier_input(modifier, identifier)
        way_back(_set_again, surface.session_uid, modifier.name, identifier, before)
        versions.set_modifier_input(modifier, identifier, value)
    surface.update_tag()


def _set_again(uid: int, name: str, identifier: str, value) -> None:
    """Set an input of a surface's modifier, unless the block whose way back this is has removed either.

    uid: the surface's session id. Blender does not tell Python of modifiers that are gone, and would crash.
    """
    surface = object_by_uid(uid)
    modifier = None if surface is None else surface.modifiers.get(name)
    group = None if modifier is None or modifier.type != "NODES" else modifier.node_group
    if group is not None and identifier in group_inputs(group).values():
        versions.set_modifier_input(modifier, identifier, value)


def surface_parameters(evaluated_object) -> dict:
    """The parameters of a surface by name, in radians and Blender units, as animated.

    PATCH and GRID answer {"points": (rows, columns, 3) float64}, own space, as does a UV_MESH that is a grid.
    NURBS answers points with weights as a fourth number, order_u and order_v.
    Raises UserError when the node group or the regular grid is gone.
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
    """Return whether modifiers besides the parameters' own act on a parametric surface in a mode."""
    own = parameter_modifier(surface)[0]
    show = "show_render" if mode == "RENDER" else "show_viewport"
    return any(getattr(modifier, show) for modifier in surface.modifiers if modifier != own)
