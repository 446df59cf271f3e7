# SPDX-License-Identifier: GPL-3.0-or-later
"""Change a control surface's points or kind, and turn a volume into a lattice."""

from __future__ import annotations

import bpy
import numpy as np

from ...projection.editing.nurbs_edits import CUBIC, patch_near, refined
from ...projection.editing.resolution import change, grid_within, patch_within
from ...projection.editing.respacing import equalised
from ...projection.editing.volume_edits import lattice, sampled
from ...projection.surfaces.kinds import surface_from_parameters
from ...projection.surfaces.surface import ControlSurface, Grid
from ...projection.typing import Array
from ...projection.user_error import UserError
from ...projection.volume.lattice import Lattice
from ...projection.volume.viewing_volume import ViewingVolume
from ..blender.all_or_nothing import at_end, keep, keep_whole, way_back
from ..blender.mesh_grid import checked_grid, grid_points, write_grid
from ..blender.rig_mark import has_other_animation
from ..blender.scene_objects import delete_with_data, editable_collections, link_beside
from ..surfaces import lattice_object, nurbs_object, surface_object
from ..surfaces.kinds import BLENDER_KINDS, MESH_KINDS, PARAMETRIC_KINDS
from ..surfaces.surface_object import surface_parameters
from ..surfaces.uv_mesh import read_uv_mesh
from ..volume import edit_mode
from ..volume.camera_members import cameras_with
from .flexible_camera import NewSurface, editable_surfaces, make_flexible, replace_surfaces
from .read_projection import PlacedLattice, read_own_projection, read_surface, world_to_own
from .shown_lens import approximate_lens

# A grid is not made finer than this many faces along an axis.
MOST_FACES = 1024
# Positions along u and along v at which a surface is searched for islands.
ISLAND_SAMPLES = 65
# At most so many positions along each axis of a lattice measure how far it differs from a volume.
MOST_MEASURES = 33
# The properties of an object's placement and display, as copied to an object that replaces it.
PLACEMENT = (
    "parent",
    "parent_type",
    "parent_bone",
    "matrix_parent_inverse",
    "rotation_mode",
    "location",
    "rotation_euler",
    "rotation_quaternion",
    "rotation_axis_angle",
    "scale",
    "delta_location",
    "delta_rotation_euler",
    "delta_rotation_quaternion",
    "delta_scale",
    "hide_viewport",
    "hide_render",
    "display_type",
)


def _require_plain_points(surface) -> None:
    """Raise UserError if something refers to points by their numbers, which new points change."""
    for exists, what in (
        (surface.data.shape_keys is not None, "shape keys"),
        (bool(surface.vertex_groups), "vertex groups"),
        (any(modifier.type == "HOOK" for modifier in surface.modifiers), "hooks"),
        (has_other_animation(surface.data), "animated points"),
    ):
        if exists:
            raise UserError(
                "'{0}' has {1}, which new points would lose: apply or remove them first", surface.name, what
            )


def own_shape(surface) -> ControlSurface:
    """A parametric or mesh surface in its own space, without further modifiers."""
    if surface.scfpf_surface.kind == "UV_MESH":
        return read_uv_mesh(surface, np.eye(4))
    parameters = surface_parameters(surface)
    points = parameters.pop("points", None)
    if points is not None and points.shape[:2] != (2, 2):
        # A patch with more points is a grid.
        return Grid(points)
    return surface_from_parameters(surface.scfpf_surface.kind, parameters, points, np.eye(4))


def _evaluated_shape(camera, surface, depsgraph) -> ControlSurface:
    """A surface in its own space as evaluated, with modifiers.

    Raises UserError for a lattice, and for a scale of 0.
    """
    read = read_surface(surface, camera, depsgraph)
    if isinstance(read, PlacedLattice):
        raise UserError(
            "'{0}' is a lattice, which is several control surfaces: choose another one", surface.name
        )
    return read.transformed(world_to_own(surface.evaluated_get(depsgraph)))


def convert_to_grid(camera, depsgraph, index: int, columns: int, rows: int, share: float) -> float:
    """Make a surface a mesh grid of columns × rows faces, of the same shape at this frame.

    columns, rows: 0 for as many as keep the change below a share of the surface's size, see
    ``projection.editing.resolution.grid_within``. Further modifiers stay and act on the grid; those of a
    surface patch are applied. Returns the greatest change of the surface as a share of its size. It is 0
    (float32) for planes and patches, and falls as the square of the resolution for curved kinds. Raises
    UserError for holes.
    """
    (surface,) = editable_surfaces(camera, [index])
    kind = surface.scfpf_surface.kind
    if kind == "GRID":
        raise UserError("'{0}' is a grid already", surface.name)
    if kind not in BLENDER_KINDS or kind == lattice_object.KIND:
        raise UserError("'{0}' cannot become a grid: choose a surface that is not a lattice", surface.name)
    if kind == nurbs_object.KIND:
        shape = _evaluated_shape(camera, surface, depsgraph)
    else:
        _require_plain_points(surface)
        shape = own_shape(surface)
        _require_one_island(surface, shape)
    if not (columns and rows):
        found = grid_within(shape, share)
        columns, rows = columns or found[0], rows or found[1]
    points = sampled(shape, columns + 1, rows + 1)
    _become_grid(camera, surface, points)
    return change(shape, Grid(points), columns, rows)


