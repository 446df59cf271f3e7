# SPDX-License-Identifier: GPL-3.0-or-later
"""A camera's volume and mappings as a preset."""

from __future__ import annotations

import re

import numpy as np

from ...projection.presets.preset import Preset, PresetError, load_preset, preset_to_json
from ...projection.presets.stored_surface import stored_surface
from ...projection.surfaces.kinds import FILE_KINDS, SURFACE_KINDS
from ...projection.user_error import UserError
from ...projection.volume.viewing_volume import Projection
from ..mappings.read_mappings import stored_mappings
from ..surfaces.surface_object import surface_parameters
from .read_projection import read_projection, world_to_camera

# The number that Blender appends to the names of copies.
NUMBERED = re.compile(r"\.\d{3}$")
# Parameters that are angles, radians.
ANGLES = {one.name for kind in SURFACE_KINDS.values() for one in kind.parameters if one.is_angle}


def preset_of(camera, depsgraph, aspect: float, name: str, description: str = "", group: str = "") -> Preset:
    """The camera's volume and mappings as a preset, as evaluated.

    aspect: of the image. Surfaces that a file cannot hold become grids. Raises PresetError, UserError
    or UserError.
    """
    projection = read_projection(camera, depsgraph, aspect)
    evaluated = camera.evaluated_get(depsgraph)
    settings, inward = evaluated.scfpf, world_to_camera(evaluated)
    try:
        surfaces = _surfaces(camera, depsgraph, projection.transformed(inward), inward)
    except UserError as error:
        raise PresetError("The volume cannot be saved: {0}", error) from error
    preset = Preset(
        name=name.strip(),
        description=description.strip(),
        source="",
        basis=projection.volume.basis,
        reparameterisation=settings.reparameterisation,
        u_range=projection.u_range,
        v_range=projection.v_range,
        aspect=aspect,
        fit=settings.fit,
        surfaces=surfaces,
        group=group.strip(),
        mappings=stored_mappings(camera, depsgraph),
    )
    # Reading checks that other readers accept the preset.
    return load_preset(preset_to_json(preset))


def _surfaces(camera, depsgraph, projection: Projection, inward) -> tuple:
    """The surfaces of a preset. projection: in camera space. inward: (4, 4), world space to camera space."""
    slots = camera.original.scfpf.surfaces
    volume = projection.volume
    if len(slots) != len(volume.surfaces):
        # Lattices consist of several layers.
        weights = volume.weights or [1.0] * len(volume.surfaces)
        return tuple(
            stored_surface(f"Surface {number}", surface, weight)
            for number, (surface, weight) in enumerate(zip(volume.surfaces, weights, strict=True), 1)
        )
    evaluated = camera.evaluated_get(depsgraph).scfpf.surfaces
    return tuple(
        stored_surface(
            NUMBERED.sub("", slot.object.name),
            surface,
            now.weight,
            **_description(slot.object, depsgraph, inward),
        )
        for slot, now, surface in zip(slots, evaluated, volume.surfaces, strict=True)
    )


def _description(obj, depsgraph, inward) -> dict[str, object]:
    """The kind, parameters, points and matrix of a surface; empty if these do not describe it."""
    kind = obj.scfpf_surface.kind
    if kind == "UV_MESH":
        return {"kind": kind}
    if kind not in FILE_KINDS:
        return {}
    seen = obj.evaluated_get(depsgraph)
    try:
        parameters = surface_parameters(seen)
    except UserError:
        return {}
    points = parameters.pop("points", None)
    matrix = inward @ np.array(seen.matrix_world, np.float64)
    parameters = {key: _short(key, value) for key, value in parameters.items()}
    return {"kind": kind, "parameters": parameters, "points": points, "matrix": matrix}


def _short(key: str, value: float) -> float:
    """A float32 parameter rounded to its seven digits: a full turn is 360 degrees, not 360.00001."""
    if key in ANGLES:
        return float(np.radians(float(f"{np.degrees(value):.7g}")))
    return float(f"{value:.7g}")
