# SPDX-License-Identifier: GPL-3.0-or-later
"""Make a camera flexible: its control surfaces, its volume object, its presets."""

from __future__ import annotations

import math

import bpy
import numpy as np
from mathutils import Matrix

from ...projection.presets.preset import MAXIMUM_SURFACES
from ...projection.surfaces.uv_mesh import UVMesh
from ...projection.volume.viewing_volume import Projection
from ..blender.rig_mark import is_rig_part
from ..blender.scene_objects import delete_with_data, link_beside
from ..blender.slot_animation import SURFACES, clear_slots, move_slot, remove_slot, require_own_items
from ..mappings.mapping_edits import MAPPINGS, clear_mappings, write_mappings
from ..surfaces import lattice_object, nurbs_object, surface_object
from ..surfaces.kinds import PARAMETRIC_KINDS
from ..surfaces.uv_mesh import mesh_kind
from ..volume import edit_mode
from ..volume.camera_members import all_cameras, cameras_with, grids_of, surfaces_of
from ..volume.volume_object import is_volume_object, sync_volume_object
from .camera_frame import size_frame
from .ordinary_camera import FrustumError, frustum

# The ordinary lens, radians: what turns less becomes orthographic, what turns more gets the widest.
NARROWEST_LENS, WIDEST_LENS = math.radians(1), math.radians(150)
# Positions across and up the picture at which the volume is measured for the lens and the clip range.
MEASURES = 17
# An orthographic camera of no width would show nothing. Blender units.
SMALLEST_ORTHO = 1e-6
# The ordinary clip start, at least, as a share of the clip end: what a depth buffer can bear.
SMALLEST_CLIP_SHARE = 1e-4


class FlexibleCameraError(ValueError):
    """An operation is not possible with this camera or object."""


def make_flexible(camera) -> None:
    """Switch flexible projection on and see to the volume object; surfaces stay as they are.

    Raises FlexibleCameraError when the object is no camera or cannot be edited.
    """
    _require_camera(camera)
    if not camera.scfpf.enabled:
        camera.scfpf.enabled = True
    sync_volume_object(camera)


def _require_camera(camera) -> None:
    if camera.type != "CAMERA":
        raise FlexibleCameraError(f"'{camera.name}' is not a camera: select a camera object")
    if not camera.is_editable:
        raise FlexibleCameraError(
            f"'{camera.name}' is linked from another file: make a library override of it first"
        )