def _require_one_island(surface, shape: ControlSurface) -> None:
    if len(np.unique(shape.evaluate(*lattice(ISLAND_SAMPLES, ISLAND_SAMPLES)).tile)) > 1:
        raise UserError(
            "'{0}' has several islands in its UV map, and a grid is one: stitch them, or keep the UV mesh",
            surface.name,
        )


def _become_grid(camera, surface, points) -> None:
    """Turn a surface into a grid of points (rows, columns, 3), own space."""
    if surface.type != "MESH":
        _put_in_place(camera, surface, "GRID", points)
        return
    points = checked_grid(points)  # before anything has changed
    if surface.data.users > 1:
        keep(surface, "data")
        surface.data = surface.data.copy()
    else:
        keep_whole(surface.data)
    keep(surface.scfpf_surface, "kind")
    surface.scfpf_surface.kind = "GRID"
    write_grid(surface.data, points)
    surface.update_tag()


def _put_in_place(camera, surface, kind: str, points, parameters=None):
    """Replace a surface on the camera's list by a new object of another type, at the same place.

    Children, and constraints and drivers of other objects, then refer to the new object. A surface on another
    camera's list remains, with everything that refers to it.
    """
    owners = (surface, surface.data, surface.data.shape_keys)
    if surface.constraints or any(has_other_animation(owner) for owner in owners if owner is not None):
        raise UserError(
            "'{0}' has constraints or animation, which the new object would not have: apply "
            "or remove them first",
            surface.name,
        )
    name = surface.name
    new = surface_object.new_surface(name, kind, parameters, points)
    for attribute in PLACEMENT:
        setattr(new, attribute, getattr(surface, attribute))
    collections = editable_collections(surface)
    link_beside(new, surface)
    for slot in camera.scfpf.surfaces:
        if slot.object == surface:
            slot.object = new
    layer = bpy.context.view_layer
    active, selected = layer.objects.active == surface, surface.select_get(view_layer=layer)
    if cameras_with(surface):
        edit_mode.release(surface)
    else:
        # Otherwise the remapping would link the new object there twice.
        for collection in collections:
            collection.objects.unlink(surface)
        way_back(_put_again, surface, new, collections)
        surface.user_remap(new)
        at_end(delete_with_data, surface)
        at_end(setattr, new, "name", name)
    if new.name in layer.objects:
        new.select_set(selected, view_layer=layer)
        if active:
            layer.objects.active = new
    return new


def _put_again(surface, new, collections: list) -> None:
    """Put a surface into its collections, and in the place of its replacement."""
    for collection in collections:
        if new.name in collection.objects:
            collection.objects.unlink(new)
        collection.objects.link(surface)
    new.user_remap(surface)


def convert_to_patch(camera, depsgraph, index: int, columns: int, rows: int, share: float) -> float:
    """Make a surface a Surface Patch with the same Q(u, v) at this frame, modifiers applied.

    columns, rows: control points, at least 4 each; 0 in either for as many as keep the change below a share
    of the surface's size. A grid keeps its own. Returns the greatest change as a share of the size. It is 0
    (float32) for planes, patches and grids, and falls as the fourth power of the number of points for others.
    Raises UserError for holes.
    """
    (surface,) = editable_surfaces(camera, [index])
    kind = surface.scfpf_surface.kind
    if kind == nurbs_object.KIND:
        raise UserError("'{0}' is a {1} already", surface.name, nurbs_object.TITLE)
    if kind not in PARAMETRIC_KINDS and kind not in MESH_KINDS:
        raise UserError(
            "'{0}' cannot become a surface patch: choose a surface that is not a lattice", surface.name
        )
    shape = _evaluated_shape(camera, surface, depsgraph)
    _require_one_island(surface, shape)
    if columns and rows:
        patch = patch_near(shape, max(columns, CUBIC), max(rows, CUBIC))
    else:
        patch = patch_within(shape, share)
    points = np.asarray(patch.points)
    orders = {"order_u": patch.along_u.order, "order_v": patch.along_v.order}
    _put_in_place(camera, surface, nurbs_object.KIND, points, orders)
    return change(shape, patch, points.shape[1], points.shape[0])


