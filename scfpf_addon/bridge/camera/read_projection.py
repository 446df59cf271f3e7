# SPDX-License-Identifier: GPL-3.0-or-later
"""The projection of a camera, as a depsgraph has evaluated it."""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np

from ...projection.mappings.stack import seen_through
from ...projection.presets.preset import MAXIMUM_SURFACES
from ...projection.surfaces.kinds import surface_from_parameters
from ...projection.surfaces.surface import ControlSurface, Grid
from ...projection.surfaces.uv_mesh import UVMesh
from ...projection.typing import Array
from ...projection.user_error import Message, UserError
from ...projection.volume.basis import WEIGHTED
from ...projection.volume.lattice import Lattice
from ...projection.volume.reparameterisation import reparameterisation
from ...projection.volume.viewing_volume import Projection, ViewingVolume
from ..blender.mesh_grid import grid_points, require_finite
from ..blender.scene_objects import absent_text, is_absent, missing_text
from ..mappings.read_mappings import read_mappings
from ..surfaces import lattice_object, nurbs_object
from ..surfaces.kinds import MESH_KINDS
from ..surfaces.surface_object import is_reshaped, surface_parameters
from ..surfaces.uv_mesh import read_reshaped, read_uv_mesh
from ..volume.volume_object import is_evaluated

# A transform has no size along an axis that it scales to less than this share of the longest: a float32
# matrix cannot separate such a scale from 0.
FLAT_SHARE = 1e-7
# Blender makes an infinite location the largest float32; squares of coordinates
# beyond this (Blender units) overflow float32.
LARGEST_COORDINATE = 1e18

# Projectors shorter than this share of the volume's extent have no length: float32 vertices cannot separate
# their ends.
COINCIDENT = 1e-7
# Projectors along each side of the image that are tested for that, and if none of these exists.
SAMPLES, MORE_SAMPLES = 5, 64


def read_projection(camera, depsgraph, aspect: float) -> Projection:
    """The camera's projection as evaluated, in world space, float64.

    depsgraph: evaluated, of the viewport or of a render. aspect: width / height of the image, > 0. Raises
    UserError.
    """
    if camera.type != "CAMERA":
        raise UserError("'{0}' is not a camera: select one", camera.name)
    if not (math.isfinite(aspect) and aspect > 0):
        raise UserError("The picture has no size: set its resolution in Output Properties")
    settings = camera.evaluated_get(depsgraph).scfpf
    listed = _listed_surfaces(camera)
    for axis, (start, end) in (("U", settings.u_range), ("V", settings.v_range)):
        if start == end:
            raise UserError("The {0} range of '{1}' is empty: give it two different ends", axis, camera.name)
    surfaces = [read_surface(surface, camera.original, depsgraph) for surface in listed]
    mappings = read_mappings(camera, depsgraph)
    projection = Projection(
        volume=_volume(camera.name, surfaces, settings),
        reparameterisation=seen_through(mappings, reparameterisation(settings.reparameterisation)),
        u_range=tuple(settings.u_range),
        v_range=tuple(settings.v_range),
        aspect=aspect,
    )
    points = _some_projectors(projection)
    if points.shape[2] == 0:
        raise UserError(
            "'{0}' has no projector: the UV maps of its control surfaces and the ranges of U "
            "and V have no place in common; move islands in the UV Editor, or widen the "
            "ranges",
            camera.name,
        )
    if np.ptp(points, axis=0).max() <= COINCIDENT * np.ptp(points, axis=(0, 2)).max():
        raise UserError(
            "All control surfaces of '{0}' lie in one place, so that no projector has a length: {1}",
            camera.name,
            _way_out(listed),
        )
    return projection


def read_own_projection(camera, depsgraph, aspect: float) -> Projection:
    """``read_projection`` in camera space."""
    projection = read_projection(camera, depsgraph, aspect)
    return projection.transformed(world_to_camera(camera.evaluated_get(depsgraph)))


