# SPDX-License-Identifier: GPL-3.0-or-later
"""The scale of parametric control surfaces: their sizes in the world, and how to turn a scale into sizes.

A surface's sizes are inputs of its node group. The scale of its object, of its parent inverse and of its
parents multiply them.
"""

from __future__ import annotations

import math

import numpy as np
from mathutils import Matrix

from ...projection.editing.volume_edits import scaled
from ...projection.file_values import LARGEST_LENGTH
from ...projection.typing import Array
from ...projection.user_error import UserError
from ..blender.all_or_nothing import PLACE, keep
from ..blender.rig_mark import has_other_animation
from ..surfaces.kinds import PARAMETRIC_KINDS
from ..surfaces.surface_object import is_reshaped, set_surface_parameters, surface_parameters
from .flexible_camera import editable_surfaces

# A scale that differs from 1 by less counts as 1. Float32 products of rotations are exact to about 1e-6, and
# in an image of 16,384 pixels this share is a sixth of a pixel.
NO_SCALE = 1e-5
# A matrix whose axes' cosines exceed this is sheared.
SHEAR = 1e-4


def whole_scale(surface) -> Array:
    """(3,) > 0: the lengths of a surface's own axes in the world, with parents and constraints."""
    lengths: Array = np.linalg.norm(np.array(surface.matrix_world, np.float64)[:3, :3], axis=0)
    return lengths


def is_scaled(surface) -> bool:
    """Return whether the sizes of a parametric surface differ from its sizes in the world."""
    is_parametric = surface.scfpf_surface.kind in PARAMETRIC_KINDS
    return is_parametric and bool(np.abs(whole_scale(surface) - 1.0).max() > NO_SCALE)


def world_sizes(surface) -> list[tuple[str, float]]:
    """The lengths of a parametric surface in the world, (label, Blender units).

    Raises UserError if its scale changes its kind, such as a sphere into an ellipsoid, and UserError
    if its node group is gone.
    """
    kind = PARAMETRIC_KINDS[surface.scfpf_surface.kind]
    sizes = scaled(surface.scfpf_surface.kind, surface_parameters(surface), whole_scale(surface))
    return [(given.label, sizes[given.key]) for given in kind.parameters if given.subtype == "DISTANCE"]


def is_changed_otherwise(surface) -> bool:
    """Return whether modifiers or animation act on a parametric surface, besides its node group's."""
    reshaped = is_reshaped(surface, "VIEWPORT") or is_reshaped(surface, "RENDER")
    return reshaped or has_other_animation(surface)


def _is_fixed(surface) -> bool:
    """Return whether a parametric surface's scale can become sizes, as nothing else acts on either."""
    return not (is_changed_otherwise(surface) or any(not c.mute for c in surface.constraints))


def apply_scale(camera, index: int) -> None:
    """Turn the whole scale of a parametric surface into its sizes; only signs are left. Nothing moves.

    That includes the scale of its parents and of the parent inverse, which then undoes the parents'.
    Blender's own Apply Scale cannot do that: without its modifier the surface's mesh is empty. Raises
    UserError, before anything is changed.
    """
    (surface,) = editable_surfaces(camera, [index])
    factors = whole_scale(surface)
    parameters = _scaled_parameters(surface, factors)
    keep(surface, *PLACE, "delta_scale", "matrix_parent_inverse")
    set_surface_parameters(surface, parameters)
    before = np.array(surface.matrix_basis, np.float64)
    surface.scale = [
        math.copysign(1.0, factor * delta)
        for factor, delta in zip(surface.scale, surface.delta_scale, strict=True)
    ]
    surface.delta_scale = 1.0, 1.0, 1.0
    own = np.diag([*factors, 1.0])
    after = np.array(surface.matrix_basis, np.float64)
    left = before @ np.linalg.inv(own) @ np.linalg.inv(after)
    if surface.parent is not None and np.abs(left - np.eye(4)).max() > NO_SCALE:
        inverse = np.array(surface.matrix_parent_inverse, np.float64)
        surface.matrix_parent_inverse = Matrix((inverse @ left).tolist())
    _keep_children(surface, own)


def _scaled_parameters(surface, factors: Array) -> dict[str, float]:
    """The parameters of a surface whose scale can become sizes. Raises UserError."""
    kind = surface.scfpf_surface.kind
    if kind not in PARAMETRIC_KINDS:
        raise UserError("'{0}' has points: apply its scale with Object > Apply > Scale", surface.name)
    if not _is_fixed(surface):
        raise UserError(
            "'{0}' has modifiers, constraints or animation, which another scale would change: "
            "convert it to a grid first",
            surface.name,
        )
    try:
        parameters = scaled(kind, surface_parameters(surface), factors)
    except UserError as error:
        raise UserError("'{0}': {1}", surface.name, error) from error
    if factors.min() == 0.0:
        raise UserError("'{0}' has a scale of 0: clear it with Alt-S", surface.name)
    axes = np.array(surface.matrix_world, np.float64)[:3, :3] / factors
    if np.abs(axes.T @ axes - np.eye(3)).max() > SHEAR:
        raise UserError(
            "'{0}' is sheared, as its parents are scaled unevenly: convert it to a grid first", surface.name
        )
    return parameters


def grow(surface, factor: float) -> bool:
    """Scale a child of a camera about the camera by a factor > 0, in its location and its sizes.

    Returns whether that was possible. If the surface is not parametric, or other things act on it, nothing
    has changed.
    """
    kind = surface.scfpf_surface.kind
    if kind not in PARAMETRIC_KINDS or not _is_fixed(surface):
        return False
    sizes = scaled(kind, surface_parameters(surface), [factor] * 3)
    if max(sizes.values(), default=0.0) > LARGEST_LENGTH:
        return False
    keep(surface, "location", "matrix_parent_inverse")
    set_surface_parameters(surface, sizes)
    place = surface.matrix_basis.translation
    surface.location = factor * place - surface.delta_location
    inverse = surface.matrix_parent_inverse.copy()
    inverse.translation = factor * inverse.translation
    surface.matrix_parent_inverse = inverse
    _keep_children(surface, np.diag([factor, factor, factor, 1.0]))
    return True


def _keep_children(surface, own: Array) -> None:
    """Keep the children of a surface in place when the (4, 4) scale ``own`` moves from it into its sizes."""
    for child in surface.children:
        keep(child, "matrix_parent_inverse")
        child.matrix_parent_inverse = Matrix(own.tolist()) @ child.matrix_parent_inverse
