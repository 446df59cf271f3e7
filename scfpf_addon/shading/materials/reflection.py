# SPDX-License-Identifier: GPL-3.0-or-later
"""Reflections off rough surfaces: one direction, drawn from the GGX facets that the viewer sees.

Heitz 2018, Sampling the GGX distribution of visible normals. α is the square of Blender's roughness.
"""

from __future__ import annotations

from functools import lru_cache

import numpy as np

from ...projection.typing import Array
from ..nodes.context import dot, unit

# Below this a surface is a mirror: reflections are blurred by less than a fifth of a degree.
MIRROR_ROUGHNESS = 0.04
# Steps of the table of how much light facets send on at once, by cosine and roughness, and draws for each.
STEPS, DRAWS = 24, 1024
# Ratios of a sequence that fills the square evenly (Roberts 2018).
EVEN = np.array([0.7548776662466927, 0.5698402909980532])


def axes(normal: Array) -> tuple[Array, Array]:
    """Two directions across unit normals (3, n) (Duff et al. 2017)."""
    x, y, z = normal
    sign = np.copysign(1.0, z)
    a = -1.0 / (sign + z)
    b = x * y * a
    return np.stack([1.0 + sign * x * x * a, sign * b, -sign * x]), np.stack([b, sign + y * y * a, -y])


def visible_facets(view: Array, alpha: Array, share: Array) -> Array:
    """Normals (3, n) of facets that are seen, about +Z. view: (3, n) unit, z >= 0. alpha: (n,). share: (2, n)
    in [0, 1).
    """
    stretched = unit(np.stack([alpha * view[0], alpha * view[1], view[2]]))
    flat = np.hypot(stretched[0], stretched[1])
    upright = flat < 1e-9
    safe = np.where(upright, 1.0, flat)
    nothing = np.zeros_like(flat)
    first = np.stack(
        [np.where(upright, 1.0, -stretched[1] / safe), np.where(upright, 0.0, stretched[0] / safe), nothing]
    )
    second = np.cross(stretched, first, axis=0)
    radius, turn = np.sqrt(share[0]), 2.0 * np.pi * share[1]
    across, along = radius * np.cos(turn), radius * np.sin(turn)
    lift = 0.5 * (1.0 + stretched[2])
    along = (1.0 - lift) * np.sqrt(np.maximum(1.0 - across**2, 0.0)) + lift * along
    up = np.sqrt(np.maximum(1.0 - across**2 - along**2, 0.0))
    facet = across * first + along * second + up * stretched
    return unit(np.stack([alpha * facet[0], alpha * facet[1], np.maximum(facet[2], 1e-9)]))


def seen_share(cosine: Array, alpha: Array) -> Array:
    """Λ of Smith's masking: 1 / (1 + Λ) of the facets are seen under a cosine."""
    cosine = np.maximum(cosine, 1e-9)
    result: Array = 0.5 * (np.sqrt(1.0 + alpha**2 * (1.0 / cosine**2 - 1.0)) - 1.0)
    return result


def passed_on(view: Array, way: Array, alpha: Array) -> Array:
    """Share of what visible facets reflect along ``way`` that no other facet stops, (n,): G₂ / G₁."""
    seen, lit = seen_share(view[2], alpha), seen_share(way[2], alpha)
    share: Array = np.where(way[2] > 0.0, (1.0 + seen) / (1.0 + seen + lit), 0.0)
    return share


@lru_cache(maxsize=1)
def _once() -> Array:
    """Light that facets send on at once, (STEPS, STEPS) by cosine and by roughness."""
    share = (np.arange(DRAWS)[:, None] * EVEN % 1.0).T
    table = np.ones((STEPS, STEPS))
    for row in range(STEPS):
        cosine = max(row / (STEPS - 1), 1e-3)
        view = np.repeat([[np.sqrt(1.0 - cosine**2)], [0.0], [cosine]], DRAWS, axis=1)
        for column in range(1, STEPS):
            alpha = np.full(DRAWS, (column / (STEPS - 1)) ** 2)
            facet = visible_facets(view, alpha, share)
            way = 2.0 * dot(facet, view) * facet - view
            table[row, column] = passed_on(view, way, alpha).mean()
    return table


def sent_on_at_once(cosine: Array, roughness: Array) -> Array:
    """Share of light that leaves a rough white surface after one facet, (n,)."""
    row, column = np.clip(cosine, 0.0, 1.0) * (STEPS - 1), np.clip(roughness, 0.0, 1.0) * (STEPS - 1)
    low = np.minimum(row.astype(np.intp), STEPS - 2)
    left = np.minimum(column.astype(np.intp), STEPS - 2)
    up, along = row - low, column - left
    flat, corner = _once().reshape(-1), low * STEPS + left
    below = flat[corner] * (1.0 - along) + flat[corner + 1] * along
    above = flat[corner + STEPS] * (1.0 - along) + flat[corner + STEPS + 1] * along
    found: Array = below * (1.0 - up) + above * up
    return found


def reflected(
    ahead: Array, normal: Array, flat: Array, roughness: Array, share: Array
) -> tuple[Array, Array, Array]:
    """A direction (3, n) off a rough surface, its share of the light (n,), and the cosine to the facet (n,).

    ahead: (3, n) unit, towards the surface. normal, flat: (3, n) unit, of shading and of the triangle, on the
    side that is seen. roughness: (n,) of Blender. share: (2, n) in [0, 1).
    """
    view = -ahead
    first, second = axes(normal)
    local = np.concatenate([dot(first, view), dot(second, view), np.maximum(dot(normal, view), 1e-4)])
    local = unit(local)
    alpha = roughness**2
    facet = visible_facets(local, alpha, share)
    cosine = dot(facet, local)[0]
    way = 2.0 * cosine * facet - local
    direction = first * way[0] + second * way[1] + normal * way[2]
    passed = passed_on(local, way, alpha)
    return unit(direction), np.where(dot(direction, flat)[0] > 0.0, passed, 0.0), np.maximum(cosine, 0.0)
