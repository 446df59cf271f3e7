# SPDX-License-Identifier: GPL-3.0-or-later
"""Operations that read the surface at hits: coordinates, layers, normals, Fresnel terms, normal maps."""

from __future__ import annotations

import numpy as np

from ...projection.typing import Array
from ..vectors import dot_row, unit
from .context import ShadingContext, fit
from .graph import Evaluator, Inputs, Settings

# The least cosine between a mapped normal and the view: normals face the viewer.
LEAST_FACING = 1e-4


def layer(inputs: Inputs, settings: Settings, context: ShadingContext) -> tuple[Array, ...]:
    """A layer of the mesh: as a vector or colour, its mean, its fourth channel, and 1 where it exists."""
    value, there = context.layer(settings["name"], settings["channels"])
    # Without the layer alpha is 1, as in Cycles.
    alpha = np.where(there > 0.0, value[3:4], 1.0) if settings["channels"] == 4 else there
    three = fit(value, 3)
    number = three.mean(axis=0, keepdims=True) if settings["channels"] > 1 else value
    return three, number, alpha, there


def position(inputs: Inputs, settings: Settings, context: ShadingContext) -> tuple[Array, ...]:
    """World position, moved by a matrix (4, 4): to an object's or the camera's space."""
    matrix = settings.get("matrix")
    if matrix is None:
        return (context.position,)
    return (np.einsum("ij,jn->in", matrix[:3, :3], context.position) + matrix[:3, 3:],)


def geometry(inputs: Inputs, settings: Settings, context: ShadingContext) -> tuple[Array, ...]:
    """The Geometry node: normal, true normal, incoming, backfacing."""
    return context.normal, context.flat, context.view, context.back


def reflection(inputs: Inputs, settings: Settings, context: ShadingContext) -> tuple[Array, ...]:
    """The Texture Coordinate node's Reflection: the mirrored view direction."""
    return (2.0 * dot_row(context.normal, context.view) * context.normal - context.view,)


def fresnel_dielectric(cosine: Array, ior: Array) -> Array:
    """Share of unpolarised light that a boundary reflects, (1, n); 1 beyond the critical angle.

    cosine: to the normal, on the side of the light. ior: of the far side over the near side.
    """
    cosine = np.clip(np.abs(cosine), 0.0, 1.0)
    g = ior**2 - 1.0 + cosine**2
    within = g > 0.0
    g = np.sqrt(np.where(within, g, 1.0))
    across = (g - cosine) / (g + cosine)
    along = ((g + cosine) * cosine - 1.0) / np.where(within, (g - cosine) * cosine + 1.0, 1.0)
    return np.where(within, 0.5 * across**2 * (1.0 + along**2), 1.0)


def fresnel(inputs: Inputs, settings: Settings, context: ShadingContext) -> tuple[Array, ...]:
    """The Fresnel node: IOR, normal."""
    ior, normal = np.maximum(inputs[0], 1e-5), inputs[1]
    ior = np.where(context.back > 0.0, 1.0 / ior, ior)
    return (fresnel_dielectric(dot_row(normal, context.view), ior),)


def layer_weight(inputs: Inputs, settings: Settings, context: ShadingContext) -> tuple[Array, ...]:
    """The Layer Weight node: blend, normal → Fresnel, Facing."""
    blend, normal = inputs
    ior = np.maximum(1.0 - blend, 1e-5)
    ior = np.where(context.back > 0.0, ior, 1.0 / ior)
    facing = np.abs(dot_row(normal, context.view))
    share = np.clip(blend, 0.0, 1.0 - 1e-5)
    # The blend bends the curve: exponent 2 b below a half, ½ / (1 - b) above.
    exponent = np.where(share < 0.5, 2.0 * share, 0.5 / (1.0 - share))
    facing = np.where(share != 0.5, np.power(np.maximum(facing, 0.0), exponent), facing)
    return fresnel_dielectric(dot_row(normal, context.view), ior), 1.0 - facing


def normal_map(inputs: Inputs, settings: Settings, context: ShadingContext) -> tuple[Array, ...]:
    """The Normal Map node: strength, colour → normal on the side of the viewer.

    Spaces are TANGENT, whose axes follow the texture coordinates, and WORLD.
    """
    strength, color = np.maximum(inputs[0], 0.0), inputs[1]
    around = 2.0 * color - 1.0
    # The side of the mesh's own normal.
    side = 1.0 - 2.0 * context.back
    normal = context.normal * side
    if settings["space"] == "WORLD":
        mapped = unit(around + np.zeros_like(normal))
        mapped = unit(normal + strength * (mapped - normal))
    else:
        tangent, turn = context.tangent(settings["layer"])
        bitangent = np.cross(normal, np.broadcast_to(tangent, normal.shape), axis=0) * turn
        height = 1.0 + np.minimum(strength, 1.0) * (around[2:3] - 1.0)
        mapped = unit(tangent * around[0:1] * strength + bitangent * around[1:2] * strength + normal * height)
        mapped = np.where((turn != 0.0) & (strength > 0.0), mapped, normal)
    return (towards_viewer(unit(mapped) * side, context),)


def towards_viewer(normal: Array, context: ShadingContext) -> Array:
    """Normals turned as little as possible to face the viewer; the surface's own instead of invalid ones."""
    valid = np.isfinite(normal).all(axis=0) & (dot_row(normal, normal) > 0.0)
    normal = np.where(valid, normal, context.normal)
    facing = dot_row(normal, context.view)
    turned = unit(normal + context.view * np.maximum(LEAST_FACING - facing, 0.0))
    return np.where(facing < LEAST_FACING, turned, normal)


def normal(inputs: Inputs, settings: Settings, context: ShadingContext) -> tuple[Array, ...]:
    """The shading normal, for unlinked sockets."""
    return (context.normal,)


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
