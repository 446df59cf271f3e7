# SPDX-License-Identifier: GPL-3.0-or-later
"""Random reflections off rough surfaces, in proportion to the GGX facets that the viewer sees.

Heitz 2018, Sampling the GGX distribution of visible normals; Dupuy and Benyoub 2023, Sampling visible GGX
normals with spherical caps. α is the square of Blender's roughness.
"""

from __future__ import annotations

from functools import lru_cache

import numpy as np

from ...projection.typing import Array
from ..interpolation import bilinear
from ..vectors import dot_row, perpendicular, unit

# Below this roughness a surface is a mirror: reflections are blurred by less than a fifth of a degree.
MIRROR_ROUGHNESS = 0.04
# Steps of the table of albedo by cosine and roughness, and facets for each.
STEPS, FACETS = 24, 1024
# The step of R2, a sequence that fills the square evenly (Roberts 2018).
R2_STEP = np.array([0.7548776662466927, 0.5698402909980532])


def visible_normals(view: Array, alpha: Array, share: Array) -> Array:
    """Normals (3, n) of random facets that the viewer sees, about +Z.

    view: (3, n) unit, z >= 0. alpha: (n,). share: (2, n) random in [0, 1).
    """
    facet = unit(np.stack([alpha * view[0], alpha * view[1], view[2]]))
    # A mirror of the unit hemisphere reflects into a spherical cap, evenly.
    up = 1.0 - share[0] * (1.0 + facet[2])
    turn, out = 2.0 * np.pi * share[1], np.sqrt(np.maximum(1.0 - up**2, 0.0))
    facet[0] += out * np.cos(turn)
    facet[1] += out * np.sin(turn)
    facet[2] = np.maximum(facet[2] + up, 1e-9)
    facet[:2] *= alpha
    return unit(facet)


def smith_lambda(cosine: Array, alpha: Array) -> Array:
    """Λ of Smith's masking, (n,): under a cosine 1 / (1 + Λ) of the facets are visible."""
    cosine = np.maximum(cosine, 1e-9)
    result: Array = 0.5 * (np.sqrt(1.0 + alpha**2 * (1.0 / cosine**2 - 1.0)) - 1.0)
    return result


def masking_shadowing(view: Array, way: Array, alpha: Array) -> Array:
    """Share of the light of visible facets along ``way`` that no other facet blocks, (n,): G₂ / G₁."""
    seen, lit = smith_lambda(view[2], alpha), smith_lambda(way[2], alpha)
    share: Array = np.where(way[2] > 0.0, (1.0 + seen) / (1.0 + seen + lit), 0.0)
    return share


@lru_cache(maxsize=1)
def _albedo_table() -> Array:
    """Albedo of white facets by cosine and roughness, (1, STEPS, STEPS), of single scattering alone."""
    share = (np.arange(FACETS)[:, None] * R2_STEP % 1.0).T
    table = np.ones((STEPS, STEPS))
    alpha = ((np.arange(1, STEPS) / (STEPS - 1)) ** 2).repeat(FACETS)
    share = np.tile(share, STEPS - 1)
    for row in range(STEPS):
        cosine = max(row / (STEPS - 1), 1e-3)
        view = np.repeat([[np.sqrt(1.0 - cosine**2)], [0.0], [cosine]], len(alpha), axis=1)
        facet = visible_normals(view, alpha, share)
        way = 2.0 * dot_row(facet, view) * facet - view
        table[row, 1:] = masking_shadowing(view, way, alpha).reshape(STEPS - 1, FACETS).mean(axis=1)
    return table[None]


def single_scatter_albedo(cosine: Array, roughness: Array) -> Array:
    """Share of light that leaves a rough white surface after one facet, (n,)."""
    row, column = np.clip(cosine, 0.0, 1.0) * (STEPS - 1), np.clip(roughness, 0.0, 1.0) * (STEPS - 1)
    found: Array = bilinear(_albedo_table(), row, column)[0]
    return found


def reflected(
    ahead: Array, normal: Array, flat: Array, roughness: Array, share: Array
) -> tuple[Array, Array, Array]:
    """Directions (3, n) off a rough surface, their share of the light (n,), and the cosine to the facet (n,).

    ahead: (3, n) unit, towards the surface. normal, flat: (3, n) unit, of shading and of the triangle, on the
    visible side. roughness: (n,) of Blender. share: (2, n) random in [0, 1).
    """
    view = -ahead
    first, second = perpendicular(normal)
    local = np.concatenate(
        [dot_row(first, view), dot_row(second, view), np.maximum(dot_row(normal, view), 1e-4)]
    )
    local = unit(local)
    alpha = roughness**2
    facet = visible_normals(local, alpha, share)
    cosine = dot_row(facet, local)[0]
    way = 2.0 * cosine * facet - local
    direction = first * way[0] + second * way[1] + normal * way[2]
    passed = masking_shadowing(local, way, alpha)
    return unit(direction), np.where(dot_row(direction, flat)[0] > 0.0, passed, 0.0), np.maximum(cosine, 0.0)