def subdivide(camera, index: int, along_u: bool, along_v: bool) -> tuple[int, int]:
    """Halve the pieces of a patch, grid or surface patch along u, v or both; the shape stays.

    Returns the control points along u and v. A patch becomes a grid. Raises UserError for
    a surface patch whose knots Blender cannot refine.
    """
    (surface,) = editable_surfaces(camera, [index])
    kind = surface.scfpf_surface.kind
    if kind == lattice_object.KIND:
        raise UserError("'{0}' is a lattice: set its points in its Object Data properties", surface.name)
    if kind not in {"PATCH", "GRID", nurbs_object.KIND}:
        raise UserError(
            "'{0}' has no control points to subdivide: convert it to a grid or a patch first", surface.name
        )
    if not (along_u or along_v):
        raise UserError("Choose a direction to subdivide in: U, V or both")
    _require_plain_points(surface)
    if kind == nurbs_object.KIND:
        patch = refined(nurbs_object.own_patch(surface), along_u, along_v)
        keep(surface, "data")
        nurbs_object.replace_net(surface, patch)
        rows, columns = np.shape(patch.points)[:2]
        return columns, rows
    rows, columns = (count - 1 for count in grid_points(surface).shape[:2])
    columns, rows = columns * (1 + along_u), rows * (1 + along_v)
    if max(columns, rows) > MOST_FACES:
        raise UserError("'{0}' would have more than {1} faces along an axis", surface.name, MOST_FACES)
    _become_grid(camera, surface, sampled(own_shape(surface), columns + 1, rows + 1))
    return columns + 1, rows + 1


def equalise(camera, depsgraph, index: int, columns: int, rows: int, along_u: bool, along_v: bool) -> float:
    """Make a surface a grid of columns × rows faces whose points have even steps along u, v or both.

    The points lie on the surface, but the image changes. Further modifiers stay; those of a surface patch are
    applied. Returns the remaining unevenness, see ``projection.editing.respacing.equalised``.
    """
    (surface,) = editable_surfaces(camera, [index])
    kind = surface.scfpf_surface.kind
    if kind not in BLENDER_KINDS or kind == lattice_object.KIND:
        raise UserError("'{0}' cannot be equalized: choose another control surface", surface.name)
    if kind == "POINT":
        raise UserError("'{0}' is a point, which has no steps: choose another control surface", surface.name)
    if kind == nurbs_object.KIND:
        shape = _evaluated_shape(camera, surface, depsgraph)
    else:
        _require_plain_points(surface)
        shape = own_shape(surface)
        _require_one_island(surface, shape)
    points, left = equalised(shape, columns + 1, rows + 1, along_u, along_v)
    _become_grid(camera, surface, points)
    return left


def convert_to_lattice(
    camera, depsgraph, aspect: float, shape: tuple[int, int, int], interpolation: str
) -> float:
    """Replace the camera's volume by one lattice of (W, V, U) points with the same Q(u, v, t) at them.

    Returns the greatest change of the volume as a share of its size: 0 (float32) for straight projectors
    between flat surfaces and a linear lattice. Raises UserError.
    """
    projection = read_own_projection(camera, depsgraph, aspect)
    volume = projection.volume
    points = _positions(volume, *_lattice_places(shape))
    low, high = points.min(1), points.max(1)
    size = np.where(high > low, high - low, max(float((high - low).max()), 1.0))
    matrix = np.diag([*size, 1.0])
    matrix[:3, 3] = (low + high) / 2
    own = ((points - matrix[:3, 3:]) / size[:, None]).T.reshape(*shape, 3)
    fitted = Lattice.through(own, (interpolation,) * 3)
    between = _lattice_places(tuple(min(2 * count - 1, MOST_MEASURES) for count in shape))
    moved = fitted.volume(matrix).evaluate(*between).position - _positions(volume, *between)
    change = np.linalg.norm(moved, axis=0).max() / size.max()
    parameters = {"interpolation": interpolation}
    replace_surfaces(
        camera,
        [NewSurface(lattice_object.TITLE, lattice_object.KIND, matrix, parameters, fitted.points[::-1])],
    )
    make_flexible(camera)
    approximate_lens(camera, projection)
    return float(change)


def _lattice_places(shape: tuple[int, ...]) -> tuple[Array, Array, Array]:
    """(u, v, t), (N,) each, of evenly spaced lattice points, W from far to near, then V, then U."""
    w, v, u = np.meshgrid(*(np.linspace(0.0, 1.0, count) for count in shape), indexing="ij")
    return u.ravel(), v.ravel(), 1.0 - w.ravel()


def _positions(volume: ViewingVolume, u: Array, v: Array, t: Array) -> Array:
    """Q(u, v, t), (3, N). Raises UserError where a control surface has a hole."""
    controls = volume.controls(u, v)
    if not controls.valid.all():
        raise UserError("A control surface has holes, which a lattice cannot have: fill them first")
    return volume.evaluate_controls(controls, t).position
