# SPDX-License-Identifier: GPL-3.0-or-later
"""Highlights of rough surfaces: facets by GGX, shadowed by Smith (Walter et al. 2007, Heitz 2014)."""

from __future__ import annotations

from functools import cache

import numpy as np

from ..projection.typing import Array
from .materials.glossy import EVEN, passed_on, visible_facets
from .materials.place import dot
from .typing import Single

# The mean of Schlick's (1 - cos)⁵ over the hemisphere.
SCHLICK_MEAN = 1.0 / 21.0
# Steps of roughness and of the cosine in the table of mean reflectance, and draws for each.
ROUGH_STEPS, COSINES, DRAWS = 24, 16, 256
# Cosine to the viewer below which a surface counts as seen edge-on.
EDGE_ON = np.float32(1e-4)
TINY = np.float32(1e-30)


def facets(lit: Single, facing: Single, between: Single, alpha: Single) -> tuple[Single, Single]:
    """Radiance of a white surface by irradiance, (N,), and Schlick's share of grazing light, (N,).

    lit, facing, between: (N,) of the angles from normal to lamp, not below 0, from normal to viewer, and from
    lamp to viewer. alpha: (N,) or (1,), the square of GGX's α. Of what is turned away from the lamp any
    number comes out.
    """
    facing = np.maximum(facing, EDGE_ON)
    # Half the square of the half vector's length, which is all that counts of it.
    half = 1 + between
    np.maximum(half, TINY, out=half)
    spread = lit + facing
    spread *= spread
    spread /= half
    np.minimum(spread, 2, out=spread)
    spread *= np.float32(0.5) * (alpha - 1)
    spread += 1
    spread *= spread
    rest = 1 - alpha
    # Never below EDGE_ON · α, so that nothing is divided by 0.
    masked = _masking(lit, alpha, rest)
    masked *= facing
    other = _masking(facing, alpha, rest)
    other *= lit
    masked += other
    spread *= masked
    density = np.divide(alpha * np.float32(0.5 / np.pi), spread, out=spread)
    grazing = np.sqrt(half, out=half)
    grazing *= np.float32(-np.sqrt(0.5))
    grazing += 1
    fourth = np.multiply(grazing, grazing, out=other)
    fourth *= fourth
    grazing *= fourth
    return density, grazing


def _masking(cosine: Single, alpha: Single, rest: Single) -> Single:
    """The root that Smith's masking has for a cosine, (N,)."""
    root = cosine * cosine
    root *= rest
    root += alpha
    return np.sqrt(root, out=root)


def sent_again(reflected: Array, white: Array) -> Array:
    """Share of the light that facets send to each other which leaves the surface in the end.

    reflected: mean reflectance of a facet. white: see ``mean_reflectance``. As in Cycles (Kulla, Conty 2017).
    """
    share: Array = reflected * white / (1.0 - reflected * (1.0 - white))
    return share


def reflection(
    front: Array, edge: Array | float, roughness: Array, multiple: Array | float
) -> tuple[Array, Array, Array]:
    """Reflectance of facets head-on, what comes to it where light grazes them, and the mean of it all.

    Each (M,) or (3, M), with what facets send on to each other. front: of a facet. edge: share by which
    grazing light makes it white. roughness, multiple: as in ``Materials``.
    """
    more = (1.0 - front) * edge
    white, grazing = mean_reflectance(roughness)
    again = 1.0 + multiple * sent_again(front + more * SCHLICK_MEAN, white) * (1.0 / white - 1.0)
    return front * again, more * again, (front * white + more * grazing) * again


def mean_reflectance(roughness: Array) -> tuple[Array, Array]:
    """What facets (n,) reflect at once in even light, as a mean over where they are seen from, (n,) each.

    Of white ones, and of those that reflect by Schlick's (1 - cos)⁵.
    """
    # Not by clip, which leaves NaN as it is.
    place = np.fmin(np.fmax(roughness, 0.0), 1.0) * (ROUGH_STEPS - 1)
    below = np.minimum(place.astype(np.intp), ROUGH_STEPS - 2)
    # Only steps that some material lies between: a scene has few, and each takes as long as 10,000 hits.
    wanted = np.zeros(ROUGH_STEPS, bool)
    wanted[below] = wanted[below + 1] = True
    table = np.zeros((2, ROUGH_STEPS))
    for step in np.flatnonzero(wanted):
        table[:, step] = _means(int(step))
    share = place - below
    white, grazing = table[:, below] * (1.0 - share) + table[:, below + 1] * share
    return white, grazing


@cache
def _means(step: int) -> tuple[float, float]:
    """As ``mean_reflectance``, of the roughness ``step`` / (ROUGH_STEPS - 1)."""
    if step == 0:
        return 1.0, SCHLICK_MEAN
    share = np.tile((np.arange(DRAWS)[:, None] * EVEN % 1.0).T, COSINES)
    # As much of a surface is seen under a cosine as that is.
    cosine = np.sqrt((np.arange(COSINES) + 0.5) / COSINES).repeat(DRAWS)
    view = np.stack([np.sqrt(1.0 - cosine**2), 0.0 * cosine, cosine])
    alpha = np.full_like(cosine, (step / (ROUGH_STEPS - 1)) ** 2)
    facet = visible_facets(view, alpha, share)
    way = 2.0 * dot(facet, view) * facet - view
    passed = passed_on(view, way, alpha)
    return float(passed.mean()), float((passed * (1.0 - dot(facet, view)[0]) ** 5).mean())
