# SPDX-License-Identifier: GPL-3.0-or-later
"""Flexible cameras: their lists of control surfaces, and volumes from presets and from frustums."""

from __future__ import annotations

import math
from dataclasses import replace
from typing import NamedTuple

import bpy
import numpy as np
from mathutils import Matrix

from ...projection.presets.preset import MAXIMUM_SURFACES
from ...projection.surfaces.uv_mesh import UVMesh
from ...projection.user_error import UserError
from ..blender.all_or_nothing import at_end, keep
from ..blender.rig_mark import is_rig_part
from ..blender.scene_objects import delete_with_data, is_being_edited, link_beside, object_by_uid
from ..blender.slot_animation import (
    MAPPINGS,
    SURFACES,
    clear_slots,
    move_slot,
    remove_slot,
    require_own_items,
)
from ..mappings.mapping_edits import clear_mappings, write_mappings
from ..surfaces import lattice_object, nurbs_object, surface_object
from ..surfaces.kinds import PARAMETRIC_KINDS
from ..surfaces.uv_mesh import mesh_kind
from ..volume import edit_mode
from ..volume.camera_members import all_cameras, cameras_with, grids_of, surfaces_of
from ..volume.screens import screens_of
from ..volume.volume_object import is_volume_object, sync_volume_object
from .ordinary_camera import frustum
from .shown_lens import approximate_lens, size_frame


class NewSurface(NamedTuple):
    """A control surface to be made. kind, parameters, points: as ``surface_object.new_surface`` takes them.

    matrix: (4, 4), the surface's own space to camera space.
    """

    name: str
    kind: str
    matrix: np.ndarray
    parameters: dict[str, float] | None = None
    points: object = None


def make_flexible(camera, again: bool = False) -> None:
    """Switch flexible projection on and make the volume object; the surfaces stay unchanged.

    again: whether the camera was flexible earlier. If it is the first one of its scenes otherwise, they get
    the settings of new scenes. Raises UserError if the object is not a camera or cannot be edited.
    """
    _require_camera(camera)
    if not camera.scfpf.enabled:
        if not again:
            for scene in _scenes_without_others(camera):
                _begin_sampling(scene)
        camera.scfpf.enabled = True
    sync_volume_object(camera)


def _begin_sampling(scene) -> None:
    """Give a scene the settings that new ones have, where none is set.

    Files keep no property that has its default value, so another default would change them.
    """
    options = scene.scfpf_sampling
    if scene.is_editable and not options.is_property_set("world_shadows"):
        options.world_shadows = True


def _scenes_without_others(camera) -> list:
    """The scenes of a camera that have no other flexible one, switched on or off."""
    others = (each for each in all_cameras() if each != camera)
    flexible = (each for each in others if each.scfpf.enabled or len(each.scfpf.surfaces))
    taken = {scene for each in flexible for scene in each.users_scene}
    return [scene for scene in camera.users_scene if scene not in taken]


def _require_camera(camera) -> None:
    if camera.type != "CAMERA":
        raise UserError("'{0}' is not a camera: select a camera object", camera.name)
    if not camera.is_editable:
        raise UserError("'{0}' is linked from another file: make a library override of it first", camera.name)


def editable_surfaces(camera, indices=None) -> list:
    """The control surfaces of a camera, or those at some places of its list, each once.

    Raises UserError for an empty place and for a surface that cannot be edited.
    """
    slots = camera.scfpf.surfaces
    found = []
    for index in range(len(slots)) if indices is None else indices:
        surface = slots[index].object
        if surface is None:
            raise UserError(
                "Control surface {0} of '{1}' is empty: remove it from the list", index + 1, camera.name
            )
        if not surface.is_editable or (surface.data is not None and not surface.data.is_editable):
            raise UserError("'{0}' is linked from another file: make it local first", surface.name)
        if is_being_edited(surface):
            raise UserError("'{0}' is being edited: go to Object Mode first, in its scene", surface.name)
        if surface not in found:
            found.append(surface)
    return found


def add_surface(camera, kind, name=None, matrix=None, parameters=None, points=None, index=None):
    """Add a new control surface as a child of the camera, and return the object.

    kind, parameters, points: as ``surface_object.new_surface`` takes them. matrix: (4, 4), the surface's own
    space to camera space, by default the identity. index: its place in the list, by default the last.
    Raises UserError; then nothing has changed.
    """
    _require_camera(camera)
    _require_room(camera)
    surface = surface_object.new_surface(name, kind, parameters, points)
    _place(camera, surface, np.eye(4) if matrix is None else matrix)
    _insert(camera, surface, index)
    return surface


def _place(camera, surface, matrix) -> None:
    """Make a new surface a child of the camera, at a (4, 4) matrix in camera space."""
    surface.parent = camera
    surface.matrix_basis = Matrix(np.asarray(matrix, np.float64).tolist())
    link_beside(surface, camera)


def _require_room(camera) -> None:
    if len(camera.scfpf.surfaces) >= MAXIMUM_SURFACES:
        raise UserError(
            "'{0}' has {1} control surfaces, the most that a volume may have", camera.name, MAXIMUM_SURFACES
        )


