# SPDX-License-Identifier: GPL-3.0-or-later
"""Edits of a flexible camera's volume in the .blend: the tools behind the operators."""

from __future__ import annotations

import itertools
import math
from typing import NamedTuple

import numpy as np
from mathutils import Matrix, Vector

from ...projection.editing.volume_edits import EditingError, inserted, mirrored
from ...projection.volume.inverse import invert
from ...projection.volume.viewing_volume import Projection
from ..blender.rig_mark import has_other_animation
from ..blender.scene_objects import link_beside
from ..blender.slot_animation import SURFACES, move_slot, require_own_items
from ..mappings.mapping_edits import own_mapping_data
from ..surfaces import lattice_object, nurbs_object
from ..surfaces.kinds import BLENDER_KINDS, MESH_KINDS, PARAMETRIC_KINDS
from ..surfaces.surface_object import is_reshaped, set_surface_parameters, surface_parameters
from ..volume.camera_members import all_cameras, cameras_with
from . import surface_scale
from .flexible_camera import (
    FlexibleCameraError,
    add_surface,
    approximate_lens,
    attach_surface,
    move_surface,
    remove_surface,
    require_attachable,
    sync_volume_object,
)
from .read_projection import read_projection

# How the size of a volume is searched that just holds what is selected: doubled from this share of the
# selection's size to the volume's, so often at most, and then halved on a logarithmic scale.
FIRST_SHARE, MOST_DOUBLINGS, BISECTIONS = 0.125, 40, 10
# An object holds no shear: a matrix that differs by more from its own location, rotation and scale has one.
# float32 products agree to about 1e-6.
SHEAR = 1e-4
# Room around what a volume is fitted to.
FIT_MARGIN = 1.05


class View(NamedTuple):
    """What a viewport shows.

    matrix: (4, 4), view to world. half_width: at distance 1, with parallel rays anywhere.
    """

    matrix: Matrix
    half_width: float
    parallel: bool


def _surfaces(camera, indices=None) -> list:
    """The different surface objects of a camera, or of some places of its list; all can be edited."""
    slots = camera.scfpf.surfaces
    found = []
    for index in range(len(slots)) if indices is None else indices:
        surface = slots[index].object
        if surface is None:
            raise FlexibleCameraError(
                f"Control surface {index + 1} of '{camera.name}' is empty: remove it from the list"
            )
        if not surface.is_editable or (surface.data is not None and not surface.data.is_editable):
            raise FlexibleCameraError(f"'{surface.name}' is linked from another file: make it local first")
        if surface not in found:
            found.append(surface)
    return found


def _in_camera_space(camera, depsgraph, aspect: float) -> Projection:
    world = np.array(camera.evaluated_get(depsgraph).matrix_world, np.float64)
    return read_projection(camera, depsgraph, aspect).transformed(np.linalg.inv(world))


def insert_surface(camera, depsgraph, aspect: float, index: int, cells: int) -> bool:
    """One control surface more, the volume as it was, see ``projection.editing.inserted``.

    Of a polyline it comes after the one at ``index``, and the others stay; of other projectors the
    inner surfaces are replaced, near and far stay. Returns whether all new surfaces are exact, see
    ``projection.editing.blend``; the others are grids of cells × cells faces.
    Raises FlexibleCameraError, ProjectionError or SurfaceError; then nothing has changed.
    """
    volume = _in_camera_space(camera, depsgraph, aspect).volume
    slots = camera.scfpf.surfaces
    if any(surface.scfpf_surface.kind == lattice_object.KIND for surface in _surfaces(camera)):
        raise FlexibleCameraError(
            "A lattice stands for several control surfaces: give it more points along W instead"
        )
    try:
        insertion = inserted(volume, index, cells)
    except EditingError as error:
        raise FlexibleCameraError(str(error)) from error
    if insertion.replaced:
        require_own_items(camera.scfpf, SURFACES)
    first, shapes = insertion.first, insertion.shapes
    try:
        for place, shape in enumerate(shapes, first):
            add_surface(
                camera,
                shape.kind,
                matrix=shape.matrix,
                parameters=shape.parameters or None,
                points=shape.points,
                index=place,
            )
    except ValueError:
        while len(slots) > len(volume.surfaces):
            remove_surface(camera, first)
        raise
    for _ in range(insertion.replaced):
        remove_surface(camera, first + len(shapes))
    if insertion.weights is not None:
        for slot, weight in zip(slots, insertion.weights, strict=True):
            slot.weight = weight
    camera.scfpf.active_surface = min(max(index, first), first + len(shapes) - 1)
    return all(shape.exact for shape in shapes)


