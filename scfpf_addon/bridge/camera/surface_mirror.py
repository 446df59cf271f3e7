# SPDX-License-Identifier: GPL-3.0-or-later
"""Mirror control surfaces in their parameters: Q(1-u, v) or Q(u, 1-v)."""

from __future__ import annotations

from collections.abc import Callable
from functools import partial

import numpy as np
from mathutils import Matrix

from ...projection.editing.volume_edits import mirrored
from ...projection.user_error import UserError
from ..blender.all_or_nothing import PLACE, keep, keep_whole
from ..blender.rig_mark import has_other_animation
from ..surfaces import lattice_object, nurbs_object
from ..surfaces.kinds import BLENDER_KINDS, MESH_KINDS, PARAMETRIC_KINDS
from ..surfaces.surface_object import set_surface_parameters, surface_parameters
from .flexible_camera import editable_surfaces
from .surface_scale import is_changed_otherwise

# A matrix is sheared, which an object cannot store, if it differs by more from its location, rotation and
# scale. Products of float32 matrices agree to about 1e-6.
SHEAR = 1e-4


def mirror_surfaces(camera, depsgraph, axis: str, indices=None) -> None:
    """Mirror surfaces: Q(1-u, v) for axis "U", Q(u, 1-v) for "V".

    Meshes keep their shape and get their UV map mirrored. Surface patches and lattices get their points in
    reverse order, parametric kinds a negative scale or exchanged ends. Raises
    UserError, before anything is changed, if a surface cannot be mirrored.
    """
    mirrors = [_mirror_of(surface, depsgraph, axis) for surface in editable_surfaces(camera, indices)]
    for mirror in mirrors:
        mirror()


def _mirror_of(surface, depsgraph, axis: str) -> Callable[[], None]:
    """A function that mirrors a surface. Raises the errors of ``mirror_surfaces``."""
    kind = surface.scfpf_surface.kind
    if surface.type != (BLENDER_KINDS[kind].object_type if kind in BLENDER_KINDS else "MESH"):
        raise UserError(
            "'{0}' is of type {1}, not of its kind: choose another kind first",
            surface.name,
            surface.type.title(),
        )
    if kind == nurbs_object.KIND:
        order = nurbs_object.reversed_order(surface, axis)
        return partial(_mirror_net, surface, order, axis)
    if kind == lattice_object.KIND:
        if surface.modifiers or surface.data.shape_keys is not None or has_other_animation(surface):
            raise UserError(
                "'{0}' has modifiers, shape keys or animation that would not be mirrored: apply "
                "or remove them first",
                surface.name,
            )
        return partial(_mirror_lattice, surface, axis)
    if kind in PARAMETRIC_KINDS:
        return _parametric_mirror(surface, depsgraph, axis)
    if kind not in MESH_KINDS:
        raise UserError(
            "'{0}' cannot be mirrored: choose another kind of control surface first", surface.name
        )
    if surface.data.uv_layers.active is None:
        raise UserError("'{0}' has no UV map: unwrap it as a regular grid", surface.name)
    return partial(_mirror_uv, surface, "UV".index(axis))


def _parametric_mirror(surface, depsgraph, axis: str) -> Callable[[], None]:
    kind = surface.scfpf_surface.kind
    if kind == "POINT":
        return lambda: None
    if is_changed_otherwise(surface):
        raise UserError(
            "'{0}' has modifiers or animation that would not be mirrored: convert it to a grid first",
            surface.name,
        )
    parameters = surface_parameters(surface.evaluated_get(depsgraph))
    try:
        matrix, parameters = mirrored(kind, parameters, axis)
    except UserError as error:
        raise UserError("'{0}': {1}", surface.name, error) from error
    placed = surface.matrix_basis @ Matrix(matrix.tolist())
    if not np.allclose(placed, Matrix.LocRotScale(*placed.decompose()), rtol=SHEAR, atol=SHEAR):
        raise UserError(
            "'{0}' is scaled unevenly and cannot be mirrored: apply its scale, or convert it to a grid first",
            surface.name,
        )

    def mirror():
        keep(surface, *PLACE)
        surface.matrix_basis = placed
        set_surface_parameters(surface, parameters)

    return mirror


def _mirror_net(surface, order, axis: str) -> None:
    keep_whole(surface.data)
    nurbs_object.reorder(surface, order, axis)


def _mirror_lattice(surface, axis: str) -> None:
    keep(surface, *PLACE)
    keep_whole(surface.data)
    surface.matrix_basis = surface.matrix_basis @ Matrix(lattice_object.mirror(surface, axis).tolist())


def _mirror_uv(surface, axis: int) -> None:
    if surface.data.users > 1:
        keep(surface, "data")
        surface.data = surface.data.copy()
    else:
        keep_whole(surface.data)
    layer = surface.data.uv_layers.active
    # Setting ``layer.uv`` in Blender 4.5 also changes the mesh's copies and its undo steps.
    uv = surface.data.attributes[layer.name].data
    values = np.empty(2 * len(uv), np.float32)
    uv.foreach_get("vector", values)
    values[axis::2] = 1 - values[axis::2]
    uv.foreach_set("vector", values)
    surface.data.update()