def world_to_camera(camera) -> Array:
    """The (4, 4) matrix from world space to the space of a camera's children. Raises UserError."""
    return world_to_own(camera)


def world_to_own(obj) -> Array:
    """The (4, 4) matrix from world space to an object's own. Raises UserError for a scale of 0."""
    world = np.array(obj.matrix_world, np.float64)
    if abs(np.linalg.det(world[:3, :3])) < np.finfo(np.float32).tiny:
        raise UserError("'{0}' has a scale of 0: clear it with Alt-S", obj.name)
    return np.linalg.inv(world)


def _listed_surfaces(camera) -> list:
    """The objects on a camera's list, at least two or one lattice. Raises UserError."""
    slots = camera.original.scfpf.surfaces
    if len(slots) < 2 and not is_lattice_volume(slots):
        raise UserError(
            "'{0}' has 1 control surface: a viewing volume needs at least two; add one in the camera's "
            "properties or load a preset"
            if slots
            else "'{0}' has no control surface: a viewing volume needs at least two; add one in the camera's "
            "properties or load a preset",
            camera.name,
        )
    if len(slots) > MAXIMUM_SURFACES:
        raise UserError(
            "'{0}' has {1} control surfaces: a volume may have {2} at most",
            camera.name,
            len(slots),
            MAXIMUM_SURFACES,
        )
    for number, slot in enumerate(slots, 1):
        if slot.object is None:
            raise UserError(
                "Control surface {0} of '{1}' is empty: choose an object for it or remove it",
                number,
                camera.name,
            )
    return [slot.object for slot in slots]


def _some_projectors(projection: Projection) -> Array:
    """The control points, (surfaces, 3, N), of some projectors of the image; N is 0 if none is found.

    UV meshes may have holes. If a coarse grid of image positions hits only holes, a finer one is sampled, and
    then the middles of the UV triangles.
    """
    (u0, u1), (v0, v1) = projection.u_range, projection.v_range
    for count in (SAMPLES, MORE_SAMPLES):
        v, u = (axis.ravel() for axis in np.meshgrid(*[(np.arange(count) + 0.5) / count] * 2))
        points, valid = projection.volume.projectors(u0 + (u1 - u0) * u, v0 + (v1 - v0) * v)
        if valid.any():
            return points[..., valid]
    charts = [surface.chart for surface in projection.volume.surfaces if isinstance(surface, UVMesh)]
    middles = np.concatenate([np.zeros((0, 2)), *(chart.uv[chart.used].mean(axis=1) for chart in charts)])
    u, v = middles[((middles >= (u0, v0)) & (middles <= (u1, v1))).all(axis=1)].T
    points, valid = projection.volume.projectors(u, v)
    return points[..., valid]


def _way_out(surfaces) -> str:
    """The remedy for control surfaces that lie in one place."""
    twice = next((one for number, one in enumerate(surfaces) if one in surfaces[:number]), None)
    if twice is None:
        return "move one of them"
    return f"'{twice.name}' is on the list twice: choose another object in one place"


class PlacedLattice(NamedTuple):
    """A lattice with its matrix (4, 4), own space to world space."""

    lattice: Lattice
    matrix: np.ndarray


def is_lattice_volume(slots) -> bool:
    """Return whether a camera's list is one lattice, which is a volume by itself."""
    return (
        len(slots) == 1
        and slots[0].object is not None
        and slots[0].object.scfpf_surface.kind == lattice_object.KIND
    )


def _volume(name: str, read: list[ControlSurface | PlacedLattice], settings) -> ViewingVolume:
    """The volume of one lattice, or of control surfaces in order."""
    first = read[0]
    if len(read) == 1 and isinstance(first, PlacedLattice):
        if len(first.lattice.moved) < 2:
            raise UserError(
                "The lattice of '{0}' has one layer: give it two or more points along W, or the "
                "camera another control surface",
                name,
            )
        return first.lattice.volume(first.matrix)
    surfaces: list[ControlSurface] = []
    weights: list[float] = []
    for slot, one in zip(settings.surfaces, read, strict=True):
        layers = one.lattice.layers(one.matrix) if isinstance(one, PlacedLattice) else [one]
        surfaces += layers
        weights += [slot.weight] * len(layers)
    return ViewingVolume(
        tuple(surfaces), settings.basis, tuple(weights) if settings.basis in WEIGHTED else None
    )