def _insert(camera, surface, index=None) -> None:
    slots = camera.scfpf.surfaces
    slots.add().object = surface
    last = len(slots) - 1
    move_slot(camera.scfpf, last, last if index is None else index)
    sync_volume_object(camera)


def attach_surface(camera, surface) -> None:
    """Append an existing object to the camera's surfaces.

    An object without a kind gets one: a mesh by its UV map PATCH, GRID or UV_MESH, a SURFACE object NURBS,
    a lattice LATTICE. Raises UserError for any other object.
    """
    require_attachable(camera, surface)
    _insert(camera, surface)


def require_attachable(camera, surface) -> None:
    """Raise the errors of ``attach_surface``."""
    _require_camera(camera)
    _require_room(camera)
    if not may_be_surface(surface):
        raise UserError(
            "'{0}' cannot be a control surface: choose a mesh with UV map, a surface or a lattice",
            surface.name,
        )


def may_be_surface(candidate) -> bool:
    """Return whether an object's type is one of control surfaces, and it is not a volume object."""
    return candidate.type in {"MESH", "SURFACE", "LATTICE"} and not is_volume_object(candidate)


def _take_kind(surface) -> None:
    """Give an object without a kind the kind that fits its type and its UV map."""
    if surface.scfpf_surface.kind != "NONE" or not surface.is_editable:
        return
    keep(surface.scfpf_surface, "kind")
    if surface.type == "SURFACE":
        surface.scfpf_surface.kind = nurbs_object.KIND
    elif surface.type == "LATTICE":
        surface.scfpf_surface.kind = lattice_object.KIND
    elif surface.type == "MESH":
        surface.scfpf_surface.kind = mesh_kind(surface)


def _delete_if_unused(camera, surface) -> None:
    """Delete a surface, or None, that is a child of the camera and on no camera's list; release any other."""
    if surface is None:
        return
    if cameras_with(surface) or surface.parent != camera or not surface.is_editable:
        edit_mode.release(surface)
        return
    at_end(delete_with_data, surface)


def remove_surface(camera, index: int) -> None:
    """Remove a surface from the list.

    Its object is deleted if it is the camera's child and on no other list.
    Raises UserError if the list has no such place.
    """
    _require_camera(camera)
    settings = camera.scfpf
    _require_place(camera, index)
    surface = settings.surfaces[index].object
    remove_slot(settings, index)
    _delete_if_unused(camera, surface)
    sync_volume_object(camera)


def _require_place(camera, index: int) -> None:
    if not 0 <= index < len(camera.scfpf.surfaces):
        raise UserError("'{0}' has no control surface at place {1}", camera.name, index + 1)


def move_surface(camera, index: int, step: int) -> int:
    """Move a surface by ``step`` places, within the list; return its new index."""
    _require_camera(camera)
    _require_place(camera, index)
    place = move_slot(camera.scfpf, index, index + step)
    sync_volume_object(camera)
    return place


def clear_surfaces(camera) -> None:
    """Remove every surface, as ``remove_surface`` does."""
    _require_camera(camera)
    surfaces = set(surfaces_of(camera))
    clear_slots(camera.scfpf)
    for surface in surfaces:
        _delete_if_unused(camera, surface)
    sync_volume_object(camera)


def surfaces_edited(camera) -> None:
    """Respond to an edit of a camera's pointers to surfaces or grids. Properties call this."""
    if camera.is_evaluated or camera.type != "CAMERA" or not camera.is_editable:
        return
    for surface in surfaces_of(camera):
        _take_kind(surface)
    edit_mode.show_by_mode(camera)
    if camera.scfpf.enabled or camera.scfpf.volume_object:
        sync_volume_object(camera)


def flexibility_edited(camera) -> None:
    """Respond to an edit of the property ``enabled``."""
    surfaces_edited(camera)
    if not camera.is_evaluated and camera.type == "CAMERA" and camera.is_editable:
        size_frame(camera)


def apply_preset(camera, preset, aspect: float, scale: float = 1.0, depth: float = 1.0) -> None:
    """Replace the camera's volume by that of a preset, made of ordinary editable objects.

    preset: projection.presets.preset.Preset. aspect: width / height of the image. scale: multiplies every
    length. depth: multiplies the length of the projectors of a volume that has a ``similarity_of_ends``.
    Surfaces that are not the camera's children, or are on another camera's list, are only removed from the
    list. Sets the ordinary lens and clip range as well. Raises UserError or PresetError.
    """
    _require_camera(camera)
    if not (math.isfinite(scale) and scale > 0):
        raise UserError("A preset's scale must be a number above 0, not {0}", scale)
    require_own_items(camera.scfpf, SURFACES, MAPPINGS)
    fitted = preset.fitted(aspect)
    surfaces = [_scaled(surface, scale) for surface in fitted.surfaces]
    projection = fitted.projection(aspect).transformed(np.diag([scale, scale, scale, 1.0]))
    ends = fitted.volume().similarity_of_ends() if depth != 1.0 else None
    if ends is not None:
        k, offset = ends
        larger = k + depth * (1 - k)
        grown = np.diag([larger, larger, larger, 1.0])
        grown[:3, 3] = (1 - depth) * scale * offset
        surfaces[-1] = _scaled(fitted.surfaces[-1], scale * larger)
        surfaces[-1].matrix[:3, 3] += grown[:3, 3]
        near, far = projection.volume.surfaces
        deeper = replace(projection.volume, surfaces=(near, far.transformed(grown)))
        projection = replace(projection, volume=deeper)
    replace_surfaces(camera, surfaces)
    settings = camera.scfpf
    for slot, surface in zip(settings.surfaces, fitted.surfaces, strict=True):
        slot.weight = surface.weight
    settings.basis = fitted.basis
    settings.reparameterisation = fitted.reparameterisation
    write_mappings(camera, fitted.mappings)
    settings.u_range = fitted.u_range
    settings.v_range = fitted.v_range
    settings.fit, settings.fitted_aspect = fitted.fit, aspect
    make_flexible(camera)
    approximate_lens(camera, projection)


