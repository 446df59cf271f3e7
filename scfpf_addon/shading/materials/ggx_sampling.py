# SPDX-License-Identifier: GPL-3.0-or-later
"""Random reflections off rough surfaces, in proportion to the GGX facets that the viewer sees.

Heitz 2018, Sampling the GGX distribution of visible normals; Dupuy and Benyoub 2023, Sampling visible GGX
normals with spherical caps. α is the square of Blender's roughness.
"""

from __future__ import annotations

from functools import lru_cache
from typing import NamedTuple

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


class Reflected(NamedTuple):
    """Reflections off rough surfaces.

    direction: (3, n) unit. passed: (n,) share of the light of rays by ``RoughLobe.sampled``. cosine: (n,) of
    view and facet. density: (n,) of these rays, per steradian.
    """

    direction: Array
    passed: Array
    cosine: Array
    density: Array


class RoughLobe(NamedTuple):
    """Reflection off rough surfaces at n places.

    axes: three (3, n) unit, the last of them the shading normal. view: (3, n) unit, towards the viewer along
    the axes, z > 0. alpha: (n,). flat: (3, n) unit normal of the triangles on the visible side.
    """

    axes: tuple[Array, Array, Array]
    view: Array
    alpha: Array
    flat: Array

    @classmethod
    def of(cls, ahead: Array, normal: Array, flat: Array, roughness: Array) -> RoughLobe:
        """The lobes under unit directions (3, n) towards the surface. roughness: (n,) of Blender."""
        axes = (*perpendicular(normal), normal)
        x, y, z = (dot_row(axis, -ahead) for axis in axes)
        return cls(axes, unit(np.concatenate([x, y, np.maximum(z, 1e-4)])), roughness**2, flat)

    def sampled(self, share: Array) -> Reflected:
        """Reflections off random facets that the viewer sees. share: (2, n) random in [0, 1)."""
        facet = visible_normals(self.view, self.alpha, share)
        way = 2.0 * dot_row(facet, self.view) * facet - self.view
        direction = unit(sum(axis * along for axis, along in zip(self.axes, way, strict=True)))
        return self._reflected(direction, way, facet)

    def along(self, direction: Array) -> Reflected:
        """Reflections in unit directions (3, n)."""
        way = np.concatenate([dot_row(axis, direction) for axis in self.axes])
        return self._reflected(direction, way, unit(way + self.view))

    def _reflected(self, direction: Array, way: Array, facet: Array) -> Reflected:
        """Reflections in directions (3, n). way, facet: (3, n), along the axes."""
        passed = masking_shadowing(self.view, way, self.alpha)
        passed *= dot_row(direction, self.flat)[0] > 0.0
        cosine = np.maximum(dot_row(facet, self.view)[0], 0.0)
        return Reflected(direction, passed, cosine, self._density(facet[2] ** 2, self.alpha**2))

    def met(self, towards: Array, solid_angle: Array) -> Array:
        """About the chances (K, n) of rays by ``sampled`` to be in solid angles (K, n) about (3, K, n)."""
        # Squared lengths of the half vector and of its part along the normal are all that is needed.
        across, along, up = (np.einsum("cn,ckn->kn", axis, towards) for axis in self.axes)
        x, y, z = across + self.view[0], along + self.view[1], up + self.view[2]
        cosine = z**2 / np.maximum(x**2 + y**2 + z**2, 1e-30)
        # As blurred as the solid angle is wide.
        squared = np.minimum(self.alpha**2 + solid_angle / np.pi, 1.0)
        chance: Array = np.minimum(self._density(cosine, squared) * solid_angle, 1.0)
        return chance

    def _density(self, cosine: Array, squared: Array) -> Array:
        """The density per steradian of directions off facets, by their squared cosines to the normal.

        squared: α squared. Both (n,) or (K, n).
        """
        spread = 1.0 + (squared - 1.0) * cosine
        density: Array = squared / (np.pi * np.maximum(spread**2, 1e-30))
        density /= 4.0 * self.view[2] * (1.0 + smith_lambda(self.view[2], np.sqrt(squared)))
        return density
