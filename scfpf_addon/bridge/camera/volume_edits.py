# SPDX-License-Identifier: GPL-3.0-or-later
"""Edits of a camera's list of surfaces: insert, duplicate, reverse, place, and make unshared."""

from __future__ import annotations

from typing import NamedTuple

from mathutils import Matrix, Vector

from ...projection.editing.volume_edits import inserted
from ...projection.user_error import UserError
from ..blender.all_or_nothing import PLACE, all_or_nothing, keep
from ..blender.scene_objects import link_beside
from ..blender.slot_animation import SURFACES, move_slot, require_own_items
from ..mappings.mapping_edits import own_mapping_data
from ..surfaces import lattice_object
from ..surfaces.kinds import PARAMETRIC_KINDS
from ..surfaces.surface_object import surface_parameters
from ..volume.camera_members import all_cameras, cameras_with
from ..volume.volume_object import sync_volume_object
from .flexible_camera import (
    add_surface,
    attach_surface,
    editable_surfaces,
    move_surface,
    remove_surface,
    require_attachable,
)
from .read_projection import read_own_projection


class ViewportView(NamedTuple):
    """The view of a viewport.

    matrix: (4, 4), view to world. half_width: of the view at distance 1; with parallel rays at any distance.
    """

    matrix: Matrix
    half_width: float
    parallel: bool


def insert_surface(camera, depsgraph, aspect: float, index: int, cells: int) -> bool:
    """Insert one control surface and keep the volume, see ``projection.editing.volume_edits.inserted``.

    In a polyline it follows the surface at ``index``, and the others stay. With another basis the inner
    surfaces are replaced; near and far stay. Returns whether all new surfaces are exact; the others are grids
    of cells × cells faces. Raises UserError; then
    nothing has changed.
    """
    volume = read_own_projection(camera, depsgraph, aspect).volume
    slots = camera.scfpf.surfaces
    if any(surface.scfpf_surface.kind == lattice_object.KIND for surface in editable_surfaces(camera)):
        raise UserError("A lattice stands for several control surfaces: give it more points along W instead")
    insertion = inserted(volume, index, cells)
    if insertion.replaced:
        require_own_items(camera.scfpf, SURFACES)
    first, shapes = insertion.first, insertion.shapes
    with all_or_nothing() as kept:
        kept.keep(camera.scfpf)
        for place, shape in enumerate(shapes, first):
            add_surface(
                camera,
                shape.kind,
                matrix=shape.matrix,
                parameters=shape.parameters or None,
                points=shape.points,
                index=place,
            )
        for _ in range(insertion.replaced):
            remove_surface(camera, first + len(shapes))
        if insertion.weights is not None:
            for slot, weight in zip(slots, insertion.weights, strict=True):
                slot.weight = weight
        camera.scfpf.active_surface = min(max(index, first), first + len(shapes) - 1)
    return all(shape.exact for shape in shapes)


def duplicate_surface(camera, index: int):
    """Copy a surface and its data to the next place of the list; return the object."""
    (surface,) = editable_surfaces(camera, [index])
    require_attachable(camera, surface)
    copy = surface.copy()
    copy.data = surface.data.copy()
    _take_own_actions(copy)
    link_beside(copy, surface)
    attach_surface(camera, copy)
    slots = camera.scfpf.surfaces
    last = len(slots) - 1
    slots[last].weight = slots[index].weight
    move_surface(camera, last, index + 1 - last)
    return copy


def _take_own_actions(copy) -> None:
    """Copy the actions that a copied object shares with its original, as Shift-D does."""
    keys = getattr(copy.data, "shape_keys", None)
    own_data = (copy.data, keys) if copy.data.users == 1 else ()
    for owner in (copy, *own_data):
        animation = owner.animation_data if owner is not None else None
        if animation is not None and animation.action is not None:
            animation.action = animation.action.copy()


def swap_ends(camera) -> None:
    """Reverse the list of surfaces: near becomes far."""
    settings = camera.scfpf
    require_own_items(settings, SURFACES)
    last, active = len(settings.surfaces) - 1, settings.active_surface
    for place in range(last):
        move_slot(settings, last, place)
    settings.active_surface = max(last - active, 0)
    sync_volume_object(camera)


def snap_near_to_view(camera, view: ViewportView) -> None:
    """Place the near surface in a view: a plane fills its width, a round kind surrounds the eye.

    Size, parameters and scale stay. In a view with parallel rays the depth stays as well.
    """
    (surface,) = editable_surfaces(camera, [0])
    place, rotation, scale = surface.matrix_world.decompose()
    kind = PARAMETRIC_KINDS.get(surface.scfpf_surface.kind)
    depth = -(view.matrix.inverted() @ place).z
    if kind is not None and not view.parallel:
        if any(one.key == "width" for one in kind.parameters):
            depth = surface_parameters(surface)["width"] * abs(scale.x) / (2 * view.half_width)
        elif kind.record.turns_about_y or not kind.parameters:
            depth = 0.0
    keep(surface, *PLACE)
    rotation = view.matrix.to_quaternion()
    location = view.matrix @ Vector((0.0, 0.0, -depth))
    surface.matrix_world = Matrix.LocRotScale(location, rotation, scale)


def align_surface(camera, index: int, target, location: bool, rotation: bool) -> None:
    """Give a surface another object's location, rotation or both; its scale stays."""
    (surface,) = editable_surfaces(camera, [index])
    place, turn, scale = surface.matrix_world.decompose()
    keep(surface, *PLACE)
    other_place, other_turn, _ = target.matrix_world.decompose()
    surface.matrix_world = Matrix.LocRotScale(
        other_place if location else place, other_turn if rotation else turn, scale
    )


def make_single_user(camera) -> int:
    """Copy objects that the camera shares with other cameras, and data with other users; return how many."""
    copied = 0
    surfaces = editable_surfaces(camera)
    others = [other for other in all_cameras() if other != camera]
    for surface in surfaces:
        own = surface
        if cameras_with(surface, cameras=others):
            own = _own_copy(camera, surface)
            copied += 1
        if own.data.users > 1:
            keep(own, "data")
            own.data = own.data.copy()
            copied += 1
    copied += own_mapping_data(camera)
    sync_volume_object(camera)
    return copied


def _own_copy(camera, surface):
    """Replace a surface by a copy at the same place, a child of the camera, with its own animation."""
    world = surface.matrix_world.copy()
    copy = surface.copy()
    _take_own_actions(copy)
    link_beside(copy, camera)
    if copy.parent != camera:
        copy.parent = camera
        copy.matrix_parent_inverse = (
            camera.matrix_world.inverted_safe() @ world @ copy.matrix_basis.inverted_safe()
        )
    for slot in camera.scfpf.surfaces:
        if slot.object == surface:
            slot.object = copy
    return copy