def add_surface(camera, kind, name=None, matrix=None, parameters=None, points=None, index=None):
    """A new control surface, child of the camera, linked where the camera is.

    kind, parameters, points: as ``surface_object.new_surface``. matrix: (4, 4),
    own space to camera space, default the identity. index: its place in the
    list, default last. Returns the object.
    Raises FlexibleCameraError or SurfaceError; nothing is left behind.
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
        raise FlexibleCameraError(
            f"'{camera.name}' has {MAXIMUM_SURFACES} control surfaces, the most that a volume may have"
        )


def _insert(camera, surface, index=None) -> None:
    slots = camera.scfpf.surfaces
    slots.add().object = surface
    last = len(slots) - 1
    place = last if index is None else min(max(index, 0), last)
    move_slot(camera.scfpf, last, place)
    camera.scfpf.active_surface = place
    sync_volume_object(camera)


def attach_surface(camera, surface) -> None:
    """Append an existing object to the camera's surfaces.

    A mesh that is no control surface yet gets the kind that its UV map shows:
    a patch, a grid, else a UV mesh; a SURFACE object becomes NURBS, a lattice LATTICE. Raises
    FlexibleCameraError for any other object.
    """
    require_attachable(camera, surface)
    _insert(camera, surface)


def require_attachable(camera, surface) -> None:
    """Raise FlexibleCameraError where ``attach_surface`` does."""
    _require_camera(camera)
    _require_room(camera)
    if not may_be_surface(surface):
        raise FlexibleCameraError(
            f"'{surface.name}' cannot be a control surface: choose a mesh with UV map, a surface or a lattice"
        )


def may_be_surface(candidate) -> bool:
    """Whether an object is of a type that control surfaces have, and no volume object."""
    return candidate.type in {"MESH", "SURFACE", "LATTICE"} and not is_volume_object(candidate)


def _take_kind(surface) -> None:
    """Give an object that has none the kind that it looks like."""
    if surface.scfpf_surface.kind != "NONE" or not surface.is_editable:
        return
    if surface.type == "SURFACE":
        surface.scfpf_surface.kind = nurbs_object.KIND
    elif surface.type == "LATTICE":
        surface.scfpf_surface.kind = lattice_object.KIND
    elif surface.type == "MESH":
        surface.scfpf_surface.kind = mesh_kind(surface)


def delete_if_unused(camera, surface) -> None:
    """Delete a surface that is the camera's own child and on no camera's list."""
    if surface is None:
        return
    if cameras_with(surface) or surface.parent != camera or not surface.is_editable:
        edit_mode.release(surface)
        return
    delete_with_data(surface)


def remove_surface(camera, index: int) -> None:
    """Take a surface off the list.

    Its object is deleted if it is the camera's child and on no other list.
    Raises FlexibleCameraError when there is no such place in the list.
    """
    _require_camera(camera)
    settings = camera.scfpf
    _require_place(camera, index)
    surface = settings.surfaces[index].object
    remove_slot(settings, index)
    settings.active_surface = max(min(settings.active_surface, len(settings.surfaces) - 1), 0)
    delete_if_unused(camera, surface)
    sync_volume_object(camera)


def _require_place(camera, index: int) -> None:
    if not 0 <= index < len(camera.scfpf.surfaces):
        raise FlexibleCameraError(f"'{camera.name}' has no control surface at place {index + 1}")


def move_surface(camera, index: int, step: int) -> int:
    """Move a surface by ``step`` places, as far as the list goes; returns its new index."""
    _require_camera(camera)
    _require_place(camera, index)
    settings = camera.scfpf
    place = min(max(index + step, 0), len(settings.surfaces) - 1)
    move_slot(settings, index, place)
    settings.active_surface = place
    sync_volume_object(camera)
    return place


def clear_surfaces(camera) -> None:
    """Remove every surface, as ``remove_surface`` does."""
    _require_camera(camera)
    settings = camera.scfpf
    surfaces = {slot.object for slot in settings.surfaces}
    clear_slots(settings)
    settings.active_surface = 0
    for surface in surfaces:
        delete_if_unused(camera, surface)
    sync_volume_object(camera)


def surfaces_edited(camera) -> None:
    """Called by the properties when a surface pointer was edited."""
    if camera.is_evaluated or camera.type != "CAMERA" or not camera.is_editable:
        return
    for surface in surfaces_of(camera):
        _take_kind(surface)
    edit_mode.show_by_mode(camera)
    if camera.scfpf.enabled or camera.scfpf.volume_object:
        sync_volume_object(camera)


def flexibility_edited(camera) -> None:
    """Called by the property ``enabled`` when it was edited."""
    surfaces_edited(camera)
    if not camera.is_evaluated and camera.type == "CAMERA" and camera.is_editable:
        size_frame(camera)


def apply_preset(camera, preset, aspect: float, scale: float = 1.0) -> None:
    """Replace the camera's volume by a preset's, as ordinary editable objects.

    preset: projection.preset.Preset. aspect: width / height of the picture.
    scale: multiplies every length. Surfaces that are no children of the camera
    or are on another camera's list are taken off the list and kept. The ordinary
    lens and clip range follow. Raises FlexibleCameraError, PresetError or SurfaceError.
    """
    _require_camera(camera)
    if not (math.isfinite(scale) and scale > 0):
        raise FlexibleCameraError(f"A preset's scale must be a number above 0, not {scale}")
    require_own_items(camera.scfpf, SURFACES, MAPPINGS)
    fitted = preset.fitted(aspect)
    replace_surfaces(camera, [_scaled(surface, scale) for surface in fitted.surfaces])
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
    sizes = np.diag([scale, scale, scale, 1.0])
    approximate_lens(camera, fitted.projection(aspect).transformed(sizes))


def _scaled(surface, scale: float):
    """A preset's surface as ``replace_surfaces`` takes it, every length multiplied."""
    inputs = PARAMETRIC_KINDS[surface.kind].inputs if surface.kind in PARAMETRIC_KINDS else ()
    # Also those that only the drawing needs: the size of a point's cross.
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
    return surface.name, surface.kind, matrix, parameters, points


def replace_surfaces(camera, described) -> None:
    """Replace all surfaces by new ones.

    described: (name, kind, matrix in camera space, parameters, points) of each, as ``new_surface``.
    All of them exist before an old one goes: what fails, fails with the old volume whole.
    """
    require_own_items(camera.scfpf, SURFACES)
    made = []
    try:
        for name, kind, _, parameters, points in described:
            made.append(surface_object.new_surface(name, kind, parameters, points))
    except surface_object.SurfaceError:
        for surface in made:
            delete_with_data(surface)
        raise
    clear_surfaces(camera)
    for surface, (_, _, matrix, _, _) in zip(made, described, strict=True):
        _place(camera, surface, matrix)
        _insert(camera, surface)
    camera.scfpf.active_surface = 0