def read_surface(surface, camera, depsgraph) -> ControlSurface | PlacedLattice:
    """One control surface of a camera in world space."""
    name, kind = surface.name, surface.scfpf_surface.kind
    if lost := missing_text(surface):
        raise UserError("Control surface {0}", lost)
    if is_absent(surface, depsgraph.scene):
        lost = absent_text(surface, depsgraph.scene, Message("remove it from the list with -"), camera)
        raise UserError("Control surface {0}", lost)
    if surface.type not in {"MESH", "SURFACE", "LATTICE"}:
        raise UserError(
            "'{0}' is of type {1}, neither a mesh nor a surface nor a lattice: remove it from "
            "the camera's list",
            name,
            surface.type.title(),
        )
    if surface.type == "SURFACE" and kind not in {"NONE", nurbs_object.KIND}:
        raise UserError("'{0}' is a surface object: set its kind to {1}", name, nurbs_object.TITLE)
    if surface.type == "LATTICE" and kind not in {"NONE", lattice_object.KIND}:
        raise UserError("'{0}' is a lattice: set its kind to {1}", name, lattice_object.TITLE)
    if kind == "NONE":
        raise UserError(
            "'{0}' is not a control surface: choose its kind, or remove it from the camera's list", name
        )
    if not is_evaluated(camera, surface, depsgraph):
        raise UserError(
            "Control surface '{0}' is hidden and the camera's volume object is missing or "
            "disabled, so that its present shape is unknown: show it, or press Render, which "
            "restores the volume object",
            name,
        )
    evaluated = surface.evaluated_get(depsgraph)
    matrix = _matrix(evaluated)
    if kind == "UV_MESH":
        return read_uv_mesh(evaluated, matrix)
    if kind == nurbs_object.KIND:
        return nurbs_object.read_patch(evaluated, depsgraph.mode).transformed(matrix)
    if kind == lattice_object.KIND:
        return PlacedLattice(lattice_object.read_lattice(evaluated), matrix)
    if kind in MESH_KINDS:
        points = grid_points(evaluated)
        require_finite(name, points)
        return _of_mesh(points, kind, matrix)
    if kind != "POINT" and is_reshaped(evaluated, depsgraph.mode):
        return read_reshaped(evaluated, matrix)
    parameters = surface_parameters(evaluated)
    for key, value in parameters.items():
        if not math.isfinite(value):
            raise UserError(
                "The {0} of '{1}' is not finite: check its animation and drivers", key.replace("_", " "), name
            )
    return surface_from_parameters(kind, parameters, None, matrix)


def _of_mesh(points, kind: str, matrix) -> ControlSurface:
    """The surface of a mesh: a patch only if it has four vertices; a modifier may have made it a grid."""
    if kind == "PATCH" and points.shape[:2] == (2, 2):
        return surface_from_parameters("PATCH", {}, points, matrix)
    return Grid(points, matrix=matrix)


def _matrix(evaluated):
    """The (4, 4) float64 matrix of an object, if it is finite and keeps a size along each axis."""
    name = evaluated.name
    matrix = np.array(evaluated.matrix_world, np.float64)
    if not (np.abs(matrix) < LARGEST_COORDINATE).all():
        raise UserError(
            "The location, rotation or scale of '{0}' is not finite or far too large: clear "
            "it with Alt-G, Alt-R and Alt-S",
            name,
        )
    sizes = np.linalg.svd(matrix[:3, :3], compute_uv=False)
    if evaluated.scfpf_surface.kind != "POINT" and sizes[-1] <= FLAT_SHARE * sizes[0]:
        raise UserError(
            "'{0}' has no size along at least one axis: no scale, its own or a parent's, may be 0", name
        )
    return matrix