def _scaled(surface, scale: float) -> NewSurface:
    """A preset's surface with every length multiplied."""
    inputs = PARAMETRIC_KINDS[surface.kind].inputs if surface.kind in PARAMETRIC_KINDS else ()
    # These include lengths that only the drawing needs, such as the size of a point's cross.
    lengths = {one.key: one.default for one in inputs if one.subtype == "DISTANCE"}
    given = lengths | surface.parameters
    parameters = {key: value * scale if key in lengths else value for key, value in given.items()}
    points = None if surface.points is None else np.array(surface.points, np.float64)
    if points is not None:
        points[..., :3] *= scale  # a fourth number is a weight
    if surface.chart is not None:
        points = UVMesh(points, surface.chart)
    matrix = np.array(surface.matrix, np.float64)
    matrix[:3, 3] *= scale
    return NewSurface(surface.name, surface.kind, matrix, parameters, points)


def replace_surfaces(camera, described: list[NewSurface]) -> None:
    """Replace all surfaces by new ones.

    The new objects are made before the old ones are deleted: an error leaves the old volume unchanged.
    """
    require_own_items(camera.scfpf, SURFACES)
    made = []
    try:
        for new in described:
            made.append(surface_object.new_surface(new.name, new.kind, new.parameters, new.points))
    except surface_object.UserError:
        for surface in made:
            delete_with_data(surface)
        raise
    clear_surfaces(camera)
    for surface, new in zip(made, described, strict=True):
        _place(camera, surface, new.matrix)
        _insert(camera, surface)
    camera.scfpf.active_surface = 0
    # The old surfaces have their names until they are deleted.
    names = {surface.session_uid: new.name for surface, new in zip(made, described, strict=True)}
    at_end(_give_names, names, last=True)


def _give_names(names: dict[int, str]) -> None:
    """Give objects, by their session ids, the names that are free."""
    for uid, name in names.items():
        surface = object_by_uid(uid)
        if surface is not None and name not in bpy.data.objects:
            surface.name = name


def volume_from_camera(camera, scene) -> None:
    """Replace the camera's volume by its own frustum, from clip start to clip end.

    Lens, shift, sensor fit, and the scene's resolution and pixel aspect count. Raises UserError: a panoramic
    or custom camera has no frustum.
    """
    _require_camera(camera)
    require_own_items(camera.scfpf, SURFACES, MAPPINGS)
    lens = camera.data
    near, far = frustum(camera, scene)
    sizes = np.linalg.norm(np.array(camera.matrix_world, np.float64)[:3, :3], axis=0)
    if not (np.isfinite(sizes).all() and sizes.min() > 0):
        raise UserError("'{0}' has a scale of 0: clear it with Alt-S", camera.name)
    # The camera object's scale acts on its children but not on its own view.
    undo_scale = np.diag([*(1 / sizes), 1.0])
    planes = [
        NewSurface(name, "PLANE", undo_scale @ end.matrix, {"width": end.width, "height": end.height})
        for name, end in (("Near", near), ("Far", far))
    ]
    replace_surfaces(camera, planes)
    settings = camera.scfpf
    settings.basis, settings.reparameterisation = "BEZIER", "RECTANGLE"
    clear_mappings(camera)
    settings.u_range = settings.v_range = (0.0, 1.0)
    width, height = far.width, far.height
    # An ordinary camera keeps the side to which its sensor is fitted.
    is_wide = lens.sensor_fit == "HORIZONTAL" or (lens.sensor_fit == "AUTO" and width >= height)
    settings.fit, settings.fitted_aspect = "HEIGHT" if is_wide else "WIDTH", width / height
    make_flexible(camera)


def control_objects() -> set[str]:
    """Full names of the objects that no image shows: control surfaces, volume objects, parts of Cycles rigs.

    So are screens that things pop out of.

    ``name_full`` differs between a local object and a linked one of the same name.
    """
    names = {part.name_full for part in bpy.data.objects if is_rig_part(part)}
    for camera in all_cameras():
        volume = camera.scfpf.volume_object
        members = surfaces_of(camera) + grids_of(camera) + screens_of(camera)
        members += [] if volume is None else [volume]
        names.update(member.name_full for member in members)
    return names
