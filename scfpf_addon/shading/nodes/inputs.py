# SPDX-License-Identifier: GPL-3.0-or-later
"""Operations that ask what is at the hit: coordinates, layers, normals, Fresnel terms, normal maps."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np

from ...projection.typing import Array
from ..vectors import dot_row, unit
from .context import ShadingContext, fit
from .graph import Evaluator

Settings = Mapping[str, Any]
Inputs = Sequence[Array]

# The least cosine between a mapped normal and the view: a surface is not seen from behind.
LEAST_FACING = 1e-4


def layer(inputs: Inputs, settings: Settings, place: ShadingContext) -> tuple[Array, ...]:
    """What is stored on triangles: as a vector or colour, its mean, its fourth channel, whether it is."""
    value, there = place.layer(settings["name"], settings["channels"])
    # Alpha of what is not there is 1, as in Cycles.
    alpha = np.where(there > 0.0, value[3:4], 1.0) if settings["channels"] == 4 else there
    three = fit(value, 3)
    number = three.mean(axis=0, keepdims=True) if settings["channels"] > 1 else value
    return three, number, alpha, there


def position(inputs: Inputs, settings: Settings, place: ShadingContext) -> tuple[Array, ...]:
    """World position, moved by a matrix (4, 4): to an object's or the camera's space."""
    matrix = settings.get("matrix")
    if matrix is None:
        return (place.position,)
    return (np.einsum("ij,jn->in", matrix[:3, :3], place.position) + matrix[:3, 3:],)


def geometry(inputs: Inputs, settings: Settings, place: ShadingContext) -> tuple[Array, ...]:
    """The Geometry node: normal, true normal, incoming, backfacing."""
    return place.normal, place.flat, place.view, place.back


def reflection(inputs: Inputs, settings: Settings, place: ShadingContext) -> tuple[Array, ...]:
    """The Texture Coordinate node's Reflection: where the view is mirrored to."""
    return (2.0 * dot_row(place.normal, place.view) * place.normal - place.view,)


def fresnel_dielectric(cosine: Array, ior: Array) -> Array:
    """Share of unpolarised light that a boundary reflects, (1, n); all of it beyond the critical angle.

    cosine: to the normal, on the side that light comes from. ior: of the far side, over the near.
    """
    cosine = np.clip(np.abs(cosine), 0.0, 1.0)
    g = ior**2 - 1.0 + cosine**2
    within = g > 0.0
    g = np.sqrt(np.where(within, g, 1.0))
    across = (g - cosine) / (g + cosine)
    along = ((g + cosine) * cosine - 1.0) / np.where(within, (g - cosine) * cosine + 1.0, 1.0)
    return np.where(within, 0.5 * across**2 * (1.0 + along**2), 1.0)


def fresnel(inputs: Inputs, settings: Settings, place: ShadingContext) -> tuple[Array, ...]:
    """The Fresnel node: IOR, normal."""
    ior, normal = np.maximum(inputs[0], 1e-5), inputs[1]
    ior = np.where(place.back > 0.0, 1.0 / ior, ior)
    return (fresnel_dielectric(dot_row(normal, place.view), ior),)


def layer_weight(inputs: Inputs, settings: Settings, place: ShadingContext) -> tuple[Array, ...]:
    """The Layer Weight node: blend, normal → Fresnel, Facing."""
    blend, normal = inputs
    ior = np.maximum(1.0 - blend, 1e-5)
    ior = np.where(place.back > 0.0, ior, 1.0 / ior)
    facing = np.abs(dot_row(normal, place.view))
    share = np.clip(blend, 0.0, 1.0 - 1e-5)
    # The blend bends the curve: exponent 2 b below a half, ½ / (1 - b) above.
    exponent = np.where(share < 0.5, 2.0 * share, 0.5 / (1.0 - share))
    facing = np.where(share != 0.5, np.power(np.maximum(facing, 0.0), exponent), facing)
    return fresnel_dielectric(dot_row(normal, place.view), ior), 1.0 - facing


def normal_map(inputs: Inputs, settings: Settings, place: ShadingContext) -> tuple[Array, ...]:
    """The Normal Map node: strength, colour → normal on the side of the viewer.

    TANGENT: over the directions in which texture coordinates grow. WORLD: as it is.
    """
    strength, color = np.maximum(inputs[0], 0.0), inputs[1]
    around = 2.0 * color - 1.0
    # Side of the normal that a mesh has.
    side = 1.0 - 2.0 * place.back
    normal = place.normal * side
    if settings["space"] == "WORLD":
        mapped = unit(around + np.zeros_like(normal))
        mapped = unit(normal + strength * (mapped - normal))
    else:
        tangent, turn = place.tangent(settings["layer"])
        bitangent = np.cross(normal, np.broadcast_to(tangent, normal.shape), axis=0) * turn
        height = 1.0 + np.minimum(strength, 1.0) * (around[2:3] - 1.0)
        mapped = unit(tangent * around[0:1] * strength + bitangent * around[1:2] * strength + normal * height)
        mapped = np.where((turn != 0.0) & (strength > 0.0), mapped, normal)
    return (towards_viewer(unit(mapped) * side, place),)


def towards_viewer(normal: Array, place: ShadingContext) -> Array:
    """Normals turned as little as makes them face the viewer; what is no direction is the place's own."""
    normal = np.where(np.isfinite(normal).all(axis=0) & (dot_row(normal, normal) > 0.0), normal, place.normal)
    facing = dot_row(normal, place.view)
    turned = unit(normal + place.view * np.maximum(LEAST_FACING - facing, 0.0))
    return np.where(facing < LEAST_FACING, turned, normal)


def normal(inputs: Inputs, settings: Settings, place: ShadingContext) -> tuple[Array, ...]:
    """The shading normal, for sockets to which nothing is linked."""
    return (place.normal,)


OPERATIONS: dict[str, Evaluator] = {
    "FRESNEL": fresnel,
    "GEOMETRY": geometry,
    "LAYER": layer,
    "LAYER_WEIGHT": layer_weight,
    "NORMAL": normal,
    "NORMAL_MAP": normal_map,
    "POSITION": position,
    "REFLECTION": reflection,
}
