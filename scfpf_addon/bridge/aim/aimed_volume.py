# SPDX-License-Identifier: GPL-3.0-or-later
"""Volumes that Aim solves, as Blender's surface objects, and the volume that each began with.

A solution starts from the volume before the first one, or else every Solve would move the background on. The
surfaces keep that start, and a digest of the solution: after any other edit the volume is a new start.
"""

from __future__ import annotations

import hashlib

import bpy
import numpy as np

from ...aim.solver.start import start_volume
from ...projection.surfaces.nurbs import NurbsPatch
from ...projection.typing import Array
from ...projection.user_error import UserError
from ...projection.volume.viewing_volume import Projection
from ..blender.slot_animation import MAPPINGS, SURFACES, require_own_items
from ..camera.flexible_camera import NewSurface, make_flexible, replace_surfaces
from ..mappings.mapping_edits import clear_mappings
from ..surfaces import nurbs_object

# Custom properties of a solved surface: the coordinates of its start, and the digest of its solution.
START_KEY, DIGEST_KEY = "scfpf_aim_start", "scfpf_aim_digest"

Patches = tuple[NurbsPatch, ...]


def moved(patches: Patches, matrix: Array) -> Patches:
    """Patches with their points transformed by an affine (4, 4) matrix."""
    return tuple(
        NurbsPatch(np.asarray(p.points)[..., :3] @ matrix[:3, :3].T + matrix[:3, 3]) for p in patches
    )


def start_of(camera) -> Patches | None:
    """The start of a camera's solved volume, in camera space; None if the volume is no solution any more."""
    found = []
    for slot in camera.scfpf.surfaces:
        surface = slot.object
        if surface is None or surface.type != "SURFACE" or surface.get(DIGEST_KEY) != _digest(surface):
            return None
        spline = surface.data.splines[0]
        points = np.array(surface[START_KEY][:], np.float64)
        if points.size != 3 * spline.point_count_u * spline.point_count_v:
            return None
        found.append(NurbsPatch(points.reshape(spline.point_count_v, spline.point_count_u, 3)))
    settings = camera.scfpf
    is_plain = settings.basis == "BEZIER" and settings.reparameterisation == "RECTANGLE"
    is_whole = tuple(settings.u_range) == tuple(settings.v_range) == (0.0, 1.0)
    return tuple(found) if found and is_plain and is_whole and not len(settings.mappings) else None


def _digest(surface) -> str:
    """A digest of everything that a solution writes to a surface: its points, shapes and place."""
    if len(surface.data.splines) != 1:
        return ""
    spline = surface.data.splines[0]
    shapes = [(4, spline.points)]
    if surface.data.shape_keys is not None:
        shapes += [(3, key.data) for key in surface.data.shape_keys.key_blocks]
    # ``matrix_local`` depends on what has been evaluated.
    place = surface.matrix_parent_inverse @ surface.matrix_basis
    digest = hashlib.sha1(np.array(place, np.float32).tobytes())
    for size, shape in shapes:
        values = np.empty(size * len(shape), np.float32)
        shape.foreach_get("co", values)
        digest.update(values.tobytes())
    digest.update(bytes([spline.order_u, spline.order_v, len(surface.modifiers)]))
    return digest.hexdigest()


def new_start(
    projection: Projection, width: int, settings, subject: float | None, far: float
) -> tuple[Patches, float]:
    """A projection as the patches that a camera's settings of Aim ask for, and their error in pixels.

    subject, far: as for ``start_volume``. Raises UserError.
    """
    net = settings.columns, settings.rows
    start = start_volume(projection, width, net, settings.degree, subject, far)
    if not all(np.isfinite(patch.points).all() for patch in start.patches):
        raise UserError("The volume has no finite control points: check its control surfaces")
    return start.patches, start.error


def fits(patches: Patches, settings) -> bool:
    """Return whether patches have the net and the degree that settings of Aim ask for."""
    shape = (settings.rows, settings.columns)
    return len(patches) == settings.degree + 1 and all(p.points.shape[:2] == shape for p in patches)


def present_patches(camera) -> Patches:
    """The patches of a solved volume, in camera space, without their shape keys' effect."""
    return tuple(NurbsPatch(_points(slot.object)) for slot in camera.scfpf.surfaces)


def _points(surface) -> Array:
    points: Array = nurbs_object.read_parameters(surface)["points"][..., :3]
    return points


def write_volume(camera, start: Patches, solved: Patches) -> None:
    """Make a camera's volume a solution: on its present surfaces if they are one of as many points.

    start, solved: in camera space. Raises UserError before anything has changed.
    """
    require_own_items(camera.scfpf, SURFACES, MAPPINGS)
    if start_of(camera) is None or not _has_room(camera, solved):
        last = len(solved) - 1
        names = ["Near" if k == 0 else "Far" if k == last else f"Surface {k + 1}" for k in range(last + 1)]
        names = [f"{camera.name} {name}" for name in names]
        replace_surfaces(
            camera,
            [
                NewSurface(name, nurbs_object.KIND, np.eye(4), points=patch.points)
                for name, patch in zip(names, solved, strict=True)
            ],
        )
        clear_mappings(camera)
        settings = camera.scfpf
        settings.basis, settings.reparameterisation, settings.fit = "BEZIER", "RECTANGLE", "NONE"
        settings.u_range = settings.v_range = (0.0, 1.0)
        make_flexible(camera)
    for slot, patch in zip(camera.scfpf.surfaces, start, strict=True):
        surface = slot.object
        if surface.data.users > 1:
            surface.data = surface.data.copy()
        _clear_shapes(surface)
        surface[START_KEY] = np.asarray(patch.points, np.float64).ravel().tolist()
    write_points(camera, solved)
    note_solution(camera)


def _clear_shapes(surface) -> None:
    """Remove shape keys, and their action if nothing else uses it."""
    keys = surface.data.shape_keys
    if keys is None:
        return
    action = None if keys.animation_data is None else keys.animation_data.action
    surface.shape_key_clear()
    if action is not None and action.users == 0 and action.is_editable:
        bpy.data.actions.remove(action)


def _has_room(camera, patches: Patches) -> bool:
    present = [_points(slot.object).shape for slot in camera.scfpf.surfaces]
    return present == [np.shape(patch.points) for patch in patches]


def is_keyed(camera) -> bool:
    """Return whether shape keys move the surfaces of a camera."""
    return any(getattr(slot.object.data, "shape_keys", None) for slot in camera.scfpf.surfaces if slot.object)


def write_points(camera, solved: Patches) -> None:
    """Write the points of a volume that ``write_volume`` has made; ``note_solution`` ends such edits."""
    for slot, patch in zip(camera.scfpf.surfaces, solved, strict=True):
        nurbs_object.write_parameters(slot.object, {"points": np.asarray(patch.points)})


def note_solution(camera) -> None:
    """Note that the present points of a camera's surfaces are a solution."""
    for slot in camera.scfpf.surfaces:
        slot.object[DIGEST_KEY] = _digest(slot.object)