def approximate_lens(camera, projection: Projection) -> None:
    """Set the ordinary lens and clip range near to what a projection in camera space shows.

    The angle is the turn of the projectors from the left border to the right at
    mid height, clamped; where they do not spread, the lens is orthographic.
    Camera data that another object shares is copied first.
    """
    if camera.data.users - camera.data.use_fake_user > 1 or not camera.data.is_editable:
        camera.data = camera.data.copy()
    lens = camera.data
    lens.sensor_fit = "HORIZONTAL"
    lens.shift_x = lens.shift_y = 0.0
    line = np.linspace(0.0, 1.0, MEASURES)
    middle = projection.parameters(line, np.full(MEASURES, 0.5))
    near, far = (
        projection.volume.evaluate(middle.u, middle.v, np.full(MEASURES, t)).position for t in (0.0, 1.0)
    )
    x, z = (far - near)[[0, 2]]
    # The sum of small turns does not wrap at half a circle, as the angle between the borders would.
    steps = np.arctan2(x[:-1] * z[1:] - x[1:] * z[:-1], x[1:] * x[:-1] + z[1:] * z[:-1])
    # Beside a round picture the volume goes on, and its projectors turn any way.
    turn = steps[middle.mask[1:] & middle.mask[:-1]].sum()
    if turn < NARROWEST_LENS:
        lens.type = "ORTHO"
        width = sum(np.linalg.norm(end[:, -1] - end[:, 0]) for end in (near, far)) / 2
        lens.ortho_scale = max(width, SMALLEST_ORTHO)
    else:
        lens.type = "PERSP"
        lens.angle_x = min(turn, WIDEST_LENS)
    x, y, t = (axis.ravel() for axis in np.meshgrid(line, line, line))
    all_over = projection.parameters(x, y)
    distance = np.linalg.norm(projection.volume.evaluate(all_over.u, all_over.v, t).position, axis=0)
    lens.clip_end = distance.max()
    lens.clip_start = max(distance.min(), lens.clip_end * SMALLEST_CLIP_SHARE)
    size_frame(camera)


def volume_from_camera(camera, scene) -> None:
    """Replace the camera's volume by its own frustum, from clip start to clip end.

    Takes in lens, shift, sensor fit and ``scene``'s resolution and pixel aspect.
    Raises FlexibleCameraError for a panoramic or custom camera, or one without depth.
    """
    _require_camera(camera)
    require_own_items(camera.scfpf, SURFACES, MAPPINGS)
    lens = camera.data
    try:
        near, far = frustum(camera, scene)
    except FrustumError as error:
        raise FlexibleCameraError(str(error)) from error
    sizes = np.linalg.norm(np.array(camera.matrix_world, np.float64)[:3, :3], axis=0)
    if not (np.isfinite(sizes).all() and sizes.min() > 0):
        raise FlexibleCameraError(f"'{camera.name}' has a scale of 0: clear it with Alt-S")
    # Children take the camera object's scale, its own view does not.
    undo_scale = np.diag([*(1 / sizes), 1.0])
    described = [
        (name, "PLANE", undo_scale @ end.matrix, {"width": end.width, "height": end.height}, None)
        for name, end in (("Near", near), ("Far", far))
    ]
    replace_surfaces(camera, described)
    settings = camera.scfpf
    settings.basis, settings.reparameterisation = "BEZIER", "RECTANGLE"
    clear_mappings(camera)
    settings.u_range = settings.v_range = (0.0, 1.0)
    width, height = far.width, far.height
    # As the ordinary camera: the side that its sensor is fitted to stays.
    is_wide = lens.sensor_fit == "HORIZONTAL" or (lens.sensor_fit == "AUTO" and width >= height)
    settings.fit, settings.fitted_aspect = "HEIGHT" if is_wide else "WIDTH", width / height
    make_flexible(camera)


def control_objects() -> set[str]:
    """Full names of control surfaces, volume objects and parts of Cycles rigs: no picture shows them.

    ``name_full`` tells a local object from a linked one of the same name.
    """
    names = {part.name_full for part in bpy.data.objects if is_rig_part(part)}
    for camera in all_cameras():
        volume = camera.scfpf.volume_object
        members = surfaces_of(camera) + grids_of(camera) + ([] if volume is None else [volume])
        names.update(member.name_full for member in members)
    return names