def duplicate_surface(camera, index: int):
    """A copy of a surface, with its mesh, right after it in the list. Returns the object."""
    (surface,) = _surfaces(camera, [index])
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
    """Give a copied object actions of its own, as Shift-D does, instead of its original's."""
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
    last = len(settings.surfaces) - 1
    for place in range(last):
        move_slot(settings, last, place)
    settings.active_surface = max(last - settings.active_surface, 0)
    sync_volume_object(camera)


def mirror_surfaces(camera, depsgraph, axis: str, indices=None) -> None:
    """Mirror surfaces: Q(1-u, v) for axis "U", Q(u, 1-v) for "V".

    Meshes get their UV map mirrored and keep their shape, surface patches and lattices their points in
    reverse order, parametric kinds a negative scale or exchanged ends. Raises FlexibleCameraError or
    SurfaceError, before anything is changed, where that cannot be done.
    """
    surfaces = _surfaces(camera, indices)
    changes, patches, lattices = [], [], []
    for surface in surfaces:
        kind = surface.scfpf_surface.kind
        if surface.type != (BLENDER_KINDS[kind].object_type if kind in BLENDER_KINDS else "MESH"):
            raise FlexibleCameraError(
                f"'{surface.name}' is of type {surface.type.title()}, not of its kind: "
                "choose another kind first"
            )
        if kind == nurbs_object.KIND:
            patches.append((surface, nurbs_object.reversed_order(surface, axis)))
            continue
        if kind == lattice_object.KIND:
            if surface.modifiers or surface.data.shape_keys is not None or has_other_animation(surface):
                raise FlexibleCameraError(
                    f"'{surface.name}' has modifiers, shape keys or animation that would not be mirrored: "
                    "apply or remove them first"
                )
            lattices.append(surface)
            continue
        if kind not in PARAMETRIC_KINDS:
            if kind not in MESH_KINDS:
                raise FlexibleCameraError(
                    f"'{surface.name}' cannot be mirrored: choose another kind of control surface first"
                )
            if surface.data.uv_layers.active is None:
                raise FlexibleCameraError(f"'{surface.name}' has no UV map: unwrap it as a regular grid")
            continue
        if kind == "POINT":
            continue
        if is_reshaped(surface, "VIEWPORT") or is_reshaped(surface, "RENDER") or has_other_animation(surface):
            raise FlexibleCameraError(
                f"'{surface.name}' has modifiers or animation that would not be mirrored: "
                "convert it to a grid first"
            )
        parameters = surface_parameters(surface.evaluated_get(depsgraph))
        try:
            matrix, parameters = mirrored(kind, parameters, axis)
        except EditingError as error:
            raise FlexibleCameraError(f"'{surface.name}': {error}") from error
        placed = surface.matrix_basis @ Matrix(matrix.tolist())
        if not np.allclose(placed, Matrix.LocRotScale(*placed.decompose()), rtol=SHEAR, atol=SHEAR):
            raise FlexibleCameraError(
                f"'{surface.name}' is scaled unevenly and cannot be mirrored: apply its scale, "
                "or convert it to a grid first"
            )
        changes.append((surface, placed, parameters))
    for surface, placed, parameters in changes:
        surface.matrix_basis = placed
        set_surface_parameters(surface, parameters)
    for surface in lattices:
        surface.matrix_basis = surface.matrix_basis @ Matrix(lattice_object.mirror(surface, axis).tolist())
    for surface, order in patches:
        nurbs_object.reorder(surface, order, axis)
    for surface in surfaces:
        if surface.scfpf_surface.kind in MESH_KINDS:
            _mirror_uv(surface, "UV".index(axis))


def _mirror_uv(surface, axis: int) -> None:
    if surface.data.users > 1:
        surface.data = surface.data.copy()
    layer = surface.data.uv_layers.active
    # Not by ``layer.uv``: in Blender 4.5 that writes through to the mesh's copies and to its undo steps.
    uv = surface.data.attributes[layer.name].data
    values = np.empty(2 * len(uv), np.float32)
    uv.foreach_get("vector", values)
    values[axis::2] = 1 - values[axis::2]
    uv.foreach_set("vector", values)
    surface.data.update()


def snap_near_to_view(camera, view: View) -> None:
    """Put the near surface into a view: a plane fills its width, a round kind comes to stand about the eye.

    Size, parameters and scale stay. A view with parallel rays leaves the depth as it was.
    """
    (surface,) = _surfaces(camera, [0])
    place, rotation, scale = surface.matrix_world.decompose()
    kind = PARAMETRIC_KINDS.get(surface.scfpf_surface.kind)
    depth = -(view.matrix.inverted() @ place).z
    if kind is not None and not view.parallel:
        if any(one.key == "width" for one in kind.parameters):
            depth = surface_parameters(surface)["width"] * abs(scale.x) / (2 * view.half_width)
        elif kind.record.turns_about_y or not kind.parameters:
            depth = 0.0
    rotation = view.matrix.to_quaternion()
    location = view.matrix @ Vector((0.0, 0.0, -depth))
    surface.matrix_world = Matrix.LocRotScale(location, rotation, scale)


def align_surface(camera, index: int, target, location: bool, rotation: bool) -> None:
    """Give a surface another object's place, rotation or both; its scale stays."""
    (surface,) = _surfaces(camera, [index])
    place, turn, scale = surface.matrix_world.decompose()
    other_place, other_turn, _ = target.matrix_world.decompose()
    surface.matrix_world = Matrix.LocRotScale(
        other_place if location else place, other_turn if rotation else turn, scale
    )


def apply_scale(camera, index: int) -> None:
    """Put the whole scale of a surface into its sizes, see ``surface_scale.apply_scale``."""
    (surface,) = _surfaces(camera, [index])
    surface_scale.apply_scale(surface)


def make_single_user(camera) -> int:
    """Give the camera surfaces and meshes of its own; returns how many objects and meshes were copied.

    An object on another camera's list too is copied, and so is a mesh with other users.
    """
    copied = 0
    surfaces = _surfaces(camera)
    others = [other for other in all_cameras() if other != camera]
    for surface in surfaces:
        own = surface
        if cameras_with(surface, cameras=others):
            own = _own_copy(camera, surface)
            copied += 1
        if own.data.users > 1:
            own.data = own.data.copy()
            copied += 1
    copied += own_mapping_data(camera)
    sync_volume_object(camera)
    return copied


def _own_copy(camera, surface):
    """A copy of a surface at the same place, with its own animation, child of the camera, in its stead."""
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


def _children(camera) -> list:
    """The surfaces of a camera, all of them its children."""
    surfaces = _surfaces(camera)
    for surface in surfaces:
        if surface.parent != camera or surface.parent_type != "OBJECT":
            raise FlexibleCameraError(
                f"'{surface.name}' is not a child of '{camera.name}': parent it to the camera (Ctrl-P) first"
            )
    return surfaces


def move_volume(camera, matrix) -> None:
    """Apply an affine (4, 4) matrix in camera space to every surface.

    It goes into the parent inverse: animation and modifiers act as before, and a shear is kept. Raises
    FlexibleCameraError for a surface that is no child of the camera.
    """
    move = Matrix(np.asarray(matrix, np.float64).tolist())
    for surface in _children(camera):
        surface.matrix_parent_inverse = move @ surface.matrix_parent_inverse


def fit_volume(camera, depsgraph, aspect: float, corners) -> None:
    """Scale the volume and move the camera, which goes on looking the same way, around a box.

    corners: (8, 3), world space. The middle of the volume comes to the middle of the box, and the volume
    is the smallest that holds all corners. Parametric surfaces take the factor into their sizes, others and
    those that are animated into the parent inverse. The ordinary lens follows. Raises FlexibleCameraError.
    """
    surfaces = _children(camera)
    projection = _in_camera_space(camera, depsgraph, aspect)
    volume = projection.volume
    world = np.array(camera.matrix_world, np.float64)
    centre = (corners.min(0) + corners.max(0)) / 2
    around = FIT_MARGIN * np.linalg.solve(world[:3, :3], (corners - centre).T)
    half = np.full(1, 0.5)
    middle = volume.evaluate(half, half, half).position
    ends = volume.evaluate(*np.array(list(itertools.product((0.0, 0.5, 1.0), repeat=3))).T).position

    def holds(scale: float) -> bool:
        return bool(invert(volume, around / scale + middle).found.all())

    size, reach = float(np.abs(ends - middle).max()), float(np.abs(around).max())
    if size == 0 or reach == 0:
        raise FlexibleCameraError("The volume or the selection has no size: there is nothing to fit")
    scale = FIRST_SHARE * reach / size
    for _ in range(MOST_DOUBLINGS):
        if holds(scale):
            break
        scale *= 2
    else:
        raise FlexibleCameraError(
            f"The volume of '{camera.name}' holds nothing around its middle: it is flat or folded there"
        )
    low, high = scale / 2, scale
    for _ in range(BISECTIONS):
        between = math.sqrt(low * high)
        low, high = (low, between) if holds(between) else (between, high)
    sizes = np.diag([high, high, high, 1.0])
    for surface in surfaces:
        if not surface_scale.grow(surface, high):
            surface.matrix_parent_inverse = Matrix(sizes.tolist()) @ surface.matrix_parent_inverse
    place = camera.matrix_world.copy()
    place.translation = Vector(centre - world[:3, :3] @ (high * middle[:, 0]))
    camera.matrix_world = place
    approximate_lens(camera, projection.transformed(sizes))
